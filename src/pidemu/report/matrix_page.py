"""The conversions of every card to every card as a heat map in HTML, and the three files in ``docs/``.

``python -m pidemu.report.matrix_page`` writes ``docs/matrix.html``, ``docs/matrix.csv`` and ``docs/matrix.md``, for the cards that
come with pidemu; a test recomputes a sample.
"""

from __future__ import annotations

import bisect
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from pidemu.card.library import ENVIRONMENT, load_card
from pidemu.errors import PidemuError
from pidemu.matrix.cell import Cell, percent
from pidemu.matrix.matrix import Matrix, counts, matrix
from pidemu.matrix.typical import DERIVATIVE_TIME, GAIN, INTEGRAL_TIME
from pidemu.report.pages import template, write

DOCS: Final = Path(__file__).resolve().parents[3] / "docs"
STEPS: Final = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
"""Deviations at which the colour changes [1]: three times as much, a darker one."""
_COMMAND: Final = "python -m pidemu.report.matrix_page"
_WORDS: Final = (
    "- **exact**: the same law for measurement and setpoint;",
    "- **feedback**: the same law for the measurement; setpoint changes differ (`exact-feedback`);",
    "- **same law**: approximate only because of what is not linear: a deadband, a limit, arithmetic, dials that round coarsely;",
    "- **to 3 %**, **more**: approximate, by the largest deviation of the feedback path in the loop band;",
    "- **refused**: the target cannot do what the source does.",
)


def check_page() -> None:
    """Refuse to go on where no page can be written, before anything is computed for it.

    Raises
    ------
    PidemuError
        jinja2 is not installed.
    """
    try:
        import jinja2  # noqa: F401
    except ImportError:
        raise PidemuError("pages need jinja2, which is not installed; pip install 'pidemu[report]'") from None


def page(m: Matrix, folder: str | Path) -> str:
    """Return the page: a heat map whose cells lead to the settings and figures of each conversion.

    Parameters
    ----------
    m : Matrix
        The conversions.
    folder : str or path
        Where the page will stand: links to the files of the cards start there.

    Raises
    ------
    PidemuError
        jinja2 is not installed.
    """
    check_page()
    cards = [_card(m, i, Path(folder)) for i in range(len(m.cards))]
    text: str = template("matrix.html.j2").render(
        m=m, cards=cards, counts=counts(m.cells), steps=_legend(), settings=typical_words(derivative=m.derivative),
        shade=shade, percent=percent, number=_number, command=lambda c: c.command.split(" --to ", 1),
    )  # fmt: skip
    return text


def write_page(file: str | Path, m: Matrix) -> None:
    """Write the page to a file.

    Raises
    ------
    PidemuError
        The file cannot be written, or jinja2 is not installed.
    """
    write(file, page(m, Path(file).parent))


def shade(cell: Cell) -> str:
    """Return the name of a cell's colour: by the verdict, and where it is approximate by the deviation, on a logarithmic scale."""
    if cell.verdict != "approximate":
        return {"exact": "e", "exact-feedback": "f", "question": "q", "refused": "r", "failed": "x"}[cell.verdict]
    return f"a{bisect.bisect_left(STEPS, cell.deviation or 0)}" if cell.deviation else "s"


def typical_words(*, derivative: bool) -> str:
    """Return what the typical settings are, in words."""
    gain, time = f"a gain of {GAIN:g}", f"an integral time of {INTEGRAL_TIME:g} s"
    if not derivative:
        return f"{gain}, {time} (in parallel forms an integral gain of {GAIN:g}/{INTEGRAL_TIME:g} 1/s) and no derivative"
    return (
        f"{gain}, {time} and a derivative time of {DERIVATIVE_TIME:g} s (in parallel forms an integral gain of "
        f"{GAIN:g}/{INTEGRAL_TIME:g} 1/s and a derivative gain of {GAIN * DERIVATIVE_TIME:g} s)"
    )


def _card(m: Matrix, i: int, folder: Path) -> dict[str, Any]:
    card_id = m.cards[i]
    file = m.files[card_id]
    row = m.row(card_id)
    return {
        "id": card_id,
        "title": load_card(file).title,
        "file": _address(file, folder),
        "given": next((c.given for c in row if c.given), ""),
        "row": row,
        "counts": counts(row),
    }


def _address(file: Path, folder: Path) -> str:
    """Return how a page in a folder links to a file."""
    try:
        return quote(Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix())
    except ValueError:  # on another drive
        return file.resolve().as_uri()


def _legend() -> list[tuple[str, str]]:
    """Return the colours of the approximate conversions, with their bounds."""
    bounds = [f"{100 * s:g}" for s in STEPS]
    return [
        ("a0", f"to {bounds[0]} %"),
        *((f"a{i}", f"to {b} %") for i, b in enumerate(bounds) if i),
        ("a6", f"over {bounds[-1]} %"),
    ]


def _number(x: float) -> str:
    return f"{x:.3g}" if x < 1e4 else f"{x:.2e}"


def summary(m: Matrix) -> str:
    """Return ``docs/matrix.md``: what the figures are, and how each card did as source and as target."""
    lines = [*_introduction(m), "", *_WORDS, ""]
    heads = ["exact", "feedback", "same law", "to 3 %", "more", "refused", "largest deviation"]
    for title, other, groups in (
        ("From each card", "to", [(c, m.row(c)) for c in m.cards]),
        ("To each card", "from", [(c, m.column(c)) for c in m.cards]),
    ):
        lines += [f"## {title}", "", f"| card | {' | '.join(heads)} |", f"|---|{'---:|' * 6}---|"]
        lines += [f"| {_linked(card)} | {' | '.join(_tally(cells, other))} |" for card, cells in groups]
        lines.append("")
    for title, verdict in (("Asked about", "question"), ("Failed", "failed")):
        found = [f"- {c.source} to {c.target}: {c.sentence}" for c in m.cells if c.verdict == verdict]
        lines += [f"## {title}", "", *found, ""] if found else []
    return "\n".join(lines)


def _introduction(m: Matrix) -> list[str]:
    rest = "continuous laws alone."
    if m.emulated:
        rest = "continuous laws, and on emulating both controllers at a common scan interval for what is not linear."
    return [
        "# Every card to every card",
        "",
        f"Generated by `{_COMMAND}`; do not edit. Typical settings of each card are converted to every card:",
        f"{typical_words(derivative=m.derivative)}, in each card's own units, other dials at the card's defaults.",
        "All options of the source are stated, ranges of 0 to 100 where a dial depends on them, and automatic where the equation",
        "depends on the mode, so that nothing is asked. Options of the target are chosen as `pidemu convert` chooses them, dials",
        f"are rounded as it prints them, no scan intervals are given. Verdicts rest on the {rest}",
        "",
        f"[matrix.html](matrix.html) shows all {len(m.cells)} conversions as a heat map, each with the settings of both",
        "sides, figures and the command that shows its certificate (download it, or open it from a clone);",
        "[matrix.csv](matrix.csv) holds them as data. `pidemu matrix` computes them, also for a few cards, as in",
        "`pidemu matrix CARD CARD`, and without derivative.",
        *(f"\nLeft out is {card}: {why}." for card, why in m.left_out.items()),
    ]


def _linked(card: str) -> str:
    return f"[{card}](matrix.html#{card})"


def _tally(cells: Sequence[Cell], other: str) -> list[str]:
    """Return how many conversions came to what, and the worst of them."""
    approximate = [c.deviation or 0.0 for c in cells if c.verdict == "approximate"]
    found = counts(cells)
    numbers = [
        found["exact"], found["exact-feedback"], sum(d == 0 for d in approximate), sum(0 < d <= 0.03 for d in approximate),
        sum(d > 0.03 for d in approximate), found["refused"],
    ]  # fmt: skip
    worst = max(cells, key=lambda c: float(f"{c.deviation or 0.0:.3g}"))  # of those that are alike the first, whatever the rounding
    text = f"{percent(worst.deviation)} % {other} {worst.target if other == 'to' else worst.source}" if worst.deviation else "none"
    return [*(str(n) if n else "" for n in numbers), text]


def main(folder: Path = DOCS) -> None:
    """Write the three files of the built-in cards."""
    os.environ.pop(ENVIRONMENT, None)  # no cards of the user's own
    found = matrix()
    write_page(folder / "matrix.html", found)
    (folder / "matrix.csv").write_text(found.to_csv(), encoding="utf-8", newline="")
    (folder / "matrix.md").write_text(summary(found), encoding="utf-8", newline="\n")
    if found.failed:
        raise SystemExit("\n".join(f"{c.source} to {c.target}: {c.sentence}" for c in found.failed))


if __name__ == "__main__":
    main()
