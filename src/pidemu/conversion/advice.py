"""What a conversion's user has to watch for, in words: everything that the target does differently."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from pidemu.settings import Settings
from pidemu.units import Role, parse_unit

if TYPE_CHECKING:
    from pidemu.conversion.result import Conversion

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
    yield from _counted_in_scans(c)
    yield from _setpoint(c)
    yield from _multiplier(c)
    yield from _noise(c)
    yield from (difference.text for difference in c.certificate.nonlinear)
    if c.certificate.not_emulated:
        yield f"the two were not run against each other: {c.certificate.not_emulated}"
    yield from _action(c.source, c.settings)
    yield from _scan(c)


def _ranges(c: Conversion) -> Iterator[str]:
    if abs(c.factor) != 1:
        yield (
            f"the signal ranges change: the percent gain is multiplied by {abs(c.factor):.6g} for the same effect in "
            "engineering units"
        )
    direct, reverse = (c.settings.equation.action.names[sense] for sense in ("direct", "reverse"))
    if c.factor < 0 and c.source.equation.action.fixed:
        yield (
            f"with these settings {c.source.card.id} is direct acting, by the sign of its gain: set the action to '{direct}' on "
            f"{c.settings.card.id}"
        )
    elif c.factor < 0:
        yield (
            f"the source's gains are negative: these are positive, so set the action to '{direct}' where the source was reverse "
            f"acting, to '{reverse}' where it was direct acting"
        )
    for s in (c.source, c.settings):
        if s.equation.signals == "engineering" and (s.pv_range is None or s.op_range is None):
            yield (
                f"{s.card.id} computes in engineering units, and not all ranges were given: spans not given are taken as 100; "
                "give the ranges of measurement and output"
            )


def _counted_in_scans(c: Conversion) -> Iterator[str]:
    """Yield which dials rest on a scan interval that was not given."""
    for s in (c.source, c.settings):
        counted = [n for n, v in s.items() if v.active and not v.off and parse_unit(v.unit).scans]
        if counted and c.request.scan is None:
            names = ", ".join(counted)
            yield f"{s.card.id}: {names} in scans: taken at {s.scan:g} s, the card's interval; give the real one, --scan"


def _setpoint(c: Conversion) -> Iterator[str]:
    kick = c.certificate.setpoint_kick_at_scan or c.certificate.setpoint_kick
    if c.certificate.setpoint.is_exact or (c.verdict == "approximate" and _alike(kick.source, kick.target)):
        return
    if math.isinf(kick.source) and math.isinf(kick.target):
        yield "the response to setpoint changes differs"
    elif math.isinf(kick.source) or math.isinf(kick.target):
        who, other = (c.source, kick.target) if math.isinf(kick.source) else (c.settings, kick.source)
        yield (
            f"a setpoint step spikes the output of {who.card.id} for one scan (unfiltered derivative on the error), the other "
            f"{_jumps(other)}"
        )
    elif _alike(kick.source, kick.target):
        yield "the response to setpoint changes differs after the first moment"
    else:
        ratio = f" ({kick.ratio:.3g} times)" if 0 < kick.ratio < math.inf else ""
        yield f"setpoint steps: the output {_jumps(kick.target)}, on the source it {_jumps(kick.source)}{ratio}"
    old, new = c.source.algorithm(), c.settings.algorithm()
    if old.kp and new.kp and bool(old.b) != bool(new.b):
        yield (
            "proportional action is on the measurement in one and on the error in the other: no settings make their setpoint "
            "responses equal; judge that of the loop by simulation, and tune for it"
        )
    filt = c.setpoint_filter
    if c.certificate.headline.is_exact and filt is not None:
        yield f"a setpoint filter {filt} before the target would give the source's setpoint response (times in s)"
    elif c.certificate.headline.is_exact:
        yield "no setpoint filter gives the source's setpoint response: it would have to differentiate"


def _jumps(kick: float) -> str:
    return f"jumps by {kick:.4g} % per % at once" if kick else "does not jump"


def _multiplier(c: Conversion) -> Iterator[str]:
    value = c.settings.by_role(Role.MULTIPLIER)
    if value is not None and value.setting.default is not None and value.value != value.setting.default and c.match == "exact":
        usual = value.setting.default
        yield (
            f"{value.name} = {value.value:.4g} makes the filter time agree, which goes with the derivative on the dial; "
            f"'--set {value.name}={usual:g}' keeps it at {usual:g}, with a filter that differs"
        )


def _alike(x: float, y: float) -> bool:
    return x == y or math.isclose(x, y, rel_tol=0.02)


def _noise(c: Conversion) -> Iterator[str]:
    high = c.certificate.feedback.full_band.high
    source, target = (abs(complex(s.law().response(high))) for s in (c.source, c.settings))
    ratio = target / (source * abs(c.factor)) if source else math.inf
    if ratio > _NOISE:
        yield f"measurement noise: at {high:.3g} rad/s the target's gain is {ratio:.3g} times the source's"
    elif 0 < ratio < 1 / _NOISE:
        yield f"measurement noise: at {high:.3g} rad/s the target's gain is only {ratio:.3g} times the source's"


def _action(source: Settings, target: Settings) -> Iterator[str]:
    if target.equation.action.fixed and not source.equation.action.fixed:
        yield (
            f"action: {target.card.id} has no choice of it, the sign of the gains decides; these are for a loop that was reverse "
            f"acting, '{source.equation.action.names['reverse']}' on {source.card.id}: where it was direct acting, turn their sign"
        )
    old, new = source.equation.action.names, target.equation.action.names
    if {k: v.casefold() for k, v in old.items()} != {k: v.casefold() for k, v in new.items()}:
        yield (
            f"action: reverse acting (output falls when the measurement rises) is '{old['reverse']}' on {source.card.id} and "
            f"'{new['reverse']}' on {target.card.id}"
        )


def _scan(c: Conversion) -> Iterator[str]:
    cost = c.certificate.scan_cost
    if c.scan is None or cost is None:
        return
    for what in c.settings.algorithm(scan=c.scan[1]).too_coarse(c.scan[1]):
        yield f"a scan interval of {c.scan[1]:g} s is long for {c.settings.card.id}: {what}"
    now = c.certificate.headline.loop_band.max_deviation
    if c.scan[0] != c.scan[1]:
        change = "costs" if cost.phase_deg > 0 else "gains"
        yield (
            f"scan intervals differ, {c.scan[0]:g} s and {c.scan[1]:g} s: that {change} {abs(cost.phase_deg):.2g} degrees of phase "
            f"at {cost.at:.3g} rad/s, half the difference as dead time; with it the loop-band deviation is {now:.2%}; do not scale "
            "the gain by their ratio: the settings are per second, not per scan, and a gain so scaled is wrong by that ratio"
        )
    if cost.compensated:
        yield (
            "the settings make up for scan intervals and rules: those of the continuous law would deviate by "
            f"{cost.uncompensated:.2%}, these by {now:.2%}; they are right for these intervals only, and '--no-compensation' gives "
            "the others"
        )
