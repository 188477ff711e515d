"""The dials of a controller: other usual units, and what was not stated."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pidemu.card.model.base import Form
from pidemu.explanation.model import DialFacts
from pidemu.formatting import number
from pidemu.settings.settings import Settings, Value
from pidemu.units import Dimension, Role, parse_unit

_PER_REPEAT: Final = ("s/repeat", "min/repeat", "repeat/min")


def dials_of(settings: Settings) -> tuple[DialFacts, ...]:
    """Return the dials that the options use, each in other usual units too."""
    return tuple(
        DialFacts(name, v.value, v.unit, {unit: v.to(unit) for unit in _others(settings, v)}, v.given, v.off)
        for name, v in settings.items()
        if v.active
    )


def _others(settings: Settings, v: Value) -> tuple[str, ...]:
    """Return the other usual units of a dial."""
    dimension = parse_unit(v.unit).dimension
    found: tuple[str, ...] = ()
    if v.off:
        return ()
    if v.role is Role.INTEGRAL:
        parallel = settings.equation.form is Form.PARALLEL
        found = {
            Dimension.PER_TIME: ("1/s", "1/min"),
            Dimension.TIME: ("s", "min") if parallel else ("s", "min", "repeat/min"),
        }.get(dimension, ("s", "min") if parallel else _PER_REPEAT)
    elif dimension is Dimension.TIME:
        found = ("s", "min")
    elif v.role is Role.FILTER_TIME:
        found = ("s",)
    elif v.role is Role.GAIN:
        found = _gain_units(settings, dimension)
    return tuple(unit for unit in found if unit != v.unit)


def _gain_units(settings: Settings, dimension: Dimension) -> tuple[str, ...]:
    if dimension is Dimension.RATIO:
        return ("%",)
    return ("%/%",) if dimension is Dimension.PERCENT or not ranges_missing(settings) else ()


def ranges_missing(settings: Settings) -> tuple[str, ...]:
    """Return the signal ranges that these settings' gains depend on and that were not given."""
    needed = set()
    if settings.equation.signals == "engineering":
        needed = {"pv_range", "op_range"}
    for v in settings.values():
        dimension = parse_unit(v.unit).dimension
        if v.active and v.role is Role.GAIN and dimension in (Dimension.OP_PER_PV, Dimension.PV_UNITS, Dimension.PERCENT_PER_PV):
            needed |= {"pv_range", "op_range"} if dimension is Dimension.OP_PER_PV else {"pv_range"}
    given = {"pv_range": settings.pv_range, "op_range": settings.op_range}
    return tuple(name for name in ("pv_range", "op_range") if name in needed and given[name] is None)


def not_stated(settings: Settings, scan: float | None) -> Iterator[str]:
    """Yield what was not given, and what was taken for it."""
    for name in settings.defaulted:
        chosen = settings.options[name]
        others = ", ".join(choice for choice in settings.card.options[name] if choice != chosen)
        yield f"{name}: {chosen}, the card's default (also there: {others})"
    for name, v in settings.items():
        if v.active and not v.given:
            unit = "" if v.unit == "1" else f" {v.unit}"
            yield f"{name}: {number(v.value)}{unit}, {'which is off, ' if v.off else ''}the card's default"
    missing = ranges_missing(settings)
    if len(missing) == 2:
        yield "pv_range, op_range: gains are in output units per PV unit; with both ranges they are in percent of span"
    elif missing:
        yield f"{missing[0]}: a span of 100 was taken; give the range, since the gain depends on it"
    default = settings.equation.scan.default
    if scan is None and settings.equation.form is Form.DAHLIN:
        yield f"scan interval: {default}, the card's default"
    elif scan is None:
        yield f"scan interval: none, so kicks and noise gain are those of the continuous equation (the card runs at {default})"
