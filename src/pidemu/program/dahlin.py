"""Dahlin's pole-cancellation algorithm: a recursion on its own past outputs (section 4)."""

from __future__ import annotations

from pidemu.algorithm.model import Algorithm
from pidemu.program import output
from pidemu.program.blocks import Builder
from pidemu.program.ir import select
from pidemu.program.terms import Terms


def dahlin(b: Builder, a: Algorithm, h: float, sign: float, t: Terms) -> None:
    """Add ``u_n = q u_(n-1) + (1 - q) u_(n-N-1) + g (e_n - p e_(n-1))``, on limited outputs; bumpless at a transfer.

    Written for increments, so that at rest nothing is left to rounding: ``u_n = u_(n-1) + (1 - q)(u_(n-N-1) - u_(n-1)) + ...``.

    Raises
    ------
    ScanError
        The dead time is more than a thousand scans, or a time is too long for the interval.
    """
    assert a.dahlin is not None
    g, p, q, delay = a.dahlin.numbers(h)
    manual = output.by_hand(b, a, t.u)
    last = output.kept(b, a, t.u)
    past = [b.state(f"u{n}", f"output {n + 1} scans ago") for n in range(1, delay + 1)]
    for state in past:
        b.let(state.id, select(b.fresh, last, state), "before the first scan the output was the initial one")
    e1 = b.state("e1", "error at the last scan")
    gain, pole = b.coefficient("g", sign * g, "gain on the error", "%/%"), b.coefficient("p", p, "pole of the process", "-")
    oldest = past[-1] if past else last
    moved = gain * (t.w - pole * e1)
    if past:
        moved = b.coefficient("q_rest", 1 - q, "share of the output before the dead time", "-") * (oldest - last) + moved
    du = b.let("du", select(t.on, moved, 0.0), "increment, pole cancellation (section 4); none at a transfer")
    b.let("e1", t.w, "kept for the next scan")
    v = b.let("v", last + du, "last output and increment")
    for n in reversed(range(delay)):
        b.let(past[n].id, past[n - 1] if n else last, "shift the history of outputs")
    output.of_sum(b, a, h, t, v, last, manual)
