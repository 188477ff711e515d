"""Rules on the equation that each combination of options makes: one function each, which says in one sentence why.

Here are those on dials and terms; `pidemu.checks.surroundings` has those on what stands around the terms.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Final

from pidemu.card.document import Path_
from pidemu.card.load import Variant, dotted
from pidemu.card.model.base import Reference
from pidemu.card.model.card_file import Equation
from pidemu.card.model.terms import Derivative, Proportional
from pidemu.card.references import references
from pidemu.checks import surroundings as stages
from pidemu.errors import PidemuError, Problem, UnitError
from pidemu.settings.ranges import are_limits
from pidemu.settings.settings import limits, off_values
from pidemu.units import LEVELS, RATES, Dimension, Role, Unit, check_unit, parse_quantity, parse_unit

_NEUTRAL: Final = {
    "multiplier": 1.0,
    "proportional-weight": 1.0,
    "derivative-weight": 1.0,
    "filter-time": 0.0,
    "filter-ratio": 0.0,
    "derivative": 0.0,
    "filter-factor": 1.0,
    "deadband": 0.0,
    "gap-gain": 1.0,
    "linearity": 1.0,
    "bias": 0.0,
    "output-rate": math.inf,
    "setpoint-rate": math.inf,
    "resolution": 0.0,
    "process-delay": 0.0,
}
"""Values that leave everything as it is."""

_OF_TERMS: Final = ("gain", "multiplier", "integral", "derivative", "bias")
_OF_THE_PROCESS: Final = ("process-gain", "process-time", "process-delay", "closed-loop-time")
_SHORTEST_SCAN: Final = 1e-6
_LONGEST_SCAN: Final = 1e6
"""Plausible scan intervals [s]."""
_RATES: Final = ("output-rate", "setpoint-rate")
_OFF_AT_INFINITY: Final = (*_RATES, "integral-limit", "windup-limit")
"""What may be infinite."""


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
        if variant.equation.signals == "engineering":
            yield from (
                variant.card.document.problem(home, m) for m in _wrong_in_own_units(variant.equation, Role(setting.sets), unit)
            )


def _wrong_in_own_units(equation: Equation, role: Role, unit: Unit) -> Iterator[str]:
    """Yield why a unit does not go with signals in engineering units."""
    if role is Role.GAIN:
        whole_output = unit.dimension in (Dimension.PV_UNITS, Dimension.PERCENT_PER_PV)
        if equation.form == "parallel" and unit.dimension is not Dimension.OP_PER_PV:
            yield "with 'signals: engineering' the gain of a parallel form is in 'eu/eu', as its integral and derivative gains are"
        elif not whole_output and unit.dimension is not Dimension.OP_PER_PV:
            yield "with 'signals: engineering' the gain's unit is 'eu/eu', '%/eu', or for a proportional band 'eu'"
        elif whole_output and not are_limits(equation.output.limits):
            yield f"'{unit.name}' refers to the output's range, and 'output.limits' is infinite; give limits, or a gain in 'eu/eu'"
    in_percent = unit.dimension is Dimension.PERCENT_PER_TIME or (role in LEVELS and unit.dimension is Dimension.PERCENT)
    if in_percent and role in (*LEVELS, *RATES):
        yield f"with 'signals: engineering' the {role.value.replace('-', ' ')} is in '{unit.name.replace('%', 'eu')}'"


def reject_mixed_degrees(variant: Variant) -> Iterator[Problem]:
    """A controller that computes in degrees computes in one kind of them."""
    if variant.equation.signals != "engineering":
        return
    first: tuple[str, Unit] | None = None
    for name, setting in variant.equation.settings.items():
        try:
            unit = parse_unit(setting.unit)
        except UnitError:  # has a rule of its own
            continue
        if unit.degree is not None and first is not None and unit.degree != first[1].degree:
            message = f"'{unit.name}', but '{first[0]}' is in '{first[1].name}'; the signals are in one of them"
            yield variant.card.document.problem(variant.home(("settings", name, "unit")), message)
        elif unit.degree is not None and first is None:
            first = name, unit


def reject_bad_numbers(variant: Variant) -> Iterator[Problem]:
    """Ranges ascend, and a default lies in its range or is an off value."""
    document = variant.card.document
    for name, s in variant.equation.settings.items():
        home = variant.home(("settings", name))
        low, high = limits(s)
        if not low < high:
            yield document.problem((*home, "range"), f"range {low:g} to {high:g} does not ascend")
        elif s.default is not None and math.isinf(s.default) and s.default not in off_values(s) and s.sets not in _OFF_AT_INFINITY:
            yield document.problem((*home, "default"), f"default is infinite, which does not go with the {s.sets}; give a number")
        elif s.default is not None and s.default not in off_values(s) and not low <= s.default <= high:
            yield document.problem(
                (*home, "default"), f"default {s.default:g} is outside {low:g} to {high:g} and is not an off value"
            )
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
        if unit is None or unit.dimension is not Dimension.TIME or unit.scans or not number > 0:
            raise PidemuError(f"'{variant.equation.scan.default}' is not a time; write it like '1 s'")
        if not _SHORTEST_SCAN <= number * unit.factor <= _LONGEST_SCAN:
            raise PidemuError(f"'{variant.equation.scan.default}' is not a plausible scan interval; write it like '1 s'")
    except PidemuError as error:
        yield variant.card.document.problem(variant.home(("scan", "default")), str(error))


def reject_missing_dials(variant: Variant) -> Iterator[Problem]:
    """Each term has exactly one dial, and no dial is of a term that the form does not have."""
    equation, document = variant.equation, variant.card.document
    dahlin = equation.form == "dahlin"
    roles = {
        "gain": not dahlin and not (equation.form == "parallel" and equation.proportional.on == "none"),
        "multiplier": False,
        "integral": not dahlin and equation.integral.on != "none",
        "derivative": equation.derivative.on != "none",
        "bias": False,
        "process-gain": dahlin,
        "process-time": dahlin,
        "process-delay": False,
        "closed-loop-time": dahlin,
    }
    for role, needed in roles.items():
        dials = [n for n, s in equation.settings.items() if s.sets == role]
        if needed and not dials:
            yield document.problem(variant.home(("settings",)), f"no setting sets the {role}", at_key=True)
        if len(dials) > 1:
            yield document.problem(
                variant.home(("settings", dials[1])), f"'{dials[0]}' and '{dials[1]}' both set the {role}", at_key=True
            )
        if dials and role in (_OF_TERMS if dahlin else _OF_THE_PROCESS):
            message = f"'{dials[0]}' sets the {role}, which form '{equation.form.value}' does not have; remove it"
            yield document.problem(variant.home(("settings", dials[0])), message, at_key=True)


def reject_bad_constants(variant: Variant) -> Iterator[Problem]:
    """A number in place of a setting's name is one that such a setting could have."""
    for path, number, mark in references(variant.equation):
        wrong = _wrong_number(str(path[-1]), mark.sets, number) if isinstance(number, float) else None
        if wrong is not None:
            yield variant.card.document.problem(variant.home(path), wrong)


def _wrong_number(field: str, role: str, x: float) -> str | None:
    """Return what is wrong with a number that stands where a setting's name could."""
    if role in ("integral-limit", "windup-limit"):
        return None
    if not 0 <= x < math.inf and role != "filter-factor":  # which has a rule of its own
        return f"{field} is {x:g}; it is a number from 0 up"
    return f"{field} is 0: nothing would ever move; give a number above 0" if x == 0 and role in _RATES else None


def reject_bad_weights(variant: Variant) -> Iterator[Problem]:
    """A weight goes with 'on: weighted' and with nothing else."""
    q = variant.equation
    parts: list[tuple[Path_, Proportional[Reference] | Derivative[Reference]]] = [
        (("proportional",), q.proportional),
        (("derivative",), q.derivative),
    ]
    if q.cascade is not None:
        parts.append((("cascade", "proportional"), q.cascade.proportional))
    for path, part in parts:
        if (part.on == "weighted") != (part.weight is not None):
            message = "'on: weighted' needs 'weight'" if part.weight is None else f"'weight' has no meaning with 'on: {part.on}'"
            yield variant.card.document.problem(variant.home((*path, "on")), message, at_key=True)


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
    if filt.of != "derivative" and filt.time is not None:
        yield document.problem(home, "'of' refers to ratio or gain, not to time", at_key=True)
    parallel = equation.form == "parallel"
    if filt.of == "derivative-time" and parallel and equation.proportional.on == "none":
        yield document.problem((*home, "of"), "'derivative-time' is kd/kp, and this card has no proportional term")
    if filt.of == "effective-derivative" and parallel and equation.derivative.on != "none":
        message = "'effective-derivative' is of a series or standard form; of a parallel one, kd/kp is 'derivative-time'"
        yield document.problem((*home, "of"), message)
    if filt.rule is not None and filt.applies_to in ("term", "lead-lag"):
        message = "'rule' here is that of a filter on measurement or output; the term's is 'derivative.rule'"
        yield document.problem((*home, "rule"), message)


def reject_wrong_action(variant: Variant) -> Iterator[Problem]:
    """The one-scan example of the action is true when it is run."""
    example, names = variant.equation.action.example, variant.equation.action.names
    home = variant.home(("action", "example"))
    words = {word: sense for sense, word in names.items()}
    at_names = variant.home(("action", "names"))
    if len(words) == 1:
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
    reject_mixed_degrees,
    reject_bad_numbers,
    reject_unexplained_defaults,
    reject_bad_scan,
    reject_missing_dials,
    reject_bad_constants,
    reject_bad_weights,
    reject_bad_filter,
    *stages.RULES,
    reject_wrong_action,
)
