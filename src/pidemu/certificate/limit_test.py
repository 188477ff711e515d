"""What two controllers do differently at an output limit, as a story with times (specs/equations.md, sections 5 and 9)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from pidemu.card.datasheet.at_limits import limit_rows
from pidemu.certificate.limit_shift import limit_shift
from pidemu.certificate.models import NonlinearDifference
from pidemu.certificate.recovery import Recoveries, Recovery, recoveries
from pidemu.certificate.scaled_controller import ScaledController
from pidemu.certificate.trials import TrialPlan, TriedController

_MORE: Final = 2.0
"""With noise the outputs are so many times further apart than without, where that is worth another sentence."""


def windup_differences(
    both: tuple[ScaledController, ScaledController], tried: tuple[TriedController, TriedController], plan: TrialPlan
) -> Iterator[NonlinearDifference]:
    """Yield how differently two controllers come back from an output limit, by emulation; nothing where they do not.

    Without integral action in both, what an excursion to a limit and back leaves behind.

    Parameters
    ----------
    both : tuple of ScaledController
        Source and target.
    tried : tuple of TriedController
        The same, to be tried.
    plan : TrialPlan
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
    found = recoveries(tried, plan, scans)
    if not found.differ:
        return
    figures = {
        "at the limit after the error has turned [s]": (found.both[0].stays, found.both[1].stays),
        "output with the error back at zero [% of output span]": (found.both[0].at_zero, found.both[1].at_zero),
    }
    if found.noisy is not None:
        figures["output on the way back from a limit, with noise [% of output span]"] = found.noisy
    yield NonlinearDifference("windup", story(found, plan, both), figures)


def _without_integral(both: tuple[ScaledController, ScaledController], scans: tuple[float, float]) -> Iterator[NonlinearDifference]:
    """Yield what a limit leaves behind for good."""
    source, target = both
    gains = [abs(side.settings.law().moments()[1]) for side in both]
    shift = limit_shift(source.settings, target.settings, scans, gains[1] / gains[0] if all(gains) else 1.0)
    if shift.permanent:
        figures = {"output after an excursion to the limit and back [% of output span]": (shift.source, shift.target)}
        yield NonlinearDifference("windup", shift.text, figures)


def unknown_windup(both: tuple[ScaledController, ScaledController], reason: str) -> Iterator[NonlinearDifference]:
    """Yield what the cards say where the two cannot be emulated and their schemes are not the same.

    Parameters
    ----------
    both : tuple of ScaledController
        Source and target.
    reason : str
        Why they cannot be.
    """
    if not all(side.integrates for side in both) or _same_scheme(*both):
        return
    each = "; ".join(f"{side.name}: {_scheme(side)}" for side in both)
    text = f"Whether the two come back from an output limit alike is not known ({reason}). By their cards: {each}."
    yield NonlinearDifference("windup", text, {})


def _same_scheme(mine: ScaledController, other: ScaledController) -> bool:
    a, b = mine.own, other.own
    return a.integral.windup.acts_like(b.integral.windup)


def _scheme(side: ScaledController) -> str:
    """Return what happens at a limit, as the data sheet has it."""
    return dict(limit_rows(side.settings.equation))["at a limit"]


def story(found: Recoveries, plan: TrialPlan, both: tuple[ScaledController, ScaledController]) -> str:
    """Return the differences as sentences with times.

    Parameters
    ----------
    found : Recoveries
        What both did.
    plan : TrialPlan
        What was tried.
    both : tuple of ScaledController
        Source and target.
    """
    old, new = found.both
    known = not (
        both[0].engineering and both[0].settings.op_range is None
    )  # else its limits are in units of which nothing is known
    low, high = (f"{x:g} %" for x in plan.limits) if known else ("its low limit", "its high limit")
    parts = []
    if found.short:
        parts.append(
            f"After an error of {plan.error:.3g} % for {2 * plan.time:.4g} s the output of the old controller is "
            f"{output_number(old.reached)} %, that of the new one {output_number(new.reached)} %."
        )
    elif found.late:
        parts.append(
            f"With the valve at {high} and the error reversing, the old controller {_leaves(old, plan)}, the new one "
            f"{_leaves(new, plan).removeprefix('leaves the limit ')}."
        )
    if found.apart:
        start = (
            "After" if parts else f"With the valve at {high} and the error reversing, both controllers {_both(old, plan)}; after"
        )
        then = ", until the loop removes the difference" if both[1].integrates else ""
        parts.append(
            f"{start} {3 * plan.time:.4g} s of an error of {plan.error:.3g} % the other way and back at zero, the output is "
            f"{_on_each((old.at_zero, new.at_zero))}{then}."
        )
    if found.noisy is not None and (not parts or _apart(found.noisy) > _MORE * _apart((old.at_zero, new.at_zero))):
        alike = "" if parts else "; without noise they are alike"
        parts.append(
            f"Coming back from {low} along a ramp of PV with noise of {plan.size / 8:.2g} %, {found.noisy_at:.4g} s after PV has "
            f"turned, the output is {_on_each(found.noisy)}{alike}."
        )
    return " ".join(parts)


def output_number(x: float) -> str:
    """Return an output in four digits, without rounding noise about zero."""
    return f"{round(x, 6) + 0.0:.4g}"


def _apart(outputs: tuple[float, float]) -> float:
    return abs(outputs[0] - outputs[1])


def _on_each(outputs: tuple[float, float]) -> str:
    return f"{output_number(outputs[0])} % on the old controller and {output_number(outputs[1])} % on the new one"


def _leaves(r: Recovery, plan: TrialPlan) -> str:
    if math.isinf(r.stays):
        return f"stays there for the {3 * plan.time:.4g} s that this lasts"
    return f"leaves the limit after {r.stays:.4g} s" if r.stays else "leaves the limit at once"


def _both(r: Recovery, plan: TrialPlan) -> str:
    return _leaves(r, plan).replace("leaves", "leave", 1).replace("stays", "stay", 1)
