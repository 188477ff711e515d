"""What two controllers do differently at an output limit, as a story with times (specs/equations.md, sections 5 and 9)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from pidemu.card.at_limits import limit_rows
from pidemu.certificate.limit_shift import limit_shift
from pidemu.certificate.models import NonlinearDifference
from pidemu.certificate.recovery import Recoveries, Recovery, recoveries
from pidemu.certificate.sides import Side
from pidemu.certificate.trials import Bench, Plan

_TRACKING: Final = 0.01
"""Relative difference of tracking times that counts."""


def windup_differences(both: tuple[Side, Side], benches: tuple[Bench, Bench], plan: Plan) -> Iterator[NonlinearDifference]:
    """Yield how differently two controllers come back from an output limit, by emulation; nothing where they do not.

    Without integral action in both, what an excursion to a limit and back leaves behind.

    Parameters
    ----------
    both : tuple of Side
        Source and target.
    benches : tuple of Bench
        The same, to be tried.
    plan : Plan
        What is tried.

    Raises
    ------
    ScanError
        One cannot be emulated.
    """
    source, target = both
    scans = source.scan, target.scan
    if not (source.integrates or target.integrates):
        yield from _without_integral(both, scans)
        return
    found = recoveries(benches, plan, scans)
    if not found.differ:
        return
    figures = {
        "at the limit after the error has turned [s]": (found.both[0].stays, found.both[1].stays),
        "output with the error back at zero [% of output span]": (found.both[0].at_zero, found.both[1].at_zero),
    }
    if found.noisy is not None:
        figures["output on the way back from a limit, with noise [% of output span]"] = found.noisy
    yield NonlinearDifference("windup", _story(found, plan, target.integrates), figures)


def _without_integral(both: tuple[Side, Side], scans: tuple[float, float]) -> Iterator[NonlinearDifference]:
    """Yield what a limit leaves behind for good."""
    source, target = both
    gains = [abs(side.settings.law().moments()[1]) for side in both]
    factor = (gains[1] / gains[0] if all(gains) else 1.0) * source.sign * target.sign
    shift = limit_shift(source.settings, target.settings, scans, factor)
    if shift.permanent:
        figures = {"output after an excursion to the limit and back [% of output span]": (shift.source, shift.target)}
        yield NonlinearDifference("windup", shift.text, figures)


def unknown_windup(both: tuple[Side, Side], reason: str) -> Iterator[NonlinearDifference]:
    """Yield what the cards say where the two cannot be emulated and their schemes are not the same.

    Parameters
    ----------
    both : tuple of Side
        Source and target.
    reason : str
        Why they cannot be.
    """
    if not all(side.integrates for side in both) or _same_scheme(*both):
        return
    each = "; ".join(f"{side.name}: {_scheme(side)}" for side in both)
    text = f"Whether the two come back from an output limit alike is not known ({reason}). By their cards: {each}."
    yield NonlinearDifference("windup", text, {})


def _same_scheme(mine: Side, other: Side) -> bool:
    a, b = mine.own, other.own
    alike = (a.windup, a.gate, a.implicit_tracking) == (b.windup, b.gate, b.implicit_tracking)
    return alike and (a.windup != "back-calculation" or math.isclose(a.tracking_time, b.tracking_time, rel_tol=_TRACKING))


def _scheme(side: Side) -> str:
    """Return what happens at a limit, as the data sheet has it."""
    return dict(limit_rows(side.settings.equation))["at a limit"]


def _story(found: Recoveries, plan: Plan, integrates: bool) -> str:
    old, new = found.both
    limit = f"{plan.limits[1]:g} %"
    parts = []
    if found.short:
        parts.append(
            f"After an error of {plan.error:.3g} % for {2 * plan.time:.4g} s the output of the old controller is "
            f"{output_number(old.reached)} %, that of the new one {output_number(new.reached)} %."
        )
    elif found.late:
        parts.append(
            f"With the valve at {limit} and the error reversing, the old controller {_leaves(old, plan)}, the new one "
            f"{_leaves(new, plan).removeprefix('leaves the limit ')}."
        )
    if found.apart:
        first = (
            "With"
            if parts
            else f"With the valve at {limit} and the error reversing, both controllers {_both_leave(old, plan)}, but with"
        )
        then = "; the loop then removes the difference" if integrates else ""
        parts.append(
            f"{first} the error back at zero {3 * plan.time:.4g} s later, the output is {output_number(old.at_zero)} % on the old "
            f"controller and {output_number(new.at_zero)} % on the new one{then}."
        )
    if not parts and found.noisy is not None:
        parts.append(
            f"On the way back from {plan.limits[0]:g} %, along a ramp of PV with noise of {plan.size / 8:.2g} %, the output is "
            f"{output_number(found.noisy[0])} % on the old controller and {output_number(found.noisy[1])} % on the new one, "
            f"{found.noisy_at:.4g} s after PV has begun to come back; on steps without noise they are alike."
        )
    return " ".join(parts)


def output_number(x: float) -> str:
    """Return an output in four digits, without rounding noise about zero."""
    return f"{round(x, 6) + 0.0:.4g}"


def _leaves(r: Recovery, plan: Plan) -> str:
    if math.isinf(r.stays):
        return f"stays there for the {3 * plan.time:.4g} s that this lasts"
    return f"leaves the limit after {r.stays:.4g} s" if r.stays else "leaves the limit at once"


def _both_leave(r: Recovery, plan: Plan) -> str:
    if not r.at_limit:
        return f"come back from {output_number(r.reached)} %"
    return _leaves(r, plan).replace("leaves", "leave", 1).replace("stays", "stay", 1)
