"""What is known of a loop before it is converted: settings, where each number comes from, and what was found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pidemu.card.load import Card
from pidemu.errors import PidemuError
from pidemu.plant.codes import CODES, Level
from pidemu.settings.action import Action
from pidemu.settings.ranges import SignalRange
from pidemu.settings.settings import Settings


@dataclass(frozen=True, slots=True)
class LoopChoice:
    """A way to read what stopped a loop, for whoever decides.

    Attributes
    ----------
    answer : str
        What states it in the decisions file.
    says : str
        What it means.
    outcome : str
        What it leads to: the target's settings, or why there are none.
    ratio : float
        What the gain or the integral action is multiplied by against the first reading; 1 where that is not known.
    """

    answer: str
    says: str = ""
    outcome: str = ""
    ratio: float = 1.0


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that was found about a loop.

    Attributes
    ----------
    code : str
        Its code.
    text : str
        What it is, in a sentence.
    place : str
        The cell; empty where it is about the loop.
    cell : str
        What the cell holds.
    choices : tuple of LoopChoice
        The readings, where a person has to decide among them.
    measure : float
        How much is at stake, for the order of the report.
    """

    code: str
    text: str
    place: str = ""
    cell: str = ""
    choices: tuple[LoopChoice, ...] = ()
    measure: float = 0.0

    @property
    def level(self) -> Level:
        """What it does by itself; the plant's rules can say otherwise."""
        return CODES[self.code].level


@dataclass(frozen=True, slots=True)
class ValueOrigin:
    """Where the number of a dial comes from.

    Attributes
    ----------
    place, cell : str
        The cell and what it holds.
    unit : str
        The unit that was read.
    unit_from : str
        ``cell``, ``unit column``, ``header``, ``mapping``, ``card``, ``decision``.
    """

    place: str
    cell: str
    unit: str
    unit_from: str


@dataclass(frozen=True, slots=True)
class Decision:
    """An answer of a person.

    Attributes
    ----------
    tag, rule, answer, name, date, reason : str
        As they stand in the decisions file.
    place : str
        Its line there.
    """

    tag: str
    rule: str
    answer: str
    name: str
    date: str
    reason: str
    place: str = ""


@dataclass
class LoopReading:
    """A loop of the list, as it was read.

    Attributes
    ----------
    file, sheet, line, tag, service, area, system
        Where it stands and what it is called.
    card : Card or None
        The card of its system.
    settings : Settings or None
        Its settings; ``None`` where they cannot be read.
    origins : dict
        Where each dial's number comes from.
    action, mode : str or None
        As far as they are known.
    scan : float or None
        Interval at which the source is executed [s].
    computes_with : float or None
        Interval that it computes with, where that is another one [s].
    pv_range, new_range : SignalRange or None
        Range of the measurement, and the one that it gets.
    rerange : str
        ``same signal`` or ``other range``; empty where nothing is said.
    limits : tuple of float or None
        Output limits [%].
    pv_filter : float
        A filter of the measurement that is no dial of the card [s].
    bias : float or None
        Output at SP = PV, decided [%].
    stated : dict
        Options of the source that the list states.
    findings : list of Finding
        What was found.
    decisions : list of Decision
        What people decided.
    contents : tuple
        What makes two lines of one tag the same.
    facts : dict
        More that is told of it: executions, aliases.
    """

    file: str
    sheet: str
    line: int
    tag: str
    service: str = ""
    area: str = ""
    system: str = ""
    card: Card | None = None
    settings: Settings | None = None
    origins: dict[str, ValueOrigin] = field(default_factory=dict)
    action: Action | None = None
    mode: str | None = None
    scan: float | None = None
    computes_with: float | None = None
    pv_range: SignalRange | None = None
    new_range: SignalRange | None = None
    rerange: str = ""
    limits: tuple[float, float] | None = None
    pv_filter: float = 0.0
    bias: float | None = None
    stated: dict[str, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    decisions: list[Decision] = field(default_factory=list)
    contents: tuple[Any, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)

    def find(self, code: str, text: str, place: str = "", cell: str = "", **more: Any) -> None:
        """Note a finding."""
        self.findings.append(Finding(code, text, place, cell, **more))

    @property
    def codes(self) -> list[str]:
        """The codes of the findings, each once, in the order they were found."""
        return list(dict.fromkeys(f.code for f in self.findings))

    def stops(self, *levels: Level) -> bool:
        """Whether a finding has one of these levels."""
        return any(f.level in levels for f in self.findings)


def fault_in_words(error: Exception) -> str:
    """Return an error as a finding tells it; one that is none of ours with its kind."""
    return str(error) if isinstance(error, PidemuError) else f"{type(error).__name__}: {error}"
