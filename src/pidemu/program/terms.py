"""What every implementation starts from: the signals as the algorithm sees them, and the terms P and D (sections 2, 4 and 8)."""

from __future__ import annotations

from dataclasses import dataclass

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.signals import ErrorShape
from pidemu.program import blocks
from pidemu.program.blocks import Builder
from pidemu.program.ir import Expr, Name, equal, select


@dataclass(frozen=True, slots=True)
class Signals:
    """Setpoint, measurement and error as the algorithm sees them.

    Attributes
    ----------
    r, y, e : Expr
        Setpoint, measurement and error, filtered.
    shaped : Expr
        The error as P and I use it.
    cascade : Expr or None
        Whether the loop is in cascade.
    """

    r: Expr
    y: Expr
    e: Expr
    shaped: Expr
    cascade: Expr | None


@dataclass(frozen=True, slots=True)
class Terms:
    """The expressions that positional and velocity implementation share.

    Attributes
    ----------
    signals : Signals
        What the terms act on.
    P : Expr
        Proportional term, without gain where the gain is applied to the sum.
    D : Expr or None
        Derivative term, likewise.
    w : Expr
        Signal of the integral.
    low, high : Name
        Output limits.
    u : Name
        Last output.
    on : Expr
        Whether the last scan was automatic.
    fresh : Expr
        Whether filters and differences start afresh.
    """

    signals: Signals
    P: Expr
    D: Expr | None
    w: Expr
    low: Name
    high: Name
    u: Name
    on: Expr
    fresh: Expr


def terms(b: Builder, a: Algorithm, h: float, limits: tuple[float, float], initial_output: float) -> Terms:
    """Filter the signals and compute P, D and the signal that the integral acts on (sections 2, 4 and 8)."""
    low = b.coefficient("low", limits[0], "low output limit", "%")
    high = b.coefficient("high", limits[1], "high output limit", "%")
    u = b.state("u", "last output", "%", initial_output)
    on = b.state("on", "automatic in the last scan", "-") > 0.0
    fresh = equal(Name("on"), 0.0) if a.transfer.derivative == "restarted" else b.fresh
    s = _signals(b, a, h, fresh)
    outside = not a.has_gain_on_sum
    if a.kp:
        with_gain = outside and not a.velocity  # increments are those of the signal, so that a changed gain acts on them alone
        P: Expr = b.let("P", _proportional(b, a, s, with_gain, fresh), "proportional term" if with_gain else "signal of P")
    else:
        P = b.let("P", 0.0, "no proportional term")
    D = None
    if a.kd:
        D = _derivative(b, a, s, fresh, a.kd if outside else a.kd / a.kp, h)
    w = s.e if a.is_shaped and not a.shapes_integral else s.shaped
    if a.series and D is not None and a.ki:
        per_gain = b.coefficient("per_kp", 1 / a.kp, "1/kp", "-")
        w = b.let("w", w + per_gain * D, "signal of the integral: series form (section 2)")
    return Terms(s, P, D, w, low, high, u, on, fresh)


def _signals(b: Builder, a: Algorithm, h: float, fresh: Expr) -> Signals:
    cascade = equal(Name("cascade"), Name("cascade")) & b.automatic if b.has("cascade") else None
    y = _measurement(b, a, h, fresh)
    r = _setpoint(b, a, h, fresh, cascade)
    e: Expr = b.let("e", r - y, "error")
    if a.error.filter is not None:
        e = blocks.signal_lag(b, e, fresh, a.error.filter, h, "e_in")
    shaped = e if not a.is_shaped else blocks.shaped(b, e, fresh, a.error, "e")
    return Signals(r, y, e, shaped, cascade)


def _measurement(b: Builder, a: Algorithm, h: float, fresh: Expr) -> Expr:
    y: Expr = Name("pv")
    if a.measurement.previous_scan:
        last = b.state("pv_was", "measurement of the previous scan")
        late = b.let("pv_late", select(fresh, y, last), "measurement of the previous scan (section 4)")
        b.let("pv_was", y, "kept for the next scan")
        y = late
    if a.measurement.filter is not None:
        y = blocks.signal_lag(b, y, fresh, a.measurement.filter, h, "pv_in")
    if a.has_signal_filter and a.filter_on == "measurement":
        y = blocks.lag(b, y, fresh, a.Tf, h, a.filter_rule, a.filter_order, "pv")
    return y


def _setpoint(b: Builder, a: Algorithm, h: float, fresh: Expr, cascade: Expr | None) -> Expr:
    """Return the setpoint as the algorithm sees it: remote or local, tracking, rate limit, filter (sections 6 and 8)."""
    r: Expr = Name("sp")
    if a.setpoint.tracks:
        local, given = b.state("sp_own", "setpoint in force"), b.state("sp1", "setpoint given at the last scan")
        stays = equal(r, given)
        start = select(b.fresh, r, select(stays, local, r))
        b.let(
            local.id,
            select(b.automatic, start, Name("pv")),
            "setpoint: follows the measurement in manual, stays until it is changed (section 6)",
        )
        b.let(given.id, r, "kept for the next scan")
        r = local
    if cascade is not None:
        r = b.let("r", select(cascade, Name("cascade"), r), "in cascade the remote setpoint (section 6)")
    if a.setpoint.rate is not None or a.setpoint.fall is not None:
        r = _rate_limited(b, a, h, r, cascade)
    if a.setpoint.filter is not None:
        r = blocks.signal_lag(b, r, fresh, a.setpoint.filter, h, "sp_in")
    return r


def _rate_limited(b: Builder, a: Algorithm, h: float, r: Expr, cascade: Expr | None) -> Expr:
    """Return the setpoint behind its rate limit (section 8)."""
    last = b.state("r1", "limited setpoint of the last scan")
    if a.setpoint.starts != "zero":
        b.let(last.id, select(b.fresh, r, last), "start at the first setpoint")
    what = "fastest change of the setpoint in one scan"
    rise, fall = a.setpoint.rate, a.setpoint.fall
    up = None if rise is None else b.coefficient("r_reach", rise * h, what, "%")
    down = up
    if fall != rise:
        what = "fastest fall of the setpoint in one scan"
        down = None if fall is None else b.coefficient("r_fall", fall * h, what, "%")
    within = blocks.towards(r, last, up, down)
    if a.setpoint.rate_counts == "local" and cascade is not None:
        within = select(cascade, r, within)
    return b.let(last.id, within, "setpoint rate limit (section 8)")


def _weighted(b: Builder, weight: float, name: str, s: Signals) -> Expr:
    """Return ``weight*r - y``; the weight is not 0."""
    return s.e if weight == 1 else b.coefficient(name, weight, "setpoint weight", "-") * s.r - s.y


def proportional_signal(b: Builder, a: Algorithm, s: Signals, fresh: Expr) -> Expr:
    """Return what P acts on, signed as ``b r - y`` (sections 2 and 8)."""
    weight = 1.0 if a.error.filter is not None else a.b
    x = _shaped_signal(b, a.error if a.shapes_proportional else None, s, fresh, weight, "b")
    if a.cascade_b is not None and s.cascade is not None:
        other = _shaped_signal(b, a.error if a.shapes_in_cascade else None, s, fresh, a.cascade_b, "b_cascade")
        x = b.let("x_P", select(s.cascade, other, x), "signal of P: another structure in cascade (section 6)")
    return x


def _shaped_signal(b: Builder, shape: ErrorShape[float] | None, s: Signals, fresh: Expr, weight: float, name: str) -> Expr:
    """Return ``weight*r - y``, shaped where the card shapes the error of P."""
    if shape is not None and weight == 1:
        return s.shaped
    x: Expr = 0.0 - s.y if weight == 0 else _weighted(b, weight, name, s)
    return x if shape is None else blocks.shaped(b, b.let(f"x_{name}", x, "signal of P"), fresh, shape, f"e_{name}")


def _proportional(b: Builder, a: Algorithm, s: Signals, outside: bool, fresh: Expr) -> Expr:
    if outside and a.b == 0 and not a.shapes_proportional and (a.cascade_b is None or s.cascade is None):
        return b.coefficient("minus_kp", -a.kp, "proportional gain on PV, signed for action", "%/%") * s.y
    x = proportional_signal(b, a, s, fresh)
    return b.coefficient("kp", a.kp, "proportional gain, signed for action", "%/%") * x if outside else x


def _derivative(b: Builder, a: Algorithm, s: Signals, fresh: Expr, gain: float, h: float) -> Expr:
    x, kd = (s.y, -gain) if a.c == 0 else (_weighted(b, a.c, "c", s), gain)
    x = x if isinstance(x, Name) else b.let("x", x, "signal of the derivative")
    return blocks.derivative(b, x, fresh, a, kd, a.Tf if a.has_term_filter else 0.0, h)
