"""The conversions of every card to every card as a heat map in HTML: ``pidemu matrix --html``."""

from __future__ import annotations

import bisect
import os
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from pidemu.card.library import load_card
from pidemu.errors import PidemuError
from pidemu.matrix.cell import Cell, percent
from pidemu.matrix.matrix import Matrix, counts
from pidemu.matrix.typical import DERIVATIVE_TIME, GAIN, INTEGRAL_TIME
from pidemu.report.pages import template, write

STEPS: Final = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
"""Deviations at which the colour changes [1]: three times as much, a darker one."""


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
