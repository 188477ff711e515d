"""What a plan for the cut-over rests on, and what it cannot avoid: its notes, as sentences."""

from __future__ import annotations

from collections.abc import Iterator

from pidemu.card.model.base import Evidence, Status
from pidemu.cutover.takeover import Takeover
from pidemu.cutover.trials import LONGEST, Cut, Way, is_none, resolution
from pidemu.units import Role


def notes(new: Takeover, way: Way, cut: Cut) -> Iterator[str]:
    """Yield what the plan rests on, and what it cannot avoid and why."""
    card = new.settings.card.id
    yield _what_starts(new, way, card)
    yield from _start_evidence(new)
    if new.entry is None:
        yield "without the plan means that the first scan it ever makes goes to the valve"
    yield from _preset(new, way, card)
    if way.bias is not None and new.settings.by_role(Role.BIAS) is None:
        yield f"{card} names no setting for a bias; without it the output moves as without the plan"
    if cut.increment:
        yield f"{_increment(new, cut)}: that is control, not a bump"
    if way.sp != new.sp:
        follows = (
            "in manual its setpoint follows the measurement, and stays there"
            if new.a.setpoint.tracks
            else "it starts at an error of 0"
        )
        yield f"{follows}; giving the setpoint back moves the output by {new.out.percent(cut.kick):.6g} % of span in one scan"
    if cut.waited is None:
        yield f"its filters and differences have not settled after {LONGEST} scans; the bump is the one at that moment"
    if new.a.arithmetic.type != "float64":
        yield f"{new.a.arithmetic.type} arithmetic: {resolution(new, cut):.2g} % of span is its rounding, not a bump"
    ranges = (new.settings.pv_range, new.settings.op_range)
    if new.settings.equation.signals == "engineering" and None in ranges:
        yield f"{card} computes in engineering units, and not all ranges were given: spans not given are taken as 100"
    yield from _left(new, cut, card)


def _increment(new: Takeover, cut: Cut) -> str:
    """Return what the integral does in a scan; which way only where the action is known."""
    size = f"{abs(new.out.percent(cut.increment)):.6g} % of span per scan"
    if not new.action_known:
        return f"the integral moves the output by {size}, up or down according to the action"
    return f"the integral {'raises' if cut.increment > 0 else 'lowers'} the output by {size}"


def _what_starts(new: Takeover, way: Way, card: str) -> str:
    if new.increments:
        return f"{card} adds increments to the last output, and makes none in the first automatic scan: there is nothing to preset"
    if new.is_bare and way.integral is None and (not new.a.transfer.way.loads_output or new.a.transfer.without_integral != "kept"):
        return f"{card} has no integral action here: its output is P, D and a bias, whatever it was before"
    return f"at the transfer {card} {new.a.transfer.way.of_a_controller}"


def _evidence(new: Takeover, path: str) -> Evidence | None:
    """Return what a field of the card rests on; ``None`` where the card leaves the field out."""
    return next((s.evidence for s in new.settings.variant.statements if s.path == path), None)


def _start_evidence(new: Takeover) -> Iterator[str]:
    """Yield how sure the card is of its transfer, where it is not stated."""
    found = _evidence(new, "transfer.start")
    if found is not None and found.status in (Status.ASSUMED, Status.INFERRED):
        yield f"that is {found.status.value}, not stated: {found.note}"


def _preset(new: Takeover, way: Way, card: str) -> Iterator[str]:
    """Yield whether the card states that what the plan sets can be set (``transfer.preset``)."""
    found = _evidence(new, "transfer.preset")
    where = "" if found is None else f"{found.status.value}: {found.at or found.note}"
    if way.load is not None:
        yield f"{card} can be given another value to load than its output ({where})"
    elif way.integral is None:
        if new.preset == "none" and _detour(new, way):
            yield f"{card} does not state that anything but its output can be loaded, so the setpoint is moved instead"
    elif new.preset == "integral":
        yield f"the integral of {card} can be set ({where})"
    elif new.preset == "initial":
        yield (
            f"the integral of {card} can be set for its first scan of all, not later ({where}); its filters and differences then "
            "begin with that scan as well, and what they add comes on top"
        )
    else:
        yield f"{card} does not state where its integral is set; where that cannot be done, the output moves as without the plan"


def _detour(new: Takeover, way: Way) -> bool:
    """Tell whether the setpoint is moved because the integral is loaded with the output."""
    loads = new.a.transfer.way.loads_output and (new.a.ki != 0 or new.a.transfer.without_integral == "kept")
    return loads and not new.a.setpoint.tracks and way.sp != new.sp


def _left(new: Takeover, cut: Cut, card: str) -> Iterator[str]:
    """Yield why the output moves all the same."""
    if is_none(new, cut):
        return
    bump = new.out.percent(cut.bump)
    if new.is_bare and new.a.transfer.without_integral != "kept":
        yield f"a bump of {bump:.6g} % of span remains: without integral action {card} keeps nothing that would hold the output; " \
            f"a constant of {-new.out.move(cut.bump):.6g} {new.out.unit} added behind it would"  # fmt: skip
    else:
        yield f"a bump of {bump:.6g} % of span remains: the output limits, the limits of the integral or the setpoint weights of " \
            f"{card} leave no room for what the output needs"  # fmt: skip
