"""The workbook for the configuration team, by xlsxwriter: text is text, never a formula."""

from __future__ import annotations

import datetime
import io
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from pidemu.errors import ListError
from pidemu.files.writing import beside
from pidemu.plant.codes import CODES
from pidemu.plant.columns import DECIDE, ERRORS, SKIPPED, converted_columns, converted_values, decision_rows, error_rows
from pidemu.plant.rows import RetrofitRow

_WIDEST: Final = 60
_UNUSED: Final = ("D-unused", "D-default", "D-zero-gain")
_COLOURS: Final = {"exact": "#d9ead3", "exact-feedback": "#fff2cc", "approximate": "#fce5cd"}
_GUARD: Final = 31
"""Characters of a sheet's name."""


def check_installed() -> None:
    """Refuse a workbook where xlsxwriter is not installed, before the work."""
    try:
        import xlsxwriter  # noqa: F401
    except ImportError:
        raise ListError("a workbook needs xlsxwriter, which is not installed; pip install 'pidemu[retrofit]' brings it") from None


def write_workbook(
    path: str | Path, rows: Sequence[RetrofitRow], document: Mapping[str, Any], inputs: Iterable[str | Path] = ()
) -> None:
    """Write the workbook of a job.

    Parameters
    ----------
    path : str or Path
        The file.
    rows : sequence of RetrofitRow
        The loops.
    document : mapping
        The job as plain values, as `pidemu.plant.document.job_document` returns it.
    inputs : iterable of path
        Files that are read, and must not be written.

    Raises
    ------
    ListError
        It cannot be written, or xlsxwriter is not installed.
    """
    check_installed()
    data = io.BytesIO()
    _fill(data, rows, document)
    with beside(path, ListError, inputs, binary=True) as stream:
        stream.write(data.getvalue())


def _fill(data: io.BytesIO, rows: Sequence[RetrofitRow], document: Mapping[str, Any]) -> None:
    import xlsxwriter

    day = datetime.datetime.combine(datetime.date.fromisoformat(document["date"]), datetime.time())
    book = xlsxwriter.Workbook(
        data, {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False, "nan_inf_to_errors": False}
    )
    book.set_properties({"title": "pidemu retrofit", "created": day, "comments": f"pidemu {document['pidemu']}"})
    writer = _Writer(book)
    converted = [row for row in rows if row.row_class == "converted"]
    columns = converted_columns(converted)
    writer.pairs("Summary", _summary(document))
    writer.table("Converted", columns, (converted_values(row, n) for n, row in enumerate(converted, 1)))
    decide = list(decision_rows(rows))
    writer.table("Decide", DECIDE, decide, answers=True)
    writer.table("Errors", ERRORS, error_rows(rows))
    unused = [line for line in decide if line["rule"] in _UNUSED]
    writer.table("Unchanged or unused", DECIDE, unused)
    writer.table("Assumptions", ("fact of a card", "loops"), _assumptions(converted))
    writer.table("Sources", ("card", "source", "address", "read"), _sources(rows, document["target"]))
    writer.table("Skipped lines", SKIPPED, document["skipped"])
    book.close()


def _summary(document: Mapping[str, Any]) -> list[tuple[str, Any]]:
    s = document["summary"]
    found: list[tuple[str, Any]] = [("pidemu retrofit", s["sentence"]), ("date", document["date"]), ("pidemu", document["pidemu"])]
    found += [("target", document["target"]), ("", "")]
    found += [(f"lines: {name}", n) for name, n in s["counts"].items()]
    found += [("lines of all files", s["lines"]), ("", "")]
    found += [(f"verdict: {name}", n) for name, n in s["verdicts"].items()]
    for what in ("cards", "areas"):
        found.append(("", ""))
        found += [
            (f"{what.removesuffix('s')} {name}", ", ".join(f"{n} {c}" for c, n in table.items())) for name, table in s[what].items()
        ]
    found += [("", ""), *((f"{code}: {CODES[code].about}", n) for code, n in s["codes"].items()), ("", "")]
    found += [
        (f"SHA-256 of {name}", digest) for table in ("files", "made_with", "cards") for name, digest in document[table].items()
    ]
    found += [("level", f"{code} is {level}") for code, level in document["levels"].items()]
    return found + [("note", note) for note in document["notes"]]


def _assumptions(rows: Sequence[RetrofitRow]) -> list[dict[str, Any]]:
    counts: Counter[str] = Counter(fact for row in rows if row.conversion is not None for fact in row.conversion.assumptions)
    return [{"fact of a card": fact, "loops": n} for fact, n in sorted(counts.items(), key=lambda x: (-x[1], x[0]))]


def _sources(rows: Sequence[RetrofitRow], target: str) -> list[dict[str, Any]]:
    from pidemu.card.library import load_card

    used = {row.reading.card.id: row.reading.card for row in rows if row.reading.card is not None}
    cards = [*dict(sorted(used.items())).values(), *([] if target in used else [load_card(target)])]
    return [
        {"card": card.id, "source": str(s.title), "address": str(s.address or ""), "read": str(s.read)}
        for card in cards
        for s in card.data.sources.values()
    ]


class _Writer:
    """Writes sheets that can be printed: header frozen and repeated, filter, widths, landscape, page numbers."""

    def __init__(self, book: Any) -> None:
        self.book = book
        self.head = book.add_format({"bold": True, "text_wrap": True, "valign": "top", "bottom": 1})
        self.open = book.add_format({"bg_color": "#fff2cc", "border": 1})
        self.by_verdict = {verdict: book.add_format({"bg_color": colour}) for verdict, colour in _COLOURS.items()}

    def _sheet(self, name: str) -> Any:
        sheet = self.book.add_worksheet(name[:_GUARD])
        sheet.set_landscape()
        sheet.set_paper(9)
        sheet.fit_to_pages(1, 0)
        sheet.set_footer("&L&F&C&A&R&P of &N")
        return sheet

    def pairs(self, name: str, pairs: Sequence[tuple[str, Any]]) -> None:
        """Write two columns."""
        sheet = self._sheet(name)
        for line, (left, right) in enumerate(pairs):
            self._write(sheet, line, 0, left, self.head if line == 0 else None)
            self._write(sheet, line, 1, right, self.head if line == 0 else None)
        sheet.set_column(0, 0, _WIDEST)
        sheet.set_column(1, 1, 2 * _WIDEST)

    def table(self, name: str, columns: Sequence[str], rows: Iterable[Mapping[str, Any]], answers: bool = False) -> None:
        """Write a table; with `answers`, the answer's column has a drop-down."""
        sheet = self._sheet(name)
        widths = [len(column) for column in columns]
        for at, column in enumerate(columns):
            self._write(sheet, 0, at, column, self.head)
        count = 0
        for count, row in enumerate(rows, 1):
            shade = self.by_verdict.get(str(row.get("verdict")))
            for at, column in enumerate(columns):
                value = row.get(column)
                own = (
                    self.open
                    if answers and column in ("answer", "name", "date", "reason")
                    else shade
                    if column == "verdict"
                    else None
                )
                self._write(sheet, count, at, value, own)
                widths[at] = max(widths[at], min(len(str(value)) if value is not None else 0, _WIDEST))
            if answers:
                _add_choices(sheet, count, columns.index("answer"), str(row.get("answers", "")))
        for at, width in enumerate(widths):
            sheet.set_column(at, at, min(width, _WIDEST) + 2)
        sheet.freeze_panes(1, 1)
        sheet.repeat_rows(0)
        sheet.autofilter(0, 0, max(count, 1), len(columns) - 1)

    @staticmethod
    def _write(sheet: Any, line: int, column: int, value: Any, style: Any) -> None:
        if value is None or value == "":
            if style is not None:
                sheet.write_blank(line, column, None, style)
        elif isinstance(value, int | float) and abs(value) < float("inf"):
            sheet.write_number(line, column, value, style)
        else:
            sheet.write_string(line, column, str(value), style)


def _add_choices(sheet: Any, line: int, column: int, answers: str) -> None:
    """Give the answer's cell a drop-down, where the answers are a list of words; another answer is still possible."""
    words = [word.strip() for word in answers.split(";") if word.strip()]
    if words and len(",".join(words)) < 250 and not any("," in word for word in words):
        sheet.data_validation(line, column, line, column, {"validate": "list", "source": words, "error_type": "information"})
