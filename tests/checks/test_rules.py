"""Every rule over cards, broken by one small edit: what the contributor reads, and that no rule goes untested."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

from pidemu.checks import equations, runs, statements
from pidemu.checks import surroundings as stages
from pidemu.errors import CardError, Problem
from tests.checks.bench import (
    ALPHA,
    ALPHA_EVIDENCE,
    CHOICE,
    DAHLIN,
    GAIN,
    VALID,
    WINDUP,
    Case,
    Edit,
    added,
    edited,
    faults,
    found_by,
    headlines,
    loaded,
)  # fmt: skip

_UNITS = "1, %/%, %, eu, eu/eu, %/eu, Hz, " + ", ".join(
    f"{time}, {time}/repeat, repeat/{time}, 1/{time}, %/{time}, eu/{time}" for time in ("ms", "s", "min", "h")
)
_UNITS += "; also scan in place of a time, and degC, K, degF in place of eu"
_ZERO_GAIN = "nobody/bench: ALPHA is 0: a derivative gain of zero means no derivative; set the derivative to zero"
_FILTER_GAIN: tuple[Edit, ...] = (
    ("ratio: ALPHA", "gain: ALPHA"),
    (ALPHA, '  ALPHA: {sets: filter-gain, unit: "1", default: 0}\n'),
    ("off: 0, default: 0}\n  ALPHA", "off: 0}\n  ALPHA"),
    ("RATE: 16}", "RATE: 16, ALPHA: 8}"),
)
_ENGINEERING = added("signals", "engineering")
_EU = ('unit: "%/%"', "unit: eu/eu")
_NO_ALPHA: tuple[Edit, ...] = ((ALPHA, ""), (ALPHA_EVIDENCE, ""))

_RECORDS = "records: [{file: bench.csv, given: {GAIN: 2, RESET: 60}, scan: 1 s}]"
_NO_RECORDS = (
    "needs 'records': recorded outputs beside the card, which the check runs it against; without them leave 'verification' out, "
    "which is V3"
)


def _verified(text: str) -> tuple[Edit, ...]:
    """Return edits that have the card say how it was verified."""
    return (("quirks:\n", f"verification: {{{text}}}\nquirks:\n"),)


STATEMENTS: tuple[Case, ...] = (
    ("reject_unused_settings", (("ratio: ALPHA", "ratio: 0.1"),), ("17:3: nothing uses 'ALPHA'",)),
    (
        "reject_unused_settings",
        (
            ("derivative: {on: pv, filter: {applies-to: term, ratio: ALPHA}}", "derivative: {on: none}"),
            *_NO_ALPHA,
            ("kd: 32, Tf: 2}", "kd: 0}"),
        ),
        ("16:3: nothing uses 'RATE'",),
    ),
    (
        "reject_wrong_folder",
        (("vendor: Nobody", "vendor: Some Body & Co."),),
        ("2:9: vendor 'Some Body & Co.' belongs in folder 'some-body-co', the card is in 'nobody'",),
    ),
    (
        "reject_dangling_sources",
        (("source: manual, at: trace 1", "source: manul, at: trace 1"),),
        ("31:46: no source 'manul' (did you mean 'manual'?); list it under sources",),
    ),
    (
        "reject_dangling_sources",
        (("hums., source: manual", "hums., source: folklore"),),
        ("43:37: no source 'folklore'; list it under sources",),
    ),
    (
        "reject_unused_sources",
        (("2026-01-02}", "2026-01-02}\n  web: {title: A page, read: 2026-01-02}"),),
        ("7:3: source 'web' is not used by any evidence, quirk or example",),
    ),
    ("reject_incomplete_evidence", (("source: manual, at: trace 1", "at: trace 1"),), ("31:3: 'measured' needs 'source'",)),
    ("reject_incomplete_evidence", ((", at: trace 1", ""),), ("31:3: 'measured' needs 'at'",)),
    ("reject_incomplete_evidence", ((", note: from the step response", ""),), ("33:3: 'inferred' needs 'note'",)),
    (
        "reject_incomplete_evidence",
        (("derivative: {status: assumed, note: not stated}", "derivative: {status: assumed}"),),
        ("34:3: 'assumed' needs 'note'",),
    ),
    (
        "reject_proof_from_another_product",
        (
            ("read: 2026-01-02}", "read: 2026-01-02}\n  toy: {title: Toy bench, read: 2026-01-02, product: another bench}"),
            ("form: {status: documented, source: manual,", "form: {status: documented, source: toy,"),
            ("implementation: {status: measured, source: manual,", "implementation: {status: measured, source: toy,"),
        ),
        (
            "31:18: 'toy' is about another bench, which does not make this documented; write 'inferred' and why",
            "32:28: 'toy' is about another bench, which does not make this measured; write 'inferred' and why",
        ),
    ),
    (
        "reject_evidence_for_nothing",
        (("quirks:\n", "  options.FORM: {status: assumed, note: a guess}\nquirks:\n"),),
        ("42:3: nothing at 'options.FORM' in this card (did you mean 'options'?)",),
    ),
    (
        "reject_evidence_for_nothing",
        (("  transfer: {status", "  transfr: {status"),),
        (
            "12:12: no evidence covers 'transfer.start'; add it under evidence, if only as assumed",
            "35:3: nothing at 'transfr' in this card (did you mean 'transfer'?)",
        ),
    ),
    (
        "reject_fields_without_evidence",
        (("  scan: {status: assumed, note: not stated}\n", ""),),
        ("27:8: no evidence covers 'scan.default'; add it under evidence, if only as assumed",),
    ),
    (
        "reject_fields_without_evidence",
        (("  options: {status", "  options.STRUCTURE.default: {status"),),
        ("23:29: no evidence covers 'options.STRUCTURE.choices.I-PD.proportional.on'; add it under evidence, if only as assumed",),
    ),
    (
        "reject_fields_without_evidence",
        (("  options: {status", "  options.STRUCTURE.choices: {status"),),
        ("20:5: no evidence covers 'options.STRUCTURE.default'",),
    ),
    (
        "reject_evidence_for_nothing",
        (("quirks:\n", "  emulation: {status: assumed, note: a guess}\nquirks:\n"),),
        ("42:3: how the scan program was verified stands under 'verification', not under evidence",),
    ),
    ("reject_unfounded_verification", _verified("class: V3"), ("42:1: 'V3' needs 'note': why there is nothing better",)),
    (
        "reject_unfounded_verification",
        _verified("class: V3, note: none was found, test: tests/real/test_king.py"),
        ("42:49: 'V3' is by the law alone; with 'test' it is V1 or V2",),
    ),
    ("reject_unfounded_verification", _verified("class: V1, source: manual, at: p. 9"), (f"42:1: 'V1' {_NO_RECORDS}",)),
    (
        "reject_unfounded_verification",
        _verified("class: V2, source: manual, at: p. 9, test: tests/real/test_king.py"),
        (f"42:1: 'V2' {_NO_RECORDS}",),
    ),
    (
        "reject_unfounded_verification",
        _verified(f"class: V1, {_RECORDS}"),
        ("42:1: 'V1' needs 'at'", "42:1: 'V1' needs 'source'"),
    ),
    (
        "reject_unfounded_verification",
        _verified(f"class: V1, source: manual, at: p. 9, package: simple-pid 2.0.1, {_RECORDS}"),
        ("42:53: 'package' is for cards that come with pidemu; remove it",),
    ),
    (
        "reject_unfounded_verification",
        (
            ("read: 2026-01-02}", "read: 2026-01-02}\n  toy: {title: Toy bench, read: 2026-01-02, product: another bench}"),
            *_verified(f"class: V2, source: toy, at: p. 9, {_RECORDS}"),
        ),
        ("43:35: 'toy' is about another bench, which verifies nothing of this card; write V3 and why",),
    ),
    (
        "reject_overlapping_options",
        (("action:\n  names", "  OTHER:\n    default: A\n    choices: {A: {}, B: {proportional: {on: none}}}\naction:\n  names"),),
        ("24:3: 'proportional.on' is changed by option STRUCTURE as well; let one option do it",),
    ),
    (
        "reject_ambiguous_names",
        (("action:\n  names", "  pv_range:\n    default: A\n    choices: {A: {}}\naction:\n  names"),),
        ("24:3: 'pv_range' is reserved for the signal range",),
    ),
    ("reject_ambiguous_names", (("  STRUCTURE:\n", "  Gain:\n"),), ("19:3: 'Gain' and 'GAIN' cannot be told apart",)),
    (
        "reject_ambiguous_names",
        ((ALPHA, '  gain: {sets: multiplier, unit: "1", default: 1}\n' + ALPHA),),
        ("17:3: 'gain' and 'GAIN' cannot be told apart",),
    ),
)

EQUATIONS: tuple[Case, ...] = (
    (
        "reject_bad_units",
        (("integral, unit: s", "integral, unit: fortnight"),),
        (f"15:33: unknown unit 'fortnight'; known units: {_UNITS}",),
    ),
    (
        "reject_bad_units",
        (("derivative, unit: s", "derivative, unit: 1/s"),),
        ("16:34: '1/s' is a rate (1/time) and cannot set derivative; use one of: s, min",),
    ),
    ("reject_bad_units", (("integral, unit: s", "integral, unit: seconds"),), ("15:33: write the unit 's'",)),
    (
        "reject_bad_units",
        (
            ("form: standard", "signals: engineering\nform: standard"),
            ("  form: {status", "  signals: {status: assumed, note: so\n    }\n  form: {status"),
        ),
        ("15:28: with 'signals: engineering' the gain's unit is 'eu/eu', '%/eu', or for a proportional band 'eu'",),
    ),
    (
        "reject_bad_units",
        (*_ENGINEERING, ('unit: "%/%"', "unit: eu"), ("limits: [0, 100]", "limits: [0, inf]")),
        ("15:28: 'eu' refers to the output's range, and 'output.limits' is infinite; give limits, or a gain in 'eu/eu'",),
    ),
    (
        "reject_bad_units",
        (*_ENGINEERING, ("form: standard", "form: parallel"), ('unit: "%/%"', "unit: '%/degC'")),
        ("15:28: with 'signals: engineering' the gain of a parallel form is in 'eu/eu', as its integral and derivative gains are",),
    ),
    (
        "reject_bad_units",
        (*_ENGINEERING, _EU, (ALPHA, "  ZERO: {sets: bias, unit: '%', default: 0}\n" + ALPHA)),
        ("18:28: with 'signals: engineering' the bias is in 'eu'",),
    ),
    (
        "reject_bad_units",
        (
            *added("setpoint", "{rate: RAMP}"),
            *_ENGINEERING,
            _EU,
            (ALPHA, "  RAMP: {sets: setpoint-rate, unit: '%/scan', default: inf}\n" + ALPHA),
        ),
        ("19:37: with 'signals: engineering' the setpoint rate is in 'eu/scan'",),
    ),
    (
        "reject_mixed_degrees",
        (
            *added("setpoint", "{rate: RAMP}"),
            *_ENGINEERING,
            ('unit: "%/%"', "unit: degC"),
            (ALPHA, "  RAMP: {sets: setpoint-rate, unit: degF/min, default: inf}\n" + ALPHA),
        ),
        ("19:37: 'degF/min', but 'GAIN' is in 'degC'; the signals are in one of them",),
    ),
    (
        "reject_bad_units",
        ((CHOICE, "{settings: {RESET: {unit: repeat}}}"),),
        (f"23:39: unknown unit 'repeat' (did you mean 's/repeat'?); known units: {_UNITS}",),
    ),
    ("reject_bad_numbers", (("[0.05, 1]", "[1, 0.05]"),), ("17:49: range 1 to 0.05 does not ascend",)),
    ("reject_bad_numbers", (("default: 0.125", "default: 2"),), ("17:69: default 2 is outside 0.05 to 1 and is not an off value",)),
    (
        "reject_bad_numbers",
        (("off: 0, default: 0}", "off: 0, default: inf}"),),
        (
            "16:54: default inf needs evidence of its own, at 'settings.RATE.default' or 'settings.RATE'",
            "16:54: default is infinite, which does not go with the derivative; give a number",
        ),
    ),
    ("reject_bad_numbers", (("[0, 100]", "[100, 0]"),), ("28:18: output limits 100 to 0 do not ascend",)),
    (
        "reject_bad_numbers",
        ((CHOICE, "{settings: {ALPHA: {range: [0.2, 1]}}}"),),
        ("23:32: default 0.125 is outside 0.2 to 1 and is not an off value",),
    ),
    ("reject_bad_numbers", ((CHOICE, "{output: {limits: [5, 1]}}"),), ("23:31: output limits 5 to 1 do not ascend",)),
    (
        "reject_unexplained_defaults",
        ((ALPHA_EVIDENCE, ""),),
        ("17:69: default 0.125 needs evidence of its own, at 'settings.ALPHA.default' or 'settings.ALPHA'",),
    ),
    (
        "reject_unexplained_defaults",
        ((CHOICE, "{settings: {RATE: {default: 5}}}"),),
        (
            "23:41: default 5 needs evidence of its own, at 'options.STRUCTURE.choices.I-PD.settings.RATE.default' "
            "or 'options.STRUCTURE.choices.I-PD.settings.RATE'",
        ),
    ),
    ("reject_bad_scan", (("default: 1 s", "default: 0 s"),), ("27:17: '0 s' is not a time; write it like '1 s'",)),
    ("reject_bad_scan", (("default: 1 s", 'default: "1"'),), ("27:17: '1' is not a time; write it like '1 s'",)),
    ("reject_bad_scan", (("default: 1 s", "default: 1 scan"),), ("27:17: '1 scan' is not a time; write it like '1 s'",)),
    ("reject_bad_scan", (("default: 1 s", "default: 1 %"),), ("27:17: '1 %' is not a time; write it like '1 s'",)),
    (
        "reject_bad_scan",
        (("default: 1 s", "default: fast"),),
        ("27:17: 'fast' is not a number, nor a number with a unit such as \"20 s/repeat\"",),
    ),
    ("reject_missing_dials", ((GAIN, ""),), ("13:1: no setting sets the gain",)),
    (
        "reject_missing_dials",
        ((GAIN, GAIN + '  PB: {sets: gain, unit: "%"}\n'),),
        ("15:3: 'GAIN' and 'PB' both set the gain",),
    ),
    (
        "reject_missing_dials",
        ((CHOICE, "{settings: {PB: {sets: gain, unit: '%'}}}"),),
        ("23:25: 'GAIN' and 'PB' both set the gain",),
    ),
    ("reject_missing_dials", ((CHOICE, "{settings: {RESET: null}}"),), ("23:14: no setting sets the integral",)),
    (
        "reject_missing_dials",
        (("GAIN: {sets: gain,", "GAIN: {sets: process-gain,"),),
        (
            "13:1: no setting sets the gain",
            "14:3: 'GAIN' sets the process-gain, which form 'standard' does not have; remove it",
        ),
    ),
    (
        "reject_missing_dials",
        (*DAHLIN, ("  LAMBDA: {sets: closed-loop-time,", "  LAMBDA: {sets: integral,")),
        (
            "13:1: no setting sets the closed-loop-time",
            "16:3: 'LAMBDA' sets the integral, which form 'dahlin' does not have; remove it",
        ),
    ),
    (
        "reject_missing_dials",
        ((ALPHA, ALPHA + '  K: {sets: multiplier, unit: "1", default: 1}\n  K2: {sets: multiplier, unit: "1", default: 1}\n'),),
        ("19:3: 'K' and 'K2' both set the multiplier",),
    ),
    ("reject_bad_constants", added("setpoint", "{filter: {time: -3}}"), ("9:27: time is -3; it is a number from 0 up",)),
    (
        "reject_bad_constants",
        added("setpoint", "{rate: 0}"),
        ("9:18: rate is 0: nothing would ever move; give a number above 0",),
    ),
    (
        "reject_bad_constants",
        added("error", "{shape: gap, band: -1, gain: -0.5}"),
        ("9:27: band is -1; it is a number from 0 up", "9:37: gain is -0.5; it is a number from 0 up"),
    ),
    (
        "reject_bad_weights",
        added("cascade", "{proportional: {on: weighted}}"),
        ("9:26: 'on: weighted' needs 'weight'",),
    ),
    (
        "reject_bad_weights",
        (("proportional: {on: error}", "proportional: {on: weighted}"),),
        ("9:16: 'on: weighted' needs 'weight'",),
    ),
    (
        "reject_bad_weights",
        (("derivative: {on: pv", "derivative: {on: pv, weight: 0.5"),),
        ("11:14: 'weight' has no meaning with 'on: pv'",),
    ),
    ("reject_bad_weights", ((CHOICE, "{proportional: {on: weighted}}"),), ("23:29: 'on: weighted' needs 'weight'",)),
    (
        "reject_bad_filter",
        (("ratio: ALPHA", "ratio: ALPHA, time: 2"),),
        ("11:22: a filter needs exactly one of ratio, gain and time",),
    ),
    (
        "reject_bad_filter",
        (("term, ratio: ALPHA", "term"), *_NO_ALPHA),
        ("11:22: a filter needs exactly one of ratio, gain and time",),
    ),
    (
        "reject_bad_filter",
        (("applies-to: term", "applies-to: lead-lag"),),
        ("11:22: a lead-lag belongs to the series form, this is 'standard'",),
    ),
    (
        "reject_bad_filter",
        (("applies-to: term", "applies-to: term, order: 2"),),
        ("11:22: a filter of order 2 is defined for the measurement only",),
    ),
    (
        "reject_bad_filter",
        (("ratio: ALPHA", "time: 2, of: effective-derivative"), *_NO_ALPHA),
        ("11:22: 'of' refers to ratio or gain, not to time",),
    ),
    (
        "reject_bad_filter",
        ((CHOICE, "{derivative: {filter: {applies-to: lead-lag, ratio: 0.1}}}"),),
        ("23:27: a lead-lag belongs to the series form, this is 'standard'",),
    ),
    (
        "reject_bad_filter",
        (("applies-to: term", "applies-to: term, rule: trapezoidal"),),
        ("11:55: 'rule' here is that of a filter on measurement or output; the term's is 'derivative.rule'",),
    ),
    (
        "reject_bad_filter",
        (
            ("ratio: ALPHA", "ratio: ALPHA, of: effective-derivative"),
            ("form: standard", "form: parallel"),
        ),
        ("11:67: 'effective-derivative' is of a series or standard form; of a parallel one, kd/kp is 'derivative-time'",),
    ),
    (
        "reject_bad_filter",
        (
            ("ratio: ALPHA", "ratio: ALPHA, of: derivative-time"),
            ("form: standard", "form: parallel"),
            (CHOICE, "{proportional: {on: none}}"),
        ),
        ("11:67: 'derivative-time' is kd/kp, and this card has no proportional term",),
    ),
    (
        "reject_wrong_action",
        (("direct: Direct", "direct: Auto"), ("reverse: Reverse", "reverse: Auto"), ("name: Reverse", "name: Auto")),
        ("25:3: reverse and direct have the same name 'Auto'",),
    ),
    (
        "reject_wrong_action",
        (("name: Reverse", "name: Backward"),),
        ("26:3: 'Backward' is not one of the names: Reverse, Direct",),
    ),
    ("reject_wrong_action", (("sp: 50, pv: 51", "sp: 50, pv: 50"),), ("26:3: setpoint and measurement must differ",)),
    (
        "reject_wrong_action",
        (("output: falls", "output: rises"),),
        ("26:3: with reverse action the output falls, the example says it rises",),
    ),
    (
        "reject_wrong_action",
        ((CHOICE, "{action: {example: {name: Direct}}}"),),
        ("23:23: with direct action the output rises, the example says it falls",),
    ),
)

RUNS: tuple[Case, ...] = (
    (
        "reject_windup_that_stops_short",
        ((WINDUP, "{scheme: conditional, last-increment: dropped}"),),
        (
            "10:39: under a constant error the output stays at 99.79 % and never reaches its limit; only what is documented or "
            "measured may do that",
        ),
    ),
    ("reject_wrong_examples", (("{kp: 2,", "{kp: 3,"),), ("46:21: kp is 3, the settings amount to 2",)),
    ("reject_wrong_examples", ((", Tf: 2}", "}"),), ("46:16: Tf is 0, the settings amount to 2",)),
    (
        "reject_wrong_examples",
        (("RESET: 60,", "RESET: 1,"),),
        ("46:28: ki is 0.0333333, the settings amount to 2",),
    ),
    (
        "reject_wrong_examples",
        (("{GAIN: 2,", "{GIAN: 2,"),),
        ("45:5: nobody/bench: unknown setting 'GIAN' (did you mean 'GAIN'?); settings: GAIN, RESET, RATE, ALPHA, STRUCTURE",),
    ),
    (
        "reject_wrong_examples",
        (("{GAIN: 2,", "{STRUCTURE: PI-D, GAIN: 2,"),),
        ("45:5: nobody/bench: option STRUCTURE has no choice 'PI-D' (did you mean 'PID'?); choices: PID, I-PD",),
    ),
    (
        "reject_wrong_examples",
        (("{GAIN: 2, RESET: 60, RATE: 16}", "{}"),),
        (
            "45:5: nobody/bench: GAIN: missing; it sets the gain, in %/%",
            "45:5: nobody/bench: RESET: missing; it sets the integral, in s",
        ),
    ),
    (
        "reject_wrong_examples",
        (("applies-to: term", "applies-to: measurement, order: 2"),),
        ("45:5: two filters, or one of second order, have no parallel gains; choose settings without, or state 'outputs'",),
    ),
    (
        "reject_wrong_examples",
        (("    canonical: {kp: 2, ki: 0.0333333, kd: 32, Tf: 2}\n", ""),),
        ("45:5: an example needs 'canonical' or 'outputs', or both",),
    ),
    (
        "reject_wrong_examples",
        (("    canonical: {kp: 2, ki: 0.0333333, kd: 32, Tf: 2}\n", "    outputs: []\n"),),
        ("45:5: an example needs 'canonical' or 'outputs', or both",),
    ),
    (
        "reject_wrong_examples",
        (("    canonical: {kp: 2,", "    outputs: [2.033333, 2.07, 2.1]\n    canonical: {kp: 2,"),),
        ("46:25: output 2 is 2.07, the settings amount to 2.06667",),
    ),
    (
        "reject_wrong_examples",
        (*added("measurement", "{filter: {time: 3}}"),),
        ("47:5: two filters, or one of second order, have no parallel gains; choose settings without, or state 'outputs'",),
    ),
    (
        "reject_wrong_examples",
        (*DAHLIN, ("    outputs: [0.5, 0.547581]\n", "    canonical: {kp: 0.5, ki: 0.05, kd: 0}\n")),
        (
            "44:5: pole cancellation for a dead time of 0 s is a recursion in scans and has no continuous law; "
            "state 'outputs' instead",
        ),
    ),
    (
        "reject_unrunnable",
        _FILTER_GAIN,
        (f"19:3: with STRUCTURE=I-PD: {_ZERO_GAIN}", f"19:3: with STRUCTURE=PID: {_ZERO_GAIN}"),
    ),
)

REFERENCES: tuple[tuple[tuple[Edit, ...], tuple[str, ...]], ...] = (
    (
        (("ratio: ALPHA", "ratio: ALFA"),),
        ("11:56: no setting 'ALFA' (did you mean 'ALPHA'?)",),
    ),
    (
        (("ratio: ALPHA", "ratio: RATE"),),
        ("11:56: 'RATE' sets the derivative; here one that sets the filter-ratio is needed",),
    ),
    (
        ((WINDUP, "{scheme: back-calculation, tracking-time: TT}"),),
        ("10:89: no setting 'TT'",),
    ),
    (
        ((CHOICE, "{proportional: {on: weighted, weight: BETA}}"),),
        ("23:51: no setting 'BETA'",),
    ),
    (
        ((WINDUP, "{scheme: none}, limits: {high: IMAX}"), (ALPHA, ALPHA + "  IMAX: {sets: deadband, unit: '%'}\n")),
        ("10:78: 'IMAX' sets the deadband; here one that sets the integral-limit is needed",),
    ),
    (
        added("measurement", "{filter: {time: TPV}}"),
        ("9:30: no setting 'TPV'",),
    ),
    (
        (("output: {limits: [0, 100]}", "output: {limits: [0, 100], rate: OUT_RATE, deadband: GAIN, resolution: STEP}"),),
        (
            "28:34: no setting 'OUT_RATE' (did you mean 'RATE'?)",
            "28:54: 'GAIN' sets the gain; here one that sets the deadband is needed",
            "28:72: no setting 'STEP'",
        ),
    ),
    (
        added("feedforward", "{summed: before-limits, gain: KFF}"),
        ("9:44: no setting 'KFF'",),
    ),
    (
        added("cascade", "{proportional: {on: weighted, weight: BETA}}"),
        ("9:48: no setting 'BETA'",),
    ),
)
"""Names of settings that are not there, or set something else: such a card is not loaded."""

_ROOMS: dict[str, tuple[Iterable[Callable[..., Iterable[Problem]]], tuple[Case, ...]]] = {
    "statements": (statements.RULES, STATEMENTS),
    "equations": ([rule for rule in equations.RULES if rule not in stages.RULES], EQUATIONS),
    "runs": (runs.RULES, RUNS),
}


def _named(case: Case, number: int, room: str) -> Any:
    return pytest.param(room, *case, id=f"{case[0]}-{number}")


@pytest.mark.parametrize("room", _ROOMS)
def test_every_rule_is_broken_by_some_card(room: str) -> None:
    rules, cases = _ROOMS[room]
    assert {rule.__name__ for rule in rules} == {name for name, _, _ in cases}


@pytest.mark.parametrize(
    ("room", "rule", "edits", "expected"),
    [_named(case, i, room) for room, (_, cases) in _ROOMS.items() for i, case in enumerate(cases)],
)
def test_a_card_that_breaks_a_rule_is_refused_at_its_place(
    room: str, rule: str, edits: tuple[Edit, ...], expected: tuple[str, ...], tmp_path: Path
) -> None:
    text = edited(VALID, *edits)
    assert list(expected) == headlines(faults(tmp_path, text))
    assert set() < _found_by(room, rule, tmp_path, text) <= set(expected)


def _found_by(room: str, name: str, folder: Path, text: str) -> set[str]:
    if room == "equations":
        return found_by(_ROOMS[room][0], name, folder, text)
    [rule] = [r for r in _ROOMS[room][0] if r.__name__ == name]
    return set(headlines(list(rule(loaded(folder, text)))))


def test_faults_of_two_rules_come_in_the_order_of_the_file(tmp_path: Path) -> None:
    text = edited(VALID, ("output: falls", "output: rises"), ("ratio: ALPHA", "ratio: 0.1"), ("[0, 100]", "[1, 0]"))
    assert [h.split(": ")[0] for h in headlines(faults(tmp_path, text))] == ["17:3", "26:3", "28:18"]


def test_two_choices_that_break_a_rule_together_are_refused(tmp_path: Path) -> None:
    other = "  EQN:\n    default: A\n    choices: {A: {}, B: {proportional: {on: pv, accumulated: true}}}\naction:\n  names"
    velocity = "{implementation: velocity, integral: {windup: {scheme: velocity}}}"
    text = edited(VALID, ("action:\n  names", other), (CHOICE, velocity))
    assert headlines(faults(tmp_path, text)) == ["26:49: 'accumulated' belongs to a positional P on pv"]


def test_two_choices_that_make_no_card_together_are_refused(tmp_path: Path) -> None:
    other = "  UNITS:\n    default: s\n    choices: {s: {}, min: {settings: {ALPHA: {unit: '%'}}}}\naction:\n  names"
    text = edited(VALID, ("action:\n  names", other), (CHOICE, "{settings: {ALPHA: null}, derivative: {filter: null}}"))
    assert headlines(faults(tmp_path, text)) == ["26:39: missing key 'sets'"]


def test_a_forward_rule_unstable_at_the_card_s_own_scan_is_refused(tmp_path: Path) -> None:
    filters = (
        "{on: pv, filter: {applies-to: term, ratio: ALPHA}}",
        "{on: pv, rule: forward, filter: {applies-to: term, time: 0.1}}",
    )
    text = edited(VALID, filters, *_NO_ALPHA, (", Tf: 2}", ", Tf: 0.1}"))
    unstable = (
        "the filter time 0.1 s is too short for the scan interval 1 s: the forward rule is unstable; "
        "use a scan interval below 0.2 s or no filter"
    )
    assert [f"18:3: with STRUCTURE=I-PD: {unstable}", f"18:3: with STRUCTURE=PID: {unstable}"] == headlines(faults(tmp_path, text))


@pytest.mark.parametrize(
    "edits",
    [
        pytest.param(
            (("unit: s, off: inf", "unit: s, range: [0, 0.0001]"), ("RESET: 60", "RESET: 0.0001"), ("ki: 0.0333333", "ki: 20000")),
            id="tiny",
        ),
        pytest.param(
            (("unit: s, off: inf", "unit: s, range: [2e4, 3e4]"), ("RESET: 60", "RESET: 2e4"), ("ki: 0.0333333", "ki: 1e-4")),
            id="huge",
        ),
        pytest.param(
            (
                (GAIN, '  GAIN: {sets: gain, unit: "%/%", range: [-9, -1]}\n'),
                ("{GAIN: 2,", "{GAIN: -2,"),
                ("{kp: 2, ki: 0.0333333, kd: 32,", "{kp: -2, ki: -0.0333333, kd: -32,"),
            ),
            id="negative",
        ),
    ],
)
def test_a_range_far_from_one_is_no_fault(edits: tuple[Edit, ...], tmp_path: Path) -> None:
    assert headlines(faults(tmp_path, edited(VALID, *edits))) == []


@pytest.mark.parametrize(
    ("edits", "expected"),
    [
        ((("ratio: ALPHA", "ratio: -2"), *_NO_ALPHA), "11:56: ratio is -2; it is a number from 0 up"),
        ((("ratio: ALPHA", "time: .nan"), *_NO_ALPHA), "11:55: nan is not a number; give one"),
        (((WINDUP, "{scheme: back-calculation, tracking-time: -5}"),), "10:89: tracking-time is -5; it is a number from 0 up"),
    ],
)
def test_a_number_in_place_of_a_setting_is_checked_as_a_setting_is(edits: tuple[Edit, ...], expected: str, tmp_path: Path) -> None:
    assert [expected] == headlines(faults(tmp_path, edited(VALID, *edits)))[:1]


@pytest.mark.parametrize(("edits", "expected"), REFERENCES)
def test_a_card_that_names_a_wrong_setting_is_not_loaded(
    edits: tuple[Edit, ...], expected: tuple[str, ...], tmp_path: Path
) -> None:
    with pytest.raises(CardError) as caught:
        loaded(tmp_path, edited(VALID, *edits))
    assert list(expected) == headlines(list(caught.value.problems))


def test_numbers_that_cannot_be_computed_with_together_are_refused_where_they_stand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def divided(*_: object, **__: object) -> None:
        raise ZeroDivisionError("float division by zero")

    card = loaded(tmp_path, VALID.replace("    canonical: {kp: 2, ki: 0.0333333, kd: 32, Tf: 2}", "    outputs: [1]"))
    monkeypatch.setattr(runs, "Bench", divided)
    monkeypatch.setattr(runs, "Controller", divided)
    message = "these numbers do not go together: they cannot be computed with"
    assert headlines(list(runs.reject_wrong_examples(card))) == [f"45:5: {message}"]
    assert headlines(list(runs.reject_unrunnable(card))) == [
        f"19:3: with STRUCTURE=PID: {message}",
        f"19:3: with STRUCTURE=I-PD: {message}",
    ]
