"""What a card does scan by scan, in manual, at transfers and with bad signals: in words, as a data sheet has them."""

from __future__ import annotations

from typing import Final

from pidemu.card.datasheet.at_limits import Row
from pidemu.card.datasheet.legend import filter_at_work
from pidemu.card.model.base import Form, Reference, Rule, short
from pidemu.card.model.card_file import Equation
from pidemu.card.model.integral import Integral
from pidemu.card.model.operation import Faults
from pidemu.card.model.terms import Derivative

_HOLDS: Final = {
    "ki e": "",
    "e/Ti": "; the sum is that of e/Ti, the gain is applied afterwards",
    "e": "; the sum is that of e, gain and integral time are applied afterwards",
}
_BAD_SIGNAL: Final = {
    "hold": "the output is held and nothing is computed",
    "propagate": "they are computed with",
    "nan": "the output is NaN and nothing is computed",
    "zero": "the output is 0 and nothing is computed",
}


def scan_rows(q: Equation) -> list[Row]:
    """Return how the equation is computed (specs/equations.md, sections 4 and 7)."""
    words = {
        "positional": "positional: the output is the sum of the terms",
        "velocity": "velocity: increments are added to the last output",
    }
    rows = [("form", q.form.value), ("implementation", words[q.implementation])]
    if q.form is not Form.DAHLIN:
        rows += [("integral", _integral(q.integral)), ("derivative", _derivative(q.derivative))]
    found = _filters(q)
    if found:
        rows.append(("filters", ", ".join(found)))
    rows.append(("signals", "% of span" if q.signals == "percent" else "engineering units"))
    rows.append(("scan interval", _interval(q)))
    if q.arithmetic is not None:
        rows.append(("arithmetic", _arithmetic(q)))
    return rows


def mode_rows(q: Equation) -> list[Row]:
    """Return what manual and the transfers do, the action, and what bad signals do (specs/equations.md, section 6)."""
    t = q.transfer
    manual = {
        "operator": "the output is the operator's; the last one where there is none",
        "gain-times-operator": "the output is the operator's number times the gain",
        "zero": "the output is 0",
    }
    rows = [("action", _action(q)), ("in manual", manual[t.manual_output] + _meanwhile(q))]
    rows += [("to automatic", _start(q)), ("at power-up", _power_up(q))]
    if q.setpoint is not None and q.setpoint.tracks:
        rows.append(("setpoint", "follows PV in manual, and stays there until it is changed"))
    rows.append(("changed settings", _changes(q)))
    stated = "in SP or PV: " if q.faults is not None else "in SP or PV, as the card does not say: "
    rows.append(("NaN, infinity", stated + _BAD_SIGNAL[(q.faults or Faults()).signal]))
    return rows


def _integral(i: Integral[Reference]) -> str:
    if i.on == "none":
        return "none"
    words = {
        Rule.BACKWARD: "backward: this scan's error counts at once",
        Rule.FORWARD: "forward: this scan's error counts from the next scan on",
        Rule.TRAPEZOIDAL: "trapezoidal: the mean of this and the last error",
    }
    still = "" if i.deadband is None else f"; it stands still while the error is within {short(i.deadband)}"
    return words[i.rule] + _HOLDS[i.holds] + still


def _derivative(d: Derivative[Reference]) -> str:
    if d.on == "none":
        return "none"
    filtered = d.filter is not None and d.filter.applies_to in ("term", "lead-lag")
    if d.rule is Rule.FOUR_POINT:
        return "four-point difference, over three scans"
    if not filtered:
        return "backward difference, unfiltered"
    if d.rule is Rule.LAGGED_DIFFERENCE:
        return "difference of the signal and its own lag; without filter time none"
    own = "; the gain comes after the filter" if d.holds == "d" else ""
    return f"{d.rule.value}, filtered" + ("; unfiltered where Tf is 0" if _may_be_off(d) else "") + own


def _may_be_off(d: Derivative[Reference]) -> bool:
    return d.filter is not None and isinstance(d.filter.time, str)


def _filters(q: Equation) -> list[str]:
    """Return the scan rules of the filters on signals."""
    parts = [(what, getattr(q, what)) for what in ("setpoint", "measurement", "error")]
    found = [f"{what} {part.filter.rule.value}" for what, part in parts if part is not None and part.filter is not None]
    filt = filter_at_work(q)
    if filt is not None and filt.applies_to in ("measurement", "output"):
        found.append(f"{filt.applies_to} {(filt.rule or q.derivative.rule).value}{', second order' if filt.order == 2 else ''}")
    return found


def _interval(q: Equation) -> str:
    if q.scan.interval == "nominal":
        return f"{q.scan.default} unless given; uneven scans are computed as if they were even"
    faults = q.faults or Faults()
    zero = {"hold": "zero does nothing", "compute": "zero is computed with"}[faults.zero_interval]
    negative = {
        "hold": "a negative one does nothing",
        "refuse": "a negative one is refused",
        "zero": "a negative one counts as zero",
    }
    return f"{q.scan.default} unless given; measured in every scan: {zero}, {negative[faults.negative_interval]}"


def _arithmetic(q: Equation) -> str:
    a = q.arithmetic
    assert a is not None
    if a.type == "integer":
        return f"integer: {a.counts} counts per percent, {a.gain_counts} per unit of gain, remainders carried"
    wide = "; operations with a number of the program text are float64" if a.type == "float32" and a.literals == "float64" else ""
    return a.type + (", rounded after every operation" if a.type == "float32" else "") + wide


def _changes(q: Equation) -> str:
    if q.implementation == "velocity":
        return "count for the increments to come, and move nothing by themselves"
    if q.integral.on == "none":
        return "a changed gain moves P and D"
    if q.transfer.changes == "bumpless":
        return "do not move the output: the integral takes up what P becomes less"
    idle = "; with a gain of 0 its sum and history go on unseen" if q.transfer.zero_gain == "runs-on" else ""
    return {
        "ki e": "leave the integral as it is; a changed gain moves P and D",
        "e/Ti": "leave the integral of e/Ti as it is; a changed gain moves the whole sum",
        "e": "leave the integral of e as it is; a changed gain or integral time moves the whole sum",
    }[q.integral.holds] + idle


def _action(q: Equation) -> str:
    words, error = q.action.names, q.action.reverse
    if q.action.fixed:
        turned = "" if error == "sp - pv" else ", so a positive gain is direct acting"
        names = f"reverse is called '{words['reverse']}', direct '{words['direct']}'"
        return f"none to choose: the error is {error.upper()}{turned}; {names}"
    vendor = "; the vendor writes the error PV - SP" if error == "pv - sp" else ""
    return f"reverse (output falls when PV rises) is called '{words['reverse']}', direct '{words['direct']}'{vendor}"


def _meanwhile(q: Equation) -> str:
    """Return what integral and derivative do in manual."""
    t = q.transfer
    integral = "" if q.implementation == "velocity" or q.integral.on == "none" else t.way.in_manual
    if q.derivative.on == "none":
        return integral
    return integral + ("; D is 0 and starts from the present signal" if t.derivative == "preset" else "")


def _start(q: Equation) -> str:
    t = q.transfer
    if q.implementation == "velocity":
        words = "bumpless: the first scan makes no increment"
    elif q.integral.on == "none" and not t.way.loads_output:
        words = "nothing is prepared: without integral the output is what P and D make it"
    else:
        loaded = "as it is" if t.loaded == "as-it-is" else "limited"
        words = t.way.at_the_transfer.format(loaded=loaded)
        if t.way.loads_output and t.without_integral == "zero":
            words += "; without integral action nothing is loaded"
        if t.first_scan == "holds" and not t.way.runs_on:
            words += "; the integral does not grow in the first scan"
    if q.derivative.on == "none" or q.form is Form.DAHLIN:
        return words
    return words + {"restarted": "; D starts afresh", "zeroed": "; D starts from a signal of zero: a kick"}.get(t.derivative, "")


def _power_up(q: Equation) -> str:
    t = q.transfer
    if t.power_up == "zero":
        words = "the integral starts at zero, whatever the output was"
        words += ", and does not grow in the first scan" if t.first_scan == "holds" else ""
    else:
        words = "a transfer from the initial output"
    if q.derivative.starts == "zero" and q.derivative.on != "none":
        words += "; D starts from a signal of zero: a kick"
    if q.integral.starts == "zero":
        words += "; the integral starts from an error of zero"
    return words + ("; the first output is 0" if t.first_output == "zero" else "")
