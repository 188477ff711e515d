"""What two controllers do differently beyond the linear law, in words and numbers (specs/equations.md, section 9, point 5)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from pidemu.card.at_limits import limit_rows
from pidemu.card.stages import STARTS
from pidemu.certificate.arithmetic import arithmetic_differences
from pidemu.certificate.models import NonlinearDifference
from pidemu.certificate.sides import Side, sides
from pidemu.certificate.stages import error_differences, limit_differences, output_differences, setpoint_differences
from pidemu.certificate.trials import Plan, Trial, planned, tried
from pidemu.errors import PidemuError
from pidemu.record.sampling import limits_for
from pidemu.settings import Settings

_MANUAL: Final = {
    "operator": "takes the operator's output",
    "gain-times-operator": "multiplies the operator's output by the gain",
    "zero": "gives zero",
}
_BUMP: Final = 1e-6
"""Difference of bumps that counts [% of the output span]."""
_ROUNDED_BUMP: Final = 1e-4
"""The same where numbers are rounded to 24 bits, 8e-6 at 100 %, in every term of the sum."""
_TRACKING: Final = 0.01
"""Relative difference of tracking times that counts."""
_APART: Final = 1.0
"""Difference of outputs after a spell at the limit that is worth a word [% of the output span]."""


def nonlinear_differences(
    source: Settings, target: Settings, scans: tuple[float, float], time_and_size: tuple[float, float]
) -> tuple[NonlinearDifference, ...]:
    """Return what two controllers do differently beyond the linear law (specs/equations.md, sections 5 to 9).

    What happens at a limit and at transfers, and which errors the arithmetic loses, is found by emulation, with parts of the
    standard record, each controller at its own scan interval and with the source's output limits, 0 to 100 % where it has none.
    Where one cannot be emulated the text says why, and the figures are missing. What is alike in both is not in the result.

    Parameters
    ----------
    source, target : Settings
        Settings of the two controllers.
    scans : tuple of float
        Their scan intervals [s].
    time_and_size : tuple of float
        Characteristic time [s] and size [%] of the standard record, as `pidemu.record.standard.scale_of` gives them for the source.
        A time of more than 2,000 scans of the faster, or less than 20 of the slower controller gives way to that.

    Returns
    -------
    tuple of NonlinearDifference
        By aspect: windup, transfer, limits, arithmetic, error, output, setpoint.

    Examples
    --------
    >>> import pidemu
    >>> old = pidemu.load_card("generic/parallel").settings(kp=2, ki=0.02)
    >>> new = pidemu.load_card("arduino/pid").settings(Kp=2, Ki=0.02)
    >>> found = {d.aspect: d for d in nonlinear_differences(old, new, (1.0, 1.0), (100.0, 4.0))}
    >>> before, after = found["transfer"].figures["bump to automatic [% of output span]"]
    >>> round(before, 9), round(after, 9)  # the error is half the size, with the measurement above the setpoint; P comes on top
    (0.0, -4.04)
    """
    both = sides(source, target, scans)
    limits = limits_for(source, None, (0.0, 100.0))
    trial = planned(source, scans, time_and_size, limits)
    outcomes = _trials(both, trial)
    found = [
        *_windup(both, trial, outcomes),
        *_transfer(both, trial, outcomes),
        *_without_integral(*both),
        *limit_differences(*both),
        *arithmetic_differences(*both),
        *error_differences(*both),
        *output_differences(*both),
        *setpoint_differences(*both),
    ]
    return tuple(found)


@dataclass(frozen=True, slots=True)
class _Outcomes:
    """What both did, or why that is not known."""

    trials: tuple[Trial, Trial] | None
    reason: str = ""


def _trials(both: tuple[Side, Side], trial: Plan) -> _Outcomes:
    source, target = both
    span = 1.0
    if source.settings.pv_range and target.settings.pv_range:
        span = source.settings.spans.pv / target.settings.spans.pv
    done = []
    for side, share in ((source, 1.0), (target, span)):
        try:
            done.append(tried(side, trial, "reverse" if side.sign == source.sign else "direct", share))
        except PidemuError as error:
            return _Outcomes(None, f"not emulated, since {side.name} cannot be: {error}")
    return _Outcomes((done[0], done[1]))


def _windup(both: tuple[Side, Side], trial: Plan, outcomes: _Outcomes) -> Iterator[NonlinearDifference]:
    """Yield how differently the integral behaves at an output limit (section 5)."""
    if not all(side.integrates for side in both):
        return
    differs = not _same_scheme(*both)
    words = _scheme_words(both)
    if outcomes.trials is None:
        if differs:
            each = ", ".join(f"{side.name} {w}" for side, w in zip(both, words, strict=True))
            yield NonlinearDifference(
                "windup", f"at an output limit the integral behaves differently: {each}; {outcomes.reason}", {}
            )
        return
    mine, other = outcomes.trials
    stays, at_zero = (mine.stays, other.stays), (mine.at_zero, other.at_zero)
    late = stays[0] != stays[1] and abs(stays[0] - stays[1]) > max(side.scan for side in both) * (1 + 1e-9)
    apart = abs(at_zero[0] - at_zero[1]) > _APART
    if not (differs or late or apart):
        return
    figures = {
        "at the limit after the error has turned [s]": stays,
        "output with the error back at zero [% of output span]": at_zero,
    }
    names = [f"{side.name} ({w})" for side, w in zip(both, words, strict=True)]
    yield NonlinearDifference("windup", _windup_words(names, trial, (mine, other)), figures)


def _same_scheme(mine: Side, other: Side) -> bool:
    a, b = mine.own, other.own
    alike = (a.windup, a.gate, a.implicit_tracking) == (b.windup, b.gate, b.implicit_tracking)
    return alike and (a.windup != "back-calculation" or math.isclose(a.tracking_time, b.tracking_time, rel_tol=_TRACKING))


def _scheme_words(both: tuple[Side, Side]) -> list[str]:
    """Return the names of both schemes, at length where short ones do not tell them apart."""
    names = [_scheme_name(side) for side in both]
    if names[0] != names[1] or _same_scheme(*both):
        return names
    return [dict(limit_rows(side.settings.equation))["at a limit"] for side in both]


def _scheme_name(side: Side) -> str:
    a = side.own
    tracking = f", Tt = {a.tracking_time:.4g} s" if a.windup == "back-calculation" else ""
    back = f", returning {a.gate.fast_return:g} times as fast from beyond its windup limits" if a.gate.fast_return != 1 else ""
    return f"{a.windup}{tracking}{back}"


def _windup_words(names: list[str], trial: Plan, done: tuple[Trial, Trial]) -> str:
    course = f"an error of {trial.error:.3g} % for {2 * trial.time:.4g} s"
    outputs = f"the outputs are {_number(done[0].at_zero)} % and {_number(done[1].at_zero)} %"
    if not any(t.at_limit for t in done):
        return (
            f"at an output limit the integral behaves differently, {names[0]} and {names[1]}, though {course} brings neither "
            f"there; after as much the other way, and back at zero, {outputs}"
        )
    left = [_leaves(t, 3 * trial.time) for t in done]
    each = f"{names[0]} {left[0]}, {names[1]} {left[1]}" if left[0] != left[1] else f"{names[0]} as well as {names[1]} {left[0]}"
    return (
        f"at an output limit the integral behaves differently: when {course} has driven it there and the error turns, {each}; "
        f"after {3 * trial.time:.4g} s of as much the other way, with the error back at zero, {outputs}"
    )


def _number(x: float) -> str:
    return f"{round(x, 6) + 0.0:.4g}"


def _leaves(t: Trial, longest: float) -> str:
    if not t.at_limit:
        return "has not reached it"
    if math.isinf(t.stays):
        return f"does not leave it within {longest:.4g} s"
    return f"leaves it after {t.stays:.4g} s" if t.stays else "leaves it at once"


def _transfer(both: tuple[Side, Side], trial: Plan, outcomes: _Outcomes) -> Iterator[NonlinearDifference]:
    """Yield how differently the transfers between manual and automatic go (section 6)."""
    starts = [side.own.start for side in both]
    manuals = [side.own.manual_output for side in both]
    parts = []
    if starts[0] != starts[1]:
        parts.append(f"transfers to automatic differ: {_each(both, [STARTS[s] for s in starts])}")
    if manuals[0] != manuals[1]:
        parts.append(f"in manual, {_each(both, [_MANUAL[m] for m in manuals])}")
    if outcomes.trials is None:
        if parts:
            yield NonlinearDifference("transfer", "; ".join([*parts, outcomes.reason]), {})
        return
    mine, other = outcomes.trials
    to_auto, to_manual = (mine.to_automatic, other.to_automatic), (mine.to_manual, other.to_manual)
    least = _BUMP if all(side.own.precision == "float64" for side in both) else _ROUNDED_BUMP
    if parts or any(abs(x - y) > least for x, y in (to_auto, to_manual)):
        parts.append(
            f"with the measurement {trial.offset:.3g} % above the setpoint, the output bumps by {_signed(to_auto)} at the "
            "transfer to automatic"
        )
        if max(map(abs, to_manual)) > least:
            parts.append(f"at that to manual, where the operator's output is what the output was, by {_signed(to_manual)}")
        figures = {"bump to automatic [% of output span]": to_auto, "bump to manual [% of output span]": to_manual}
        yield NonlinearDifference("transfer", "; ".join(parts), figures)


def _each(both: tuple[Side, Side], words: list[str]) -> str:
    return " and ".join(f"{side.name} {w}" for side, w in zip(both, words, strict=True))


def _signed(bumps: tuple[float, float]) -> str:
    return f"{_number(bumps[0])} % on the source and {_number(bumps[1])} % on the target"


def _without_integral(source: Side, target: Side) -> Iterator[NonlinearDifference]:
    """Yield what the output counts from where nothing integrates."""
    if source.integrates or target.integrates:
        return
    ways = [side.settings.equation.implementation for side in (source, target)]
    if ways == ["positional", "positional"]:
        text = "there is no integral: the output rests on a bias, which these settings do not hold; carry it over"
        yield NonlinearDifference("transfer", text, {})
    elif ways[0] != ways[1]:
        text = (
            f"there is no integral: the output of {source.name} ({ways[0]}) and {target.name} ({ways[1]}) counts from different "
            "starts, a bias for positional, the output at the transfer for velocity"
        )
        yield NonlinearDifference("transfer", text, {})
