"""What the symbols of a card's equation are: signals before the algorithm, filter times, and the dials behind the gains."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from pidemu.card.model.base import Form, Given, Reference, short
from pidemu.card.model.card_file import Equation
from pidemu.card.model.signals import ErrorShape, SignalFilter
from pidemu.card.model.terms import Filter
from pidemu.errors import UnitError
from pidemu.part import part
from pidemu.units import Dimension, parse_unit

_TIMES: Final = (Dimension.TIME, Dimension.TIME_PER_REPEAT)


@part(frozen=True, slots=True)
class SignalNames:
    """The names of the signals as the terms see them.

    Attributes
    ----------
    sp, pv : str
        Setpoint and measurement, behind filters and rate limit.
    turned : bool
        Whether the equation has the error PV - SP.
    filtered : bool
        Whether the error has a filter of its own.
    """

    sp: str
    pv: str
    turned: bool
    filtered: bool

    @classmethod
    def of(cls, q: Equation) -> SignalNames:
        """Return the signals of an equation."""
        sp, pv, filt = q.setpoint, q.measurement, filter_at_work(q)
        on_measurement = filt is not None and filt.applies_to == "measurement"
        return cls(
            sp="SPf" if sp is not None and (sp.filter is not None or sp.rate is not None) else "SP",
            pv="PVf" if on_measurement or (pv is not None and pv.filter is not None) else "PV",
            turned=q.action.fixed and q.action.reverse == "pv - sp",
            filtered=q.error is not None and q.error.filter is not None,
        )

    def on(self, what: str, weight: str = "") -> str:
        """Return what a term acts on: ``SP - PV``, ``-PV`` or ``b SP - PV``, as the equation turns it."""
        if what == "error" and self.filtered:
            return "E"
        sp = {"error": self.sp, "weighted": f"{weight} {self.sp}", "pv": ""}[what]
        if self.turned:
            return f"{self.pv} - {sp}" if sp else self.pv
        return f"{sp} - {self.pv}" if sp else f"-{self.pv}"


def filter_at_work(q: Equation) -> Filter[Reference] | None:
    """Return the filter that goes with the derivative, unless there is no derivative that it could act on or be a part of."""
    filt = q.derivative.filter
    if filt is None or q.derivative.on != "none":
        return filt
    return None if filt.time is None or filt.applies_to in ("term", "lead-lag") else filt


def legend(q: Equation) -> list[str]:
    """Return what the symbols of the equation are, one per line (specs/equations.md, sections 1, 4 and 8).

    Parameters
    ----------
    q : Equation
        The equation.
    """
    lines = [*_setpoint(q), *_measurement(q), *_error(q)]
    if q.form is Form.DAHLIN:
        return [*_pole_cancellation(q), *lines]
    return [*lines, *_gains(q), *_derivative_filter(q), *_weights(q)]


def _setpoint(q: Equation) -> Iterator[str]:
    sp = q.setpoint
    if sp is None:
        return
    limited = "SP" if sp.rate is None else "SPr"
    if sp.filter is not None:
        yield f"SPf = {limited}/(1 + Tsp s)"
        yield from _lag_time(q, "Tsp", sp.filter)
    if sp.rate is not None:
        down = "" if sp.rate_down is None else f" upwards, {_per_second(q, sp.rate_down)} downwards"
        local = "; a remote setpoint is not limited" if sp.rate_counts == "local" else ""
        yield f"{'SPf' if sp.filter is None else 'SPr'} = SP, changing by at most {_per_second(q, sp.rate)}{down}{local}"


def _per_second(q: Equation, given: str | float) -> str:
    return f"{named(q, given)}{'' if isinstance(given, str) else ' per s'}"


def _measurement(q: Equation) -> Iterator[str]:
    m, filt, lags = q.measurement, filter_at_work(q), []
    if m is not None and m.filter is not None:
        lags.append("(1 + Tpv s)")
    if filt is not None and filt.applies_to == "measurement":
        lags.append(f"(1 + Tf s{' + Tf^2 s^2/2' if filt.order == 2 else ''})")
    if lags:
        yield f"PVf = PV/{lags[0] if len(lags) == 1 else f'[{lags[0]} {lags[1]}]'}"
    if m is not None and m.filter is not None:
        yield from _lag_time(q, "Tpv", m.filter)
    if m is not None and m.previous_scan:
        yield "PV: that of the previous scan"


def _error(q: Equation) -> Iterator[str]:
    if q.error is None:
        return
    if q.error.filter is not None:
        yield f"E = ({replace(SignalNames.of(q), filtered=False).on('error')})/(1 + Te s)"
        yield from _lag_time(q, "Te", q.error.filter)
    if q.error.shape != "linear":
        yield _shape(q, q.error)


def _lag_time(q: Equation, symbol: str, filt: SignalFilter[Reference]) -> Iterator[str]:
    if filt.factor is not None:
        k = short(filt.factor)
        yield f"{symbol} = h (1 - {k})/{k}   h: scan interval; each scan takes the share {k} of the new sample"
    elif filt.time is not None:
        yield _time(q, symbol, filt.time)


def _shape(q: Equation, e: ErrorShape[Reference]) -> str:
    """Return the shape of the error as a formula (specs/equations.md, section 8)."""
    if e.shape == "squared":
        return f"S(x) = x |x|/{e.over:g}"
    if e.shape == "gain-linear":
        share = short(e.linearity)
        return f"S(x) = x ({share} + (1 - {share}) |x|/{e.over:g})"
    band, gain = short(e.band), short(e.gain)
    within = "0" if e.gain == 0 else f"{gain} x"
    less = band if e.gain == 0 else f"(1 - {gain}) {band}"
    outside = f"x - {less} sign(x)" if e.subtracted else "x"
    size = f"|x| {'<=' if e.edge == 'inside' else '<'} {named(q, e.band)}"
    return f"S(x) = {within} while {size}{', once x has changed its sign there' if e.zero_crossing else ''}; else {outside}"


def _derivative_filter(q: Equation) -> Iterator[str]:
    filt = filter_at_work(q)
    if filt is None:
        return
    if filt.time is not None:
        yield _time(q, "Tf", filt.time)
    else:
        yield f"Tf = {_of_derivative(q, filt)}"


def _of_derivative(q: Equation, filt: Filter[Reference]) -> str:
    time = "Td"
    if filt.of == "effective-derivative":
        time = "Ti Td/(Ti + Td)" if q.integral.on != "none" else "Td"
    elif filt.of == "derivative-time" and q.form is Form.PARALLEL:
        return f"{short(filt.ratio)} x kd/kp" if filt.ratio is not None else f"kd/(kp {short(filt.gain)})"
    elif q.form is Form.PARALLEL:
        time = next((name for name, s in q.settings.items() if s.sets == "derivative"), "kd")
    return f"{short(filt.ratio)} x {time}" if filt.ratio is not None else f"{time} / {short(filt.gain)}"


def _gains(q: Equation) -> Iterator[str]:
    """Yield where gain, integral and derivative come from (specs/equations.md, section 1)."""
    parallel = q.form is Form.PARALLEL
    symbols = dict(zip(("gain", "integral", "derivative"), ("kp", "ki", "kd") if parallel else ("K", "Ti", "Td"), strict=True))
    there = {
        "gain": not parallel or q.proportional.on != "none",
        "integral": q.integral.on != "none",
        "derivative": q.derivative.on != "none",
    }
    multiplier = next((name for name, s in q.settings.items() if s.sets == "multiplier"), None)
    for name, s in q.settings.items():
        if s.sets in symbols and there[s.sets]:
            value = _canonical(q, s.sets, name, s.unit)
            multiplied = multiplier is not None and (parallel or s.sets == "gain")
            yield _is(symbols[s.sets], f"{multiplier} x {value}" if multiplied else value, name, s.unit)


def _canonical(q: Equation, role: str, name: str, unit: str) -> str:
    """Return a dial's canonical quantity as a formula."""
    dimension = _dimension(unit)
    if role == "gain":
        own = q.signals == "engineering"
        span = "OP span" if own else "PV span"
        return {
            Dimension.PERCENT: f"100/{name}",
            Dimension.PV_UNITS: f"{span}/{name}",
            Dimension.OP_PER_PV: name if own else f"{name} x PV span/OP span",
            Dimension.PERCENT_PER_PV: f"{name} x {span}/100",
        }.get(dimension or Dimension.RATIO, name)
    inverse = role == "integral" and (dimension in _TIMES) == (q.form is Form.PARALLEL)
    return f"1/{name}" if inverse else name


def _weights(q: Equation) -> Iterator[str]:
    """Yield the numbers that are ratios, and the bias."""
    if q.proportional.weight is not None:
        yield _is("b", short(q.proportional.weight))
    if q.cascade is not None and q.cascade.proportional.weight not in (None, q.proportional.weight):
        yield _is("bc", short(q.cascade.proportional.weight))
    if q.derivative.weight is not None:
        yield _is("c", short(q.derivative.weight))
    if q.feedforward is not None and q.feedforward.gain != 1:
        yield _is("kFF", short(q.feedforward.gain))
    bias = next(((name, s.unit) for name, s in q.settings.items() if s.sets == "bias"), None)
    if bias is not None and q.integral.on == "none":
        yield _is("bias", bias[0], *bias)


def _pole_cancellation(q: Equation) -> Iterator[str]:
    """Yield Dahlin's algorithm (specs/equations.md, section 4)."""
    dials = {s.sets: name for name, s in q.settings.items()}
    gain, time, wanted = (dials.get(role, role) for role in ("process-gain", "process-time", "closed-loop-time"))
    delay = dials.get("process-delay")
    dead = f" exp(-{delay} s)" if delay else ""
    units = [named(q, name) for name in (gain, time, delay, wanted) if name is not None]
    yield "D(z) = g (1 - p z^-1)/(1 - q z^-1 - (1 - q) z^-(N+1))"
    yield f"p = exp(-h/{time}), q = exp(-h/{wanted}), g = (1 - q)/({gain} (1 - p))   h: scan interval"
    yield f"N = {delay}/h, rounded to whole scans" if delay else "N = 0"
    yield f"The process is {gain}{dead}/(1 + {time} s); PV is to follow SP as {dead.strip() or '1'}/(1 + {wanted} s)"
    yield f"Settings: {', '.join(units)}"


def _time(q: Equation, symbol: str, given: str | float) -> str:
    """Return a time constant: a number of seconds, or the dial that holds it."""
    if not isinstance(given, str):
        return f"{symbol} = {given:g} s"
    unit = q.settings[given].unit if given in q.settings else "s"
    return _is(symbol, f"1/(2 pi {given})" if _dimension(unit) is Dimension.FREQUENCY else given, given, unit)


def _is(symbol: str, value: str, dial: str = "", unit: str = "1") -> str:
    """Return ``Ti = 1/RESET, RESET [repeat/min]``; shorter where the symbol is the dial, or the dial's name."""
    shown = "" if unit == "1" else f" [{unit}]"
    if symbol == value:
        return f"{symbol}: the setting{shown}"
    return f"{symbol} = {value}{shown}" if value == dial or not shown else f"{symbol} = {value}, {dial}{shown}"


def named(q: Equation, given: Given) -> str:
    """Return a number, or a dial with its unit."""
    return f"{given} [{q.settings[given].unit}]" if isinstance(given, str) and given in q.settings else short(given)


def _dimension(unit: str) -> Dimension | None:
    try:
        return parse_unit(unit).dimension
    except UnitError:  # a rule over cards refuses it
        return None
