"""Ranges in a conversion: what new ones do to the gain, and which have to be asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Final

from pidemu.card.load import Variant
from pidemu.card.model.base import Form
from pidemu.settings.range_relation import RangeQuestion, Relation, relation
from pidemu.settings.ranges import PERCENT, RANGES, SignalRange, Which, option_of
from pidemu.settings.settings import Settings, spans_of
from pidemu.units import Dimension, Role, parse_unit

_EXAMPLES: Final[dict[Which, str]] = {"pv_range": "0,400 degC", "op_range": "0,100 %"}
_WORDS: Final[dict[Which, str]] = {"pv_range": "the PV range", "op_range": "the output range"}


@dataclass(frozen=True, slots=True)
class Rescaling:
    """What the target's ranges do to the gain.

    Attributes
    ----------
    factor : Fraction
        What the percent gain is multiplied by.
    notes : tuple of str
        Why, a sentence per range.
    questions : tuple of RangeQuestion
        What is not clear.
    """

    factor: Fraction
    notes: tuple[str, ...] = ()
    questions: tuple[RangeQuestion, ...] = ()


def is_generic(settings: Settings) -> bool:
    """Whether the card is an equation and not a product: its signals are then those of the other side."""
    return settings.card.id.startswith("generic/")


def rescaling(source: Settings, to_pv_range: SignalRange | None, to_op_range: SignalRange | None) -> Rescaling:
    """Return what new ranges do to the percent gain (specs/equations.md, section 3, rescaling).

    A generic source whose range is not given has that of the target.

    Parameters
    ----------
    source : Settings
        The source, with its ranges.
    to_pv_range, to_op_range : SignalRange or None
        The target's ranges; ``None``: the source's.
    """
    factor = Fraction(1)
    notes: list[str] = []
    questions: list[RangeQuestion] = []
    for which, old, new in zip(RANGES, (source.pv_range, source.op_range), (to_pv_range, to_op_range), strict=True):
        found = Relation() if old is None and is_generic(source) else relation(old, new, which)
        if isinstance(found, RangeQuestion):
            questions.append(found)
            continue
        factor *= found.factor
        if found.text:
            notes.append(found.text)
    return Rescaling(factor, tuple(notes), tuple(questions))


def ranges_needed(source: Settings, target: Settings) -> tuple[Which, ...]:
    """Return the ranges that have to be known before the target's dials can be.

    A range that neither side has is needed where a dial of the target would be another if the span were: where the gains of the two
    laws do not grow alike with it. A generic card takes the signals of the other side, so that nothing is needed unless one of the
    two ranges is given, which makes it percent.

    Parameters
    ----------
    source, target : Settings
        What is converted, and what it is converted to: its numbers do not matter, only which terms it uses.

    Returns
    -------
    tuple of str
        ``"pv_range"``, ``"op_range"``, both or none.
    """
    ranges = _given(source, target)
    if not any(ranges.values()) and (is_generic(source) or is_generic(target)):
        return ()
    return tuple(which for which in RANGES if ranges[which] is None and not _grow_alike(source, target, which))


def range_questions(source: Settings, target: Settings) -> tuple[RangeQuestion, ...]:
    """Return a question for each range that has to be asked for; see `ranges_needed`."""
    found = []
    for which in ranges_needed(source, target):
        who = " and ".join(s.card.id for s in (source, target) if any(g not in (None, 1.0) for g in _growth(s, which)))
        example = f'{option_of(which)} "{_EXAMPLES[which]}"'
        text = (
            f"{_WORDS[which]} is not given, and the settings depend on its span, since {who} has gains in engineering units; "
            f"add for example {example}"
        )
        found.append(RangeQuestion("range", which, text, example))
    return tuple(found)


def signals_note(source: Settings, target: Settings) -> str:
    """Return what the gain of a generic card means where no range is given; empty where it is in percent per percent."""
    if is_generic(source) == is_generic(target) or any(_given(source, target).values()):
        return ""
    equation, product = (source, target) if is_generic(source) else (target, source)
    if all(g in (None, 1.0) for which in RANGES for g in _growth(product, which)):
        return ""
    gain = equation.by_role(Role.GAIN)
    name = "its gains are" if gain is None or equation.equation.form is Form.PARALLEL else f"{gain.name} is"
    return (
        f"{equation.card.id} is an equation and takes the signals of {product.card.id}: {name} in output units per PV unit; "
        "give both ranges for percent"
    )


def _given(source: Settings, target: Settings) -> dict[Which, SignalRange | None]:
    return {"pv_range": source.pv_range or target.pv_range, "op_range": source.op_range or target.op_range}


def _grow_alike(source: Settings, target: Settings, which: Which) -> bool:
    """Whether the same dials stand for the same law whatever the span, in all terms that both use."""
    both = zip(_growth(source, which), _growth(target, which), strict=True)
    return all(old is None or new is None or math.isclose(old, new) for old, new in both)


def _growth(settings: Settings, which: Which) -> tuple[float | None, ...]:
    """Return by how much the three gains of the law grow where a span doubles; ``None`` where a term is not used."""
    if not _refers_to_spans(settings.variant):
        a = settings.algorithm()
        return tuple(1.0 if k else None for k in (a.kp, a.ki, a.kd))
    before, after = (_at(settings, which, high).algorithm() for high in (PERCENT.high, 2 * PERCENT.high))
    return tuple(getattr(after, k) / getattr(before, k) if getattr(before, k) else None for k in ("kp", "ki", "kd"))


@lru_cache(maxsize=1024)
def _refers_to_spans(variant: Variant) -> bool:
    """Whether spans matter to an equation: it computes in engineering units, or a dial at work is not in percent throughout."""
    dials = (s for n, s in variant.equation.settings.items() if n in variant.active)
    return variant.equation.signals == "engineering" or any(parse_unit(s.unit).dimension in _OF_SPANS for s in dials)


_OF_SPANS: Final = (Dimension.PV_UNITS, Dimension.OP_PER_PV, Dimension.PERCENT_PER_PV, Dimension.UNITS_PER_TIME)


def _at(settings: Settings, which: Which, high: float) -> Settings:
    """Return settings with the dials as they are, and 0 to `high` for a range."""
    new = SignalRange(0.0, high)
    pv, op = (new, settings.op_range) if which == "pv_range" else (settings.pv_range, new)
    dials = {name: replace(value, spans=spans_of(pv, op)) for name, value in settings.items()}
    return replace(settings, values_by_name=dials, pv_range=pv, op_range=op)
