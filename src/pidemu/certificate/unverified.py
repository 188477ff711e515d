"""What no source of a card states and a result rests on: fields that are assumed or inferred, and are at work at given settings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from pidemu.algorithm.model import Algorithm
from pidemu.card.load import Statement
from pidemu.errors import PidemuError
from pidemu.law.law import Law
from pidemu.settings.settings import Settings, Value
from pidemu.units import parse_unit, to_canonical

_NEVER: Final = ("sets", "about", "range", "resolution", "scope")
"""What is said of a dial beside its unit, its default and what switches it off."""
_ACTION: Final = ("action.names", "action.reverse")
_NOT_PRINTED: Final = ("faults", "signals", "cascade", "feedforward", "transfer.changes", "transfer.preset", "transfer.zero-gain")
"""What no printed program has: inputs for them, or a change while it runs."""
_FREQUENCIES: Final = np.geomspace(1e-6, 1e3, 37)
_SAME: Final = 1e-12
"""Largest relative difference of two laws that are the same."""


@dataclass(frozen=True, slots=True)
class Fact:
    """A field of a card that no source states.

    Attributes
    ----------
    path : str
        The field, such as ``derivative.filter.ratio``; of an option that was not chosen, its name.
    value : str
        What the card says.
    status : {"assumed", "inferred"}
        How sure it is.
    why : str
        Why it is taken so.
    """

    path: str
    value: str
    status: str
    why: str

    def __str__(self) -> str:
        return f"{self.status}: {self.path} = {self.value}" + (f" ({self.why})" if self.why else "")


def facts(statements: Iterable[Statement]) -> tuple[Fact, ...]:
    """Return statements with what their evidence says: its note, else the place in its source."""
    found = ((s, s.evidence) for s in statements)
    return tuple(
        Fact(s.path, _written(s.value), e.status.value, e.note or ", ".join(filter(None, (e.source, e.at))))
        for s, e in found
        if e is not None
    )


def unverified_law(settings: Settings, *, rules: bool = False, action: bool = False) -> list[Statement]:
    """Return what the linear law at these settings rests on and no source states.

    Parameters
    ----------
    settings : Settings
        The settings.
    rules : bool
        Whether the scan rules of the terms count as well, as they do at a scan interval.
    action : bool
        Whether the vendor's error and words for the action count as well.

    Returns
    -------
    list of Statement
        Assumed and inferred fields, in the order of the card: one per evidence entry, and options that were not chosen.
    """
    found: dict[str, Statement] = {s.key: s for s in _options(settings)}
    for s in _statements(settings):
        head, *rest = s.path.split(".")
        of_the_law = (s.makes_the_law and head != "signals") or head == "cascade"
        if of_the_law or (rules and head in ("integral", "derivative") and rest[-1] == "rule"):
            found.setdefault(s.key, s)
    for s in settings.variant.statements if action else ():
        if (s.is_assumed or s.is_inferred) and s.path.startswith(_ACTION):
            found.setdefault(s.key, s)
    return list(found.values())


def unverified_program(settings: Settings, *, scan: bool = False, limits: bool = False) -> list[Statement]:
    """Return what the scan program at these settings rests on and no source states.

    Parameters
    ----------
    settings : Settings
        The settings.
    scan, limits : bool
        Whether scan interval and output limits were given, so that the card's do not count.

    Returns
    -------
    list of Statement
        Assumed and inferred fields, in the order of the card, and options that were not chosen.
    """
    given = {"scan.default": scan, "output.limits": limits}
    made = [s for s in _statements(settings) if not (given.get(s.path) or s.path.startswith(_NOT_PRINTED))]
    return [*_options(settings), *made]


def _written(value: object) -> str:
    if isinstance(value, list | tuple):
        return " to ".join(map(_written, value)) if len(value) == 2 else ", ".join(map(_written, value))
    return f"{value:g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)


def _statements(settings: Settings) -> Iterator[Statement]:
    """Yield the assumed and inferred fields that are at work."""
    a = settings.algorithm()
    for s in settings.variant.statements:
        if (s.is_assumed or s.is_inferred) and _at_work(settings, a, s.path.split(".")):
            yield s


def _options(settings: Settings) -> Iterator[Statement]:
    """Yield the options that were not chosen, whose default no source states, and of which another choice makes another law."""
    card = settings.card
    for name in settings.defaulted:
        key = card.evidence_key(("options", name, "default")) or ""
        s = Statement(name, settings.options[name], card.data.evidence.get(key), f"{key}:{name}")
        if (s.is_assumed or s.is_inferred) and _matters(settings, name):
            yield s


def _matters(settings: Settings, option: str) -> bool:
    chosen = settings.options[option]
    others = [choice for choice in settings.card.options[option] if choice != chosen]
    return any(not _same_law(settings, option, choice) for choice in others)


def _same_law(settings: Settings, option: str, choice: str) -> bool:
    try:
        other = settings.changed({option: choice})
        laws = [Law(s.algorithm(), 1.0 if s.algorithm().dahlin else None) for s in (settings, other)]
        frequencies = _FREQUENCIES[_FREQUENCIES < 3] if laws[0].scan else _FREQUENCIES
        pairs = [[law.response(frequencies, path) for law in laws] for path in ("feedback", "setpoint")]
    except PidemuError:  # with another choice these dials mean nothing
        return False
    return all(bool(np.all(np.abs(x - y) <= _SAME * np.abs(x))) for x, y in pairs)


def _at_work(settings: Settings, a: Algorithm, path: list[str]) -> bool:
    """Tell whether a field of the equation makes a difference at these settings."""
    head, *rest = path
    if head == "settings":
        return _dial_at_work(settings.get(rest[0]), rest[1])
    if head in ("integral", "derivative", "setpoint", "measurement", "error"):
        return _term_at_work(settings, a, head, rest)
    if head == "proportional":
        return bool(a.kp) or settings.equation.proportional.on == "none"
    if head == "transfer":
        return rest[0] != "derivative" or bool(a.kd or a.Tf)
    if head == "output":
        parts: Mapping[str, bool] = {
            "rate": a.output.rate is not None,
            "deadband": bool(a.output.deadband),
            "resolution": bool(a.output.resolution),
        }
        return parts.get(rest[0], True)
    everything: Mapping[str, bool] = {
        "form": bool(a.kd and (a.ki or a.Tf)) or bool(a.ki and a.kp) or a.dahlin is not None,
        "action": rest == ["reverse"] and settings.equation.action.fixed,
        "cascade": a.cascade_b is not None,
        "scan": rest == ["default"],
    }
    return everything.get(head, True)


def _dial_at_work(v: Value | None, field: str) -> bool:
    if v is None or not v.active or field in _NEVER:
        return False
    if field == "default":
        return not v.given and not v.off
    if field == "off":  # where the number alone would say the same, nothing rests on it
        return v.off and to_canonical(v.role, v.value, parse_unit(v.unit), v.spans) != v.canonical
    return not v.off


def _term_at_work(settings: Settings, a: Algorithm, head: str, rest: list[str]) -> bool:
    """Tell whether a field of a term, or of what is done to a signal, makes a difference."""
    if head == "integral":
        if rest[0] == "deadband":
            return bool(a.ki and a.integral.deadband)
        return (
            bool(a.ki)
            or settings.equation.integral.on == "none"
            or (rest[0] == "windup" and a.integral.windup.limits_without_integral)
        )
    if head == "derivative":
        return bool(a.Tf) and (bool(a.kd) or a.has_signal_filter) if rest[0] == "filter" else _derivative_at_work(settings, a, rest)
    if rest[0] == "filter":
        return {"setpoint": a.setpoint.filter, "measurement": a.measurement.filter, "error": a.error.filter}[head] is not None
    if head == "error":
        return a.is_shaped
    if head == "setpoint" and rest[0] in ("rate", "starts"):
        return a.setpoint.rate is not None
    return True


def _derivative_at_work(settings: Settings, a: Algorithm, rest: list[str]) -> bool:
    filt = settings.equation.derivative.filter
    signal_filter_by_its_rule = rest[0] == "rule" and a.has_signal_filter and filt is not None and filt.rule is None
    return bool(a.kd) or signal_filter_by_its_rule
