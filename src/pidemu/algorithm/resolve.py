"""A card and its settings to an `Algorithm`: one walk over the card's tree that puts numbers where it names settings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Generic

from pidemu.algorithm.model import Algorithm, Dahlin
from pidemu.card.model.base import Form, Reference, Rule
from pidemu.card.model.card_file import Equation, default_scan
from pidemu.card.model.integral import Integral, IntegralLimits
from pidemu.card.model.operation import Arithmetic, Output
from pidemu.card.model.signals import ErrorShape, Measurement, Setpoint, SignalFilter
from pidemu.card.model.terms import Derivative, Feedforward, Filter, Proportional
from pidemu.columns.functions import sqrt
from pidemu.errors import SettingError, UndefinedError
from pidemu.numeric import X
from pidemu.settings.settings import Settings
from pidemu.units import Dimension, Role, Spans, parse_unit, to_canonical


@dataclass(frozen=True)
class Reader(Generic[X]):
    """Reads a card's dials and numbers in canonical units, or in the controller's own.

    Attributes
    ----------
    settings : Settings
        The settings.
    spans : Spans
        Signal spans and scan interval that canonical numbers refer to.
    own : bool
        Whether gains and levels stay in the controller's own units.
    """

    settings: Settings
    spans: Spans
    own: bool = False

    def value(self, name: str) -> X:
        """Return a dial's canonical value; 0 where it is off."""
        raise NotImplementedError

    def number(self, x: float) -> X:
        """Return a constant of the card."""
        raise NotImplementedError

    @property
    def span_ratio(self) -> X:
        """Percent gain that one output unit per measurement unit amounts to [%/%]."""
        raise NotImplementedError

    def role(self, role: Role, default: float) -> Any:
        """Return the canonical value of the dial that sets `role`."""
        value = self.settings.by_role(role)
        return default if value is None else self.value(value.name)

    def pick(self, given: str | float | None, default: float) -> Any:
        """Return a number that a card gives itself, or by the name of a setting; `default` where there is none or it is off."""
        if isinstance(given, str):
            return default if self.settings[given].off else self.value(given)
        return default if given is None else self.number(given)

    def level(self, given: Reference, default: float) -> Any:
        """Return a level of the output [%]: a level in engineering units counts from the low end of the range."""
        level, low = self.pick(given, default), self.settings.op_range.low if self.settings.op_range is not None else 0.0
        in_units = isinstance(given, str) and parse_unit(self.settings[given].unit).dimension is Dimension.PV_UNITS
        return level - 100 * low / self.spans.op if in_units and self.settings.equation.signals == "percent" else level

    def level_of_output(self, given: str | float | None) -> Any:
        """Return a deadband of the output, which a dial for one of the measurement may hold too; 0 where there is none."""
        return replace(self, spans=replace(self.spans, pv=self.spans.op)).pick(given, 0.0)


class FloatReader(Reader[float]):
    """Reads numbers as floats."""

    def value(self, name: str) -> float:
        """Return a dial's canonical value; 0 where it is off."""
        value = self.settings[name]
        return 0.0 if value.off else to_canonical(value.role, value.value, parse_unit(value.unit), self._spans_for(value.role))

    def _spans_for(self, role: Role) -> Spans:
        """Return what a dial refers to; a gain in own units, by which the output moves over its range, to the output's span."""
        if self.own and role is Role.GAIN:
            span = self.settings.spans.op
            return replace(self.spans, pv=span, op=span)
        return self.spans

    def number(self, x: float) -> float:
        """Return a constant of the card."""
        return x

    @property
    def span_ratio(self) -> float:
        """Percent gain that one output unit per measurement unit amounts to [%/%]."""
        return float(self.spans.ratio)


@dataclass(frozen=True)
class _Core(Generic[X]):
    """The canonical numbers of the terms, and what else is made of the same dials.

    Attributes
    ----------
    read : Reader
        What they are read from.
    kp, ki, kd, Tf : number
        Gains [%/%, 1/s, s] and filter time [s].
    rate, time : number
        The dials of integral [1/s] and derivative [s] as they stand.
    """

    read: Reader[X]
    kp: Any
    ki: Any
    kd: Any
    Tf: Any
    rate: Any
    time: Any

    @property
    def integrates(self) -> bool:
        """Whether there is integral action."""
        return bool(self.ki)

    @property
    def Ti(self) -> Any:
        """Integral time [s], of the dial where that is one; 0 without integral action."""
        if not self.ki:
            return 0.0
        parallel = self.read.settings.equation.form is Form.PARALLEL
        return abs(self.kp / self.ki if parallel and self.kp else 1 / self.rate)

    @cached_property
    def times(self) -> Mapping[str, Any]:
        """Times that a card names by a word [s] (specs/equations.md, section 5)."""
        both = abs(self.kd / self.ki) if self.read.settings.equation.form is Form.PARALLEL else abs(self.Ti * self.time)  # Ti Td
        return {"Ti": self.Ti, "sqrt(Ti Td)": sqrt(both) if both else self.Ti}

    def pick(self, given: str | float | None, default: float) -> Any:
        """Return a number that a card gives itself, or by the name of a setting."""
        return self.read.pick(given, default)

    def level(self, given: Reference, default: float) -> Any:
        """Return a level of the output [%]."""
        return self.read.level(given, default)


def algorithm_of(settings: Settings, *, own_units: bool = False, scan: float | None = None) -> Algorithm:
    """Return the algorithm with its numbers; see `Settings.algorithm`."""
    own = own_units and settings.equation.signals == "engineering"
    interval = default_scan(settings.equation) if scan is None else scan
    return algorithm_as_read(FloatReader(settings, replace(Spans() if own else settings.spans, scan=interval), own), interval)


def algorithm_as_read(read: Reader[X], scan: float | None = None) -> Algorithm[X]:
    """Return the algorithm with its numbers as a reader reads them.

    Parameters
    ----------
    read : Reader
        Gives floats, or numbers without rounding.
    scan : float, optional
        Scan interval [s]; by default the card's own.

    Raises
    ------
    SettingError
        A setting has a value that nothing can be computed with.
    UndefinedError
        The combination is not defined.
    """
    equation = read.settings.equation
    h = default_scan(equation) if scan is None else scan
    core = _core(read, equation)
    b = _weight(read, equation.proportional)
    in_cascade = equation.proportional if equation.cascade is None else equation.cascade.proportional
    cascade_b = _weight(read, in_cascade)
    error = _error(read, equation.error, h)
    return Algorithm(
        form=equation.form,
        implementation=equation.implementation,
        kp=core.kp,
        ki=core.ki,
        kd=core.kd,
        b=b,
        c=_weight(read, equation.derivative),
        cascade_b=None if cascade_b == b else cascade_b,
        Tf=core.Tf,
        Ti=core.Ti,
        bias=read.role(Role.BIAS, 0.0),
        error=error,
        proportional=Proportional(on=equation.proportional.on, accumulated=equation.proportional.accumulated),
        integral=_integral(core, equation.integral),
        derivative=_derivative(equation.derivative),
        setpoint=_setpoint(read, equation.setpoint, h),
        measurement=_measurement(read, equation.measurement, h),
        feedforward=_feedforward(read, equation.feedforward),
        transfer=equation.transfer,
        action=equation.action,
        output=_output(read, equation.output),
        arithmetic=equation.arithmetic or Arithmetic(type="float64"),
        shaped_in_cascade=error.on != "integral" and in_cascade.on != "pv",
        dahlin=_dahlin(read) if equation.form is Form.DAHLIN else None,
    )


def _core(read: Reader[X], equation: Equation) -> _Core[X]:
    """Return gains and filter time (specs/equations.md, sections 1 and 2)."""
    form, sign = equation.form, equation.action.gain_sign
    gain = sign * read.role(Role.GAIN, 0.0 if form is Form.PARALLEL else 1.0)
    scale = read.role(Role.MULTIPLIER, 1.0)
    rate = read.role(Role.INTEGRAL, 0.0) if equation.integral.on != "none" else 0.0
    time = read.role(Role.DERIVATIVE, 0.0) if equation.derivative.on != "none" else 0.0
    kp = gain * scale
    if form is Form.PARALLEL:
        scale *= read.span_ratio if equation.signals == "engineering" else 1.0
        scale *= sign
        ki, kd = rate * scale, time * scale
    else:
        ki, kd = kp * rate, kp * time
    filt = _at_work(equation.derivative)
    Tf = 0.0 if filt is None else _filter_time(read, filt, _Core(read, kp, ki, kd, 0.0, rate, time))
    if filt is not None and filt.applies_to == "lead-lag":
        kd -= kp * Tf
    if equation.derivative.rule is Rule.LAGGED_DIFFERENCE and not Tf:
        kd = 0.0  # there is no lag to take the difference from
    if equation.proportional.on == "none":
        kp = 0.0
    if form is Form.SERIES and kd and not kp:
        raise UndefinedError(
            f"{read.settings.card.id}: a series form with derivative but without proportional action is not defined; "
            f"change {read.settings.variant.choice_text}"
        )
    return _Core(read, kp, ki, kd, Tf, rate, time)


def _at_work(derivative: Derivative[Reference]) -> Filter[Reference] | None:
    """Return the filter that goes with the derivative, unless it filters what is not there."""
    filt = derivative.filter
    return None if filt is not None and derivative.on == "none" and filt.applies_to in ("term", "lead-lag") else filt


def _weight(read: Reader[X], term: Proportional[Reference] | Derivative[Reference]) -> Any:
    if term.on != "weighted":
        return float(term.on == "error")
    return read.value(term.weight) if isinstance(term.weight, str) else 1.0 if term.weight is None else read.number(term.weight)


def _filter_time(read: Reader[X], filt: Filter[Reference], core: _Core[X]) -> Any:
    """Return the time of the filter that goes with the derivative [s] (specs/equations.md, section 1)."""
    if filt.time is not None:
        return read.pick(filt.time, 0.0)
    base = _filter_base(filt, core)
    if base == 0 or (isinstance(filt.gain, str) and read.settings[filt.gain].off):
        return 0.0
    if filt.gain is None:
        return base * read.pick(filt.ratio, 0.0)
    gain = read.pick(filt.gain, math.inf)
    if gain == 0:
        raise SettingError(
            f"{read.settings.card.id}: {filt.gain} is 0: a derivative gain of zero means no derivative; set the derivative to zero"
        )
    return base / gain


def _filter_base(filt: Filter[Reference], core: _Core[X]) -> Any:
    """Return the derivative time that the filter's ratio or gain refers to [s].

    Raises
    ------
    UndefinedError
        It is ``kd/kp``, of a controller without proportional gain or with one of the other sign.
    """
    settings, kp, kd = core.read.settings, core.kp, core.kd
    if filt.of == "effective-derivative":
        return core.time / (1 + core.rate * core.time)
    if filt.of == "derivative" or not kd or settings.equation.form is not Form.PARALLEL:
        return core.time
    if not kp or kd / kp <= 0:
        raise UndefinedError(
            f"{settings.card.id}: the derivative's filter goes with the derivative time kd/kp, and kp is {kp:g} with kd "
            f"{kd:g}; give a proportional gain of the same sign, or switch the filter off"
        )
    return kd / kp


def _integral(core: _Core[X], i: Integral[Reference]) -> Integral[X]:
    return Integral(
        on=i.on,
        rule=i.rule,
        holds=i.holds if core.kp else "ki e",
        limits=_integral_limits(core.read, i.limits),
        starts=i.starts,
        deadband=core.read.pick(i.deadband, 0.0) or None,
        windup=i.windup.with_numbers(core),
    )


def _integral_limits(read: Reader[X], limits: IntegralLimits[Reference] | None) -> IntegralLimits[X] | None:
    """Return the limits with both ends; one that is off is no limit."""
    if limits is None:
        return None
    high: Any = "output" if limits.high == "output" else read.pick(limits.high, math.inf)
    if limits.low is None:
        return IntegralLimits(high=high, low="output" if high == "output" else -high)
    low: Any = "output" if limits.low == "output" else read.pick(limits.low, math.inf)
    return IntegralLimits(high=high, low=-math.inf if isinstance(limits.low, str) and low == math.inf else low)


def _derivative(d: Derivative[Reference]) -> Derivative[X]:
    f = _at_work(d)
    filt: Filter[X] | None = None if f is None else Filter(applies_to=f.applies_to, order=f.order, of=f.of, rule=f.rule)
    return Derivative(on=d.on, rule=d.rule, starts=d.starts, filter=filt)


def _lag(read: Reader[X], filt: SignalFilter[Reference] | None, h: float) -> SignalFilter[X] | None:
    """Return a signal's filter, or ``None`` where there is none or it is off."""
    if filt is None:
        return None
    if filt.factor is None:
        time = read.pick(filt.time, 0.0)
        return SignalFilter(time=time, rule=filt.rule) if time else None
    factor = read.pick(filt.factor, 1.0)
    if not 0 < factor <= 1:
        raise SettingError(f"{read.settings.card.id}: {filt.factor} is {factor:g}; a share of the new sample is above 0, up to 1")
    return SignalFilter(time=read.number(h) * (1 - factor) / factor, factor=factor, rule=filt.rule) if factor != 1 else None


def _setpoint(read: Reader[X], sp: Setpoint[Reference] | None, h: float) -> Setpoint[X]:
    if sp is None:
        return Setpoint()
    return Setpoint(
        filter=_lag(read, sp.filter, h),
        rate=_unless_off(read, sp.rate),
        rate_down=None if sp.rate_down is None else read.pick(sp.rate_down, math.inf),
        rate_counts=sp.rate_counts,
        starts=sp.starts,
        tracks=sp.tracks,
    )


def _unless_off(read: Reader[X], rate: Reference | None) -> Any:
    """Return a rate limit, or ``None`` where it is off."""
    found = read.pick(rate, math.inf)
    return None if found == math.inf else found


def _measurement(read: Reader[X], pv: Measurement[Reference] | None, h: float) -> Measurement[X]:
    return Measurement() if pv is None else Measurement(filter=_lag(read, pv.filter, h), previous_scan=pv.previous_scan)


def _error(read: Reader[X], error: ErrorShape[Reference] | None, h: float) -> ErrorShape[X]:
    """Return what is done to the error; linear where its shape does nothing."""
    if error is None:
        return ErrorShape()
    filt, band, linearity = _lag(read, error.filter, h), read.pick(error.band, 0.0), read.pick(error.linearity, 1.0)
    idle = (error.shape == "gap" and not band) or (error.shape == "gain-linear" and linearity == 1)
    if error.shape == "linear" or idle:
        return ErrorShape(filter=filt)
    return ErrorShape(
        filter=filt,
        shape=error.shape,
        band=band,
        gain=read.value(error.gain) if isinstance(error.gain, str) else read.number(error.gain),
        subtracted=error.subtracted,
        zero_crossing=error.zero_crossing,
        edge=error.edge,
        linearity=linearity,
        over=error.over,
        on=error.on,
    )


def _feedforward(read: Reader[X], ff: Feedforward[Reference] | None) -> Feedforward[X] | None:
    return None if ff is None else Feedforward(summed=ff.summed, gain=read.pick(ff.gain, 0.0))


def _output(read: Reader[X], output: Output[Reference]) -> Output[X]:
    return Output(
        limits=output.limits,
        rate=_unless_off(read, output.rate),
        deadband=read.level_of_output(output.deadband) or None,
        resolution=read.pick(output.resolution, 0.0) or None,
    )


def _dahlin(read: Reader[X]) -> Dahlin:
    found = Dahlin(
        gain=read.role(Role.PROCESS_GAIN, 1.0),
        time=read.role(Role.PROCESS_TIME, 0.0),
        delay=read.role(Role.PROCESS_DELAY, 0.0),
        wanted=read.role(Role.CLOSED_LOOP_TIME, 0.0),
    )
    if not found.gain:
        raise SettingError(f"{read.settings.card.id}: a process gain of zero cannot be controlled; give the process's gain")
    return found
