"""Where a conversion says exact, both controllers give the same output, scan by scan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.errors import ConversionRefusedError, ScanError
from tests.conversion.support import difference, outputs, random_signal, settings_that_act

ROUNDING = 1e-9
"""Of the span, or of what the outputs move over: sums over 200 scans of doubles, with a margin of a thousand and more."""

SCAN = 1.0


@dataclass(frozen=True)
class Pair:
    source: str
    given: Mapping[str, object]
    target: str
    verdict: str = "exact"
    options: Mapping[str, object] = field(default_factory=dict)
    dials: Mapping[str, object] = field(default_factory=dict)

    def __str__(self) -> str:
        chosen = "".join(f",{k}={v}" for k, v in {**self.options, **self.dials}.items())
        return f"{self.source}({','.join(f'{k}={v}' for k, v in self.given.items())})->{self.target}{chosen}"

    def convert(self) -> pidemu.Conversion:
        source = pidemu.load_card(self.source).settings(**self.given)
        return pidemu.convert(source, self.target, options=self.options, given=self.dials, scan=SCAN)


PROVOX = {"GAIN": 2, "RESET": 4, "RATE": 0.1}
STANDARD = {"K": 2, "Ti": 30, "Td": 6, "Tf": 0.8, "b": 0.7, "c": 0.3}
SERIES = {"K": 2, "Ti": 30, "Td": 6, "alpha": 0.1}
UDC = {"GAIN": 2, "RSET": 1, "RATE": 0.1}
BAILEY = {"K": 2, "KP": 1.5, "KI": 0.6, "KD": 0.2}

EXACT = [
    Pair("generic/standard", STANDARD, "generic/parallel"),
    Pair("generic/parallel", {"kp": 2, "ki": 0.05, "kd": 12, "Tf": 0.8, "b": 0.7, "c": 0.3}, "generic/standard"),
    Pair("generic/series", SERIES, "generic/parallel"),
    Pair("generic/series", SERIES, "generic/standard"),
    Pair("generic/standard", {"K": 2, "Ti": 30, "Td": 6, "Tf": 0.8}, "generic/series"),
    Pair("generic/parallel", {"kp": 2, "ki": 0.05, "kd": 12}, "generic/series"),
    Pair("generic/parallel", {"kp": 0, "ki": 0.05, "kd": 2, "Tf": 1}, "generic/parallel"),
    Pair("simple-pid/simple-pid", {"Kp": -2, "Ki": -0.1, "Kd": -3}, "simple-pid/simple-pid"),
    Pair("fisher/provox", PROVOX, "generic/parallel"),
    Pair("fisher/provox", PROVOX, "generic/standard"),
    Pair("fisher/provox", PROVOX, "emerson/deltav", options={"STRUCTURE": "7"}),
    Pair("fisher/provox", PROVOX, "emerson/deltav", options={"FORM": "Series"}),
    Pair("fisher/provox", {"GAIN": 2, "RESET": 4}, "emerson/deltav"),
    Pair("emerson/deltav", {"GAIN": 2, "RESET": 30, "RATE": 4, "FORM": "Series"}, "generic/parallel"),
    Pair("emerson/deltav", {"GAIN": 2, "RESET": 30, "RATE": 4, "STRUCTURE": "7", "BETA": 0.4, "GAMMA": 0.2}, "generic/standard"),
    Pair("emerson/deltav", {"GAIN": 2, "RATE": 4, "STRUCTURE": "4"}, "generic/parallel"),
    Pair("emerson/deltav", {"GAIN": 2, "RESET": 30, "STRUCTURE": "5"}, "generic/parallel"),
    Pair("honeywell/tdc3000", {"K": 2, "T1": 1, "T2": 0.25}, "generic/series"),
    Pair("honeywell/tdc3000", {"K": 2, "T1": 1, "T2": 0.25, "CTEQN": "B"}, "generic/parallel"),
    Pair("king/velocity", {"Kc": 2, "Ti": 1, "EQUATION": "8"}, "generic/standard"),
    Pair("foxboro/pneumatic", {"PB": 50, "INT": 1, "DERIV": 0.25}, "honeywell/tdc3000"),
    Pair("honeywell/udc", {**UDC, "ALGO": "B"}, "generic/parallel"),
    Pair("honeywell/udc", UDC, "generic/series"),
    Pair("bailey/fc18", BAILEY, "bailey/fc19"),
    Pair("bailey/fc18", BAILEY, "generic/standard"),
    Pair("bailey/fc19", {**BAILEY, "S11": "integral only"}, "generic/standard"),
    Pair("allen-bradley/plc5", {"EQUATION": "ISA", "KC": 2, "TI": 1, "TD": 0.1}, "generic/standard"),
    Pair("arduino/pid", {"Kp": 2, "Ki": 0.1, "Kd": 3}, "generic/parallel"),
    Pair(
        "arduino/pid",
        {"Kp": 2, "Ki": 0.1, "Kd": 3, "POn": "P_ON_M"},
        "simple-pid/simple-pid",
        options={"proportional_on_measurement": "true"},
    ),
    Pair("simple-pid/simple-pid", {"Kp": 2, "Ki": 0.1, "Kd": 3, "differential_on_measurement": "false"}, "generic/standard"),
    Pair("foxboro/ia-pid", {"PBAND": 50, "INT": 1, "DERIV": 0, "MODOPT": "PI"}, "fisher/provox"),
]

FEEDBACK = [
    Pair("fisher/provox", PROVOX, "emerson/deltav", "exact-feedback", {"FORM": "Standard", "STRUCTURE": "1"}),
    Pair("generic/standard", STANDARD, "generic/series", "exact-feedback"),
    Pair("generic/series", SERIES, "generic/standard", "exact-feedback", dials={"b": 1, "c": 0}),
    Pair("honeywell/udc", UDC, "honeywell/udc", "exact-feedback", {"ALGO": "B"}),
    Pair("honeywell/tdc3000", {"K": 2, "T1": 1, "T2": 0.25}, "honeywell/tdc3000", "exact-feedback", {"CTEQN": "B"}),
    Pair("bailey/fc18", BAILEY, "bailey/fc19", "exact-feedback", {"S11": "integral only"}),
    Pair(
        "bailey/fc18", {"KP": 2, "KI": 0.5, "KD": 0.1}, "emerson/deltav", "exact-feedback", {"FORM": "Standard", "STRUCTURE": "1"}
    ),
    Pair("arduino/pid", {"Kp": 2, "Ki": 0.1, "Kd": 3}, "arduino/pid", "exact-feedback", {"POn": "P_ON_M"}),
]


@pytest.mark.parametrize("pair", EXACT, ids=str)
def test_exact_means_the_same_output_whatever_the_setpoint_and_the_measurement_do(pair: Pair) -> None:
    conversion = pair.convert()
    assert conversion.verdict == "exact"
    for seed in range(3):
        sp, pv = random_signal(seed), random_signal(100 + seed)
        a, b = (outputs(s, sp, pv, SCAN) for s in (conversion.source, conversion.settings))
        assert np.ptp(a) > 1
        assert difference(a, b) < ROUNDING


@pytest.mark.parametrize("pair", FEEDBACK, ids=str)
def test_exact_feedback_means_the_same_output_while_the_setpoint_stays(pair: Pair) -> None:
    conversion = pair.convert()
    assert conversion.verdict == "exact-feedback"
    sp, pv = np.full(200, 50.0), random_signal(7)
    a, b = (outputs(s, sp, pv, SCAN) for s in (conversion.source, conversion.settings))
    assert np.ptp(a) > 1
    assert difference(a, b) < ROUNDING


@pytest.mark.parametrize("pair", FEEDBACK, ids=str)
def test_exact_feedback_is_not_said_of_controllers_that_agree_on_setpoint_changes_too(pair: Pair) -> None:
    conversion = pair.convert()
    sp, pv = random_signal(8), np.full(200, 50.0)
    a, b = (outputs(s, sp, pv, SCAN) for s in (conversion.source, conversion.settings))
    assert difference(a, b) > 1e-3


GENERIC = (
    "generic/standard",
    "generic/parallel",
    "generic/series",
    "fisher/provox",
    "emerson/deltav",
    "honeywell/tdc3000",
    "bailey/fc19",
)


@given(
    data=st.data(),
    names=st.tuples(st.sampled_from(GENERIC), st.sampled_from(GENERIC)),
    scan=st.floats(0.1, 5),
    seed=st.integers(0, 999),
)
@settings(max_examples=100)
def test_the_verdict_at_the_scans_is_what_the_emulated_controllers_show(
    data: st.DataObject, names: tuple[str, str], scan: float, seed: int
) -> None:
    source = settings_that_act(data, pidemu.load_card(names[0]))
    try:
        conversion = pidemu.convert(source, names[1], scan=scan)
    except ConversionRefusedError:
        assume(False)
    assume(conversion.verdict != "approximate")
    sp, pv = random_signal(seed, 120), random_signal(seed + 1000, 120)
    if conversion.verdict == "exact-feedback":
        sp = np.full(120, 50.0)
    try:
        a, b = (outputs(s, sp, pv, scan) for s in (conversion.source, conversion.settings))
    except ScanError:  # one of them cannot run at this interval, and says so
        assume(False)
    if not conversion.source.algorithm().ki:  # positional: counted from the bias; velocity: from the output at the transfer
        a, b = a - a[0], b - b[0]
    # the law's verdict is relative, per frequency, to 1e-9; an output adds up 120 scans of it
    assert difference(a, b) < 100 * ROUNDING


def test_equal_laws_at_unequal_scans_are_not_exact() -> None:
    source = pidemu.load_card("fisher/provox").settings(**PROVOX)
    conversion = pidemu.convert(source, "generic/parallel", scan=(1.0, 0.25), compensate=False)
    assert conversion.certificate.feedback.is_exact
    assert conversion.verdict == "approximate"
    assert any("scan intervals differ" in w for w in conversion.warnings)


def test_equal_laws_by_unequal_rules_are_not_exact_at_the_scan() -> None:
    source = pidemu.load_card("foxboro/ia-pid").settings(PBAND=50, INT=1, DERIV=0.1)
    target = pidemu.load_card("foxboro/ia-pid")
    assert pidemu.convert(source, target, scan=(1.0, 1.0)).verdict == "exact"
    assert pidemu.convert(source, target, scan=(1.0, 0.5)).verdict == "approximate"
