"""Rules on the equation that each combination of options makes: one function each, which says in one sentence why."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Final

from pidemu.card.load import Variant, dotted, variants
from pidemu.card.models import GENERAL_RULES, Equation, Rule, WindupBackCalculation, WindupGate
from pidemu.card.source import Path_
from pidemu.errors import PidemuError, Problem, suggest
from pidemu.settings import limits, off_values
from pidemu.units import Dimension, Role, check_unit, parse_quantity, parse_unit

_NEUTRAL: Final = {
    "multiplier": 1.0,
    "proportional-weight": 1.0,
    "derivative-weight": 1.0,
    "filter-time": 0.0,
    "filter-ratio": 0.0,
    "derivative": 0.0,
}

_BY_ROLE: Final = (
    "gain", "multiplier", "integral", "derivative", "bias", "process-gain", "process-time", "process-delay", "closed-loop-time",
)  # fmt: skip
"""Roles that need no field to name them."""
_WORDS: Final = {"tracking-time": ("Ti", "sqrt(Ti Td)"), "integral-limit": ("output",)}
"""Words that stand where a setting's name could."""
_REFERENCES: Final = (
    (("proportional", "weight"), "proportional-weight"),
    (("cascade", "proportional", "weight"), "proportional-weight"),
    (("derivative", "weight"), "derivative-weight"),
    (("derivative", "filter", "ratio"), "filter-ratio"),
    (("derivative", "filter", "gain"), "filter-gain"),
    (("derivative", "filter", "time"), "filter-time"),
    (("integral", "windup", "tracking_time"), "tracking-time"),
    (("integral", "limits", "low"), "integral-limit"),
    (("integral", "limits", "high"), "integral-limit"),
    (("integral", "deadband"), "deadband"),
    (("setpoint", "filter", "time"), "filter-time"),
    (("setpoint", "filter", "factor"), "filter-factor"),
    (("setpoint", "rate"), "setpoint-rate"),
    (("measurement", "filter", "time"), "filter-time"),
    (("measurement", "filter", "factor"), "filter-factor"),
    (("error", "filter", "time"), "filter-time"),
    (("error", "filter", "factor"), "filter-factor"),
    (("error", "band"), "deadband"),
    (("error", "gain"), "gap-gain"),
    (("error", "linearity"), "linearity"),
    (("feedforward", "gain"), "feedforward-gain"),
    (("output", "rate"), "output-rate"),
    (("output", "deadband"), "deadband"),
    (("output", "resolution"), "resolution"),
)
"""Fields that may name a setting, and what that setting must set."""


def reject_bad_units(variant: Variant) -> Iterator[Problem]:
    """A dial's unit measures what the dial sets."""
    for name, setting in variant.equation.settings.items():
        home = variant.home(("settings", name, "unit"))
        try:
            unit = parse_unit(setting.unit)
            check_unit(Role(setting.sets), unit)
        except PidemuError as error:
            yield variant.card.document.problem(home, str(error))
            continue
        if unit.name != setting.unit:
            yield variant.card.document.problem(home, f"write the unit '{unit.name}'")
        if setting.sets == "gain" and variant.equation.signals == "engineering" and unit.dimension is not Dimension.OP_PER_PV:
            yield variant.card.document.problem(home, "with 'signals: engineering' the gain's unit is 'eu/eu'")


def reject_bad_numbers(variant: Variant) -> Iterator[Problem]:
    """Ranges ascend, and a default lies in its range or is an off value."""
    document = variant.card.document
    for name, s in variant.equation.settings.items():
        home = variant.home(("settings", name))
        low, high = limits(s)
        if not low < high:
            yield document.problem((*home, "range"), f"range {low:g} to {high:g} does not ascend")
        elif s.default is not None and math.isnan(s.default):
            yield document.problem((*home, "default"), "default is not a number")
        elif s.default is not None and s.default not in off_values(s) and not low <= s.default <= high:
            yield document.problem((*home, "default"), f"default {s.default:g} is outside {low:g} to {high:g} and no off value")
    low, high = variant.equation.output.limits
    if not low < high:
        yield document.problem(variant.home(("output", "limits")), f"output limits {low:g} to {high:g} do not ascend")


def reject_unexplained_defaults(variant: Variant) -> Iterator[Problem]:
    """A default is the vendor's, with evidence of its own, or one that switches the term off or leaves it as it is."""
    for name, s in variant.equation.settings.items():
        if s.default is None or s.default in off_values(s) or s.default == _NEUTRAL.get(s.sets):
            continue
        home = variant.home(("settings", name, "default"))
        key = variant.card.evidence_key(home) or ""
        if name not in key.split("."):
            yield variant.card.document.problem(
                home, f"default {s.default:g} needs evidence of its own, at '{dotted(home)}' or '{dotted(home[:-1])}'"
            )


def reject_bad_scan(variant: Variant) -> Iterator[Problem]:
    """The default scan interval is a time above zero."""
    try:
        number, unit = parse_quantity(variant.equation.scan.default)
        if unit is None or unit.dimension is not Dimension.TIME or not 0 < number < math.inf:
            raise PidemuError(f"'{variant.equation.scan.default}' is no time; write it like '1 s'")
    except PidemuError as error:
        yield variant.card.document.problem(variant.home(("scan", "default")), str(error))


def reject_missing_dials(variant: Variant) -> Iterator[Problem]:
    """Each term has exactly one dial."""
    equation, document = variant.equation, variant.card.document
    dahlin = equation.form == "dahlin"
    roles = {
        "gain": not dahlin and not (equation.form == "parallel" and equation.proportional.on == "none"),
        "integral": not dahlin and equation.integral.on != "none",
        "derivative": equation.derivative.on != "none",
        "process-gain": dahlin,
        "process-time": dahlin,
        "process-delay": dahlin,
        "closed-loop-time": dahlin,
        "bias": False,
    }
    for role, needed in roles.items():
        dials = [n for n, s in equation.settings.items() if s.sets == role]
        if needed and not dials:
            yield document.problem(variant.home(("settings",)), f"no setting sets the {role}", at_key=True)
        if len(dials) > 1:
            yield document.problem(
                variant.home(("settings", dials[1])), f"'{dials[0]}' and '{dials[1]}' both set the {role}", at_key=True
            )


def reject_bad_references(variant: Variant) -> Iterator[Problem]:
    """A field that names a setting names one with the right role, a number in its place is one, and every such setting is named."""
    equation, document = variant.equation, variant.card.document
    for path, name, role in _references(equation):
        signed = role == "integral-limit"
        if isinstance(name, float) and (math.isnan(name) if signed else not 0 <= name < math.inf):
            yield document.problem(variant.home(path), f"{path[-1]} is {name:g}; it is a number{'' if signed else ' from 0 up'}")
        if not isinstance(name, str) or name in _WORDS.get(role, ()):
            continue
        setting = equation.settings.get(name)
        if setting is None:
            yield document.problem(variant.home(path), f"no setting '{name}'{suggest(name, equation.settings)}")
        elif setting.sets != role:
            yield document.problem(variant.home(path), f"'{name}' sets the {setting.sets}, here a {role} is needed")
    named = {name for _, name, _ in _references(equation)}
    everywhere = {n for v in variants(variant.card) for _, n, _ in _references(v.equation)}
    for name, setting in equation.settings.items():
        needs = setting.sets not in _BY_ROLE
        if needs and name not in named and name not in everywhere:
            yield document.problem(variant.home(("settings", name)), f"nothing uses '{name}'", at_key=True)


def _references(equation: Equation) -> Iterator[tuple[Path_, object, str]]:
    """Yield every field that may name a setting: its path, its value and the role that the setting must have."""
    for path, role in _REFERENCES:
        part: object = equation
        for key in path:
            part = getattr(part, key, None)
        if part is not None:
            yield tuple(key.replace("_", "-") for key in path), part, role


def reject_bad_signal_filters(variant: Variant) -> Iterator[Problem]:
    """A filter on a signal has a time or a factor, and a factor is a share of the new sample."""
    for key in ("setpoint", "measurement", "error"):
        part = getattr(variant.equation, key)
        if part is None or part.filter is None:
            continue
        home = variant.home((key, "filter"))
        if (part.filter.time is None) == (part.filter.factor is None):
            yield variant.card.document.problem(home, "a filter on a signal needs exactly one of time and factor", at_key=True)
        if isinstance(part.filter.factor, float) and not 0 < part.filter.factor <= 1:
            yield variant.card.document.problem((*home, "factor"), f"factor is {part.filter.factor:g}; it is above 0, up to 1")


def reject_bad_error(variant: Variant) -> Iterator[Problem]:
    """A shape of the error has what it needs and nothing else, and a filtered error is what P and D act on."""
    equation, document = variant.equation, variant.card.document
    error = equation.error
    if error is None:
        return
    home = variant.home(("error",))
    for key, shape in (("band", "gap"), ("linearity", "gain-linear")):
        given = getattr(error, key) is not None
        if given != (error.shape == shape):
            message = f"shape '{shape}' needs '{key}'" if not given else f"'{key}' has no meaning with shape '{error.shape}'"
            yield document.problem(home, message, at_key=True)
    if error.shape != "gap" and (error.gain != 0 or error.subtracted or error.zero_crossing):
        yield document.problem(home, "'gain', 'subtracted' and 'zero-crossing' belong to shape 'gap'", at_key=True)
    if error.filter is not None and not {equation.proportional.on, equation.derivative.on} <= {"error", "none"}:
        yield document.problem(home, "a filter on the error needs P and D on the error", at_key=True)


def reject_bad_cascade(variant: Variant) -> Iterator[Problem]:
    """In cascade the proportional term may have another setpoint weight, and nothing else."""
    equation, cascade = variant.equation, variant.equation.cascade
    if cascade is not None and (cascade.proportional.on == "none" or equation.proportional.on == "none"):
        message = "a proportional term that comes or goes with the mode is not defined"
        yield variant.card.document.problem(variant.home(("cascade",)), message, at_key=True)


def reject_bad_transfer(variant: Variant) -> Iterator[Problem]:
    """The fine print of a transfer goes with the transfer that it belongs to."""
    equation, document = variant.equation, variant.card.document
    t, home = equation.transfer, variant.home(("transfer",))
    if equation.implementation == "velocity" and (t.start != "bumpless" or t.power_up != "transfer"):
        yield document.problem(home, "a velocity implementation starts from the last output: 'bumpless'", at_key=True)
    if t.first_scan == "holds" and t.start in ("bumpless", "tracked"):
        yield document.problem(home, f"'first-scan' has no meaning with start '{t.start}'", at_key=True)
    if t.start != "load-output" and (t.loaded != "limited" or t.without_integral != "kept"):
        yield document.problem(home, "'loaded' and 'without-integral' belong to start 'load-output'", at_key=True)
    if t.changes == "bumpless" and equation.integral.holds != "ki e":
        yield document.problem(home, "'changes: bumpless' needs an integral that holds 'ki e'", at_key=True)


def reject_bad_arithmetic(variant: Variant) -> Iterator[Problem]:
    """Whole numbers have a size, and an algorithm that is written for them."""
    equation, document, a = variant.equation, variant.card.document, variant.equation.arithmetic
    if a is None:
        return
    home = variant.home(("arithmetic",))
    if (a.type == "integer") != (a.counts is not None and a.gain_counts is not None):
        yield document.problem(home, "'counts' and 'gain-counts' go with type 'integer'", at_key=True)
    if a.type != "float32" and a.literals != "float32":
        yield document.problem(home, "'literals' belongs to type 'float32'", at_key=True)
    fits = equation.form == "standard" and equation.implementation == "velocity" and equation.integral.rule is Rule.BACKWARD
    fits = fits and equation.proportional.on == "error" and equation.derivative.on in ("pv", "none")
    if a.type == "integer" and not fits:
        message = "type 'integer' is defined for velocity, standard form, backward rule, P on error, D on pv"
        yield document.problem(home, message, at_key=True)


def reject_bad_pole_cancellation(variant: Variant) -> Iterator[Problem]:
    """Pole cancellation is a recursion on past outputs and has no terms of its own."""
    equation = variant.equation
    if equation.form != "dahlin":
        return
    if equation.implementation != "velocity" or (equation.proportional.on, equation.derivative.on) != ("none", "none"):
        message = "form 'dahlin' is a velocity implementation without P and D: 'on: none'"
        yield variant.card.document.problem(variant.home(("form",)), message)


def reject_bad_derivative_rule(variant: Variant) -> Iterator[Problem]:
    """Two rules of the derivative have a say in its filter."""
    rule, filt = variant.equation.derivative.rule, variant.equation.derivative.filter
    on_term = filt is not None and filt.applies_to in ("term", "lead-lag")
    if variant.equation.derivative.on == "none":
        return
    home = variant.home(("derivative", "rule"))
    if rule == "lagged-difference" and not on_term:
        yield variant.card.document.problem(home, "the lagged-difference rule needs a filter on the term")
    if rule == "four-point" and on_term:
        yield variant.card.document.problem(home, "the four-point rule goes with no other filter on the term")
    if filt is not None and not on_term and filt.rule is None and rule not in GENERAL_RULES:
        yield variant.card.document.problem(home, f"the filter needs a rule of its own: '{rule}' is one of the derivative only")


def reject_bad_weights(variant: Variant) -> Iterator[Problem]:
    """A weight goes with 'on: weighted' and with nothing else."""
    for term in ("proportional", "derivative"):
        part = getattr(variant.equation, term)
        if (part.on == "weighted") != (part.weight is not None):
            message = "'on: weighted' needs 'weight'" if part.weight is None else f"'weight' has no meaning with 'on: {part.on}'"
            yield variant.card.document.problem(variant.home((term, "on")), message, at_key=True)


def reject_bad_filter(variant: Variant) -> Iterator[Problem]:
    """A filter has one measure, and sits where the form has a place for it."""
    equation, document = variant.equation, variant.card.document
    filt = equation.derivative.filter
    if filt is None:
        return
    home = variant.home(("derivative", "filter"))
    if sum(x is not None for x in (filt.ratio, filt.gain, filt.time)) != 1:
        yield document.problem(home, "a filter needs exactly one of ratio, gain and time", at_key=True)
    if filt.applies_to == "lead-lag" and equation.form != "series":
        yield document.problem(home, f"a lead-lag belongs to the series form, this is '{equation.form.value}'", at_key=True)
    if filt.order == 2 and filt.applies_to != "measurement":
        yield document.problem(home, "a filter of order 2 is defined for the measurement only", at_key=True)
    if filt.of == "effective-derivative" and filt.time is not None:
        yield document.problem(home, "'of' refers to ratio or gain, not to time", at_key=True)


def reject_bad_windup(variant: Variant) -> Iterator[Problem]:
    """The windup scheme fits the implementation and the rule."""
    equation, document = variant.equation, variant.card.document
    scheme, home = equation.integral.windup.scheme, variant.home(("integral", "windup"))
    if (scheme == "velocity") != (equation.implementation == "velocity"):
        yield document.problem(home, f"windup '{scheme}' does not go with implementation '{equation.implementation}'", at_key=True)
    if scheme == "external-reset" and equation.integral.rule is Rule.TRAPEZOIDAL:
        yield document.problem(home, "external-reset is defined for the backward and forward rules", at_key=True)
    if scheme == "external-reset" and equation.integral.on != "none" and equation.proportional.on != "error":
        message = "external-reset needs P on the error: positive feedback of another P settles beyond the limit"
        yield document.problem(home, message, at_key=True)
    if equation.proportional.accumulated and (equation.proportional.on != "pv" or equation.implementation != "positional"):
        place = variant.home(("proportional", "accumulated"))
        yield document.problem(place, "'accumulated' belongs to a positional P on pv", at_key=True)
    if (
        scheme == "clamp-sum"
        and equation.implementation == "positional"
        and equation.proportional.on == "pv"
        and not equation.proportional.accumulated
    ):
        yield document.problem(home, "clamp-sum with P on pv needs 'proportional.accumulated: true'", at_key=True)


def reject_bad_windup_details(variant: Variant) -> Iterator[Problem]:
    """The fine print of a windup scheme goes with the scheme that it belongs to."""
    windup, document, home = variant.equation.integral.windup, variant.card.document, variant.home(("integral", "windup"))
    if isinstance(windup, WindupGate):
        freezes = windup.scheme == "freeze"
        if not freezes and (windup.judged_on != "output" or windup.direction != "further"):
            yield document.problem(home, "'judged-on' and 'direction' belong to 'freeze'", at_key=True)
        if freezes and windup.test != "increment":
            yield document.problem(home, "'test' belongs to 'conditional'", at_key=True)
    if isinstance(windup, WindupBackCalculation):
        word = windup.tracking_time in ("Ti", "sqrt(Ti Td)")
        if word and (windup.times is not None or windup.when_off is not None):
            yield document.problem(home, "'times' and 'when-off' go with a number or a setting under 'tracking-time'", at_key=True)
    if variant.equation.integral.holds != "ki e" and (
        variant.equation.implementation == "velocity"
        or variant.equation.form == "parallel"
        or windup.scheme in ("clamp", "clamp-sum")
    ):
        message = "an integral that does not hold 'ki e' needs a positional implementation with one gain, and limits of its own"
        yield document.problem(variant.home(("integral", "holds")), message)


def reject_wrong_action(variant: Variant) -> Iterator[Problem]:
    """The one-scan example of the action is true when it is run."""
    example, names = variant.equation.action.example, variant.equation.action.names
    home = variant.home(("action", "example"))
    words = {word: sense for sense, word in names.items()}
    at_names = variant.home(("action", "names"))
    if set(names) != {"reverse", "direct"}:
        yield variant.card.document.problem(at_names, "names needs both 'reverse' and 'direct'", at_key=True)
    elif len(words) == 1:
        yield variant.card.document.problem(at_names, f"reverse and direct have the same name '{names['reverse']}'", at_key=True)
    elif example.name not in words:
        yield variant.card.document.problem(home, f"'{example.name}' is not one of the names: {', '.join(words)}", at_key=True)
    elif example.sp == example.pv:
        yield variant.card.document.problem(home, "setpoint and measurement must differ", at_key=True)
    else:
        falls = (example.pv > example.sp) == (words[example.name] == "reverse")
        if falls != (example.output == "falls"):
            true = "falls" if falls else "rises"
            message = f"with {words[example.name]} action the output {true}, the example says it {example.output}"
            yield variant.card.document.problem(home, message, at_key=True)


RULES: Final[tuple[Callable[[Variant], Iterator[Problem]], ...]] = (
    reject_bad_units,
    reject_bad_numbers,
    reject_unexplained_defaults,
    reject_bad_scan,
    reject_missing_dials,
    reject_bad_references,
    reject_bad_weights,
    reject_bad_filter,
    reject_bad_windup,
    reject_bad_windup_details,
    reject_bad_signal_filters,
    reject_bad_error,
    reject_bad_cascade,
    reject_bad_transfer,
    reject_bad_arithmetic,
    reject_bad_pole_cancellation,
    reject_bad_derivative_rule,
    reject_wrong_action,
)
