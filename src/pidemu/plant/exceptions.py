"""The exception report: counts first, then what needs a person, the greatest risk first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from pidemu.plant.codes import CODES, Level
from pidemu.plant.job import RetrofitSummary
from pidemu.plant.reading_model import Finding
from pidemu.plant.rows import RetrofitRow, level_of

_HEADINGS: Final = {
    1: "Refused by the target",
    2: "Duplicate tags",
    3: "Cannot be read",
    4: "Unit or form in doubt, the largest ratio between the readings first",
    5: "Action unknown",
    6: "Ranges, intervals, and loops that nobody tuned",
    7: "Approximate, the largest deviation first",
    8: "A setpoint step kicks otherwise",
    9: "Output limits to set",
    10: "To be read",
}
_CASCADE: Final = ("cascade",)


def exception_report(rows: Sequence[RetrofitRow], summary: RetrofitSummary, levels: Mapping[str, Level]) -> list[str]:
    """Return the report as lines.

    Parameters
    ----------
    rows, summary
        What `pidemu.retrofit` returns.
    levels : mapping
        Levels of codes that the rules changed.
    """
    lines = [summary.sentence, f"{summary.lines:,} lines, every one accounted for", ""]
    lines += [f"the rules make {code} {level}: {CODES[code].about}" for code, level in levels.items()]
    found = [(finding, row) for row in rows for finding in row.reading.findings if _is_told(finding, row)]
    for risk, heading in _HEADINGS.items():
        part = [(f, r) for f, r in found if CODES[f.code].risk == risk]
        if part:
            lines += [f"{risk}. {heading} ({len(part):,})", *_told(part), ""]
    return lines


def _is_told(finding: Finding, row: RetrofitRow) -> bool:
    """Whether a finding stands in the report: of a loop that stops, what stops it, else its flags."""
    level = level_of(finding, row.levels)
    if row.row_class == "skipped":
        return False
    return level == "flag" if row.row_class == "converted" else level != "flag"


def _told(part: Sequence[tuple[Finding, RetrofitRow]]) -> Iterator[str]:
    """Yield the findings of a part: inner loops of cascades before outer ones, the most at stake first."""
    ordered = sorted(part, key=lambda x: (x[1].reading.mode not in _CASCADE, -x[0].measure, x[1].reading.tag, x[1].reading.line))
    for finding, row in ordered:
        r = row.reading
        line = "" if finding.place.startswith("line ") else f"line {r.line}"
        where = ", ".join(x for x in (r.file, r.sheet, line, finding.place) if x)
        yield f"   {r.tag or '(no tag)'}  {finding.code}  {finding.text}  [{where}]"
        for choice in finding.choices:
            says = f": {choice.says}" if choice.says else ""
            yield f"      {choice.answer}{says}{f' -> {choice.outcome}' if choice.outcome else ''}"
