"""What is free to choose on a target card, and how canonical numbers become its settings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, Literal

from pidemu.algorithm.model import Algorithm
from pidemu.card.load import Card, Variant
from pidemu.card.model.base import Form, Rule
from pidemu.card.model.card_file import Equation, Setting, default_scan
from pidemu.card.references import is_active
from pidemu.errors import SettingError
from pidemu.settings.ranges import SignalRange
from pidemu.settings.settings import Settings, limits, off_values, spans_of
from pidemu.units import Role, from_canonical, parse_unit, to_canonical

FilterKind = Literal["none", "time", "ratio", "gain"]

_CORE: Final = (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE)
_HARDLY: Final = 100.0
"""Derivative gain of a filter that is hardly one."""
_USUAL: Final = {"gain": 10.0, "ratio": 0.1}
"""Filter of a derivative where the card delivers none: a tenth of the derivative time."""
_WEIGHTS: Final = (Role.PROPORTIONAL_WEIGHT, Role.DERIVATIVE_WEIGHT)


def is_computed(equation: Equation, name: str, role: Role) -> bool:
    """Tell whether a conversion sets a dial: a term's, the derivative's filter or a setpoint weight."""
    return role in _CORE or is_settled_later(equation, name, role)


def is_settled_later(equation: Equation, name: str, role: Role) -> bool:
    """Tell whether a conversion sets a dial only where something depends on it."""
    filt = equation.derivative.filter
    return role in _WEIGHTS or (filt is not None and name in (filt.ratio, filt.gain, filt.time))


@dataclass(frozen=True, slots=True)
class Numbers:
    """The numbers of a target's own form, in canonical units.

    Attributes
    ----------
    K : float
        Gain [%/%]. The first three may be arrays in `Target.algorithm_of`.
    ki : float
        Integral gain, ``K/Ti`` in the standard and series forms [1/s].
    kd : float
        ``K Td`` with Td the derivative dial, or the parallel form's derivative gain [s].
    Tf : float or None
        Filter time [s], where the target's filter is free; ``None``: as the target fixes it.
    b, c : float or None
        Setpoint weights, where the target's are free.
    multiplier : float or None
        Overall multiplier, where the conversion chooses one; ``None``: as it is.
    """

    K: Any
    ki: Any
    kd: Any
    Tf: float | None = None
    b: float | None = None
    c: float | None = None
    multiplier: float | None = None


@dataclass(frozen=True, slots=True)
class TargetFilter:
    """The filter that goes with a target's derivative.

    Attributes
    ----------
    kind : str
        How the card states it.
    setting : str or None
        The dial that sets it.
    free : bool
        Whether the conversion may choose it.
    value : float
        Its present value: time [s], ratio or gain.
    needed : bool
        Whether the derivative is nothing without it: the lagged-difference rule.
    lead_lag : bool
        Whether it is the lag of a lead-lag.
    of : {"derivative", "derivative-time", "effective-derivative"}
        What ratio or gain refer to: the derivative dial, ``kd/kp`` of a parallel form, ``Ti Td/(Ti + Td)``.
    low, high : float
        Allowed values, in the dial's own terms made canonical.
    """

    kind: FilterKind = "none"
    setting: str | None = None
    free: bool = False
    value: float = 0.0
    needed: bool = False
    lead_lag: bool = False
    of: Literal["derivative", "derivative-time", "effective-derivative"] = "derivative"
    low: float = 0.0
    high: float = math.inf

    @property
    def ratio(self) -> float:
        """``Tf`` per derivative time; 0 where the filter is none or a fixed time."""
        if self.kind == "ratio":
            return self.value
        return 1 / self.value if self.kind == "gain" and self.value else 0.0

    @property
    def time(self) -> float:
        """``Tf`` [s] of a filter stated as a time; otherwise 0."""
        return self.value if self.kind == "time" else 0.0

    def nearest_to(self, Tf: float, base: float) -> TargetFilter:
        """Return the filter fixed at the allowed value nearest to `Tf` [s]; `base` is the derivative time it refers to [s].

        Where none is wanted of a target that always has one, it is a hundredth of the derivative time: far above the loop band.
        """
        if self.kind == "time":
            wanted = Tf or (base / _HARDLY if self.needed else 0.0)
        elif self.kind == "ratio":
            wanted = Tf / base if base > 0 else self.value
        elif self.kind == "gain":
            wanted = base / Tf if Tf > 0 else min(self.high, max(_HARDLY, self.value))
        else:
            return self
        return replace(self, free=False, value=min(max(wanted, self.low), self.high))


class Target:
    """A card to convert to, with its options chosen and some dials perhaps given.

    Parameters
    ----------
    card : Card
        The card.
    options : mapping
        Options by name.
    given : mapping
        Dials that the user has fixed.
    pv_range, op_range : SignalRange, optional
        Ranges of measurement and output.
    pace : float
        Interval at which the target is really executed per the one that it computes with; see `Settings.pace`.
    scan : float, optional
        Scan interval that it computes with [s], for dials that count in scans; by default the card's.
    source_lag : float, optional
        The lag with which the source filters its measurement [s], where the target is to have it too, in its own filter or in front
        of it; ``None``: whatever filters the target has are part of what is matched.
    """

    def __init__(
        self,
        card: Card,
        options: Mapping[str, object],
        given: Mapping[str, object],
        pv_range: SignalRange | None,
        op_range: SignalRange | None,
        pace: float = 1.0,
        scan: float | None = None,
        source_lag: float | None = None,
    ) -> None:
        self.card = card
        self.pace = pace
        self.variant: Variant = card.variant(options)
        self.options = dict(options)
        self.given = dict(given)
        self.ranges = {k: v for k, v in (("pv_range", pv_range), ("op_range", op_range)) if v is not None}
        self.scan = scan
        self.spans = spans_of(pv_range, op_range, default_scan(self.variant.equation) if scan is None else scan)
        self.form = self.variant.equation.form
        self.idle_gain = 1.0
        """Gain taken where there is no proportional term, so that the gain only scales the two times."""
        self.lag = 0.0
        """A lag in front of the block [s]."""
        self.is_paired = source_lag is not None
        """Whether source and target filter the measurement alike, so that the rest is matched as if neither did."""
        if source_lag is not None:
            self._filter_the_measurement(source_lag)
        self._check_given()
        dial = self.dial(Role.MULTIPLIER)
        self.multiplier = self.template()[dial[0]].canonical if dial is not None else 1.0
        """Overall multiplier of all three terms."""
        self.filter = self._find_filter()
        """The filter, whether it is free and, once a match has fixed it, its value."""

    def _filter_the_measurement(self, lag: float) -> None:
        """Set the target's own filter on the measurement to a lag [s], or ask for one in front of the block."""
        measurement = self.variant.equation.measurement
        name = None if measurement is None or measurement.filter is None else measurement.filter.time
        if not isinstance(name, str):
            self.lag = lag
        elif name.casefold() not in {n.casefold() for n in self.given}:
            setting = self.variant.equation.settings[name]
            self.given[name] = from_canonical(Role.FILTER_TIME, lag / self.pace, parse_unit(setting.unit), self.spans)

    def _check_given(self) -> None:
        known = {n.casefold(): n for n in self.variant.equation.settings}
        self.given = {known.get(n.casefold(), n): v for n, v in self.given.items()}
        for name in self.given:
            if name not in self.variant.equation.settings:
                self.template(**{name: self.given[name]})  # says what is wrong with the name
            elif Role(self.variant.equation.settings[name].sets) in _CORE:
                raise SettingError(f"{self.card.id}: {name} is what the conversion computes; it cannot be given")

    def dial(self, role: Role) -> tuple[str, Setting] | None:
        """Return the active dial that sets `role`."""
        for name, setting in self.variant.equation.settings.items():
            if setting.sets == role.value and is_active(self.variant.equation, name, setting):
                return name, setting
        return None

    def is_free(self, name: str, setting: Setting) -> bool:
        """Whether the conversion may choose a dial."""
        return name not in self.given and setting.scope == "loop"

    def may_choose(self, role: Role) -> bool:
        """Whether the conversion may choose the dial that sets `role`: a setpoint weight, an overall multiplier."""
        dial = self.dial(role)
        return dial is not None and self.is_free(*dial)

    @cached_property
    def has_proportional(self) -> bool:
        """Whether there is a proportional term on the measurement."""
        return self.variant.equation.proportional.on != "none"

    @cached_property
    def has_integral(self) -> bool:
        """Whether there is an integral term."""
        return self.variant.equation.integral.on != "none" and self.dial(Role.INTEGRAL) is not None

    @cached_property
    def has_derivative(self) -> bool:
        """Whether there is a derivative term."""
        return self.variant.equation.derivative.on != "none" and self.dial(Role.DERIVATIVE) is not None

    @property
    def percent_per_unit(self) -> float:
        """Percent gain that a gain of 1 in the card's own signals amounts to [%/%]."""
        return float(self.spans.ratio) if self.variant.equation.signals == "engineering" else 1.0

    def _find_filter(self) -> TargetFilter:
        filt = self.variant.equation.derivative.filter
        if filt is None:
            return TargetFilter()
        kind: FilterKind = "ratio" if filt.ratio is not None else "gain" if filt.gain is not None else "time"
        given = filt.ratio if kind == "ratio" else filt.gain if kind == "gain" else filt.time
        needed = self.variant.equation.derivative.rule is Rule.LAGGED_DIFFERENCE
        shape: dict[str, Any] = {"lead_lag": filt.applies_to == "lead-lag", "of": filt.of, "needed": needed}
        if not isinstance(given, str):
            return TargetFilter(kind, None, False, float(given or 0.0) * (self.pace if kind == "time" else 1.0), **shape)
        setting = self.variant.equation.settings[given]
        role, unit = Role(setting.sets), parse_unit(setting.unit)
        pace = self.pace if kind == "time" else 1.0
        low, high = (to_canonical(role, x, unit, self.spans) * pace for x in limits(setting))
        present, free = self.template()[given].canonical * pace, self.is_free(given, setting)
        if free and setting.default is None and kind != "time":
            present = min(max(_USUAL[kind], low), high)
        return TargetFilter(kind, given, free, present, low=low, high=high, **shape)

    @cached_property
    def shape(self) -> Algorithm:
        """The target's algorithm with placeholder numbers, for everything but its numbers."""
        found = self.template().algorithm()
        return found.filtered(None) if self.is_paired else found

    def template(self, **extra: object) -> Settings:
        """Return settings with placeholder numbers in the dials that a conversion computes."""
        values: dict[str, object] = {**self.given, **extra}
        for name, setting in self.variant.equation.settings.items():
            if name not in values and (setting.default is None or setting.sets in ("gain", "integral", "derivative")):
                undefined = setting.sets == "derivative" and self.form is Form.SERIES and not self.has_proportional
                values[name] = (*off_values(setting), 0.0)[0] if undefined else _placeholder(setting)
        settings = self.card.settings({**self.variant.chosen, **values, **self.ranges})
        return replace(settings, pace=self.pace, lag=self.lag).at_scan(self.scan)

    def settings(self, n: Numbers) -> Settings:
        """Return the target's settings for canonical numbers.

        Raises
        ------
        SettingError
            A dial would leave its range, or a term that cannot be switched off would have to be.
        """
        dials = {**self.options, **self._idle(), **self.given, **self._dials(n), **self.ranges}
        return replace(self.card.settings(dials), pace=self.pace, lag=self.lag).at_scan(self.scan)

    def _idle(self) -> dict[str, object]:
        """Return values for filter and weights that have no default, where nothing depends on them."""
        found: dict[str, object] = {}
        for name, setting in self._without_default():
            if is_settled_later(self.variant.equation, name, Role(setting.sets)):
                found[name] = 1.0 if Role(setting.sets) in _WEIGHTS else _placeholder(setting)
        return found

    def _without_default(self) -> Iterator[tuple[str, Setting]]:
        for name, setting in self.variant.equation.settings.items():
            if setting.default is None and is_active(self.variant.equation, name, setting):
                yield name, setting

    def reject_missing(self) -> None:
        """Refuse to go on where a dial is neither computed by a conversion nor given, and has no default.

        Raises
        ------
        SettingError
            Naming these dials.
        """
        equation = self.variant.equation
        idle = [n for n, s in self._without_default() if not is_computed(equation, n, Role(s.sets)) and n not in self.given]
        missing = [n for n in idle if equation.settings[n].sets != "multiplier"]
        if missing:
            raise SettingError(
                f"{self.card.id}: a conversion does not compute {' and '.join(missing)}, and the card has no default; "
                f"give {'it' if len(missing) == 1 else 'them'}, with --set {missing[0]}=VALUE"
            )

    def _dials(self, n: Numbers) -> dict[str, float]:
        parallel = self.form is Form.PARALLEL
        scale = self.multiplier if n.multiplier is None else n.multiplier
        engineering = self.percent_per_unit
        per_gain = 1 / n.K if n.K and not parallel else 0.0
        rate = n.ki / (scale * engineering) if parallel else n.ki * per_gain
        time = n.kd / (scale * engineering) if parallel else n.kd * per_gain
        rate, time = rate * self.pace, time / self.pace
        sign = self.variant.equation.action.gain_sign  # a parallel form carries it on every gain, the others on one
        each = sign if parallel else 1.0
        wanted = [
            (Role.GAIN, sign * n.K / scale), (Role.INTEGRAL, each * rate), (Role.DERIVATIVE, each * time), (Role.MULTIPLIER, scale),
        ]  # fmt: skip
        if n.b is not None:
            wanted.append((Role.PROPORTIONAL_WEIGHT, n.b))
        if n.c is not None:
            wanted.append((Role.DERIVATIVE_WEIGHT, n.c))
        dials = {}
        for role, value in wanted:
            dial = self.dial(role)
            if dial is not None:
                dials[dial[0]] = self._in_reach(*dial, self._to_dial(*dial, value))
        if n.Tf is not None and self.filter.setting is not None:
            dials.update(self._filter_dial(n.Tf, self.filter_base(n)))
        return dials

    def _in_reach(self, name: str, setting: Setting, value: float) -> float:
        """Return a dial's value, at the end of its range where only rounding keeps it outside.

        Raises
        ------
        SettingError
            It would have to be negative where the dial cannot be.
        """
        ends = limits(setting)
        if value < 0 <= ends[0]:
            why = (
                "change the action instead" if setting.sets in ("gain", "multiplier") else "with these filters no positive one fits"
            )
            raise SettingError(f"{name} would have to be negative, {value:.6g} {setting.unit}: {why}")
        return next((end for end in ends if math.isclose(value, end, rel_tol=1e-12)), value)

    def _to_dial(self, name: str, setting: Setting, value: float) -> float:
        role = Role(setting.sets)
        off = off_values(setting)
        if value == 0 and role in (Role.INTEGRAL, Role.DERIVATIVE, Role.FILTER_TIME):
            if off:
                return off[0]
            if role is Role.INTEGRAL:
                raise SettingError(f"{name} cannot be switched off: the card states no off value")
        found = from_canonical(role, value, parse_unit(setting.unit), self.spans)
        if value and role in (Role.INTEGRAL, Role.DERIVATIVE) and found in off:
            low, high = limits(setting)
            raise SettingError(
                f"{name}: {found:g} {setting.unit} is outside {low:g} to {high:g} {setting.unit}; it switches it off"
            )
        return found

    def _filter_dial(self, Tf: float, base: float) -> dict[str, float]:
        f = self.filter
        assert f.setting is not None
        setting = self.variant.equation.settings[f.setting]
        if f.kind == "time":
            return {f.setting: self._in_reach(f.setting, setting, self._to_dial(f.setting, setting, Tf / self.pace))}
        if base == 0:
            return {}
        if f.kind == "ratio":
            return {f.setting: self._in_reach(f.setting, setting, Tf / base)}
        if Tf == 0 and off_values(setting):
            return {f.setting: off_values(setting)[0]}
        if Tf == 0:
            raise SettingError(f"{f.setting} would have to be infinite: this target always filters its derivative")
        return {f.setting: self._in_reach(f.setting, setting, base / Tf)}

    def filter_base(self, n: Numbers) -> Any:
        """Return the derivative time that the filter's ratio or gain refers to [s], for numbers that may be arrays."""
        scale = self.multiplier if n.multiplier is None else n.multiplier
        parallel = self.form is Form.PARALLEL
        scale *= self.percent_per_unit
        of_dial = parallel and self.filter.of != "derivative-time"
        time = n.kd / scale if of_dial else _over(n.kd, n.K)
        effective = self.filter.of == "effective-derivative" and not _is_zero(time)
        return time / (1 + _over(time * n.ki, n.K)) if effective else time

    def algorithm_of(self, n: Numbers) -> Algorithm:
        """Return the target's algorithm for canonical numbers, which may be arrays, whether its dials can be set so or not."""
        f, base = self.filter, self.filter_base(n)
        Tf = n.Tf if n.Tf is not None else f.time if f.kind == "time" else f.ratio * base
        if f.kind != "time" and _is_zero(base):
            Tf = 0.0
        kd = n.kd - n.K * Tf if f.lead_lag else n.kd
        b, c = (own if x is None else x for own, x in ((self.shape.b, n.b), (self.shape.c, n.c)))
        return replace(self.shape, kp=n.K if self.has_proportional else 0.0, ki=n.ki, kd=kd, Tf=Tf, b=b, c=c)


def _over(x: Any, y: Any) -> Any:
    """Return a quotient, 0 where there is nothing to divide by."""
    return 0.0 if _is_zero(y) else x / y


def _is_zero(x: Any) -> bool:
    return isinstance(x, float | int) and x == 0


def _placeholder(setting: Setting) -> float:
    low, high = limits(setting)
    candidate = setting.default if setting.default is not None else 1.0
    if low <= candidate <= high and candidate not in off_values(setting) and (candidate or setting.sets == "derivative"):
        return candidate or min(1.0, high)
    return low if low > 0 else high if math.isfinite(high) else 1.0
