"""A card's settings to an `Algorithm`: the numbers of its terms, filters, windup and stages in canonical units."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from pidemu.algorithm.model import Algorithm, Dahlin, Gate, Lag, Place, Shape
from pidemu.card.model.base import Form, Rule
from pidemu.card.model.card_file import Equation, default_scan, gain_sign
from pidemu.card.model.integral import (
    FastReturn,
    IntegralLimits,
    WindupBackCalculation,
    WindupExternalReset,
    WindupGate,
    WindupRecompute,
)
from pidemu.card.model.terms import ErrorShape, Filter, Measurement, Setpoint
from pidemu.errors import SettingError, UndefinedError
from pidemu.settings.settings import Settings
from pidemu.units import Dimension, Role, Spans, parse_unit, to_canonical


@dataclass(frozen=True, slots=True)
class Reader:
    """Reads a card's dials and numbers in canonical units, or in the controller's own."""

    settings: Settings
    spans: Spans
    own: bool = False

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

    def level_of_output(self, given: str | float | None) -> float:
        """Return a deadband of the output, which a dial for one of the measurement may hold too; 0 where there is none."""
        return replace(self, spans=replace(self.spans, pv=self.spans.op)).pick(given, 0.0)

    def number(self, x: float) -> float:
        """Return a constant of the card."""
        return x

    @property
    def span_ratio(self) -> float:
        """Percent gain that one output unit per measurement unit amounts to [%/%]."""
        return float(self.spans.ratio)

    def role(self, role: Role, default: float) -> float:
        """Return the canonical value of the dial that sets `role`."""
        value = self.settings.by_role(role)
        return default if value is None else self.value(value.name)

    def pick(self, given: str | float | None, default: float) -> float:
        """Return a number that a card gives itself, or by the name of a setting; `default` where there is none or it is off."""
        if isinstance(given, str):
            return default if self.settings[given].off else self.value(given)
        return default if given is None else self.number(given)


def algorithm_of(settings: Settings, *, own_units: bool = False, scan: float | None = None) -> Algorithm:
    """Return the algorithm with its numbers; see `Settings.algorithm`."""
    own = own_units and settings.equation.signals == "engineering"
    interval = default_scan(settings.equation) if scan is None else scan
    return algorithm_as_read(Reader(settings, replace(Spans() if own else settings.spans, scan=interval), own), interval)


def algorithm_as_read(read: Reader, scan: float | None = None) -> Algorithm:
    """Return the algorithm with its numbers as a reader reads them: floats, or without rounding."""
    settings = read.settings
    equation = settings.equation
    engineering = equation.signals == "engineering"
    form = equation.form
    gain = gain_sign(equation) * read.role(Role.GAIN, 0.0 if form is Form.PARALLEL else 1.0)
    scale = read.role(Role.MULTIPLIER, 1.0)
    rate = read.role(Role.INTEGRAL, 0.0) if equation.integral.on != "none" else 0.0
    time = read.role(Role.DERIVATIVE, 0.0) if equation.derivative.on != "none" else 0.0
    if form is Form.PARALLEL:
        kp = gain * scale
        scale *= read.span_ratio if engineering else 1.0
        scale *= gain_sign(equation)
        ki, kd = rate * scale, time * scale
    else:
        kp = gain * scale
        ki, kd = kp * rate, kp * time
    filt = equation.derivative.filter
    if filt is not None and equation.derivative.on == "none" and filt.applies_to in ("term", "lead-lag"):
        filt = None  # it filters what is not there
    Tf, place, order = _filter(read, filt, rate, time, kp, kd)
    if filt is not None and filt.applies_to == "lead-lag":
        kd -= kp * Tf
    if equation.derivative.rule is Rule.LAGGED_DIFFERENCE and not Tf:
        kd = 0.0  # there is no lag to take the difference from
    if equation.proportional.on == "none":
        kp = 0.0
    _refuse_undefined(settings, kp, kd)
    return Algorithm(
        series=form is Form.SERIES,
        kp=kp,
        ki=ki,
        kd=kd,
        b=_weight(read, equation.proportional.on, equation.proportional.weight),
        c=_weight(read, equation.derivative.on, equation.derivative.weight),
        Tf=Tf,
        filter_on=place,
        filter_order=order,
        velocity=equation.implementation == "velocity",
        integral_rule=equation.integral.rule,
        derivative_rule=equation.derivative.rule,
        filter_rule=(equation.derivative.filter and equation.derivative.filter.rule) or equation.derivative.rule,
        windup=equation.integral.windup.scheme,
        gate=_gate(read, equation),
        tracking_time=_tracking(read, rate, time, kp, ki, kd) if ki else 0.0,
        implicit_tracking=getattr(equation.integral.windup, "implicit", False),
        limits_without_integral=getattr(equation.integral.windup, "without_integral", "zero") == "limited",
        reads_back=getattr(equation.integral.windup, "reads_back", False),
        accumulated=equation.proportional.accumulated,
        gain_sign=gain_sign(equation),
        holds=equation.integral.holds if kp else "ki e",
        integral_limits=_integral_limits(read, equation.integral.limits),
        integral_deadband=_some(read.pick(equation.integral.deadband, 0.0)) if equation.integral.deadband is not None else None,
        bias=read.role(Role.BIAS, 0.0),
        dahlin=_dahlin(read) if form is Form.DAHLIN else None,
        **_transfer(equation),
        **_signals(read, equation, default_scan(equation) if scan is None else scan),
        **_output(read, equation),
    )


def _refuse_undefined(settings: Settings, kp: float, kd: float) -> None:
    equation = settings.equation
    if equation.form is Form.SERIES and kd and not kp:
        raise UndefinedError(
            f"{settings.card.id}: a series form with derivative but without proportional action is not defined; "
            f"change {settings.variant.choice_text}"
        )


def _some(value: float) -> float | None:
    return value if value else None


def _weight(read: Reader, on: str, weight: str | float | None) -> float:
    if on != "weighted":
        return float(on == "error")
    return read.value(weight) if isinstance(weight, str) else 1.0 if weight is None else read.number(weight)


def _filter(read: Reader, filt: Filter | None, rate: float, time: float, kp: float, kd: float) -> tuple[float, Place, Any]:
    """Return the filter's time [s], place and order (specs/equations.md, section 1)."""
    if filt is None:
        return 0.0, "term", 1
    place: Place = "term" if filt.applies_to == "lead-lag" else filt.applies_to
    if filt.time is not None:
        return read.pick(filt.time, 0.0), place, filt.order
    base = _filter_base(read, filt, rate, time, kp, kd)
    if base == 0:
        return 0.0, place, filt.order
    if isinstance(filt.gain, str) and read.settings[filt.gain].off:
        return 0.0, place, filt.order
    if filt.gain is not None:
        gain = read.pick(filt.gain, math.inf)
        if gain == 0:
            raise SettingError(
                f"{read.settings.card.id}: {filt.gain} is 0: a derivative gain of zero means no derivative; "
                "set the derivative to zero"
            )
        return base / gain, place, filt.order
    return base * read.pick(filt.ratio, 0.0), place, filt.order


def _filter_base(read: Reader, filt: Filter, rate: float, time: float, kp: float, kd: float) -> float:
    """Return the derivative time that the filter's ratio or gain refers to [s].

    Raises
    ------
    UndefinedError
        It is ``kd/kp``, of a controller without proportional gain or with one of the other sign.
    """
    if filt.of == "effective-derivative":
        return time / (1 + rate * time)
    if filt.of == "derivative" or not kd or read.settings.equation.form is not Form.PARALLEL:
        return time
    if not kp or kd / kp <= 0:
        raise UndefinedError(
            f"{read.settings.card.id}: the derivative's filter goes with the derivative time kd/kp, and kp is {kp:g} with kd "
            f"{kd:g}; give a proportional gain of the same sign, or switch the filter off"
        )
    return kd / kp


def _gate(read: Reader, equation: Equation) -> Gate:
    match equation.integral.windup:
        case WindupGate() as w:
            return Gate(
                without_derivative=w.judged_on == "sum-without-derivative",
                this_scan=w.judged_on == "sum",
                both=w.direction == "both",
                unless_smaller=w.direction == "unless-smaller",
                from_integrated=w.resumes_from == "last-integrated",
                by_output_sign=w.test == "error-times-output",
                drops=w.last_increment == "dropped",
            )
        case WindupRecompute() as w:
            return Gate(without_derivative=w.without_derivative, clamped=w.clamped)
        case WindupExternalReset(fast_return=FastReturn() as f):
            beyond = _level(read, f.low, -math.inf), _level(read, f.high, math.inf)
            return Gate(fast_return=f.factor, fast_beyond=beyond) if beyond != (-math.inf, math.inf) else Gate()
    return Gate()


def _level(read: Reader, given: str | float, default: float) -> float:
    """Return a level of the output [%]: a level in engineering units counts from the low end of the range."""
    level, low = read.pick(given, default), read.settings.op_range.low if read.settings.op_range is not None else 0.0
    in_units = isinstance(given, str) and parse_unit(read.settings[given].unit).dimension is Dimension.PV_UNITS
    return level - 100 * low / read.spans.op if in_units and read.settings.equation.signals == "percent" else level


def _tracking(read: Reader, rate: float, time: float, kp: float, ki: float, kd: float) -> float:
    """Return the time in which the integral follows the cut-off [s] (specs/equations.md, section 5)."""
    parallel = read.settings.equation.form is Form.PARALLEL
    integral_time = abs(kp / ki if parallel and kp else 1 / rate)
    both = abs(kd / ki) if parallel else abs(integral_time * time)  # Ti Td
    known = {"Ti": integral_time, "sqrt(Ti Td)": math.sqrt(both) if both else integral_time}
    windup = read.settings.equation.integral.windup
    if not isinstance(windup, WindupBackCalculation):
        return integral_time
    given = windup.tracking_time
    if isinstance(given, str) and given in known:
        return known[given]
    found = read.pick(given, 0.0)
    if not found and windup.when_off is not None:
        return known[windup.when_off]
    return found * integral_time if windup.times == "Ti" else found


def _integral_limits(read: Reader, limits: IntegralLimits | None) -> tuple[float | None, float | None] | None:
    if limits is None:
        return None

    def one(given: str | float | None) -> float | None:
        return None if given == "output" else read.pick(given, math.inf)

    high = one(limits.high)
    if limits.low is not None:
        low = one(limits.low)
        return (-math.inf if isinstance(limits.low, str) and limits.low != "output" and low == math.inf else low), high
    return None if high is None else -high, high


def _transfer(equation: Equation) -> dict[str, Any]:
    t = equation.transfer
    return {
        "start": t.start,
        "keeps_integral": t.without_integral == "kept",
        "first_scan_holds": t.first_scan == "holds",
        "loads_as_it_is": t.loaded == "as-it-is",
        "zero_power_up": t.power_up == "zero",
        "derivative_start": t.derivative,
        "derivative_from_zero": equation.derivative.starts == "zero",
        "integral_from_zero": equation.integral.starts == "zero",
        "zero_first_output": t.first_output == "zero",
        "manual_output": t.manual_output,
        "bumpless_changes": t.changes == "bumpless",
    }


def _lag(read: Reader, signal: Setpoint | Measurement | ErrorShape | None, h: float) -> Lag | None:
    """Return a signal's filter, or ``None`` where there is none or it is off."""
    filt = None if signal is None else signal.filter
    if filt is None:
        return None
    if filt.factor is None:
        time = read.pick(filt.time, 0.0)
        return Lag(time, 1.0, filt.rule) if time else None
    factor = read.pick(filt.factor, 1.0)
    if not 0 < factor <= 1:
        raise SettingError(f"{read.settings.card.id}: {filt.factor} is {factor:g}; a share of the new sample is above 0, up to 1")
    return Lag(read.number(h) * (1 - factor) / factor, factor, filt.rule) if factor != 1 else None


def _shape(read: Reader, equation: Equation) -> Shape | None:
    """Return what is done to the error, or ``None`` where that is nothing; P on the measurement itself is no error."""
    error = equation.error
    if error is None or error.shape == "linear":
        return None
    band, linearity = read.pick(error.band, 0.0), read.pick(error.linearity, 1.0)
    if (error.shape == "gap" and not band) or (error.shape == "gain-linear" and linearity == 1):
        return None
    gain = read.value(error.gain) if isinstance(error.gain, str) else error.gain
    in_cascade = equation.proportional if equation.cascade is None else equation.cascade.proportional
    return Shape(
        kind=error.shape,
        band=band,
        gain=gain,
        subtracted=error.subtracted,
        zero_crossing=error.zero_crossing,
        open_edge=error.edge == "outside",
        linearity=linearity,
        over=error.over,
        on_integral=error.on != "proportional",
        on_proportional=error.on != "integral" and equation.proportional.on != "pv",
        on_cascade=error.on != "integral" and in_cascade.on != "pv",
    )


def _signals(read: Reader, equation: Equation, h: float) -> dict[str, Any]:
    sp, pv, error, ff = equation.setpoint, equation.measurement, equation.error, equation.feedforward
    cascade = None if equation.cascade is None else equation.cascade.proportional
    b = _weight(read, equation.proportional.on, equation.proportional.weight)
    rate = math.inf if sp is None else read.pick(sp.rate, math.inf)
    other_b = b if cascade is None else _weight(read, cascade.on, cascade.weight)
    return {
        "sp_filter": _lag(read, sp, h),
        "sp_rate": rate,
        "sp_rate_down": rate if sp is None or sp.rate_down is None else read.pick(sp.rate_down, math.inf),
        "sp_rate_local": sp is not None and sp.rate_counts == "local",
        "sp_from_zero": sp is not None and sp.starts == "zero",
        "sp_tracks": sp is not None and sp.tracks,
        "pv_filter": _lag(read, pv, h),
        "previous_pv": pv is not None and pv.previous_scan,
        "e_filter": _lag(read, error, h),
        "shape": _shape(read, equation),
        "cascade_b": None if other_b == b else other_b,
        "feedforward": None if ff is None else read.pick(ff.gain, 0.0),
        "feedforward_after": ff is not None and ff.summed == "after-limits",
    }


def _output(read: Reader, equation: Equation) -> dict[str, Any]:
    arithmetic = equation.arithmetic
    numbers: dict[str, Any] = {
        "output_rate": read.pick(equation.output.rate, math.inf),
        "output_deadband": read.level_of_output(equation.output.deadband),
        "resolution": read.pick(equation.output.resolution, 0.0),
    }
    if arithmetic is not None:
        numbers |= {
            "precision": arithmetic.type,
            "wide_literals": arithmetic.literals == "float64",
            "counts": arithmetic.counts or 1,
            "gain_counts": arithmetic.gain_counts or 1,
        }
    return numbers


def _dahlin(read: Reader) -> Dahlin:
    found = Dahlin(
        gain=read.role(Role.PROCESS_GAIN, 1.0),
        time=read.role(Role.PROCESS_TIME, 0.0),
        delay=read.role(Role.PROCESS_DELAY, 0.0),
        wanted=read.role(Role.CLOSED_LOOP_TIME, 0.0),
    )
    if not found.gain:
        raise SettingError(f"{read.settings.card.id}: a process gain of zero cannot be controlled; give the process's gain")
    return found
