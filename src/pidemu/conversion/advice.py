"""What a conversion's user has to watch for, in words: everything that the target does differently."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from pidemu.settings import Settings

if TYPE_CHECKING:
    from pidemu.conversion.convert import Conversion

_NOISE: Final = 1.25
"""Ratio of high-frequency gains from which noise is worth a word."""


def warnings_for(c: Conversion) -> Iterator[str]:
    """Yield one sentence per difference.

    Parameters
    ----------
    c : Conversion
        The conversion, without its warnings.
    """
    if c.refusal:
        yield f"these are only the nearest settings: {c.refusal}"
    yield from _ranges(c)
    yield from _setpoint(c)
    yield from _noise(c)
    yield from _without_integral(c.source, c.settings)
    yield from _nonlinear(c.source, c.settings)
    yield from _action(c.source, c.settings)
    yield from _scan(c)


def _ranges(c: Conversion) -> Iterator[str]:
    if c.factor != 1:
        yield f"the signal ranges change: the percent gain is multiplied by {c.factor:.6g} for the same effect in engineering units"
    for s in (c.source, c.settings):
        if s.equation.signals == "engineering" and (s.pv_range is None or s.op_range is None):
            yield (
                f"{s.card.id} computes in engineering units, and no ranges were given: measurement and output spans are taken as "
                "100; give pv_range and op_range"
            )


def _setpoint(c: Conversion) -> Iterator[str]:
    kick = c.certificate.setpoint_kick
    if c.certificate.setpoint.is_exact or (c.verdict == "approximate" and _alike(kick.source, kick.target)):
        return
    if math.isinf(kick.source) or math.isinf(kick.target):
        who = c.source.card.id if math.isinf(kick.source) else c.settings.card.id
        other = kick.target if math.isinf(kick.source) else kick.source
        if not (math.isinf(kick.source) and math.isinf(kick.target)):
            yield (
                f"a setpoint step spikes the output of {who} for one scan (unfiltered derivative on the error), the other "
                f"moves by {other:.4g} % per % at once"
            )
            return
        yield "the response to setpoint changes differs"
    elif _alike(kick.source, kick.target):
        yield "the response to setpoint changes differs after the first moment"
    else:
        yield (
            f"setpoint steps: the output jumps by {kick.target:.4g} % per % at once, on the source by {kick.source:.4g}"
            + (f" ({kick.ratio:.3g} times)" if 0 < kick.ratio < math.inf else "")
        )


def _alike(x: float, y: float) -> bool:
    return x == y or math.isclose(x, y, rel_tol=0.02)


def _noise(c: Conversion) -> Iterator[str]:
    high = c.certificate.feedback.full_band.high
    source, target = (abs(complex(s.law().response(high))) for s in (c.source, c.settings))
    ratio = target / (source * c.factor) if source else math.inf
    if ratio > _NOISE:
        yield f"measurement noise: at {high:.3g} rad/s the target's gain is {ratio:.3g} times the source's"
    elif 0 < ratio < 1 / _NOISE:
        yield f"measurement noise: at {high:.3g} rad/s the target's gain is only {ratio:.3g} times the source's"


def _without_integral(source: Settings, target: Settings) -> Iterator[str]:
    if source.algorithm().ki or target.algorithm().ki:
        return
    ways = [s.equation.implementation for s in (source, target)]
    if ways == ["positional", "positional"]:
        yield "there is no integral: the output rests on a bias, which these settings do not hold; carry it over"
    elif ways[0] != ways[1]:
        yield (
            f"there is no integral: the output of {source.card.id} ({ways[0]}) and {target.card.id} ({ways[1]}) counts from "
            "different starts, a bias for positional, the output at the transfer for velocity"
        )


def _nonlinear(source: Settings, target: Settings) -> Iterator[str]:
    old, new = source.equation, target.equation
    has_integral = bool(source.algorithm().ki) and bool(target.algorithm().ki)
    if has_integral and old.integral.windup.scheme != new.integral.windup.scheme:
        yield (
            f"at an output limit the integral behaves differently: {source.card.id} {old.integral.windup.scheme}, "
            f"{target.card.id} {new.integral.windup.scheme}"
        )
    if old.transfer.start != new.transfer.start:
        bumps = target if new.transfer.start == "load-output" else source
        yield (
            f"transfer to automatic: {bumps.card.id} loads the output into the integral and bumps by its other terms, "
            "the other controller does not"
        )
    if old.output.limits != new.output.limits and old.signals == new.signals:
        low, high = ("{:g} to {:g}".format(*e.output.limits) for e in (old, new))
        yield f"default output limits differ: {low} on the source, {high} on the target"


def _action(source: Settings, target: Settings) -> Iterator[str]:
    old, new = source.equation.action.names, target.equation.action.names
    if {k: v.casefold() for k, v in old.items()} != {k: v.casefold() for k, v in new.items()}:
        yield (
            f"action: reverse acting (output falls when the measurement rises) is '{old['reverse']}' on {source.card.id} and "
            f"'{new['reverse']}' on {target.card.id}"
        )


def _scan(c: Conversion) -> Iterator[str]:
    if c.scan is not None and c.scan[0] != c.scan[1]:
        cost = c.certificate.feedback_at_scan
        if cost is not None:
            yield (
                f"scan intervals differ, {c.scan[0]:g} s and {c.scan[1]:g} s: with them the loop-band deviation is "
                f"{cost.loop_band.max_deviation:.2%}; do not scale the gain by their ratio, the settings are per second already"
            )
