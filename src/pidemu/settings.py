"""Dial values on one card: reading them, checking them, and what they amount to in canonical units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from numbers import Real
from typing import TYPE_CHECKING, Any, Final

from pidemu.algorithm import Algorithm, Place, Scheme
from pidemu.card.load import Card, Statement, Variant
from pidemu.card.models import Equation, Filter, Form, Setting, WindupBackCalculation
from pidemu.errors import SettingError, UnitError, suggest
from pidemu.units import (
    FULL,
    Dimension,
    Role,
    Spans,
    Unit,
    convert_unit,
    from_canonical,
    is_reciprocal,
    parse_quantity,
    parse_unit,
    to_canonical,
)

if TYPE_CHECKING:
    from pidemu.law import Law

RESERVED: Final = ("pv_range", "op_range")
"""Names that no setting may have: they state the signal ranges."""

_PER_REPEAT: Final = (Dimension.TIME_PER_REPEAT, Dimension.REPEATS_PER_TIME)


@dataclass(frozen=True, slots=True)
class Value:
    """One dial and its value.

    Attributes
    ----------
    name : str
        The dial.
    setting : Setting
        What the card says of it.
    value : float
        The dial's value, in `unit`.
    unit : str
        The card's unit.
    spans : Spans
        Signal spans, for gains in engineering units.
    given : bool
        Whether the user gave it; otherwise it is the card's default.
    active : bool
        Whether the chosen options use it.
    note : str
        How what was given became `value`; empty if it was given so.
    """

    name: str
    setting: Setting
    value: float
    unit: str
    spans: Spans = FULL
    given: bool = True
    active: bool = True
    note: str = ""

    @property
    def role(self) -> Role:
        """What the dial sets."""
        return Role(self.setting.sets)

    @property
    def off(self) -> bool:
        """Whether the value switches its term off."""
        return self.value in off_values(self.setting)

    @property
    def canonical(self) -> float:
        """The value in canonical units; 0 for a term that is off (see `pidemu.units`)."""
        if self.off and self.role in (Role.INTEGRAL, Role.DERIVATIVE, Role.GAIN):
            return 0.0
        return to_canonical(self.role, self.value, parse_unit(self.unit), self.spans)

    def to(self, unit: str) -> float:
        """Return the value in another unit.

        Parameters
        ----------
        unit : str
            Any unit that fits the dial, such as ``"s/repeat"``.

        Raises
        ------
        UnitError
            The unit is unknown or has the wrong dimension.
        """
        wanted = parse_unit(unit)
        if self.off:
            return from_canonical(self.role, 0.0, wanted, self.spans)
        return convert_unit(self.role, self.value, parse_unit(self.unit), wanted, self.spans)


def off_values(setting: Setting) -> tuple[float, ...]:
    """Return the values that switch a dial's term off."""
    if setting.off is None:
        return ()
    return tuple(setting.off) if isinstance(setting.off, list) else (setting.off,)


def limits(setting: Setting) -> tuple[float, float]:
    """Return the smallest and largest value of a dial [its unit]: the card's, or 0 to infinity."""
    return setting.range if setting.range is not None else (0.0, math.inf)


@dataclass(frozen=True)
class Settings(Mapping[str, Value]):
    """Settings of one card: a read-only mapping from dial names to values.

    Attributes
    ----------
    variant : Variant
        The card with its options chosen.
    values_by_name : dict
        Value by dial.
    pv_range, op_range : tuple of float or None
        Signal ranges [engineering units], where given.
    notes : tuple of str
        What was inferred or converted on the way in.
    defaulted : tuple of str
        Options that nobody chose, so that the card's default was taken.
    """

    variant: Variant
    values_by_name: Mapping[str, Value]
    pv_range: tuple[float, float] | None = None
    op_range: tuple[float, float] | None = None
    notes: tuple[str, ...] = field(default=(), compare=False)
    defaulted: tuple[str, ...] = field(default=(), compare=False)

    def __getitem__(self, name: str) -> Value:
        return self.values_by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.values_by_name)

    def __len__(self) -> int:
        return len(self.values_by_name)

    def __hash__(self) -> int:
        return hash((self.card.id, *self.options.values(), *(v.value for v in self.values())))

    def __repr__(self) -> str:
        return f"<Settings {self.summary}>"

    @property
    def summary(self) -> str:
        """Card, dials and options in one line."""
        dials = ", ".join(f"{n}={v.value:g} {v.unit}" for n, v in self.items() if v.active)
        chosen = "".join(f", {n}={c}" for n, c in self.options.items())
        return f"{self.card.id}: {dials}{chosen}"

    @property
    def card(self) -> Card:
        """The card."""
        return self.variant.card

    @property
    def options(self) -> Mapping[str, str]:
        """Choice by option."""
        return self.variant.chosen

    @property
    def equation(self) -> Equation:
        """The card's equation with the options overlaid."""
        return self.variant.equation

    @property
    def spans(self) -> Spans:
        """Signal spans; 100 where no range was given."""
        return _spans(self.pv_range, self.op_range)

    def by_role(self, role: Role) -> Value | None:
        """Return the active dial that sets `role`, or ``None``."""
        return next((v for v in self.values() if v.role is role and v.active), None)

    def assumptions(self) -> list[Statement]:
        """Return what the card only assumes and these settings rest on: fields of its equation, and options that nobody chose."""
        return self.variant.assumptions(self.defaulted)

    def algorithm(self, *, own_units: bool = False) -> Algorithm:
        """Return the algorithm with its numbers.

        Parameters
        ----------
        own_units : bool
            For a card that computes in engineering units: leave the gains in those units, as the scan program needs them,
            instead of percent of span.

        Raises
        ------
        SettingError
            The settings do not make a controller: no gain to divide by, a filter of zero derivative gain.
        """
        return _algorithm(self, own_units=own_units)

    def law(self, scan: float | None = None) -> Law:
        """Return the linear law (specs/equations.md, section 2).

        Parameters
        ----------
        scan : float, optional
            Scan interval [s], for the discrete law; without it the continuous one.
        """
        from pidemu.law import Law  # the law is made from settings, not settings from the law

        return Law(self.algorithm(), scan)


def _spans(pv: tuple[float, float] | None, op: tuple[float, float] | None) -> Spans:
    return Spans(pv[1] - pv[0] if pv else 100.0, op[1] - op[0] if op else 100.0)


def make_settings(card: Card, given: Mapping[str, object]) -> Settings:
    """Read settings and options; see `Card.settings`."""
    given = dict(given)
    _refuse_twice(card, given)
    pv_range, op_range = (_range(card, name, given.pop(name, None)) for name in RESERVED)
    options = {k: v for k, v in given.items() if _known(k, card.data.options)}
    dials = {k: v for k, v in given.items() if k not in options}
    notes: list[str] = []
    implied = _implied(card, options, dials, notes)
    variant = card.variant(implied)
    folded = {name.casefold() for name in implied}
    defaulted = tuple(name for name in card.options if name.casefold() not in folded)
    spans = _spans(pv_range, op_range)
    values: dict[str, Value] = {}
    faults: list[str] = []
    names = {_known(k, variant.equation.settings) or k: v for k, v in dials.items()}
    unknown = [name for name in names if name not in variant.equation.settings]
    faults += [_unknown(card, variant, name) for name in unknown]
    misspelt = " ".join(faults)
    for name, setting in variant.equation.settings.items():
        active = is_active(variant.equation, name, setting)
        try:
            value = _read(name, setting, names.get(name), spans, active, variant.equation.form)
        except (UnitError, SettingError) as error:
            if f"did you mean '{name}'" not in misspelt:
                faults.append(f"{card.id}: {name}: {error}")
            continue
        if value is not None:
            values[name] = value
            if value.note:
                notes.append(f"{name}: {value.note}")
            if value.given and not active:
                chosen = ", ".join(f"{o}={c}" for o, c in variant.chosen.items())
                notes.append(f"{name} is not used with {chosen}")
    if faults:
        raise SettingError("\n".join(faults))
    return Settings(variant, values, pv_range, op_range, tuple(notes), defaulted)


def _refuse_twice(card: Card, given: Mapping[str, object]) -> None:
    """Refuse a name given in two spellings."""
    seen: dict[str, str] = {}
    for name in given:
        first = seen.setdefault(name.casefold(), name)
        if first != name:
            raise SettingError(f"{card.id}: {first} and {name} are the same setting; give it once")


def _known(name: str, known: Mapping[str, Any]) -> str | None:
    if name in known:
        return name
    folded = [k for k in known if k.casefold() == name.casefold()]
    return folded[0] if len(folded) == 1 else None


def _unknown(card: Card, variant: Variant, name: str) -> str:
    everything = [*card.all_settings(), *card.data.options]
    if name in everything:
        chosen = ", ".join(f"{o}={c}" for o, c in variant.chosen.items())
        return f"{card.id}: {name} is not a setting with {chosen}; settings: {', '.join(variant.equation.settings)}"
    return f"{card.id}: unknown setting '{name}'{suggest(name, everything)}; settings: {', '.join(everything)}"


def _implied(card: Card, options: Mapping[str, object], dials: Mapping[str, object], notes: list[str]) -> dict[str, object]:
    """Choose an option nobody gave where the dials named exist under one of its choices only."""
    chosen = dict(options)
    for name, option in card.data.options.items():
        if _known(name, options) or any(k.casefold() == name.casefold() for k in options):
            continue
        fits = [
            choice
            for choice in card.options[name]
            if all(_known(d, card.variant({**chosen, name: choice}).equation.settings) for d in dials)
        ]
        if fits and option.default not in fits:
            chosen[name] = fits[0]
            notes.append(f"{name}={fits[0]}, since {', '.join(dials)} are its settings")
    return chosen


def _range(card: Card, name: str, given: object) -> tuple[float, float] | None:
    if given is None:
        return None
    try:
        if isinstance(given, str):
            raise ValueError
        low, high = (float(x) for x in given)  # type: ignore[attr-defined]
    except (TypeError, ValueError, OverflowError):
        raise SettingError(f"{card.id}: {name}: '{given}' is not a pair of numbers such as (0, 200)") from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise SettingError(f"{card.id}: {name}: {low:g} to {high:g} is no range; give low, then high")
    return low, high


def is_active(equation: Equation, name: str, setting: Setting) -> bool:
    """Tell whether the equation uses a dial."""
    has_derivative = equation.derivative.on != "none"
    filt = equation.derivative.filter
    windup = equation.integral.windup
    match Role(setting.sets):
        case Role.GAIN:
            return not (equation.form is Form.PARALLEL and equation.proportional.on == "none")
        case Role.INTEGRAL:
            return equation.integral.on != "none"
        case Role.DERIVATIVE:
            return has_derivative
        case Role.FILTER_RATIO | Role.FILTER_GAIN:
            return has_derivative and filt is not None and name in (filt.ratio, filt.gain)
        case Role.FILTER_TIME:
            return filt is not None and name == filt.time and (has_derivative or filt.applies_to != "term")
        case Role.PROPORTIONAL_WEIGHT:
            return equation.proportional.on == "weighted" and name == equation.proportional.weight
        case Role.DERIVATIVE_WEIGHT:
            return equation.derivative.on == "weighted" and name == equation.derivative.weight
        case Role.TRACKING_TIME:
            return isinstance(windup, WindupBackCalculation) and name == windup.tracking_time
        case _:
            return True


def _read(name: str, setting: Setting, given: object, spans: Spans, active: bool, form: Form) -> Value | None:
    unit = parse_unit(setting.unit)
    if given is None:
        if setting.default is not None:
            return Value(name, setting, setting.default, unit.name, spans, given=False, active=active)
        if not active:
            return None
        raise SettingError(f"missing; it {_purpose(setting)}, in {unit.name}")
    number, written, note = _number(given, setting, unit, spans, form)
    value = Value(name, setting, number, unit.name, spans, active=active, note=note)
    _check(value, given if written else None)
    return value


def _purpose(setting: Setting) -> str:
    return f"sets the {setting.sets.replace('-', ' ')}" + (f" ({setting.about})" if setting.about else "")


def _number(given: object, setting: Setting, unit: Unit, spans: Spans, form: Form) -> tuple[float, bool, str]:
    """Return the dial's number, whether another unit was written, and the conversion in words."""
    if isinstance(given, bool) or not isinstance(given, str | Real):
        raise SettingError(f"'{given}' is not a number, nor a text such as \"20 {unit.name}\"")
    if isinstance(given, Real):
        try:
            return float(given), False, ""
        except OverflowError:
            raise SettingError(f"{str(given)[:12]}... is too large a number") from None
    if given.strip().casefold() == "off":
        if not off_values(setting):
            raise SettingError("cannot be switched off: the card states no off value")
        return off_values(setting)[0], False, f"off is {off_values(setting)[0]:g} {unit.name}"
    number, written = parse_quantity(given)
    if written is None or written == unit:
        return number, False, ""
    role = Role(setting.sets)
    if role is Role.INTEGRAL and form is Form.PARALLEL and written.dimension in _PER_REPEAT and unit.dimension not in _PER_REPEAT:
        raise SettingError(
            f"'{given}' counts repeats of the proportional action, but this dial is a gain of its own, in {unit.name}; "
            f"write {number:g} {written.name.replace('repeat', '1').replace('/1', '')} if the gain is meant"
        )
    value = convert_unit(role, number, written, unit, spans)
    inverted = is_reciprocal(role, written) != is_reciprocal(role, unit)
    how = f", the reciprocal, since the dial is in {unit.name}" if inverted else ""
    return value, True, f"{given.strip()} is {value:.6g} {unit.name}{how}"


def _check(value: Value, written: object) -> None:
    setting, unit = value.setting, value.unit
    unit = "" if unit == "1" else f" {unit}"
    shown = f"{value.value:.6g}{unit}" + (f" (given as {written})" if written is not None else "")
    if math.isnan(value.value):
        raise SettingError("is not a number (NaN)")
    if value.off:
        return
    low, high = limits(setting)
    if not low <= value.value <= high:
        allowed = f"{low:g} to {high:g}{unit}"
        off = off_values(setting)
        raise SettingError(f"{shown} is outside {allowed}" + (f"; {off[0]:g} switches it off" if off else ""))
    if math.isinf(value.value):
        raise SettingError(f"{shown} is infinite, and infinity is no off value here")
    if value.value == 0 and is_reciprocal(value.role, parse_unit(value.unit)):
        raise SettingError(f"{shown} would be infinite action; the smallest value above zero is meant, or another unit")


def _pick(settings: Settings, value: str | float | None, default: float) -> float:
    """Return a number that a card gives itself, or by the name of a setting."""
    if isinstance(value, str):
        return settings[value].canonical
    return default if value is None else value


def _algorithm(settings: Settings, *, own_units: bool) -> Algorithm:
    equation = settings.equation
    engineering = equation.signals == "engineering"
    spans = Spans() if own_units and engineering else settings.spans

    def number(role: Role, default: float) -> float:
        value = settings.by_role(role)
        if value is None:
            return default
        if value.off:
            return 0.0
        return to_canonical(role, value.value, parse_unit(value.unit), spans)

    gain = number(Role.GAIN, 0.0 if equation.form is Form.PARALLEL else 1.0)
    scale = number(Role.MULTIPLIER, 1.0)
    rate = number(Role.INTEGRAL, 0.0) if equation.integral.on != "none" else 0.0
    time = number(Role.DERIVATIVE, 0.0) if equation.derivative.on != "none" else 0.0
    if equation.form is Form.PARALLEL:
        scale *= float(spans.ratio) if engineering else 1.0
        kp = gain * number(Role.MULTIPLIER, 1.0)
        ki, kd = rate * scale, time * scale
    else:
        kp = gain * scale
        ki, kd = kp * rate, kp * time
    Tf, place, order = _filter(settings, equation.derivative.filter, rate, time)
    if equation.derivative.filter is not None and equation.derivative.filter.applies_to == "lead-lag":
        kd -= kp * Tf
    if equation.proportional.on == "none":
        kp = 0.0
    if equation.form is Form.SERIES and kd and not kp:
        chosen = ", ".join(f"{o}={c}" for o, c in settings.options.items())
        raise SettingError(
            f"{settings.card.id}: a series form with derivative but without proportional action is not defined; change {chosen}"
        )
    windup = equation.integral.windup
    return Algorithm(
        series=equation.form is Form.SERIES,
        kp=kp,
        ki=ki,
        kd=kd,
        b=_weight(settings, equation.proportional.on, equation.proportional.weight),
        c=_weight(settings, equation.derivative.on, equation.derivative.weight),
        Tf=Tf,
        filter_on=place,
        filter_order=order,
        velocity=equation.implementation == "velocity",
        integral_rule=equation.integral.rule,
        derivative_rule=equation.derivative.rule,
        filter_rule=(equation.derivative.filter and equation.derivative.filter.rule) or equation.derivative.rule,
        windup=_scheme(windup.scheme),
        tracking_time=_tracking(settings, rate, time, kp, ki, kd) if ki else 0.0,
        accumulated=equation.proportional.accumulated,
        load_output=equation.transfer.start == "load-output",
        restarted=equation.transfer.derivative == "restarted",
    )


def _scheme(scheme: Scheme) -> Scheme:
    return scheme


def _weight(settings: Settings, on: str, weight: str | float | None) -> float:
    return _pick(settings, weight, 1.0) if on == "weighted" else float(on == "error")


def _filter(settings: Settings, filt: Filter | None, rate: float, time: float) -> tuple[float, Place, Any]:
    if filt is None:
        return 0.0, "term", 1
    place: Place = "term" if filt.applies_to == "lead-lag" else filt.applies_to
    if filt.time is not None:
        return _pick(settings, filt.time, 0.0), place, filt.order
    base = time / (1 + rate * time) if filt.of == "effective-derivative" else time
    if base == 0:
        return 0.0, place, filt.order
    if isinstance(filt.gain, str) and settings[filt.gain].off:
        return 0.0, place, filt.order
    if filt.gain is not None:
        gain = _pick(settings, filt.gain, math.inf)
        if gain == 0:
            raise SettingError(
                f"{settings.card.id}: {filt.gain} is 0: a derivative gain of zero is no derivative; set the derivative to zero"
            )
        return base / gain, place, filt.order
    return base * _pick(settings, filt.ratio, 0.0), place, filt.order


def _tracking(settings: Settings, rate: float, time: float, kp: float, ki: float, kd: float) -> float:
    """Return the time in which the integral follows the cut-off [s] (specs/equations.md, section 5)."""
    parallel = settings.equation.form is Form.PARALLEL and kp != 0
    integral_time, derivative_time = (kp / ki, kd / kp) if parallel else (1 / rate, time)
    windup = settings.equation.integral.windup
    given = windup.tracking_time if isinstance(windup, WindupBackCalculation) else "Ti"
    if given == "Ti":
        return abs(integral_time)
    if given == "sqrt(Ti Td)":
        return math.sqrt(abs(integral_time * derivative_time)) if derivative_time else abs(integral_time)
    return _pick(settings, given, integral_time)
