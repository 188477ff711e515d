"""What comes out for a loop: its class, the target's settings, and everything that has to be told of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pidemu.conversion.result import Conversion
from pidemu.formatting import json_safe
from pidemu.plant.codes import CODES, Level, RowClass, class_of
from pidemu.plant.converting import LoopConversion
from pidemu.plant.reading_model import Decision, Finding, LoopReading


@dataclass(frozen=True)
class RetrofitRow:
    """A loop of the list, and what became of it.

    Attributes
    ----------
    reading : LoopReading
        The loop as it was read, with all findings.
    row_class : str
        ``converted``, ``decision``, ``error`` or ``skipped``.
    converted : LoopConversion or None
        The conversion; ``None`` where there is none, or where it is not to be used.
    levels : dict
        Levels of codes that the rules changed.
    """

    reading: LoopReading
    row_class: RowClass
    converted: LoopConversion | None = None
    levels: Mapping[str, Level] = field(default_factory=dict)

    @property
    def conversion(self) -> Conversion | None:
        """The conversion itself."""
        return None if self.converted is None else self.converted.conversion

    @property
    def settings(self) -> dict[str, float | str]:
        """Everything to set on the target, by name: dials that are in use, in the target's own order, then options."""
        c = self.conversion
        if c is None or self.row_class != "converted":
            return {}
        return {**{n: v.value for n, v in c.settings.items() if v.active}, **c.settings.options}

    @property
    def options(self) -> dict[str, str]:
        """The options of the target alone."""
        c = self.conversion
        return {} if c is None or self.row_class != "converted" else c.settings.options

    @property
    def verdict(self) -> str:
        """The verdict; empty where the loop is not converted."""
        c = self.conversion
        return "" if c is None or self.row_class != "converted" else c.verdict

    def stopping(self) -> list[Finding]:
        """Return the findings that stop the loop."""
        return [f for f in self.reading.findings if level_of(f, self.levels) in ("error", "decision")]

    def to_dict(self) -> dict[str, Any]:
        """Return the row as plain values, for JSON."""
        r, c = self.reading, self.conversion if self.row_class == "converted" else None
        plain: dict[str, Any] = {
            "file": r.file,
            "sheet": r.sheet,
            "row": r.line,
            "tag": r.tag,
            "service": r.service,
            "area": r.area,
            "system": r.system,
            "card": None if r.card is None else r.card.id,
            "class": self.row_class,
            "codes": r.codes,
            "findings": [_finding(f, self.levels) for f in r.findings],
            "decided": [_decision(d) for d in r.decisions],
            "source": _source(r),
            "settings": self.settings,
            "options": self.options,
            "units": {} if c is None else {n: v.unit for n, v in c.settings.items() if v.active},
            "verdict": self.verdict,
            "figures": None if c is None or self.converted is None else _figures(self.converted),
            "pasted": {} if c is None or self.converted is None else dict(self.converted.pasted),
            "held": {} if c is None or self.converted is None else dict(self.converted.options),
            "action": None if c is None else c.action_text,
            "scan": None if c is None or c.scan is None else list(c.scan),
            "conditions": [] if c is None else [str(x) for x in c.conditions],
            "facts": dict(r.facts),
        }
        safe: dict[str, Any] = json_safe(plain)
        return safe


def level_of(finding: Finding, levels: Mapping[str, Level]) -> Level:
    """Return what a finding does to its loop, as the rules say."""
    return levels.get(finding.code, CODES[finding.code].level)


def row_of(reading: LoopReading, converted: LoopConversion | None, levels: Mapping[str, Level]) -> RetrofitRow:
    """Return the row of a loop that is not skipped.

    Parameters
    ----------
    reading : LoopReading
        The loop.
    converted : LoopConversion or None
        Its conversion.
    levels : mapping
        Levels that the rules changed.
    """
    found = class_of([level_of(f, levels) for f in reading.findings])
    if found == "converted" and converted is None:
        found = "decision"
    return RetrofitRow(reading, found, converted, levels)


def _finding(f: Finding, levels: Mapping[str, Level]) -> dict[str, Any]:
    return {
        "code": f.code,
        "level": level_of(f, levels),
        "text": f.text,
        "place": f.place,
        "cell": f.cell,
        "choices": [{"answer": x.answer, "says": x.says, "outcome": x.outcome} for x in f.choices],
    }


def _decision(d: Decision) -> dict[str, str]:
    return {name: getattr(d, name) for name in ("tag", "rule", "answer", "name", "date", "reason", "place")}


def _source(r: LoopReading) -> dict[str, Any]:
    """Return the source as it was read: each dial with its cell and unit."""
    dials = {}
    if r.settings is not None:
        for name, value in r.settings.items():
            origin = r.origins.get(name)
            if value.given or origin is not None:
                dials[name] = {
                    "value": value.value,
                    "unit": value.unit,
                    "place": "" if origin is None else origin.place,
                    "cell": "" if origin is None else origin.cell,
                    "unit_read": value.unit if origin is None else origin.unit,
                    "unit_from": "" if origin is None else origin.unit_from,
                }
    return {
        "settings": dials,
        "options": {} if r.settings is None else r.settings.options,
        "stated": dict(r.stated),
        "pv_range": None if r.pv_range is None else r.pv_range.to_dict(),
        "new_range": None if r.new_range is None else r.new_range.to_dict(),
        "limits": None if r.limits is None else list(r.limits),
        "action": r.action,
        "mode": r.mode,
        "scan": r.scan,
        "pv_filter": r.pv_filter,
    }


def _figures(converted: LoopConversion) -> dict[str, Any]:
    c = converted.conversion
    band, kick = c.certificate.headline.loop_band, c.certificate.setpoint_kick
    return {
        "match": c.match,
        "deviation": band.max_deviation,
        "gain_db": band.gain_db,
        "phase_deg": band.phase_deg,
        "kick_before": kick.source,
        "kick_after": kick.target,
        "gain_factor": c.factor,
        "lag_on_pv": converted.lag,
    }
