"""Exact laws as an engineer writes them: with the dials in their places, and as a quotient of polynomials."""

from __future__ import annotations

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Form
from pidemu.card.model.card_file import Equation
from pidemu.card.model.signals import SignalFilter
from pidemu.certificate.exact_law import ExactLaw, PathName, in_mode
from pidemu.law.exact import Exact, exact


def law_text(equation: Equation, a: Algorithm[Exact], path: PathName, law: ExactLaw, factor: Exact) -> str:
    """Return a path in both ways, such as ``2 (1 + 1/(15 s)) (1 + 6 s)/(1 + 3/4 s) = (2/15 + 14/5 s + 12 s^2)/(s (1 + 3/4 s))``.

    Parameters
    ----------
    equation : Equation
        The card's equation.
    a : Algorithm[Exact]
        The algorithm with exact numbers.
    path : str
        Which path.
    law : ExactLaw
        The path, multiplied by `factor`.
    factor : Exact
        What the source's gain is multiplied by for new signal ranges.
    """
    plain, drawn = str(law), _drawn(equation, in_mode(a, path), path)
    if drawn and factor != 1:
        drawn = f"{_first(factor)} ({drawn})"
    return plain if drawn in ("", plain) else f"{drawn} = {plain}"


def _drawn(equation: Equation, a: Algorithm[Exact], path: PathName) -> str:
    """Return the path as its block diagram is drawn, or nothing where the quotient says it as well."""
    kp, ki, kd, Tf = (exact(x) for x in (a.kp, a.ki, a.kd, a.Tf))
    setpoint = path != "feedback"
    b, c = (exact(a.b), exact(a.c)) if setpoint else (exact(1), exact(1))
    filter_time = Tf if a.filter_on == "term" else exact(0)
    lags = _lags(a, setpoint)
    if a.series and kp and kd and c:
        if setpoint and (b != 1 or c != 1):
            return ""
        filt = equation.derivative.filter
        lead_lag = filt is not None and filt.applies_to == "lead-lag" and Tf
        lead = f"(1 + {_rate(kd / kp + Tf)})/{_lag(Tf)}" if lead_lag else f"(1 + {_derivative(kd / kp, filter_time)})"
        core = f"{_first(kp)} (1 + {_integral(ki / kp)}) {lead}" if ki else f"{_first(kp)} {lead}"
    elif equation.form is Form.PARALLEL or not kp:
        rate = f"({_number(ki)})/s" if "/" in _number(ki) else f"{_number(ki)}/s"
        core = _sum(kp * b, rate if ki else "", _derivative(kd * c, filter_time))
        core = f"({core})" if lags and " + " in core else core
    else:
        inner = _sum(b, _integral(ki / kp), _derivative(kd / kp * c, filter_time))
        core = f"{_first(kp)} ({inner})" if inner != "1" else str(kp)
    if not lags:
        return core
    core = f"({core})" if "/" in core and " " not in core else core
    return f"{core}/{lags[0]}" if len(lags) == 1 else f"{core}/({' '.join(lags)})"


def _sum(constant: Exact, integral: str, derivative: str) -> str:
    return " + ".join(x for x in (str(constant) if constant else "", integral, derivative) if x) or "0"


def _integral(rate: Exact) -> str:
    return f"1/({_rate(1 / rate)})" if rate else ""


def _derivative(gain: Exact, Tf: Exact) -> str:
    if not gain:
        return ""
    return f"{_rate(gain)}/{_lag(Tf)}" if Tf else _rate(gain)


def _lags(a: Algorithm[Exact], setpoint: bool) -> list[str]:
    """Return the filters that a path is divided by."""
    found = []
    if a.filter_on == "output" or (a.filter_on == "measurement" and not setpoint):
        Tf = exact(a.Tf)
        second = f" + {_number(Tf * Tf / 2)} s^2" if a.filter_order == 2 and a.filter_on == "measurement" else ""
        found += [f"(1 + {_rate(Tf)}{second})"] if Tf else []
    signals: tuple[SignalFilter[Exact] | None, ...] = (a.error.filter, a.setpoint.filter if setpoint else a.measurement.filter)
    return [*found, *(_lag(exact(lag.seconds)) for lag in signals if lag is not None and lag.seconds)]


def _lag(time: Exact) -> str:
    return f"(1 + {_rate(time)})"


def _rate(x: Exact) -> str:
    return "s" if x == 1 else f"{_number(x)} s"


def _first(x: Exact) -> str:
    """Return a number that begins a product."""
    text = str(x)
    return f"({text})" if " " in text and not text.startswith("(") else text


def _number(x: Exact) -> str:
    """Return a number within a sum or a product."""
    text = str(x)
    return f"({text})" if (" " in text and not text.startswith("(")) or text.startswith("-") else text
