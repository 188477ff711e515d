"""The columns of what is written: the same in the workbook and in the CSV files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

from pidemu.plant.codes import CODES
from pidemu.plant.rows import RetrofitRow, level_of
from pidemu.plant.settings_units import shown_unit
from pidemu.units import Role

_PARTS: Final = (("P", Role.GAIN), ("I", Role.INTEGRAL), ("D", Role.DERIVATIVE))
DECIDE: Final = (
    "tag", "rule", "answer", "name", "date", "reason", "question", "reading A", "result A", "reading B", "result B", "answers",
    "service",
    "file", "sheet", "row", "cell",
)  # fmt: skip
"""Columns of the decisions; the first six are those of the decisions file, so that it can be filled in and read back."""
ERRORS: Final = ("tag", "code", "what was expected", "file", "sheet", "row", "cell", "text")
SKIPPED: Final = ("file", "sheet", "row", "kind", "text")
_VERDICTS: Final = {
    "exact": "exact",
    "exact-feedback": "exact against disturbances; a setpoint step is answered otherwise",
    "approximate": "approximate",
}


def converted_columns(rows: Sequence[RetrofitRow]) -> list[str]:
    """Return the columns of the converted loops; the target's dials and options are those of any row."""
    targets = list(dict.fromkeys(name for row in rows for name in row.settings))
    source = [f"source {letter}{what}" for letter, _ in _PARTS for what in ("", " as found", " unit")]
    return [
        "tag", "service", "area", "source card", "source options", *source, "PV filter [s]", *targets, "target units",
        "pasted by units alone", "verdict",
        "in words", "loop-band deviation [%]", "kick before", "kick after", "gain factor", "PV range", "new PV range",
        "action", "scan [s]",
        "flags", "remarks", "decided by", "file", "sheet", "row", "number",
    ]  # fmt: skip


def converted_values(row: RetrofitRow, number: int) -> dict[str, Any]:
    """Return the values of a converted loop, by column.

    Parameters
    ----------
    row : RetrofitRow
        The loop.
    number : int
        Its number among the converted ones: the certificate's.
    """
    r, c = row.reading, row.conversion
    assert c is not None
    assert row.converted is not None
    band, kick = c.certificate.headline.loop_band, c.certificate.setpoint_kick
    found: dict[str, Any] = {
        "tag": r.tag,
        "service": r.service,
        "area": r.area,
        "source card": c.source.card.id,
        "source options": ", ".join(f"{n} {x}" for n, x in c.source.options.items()),
        "PV filter [s]": r.pv_filter or None,
        **row.settings,
        "target units": ", ".join(f"{n} {v.unit}" for n, v in c.settings.items() if v.active and v.unit != "1"),
        "pasted by units alone": ", ".join(f"{n} {x:.5g}" for n, x in row.converted.pasted.items()),
        "verdict": c.verdict,
        "in words": _VERDICTS.get(c.verdict, c.verdict),
        "loop-band deviation [%]": round(100 * band.max_deviation, 3),
        "kick before": kick.source,
        "kick after": kick.target,
        "gain factor": c.factor,
        "PV range": "" if r.pv_range is None else str(r.pv_range),
        "new PV range": "" if r.new_range is None else str(r.new_range),
        "action": c.action_text,
        "scan [s]": None if c.scan is None else c.scan[1],
        "flags": ", ".join(r.codes),
        "remarks": "; ".join(f.text for f in r.findings),
        "decided by": "; ".join(
            f"{d.rule}: {d.answer} ({', '.join(x for x in (d.name, d.date, d.reason) if x)})" for d in r.decisions
        ),
        "file": r.file,
        "sheet": r.sheet,
        "row": r.line,
        "number": number,
    }
    for letter, role in _PARTS:
        dial = next((v for v in c.source.values() if v.role is role and v.active), None)
        if dial is not None:
            origin = r.origins.get(dial.name)
            found[f"source {letter}"] = dial.value
            found[f"source {letter} unit"] = dial.unit
            found[f"source {letter} as found"] = (
                "" if origin is None else f"{origin.cell} {shown_unit(origin.unit)} ({origin.unit_from})"
            )
    return found


def decision_rows(rows: Sequence[RetrofitRow]) -> Iterator[dict[str, Any]]:
    """Yield a line for everything that a person has to decide, in the order of risk."""
    open_ones = [
        (f, row)
        for row in rows
        if row.row_class == "decision"
        for f in row.reading.findings
        if level_of(f, row.levels) == "decision"
    ]
    for finding, row in sorted(open_ones, key=lambda x: (CODES[x[0].code].risk, -x[0].measure, x[1].reading.tag)):
        r = row.reading
        found: dict[str, Any] = {
            "tag": r.tag,
            "rule": finding.code,
            "question": finding.text,
            "answers": "; ".join(c.answer for c in finding.choices) or CODES[finding.code].answers,
            "service": r.service,
            "file": r.file,
            "sheet": r.sheet,
            "row": r.line,
            "cell": f"{finding.place} {finding.cell}".strip(),
        }
        for letter, choice in zip("AB", finding.choices, strict=False):
            found[f"reading {letter}"] = f"{choice.answer}: {choice.says}" if choice.says else choice.answer
            found[f"result {letter}"] = choice.outcome
        yield found


def error_rows(rows: Sequence[RetrofitRow]) -> Iterator[dict[str, Any]]:
    """Yield a line for everything that cannot be read."""
    for row in rows:
        for finding in row.reading.findings if row.row_class == "error" else ():
            if level_of(finding, row.levels) == "error":
                yield {
                    "tag": row.reading.tag,
                    "code": finding.code,
                    "what was expected": finding.text,
                    "file": row.reading.file,
                    "sheet": row.reading.sheet,
                    "row": row.reading.line,
                    "cell": finding.place,
                    "text": finding.cell,
                }
