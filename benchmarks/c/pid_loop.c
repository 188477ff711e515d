#include "pid_loop.h"

/* States that decay would end as denormal numbers, which make an operation many times slower. */
#define TINY 1e-300
#define FLUSHED(x) (((x) > -TINY) & ((x) < TINY) ? 0.0 : (x))

void run_one(const pid_loop_settings *settings, pid_loop_state *state, size_t n, const double *restrict sp,
             const double *restrict load, double *restrict y, double *restrict u)
{
    const pid_loop_settings s = *settings;
    double integral = state->integral, derivative = state->derivative, y_last = state->y_last;
    double x = state->x, was = state->was;
    double *restrict ring = state->ring;
    size_t at = state->at;
    for (size_t i = 0; i < n; i++) {
        const double pv = s.y_rest + s.row * x;
        const double e = sp[i] - pv;
        const double P = s.kp * e;
        const double D = s.d_decay * derivative + s.d_gain * (pv - y_last);
        derivative = FLUSHED(D);
        y_last = pv;
        const double dI = s.ki_h * e;
        const double grown = integral + dI;
        const double wanted = P + grown + derivative;
        if (!((wanted > s.high && dI > 0.0) || (wanted < s.low && dI < 0.0)))
            integral = grown;
        const double v = P + integral + derivative;
        const double out = v > s.high ? s.high : v < s.low ? s.low : v;
        y[i] = pv;
        u[i] = out;
        ring[at] = out - s.u_rest + load[i];
        at = at < s.delay ? at + 1 : 0;
        const double now = ring[at];
        const double moved = x + (s.growth * x + s.early * was + s.late * now);
        x = FLUSHED(moved);
        was = now;
    }
    state->integral = integral;
    state->derivative = derivative;
    state->y_last = y_last;
    state->x = x;
    state->was = was;
    state->at = at;
}

/* One scan of all controllers; what enters the processes is returned in `entering`. */
static inline void control(const pid_block_settings *restrict s, pid_block_state *restrict state, double scan, double *restrict y,
                           double *restrict u, double *restrict entering)
{
    for (size_t i = 0; i < PID_LOOPS; i++) {
        const double pv = s->y_rest[i] + s->row[i] * state->x[i];
        const double sp_step = s->sp_step[i], load_step = s->load_step[i]; /* read in any case: no branches */
        const double e = s->sp[i] + (scan >= s->sp_at[i] ? sp_step : 0.0) - pv;
        const double P = s->kp[i] * e;
        const double D = s->d_decay[i] * state->derivative[i] + s->d_gain[i] * (pv - state->y_last[i]);
        const double derivative = FLUSHED(D);
        const double dI = s->ki_h[i] * e;
        const double last = state->integral[i];
        const double grown = last + dI;
        const double wanted = P + grown + derivative;
        const double high = s->high[i], low = s->low[i];
        const double integral = ((wanted > high) & (dI > 0.0)) | ((wanted < low) & (dI < 0.0)) ? last : grown;
        const double v = P + integral + derivative;
        const double raised = v < low ? low : v;
        const double out = v > high ? high : raised;
        state->derivative[i] = derivative;
        state->y_last[i] = pv;
        state->integral[i] = integral;
        y[i] = pv;
        u[i] = out;
        entering[i] = out - s->u_rest[i] + (scan >= s->load_at[i] ? load_step : 0.0);
    }
}

/* One scan of all processes with what leaves the dead times. */
static inline void move(const pid_block_settings *restrict s, pid_block_state *restrict state, const double *restrict leaving)
{
    for (size_t i = 0; i < PID_LOOPS; i++) {
        const double x = state->x[i];
        const double moved = x + (s->growth[i] * x + s->early[i] * state->was[i] + s->late[i] * leaving[i]);
        state->x[i] = FLUSHED(moved);
        state->was[i] = leaving[i];
    }
}

void run_block(const pid_block_settings *settings, pid_block_state *state, size_t n, double *y, double *u)
{
    double unwanted[2][PID_LOOPS], leaving[PID_LOOPS];
    const size_t last = state->rows - 1; /* a mask: the number of rows is a power of two */
    const size_t first = state->scans;
    for (size_t k = 0; k < n; k++) {
        const size_t scan = first + k;
        control(settings, state, (double)scan, y ? y + k * PID_LOOPS : unwanted[0], u ? u + k * PID_LOOPS : unwanted[1],
                state->ring + (scan & last) * PID_LOOPS);
        for (size_t i = 0; i < PID_LOOPS; i++)
            leaving[i] = state->ring[((scan - settings->delay[i]) & last) * PID_LOOPS + i];
        move(settings, state, leaving);
    }
    state->scans = first + n;
}
