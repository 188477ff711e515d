"""What an explanation holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from pidemu.certificate.unverified import Fact
from pidemu.explanation.forms import Forms
from pidemu.explanation.responses import Ramp, Responses
from pidemu.formatting import json_safe


@dataclass(frozen=True, slots=True)
class DialFacts:
    """One dial as given.

    Attributes
    ----------
    name : str
        The dial.
    value : float
        Its value, in `unit`.
    unit : str
        The card's unit.
    others : dict of str to float
        The same in other usual units.
    given : bool
        Whether it was given; otherwise it is the card's default.
    off : bool
        Whether it switches its term off.
    """

    name: str
    value: float
    unit: str
    others: Mapping[str, float]
    given: bool
    off: bool


@dataclass(frozen=True, slots=True)
class FilterFacts:
    """A filter at work.

    Attributes
    ----------
    on : {"derivative", "lead-lag", "measurement", "output", "setpoint", "error"}
        Where it sits; ``"lead-lag"``: ``(1 + Td s)/(1 + Tf s)``.
    time : float
        Filter time [s].
    ratio : float or None
        Filter time per derivative time: of the series form for a series controller whose card does not refer it to the equivalent
        standard form, else of the standard form; ``None`` where there is no derivative.
    order : {1, 2}
        Its order.
    """

    on: str
    time: float
    ratio: float | None = None
    order: int = 1


@dataclass(frozen=True, slots=True)
class Mode:
    """What sees the setpoint in a mode, and what a step of it does.

    Attributes
    ----------
    b, c : float or None
        Setpoint weights of P and D: 1 on the error, 0 on the measurement alone; ``None`` where there is no such term.
    responses : Responses or None
        The continuous law's; ``None`` where it has none.
    at_scan : Responses or None
        Those at the scan interval, where one is given.
    """

    b: float | None
    c: float | None
    responses: Responses | None
    at_scan: Responses | None


@dataclass(frozen=True)
class Explanation:
    """One controller at its settings, in the words of a control engineer.

    Gains count percent of output span per percent of measurement span, unless `gain_unit` says otherwise, and are positive where a
    reverse-acting controller lowers its output as the measurement rises.

    Attributes
    ----------
    card, title : str
        Id of the card, and what it is.
    options : dict of str to str
        Choice by option.
    scan : float or None
        Scan interval [s]; ``None`` where none was given.
    gain_unit : str
        ``"%/%"``, or ``"output units per PV unit"`` for a card that computes in engineering units whose ranges were not given.
    dials : tuple of DialFacts
        The dials that these options use.
    kind : str
        ``"PID"``, ``"PI"``, ``"P"``, ``"I"`` and so on; ``"pole cancellation"``; ``"none"`` where all gains are zero.
    forms : Forms or None
        Gains in parallel, standard and series form; ``None`` for pole cancellation, which has no PID settings.
    filters : tuple of FilterFacts
        The filters at work.
    automatic, cascade : Mode
        What sees the setpoint; alike where the equation does not depend on the mode.
    ramp : Ramp or None
        What a step of the measurement comes to.
    reverse_with_gains : bool or None
        For a card on which the sign of the gains decides the action, and for negative gains: whether the output falls as the
        measurement rises, with the card's reverse action. ``None`` where the action is chosen apart.
    beyond : tuple of str
        What these numbers leave out: deadbands, rate limits, arithmetic.
    not_stated : tuple of str
        What was not given, and what was taken for it.
    notes : tuple of str
        How what was given was read.
    rests_on : tuple of Fact
        What no source of the card states and these numbers rest on.
    action : str
        What makes the output fall and rise, by the error formula.
    summary : str
        A few sentences that say it all.
    text : str
        Everything, in lines.
    """

    card: str
    title: str
    options: Mapping[str, str]
    scan: float | None
    gain_unit: str
    dials: tuple[DialFacts, ...]
    kind: str
    forms: Forms | None
    filters: tuple[FilterFacts, ...]
    automatic: Mode
    cascade: Mode
    ramp: Ramp | None
    reverse_with_gains: bool | None
    beyond: tuple[str, ...]
    not_stated: tuple[str, ...]
    notes: tuple[str, ...]
    rests_on: tuple[Fact, ...]
    action: str = ""
    summary: str = ""

    @property
    def text(self) -> str:
        """Everything, in lines of at most 110 characters."""
        from pidemu.explanation.text import as_text  # the text is made from the explanation

        return as_text(self)

    def __str__(self) -> str:
        return self.text

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values for JSON; what is infinite becomes the string ``"inf"``."""
        plain = asdict(self)
        modes = {name: plain.pop(name) for name in ("automatic", "cascade")}
        forms = plain.pop("forms")
        plain["parallel"], plain["standard"], plain["series"] = (
            (None, None, None) if forms is None else (forms["parallel"], forms["standard"], forms["series"])
        )
        plain["why_not"] = {} if forms is None else forms["why_not"]
        plain["own_form"] = None if forms is None else forms["own"]
        plain["modes"] = modes
        found: dict[str, Any] = json_safe(plain)
        return found
