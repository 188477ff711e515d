"""What was not stated of the source: options, inputs and units whose meaning decides the result (specs/equations.md, section 9)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from pidemu.certificate.linear import bands, deviation
from pidemu.certificate.models import EXACT
from pidemu.conversion.questions import Answer, Kind, Question
from pidemu.errors import PidemuError
from pidemu.law.law import Law, PathName
from pidemu.settings.settings import Settings, off_values
from pidemu.units import Dimension, Role, parse_quantity, parse_unit

_ASKED: Final = 0.1
"""Deviation in the loop band from which readings are asked about."""
_MOST: Final = 6
"""Readings of one question, at most."""
_TERMS: Final = {Role.INTEGRAL: "ki", Role.DERIVATIVE: "kd"}


@dataclass(frozen=True, slots=True)
class Alternative:
    """Another way to read the source.

    Attributes
    ----------
    value : str
        What would have been stated.
    says : str
        What it means, where the value does not say it.
    settings : Settings
        The source, read so.
    given : dict
        What states it.
    """

    value: str
    settings: Settings
    given: Mapping[str, object]
    says: str = ""


@dataclass(frozen=True)
class Open:
    """Something that was not stated, the reading that is taken, and the others.

    Attributes
    ----------
    kind : str
        As of a `Question`.
    about : str
        The option or dial.
    taken : Alternative
        The card's own reading.
    others : tuple of Alternative
        The other ones whose law, for measurement or setpoint, is another.
    asked : bool
        Whether they differ by so much that it is to be asked.
    idle : str
        Why it makes no difference now; empty where it does.
    """

    kind: Kind
    about: str
    taken: Alternative
    others: tuple[Alternative, ...] = ()
    asked: bool = False
    idle: str = ""
    texts: Mapping[str, str] = field(default_factory=dict)

    @property
    def question(self) -> Question:
        """The question, its answers not yet worked out."""
        answers = tuple(Answer(a.value, a.says, given=a.given) for a in (self.taken, *self.others))
        return Question(self.kind, self.about, self.texts["question"], answers[:_MOST])


def unstated(source: Settings) -> Iterator[Open]:
    """Yield what was not stated of a source, where there are other readings.

    One thing is changed at a time. Never asked about: a choice that drops a term whose setting was given, scan rules, windup and
    transfers (the law does not have them), and of equations and software what they do by their documented defaults.
    """
    yield from _units(source)
    yield from _inputs(source)
    if source.card.data.kind == "product":
        yield from _options(source)


def _options(source: Settings) -> Iterator[Open]:
    base = source.law()
    for name in source.defaulted:
        default = source.options[name]
        taken = Alternative(default, source, {name: default})
        others, asked, form_only = [], False, False
        for choice in source.card.options[name]:
            if choice == default:
                continue
            try:
                read = source.changed({name: choice})
                law = read.law()
            except PidemuError:  # a dial that only the other choice has states the option
                continue
            if _drops_a_term(source, read):
                continue
            off, setpoint = _apart(base, law), _apart(base, law, setpoint=True)
            form_only = form_only or (off <= EXACT and read.equation.form is not source.equation.form)
            if max(off, setpoint) > EXACT:
                others.append(Alternative(choice, read, {name: choice}))
                asked = asked or off > _ASKED
        if others:
            about = source.card.data.options[name].about or name
            yield Open("option", name, taken, tuple(others), asked, texts={"question": _option_text(source, name, about)})
        elif form_only:
            rate = next((n for n, v in source.items() if v.role is Role.DERIVATIVE), "the derivative")
            yield Open("option", name, taken, idle=f"{name} is not stated; it makes no difference until {rate} is used")


def _option_text(source: Settings, name: str, about: str) -> str:
    return f"{source.card.id}: {name} is not stated ({about}), and the result depends on it. Which is it?"


def _inputs(source: Settings) -> Iterator[Open]:
    """Yield integral and derivative dials that were left open and whose default is not off."""
    for name, value in source.items():
        if value.given or not value.active or value.off or value.role not in _TERMS or not value.canonical:
            continue
        off = off_values(value.setting)
        if not off and value.role is Role.INTEGRAL:
            continue
        number = off[0] if off else 0.0
        try:
            without = source.changed({name: number})
            law = without.law()
        except PidemuError:
            continue
        unit = f" {value.unit}" if value.unit != "1" else ""
        taken = Alternative(
            f"{value.value:g}{unit}", source.changed({name: value.value}), {name: value.value}, "the block's default"
        )
        other = Alternative("off", without, {name: number}, "no such action was meant")
        text = (
            f"{source.card.id}: {name} is not given, and an open {name} is not off on this block: it is {value.value:g}{unit}. "
            "Was it left open on purpose, or was no such action meant?"
        )
        yield Open("input", name, taken, (other,), _apart(source.law(), law) > _ASKED, texts={"question": text})


def _units(source: Settings) -> Iterator[Open]:
    """Yield integral dials that count repeats per time and were given a plain time."""
    for name, value in source.items():
        if not value.unclear or not isinstance(value.typed, str):
            continue
        number, unit = parse_quantity(value.typed)
        assert unit is not None
        readings = []
        for text in (f"{number:g} {unit.name}/repeat", f"{number:g} {value.unit}"):  # the first is what the settings hold
            with_unit = source.changed({name: text})
            readings.append(Alternative(text, with_unit, {name: text}, f"{with_unit[name].to('s/repeat'):g} s per repeat"))
        off = _apart(*(r.settings.law() for r in readings))
        if off <= EXACT:  # once per minute is a minute
            continue
        text = (
            f"{source.card.id}: {name} counts {_counts(value.unit)}, and was given as a time, {value.typed.strip()}. Is it "
            f"{readings[0].value} or {readings[1].value}?"
        )
        yield Open("unit", name, readings[0], (readings[1],), asked=off > _ASKED, texts={"question": text})


def _counts(unit: str) -> str:
    return "repeats per time" if parse_unit(unit).dimension is Dimension.REPEATS_PER_TIME else unit


def _drops_a_term(source: Settings, read: Settings) -> bool:
    a, b = source.algorithm(), read.algorithm()
    return any(x and not y for x, y in ((a.kp, b.kp), (a.ki, b.ki), (a.kd, b.kd)))


def _apart(base: Law, law: Law, *, setpoint: bool = False) -> float:
    """Return how far two readings are apart in the loop band of the first, whichever of them counts as the truth."""
    band = bands(base, None)[0]
    path: PathName = "setpoint" if setpoint else "feedback"
    return max(deviation(base, law, band, 1.0, path), deviation(law, base, band, 1.0, path))
