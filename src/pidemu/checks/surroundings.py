"""Rules on what stands around the terms: filters, error, cascade, windup's fine print, transfer, arithmetic, faults."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from pidemu.card.load import Variant
from pidemu.card.model.base import GENERAL_RULES, Reference, Rule
from pidemu.card.model.card_file import Equation
from pidemu.card.model.signals import ErrorShape
from pidemu.errors import Problem
from pidemu.settings.settings import limits


def reject_bad_signal_filters(variant: Variant) -> Iterator[Problem]:
    """A filter on a signal has a time or a factor, and a factor is a share of the new sample."""
    document = variant.card.document
    for key in ("setpoint", "measurement", "error"):
        part = getattr(variant.equation, key)
        if part is None or part.filter is None:
            continue
        home, filt = variant.home((key, "filter")), part.filter
        if (filt.time is None) == (filt.factor is None):
            yield document.problem(home, "a filter on a signal needs exactly one of time and factor", at_key=True)
        if isinstance(filt.factor, float) and not 0 < filt.factor <= 1:
            yield document.problem((*home, "factor"), f"factor is {filt.factor:g}; it is above 0, up to 1")
        if filt.factor is not None and filt.rule is not Rule.BACKWARD:
            yield document.problem((*home, "rule"), "a share of the new sample is the backward rule; leave 'rule' out")
    for name, setting in variant.equation.settings.items():
        low, high = limits(setting)
        if setting.sets == "filter-factor" and not 0 < low < high <= (100 if setting.unit == "%" else 1):
            message = f"'{name}' is a share of the new sample: give it a range above 0, up to 1"
            yield document.problem(variant.home(("settings", name)), message, at_key=True)


def reject_bad_setpoint(variant: Variant) -> Iterator[Problem]:
    """Only a limited setpoint starts elsewhere than at the setpoint, falls at a rate of its own, or is limited in some modes."""
    setpoint = variant.equation.setpoint
    if setpoint is not None and setpoint.starts == "zero" and setpoint.rate is None:
        yield variant.card.document.problem(
            variant.home(("setpoint", "starts")), "'starts: zero' belongs to a setpoint with a 'rate'"
        )
    if setpoint is not None and setpoint.rate is None and (setpoint.rate_down is not None or setpoint.rate_counts != "always"):
        message = "'rate-down' and 'rate-counts' belong to a setpoint with a 'rate'"
        yield variant.card.document.problem(variant.home(("setpoint",)), message, at_key=True)


def reject_bad_error(variant: Variant) -> Iterator[Problem]:
    """A shape of the error has what it needs and nothing else, and a filtered error is what P and D act on."""
    equation, document, home = variant.equation, variant.card.document, variant.home(("error",))
    error = equation.error
    if error is None:
        return
    for key, shape in (("band", "gap"), ("linearity", "gain-linear")):
        given = getattr(error, key) is not None
        if given != (error.shape == shape):
            message = f"shape '{shape}' needs '{key}'" if not given else f"'{key}' has no meaning with shape '{error.shape}'"
            yield document.problem(home, message, at_key=True)
    for message in _idle_in_error(error):
        yield document.problem(home, message, at_key=True)
    if isinstance(error.linearity, float) and error.linearity > 1:
        yield document.problem((*home, "linearity"), f"linearity is {error.linearity:g}; it is a share from 0 to 1")
    if error.subtracted and error.zero_crossing:
        message = "'subtracted' and 'zero-crossing' do not go together: within the band the error would change its sign; remove one"
        yield document.problem(home, message, at_key=True)
    if error.on == "proportional" and equation.proportional.on == "pv":
        yield document.problem((*home, "on"), "P acts on pv and has no error to shape; write 'on: integral'")
    in_cascade = equation.proportional if equation.cascade is None else equation.cascade.proportional
    if error.filter is not None and not {equation.proportional.on, in_cascade.on, equation.derivative.on} <= {"error", "none"}:
        yield document.problem(home, "a filter on the error needs P and D on the error, in cascade too", at_key=True)


def _idle_in_error(error: ErrorShape[Reference]) -> Iterator[str]:
    """Yield what is said of a shape that the error does not have."""
    if error.shape != "gap" and (error.gain != 0 or error.subtracted or error.zero_crossing or error.edge != "inside"):
        yield "'gain', 'subtracted', 'zero-crossing' and 'edge' belong to shape 'gap'"
    if error.shape in ("linear", "gap") and error.over != 100:
        yield "'over' belongs to the shapes 'squared' and 'gain-linear'"
    if error.shape == "linear" and error.on != "error":
        yield "'on' says where a shape counts; it has no meaning with shape 'linear'"


def reject_bad_cascade(variant: Variant) -> Iterator[Problem]:
    """In cascade the proportional term may have another setpoint weight, and nothing else."""
    equation, cascade, home = variant.equation, variant.equation.cascade, variant.home(("cascade",))
    if cascade is None:
        return
    if cascade.proportional.on == "none" or equation.proportional.on == "none":
        message = "a proportional term that comes or goes with the mode is not defined"
        yield variant.card.document.problem(home, message, at_key=True)
    if cascade.proportional.accumulated or equation.proportional.accumulated:
        message = "an accumulated proportional term is not defined with another structure in cascade"
        yield variant.card.document.problem(home, message, at_key=True)


def reject_bad_integral(variant: Variant) -> Iterator[Problem]:
    """What is said of the integral's state fits the rule, the form and the implementation."""
    equation, document, i = variant.equation, variant.card.document, variant.equation.integral
    if i.starts == "zero" and i.rule is not Rule.TRAPEZOIDAL:
        yield document.problem(variant.home(("integral", "starts")), "'starts: zero' belongs to the trapezoidal rule")
    if i.limits is not None:
        home = variant.home(("integral", "limits"))
        if equation.implementation == "velocity":
            yield document.problem(home, "a velocity implementation has no integral to limit; remove 'limits'", at_key=True)
        low = -i.limits.high if i.limits.low is None and isinstance(i.limits.high, float) else i.limits.low
        if isinstance(low, float) and isinstance(i.limits.high, float) and not low < i.limits.high:
            yield document.problem(home, f"limits {low:g} to {i.limits.high:g} do not ascend", at_key=True)
    wrong = _wrong_state(equation)
    if i.holds != "ki e" and wrong is not None:
        yield document.problem(variant.home(("integral", "holds")), f"'holds: {i.holds}' {wrong}")


def _wrong_state(equation: Equation) -> str | None:
    """Return why the integral's state cannot be that of the error without its gain."""
    if equation.implementation == "velocity":
        return "belongs to a positional implementation; remove it"
    if equation.form == "parallel":
        whole = equation.integral.holds == "e"
        return None if whole else "needs one gain for all terms, which the parallel form does not have; remove it"
    if equation.integral.windup.limits_the_term:
        return f"does not go with windup '{equation.integral.windup.scheme}', which limits the term; use 'integral.limits'"
    return None


def reject_bad_windup(variant: Variant) -> Iterator[Problem]:
    """The windup scheme fits the equation that it stands in."""
    home = variant.home(("integral", "windup"))
    for message in variant.equation.integral.windup.faults(variant.equation):
        yield variant.card.document.problem(home, message, at_key=True)


def reject_accumulated_elsewhere(variant: Variant) -> Iterator[Problem]:
    """Only a positional P on PV can be accumulated."""
    P = variant.equation.proportional
    if P.accumulated and (P.on != "pv" or variant.equation.implementation != "positional"):
        place = variant.home(("proportional", "accumulated"))
        yield variant.card.document.problem(place, "'accumulated' belongs to a positional P on pv", at_key=True)


def reject_bad_transfer(variant: Variant) -> Iterator[Problem]:
    """The fine print of a transfer goes with the transfer that it belongs to."""
    equation, document = variant.equation, variant.card.document
    t, home = equation.transfer, variant.home(("transfer",))
    if equation.implementation == "velocity" and (t.start, t.power_up, t.first_output) != ("bumpless", "transfer", "computed"):
        message = "a velocity implementation goes on from the last output: 'start: bumpless', without 'power-up' and 'first-output'"
        yield document.problem(home, message, at_key=True)
    if t.first_scan == "holds" and not t.way.can_hold:
        yield document.problem(home, f"'first-scan' has no meaning with start '{t.start}'", at_key=True)
    if not t.way.loads_output and t.loaded != "limited":
        yield document.problem(home, "'loaded' belongs to start 'load-output'", at_key=True)
    if t.changes == "bumpless" and equation.integral.holds != "ki e":
        yield document.problem(home, "'changes: bumpless' needs an integral that holds 'ki e'", at_key=True)
    if t.manual_output == "gain-times-operator" and not equation.action.fixed:
        message = "'gain-times-operator' needs 'action.fixed: true': the sign of the gain would depend on the action"
        yield document.problem((*home, "manual-output"), message)


def reject_bad_feedforward(variant: Variant) -> Iterator[Problem]:
    """Increments cannot be added behind the limits."""
    feedforward = variant.equation.feedforward
    if feedforward is not None and variant.equation.implementation == "velocity" and feedforward.summed == "after-limits":
        message = "a velocity implementation adds increments before the limits; write 'summed: before-limits'"
        yield variant.card.document.problem(variant.home(("feedforward", "summed")), message)


def reject_bad_faults(variant: Variant) -> Iterator[Problem]:
    """What an interval does matters where intervals are measured, and one of zero can be computed with by one rule."""
    equation, document, faults = variant.equation, variant.card.document, variant.equation.faults
    if faults is None:
        return
    home = variant.home(("faults",))
    if equation.scan.interval == "nominal" and (faults.zero_interval, faults.negative_interval) != ("hold", "hold"):
        yield document.problem(home, "'zero-interval' and 'negative-interval' belong to 'scan.interval: measured'", at_key=True)
    elif faults.zero_interval == "compute" and equation.derivative.rule is not Rule.LAGGED_DIFFERENCE:
        message = "'zero-interval: compute' is defined for the lagged-difference rule: every other divides by the interval"
        yield document.problem((*home, "zero-interval"), message)


def reject_bad_arithmetic(variant: Variant) -> Iterator[Problem]:
    """Whole numbers have a size, and an algorithm that is written for them."""
    equation, document, a = variant.equation, variant.card.document, variant.equation.arithmetic
    if a is None:
        return
    home = variant.home(("arithmetic",))
    if a.type == "integer" and (a.counts is None or a.gain_counts is None):
        yield document.problem(home, "type 'integer' needs 'counts' and 'gain-counts'", at_key=True)
    if a.type != "integer" and (a.counts is not None or a.gain_counts is not None):
        yield document.problem(home, "'counts' and 'gain-counts' belong to type 'integer'", at_key=True)
    if a.type != "float32" and a.literals != "float32":
        yield document.problem(home, "'literals' belongs to type 'float32'", at_key=True)
    if a.type == "integer" and not _fits_integers(equation):
        message = "type 'integer' is defined for velocity, standard form, backward rules, P on error, D on pv, a filter on the term"
        yield document.problem(home, message, at_key=True)
    if a.type == "integer":
        for key in _beyond_integers(equation):
            yield document.problem(home, f"type 'integer' goes with no '{key}'; remove it", at_key=True)


def _fits_integers(equation: Equation) -> bool:
    derivative, filt = equation.derivative, equation.derivative.filter
    terms = equation.proportional.on == "error" and derivative.on in ("pv", "none")
    rules = equation.integral.rule is Rule.BACKWARD and derivative.rule is Rule.BACKWARD
    form = equation.form == "standard" and equation.implementation == "velocity"
    return form and terms and rules and (filt is None or filt.applies_to == "term")


def _beyond_integers(equation: Equation) -> Iterator[str]:
    """Yield the fields that integer arithmetic would pass over in silence."""
    for key in ("error", "cascade", "feedforward"):
        if getattr(equation, key) is not None:
            yield key
    yield from (f"output.{key}" for key in ("rate", "deadband", "resolution") if getattr(equation.output, key) is not None)
    if equation.integral.deadband is not None:
        yield "integral.deadband"


def reject_bad_pole_cancellation(variant: Variant) -> Iterator[Problem]:
    """Pole cancellation is a recursion on past outputs and has no terms of its own."""
    equation, home = variant.equation, variant.home(("form",))
    if equation.form != "dahlin":
        return
    terms = (equation.proportional.on, equation.integral.on, equation.derivative.on)
    if equation.implementation != "velocity" or terms != ("none", "error", "none"):
        message = "form 'dahlin' is a velocity implementation of an integral on the error, without P and D: 'on: none'"
        yield variant.card.document.problem(home, message)
    for key, given in (("feedforward", equation.feedforward), ("integral.deadband", equation.integral.deadband)):
        if given is not None:
            yield variant.card.document.problem(home, f"form 'dahlin' goes with no '{key}'; remove it")


def reject_bad_derivative_rule(variant: Variant) -> Iterator[Problem]:
    """Two rules of the derivative have a say in its filter."""
    rule, filt = variant.equation.derivative.rule, variant.equation.derivative.filter
    on_term = filt is not None and filt.applies_to in ("term", "lead-lag")
    if variant.equation.derivative.on == "none":
        return
    home = variant.home(("derivative", "rule"))
    if rule is Rule.LAGGED_DIFFERENCE and not on_term:
        yield variant.card.document.problem(home, "the lagged-difference rule needs a filter on the term")
    if rule is Rule.FOUR_POINT and on_term:
        yield variant.card.document.problem(home, "the four-point rule goes with no other filter on the term")
    if filt is not None and not on_term and filt.rule is None and rule not in GENERAL_RULES:
        yield variant.card.document.problem(home, f"the filter needs a rule of its own: '{rule}' is one of the derivative only")


RULES: Final[tuple[Callable[[Variant], Iterator[Problem]], ...]] = (
    reject_bad_signal_filters,
    reject_bad_setpoint,
    reject_bad_error,
    reject_bad_cascade,
    reject_bad_integral,
    reject_bad_windup,
    reject_accumulated_elsewhere,
    reject_bad_transfer,
    reject_bad_feedforward,
    reject_bad_faults,
    reject_bad_arithmetic,
    reject_bad_pole_cancellation,
    reject_bad_derivative_rule,
)
