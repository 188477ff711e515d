"""A job: all loops of all lists read, converted, and accounted for."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from pidemu.card.load import Card
from pidemu.files.tables import counted
from pidemu.plant.codes import CODES
from pidemu.plant.converting import LoopConversion, as_ranged, convert_loop
from pidemu.plant.decisions import SKIP, Decisions, note_decision, pass_over, read_decisions
from pidemu.plant.duplicates import note_duplicates
from pidemu.plant.lines import SkippedLine
from pidemu.plant.loop_list import Again, PlantList, read_lists
from pidemu.plant.mapping import PlantWords, read_mapping
from pidemu.plant.outcomes import with_outcomes
from pidemu.plant.reading import ask_structures
from pidemu.plant.reading_model import LoopReading, fault_in_words
from pidemu.plant.rows import RetrofitRow, level_of, row_of
from pidemu.plant.rules import PlantRules, read_rules
from pidemu.plant.sources import read_sources

_CLASSES: Final = ("converted", "decision", "error", "skipped")


@dataclass(frozen=True)
class RetrofitSummary:
    """What became of a job.

    Attributes
    ----------
    lines : int
        Lines of all files; a loop of an L5X file is a line.
    counts : dict
        Loops that are converted, to decide, and errors, and lines that are skipped: together they are all lines.
    verdicts, codes, cards, areas : dict
        Loops by verdict, by code, by source card and by area, each by class.
    skipped : tuple of SkippedLine
        Every line that is no loop.
    notes : tuple of str
        How the files were read.
    files : dict of str to str
        SHA-256 by file.
    """

    lines: int
    counts: dict[str, int]
    verdicts: dict[str, int]
    codes: dict[str, int]
    cards: dict[str, dict[str, int]]
    areas: dict[str, dict[str, int]]
    skipped: tuple[SkippedLine, ...]
    notes: tuple[str, ...]
    files: dict[str, str]

    @property
    def sentence(self) -> str:
        """The counts in a line: ``40 loops: 24 converted (17 exact), 13 to decide, 3 errors``."""
        loops = sum(n for name, n in self.counts.items() if name != "skipped")
        exact = self.verdicts.get("exact", 0)
        return (
            f"{loops:,} loops: {self.counts['converted']:,} converted ({exact:,} exact), {self.counts['decision']:,} to decide, "
            f"{counted(self.counts['error'], 'error')}; {counted(self.counts['skipped'], 'other line')}"
        )


class RetrofitResult(NamedTuple):
    """Rows and summary of a job, and what it was made with.

    Attributes
    ----------
    rows : list of RetrofitRow
        A row for every loop, in the order of the lists.
    summary : RetrofitSummary
        The counts.
    """

    rows: list[RetrofitRow]
    summary: RetrofitSummary


def retrofit(
    table: str | Path | Sequence[str | Path],
    *,
    rules: str | Path | PlantRules | None = None,
    target: str | Path | Card | None = None,
    mapping: str | Path | PlantWords | None = None,
    decisions: str | Path | Decisions | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> RetrofitResult:
    """Convert the loops of a plant's lists.

    Parameters
    ----------
    table : path or sequence of path
        One or several loop lists: xlsx, xls, ods, CSV, L5X.
    rules : path or PlantRules, optional
        The plant's rules; without them the target's options are chosen as `pidemu.convert` does.
    target : str, path or Card, optional
        The card to convert to; by default that of the rules.
    mapping : path or PlantWords, optional
        What the plant's words mean.
    decisions : path or Decisions, optional
        What people decided.
    progress : callable, optional
        Gets how many loops are done, and of how many.

    Returns
    -------
    RetrofitResult
        ``rows, summary``: every loop with its class and codes, every line accounted for.

    Raises
    ------
    ListError
        A file cannot be read, or no line of it is a header of loops.
    PidemuError
        The target is unknown.

    Notes
    -----
    What is wrong with one loop is in its row, and costs no other.
    """
    paths = [table] if isinstance(table, str | Path) else list(table)
    words = mapping if isinstance(mapping, PlantWords) else PlantWords() if mapping is None else read_mapping(mapping)
    ruled = rules if isinstance(rules, PlantRules) else read_rules(rules, target)
    decided = decisions if isinstance(decisions, Decisions) else Decisions() if decisions is None else read_decisions(decisions)
    listed = read_lists(read_sources(paths), words, decided)
    return convert_lists(listed, ruled, words, decided, progress)


def convert_lists(
    listed: PlantList,
    rules: PlantRules,
    words: PlantWords,
    decisions: Decisions,
    progress: Callable[[int, int], None] | None = None,
) -> RetrofitResult:
    """Convert loops that were read.

    Parameters
    ----------
    listed : PlantList
        The loops.
    rules, words, decisions
        As for `retrofit`.
    progress : callable, optional
        Gets how many loops are done, and of how many.
    """
    readings = [reading for reading, _ in listed.loops]
    ask_structures(readings, words, decisions)
    dropped = note_duplicates(readings, decisions)
    rows = []
    for number, (reading, again) in enumerate(listed.loops, 1):
        rows.append(_row(reading, again, rules, decisions, id(reading) in dropped))
        if progress is not None:
            progress(number, len(listed.loops))
    used = {(d.tag, d.rule) for reading in readings for d in reading.decisions}
    for key, decision in decisions.given.items():
        if key not in used:
            listed.notes.append(f"{decision.place}: {key[0]} {key[1]} was not asked, or '{decision.answer}' is not an answer to it")
    return RetrofitResult(rows, _summary(rows, listed))


def _row(reading: LoopReading, again: Again, rules: PlantRules, decisions: Decisions, dropped: bool) -> RetrofitRow:
    skip = next((d for code in reading.codes if (d := decisions.answer(reading.tag, code)) and d.answer.casefold() == SKIP), None)
    if skip is not None or dropped:
        if skip is not None:
            note_decision(reading, skip)
        return RetrofitRow(reading, "skipped", None, rules.levels)
    converted = attempt(reading, rules, decisions)
    pass_over(reading, decisions)
    row = row_of(reading, converted, rules.levels)
    return with_outcomes(row, again, rules, decisions, attempt) if row.row_class == "decision" else row


def attempt(reading: LoopReading, rules: PlantRules, decisions: Decisions) -> LoopConversion | None:
    """Convert a loop that nothing stops; ``None`` where something does, or where it cannot be converted."""
    if reading.settings is None or any(level_of(f, rules.levels) != "flag" for f in reading.findings):
        return None
    for finding in list(reading.findings):
        if CODES[finding.code].level != "flag":
            reading.find("F-lowered", f"the rules let pass {finding.code}: {finding.text}", finding.place)
    try:
        as_ranged(reading)
        return convert_loop(reading, rules, decisions)
    except Exception as error:  # a fault of one loop costs no other
        reading.find("E-program", f"the loop could not be converted: {fault_in_words(error)}")
        return None


def _summary(rows: Sequence[RetrofitRow], listed: PlantList) -> RetrofitSummary:
    counts = dict.fromkeys(_CLASSES, 0)
    cards: dict[str, Counter[str]] = defaultdict(Counter)
    areas: dict[str, Counter[str]] = defaultdict(Counter)
    for row in rows:
        counts[row.row_class] += 1
        cards[row.reading.card.id if row.reading.card is not None else "unknown"][row.row_class] += 1
        areas[row.reading.area or "none"][row.row_class] += 1
    counts["skipped"] += len(listed.skipped)
    return RetrofitSummary(
        lines=len(rows) + len(listed.skipped),
        counts=counts,
        verdicts=dict(sorted(Counter(row.verdict for row in rows if row.verdict).items())),
        codes=dict(sorted(Counter(code for row in rows for code in row.reading.codes).items())),
        cards={name: dict(found) for name, found in sorted(cards.items())},
        areas={name: dict(found) for name, found in sorted(areas.items())},
        skipped=tuple(listed.skipped),
        notes=tuple(listed.notes),
        files=dict(listed.files),
    )
