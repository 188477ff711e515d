"""The rules on what stands around the terms, each broken by a small edit; and what they must let through."""

from __future__ import annotations

from pathlib import Path

import pytest

from pidemu.checks import surroundings as stages
from tests.checks.bench import (
    ALPHA,
    ALPHA_EVIDENCE,
    CHOICE,
    DAHLIN,
    VALID,
    VELOCITY,
    WINDUP,
    Case,
    added,
    edited,
    faults,
    found_by,
    headlines,
)  # fmt: skip

NO_FILTER = ((", filter: {applies-to: term, ratio: ALPHA}", ""), (ALPHA, ""), (ALPHA_EVIDENCE, ""), (", Tf: 2}", "}"))
D_ON_ERROR = ("derivative: {on: pv", "derivative: {on: error")
NO_CHOICE = (CHOICE, "{}")
FACTOR = '  SHARE: {sets: filter-factor, unit: "1"}\n'
FIXED = ("action:\n  names", "action:\n  fixed: true\n  names")


CASES: tuple[Case, ...] = (
    (
        "reject_bad_signal_filters",
        added("measurement", "{filter: {}}"),
        ("9:15: a filter on a signal needs exactly one of time and factor",),
    ),
    (
        "reject_bad_signal_filters",
        added("setpoint", "{filter: {time: 2, factor: 0.5}}"),
        ("9:12: a filter on a signal needs exactly one of time and factor",),
    ),
    ("reject_bad_signal_filters", added("measurement", "{filter: {factor: 2}}"), ("9:32: factor is 2; it is above 0, up to 1",)),
    ("reject_bad_signal_filters", added("measurement", "{filter: {factor: 0}}"), ("9:32: factor is 0; it is above 0, up to 1",)),
    (
        "reject_bad_signal_filters",
        added("measurement", "{filter: {factor: 0.5, rule: trapezoidal}}"),
        ("9:43: a share of the new sample is the backward rule; leave 'rule' out",),
    ),
    (
        "reject_bad_signal_filters",
        (*added("measurement", "{filter: {factor: SHARE}}"), (ALPHA, ALPHA + FACTOR), ("RATE: 16}", "RATE: 16, SHARE: 1}")),
        ("19:3: 'SHARE' is a share of the new sample: give it a range above 0, up to 1",),
    ),
    (
        "reject_bad_setpoint",
        added("setpoint", "{starts: zero}"),
        ("9:20: 'starts: zero' belongs to a setpoint with a 'rate'",),
    ),
    (
        "reject_bad_setpoint",
        added("setpoint", "{rate-counts: local}"),
        ("9:1: 'rate-down' and 'rate-counts' belong to a setpoint with a 'rate'",),
    ),
    ("reject_bad_error", added("error", "{shape: gap}"), ("9:1: shape 'gap' needs 'band'",)),
    ("reject_bad_error", added("error", "{shape: gain-linear}"), ("9:1: shape 'gain-linear' needs 'linearity'",)),
    ("reject_bad_error", added("error", "{shape: squared, band: 2}"), ("9:1: 'band' has no meaning with shape 'squared'",)),
    ("reject_bad_error", added("error", "{linearity: 0.1}"), ("9:1: 'linearity' has no meaning with shape 'linear'",)),
    (
        "reject_bad_error",
        added("error", "{shape: squared, gain: 0.5, edge: outside}"),
        ("9:1: 'gain', 'subtracted', 'zero-crossing' and 'edge' belong to shape 'gap'",),
    ),
    (
        "reject_bad_error",
        added("error", "{shape: gap, band: 2, over: 50}"),
        ("9:1: 'over' belongs to the shapes 'squared' and 'gain-linear'",),
    ),
    (
        "reject_bad_error",
        (*added("error", "{filter: {time: 2}, on: integral}"), D_ON_ERROR, NO_CHOICE),
        ("9:1: 'on' says where a shape counts; it has no meaning with shape 'linear'",),
    ),
    (
        "reject_bad_error",
        added("error", "{shape: gain-linear, linearity: 1.5}"),
        ("9:40: linearity is 1.5; it is a share from 0 to 1",),
    ),
    (
        "reject_bad_error",
        added("error", "{shape: gap, band: 2, subtracted: true, zero-crossing: true}"),
        ("9:1: 'subtracted' and 'zero-crossing' do not go together: within the band the error would change its sign; remove one",),
    ),
    (
        "reject_bad_error",
        added("error", "{shape: squared, on: proportional}"),
        ("9:29: P acts on pv and has no error to shape; write 'on: integral'",),  # in the structure I-PD
    ),
    (
        "reject_bad_error",
        (*added("error", "{filter: {time: 2}}"), NO_CHOICE),
        ("9:1: a filter on the error needs P and D on the error, in cascade too",),
    ),
    (
        "reject_bad_error",
        (NO_CHOICE, D_ON_ERROR, *added("cascade", "{proportional: {on: pv}}"), *added("error", "{filter: {time: 2}}", line=8)),
        ("8:1: a filter on the error needs P and D on the error, in cascade too",),
    ),
    (
        "reject_bad_cascade",
        added("cascade", "{proportional: {on: none}}"),
        ("9:1: a proportional term that comes or goes with the mode is not defined",),
    ),
    (
        "reject_bad_cascade",
        (*added("cascade", "{proportional: {on: error}}"), (CHOICE, "{proportional: {on: pv, accumulated: true}}")),
        ("9:1: an accumulated proportional term is not defined with another structure in cascade",),
    ),
    (
        "reject_bad_integral",
        (("rule: backward", "rule: backward, starts: zero"),),
        ("10:47: 'starts: zero' belongs to the trapezoidal rule",),
    ),
    (
        "reject_bad_integral",
        (*VELOCITY, ("rule: backward", "rule: backward, limits: {high: 50}")),
        ("10:39: a velocity implementation has no integral to limit; remove 'limits'",),
    ),
    (
        "reject_bad_integral",
        (("rule: backward", "rule: backward, limits: {low: 50, high: 20}"),),
        ("10:39: limits 50 to 20 do not ascend",),
    ),
    ("reject_bad_integral", (("rule: backward", "rule: backward, limits: {high: -5}"),), ("10:39: limits 5 to -5 do not ascend",)),
    (
        "reject_bad_integral",
        (*VELOCITY, ("rule: backward", "rule: backward, holds: e")),
        ("10:46: 'holds: e' belongs to a positional implementation; remove it",),
    ),
    (
        "reject_bad_integral",
        ((WINDUP, "{scheme: clamp}"), ("rule: backward", "rule: backward, holds: e/Ti")),
        ("10:46: 'holds: e/Ti' does not go with windup 'clamp', which limits the term; use 'integral.limits'",),
    ),
    (
        "reject_bad_integral",
        ((CHOICE, "{form: parallel, integral: {holds: e/Ti}}"),),
        ("23:48: 'holds: e/Ti' needs one gain for all terms, which the parallel form does not have; remove it",),
    ),
    (
        "reject_bad_windup",
        ((WINDUP, "{scheme: velocity}"),),
        ("10:39: windup 'velocity' does not go with implementation 'positional'",),
    ),
    (
        "reject_bad_windup",
        (("implementation: positional", "implementation: velocity"),),
        ("10:39: windup 'back-calculation' does not go with implementation 'velocity'",),
    ),
    (
        "reject_bad_windup",
        ((WINDUP, "{scheme: external-reset}"), ("rule: backward", "rule: trapezoidal")),
        ("10:42: external-reset is defined for the backward and forward rules",),
    ),
    (
        "reject_accumulated_elsewhere",
        (("proportional: {on: error}", "proportional: {on: error, accumulated: true}"), (CHOICE, "{scan: {default: 2 s}}")),
        ("9:27: 'accumulated' belongs to a positional P on pv",),
    ),
    (
        "reject_bad_windup",
        ((WINDUP, "{scheme: clamp-sum}"), ("proportional: {on: error}", "proportional: {on: pv}")),
        ("10:39: clamp-sum with P on pv needs 'proportional.accumulated: true'",),
    ),
    (
        "reject_bad_windup",
        ((CHOICE, "{integral: {windup: {scheme: velocity}}}"),),
        ("23:25: windup 'velocity' does not go with implementation 'positional'",),
    ),
    (
        "reject_bad_windup",
        ((WINDUP, "{scheme: conditional, test: error-times-output}"),),
        ("10:39: 'test: error-times-output' stops the way back too and keeps nothing: write 'last-increment: dropped'",),
    ),
    (
        "reject_bad_windup",
        ((WINDUP, "{scheme: conditional, last-increment: dropped}"), ("rule: backward", "rule: forward")),
        ("10:38: 'last-increment' has no meaning under the forward rule, whose increment comes after the output",),
    ),
    (
        "reject_bad_windup",
        ((WINDUP, "{scheme: freeze, resumes-from: last-integrated}"),),
        ("10:39: 'resumes-from' belongs to the trapezoidal rule",),
    ),
    (
        "reject_bad_windup",
        ((WINDUP, "{scheme: freeze, judged-on: sum, direction: both}"), ("rule: backward", "rule: forward")),
        ("10:38: 'judged-on: sum' needs this scan's increment in the sum: a backward or trapezoidal rule",),
    ),
    (
        "reject_bad_windup",
        ((WINDUP, "{scheme: freeze, judged-on: sum}"),),
        ("10:39: 'judged-on: sum' forgets the increment whichever way it goes: write 'direction: both'",),
    ),
    (
        "reject_bad_windup",
        (
            (WINDUP, "{scheme: freeze, judged-on: sum, direction: both, resumes-from: last-integrated}"),
            ("rule: backward", "rule: trapezoidal"),
        ),
        ("10:42: 'resumes-from' has no meaning with 'judged-on: sum'",),
    ),
    (
        "reject_bad_windup",
        ((WINDUP, "{scheme: back-calculation, tracking-time: Ti, times: Ti}"),),
        ("10:39: 'times' and 'when-off' go with a number or a setting under 'tracking-time'",),
    ),
    (
        "reject_bad_windup",
        ((WINDUP, "{scheme: back-calculation, tracking-time: 4, when-off: Ti}"),),
        ("10:39: 'when-off' goes with a setting under 'tracking-time'",),
    ),
    (
        "reject_bad_windup",
        (
            (WINDUP, "{scheme: back-calculation, tracking-time: NI}"),
            (ALPHA, ALPHA + '  NI: {sets: tracking-time, unit: "1"}\n'),
            ("RATE: 16}", "RATE: 16, NI: 1}"),
        ),
        ("10:39: 'NI' is a plain ratio; say of what: 'times: Ti'",),
    ),
    (
        "reject_bad_windup",
        (
            (WINDUP, "{scheme: back-calculation, tracking-time: TT, times: Ti}"),
            (ALPHA, ALPHA + "  TT: {sets: tracking-time, unit: min}\n"),
            ("RATE: 16}", "RATE: 16, TT: 1}"),
        ),
        ("10:39: 'TT' is a time already; remove 'times'",),
    ),
    (
        "reject_bad_windup",
        ((WINDUP, "{scheme: reset-outside-band}"), (CHOICE, "{proportional: {on: none}}")),
        ("10:39: reset-outside-band needs a proportional term, whose band it is",),
    ),
    (
        "reject_bad_transfer",
        (*VELOCITY, ("transfer: {start: bumpless}", "transfer: {start: bumpless, power-up: zero}")),
        ("12:1: a velocity implementation goes on from the last output: 'start: bumpless', without 'power-up' and 'first-output'",),
    ),
    (
        "reject_bad_transfer",
        (("transfer: {start: bumpless}", "transfer: {start: bumpless, first-scan: holds}"),),
        ("12:1: 'first-scan' has no meaning with start 'bumpless'",),
    ),
    (
        "reject_bad_transfer",
        (("transfer: {start: bumpless}", "transfer: {start: keep, loaded: as-it-is}"),),
        ("12:1: 'loaded' belongs to start 'load-output'",),
    ),
    (
        "reject_bad_transfer",
        (
            ("transfer: {start: bumpless}", "transfer: {start: bumpless, changes: bumpless}"),
            ("rule: backward", "rule: backward, holds: e"),
        ),
        ("12:1: 'changes: bumpless' needs an integral that holds 'ki e'",),
    ),
    (
        "reject_bad_transfer",
        (("transfer: {start: bumpless}", "transfer: {start: bumpless, manual-output: gain-times-operator}"),),
        ("12:44: 'gain-times-operator' needs 'action.fixed: true': the sign of the gain would depend on the action",),
    ),
    (
        "reject_bad_feedforward",
        (*VELOCITY, *added("feedforward", "{summed: after-limits}")),
        ("9:23: a velocity implementation adds increments before the limits; write 'summed: before-limits'",),
    ),
    (
        "reject_bad_faults",
        added("faults", "{zero-interval: compute}"),
        ("9:1: 'zero-interval' and 'negative-interval' belong to 'scan.interval: measured'",),
    ),
    (
        "reject_bad_faults",
        (*added("faults", "{zero-interval: compute}"), ("scan: {default: 1 s}", "scan: {default: 1 s, interval: measured}")),
        ("9:25: 'zero-interval: compute' is defined for the lagged-difference rule: every other divides by the interval",),
    ),
    (
        "reject_bad_arithmetic",
        added("arithmetic", "{type: float32, counts: 100}"),
        ("9:1: 'counts' and 'gain-counts' belong to type 'integer'",),
    ),
    (
        "reject_bad_arithmetic",
        added("arithmetic", "{type: float64, literals: float64}"),
        ("9:1: 'literals' belongs to type 'float32'",),
    ),
    (
        "reject_bad_arithmetic",
        (*VELOCITY, *added("arithmetic", "{type: integer, counts: 100}"), NO_CHOICE),
        ("9:1: type 'integer' needs 'counts' and 'gain-counts'",),
    ),
    (
        "reject_bad_arithmetic",
        (*added("arithmetic", "{type: integer, counts: 100, gain-counts: 100}"), NO_CHOICE),
        ("9:1: type 'integer' is defined for velocity, standard form, backward rules, P on error, D on pv, a filter on the term",),
    ),
    (
        "reject_bad_arithmetic",
        (
            *VELOCITY,
            *added("arithmetic", "{type: integer, counts: 100, gain-counts: 100}"),
            NO_CHOICE,
            ("output: {limits: [0, 100]}", "output: {limits: [0, 100], rate: 5}"),
            ("rule: backward", "rule: backward, deadband: 1"),
        ),
        (
            "9:1: type 'integer' goes with no 'integral.deadband'; remove it",
            "9:1: type 'integer' goes with no 'output.rate'; remove it",
        ),
    ),
    (
        "reject_bad_pole_cancellation",
        (*DAHLIN, ("implementation: velocity", "implementation: positional"), ("{scheme: velocity}", "{scheme: none}")),
        ("7:7: form 'dahlin' is a velocity implementation of an integral on the error, without P and D: 'on: none'",),
    ),
    (
        "reject_bad_pole_cancellation",
        (*added("feedforward", "{summed: before-limits}"), *DAHLIN),
        ("7:7: form 'dahlin' goes with no 'feedforward'; remove it",),
    ),
    (
        "reject_bad_derivative_rule",
        (*NO_FILTER, ("derivative: {on: pv", "derivative: {on: pv, rule: lagged-difference")),
        ("11:28: the lagged-difference rule needs a filter on the term",),
    ),
    (
        "reject_bad_derivative_rule",
        (("derivative: {on: pv", "derivative: {on: pv, rule: four-point"),),
        ("11:28: the four-point rule goes with no other filter on the term",),
    ),
    (
        "reject_bad_derivative_rule",
        (("derivative: {on: pv", "derivative: {on: pv, rule: exact"), ("applies-to: term", "applies-to: measurement")),
        ("11:28: the filter needs a rule of its own: 'exact' is one of the derivative only",),
    ),
)


def test_every_rule_is_broken_by_some_card() -> None:
    assert {rule.__name__ for rule in stages.RULES} == {name for name, _, _ in CASES}


@pytest.mark.parametrize(("rule", "edits", "expected"), [pytest.param(*case, id=f"{case[0]}-{i}") for i, case in enumerate(CASES)])
def test_a_card_that_breaks_a_rule_is_refused_at_its_place(
    rule: str, edits: tuple[tuple[str, str], ...], expected: tuple[str, ...], tmp_path: Path
) -> None:
    text = edited(VALID, *edits)
    assert list(expected) == headlines(faults(tmp_path, text))
    assert found_by(stages.RULES, rule, tmp_path, text) == set(expected)


SENSIBLE = {
    "a filter that is a share": (
        *added("measurement", "{filter: {factor: SHARE}}"),
        (ALPHA, ALPHA + '  SHARE: {sets: filter-factor, unit: "1", range: [0.1, 1], default: 1}\n'),
    ),
    "a filter that is a share in percent": (
        *added("measurement", "{filter: {factor: SHARE}}"),
        (ALPHA, ALPHA + '  SHARE: {sets: filter-factor, unit: "%", range: [10, 100], default: 100}\n'),
        (ALPHA_EVIDENCE, ALPHA_EVIDENCE + "  settings.SHARE: {status: assumed, note: so}\n"),
    ),
    "a deadband that is continuous": added("error", "{shape: gap, band: 2, subtracted: true}"),
    "a gap in a structure that goes with the mode": (
        *added("cascade", "{proportional: {on: pv}}"),
        *added("error", "{shape: gap, band: 2, gain: 0.5}", line=8),
    ),
    "a setpoint that is limited from zero": added("setpoint", "{rate: 2, starts: zero}"),
    "an integral of the error": (("rule: backward", "rule: backward, holds: e, limits: {low: -900, high: 900}"),),
    "limits of the integral that are the output's": (("rule: backward", "rule: backward, limits: {low: output, high: output}"),),
    "a half of the first error": (("rule: backward", "rule: trapezoidal, starts: zero"),),
    "a freeze that forgets": ((WINDUP, "{scheme: freeze, judged-on: sum, direction: both}"),),
    "a tracking time as a share of Ti": (
        (WINDUP, "{scheme: back-calculation, tracking-time: NI, times: Ti}"),
        (ALPHA, ALPHA + '  NI: {sets: tracking-time, unit: "1"}\n'),
        ("RATE: 16}", "RATE: 16, NI: 1}"),
    ),
    "a tracking time of half of Ti": ((WINDUP, "{scheme: back-calculation, tracking-time: 0.5, times: Ti}"),),
    "an integral cleared outside the band": ((WINDUP, "{scheme: reset-outside-band}"),),
    "feedforward on the limited output": added("feedforward", "{summed: after-limits, gain: 0.5}"),
    "feedforward of a velocity implementation": (*VELOCITY, *added("feedforward", "{summed: before-limits}")),
    "measured intervals": (
        *added("faults", "{negative-interval: refuse}"),
        ("scan: {default: 1 s}", "scan: {default: 1 s, interval: measured}"),
    ),
    "whole numbers": (*VELOCITY, *added("arithmetic", "{type: integer, counts: 100, gain-counts: 100}"), NO_CHOICE),
    "pole cancellation": DAHLIN,
    "a manual output times the gain": (
        ("transfer: {start: bumpless}", "transfer: {start: bumpless, manual-output: gain-times-operator}"),
        FIXED,
    ),
    "an exact rule": (("derivative: {on: pv", "derivative: {on: pv, rule: exact"),),
}


@pytest.mark.parametrize("name", SENSIBLE)
def test_a_sensible_card_is_let_through(name: str, tmp_path: Path) -> None:
    assert headlines(faults(tmp_path, edited(VALID, *SENSIBLE[name]))) == []
