"""The steps of a cut-over, as sentences for the technician."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from pidemu.cutover.takeover import Takeover
from pidemu.cutover.trials import LONGEST, Cut, Way
from pidemu.units import Role


@dataclass(frozen=True, slots=True)
class CutoverStep:
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


def steps(new: Takeover, way: Way, cut: Cut) -> Iterator[CutoverStep]:
    """Yield what to do, in order."""
    back = way.sp != new.sp
    if not new.a.setpoint.tracks:
        given = new.measured.given(way.sp)
        why = ", the measurement" if back else ""
        yield CutoverStep(f"set the target's setpoint to {new.measured.text(way.sp)}{why}", {f"SP [{new.measured.unit}]": given})
    if way.bias is not None:
        yield _bias(new, way.bias)
    yield _manual(new, way)
    yield from _wait(new, way, cut)
    if way.load is not None:
        yield _load(new, way.load, cut)
    if way.integral is not None:
        yield _integral(new, way.integral, cut)
    if way.entry is None or not new.gain:
        yield CutoverStep("let its next output go to the valve", {})
    else:
        yield CutoverStep("switch the target to automatic", {})
    if back:
        moves = f"{new.out.move(cut.kick):.6g} {new.out.unit}"
        yield CutoverStep(
            f"after its first automatic scan give it the setpoint of {new.measured.text(new.sp)}: "
            f"the output then moves by {moves} in one scan",
            {f"SP [{new.measured.unit}]": new.measured.given(new.sp)},
        )


def _wait(new: Takeover, way: Way, cut: Cut) -> Iterator[CutoverStep]:
    """Yield how long it stays there, where one scan is not enough or is needed (section 6, tracked)."""
    how = "let it compute so" if way.entry is None else "leave it so"
    if cut.waited is None:
        yield CutoverStep(f"{how} until its filters and differences have settled, more than {LONGEST * new.scan:.6g} s", {})
    elif cut.waited > 1 or new.a.transfer.way.tracks:
        why = "its integral follows the output" if cut.waited == 1 else "its filters and differences settle"
        count = f"{cut.waited} scan{'s' * (cut.waited > 1)}"
        yield CutoverStep(f"{how} for at least {cut.waited * new.scan:.6g} s ({count}), in which {why}", {})


def _manual(new: Takeover, way: Way) -> CutoverStep:
    """Return how the valve stays where it is until the transfer (section 6)."""
    op = new.out.text(new.op)
    if way.entry is None:
        return CutoverStep(
            f"hold the valve at {op} from outside, and let the target compute without using its output: it has no manual", {}
        )
    if not new.gain:
        return CutoverStep(f"hold the valve at {op} from outside, and switch the target off: its output is then 0", {})
    if new.a.transfer.manual_output == "gain-times-operator":
        return CutoverStep(
            f"put the target in manual and enter {way.entry:.6g}: its output is that times {new.gain:.6g}, its gain: {op}",
            {f"manual entry [{new.out.unit}]": way.entry},
        )
    return CutoverStep(f"put the target in manual with output {op}", {f"OP [{new.out.unit}]": new.out.given(new.op)})


def _bias(new: Takeover, bias: float) -> CutoverStep:
    dial, why = new.settings.by_role(Role.BIAS), "the output less the proportional term"
    if dial is not None:
        value = new.on_dial(dial, bias)
        return CutoverStep(f"set {dial.name}, the bias, to {value:.6g} {dial.unit}: {why}", {f"{dial.name} [{dial.unit}]": value})
    return CutoverStep(
        f"give the target a bias of {new.out.text(bias)}, as manual reset or added behind the block: {why}",
        {f"bias [{new.out.unit}]": new.out.given(bias)},
    )


def _load(new: Takeover, load: float, cut: Cut) -> CutoverStep:
    more = f"{new.out.move(cut.proportional):.6g} {new.out.unit}"
    return CutoverStep(
        f"load the integral with {new.out.text(load)}, and not with the output of {new.out.text(new.op)}: the proportional "
        f"term of {more} comes on top",
        {f"load [{new.out.unit}]": new.out.given(load)},
    )


def _integral(new: Takeover, integral: float, cut: Cut) -> CutoverStep:
    own = "% of span" if new.out.rescaled else new.out.unit
    held = {"ki e": "", "e/Ti": ", divided by the gain", "e": ", divided by the gain and times the integral time"}[
        new.a.integral.holds
    ]
    if new.a.integral.holds == "e" and not new.a.has_gain_on_sum:
        held = ", divided by the integral gain"
    after = "once it is on, and before its first scan, " if new.a.transfer.way.clears else ""
    return CutoverStep(
        f"{after}set its integral to {integral:.6g} {new.unit}: the output of {new.op:.6g} {own} less the proportional term of "
        f"{cut.proportional:.6g} {own}{held}; the derivative is 0 at rest",
        {f"I [{new.unit}]": integral},
    )
