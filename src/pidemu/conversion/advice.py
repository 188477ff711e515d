"""What a conversion's user has to watch for, in words: everything that the target does differently."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from pidemu.action import action_line
from pidemu.certificate.noise import noise_change
from pidemu.conversion.spans import range_questions, rescaling, signals_note
from pidemu.units import Role

if TYPE_CHECKING:
    from pidemu.conversion.result import Conversion


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
    yield from _multiplier(c)
    noise = noise_change(c.source, c.settings, c.scan, c.factor).text
    if noise:
        yield noise
    yield from (difference.text for difference in c.certificate.nonlinear)
    if c.certificate.not_emulated:
        yield f"the two were not run against each other: {c.certificate.not_emulated}"
    yield from _action(c)
    yield from _scan(c)


def _ranges(c: Conversion) -> Iterator[str]:
    yield from rescaling(c.source, c.request.to_pv_range, c.request.to_op_range).notes
    for question in range_questions(c.source, c.settings):
        yield f"{question.text}; 0 to 100 is taken"
    note = signals_note(c.source, c.settings)
    if note:
        yield note


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


def _action(c: Conversion) -> Iterator[str]:
    """Yield what the action is set to, where it is not the same word on both."""
    old, new = c.source.equation.action, c.settings.equation.action
    same = {k: v.casefold() for k, v in old.names.items()} == {k: v.casefold() for k, v in new.names.items()}
    turned = c.factor < 0 and not (old.fixed and new.fixed)
    if same and not turned and old.fixed == new.fixed:
        return
    yield f"action: {c.action_text}; on {c.source.card.id}: {action_line(c.source, c.action)}"


def _scan(c: Conversion) -> Iterator[str]:
    if c.scan is None:
        return
    for what in c.settings.algorithm(scan=c.scan[1]).too_coarse(c.scan[1]):
        yield f"a scan interval of {c.scan[1]:g} s is long for {c.settings.card.id}: {what}"
    if c.scan[0] != c.scan[1]:
        yield (
            f"scan intervals differ, {c.scan[0]:g} s and {c.scan[1]:g} s: the settings are per second, so do not scale the gain by "
            "the ratio of the intervals"
        )
    if c.request.compensate:
        yield (
            "the settings make up for scan intervals and rules: they are right for these intervals only, and rest on scan rules "
            "that are often only assumed"
        )
