"""What another range of a signal means for the gain (specs/equations.md, section 3, rescaling)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final, Literal

from pidemu.errors import SettingError
from pidemu.settings.quantities import Measure, measure_of
from pidemu.settings.ranges import SignalRange, Which, option_of

_SIGNALS: Final[dict[Which, str]] = {"pv_range": "PV", "op_range": "output"}


@dataclass(frozen=True, slots=True)
class Relation:
    """What the target's range does to the gain.

    Attributes
    ----------
    factor : Fraction
        What the percent gain is multiplied by.
    text : str
        Why, in a sentence; empty where there is nothing to say.
    """

    factor: Fraction = Fraction(1)
    text: str = ""


@dataclass(frozen=True, slots=True)
class RangeReading:
    """One way to read two ranges.

    Attributes
    ----------
    text : str
        What it means.
    factor : Fraction
        What the percent gain is then multiplied by.
    source, target : SignalRange
        The ranges written so that they mean this, and nothing else.
    """

    text: str
    factor: Fraction
    source: SignalRange
    target: SignalRange


@dataclass(frozen=True, slots=True)
class RangeQuestion:
    """What has to be known of a range before a dial can be given.

    Attributes
    ----------
    kind : str
        ``"range"``: a range is missing; ``"scale"``: what two ranges have to do with each other is not clear.
    about : str
        ``"pv_range"`` or ``"op_range"``.
    text : str
        The question, in a sentence.
    example : str
        What to add to the command line, such as ``--pv-range "0,400 degC"``; empty where the readings answer.
    readings : tuple of RangeReading
        The ways to read the ranges, with what each does to the gain.
    """

    kind: Literal["range", "scale"]
    about: Which
    text: str
    example: str = ""
    readings: tuple[RangeReading, ...] = ()

    @property
    def in_words(self) -> str:
        """The question with its readings, each with what states it."""
        old, new = option_of(self.about), option_of(self.about, target=True)
        ways = [f'{r.text}: {old} "{r.source.argument}" {new} "{r.target.argument}"' for r in self.readings]
        return "\n".join([self.text, *(f"  {way}" for way in ways)])


def relation(source: SignalRange | None, target: SignalRange | None, which: Which) -> Relation | RangeQuestion:
    """Return what the target's range does to the percent gain, or what has to be asked first.

    Two ranges in units of one quantity: the target keeps the source's effect in these units, so that the gain is multiplied by
    new/old span of the measurement, or old/new span of the output. A raw scale (counts, pwm, %, mA against something else, a word
    that is not a known unit): the same signal counted otherwise, whose ends correspond, so that the gain stays.

    Parameters
    ----------
    source, target : SignalRange or None
        The two ranges; where the target's is not given it has the source's.
    which : str
        ``"pv_range"`` or ``"op_range"``.

    Examples
    --------
    >>> from pidemu.settings.ranges import read_range
    >>> relation(read_range("0,200 degC"), read_range("0,400 degC"), "pv_range").factor
    Fraction(2, 1)
    >>> relation(read_range("0,16383 counts"), read_range("0,1000 degF"), "pv_range").factor
    Fraction(1, 1)
    >>> relation(read_range("0,200"), read_range("0,400"), "pv_range").kind
    'scale'
    """
    if target is None or source == target:
        return Relation()
    if source is None:
        return _missing_at_source(target, which)
    old, new = _compared(source, target)
    a, b = measure_of(old.unit), measure_of(new.unit)
    if a.quantity == b.quantity:
        if a.is_quantity and b.is_quantity:
            factor = _factor(Fraction(old.span) * a.factor, Fraction(new.span) * b.factor, which)
            return Relation(factor, _physics(which, old, new, factor))
        if _ends(old, a) == _ends(new, b):
            return Relation()
        if a.kind == "count":
            return _corresponds(which, old, new)
        return _unless_alike(_which_of_two(which, (source, target), (old, new), b.factor / a.factor))
    if a.is_raw or b.is_raw:
        return _corresponds(which, old, new)
    if "none" in (a.kind, b.kind) and old.ends == new.ends:
        return Relation()  # a unit that one of them leaves out
    found = _unless_alike(_which_of_two(which, (source, target), (old, new)))
    return _corresponds(which, old, new) if isinstance(found, Relation) and "none" not in (a.kind, b.kind) else found


def in_target_units(x: float, source: SignalRange | None, target: SignalRange | None) -> float:
    """Return what the target shows for a signal that the source shows: the same physical value, or the same point of the range.

    Parameters
    ----------
    x : float
        The signal [units of the source's range; %, where there is none].
    source, target : SignalRange or None
        The two ranges, related as by `relation`; where the target's is not given it has the source's.

    Raises
    ------
    SettingError
        One range is of a gauge pressure and the other one of an absolute pressure.

    Examples
    --------
    >>> from pidemu.settings.ranges import read_range
    >>> in_target_units(150.0, read_range("0,300 degC"), read_range("0,600 degF"))
    302.0
    >>> in_target_units(8192.0, read_range("0,16384 counts"), read_range("0,400 degC"))
    200.0
    """
    if source is None or target is None or source == target:
        return x
    old, new = _compared(source, target)
    _refuse_gauge_and_absolute(old.unit, new.unit)
    a, b = measure_of(old.unit), measure_of(new.unit)
    if not (a.quantity == b.quantity and a.is_quantity):
        return _point(float(x), source, target)
    seen = Fraction(_point(float(x), source, old))
    return _point(float((seen * a.factor + a.zero - b.zero) / b.factor), new, target)


def _point(x: float, one: SignalRange, other: SignalRange) -> float:
    """Return the point of another range that lies where `x` lies in the first."""
    if one.ends == other.ends:
        return x
    part = (Fraction(x) - Fraction(one.low)) / (Fraction(one.high) - Fraction(one.low))
    return float(Fraction(other.low) + part * (Fraction(other.high) - Fraction(other.low)))


_GAUGE: Final = ("barg", "psig", "kpag")
_ABSOLUTE: Final = ("bara", "psia", "kpaa")


def _refuse_gauge_and_absolute(*units: str) -> None:
    words = {unit.strip().casefold() for unit in units}
    if words & set(_GAUGE) and words & set(_ABSOLUTE):
        raise SettingError(
            f"{' and '.join(units)} are a gauge and an absolute pressure, which are apart by the pressure of the atmosphere; give "
            "both ranges as gauge or both as absolute pressures to carry over a setpoint"
        )


def _compared(source: SignalRange, target: SignalRange) -> tuple[SignalRange, SignalRange]:
    """Return the ranges to hold against each other: what a raw scale stands for, where the other one is no raw scale."""
    if source.meaning is not None and target.meaning is not None:
        return source.meaning, target.meaning
    if source.meaning is not None:
        return _meant(source, source.meaning, target), target
    if target.meaning is not None:
        return source, _meant(target, target.meaning, source)
    return source, target


def _meant(own: SignalRange, meaning: SignalRange, other: SignalRange) -> SignalRange:
    measure = measure_of(other.unit)
    return own if measure.is_raw and measure.quantity != measure_of(meaning.unit).quantity else meaning


def _factor(old: Fraction, new: Fraction, which: Which) -> Fraction:
    return new / old if which == "pv_range" else old / new


def _ends(r: SignalRange, measure: Measure) -> tuple[Fraction, Fraction]:
    return Fraction(r.low) * measure.factor, Fraction(r.high) * measure.factor


def _physics(which: Which, old: SignalRange, new: SignalRange, factor: Fraction) -> str:
    effect = "the gain in percent stays" if factor == 1 else f"the gain in percent is multiplied by {float(factor):.6g}"
    return f"{_SIGNALS[which]} range: {old} becomes {new}, so {effect}"


def _corresponds(which: Which, old: SignalRange, new: SignalRange) -> Relation:
    unknown = [f"'{r.unit}'" for r in (old, new) if measure_of(r.unit).kind == "unknown"]
    what = f" ({' and '.join(unknown)}: not a unit that pidemu knows)" if unknown else ""
    same = f"{_SIGNALS[which]} range: {old} and {new} are taken as the same signal, end for end"
    return Relation(text=f"{same}, so the gain in percent stays{what}")


def _unless_alike(question: RangeQuestion) -> Relation | RangeQuestion:
    """Return nothing to do where all readings of a question come to the same gain."""
    return Relation() if all(reading.factor == 1 for reading in question.readings) else question


def _restated(given: SignalRange, compared: SignalRange) -> SignalRange:
    return compared if given.meaning is None else replace(given, meaning=compared)


def _missing_at_source(target: SignalRange, which: Which) -> RangeQuestion:
    text = f"the target's {_SIGNALS[which]} range is {target}, the source's is not given; give both, also where they agree"
    return RangeQuestion("range", which, text, f'{option_of(which)} "{target.argument}"')


def _which_of_two(
    which: Which, given: tuple[SignalRange, SignalRange], compared: tuple[SignalRange, SignalRange], size: Fraction = Fraction(1)
) -> RangeQuestion:
    """Return the question whether two ranges are the same signal or another range of the same quantity.

    `size` is one unit of the target in units of the source.
    """
    (source, target), (old, new) = given, compared
    unit = old.unit or new.unit
    unit = unit if measure_of(unit).is_quantity else "eu"
    low, high = (float(Fraction(x) * size) for x in new.ends)
    factor = _factor(Fraction(old.span), Fraction(high) - Fraction(low), which)
    effect = f"the gain in percent is multiplied by {float(factor):.6g}"
    restated = _restated(source, SignalRange(*old.ends, unit)), _restated(target, SignalRange(low, high, unit))
    same = Fraction(1)
    readings = (
        RangeReading("the same signal (ends correspond): the gain in percent stays", same, replace(source, meaning=new), target),
        RangeReading(f"another range of the same quantity: {effect}", factor, *restated),
    )
    return RangeQuestion(
        "scale",
        which,
        f"{_SIGNALS[which]} range: are {source} (source) and {target} (target) the same signal, or two ranges of one quantity?",
        readings=readings,
    )
