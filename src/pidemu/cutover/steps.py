"""The steps of a cut-over, as sentences for the technician."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from pidemu.cutover.bench import Bench
from pidemu.cutover.trials import LONGEST, Cut, Way
from pidemu.units import Role


@dataclass(frozen=True, slots=True)
class Step:
    """One thing to do at the cut-over.

    Attributes
    ----------
    do : str
        What, in a sentence for the technician.
    set : mapping of str to float
        What is set, by name with its unit in brackets; empty where only a mode changes or time passes.
    """

    do: str
    set: Mapping[str, float]


def steps(bench: Bench, way: Way, cut: Cut) -> Iterator[Step]:
    """Yield what to do, in order."""
    back = way.sp != bench.sp
    if not bench.a.setpoint.tracks:
        given = bench.measured.given(way.sp)
        why = ", the measurement" if back else ""
        yield Step(f"set the target's setpoint to {bench.measured.text(way.sp)}{why}", {f"SP [{bench.measured.unit}]": given})
    if way.bias is not None:
        yield _bias(bench, way.bias)
    yield _manual(bench, way)
    yield from _wait(bench, way, cut)
    if way.load is not None:
        yield _load(bench, way.load, cut)
    if way.integral is not None:
        yield _integral(bench, way.integral, cut)
    if way.entry is None or not bench.gain:
        yield Step("let its next output go to the valve", {})
    else:
        yield Step("switch the target to automatic", {})
    if back:
        moves = f"{bench.out.move(cut.kick):.6g} {bench.out.unit}"
        yield Step(
            f"after its first automatic scan give it the setpoint of {bench.measured.text(bench.sp)}: "
            f"the output then moves by {moves} in one scan",
            {f"SP [{bench.measured.unit}]": bench.measured.given(bench.sp)},
        )


def _wait(bench: Bench, way: Way, cut: Cut) -> Iterator[Step]:
    """Yield how long it stays there, where one scan is not enough or is needed (section 6, tracked)."""
    how = "let it compute so" if way.entry is None else "leave it so"
    if cut.waited is None:
        yield Step(f"{how} until its filters and differences have settled, more than {LONGEST * bench.scan:.6g} s", {})
    elif cut.waited > 1 or bench.a.transfer.way.tracks:
        why = "its integral follows the output" if cut.waited == 1 else "its filters and differences settle"
        count = f"{cut.waited} scan{'s' * (cut.waited > 1)}"
        yield Step(f"{how} for at least {cut.waited * bench.scan:.6g} s ({count}), in which {why}", {})


def _manual(bench: Bench, way: Way) -> Step:
    """Return how the valve stays where it is until the transfer (section 6)."""
    op = bench.out.text(bench.op)
    if way.entry is None:
        return Step(
            f"hold the valve at {op} from outside, and let the target compute without using its output: it has no manual", {}
        )
    if not bench.gain:
        return Step(f"hold the valve at {op} from outside, and switch the target off: its output is then 0", {})
    if bench.a.transfer.manual_output == "gain-times-operator":
        return Step(
            f"put the target in manual and enter {way.entry:.6g}: its output is that times {bench.gain:.6g}, its gain: {op}",
            {f"manual entry [{bench.out.unit}]": way.entry},
        )
    return Step(f"put the target in manual with output {op}", {f"OP [{bench.out.unit}]": bench.out.given(bench.op)})


def _bias(bench: Bench, bias: float) -> Step:
    dial, why = bench.settings.by_role(Role.BIAS), "the output less the proportional term"
    if dial is not None:
        value = bench.on_dial(dial, bias)
        return Step(f"set {dial.name}, the bias, to {value:.6g} {dial.unit}: {why}", {f"{dial.name} [{dial.unit}]": value})
    return Step(
        f"give the target a bias of {bench.out.text(bias)}, as manual reset or added behind the block: {why}",
        {f"bias [{bench.out.unit}]": bench.out.given(bias)},
    )


def _load(bench: Bench, load: float, cut: Cut) -> Step:
    more = f"{bench.out.move(cut.proportional):.6g} {bench.out.unit}"
    return Step(
        f"load the integral with {bench.out.text(load)}, and not with the output of {bench.out.text(bench.op)}: the proportional "
        f"term of {more} comes on top",
        {f"load [{bench.out.unit}]": bench.out.given(load)},
    )


def _integral(bench: Bench, integral: float, cut: Cut) -> Step:
    own = "% of span" if bench.out.rescaled else bench.out.unit
    held = {"ki e": "", "e/Ti": ", divided by the gain", "e": ", divided by the gain and times the integral time"}[
        bench.a.integral.holds
    ]
    after = "once it is on, and before its first scan, " if bench.a.transfer.way.clears else ""
    return Step(
        f"{after}set its integral to {integral:.6g} {bench.unit}: the output of {bench.op:.6g} {own} less the proportional term of "
        f"{cut.proportional:.6g} {own}{held}; the derivative is 0 at rest",
        {f"I [{bench.unit}]": integral},
    )
