"""From the sum of the terms to the output: filter, feedforward, limits, rate limit, deadband, resolution, mode."""

from __future__ import annotations

from pidemu.algorithm.model import Algorithm
from pidemu.program import blocks
from pidemu.program.blocks import Builder
from pidemu.program.ir import Expr, Name, equal, select
from pidemu.program.terms import Terms


def lagged(b: Builder, a: Algorithm, h: float, x: Expr, what: str) -> Expr:
    """Return the output, or its increment, behind the filter if there is one; it starts afresh at a transfer."""
    if not (a.has_signal_filter and a.filter_on == "output"):
        return x
    return blocks.lag(b, x, equal(Name("on"), 0.0), a.Tf, h, a.filter_rule, a.filter_order, what)


def feedforward(b: Builder, a: Algorithm) -> Expr | None:
    """Return the feedforward term, where the program reads that signal (section 6)."""
    if a.feedforward is None or not b.has("feedforward"):
        return None
    gain = b.coefficient("kff", a.feedforward.gain, "feedforward gain", "%/%")
    return b.let("FF", gain * Name("feedforward"), "feedforward")


def within_limits(b: Builder, a: Algorithm, h: float, t: Terms, v: Expr, last: Expr, after: Expr | None = None) -> Expr:
    """Return the sum within the output limits and the rate limit (sections 5 and 8).

    Parameters
    ----------
    b : Builder
        The program under construction.
    a : Algorithm
        For the rate limit.
    h : float
        Scan interval [s].
    t : Terms
        For the limits.
    v : Expr
        The sum.
    last : Expr
        The last output, before deadband and resolution.
    after : Expr, optional
        Feedforward that is added to the limited sum, which is then limited again.
    """
    out: Expr = b.let("out", blocks.limited(v, t.low, t.high), "output limits (section 5)")
    if after is not None:
        total = b.let("out", out + after, "feedforward on the limited output (section 6)")
        out = b.let("out", blocks.limited(total, t.low, t.high), "output limits (section 5)")
    if a.output.rate is not None:
        reach = b.coefficient("u_reach", a.output.rate * h, "fastest change of the output in one scan", "%")
        out = b.let("out", blocks.towards(out, last, reach, reach), "output rate limit (section 8)")
        out = b.let("out", blocks.limited(out, t.low, t.high), "the operator may have been beyond the limits")
    return out


def stepped(b: Builder, a: Algorithm, t: Terms, out: Expr) -> Expr:
    """Return the output behind deadband and resolution: what the rest of the controller does not see (sections 7 and 8)."""
    if a.output.deadband:
        width = b.coefficient("u_band", a.output.deadband, "output deadband", "%")
        out = b.let(
            "out_d",
            select(blocks.magnitude(out - t.u) > width, out, blocks.limited(t.u, t.low, t.high)),
            "output deadband (section 8)",
        )
    if a.output.resolution:
        step = b.coefficient("u_step", a.output.resolution, "output resolution", "%")
        out = b.let("out_s", blocks.limited(blocks.rounded(out, step), t.low, t.high), "output resolution (section 7)")
    return out


def kept(b: Builder, a: Algorithm, u: Name) -> Name:
    """Return the last output as the algorithm knows it: its own, where the real one is rounded or not used in manual."""
    if a.transfer.way.runs_on or a.output.deadband or a.output.resolution:
        own = b.state("own", "last output as the algorithm knows it")
        b.let("own", select(b.fresh, u, own), "start at the initial output")
        return own
    return u


def finish(b: Builder, out: Expr, manual: Expr) -> None:
    """Choose between the algorithm's output and the operator's, and keep the mode (section 6)."""
    b.let("u", select(b.automatic, out, manual), "output")
    b.let("on", select(b.automatic, 1.0, 0.0), "mode, kept for the next scan")
    b.let("begun", 1.0, "there has been a scan")


def of_sum(b: Builder, a: Algorithm, h: float, t: Terms, v: Expr, last: Name, manual: Expr) -> None:
    """Take a sum whose increments count from the last output through limits and steps to the output, and keep it."""
    out = within_limits(b, a, h, t, v, last)
    final = stepped(b, a, t, out)
    if last is not t.u:
        b.let(last.id, select(b.automatic, out, manual), "output as the algorithm knows it")
    finish(b, final, manual)


def by_hand(b: Builder, a: Algorithm, u: Expr) -> Expr:
    """Return the output of this scan if it is not an automatic one (section 6)."""
    if a.transfer.manual_output == "zero":
        manual: Expr = b.let("man", 0.0, "no output in manual (section 6)")
    elif a.transfer.manual_output == "gain-times-operator":
        gain = b.coefficient("kp_manual", a.action.gain_sign * a.kp, "gain on the operator's output", "-")
        given = Name("manual")
        manual = b.let("man", select(equal(given, given), gain * given, u), "the operator's output times the gain (section 6)")
    else:
        manual = b.let("man", blocks.held(Name("manual"), u), "the operator's output; held where none is set (section 6)")
    if b.has("track"):
        track = Name("track")
        manual = b.let("man", select(equal(track, track), track, manual), "tracking: the output follows (section 6)")
    return manual
