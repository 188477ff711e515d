"""Reading settings: what a user gives, as numbers or with units, checked against a card."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pidemu.card.load import Card, Variant, match_name
from pidemu.card.model.base import Form
from pidemu.card.model.card_file import Equation, Setting, default_scan
from pidemu.columns.functions import isinf, isnan
from pidemu.errors import SettingError, UnitError, suggest
from pidemu.plausible import GAIN, LEVEL, RATE, RATIO, TIME, WEIGHT, PlausibleSize, number, shown
from pidemu.settings.ranges import RANGES, SignalRange, are_limits, read_range
from pidemu.settings.settings import Settings, Value, limits, off_values, spans_of
from pidemu.units import (
    LEVELS,
    RATES,
    Dimension,
    Role,
    Spans,
    Unit,
    check_unit,
    convert_unit,
    is_reciprocal,
    parse_quantity,
    parse_unit,
)

_RATES: Final = (Dimension.REPEATS_PER_TIME, Dimension.PER_TIME)
_OF_WHOLE_OUTPUT: Final = (Dimension.PV_UNITS, Dimension.PERCENT_PER_PV)
_QUANTITIES: Final[dict[Role, PlausibleSize]] = {
    **dict.fromkeys((Role.GAIN, Role.MULTIPLIER, Role.PROCESS_GAIN), GAIN),
    **dict.fromkeys((Role.DERIVATIVE, Role.FILTER_TIME, Role.TRACKING_TIME), TIME),
    **dict.fromkeys((Role.PROCESS_TIME, Role.PROCESS_DELAY, Role.CLOSED_LOOP_TIME), TIME),
    Role.INTEGRAL: RATE,
    **dict.fromkeys((Role.FILTER_RATIO, Role.FILTER_GAIN, Role.FILTER_FACTOR), RATIO),
    **dict.fromkeys((*LEVELS, *RATES), LEVEL),
}
"""What a dial's canonical value is; a weight where nothing is stated."""
_PER_REPEAT: Final = (Dimension.TIME_PER_REPEAT, Dimension.REPEATS_PER_TIME)


def make_settings(card: Card, given: Mapping[str, object]) -> Settings:
    """Read settings and options; see `Card.settings`."""
    given = dict(given)
    _refuse_twice(card, given)
    pv_range, op_range = (signal_range(card, name, given.pop(name, None)) for name in RANGES)
    options = {k: v for k, v in given.items() if match_name(k, card.data.options)}
    dials = {k: v for k, v in given.items() if k not in options}
    notes: list[str] = []
    implied = _implied(card, options, dials, notes)
    variant = card.variant(implied)
    folded = {name.casefold() for name in implied}
    defaulted = tuple(name for name in card.options if name.casefold() not in folded)
    op_range = op_range or _output_range(variant.equation)
    in_scans = any(parse_unit(s.unit).scans for s in variant.equation.settings.values())
    scan = default_scan(variant.equation) if in_scans else None
    spans = spans_of(pv_range, op_range, scan)
    values: dict[str, Value] = {}
    faults: list[str] = []
    names = {match_name(k, variant.equation.settings) or k: v for k, v in dials.items()}
    unknown = [name for name in names if name not in variant.equation.settings]
    faults += [_unknown(card, variant, name) for name in unknown]
    misspelt = " ".join(faults)
    for name, setting in variant.equation.settings.items():
        active = name in variant.active
        try:
            value = _read(name, setting, names.get(name), spans, active, variant.equation.form, (bool(pv_range), bool(op_range)))
        except (UnitError, SettingError) as error:
            if f"did you mean '{name}'" not in misspelt:
                faults.append(f"{card.id}: {name}: {error}")
            continue
        if value is not None:
            values[name] = value
            if value.note:
                notes.append(f"{name}: {value.note}")
            if value.given and not active:
                notes.append(f"{name} is not used with {variant.choice_text}")
    if faults:
        raise SettingError("\n".join(faults))
    return Settings(variant, values, pv_range, op_range, tuple(notes), defaulted, scan=scan)


def _refuse_twice(card: Card, given: Mapping[str, object]) -> None:
    """Refuse a name given in two spellings."""
    seen: dict[str, str] = {}
    for name in given:
        first = seen.setdefault(name.casefold(), name)
        if first != name:
            raise SettingError(f"{card.id}: {first} and {name} are the same setting; give it once")


def _unknown(card: Card, variant: Variant, name: str) -> str:
    everything = [*card.all_settings(), *card.data.options]
    if name in everything:
        return f"{card.id}: {name} is not a setting with {variant.choice_text}; settings: {', '.join(variant.equation.settings)}"
    return f"{card.id}: unknown setting '{name}'{suggest(name, everything)}; settings: {', '.join(everything)}"


def _implied(card: Card, options: Mapping[str, object], dials: Mapping[str, object], notes: list[str]) -> dict[str, object]:
    """Choose an option that was not given where the dials named exist under one of its choices only."""
    chosen = dict(options)
    for name, option in card.data.options.items():
        if match_name(name, options):
            continue
        fits = [
            choice
            for choice in card.options[name]
            if all(match_name(d, card.variant({**chosen, name: choice}).equation.settings) for d in dials)
        ]
        if len(fits) > 1 and option.default not in fits:
            raise SettingError(f"{card.id}: {', '.join(dials)} go with {name}={' or '.join(fits)}; say which")
        if fits and option.default not in fits:
            chosen[name] = fits[0]
            notes.append(f"{name}={fits[0]}, since {', '.join(dials)} are its settings")
    return chosen


def signal_range(card: Card, name: str, given: object) -> SignalRange | None:
    """Return a signal range that is given for a card, if it is; raises `SettingError` where it is not a range."""
    try:
        return None if given is None else read_range(given)
    except SettingError as error:
        raise SettingError(f"{card.id}: {name}: {error}") from None


def _output_range(equation: Equation) -> SignalRange | None:
    """Return the output's range where it is the card's: a band, or a gain in % of output, moves it over just that."""
    units = [parse_unit(s.unit).dimension for s in equation.settings.values() if s.sets == "gain"]
    known = equation.signals == "engineering" and are_limits(equation.output.limits)
    return SignalRange(*equation.output.limits) if known and units and units[0] in _OF_WHOLE_OUTPUT else None


def _read(
    name: str, setting: Setting, given: object, spans: Spans, active: bool, form: Form, ranged: tuple[bool, bool]
) -> Value | None:
    unit = parse_unit(setting.unit)
    if given is None:
        if setting.default is not None:
            default = Value(name, setting, setting.default, unit.name, spans, given=False, active=active)
            _check_size(default, f"the card's default, {shown(setting.default)} {unit.name},")
            return default
        if not active:
            return None
        raise SettingError(f"missing; it {_purpose(setting)}, in {unit.name}")
    number, written, note = _number(given, setting, unit, spans, form, ranged)
    typed = given if isinstance(given, str) and written else number
    unclear = note != "" and isinstance(given, str) and _counts_the_other_way(given, setting, unit, form)
    value = Value(name, setting, number, unit.name, spans, active=active, note=note, typed=typed, unclear=unclear)
    _check(value, given if written else None)
    return value


def _counts_the_other_way(given: str, setting: Setting, unit: Unit, form: Form) -> bool:
    """Whether a time without "per" was written for an integral dial that counts repeats per time."""
    if Role(setting.sets) is not Role.INTEGRAL or form is Form.PARALLEL:
        return False
    written = parse_quantity(given)[1] if given.strip().casefold() != "off" else None
    return written is not None and written.dimension is Dimension.TIME and unit.dimension in _RATES


def _purpose(setting: Setting) -> str:
    return f"sets the {setting.sets.replace('-', ' ')}" + (f" ({setting.about})" if setting.about else "")


def _number(
    given: object, setting: Setting, unit: Unit, spans: Spans, form: Form, ranged: tuple[bool, bool]
) -> tuple[float, bool, str]:
    """Return the dial's number, whether another unit was written, and the conversion in words."""
    if not isinstance(given, str):
        try:
            return number(given), False, ""
        except ValueError as error:
            such = f', nor a text such as "20 {unit.name}"' if "is not" in str(error) else ""
            raise SettingError(f"{error}{such}") from None
    if given.strip().casefold() == "off":
        if not off_values(setting):
            raise SettingError("cannot be switched off: the card states no off value")
        return off_values(setting)[0], False, f"off is {off_values(setting)[0]:g} {unit.name}"
    amount, written = parse_quantity(given)
    if written is None or written == unit:
        return amount, False, ""
    role = Role(setting.sets)
    _fit(role, written, unit)
    if written.scans != unit.scans:
        raise SettingError(
            f"'{given}' {'counts in scans' if written.scans else 'does not count in scans'}, this dial is in {unit.name}; "
            f"what that is depends on the scan interval: work it out and write it in {unit.name}"
        )
    if role is Role.INTEGRAL and form is Form.PARALLEL and written.dimension in _PER_REPEAT and unit.dimension not in _PER_REPEAT:
        raise SettingError(
            f"'{given}' counts repeats of the proportional action, but this dial is a gain of its own, in {unit.name}; "
            f"write {amount:g} {written.name.replace('repeat', '1').replace('/1', '')} if the gain is meant"
        )
    _need_ranges(written, unit, ranged)
    value = convert_unit(role, amount, written, unit, spans)
    inverted = is_reciprocal(role, written) != is_reciprocal(role, unit)
    how = f", the reciprocal, since the dial is in {unit.name}" if inverted else ""
    return value, True, f"{given.strip()} is {value:.6g} {unit.name}{how}"


def _fit(role: Role, written: Unit, unit: Unit) -> None:
    """Refuse a unit that cannot measure what the dial sets; where the dial counts in scans, only its own unit will do."""
    try:
        check_unit(role, written)
    except UnitError as error:
        if not unit.scans:
            raise
        raise SettingError(f"{str(error).partition('; use one of')[0]}; write it in {unit.name}") from None


def _need_ranges(written: Unit, unit: Unit, ranged: tuple[bool, bool]) -> None:
    """Refuse a unit whose conversion takes the signal ranges, where these are not given."""
    needs = {Dimension.PV_UNITS: (True, False), Dimension.PERCENT_PER_PV: (True, False), Dimension.OP_PER_PV: (True, True)}
    pv, op = needs.get(written.dimension, needs.get(unit.dimension, (False, False)))
    if written.degree is not None and unit.degree is not None:
        pv = op = False  # two kinds of degree
    missing = [name for name, needed, given in zip(RANGES, (pv, op), ranged, strict=True) if needed and not given]
    if missing:
        raise SettingError(
            f"{written.name} is {written.dimension.value}, for a dial in {unit.name}: {' and '.join(missing)} must be given"
        )


def _check(value: Value, written: object) -> None:
    setting, unit = value.setting, value.unit
    unit = "" if unit == "1" else f" {unit}"
    words = f"{value.value:.6g}{unit}" + (f" (given as {written})" if written is not None else "")
    if isnan(value.value):
        raise SettingError("is not a number (NaN)")
    if value.off:
        return
    low, high = limits(setting)
    if not low <= value.value <= high:
        allowed = f"{low:g} to {high:g}{unit}"
        off = off_values(setting)
        raise SettingError(f"{words} is outside {allowed}" + (f"; {off[0]:g} switches it off" if off else ""))
    if isinf(value.value):
        off = off_values(setting)
        does = f"; {off[0]:g} does" if off else ""
        raise SettingError(f"{words} is infinite, and infinity does not switch it off here{does}")
    if value.value == 0 and is_reciprocal(value.role, parse_unit(value.unit)):
        off = off_values(setting)
        instead = f"{off[0]:g} switches it off" if off else "give the smallest value above zero, or another unit"
        raise SettingError(f"{words} would be infinite action; {instead}")
    _check_size(value, words)


def _check_size(value: Value, words: str) -> None:
    """Refuse a dial whose canonical value no controller has; what computes with it could not hold it."""
    canonical, quantity = value.canonical, _QUANTITIES.get(value.role, WEIGHT)
    if value.off or not value.value or isinf(value.value):
        return
    if not canonical or not quantity.has(canonical):
        same = f"{canonical:.6g} {quantity.unit}".rstrip()
        raise SettingError(quantity.refusal(words if same in words else f"{words} ({same})"))
