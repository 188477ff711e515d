/*
 * A closed loop written by hand, to compare with: a positional PID in parallel form and a first-order process with dead time.
 *
 *   e = sp - y,  P = kp e,  D = d_decay D + d_gain (y - y_1)          derivative of the measurement, filtered, backward
 *   I grows by ki_h e, but not further beyond a limit                 conditional integration
 *   u = P + I + D within [low, high]
 *   x += growth x + early w_(n-d-1) + late w_(n-d),  y = y_rest + row x,  w = u - u_rest + load
 *
 * Build with -O3 -march=x86-64-v2 (or native) -ffp-contract=off -fno-trapping-math; the last one lets the compiler compute both sides
 * of a choice, and changes no bits.
 */
#ifndef PID_LOOP_H
#define PID_LOOP_H

#include <stddef.h>

typedef struct {
    double kp, ki_h;         /* gain; integral gain times the scan interval, signed for action [%/%] */
    double d_decay, d_gain;  /* of the filtered derivative; d_gain has the sign of -kp [-] */
    double low, high;        /* output limits [%] */
    double growth, early, late, row; /* the sampled process */
    double y_rest, u_rest;   /* measurement and output at rest [%] */
    size_t delay;            /* whole scans of dead time */
} pid_loop_settings;

typedef struct {
    double integral, derivative, y_last; /* of the controller [%] */
    double x, was;           /* of the process, and what reached it in the last scan */
    double *ring;            /* on the way: delay + 1 numbers, zeros at first */
    size_t at;               /* where in the ring the next one goes */
} pid_loop_state;

/* n scans with setpoint and load given; measurement and output returned [%]. */
void run_one(const pid_loop_settings *settings, pid_loop_state *state, size_t n, const double *sp, const double *load, double *y,
             double *u);

#define PID_LOOPS 64

/* As above for loops side by side, with a step of setpoint and load each: from scan ..._at on (counted from 0, a whole number). */
typedef struct {
    double kp[PID_LOOPS], ki_h[PID_LOOPS], d_decay[PID_LOOPS], d_gain[PID_LOOPS], low[PID_LOOPS], high[PID_LOOPS];
    double growth[PID_LOOPS], early[PID_LOOPS], late[PID_LOOPS], row[PID_LOOPS], y_rest[PID_LOOPS], u_rest[PID_LOOPS];
    double sp[PID_LOOPS], sp_step[PID_LOOPS], sp_at[PID_LOOPS];
    double load_step[PID_LOOPS], load_at[PID_LOOPS];
    size_t delay[PID_LOOPS];
} pid_block_settings;

typedef struct {
    double integral[PID_LOOPS], derivative[PID_LOOPS], y_last[PID_LOOPS];
    double x[PID_LOOPS], was[PID_LOOPS];
    double *ring;            /* on the way: `rows` rows of PID_LOOPS numbers, zeros at first */
    size_t rows;             /* a power of two, more than the longest dead time has scans */
    size_t scans;            /* done so far */
} pid_block_state;

/* n scans of all loops; y and u have n rows of PID_LOOPS numbers, or are null: not wanted. */
void run_block(const pid_block_settings *settings, pid_block_state *state, size_t n, double *y, double *u);

#endif /* PID_LOOP_H */
