"""One conversion of typical settings from a card to a card, in the figures and words that a table of many has room for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, Literal

from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.certificate.models import EXACT, PathComparison
from pidemu.conversion.command import words_for
from pidemu.conversion.convert import convert
from pidemu.conversion.modes import Modes, depends_on_mode
from pidemu.conversion.refused import ConversionRefusedError, QuestionError
from pidemu.conversion.request import DIGITS, Request
from pidemu.conversion.result import Conversion
from pidemu.conversion.spans import ranges_needed
from pidemu.conversion.target.computed import is_computed
from pidemu.formatting import json_safe
from pidemu.matrix.typical import held_dials, typical_settings
from pidemu.settings.ranges import RANGES, SignalRange
from pidemu.settings.settings import Settings

Outcome = Literal["exact", "exact-feedback", "approximate", "question", "refused", "failed"]

OUTCOMES: Final[tuple[Outcome, ...]] = ("exact", "exact-feedback", "approximate", "question", "refused", "failed")
"""What a conversion can come to, the best first; ``failed`` is an error of this program, or of a card."""
_MARKS: Final[dict[Outcome, str]] = {"exact": "=", "exact-feedback": "=", "question": "?", "refused": "x", "failed": "!"}
_STATED: Final = SignalRange(0.0, 100.0)
"""The range that is stated where one is needed: typical gains are in percent per percent."""


@dataclass(frozen=True, slots=True)
class Cell:
    """What one conversion came to.

    Attributes
    ----------
    source, target : str
        Ids of the two cards.
    verdict : str
        ``exact``, ``exact-feedback``, ``approximate``, ``question``, ``refused`` or ``failed``.
    deviation : float or None
        Largest deviation of the feedback path in the loop band [1]; 0 where the laws are the same before the dials are rounded.
        For a refusal it is that of the nearest settings; ``None`` where there are none.
    setpoint_deviation : float or None
        The same for the setpoint path [1], in the mode in which it is larger.
    scan_by_scan_feedback : float or None
        Largest difference of the two outputs, both emulated with dials that are not rounded, while the setpoint rests [% of the
        output span]; 0 where it is only arithmetic, ``None`` where they were not emulated.
    scan_by_scan : float or None
        The same with setpoint and measurement both moving.
    movement : float or None
        What the source's output moves over meanwhile [% of the output span].
    match : str
        How the target's settings were found.
    given : str
        The source's settings, in words.
    settings : str
        The target's settings, in words; those nearest where it refuses; empty where there are none.
    chosen : dict of str to str
        Options of the target that were chosen and are not as the card delivers them.
    sentence : str
        The verdict in one sentence, or the question, or why there is no verdict.
    command : str
        The command that shows this conversion with its whole certificate.
    """

    source: str
    target: str
    verdict: Outcome
    deviation: float | None = None
    setpoint_deviation: float | None = None
    scan_by_scan_feedback: float | None = None
    scan_by_scan: float | None = None
    movement: float | None = None
    match: str = ""
    given: str = ""
    settings: str = ""
    chosen: Mapping[str, str] | None = None
    sentence: str = ""
    command: str = ""

    @property
    def figures(self) -> tuple[float | None, ...]:
        """The figures, in the order of the attributes."""
        return self.deviation, self.setpoint_deviation, self.scan_by_scan_feedback, self.scan_by_scan, self.movement

    @property
    def mark(self) -> str:
        """What a table shows of it: ``=`` the same law, ``~`` the same but for what is nonlinear, else the deviation [%]."""
        if self.verdict != "approximate":
            return _MARKS[self.verdict]
        return percent(self.deviation) if self.deviation else "~"

    @property
    def setpoint_stands_out(self) -> bool:
        """Whether the setpoint path deviates more than the feedback path."""
        return bool(self.setpoint_deviation) and (self.setpoint_deviation or 0) > 1.05 * (self.deviation or 0)

    def to_dict(self) -> dict[str, Any]:
        """Return the cell as plain values, for JSON."""
        plain: dict[str, Any] = json_safe({**asdict(self), "chosen": dict(self.chosen or {})})
        return plain


@dataclass(frozen=True, slots=True)
class Work:
    """What is computed for every pair of cards, in words that another process can be sent.

    Attributes
    ----------
    names : dict of str to str
        What the cards were called by, an id or a file, by id.
    vendors : tuple of str
        Folders of the user's own cards.
    derivative : bool
        Whether the derivative acts in the typical settings.
    emulate : bool
        Whether the certificates emulate both controllers.
    """

    names: Mapping[str, str]
    vendors: tuple[str, ...]
    derivative: bool
    emulate: bool


def cell(work: Work, source: str, target: str) -> Cell:
    """Convert typical settings of one card to another.

    Parameters
    ----------
    work : Work
        What is computed.
    source, target : str
        Ids of the cards.

    Returns
    -------
    Cell
        The outcome; an error that is not a refusal gives the verdict ``failed``, with the error as sentence.
    """
    try:
        return _converted(work, source, target)
    except Exception as error:  # one fault must not take the other cells with it
        return failed(source, target, error)


def failed(source: str, target: str, error: BaseException) -> Cell:
    """Return the cell of a conversion that ended in an error."""
    return Cell(source, target, "failed", sentence=f"{type(error).__name__}: {error}")


def _converted(work: Work, source: str, target: str) -> Cell:
    card = load_card(work.names[target], work.vendors)
    settings = _ranged(typical_settings(load_card(work.names[source], work.vendors), derivative=work.derivative), card)
    held = {} if source == target else held_dials(card)
    mode: Modes = "auto" if depends_on_mode(settings) else "both"
    command = words_for(settings, card, Request(given=held, mode=mode))
    base = Cell(source, target, "refused", given=_given(settings, mode), command=command)
    try:
        found = convert(settings, card, given=held, mode=mode, digits=DIGITS, emulate=work.emulate)
    except QuestionError as asked:
        return replace(base, verdict="question", sentence=str(asked))
    except ConversionRefusedError as refusal:
        figures = {} if refusal.nearest is None else _figures(refusal.nearest)
        return replace(base, **figures, sentence=str(refusal))
    return replace(base, **_figures(found), verdict=found.verdict, sentence=found.sentence)


def _ranged(settings: Settings, target: Card) -> Settings:
    """Return settings with 0 to 100 for the ranges that have to be stated for a conversion to a card."""
    needed = ranges_needed(settings, typical_settings(target))
    pv, op = (_STATED if name in needed else None for name in RANGES)
    return replace(settings, pv_range=pv, op_range=op)


def _figures(c: Conversion) -> dict[str, Any]:
    """Return the figures of a conversion and what its settings are."""
    certificate, both = c.certificate, c.certificate.scan_by_scan
    setpoint = [_off(certificate.setpoint_headline, certificate.setpoint_before_rounding)]
    if certificate.setpoint_in_cascade is not None:
        setpoint.append(_off(certificate.setpoint_in_cascade))
    emulated = {}
    if both is not None:
        emulated = {
            "scan_by_scan_feedback": 0.0 if both.is_exact_on_measurement else both.on_measurement,
            "scan_by_scan": 0.0 if both.is_exact else both.largest,
            "movement": both.size,
        }
    return {
        "deviation": _off(certificate.headline, certificate.feedback_before_rounding),
        "setpoint_deviation": max(setpoint),
        "match": c.match,
        "settings": in_words(c.settings),
        "chosen": dict(c.chosen),
        **emulated,
    }


def _off(path: PathComparison, before_rounding: PathComparison | None = None) -> float:
    """Return the deviation in the loop band; 0 where there is none before the dials are rounded."""
    exactly = (before_rounding or path).loop_band.max_deviation < EXACT
    return 0.0 if exactly else path.loop_band.max_deviation


def percent(deviation: float) -> str:
    """Return a relative deviation in percent, in four characters at most.

    Examples
    --------
    >>> [percent(x) for x in (1e-7, 0.00046, 0.0181, 0.123, 77.0)]
    ['<.01', '.05', '1.8', '12', '>999']
    """
    x = 100 * deviation
    if x >= 999.5:
        return ">999"
    if x < 0.01:
        return "<.01"
    return f"{x:.2f}".removeprefix("0") if x < 0.995 else f"{x:.1f}" if x < 9.95 else f"{x:.0f}"


def _given(settings: Settings, mode: Modes) -> str:
    """Return the source's settings in words, with all options and the mode where the equation depends on it."""
    words = ", ".join([*_dials(settings), *(f"{n}={c}" for n, c in settings.options.items())])
    return "; ".join((words, *settings.notes, *(["in automatic"] if mode == "auto" else [])))


def in_words(settings: Settings) -> str:
    """Return the dials that were set, the derivative's filter and the setpoint weights, and options that are not as delivered."""
    return ", ".join([*_dials(settings), *(f"{n}={c}" for n, c in _changed(settings).items())])


def _dials(settings: Settings) -> list[str]:
    return [
        f"{n}={v.value:.6g} {v.unit}".removesuffix(" 1")
        for n, v in settings.items()
        if v.active and (v.given or is_computed(settings.equation, n, v.role))
    ]


def _changed(settings: Settings) -> dict[str, str]:
    delivered = settings.card.variant().chosen
    return {n: c for n, c in settings.options.items() if c != delivered[n]}
