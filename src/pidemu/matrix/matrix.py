"""Every card to every card: typical settings converted, with verdict and deviation for each ordered pair."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pidemu.card.library import card_files, load_card
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.files.tables import write_rows
from pidemu.matrix.cell import OUTCOMES, Cell, Work
from pidemu.matrix.pairs import computed
from pidemu.matrix.typical import has_terms

LEFT_OUT: Final = "it cancels the pole of a process model and has no PID settings"
"""Why a card is left out."""


COLUMNS: Final = (
    "source", "target", "verdict", "feedback_deviation", "setpoint_deviation", "scan_by_scan_feedback", "scan_by_scan",
    "movement", "match", "source_settings", "target_settings", "sentence", "command",
)  # fmt: skip
"""Columns of the CSV. Deviations are relative [1]; differences scan by scan and the movement are in percent of the output span."""


@dataclass(frozen=True)
class Matrix:
    """Conversions of every card to every card.

    Attributes
    ----------
    cards : tuple of str
        Ids of the cards, in the order of rows and columns.
    cells : tuple of Cell
        Row by row: all targets of the first source, then those of the second.
    files : dict of str to Path
        The file of every card.
    left_out : dict of str to str
        Cards that were asked for and cannot be converted, and why.
    derivative : bool
        Whether the derivative acts in the typical settings.
    emulated : bool
        Whether both controllers were emulated, so that the verdict rests on that as well; otherwise on the continuous laws alone.
    """

    cards: tuple[str, ...]
    cells: tuple[Cell, ...]
    files: Mapping[str, Path]
    left_out: Mapping[str, str]
    derivative: bool
    emulated: bool

    def row(self, source: str) -> tuple[Cell, ...]:
        """Return the conversions from a card."""
        start = self.cards.index(source) * len(self.cards)
        return self.cells[start : start + len(self.cards)]

    def column(self, target: str) -> tuple[Cell, ...]:
        """Return the conversions to a card."""
        return self.cells[self.cards.index(target) :: len(self.cards)]

    def rows(self) -> Iterator[tuple[str, tuple[Cell, ...]]]:
        """Yield every source with its conversions."""
        return ((card, self.row(card)) for card in self.cards)

    @property
    def failed(self) -> tuple[Cell, ...]:
        """Conversions that ended in an error that is no refusal."""
        return tuple(c for c in self.cells if c.verdict == "failed")

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, the form of ``pidemu matrix --json``."""
        return {
            "cards": list(self.cards),
            "left_out": dict(self.left_out),
            "derivative": self.derivative,
            "emulated": self.emulated,
            "counts": counts(self.cells),
            "cells": [c.to_dict() for c in self.cells],
        }

    def to_csv(self) -> str:
        """Return one line per conversion under a header of `COLUMNS`; figures with four digits, empty where there are none."""
        text = io.StringIO()
        write_rows(text, [COLUMNS, *map(_line, self.cells)])
        return text.getvalue()


def _line(c: Cell) -> tuple[str, ...]:
    figures = ("" if x is None else f"{x:.4g}" for x in c.figures)
    return (c.source, c.target, c.verdict, *figures, c.match, c.given, c.settings, c.sentence, c.command)


def counts(cells: Sequence[Cell]) -> dict[str, int]:
    """Return how many cells came to what, in the order of `OUTCOMES`."""
    found = Counter(c.verdict for c in cells)
    return {outcome: found[outcome] for outcome in OUTCOMES}


def matrix(
    cards: Sequence[str | Path] | None = None,
    *,
    derivative: bool = True,
    emulate: bool = True,
    jobs: int | None = None,
    vendors: Sequence[str | Path] = (),
    progress: Callable[[int, int], None] | None = None,
) -> Matrix:
    """Convert typical settings of every card to every card (see `pidemu.matrix.typical`).

    Parameters
    ----------
    cards : sequence of str or path, optional
        Ids or files of cards; by default all. Cards without PID settings are left out, which the result states.
    derivative : bool
        Whether the derivative acts.
    emulate : bool
        Whether every certificate emulates both controllers; without it the continuous laws alone count, in less time.
    jobs : int, optional
        Processes that share the work; by default as many as there are processors, and none where there is little to do. More
        than 1 needs, as always with processes, ``if __name__ == "__main__":`` in a script that calls this.
    vendors : sequence of path, optional
        Folders of the user's own cards, searched before the built-in ones.
    progress : callable, optional
        Called with the number of conversions done, and of all.

    Returns
    -------
    Matrix
        All conversions. One that ends in an error is a cell with the verdict ``failed``; it does not stop the others.

    Raises
    ------
    CardError
        A card is wrong, or there is none of this name.
    ConversionRefusedError
        No card is left that can be converted.
    """
    names = [str(c) for c in (card_files(vendors) if cards is None else cards)]
    found = {card.id: (name, card) for name, card in ((name, load_card(name, vendors)) for name in names)}
    left_out = {i: LEFT_OUT for i, (_, card) in found.items() if not has_terms(card)}
    kept = {i: name for i, (name, _) in found.items() if i not in left_out}
    if not kept:
        raise ConversionRefusedError(f"no card is left to convert: {'; '.join(f'{i}: {why}' for i, why in left_out.items())}")
    work = Work(kept, tuple(str(v) for v in vendors), derivative, emulate)
    pairs = [(source, target) for source in kept for target in kept]
    cells = computed(work, pairs, jobs, progress)
    files = {i: Path(found[i][1].document.path) for i in kept}
    return Matrix(tuple(kept), tuple(cells[pair] for pair in pairs), files, left_out, derivative, emulate)
