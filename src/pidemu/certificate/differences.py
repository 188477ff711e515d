"""Limits, bands and rates of two controllers in numbers: what their cards do to error, setpoint and output (section 8)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from pidemu.certificate.models import NonlinearDifference
from pidemu.certificate.scaled_controller import ScaledController, alike
from pidemu.settings.ranges import infinite_where_none

Figures = dict[str, tuple[float, float]]
Pair = tuple[float, float]


def limit_differences(source: ScaledController, target: ScaledController, *, stated: bool = False) -> Iterator[NonlinearDifference]:
    """Yield how output limits as delivered, unless others are `stated`, and limits of the integral itself differ (section 5)."""
    both = (source, target)
    figures: Figures = {}
    parts = []
    unknown = any(side.engineering and side.settings.op_range is None for side in both)
    low, high = zip(*(side.limits if unknown else side.limits_percent for side in both), strict=True)
    units = [side.unit if unknown else "%" for side in both]
    if not (stated or (alike(*low) and alike(*high))):
        unit = units[0] if units[0] == units[1] else "% or engineering units"
        figures |= {f"low output limit [{unit}]": _pair(low), f"high output limit [{unit}]": _pair(high)}
        words = ", ".join(f"{_span((low[i], high[i]), units[i])} on {both[i].name}" for i in (0, 1))
        parts.append(f"Output limits as delivered: {words}. Set those of the old controller on the new one{_in_own_units(target)}.")
    if all(side.integrates for side in both):
        mine, other = (_integral_limits(side) for side in both)
        if not (alike(mine[0], other[0]) and alike(mine[1], other[1])):
            figures |= {"low limit of the integral term [% of output span]": (mine[0], other[0])}
            figures |= {"high limit of the integral term [% of output span]": (mine[1], other[1])}
            words = ", ".join(f"{_span(found, '%')} on {side.name}" for found, side in zip((mine, other), both, strict=True))
            parts.append(f"Limits of the integral term itself: {words}.")
    if parts:
        yield NonlinearDifference("limits", " ".join(parts), figures)


def _in_own_units(target: ScaledController) -> str:
    """Return what 0 to 100 % is on a target that computes in engineering units."""
    if not target.engineering:
        return ""
    if target.settings.op_range is None:
        return f"; {target.name} has them in engineering units: give the range of the output to see them in %"
    return f"; 0 to 100 % is {target.settings.op_range} there"


def _span(limits: Pair, unit: str) -> str:
    low, high = limits
    if math.isinf(low) and math.isinf(high):
        return "none"
    if math.isinf(low) or math.isinf(high):
        return f"{'at most' if math.isinf(low) else 'at least'} {high if math.isinf(low) else low:g} {unit}"
    return f"{low:g} to {high:g} {unit}"


def _integral_limits(side: ScaledController) -> Pair:
    """Return the limits of the integral term [% of the output span]; infinite where there are none."""
    a = side.own
    if a.integral.limits is None:
        return -math.inf, math.inf
    ends = zip((a.integral.limits.low, a.integral.limits.high), side.limits, strict=True)
    low, high = (own if end is None or isinstance(end, str) else end for end, own in ends)
    given = infinite_where_none((low, high))
    gain = {"ki e": 1.0, "e/Ti": a.kp, "e": a.ki}[a.integral.holds]
    low, high = sorted(side.op.in_percent(gain * x) for x in given)
    return low, high


def error_differences(source: ScaledController, target: ScaledController) -> Iterator[NonlinearDifference]:
    """Yield what is done to the error, and where the integral stands still for it."""
    figures = {
        "error: half width of the band [% of PV span]": _of(source, target, _band),
        "error: gain within the band [-]": _of(source, target, lambda side: side.own.error.gain if _band(side) else 1.0),
        "error: where a gain that grows with it is 1 [% of PV span]": _of(source, target, _over),
        "error: gain near zero [-]": _of(source, target, _linearity),
        "integral deadband [% of PV span]": _of(
            source, target, lambda side: side.pv.change_in_percent(side.own.integral.deadband or 0.0)
        ),
    }
    found = {name: pair for name, pair in figures.items() if not alike(*pair)}
    if found or _fine_print(source) != _fine_print(target):
        words = "; ".join(f"{side.name} {_error_words(side)}" for side in (source, target))
        yield NonlinearDifference("error", f"The error is used differently: {words}.", found)


def _band(side: ScaledController) -> float:
    return side.pv.change_in_percent(side.own.error.band or 0.0) if side.own.error.shape == "gap" else 0.0


def _over(side: ScaledController) -> float:
    return side.pv.change_in_percent(side.own.error.over) if side.own.error.shape in ("squared", "gain-linear") else math.inf


def _linearity(side: ScaledController) -> float:
    """Return the gain near zero of a shape that has no band."""
    error = side.own.error
    return {"squared": 0.0, "gain-linear": error.linearity or 0.0}.get(error.shape, 1.0)


def _fine_print(side: ScaledController) -> tuple[object, ...]:
    """Return what is not a number of a shape, but that of the mode in cascade."""
    a, error = side.own, side.own.error
    return () if not a.is_shaped else (error.shape, error.subtracted, error.zero_crossing, a.shapes_integral, a.shapes_proportional)


def _error_words(side: ScaledController) -> str:
    a, error, band = side.own, side.own.error, side.pv.change_in_percent(side.own.integral.deadband or 0.0)
    still = f"does not integrate within {band:.4g} %" if not alike(band, 0.0) else ""
    if not a.is_shaped:
        return still or "uses it as it is"
    if error.shape == "gap":
        gain = f"multiplies it by {error.gain:g}" if error.gain else "takes it as zero"
        text = f"{gain} within {_band(side):.4g} %"
        text += ", and subtracts the band outside" if error.subtracted else ""
        text += ", from its first change of sign there" if error.zero_crossing else ""
    elif error.shape == "squared":
        text = f"squares it (gain 1 at {_over(side):.4g} %)"
    else:
        text = f"gives it a gain of {error.linearity:g} near zero, rising to 1 at {_over(side):.4g} %"
    where = "" if a.shapes_integral and a.shapes_proportional else " for the integral" if a.shapes_integral else " for P"
    return f"{text}{where}{' and ' + still if still else ''}"


def integral_differences(source: ScaledController, target: ScaledController, limits: Pair) -> Iterator[NonlinearDifference]:
    """Yield what a windup scheme does with the output inside its limits [% of the output span], such as a faster way back."""
    own = [side.settings.algorithm().integral.windup.inside_limits(*limits) if side.integrates else "" for side in (source, target)]
    if own[0] != own[1]:
        each = zip((source, target), own, strict=True)
        words = "; ".join(f"that of {side.name} {did or 'comes back as it went'}" for side, did in each)
        yield NonlinearDifference("integral", f"The integral comes back differently inside the output limits: {words}.", {})


def output_differences(source: ScaledController, target: ScaledController) -> Iterator[NonlinearDifference]:
    """Yield rate limit, deadband and step of the output where they differ."""
    yield from _numbers(
        "output",
        (source, target),
        {
            "output rate limit [%/s]": _of(source, target, lambda side: side.op.change_in_percent(_endless(side.own.output.rate))),
            "output deadband [%]": _of(source, target, lambda side: side.op.change_in_percent(side.own.output.deadband or 0.0)),
            "output step [%]": _of(source, target, lambda side: side.op.change_in_percent(side.own.output.resolution or 0.0)),
        },
        [],
    )


def setpoint_differences(
    source: ScaledController, target: ScaledController, *, in_cascade: bool = False
) -> Iterator[NonlinearDifference]:
    """Yield the setpoint's rate limit where it differs, and what becomes of the setpoint at power-up and in manual.

    With `in_cascade` the remote setpoint alone counts, which some do not limit.
    """
    words = [
        f"On {side.name} the setpoint follows PV in manual and stays there until it is changed"
        for side, other in ((source, target), (target, source))
        if side.own.setpoint.tracks and not other.own.setpoint.tracks
    ]
    words += [
        f"On {side.name} the rate-limited setpoint starts at zero at power-up"
        for side, other in ((source, target), (target, source))
        if _from_zero(side) and not _from_zero(other)
    ]
    free = [in_cascade and side.own.setpoint.rate_counts == "local" for side in (source, target)]
    up, down = (
        tuple(
            math.inf if none else side.pv.change_in_percent(rate)
            for none, rate, side in zip(free, rates, (source, target), strict=True)
        )
        for rates in zip(*((_endless(s.own.setpoint.rate), _endless(s.own.setpoint.fall)) for s in (source, target)), strict=True)
    )
    rates = {"setpoint rate limit [%/s]": (up[0], up[1]), "setpoint rate limit downwards [%/s]": (down[0], down[1])}
    if alike(*rates["setpoint rate limit downwards [%/s]"]) or all(
        s.own.setpoint.rate == s.own.setpoint.fall for s in (source, target)
    ):
        del rates["setpoint rate limit downwards [%/s]"]
    yield from _numbers("setpoint", (source, target), rates, words)


def _endless(rate: float | None) -> float:
    return math.inf if rate is None else rate


def _from_zero(side: ScaledController) -> bool:
    return side.own.setpoint.starts == "zero" and side.own.setpoint.rate is not None


def _numbers(
    aspect: str, both: tuple[ScaledController, ScaledController], figures: Figures, words: list[str]
) -> Iterator[NonlinearDifference]:
    """Yield the figures that differ as one difference, with further sentences."""
    found = {name: pair for name, pair in figures.items() if not alike(*pair)}
    parts = []
    for name, pair in found.items():
        what, unit = name.removesuffix("]").split(" [")
        each = (f"{_or_none(x, unit)} on {side.name}" for x, side in zip(pair, both, strict=True))
        parts.append(f"{what[0].upper()}{what[1:]}: {', '.join(each)}")
    if parts or words:
        yield NonlinearDifference(aspect, f"{'. '.join([*parts, *words])}.", found)


def _or_none(x: float, unit: str) -> str:
    return f"{x:.4g} {unit}" if x and math.isfinite(x) else "none"


def _of(source: ScaledController, target: ScaledController, number: Callable[[ScaledController], float]) -> Pair:
    return number(source), number(target)


def _pair(numbers: tuple[float, ...]) -> Pair:
    return numbers[0], numbers[1]
