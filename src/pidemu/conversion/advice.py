"""What a conversion's user has to watch for, in words: everything that the target does differently."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from pidemu.certificate.figures import percent
from pidemu.certificate.noise import noise_change
from pidemu.conversion.modes import Mode, in_mode
from pidemu.conversion.spans import range_questions, rescaling, signals_note
from pidemu.formatting import number
from pidemu.units import Role, parse_unit

if TYPE_CHECKING:
    from pidemu.conversion.result import Conversion


def warnings_for(c: Conversion) -> Iterator[str]:
    """Yield what to watch for, one sentence or two per difference, what matters most first.

    Parameters
    ----------
    c : Conversion
        The conversion, without its warnings.
    """
    said = (
        *([f"These are only the nearest settings: {c.refusal}"] if c.refusal else []),
        *(d.text for d in c.certificate.nonlinear if d.inside_limits),
        _lag(c),
        *_setpoint(c),
        noise_change(c.source, c.settings, c.scan, c.factor).text,
        *(
            d.text
            for d in c.certificate.nonlinear
            if not d.inside_limits and not (d.aspect == "bias" and c.request.bias is not None)
        ),
        *_ranges(c),
        *_counted_in_scans(c),
        *_multiplier(c),
        *(o.idle for o in c.opens),
        _bias(c),
        *([f"The two were not run against each other: {c.certificate.not_emulated}"] if c.certificate.not_emulated else []),
        *_scan(c),
    )
    yield from (_sentence(text) for text in dict.fromkeys(said) if text)


def _sentence(text: str) -> str:
    """Return a text as a sentence: a capital in front where it begins with a plain word, a full stop behind."""
    first = text.split(maxsplit=1)[0]
    capital = text[0].upper() + text[1:] if first.isalpha() and first.islower() else text
    return capital if text.endswith((".", "!")) else f"{capital}."


def _ranges(c: Conversion) -> Iterator[str]:
    yield from rescaling(c.source, c.request.to_pv_range, c.request.to_op_range).notes
    for question in range_questions(c.source, c.settings):
        yield f"{question.text}; 0 to 100 is taken"
    yield signals_note(c.source, c.settings)


def _counted_in_scans(c: Conversion) -> Iterator[str]:
    """Yield which dials rest on a scan interval that was not given."""
    for s in (c.source, c.settings):
        counted = [n for n, v in s.items() if v.active and not v.off and parse_unit(v.unit).scans]
        if counted and c.request.scan is None:
            names = ", ".join(counted)
            yield f"{s.card.id}: {names} in scans: taken at {s.scan:g} s, the card's interval; give the real one, --scan"


def _bias(c: Conversion) -> str:
    """Return that a bias was stated for nothing."""
    if c.request.bias is None or not c.settings.algorithm().ki:
        return ""
    return f"The bias of {number(c.request.bias)} % is not used: the integral action finds the output at SP = PV"


def _lag(c: Conversion) -> str:
    """Return what to put in front of the new block, where it cannot filter its measurement as the old one does."""
    if not c.settings.lag:
        return ""
    work = c.ranking[0].solver
    assert work is not None
    without = percent(work.yardstick.continuous_deviation(replace(c.settings, lag=0.0)))
    return (
        f"The old controller filters PV, the new block cannot: put a first-order lag of {number(c.settings.lag)} s on PV in front "
        f"of it, as the figures suppose; without it the two differ by {without} in the loop band"
    )


def _setpoint(c: Conversion) -> Iterator[str]:
    """Yield how setpoint changes differ, before and after, and what would make them alike."""
    if (c.certificate.setpoint_before_rounding or c.certificate.setpoint).is_exact:
        return
    kick = c.certificate.setpoint_kick
    mode: Mode = "cascade" if c.request.mode == "cascade" else "auto"
    old, new = (in_mode(s.algorithm(), mode) for s in (c.source, c.settings))
    lost, gained = old.kp and old.b and not new.b, new.kp and new.b and not old.b
    if not c.certificate.moves_alike_at_once:
        yield f"Setpoint steps: with the old controller the output {_jumps(kick.source)}, with the new one it {_jumps(kick.target)}"
    if lost:
        yield (
            "P acts on the error on the old controller and on the measurement on the new one: setpoint changes will be slower, and "
            "no filter makes up for it"
        )
    filt = c.setpoint_filter
    if filt is not None and (gained or c.certificate.headline.is_exact):
        yield f"A setpoint filter {filt} before the new controller gives the old setpoint response (times in s)"


def _jumps(kick: float) -> str:
    if math.isinf(kick):
        return "spikes for one scan (unfiltered derivative on the error)"
    return f"jumps by {kick:.4g} % per % at once" if kick else "does not jump"


def _multiplier(c: Conversion) -> Iterator[str]:
    value = c.settings.by_role(Role.MULTIPLIER)
    if value is not None and value.setting.default is not None and value.value != value.setting.default and c.match == "exact":
        usual = value.setting.default
        yield (
            f"{value.name} = {value.value:.4g} makes the filter time agree, which goes with the derivative on the dial; "
            f"--set {value.name}={usual:g} keeps it at {usual:g}, with a filter that differs"
        )


def _scan(c: Conversion) -> Iterator[str]:
    if c.scan is None:
        return
    if c.request.undeclared:
        yield (
            "Only the real intervals were stated, and the controllers are taken to compute with these; if they do not, add --scan"
        )
    for what in c.settings.algorithm(scan=c.scan[1]).too_coarse(c.scan[1]):
        yield f"a scan interval of {c.scan[1]:g} s is long for {c.settings.card.id}: {what}"
    if c.scan[0] != c.scan[1]:
        yield (
            f"The scan intervals differ, {c.scan[0]:g} s and {c.scan[1]:g} s: settings are per second, so do not scale the gain "
            "by their ratio"
        )
    at_scan = c.certificate.feedback_at_scan
    if c.request.compensate and not c.certificate.compensated and at_scan is not None and not at_scan.is_exact:
        yield "Nothing was compensated: no settings come nearer at these scans, so these are the plain ones"
    if c.certificate.compensated:
        yield (
            "The settings make up for scan intervals and rules: they are right for these intervals only, and rest on scan rules "
            "that are often only assumed"
        )
