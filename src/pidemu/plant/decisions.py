"""What people decided: a file of answers that the next run reads."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from pidemu.errors import ListError, suggest
from pidemu.excerpt import visible
from pidemu.files.reading import Kind, read_bytes
from pidemu.plant.codes import code_named
from pidemu.plant.delimited import read_delimited
from pidemu.plant.reading_model import Decision, LoopReading

COLUMNS: Final = ("tag", "rule", "answer", "name", "date", "reason")
_KIND: Final = Kind("a decisions file", "a decisions file is CSV with the columns " + ", ".join(COLUMNS), limit=2**24)
CONVERT: Final = "convert"
SKIP: Final = "skip"
_DROPPED: Final = ("D-nonlinear", "D-unused", "D-default", "D-zero-gain")
"""What the answer `convert` passes over."""


@dataclass(frozen=True)
class Decisions:
    """Answers by tag and code.

    Attributes
    ----------
    given : dict of (str, str) to Decision
        The answers.
    digest : str
        SHA-256 of the file; empty without one.
    """

    given: dict[tuple[str, str], Decision] = field(default_factory=dict)
    digest: str = ""

    def answer(self, tag: str, code: str) -> Decision | None:
        """Return what was decided for a tag; ``None`` where nothing was."""
        return self.given.get((tag, code))


def read_decisions(path: str | Path) -> Decisions:
    """Read a decisions file; a line without an answer is one that is still open.

    Parameters
    ----------
    path : str or Path
        The file.

    Raises
    ------
    ListError
        It cannot be read, a column is missing, a rule is unknown, or one question has two answers.
    """
    name = visible(str(path))
    data = read_bytes(path, ListError, _KIND)
    sheet = read_delimited(data, name)
    if not sheet.lines:
        return Decisions({}, hashlib.sha256(data).hexdigest())
    header = {cell.text.casefold(): column for column, cell in sheet.lines[0].cells.items()}
    missing = [column for column in COLUMNS[:3] if column not in header]
    if missing:
        raise ListError(f"{name}:{sheet.lines[0].number}: no column '{missing[0]}'{suggest(missing[0], header)}; {_KIND.remedy}")
    given: dict[tuple[str, str], Decision] = {}
    for line in sheet.lines[1:]:
        texts = {c: line.cells[header[c]].text if c in header and header[c] in line.cells else "" for c in COLUMNS}
        if not texts["answer"]:
            continue
        try:
            code = code_named(texts["rule"]).name
        except ListError as error:
            raise ListError(f"{name}:{line.number}: {error}") from None
        answer, who, date, reason = (texts[c] for c in COLUMNS[2:])
        found = Decision(texts["tag"], code, answer, who, date, reason, f"{name}:{line.number}")
        before = given.setdefault((found.tag, code), found)
        if before.answer != found.answer:
            raise ListError(
                f"{found.place}: {found.tag} {code} is answered '{found.answer}', and '{before.answer}' in {before.place}"
            )
    return Decisions(given, hashlib.sha256(data).hexdigest())


def skipped_by_decision(reading: LoopReading, decisions: Decisions, codes: Iterable[str]) -> Decision | None:
    """Return the decision that a loop is not to be converted; ``None`` where there is none."""
    for code in codes:
        found = decisions.answer(reading.tag, code)
        if found is not None and found.answer.casefold() == SKIP:
            return found
    return None


def pass_over(reading: LoopReading, decisions: Decisions) -> None:
    """Take findings off a loop that a person decided to convert anyway."""
    for finding in list(reading.findings):
        found = decisions.answer(reading.tag, finding.code) if finding.code in _DROPPED else None
        if found is not None and found.answer.casefold() == CONVERT:
            reading.findings.remove(finding)
            note_decision(reading, found)


def is_nearest_wanted(reading: LoopReading, decisions: Decisions) -> bool:
    """Whether a person accepts the nearest settings where the target refuses, or where the deviation is beyond what is allowed."""
    found = decisions.answer(reading.tag, "D-refused")
    return found is not None and found.answer.casefold() == "nearest"


def note_decision(reading: LoopReading, decision: Decision) -> None:
    """Write down that a decision was used."""
    if decision in reading.decisions:
        return
    reading.decisions.append(decision)
    who = f" by {decision.name}" if decision.name else ""
    why = f": {decision.reason}" if decision.reason else ""
    reading.find("F-decided", f"{decision.rule} was decided{who}, {decision.answer}{why}", decision.place)
