"""What a bare number on an integral dial may mean: units, gain or reset rate, and each in words."""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Real

from pidemu.card.model.base import Form
from pidemu.errors import UnitError
from pidemu.settings.settings import Settings
from pidemu.units import Dimension, Role, Unit, parse_quantity, parse_unit


def bare(given: object) -> float | None:
    """Return a number that is given without a unit; ``None`` for anything else."""
    if isinstance(given, str):
        try:
            number, unit = parse_quantity(given)
        except UnitError:
            return None
        return number if unit is None else None
    return float(given) if isinstance(given, Real) and not isinstance(given, bool) else None


def written(given: object) -> str:
    """Return what was given as one would write it: numbers in full, and short where that is enough."""
    if not isinstance(given, Real):
        return str(given).strip()
    short = f"{float(given):g}"
    return short if float(short) == float(given) else repr(float(given))


def possible_units(unit: Unit, form: Form) -> tuple[str, ...]:
    """Return the units that a bare number on an integral dial may be in, the card's own first.

    A time per repeat and repeats per that time are taken for each other; independent gains per second and per minute.

    Examples
    --------
    >>> possible_units(parse_unit("min/repeat"), Form.STANDARD)
    ('min/repeat', 'repeat/min')
    >>> possible_units(parse_unit("1/s"), Form.PARALLEL)
    ('1/s', '1/min')
    """
    time = unit.name.replace("/repeat", "").split("/")[-1]
    match unit.dimension:
        case Dimension.PER_TIME if form is Form.PARALLEL:
            return (unit.name, *(u for u in ("1/s", "1/min") if u != unit.name))
        case Dimension.PER_TIME:
            return unit.name, time
        case Dimension.TIME if form is Form.PARALLEL:
            return unit.name, f"1/{time}"
        case Dimension.REPEATS_PER_TIME:
            return unit.name, f"{time}/repeat"
        case _:
            return unit.name, f"repeat/{time}"


def as_reset_rates(name: str, number: float, units: Iterable[str], settings: Settings) -> list[tuple[str, str]]:
    """Return an independent integral gain read as a reset rate, ``ki = kp rate`` (specs/equations.md, section 1).

    Parameters
    ----------
    name : str
        The integral dial.
    number : float
        The number that may be a rate.
    units : iterable of str
        The units ``1/time`` it may be in.
    settings : Settings
        The same settings with the number read as a gain, not zero.

    Returns
    -------
    list of tuple
        The gain that the rate amounts to, with its unit, and what it is in words. Empty where there is no proportional gain,
        or where the dial is no independent gain.
    """
    a, dial = settings.algorithm(), settings[name]
    if settings.equation.form is not Form.PARALLEL or parse_unit(dial.unit).dimension is not Dimension.PER_TIME:
        return []
    if not a.kp or not a.ki:
        return []
    gain = a.kp * dial.canonical / a.ki  # the proportional gain in the dial's own terms: without multipliers, spans and signs
    rates = []
    for unit in units:
        rate, own = f"{number:.6g} {unit.replace('1/', 'repeat/')}", number * gain
        rates.append((f"{own:.12g} {unit}", f"{name} = {rate}, a reset rate: times the gain it is {own:.6g} {unit}"))
    return rates


def in_words(settings: Settings, quantity: object) -> str:
    """Return what the integral setting, given as `quantity`, amounts to; empty where none is given or it is not at work."""
    value = settings.by_role(Role.INTEGRAL)
    if value is None or not value.given:
        return ""
    if value.off:
        return f"{value.name} off"
    unit = value.unit if bare(quantity) is not None else written(quantity).partition(" ")[2]
    said = f"{value.name} = {written(quantity)}" + (f" {unit}" if bare(quantity) is not None else "")
    if settings.equation.form is Form.PARALLEL:
        return f"{said}, a gain of its own" + (f" ({value.to('1/s'):.6g} 1/s)" if unit != "1/s" else "")
    return said + (f" ({value.to('s/repeat'):.6g} s per repeat)" if unit not in ("s", "s/repeat") else "")
