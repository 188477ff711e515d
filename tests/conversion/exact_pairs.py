"""Pairs of controllers that are exactly alike, or alike but for setpoint changes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import pidemu
from tests.conversion.support import HUNDRED

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
TDC = {"K": 2, "T1": 1, "T2": 0.25, "FORM": "interactive"}

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
    Pair(
        "emerson/deltav",
        {"GAIN": 2, "RESET": 30, "RATE": 4, "FORM": "Standard", "STRUCTURE": "7", "BETA": 0.4, "GAMMA": 0.2},
        "generic/standard",
    ),
    Pair("emerson/deltav", {"GAIN": 2, "RATE": 4, "STRUCTURE": "4"}, "generic/parallel"),
    Pair("emerson/deltav", {"GAIN": 2, "RESET": 30, "STRUCTURE": "5"}, "generic/parallel"),
    Pair("honeywell/tdc3000", TDC, "honeywell/tdc3000"),
    Pair("honeywell/tdc3000", TDC, "generic/series"),  # which then integrates by the trapezoidal rule as well
    Pair("king/velocity", {"Kc": 2, "Ti": 1, "EQUATION": "8"}, "generic/standard"),
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

OTHER_RULE = [
    Pair("honeywell/tdc3000", TDC, "generic/series", options={"INTEGRAL_RULE": "backward"}),
    Pair("honeywell/tdc3000", {**TDC, "CTEQN": "B"}, "generic/parallel", options={"INTEGRAL_RULE": "backward"}),
    Pair("honeywell/tdc3000", {**TDC, "CTEQN": "B"}, "generic/parallel"),  # trapezoidal too, but a sum and not a product
    Pair("foxboro/pneumatic", {"PB": 50, "INT": 1, "DERIV": 0.25}, "honeywell/tdc3000"),
]
"""The same law by other rules; tdc3000 integrates by the trapezoidal rule and differentiates by the backward one."""

FEEDBACK = [
    Pair("fisher/provox", PROVOX, "emerson/deltav", "exact-feedback", {"FORM": "Standard", "STRUCTURE": "1"}),
    Pair("generic/standard", STANDARD, "generic/series", "exact-feedback"),
    Pair("generic/series", SERIES, "generic/standard", "exact-feedback", dials={"b": 1, "c": 0}),
    Pair("honeywell/udc", UDC, "honeywell/udc", "exact-feedback", {"ALGO": "B"}),
    Pair("honeywell/tdc3000", TDC, "honeywell/tdc3000", "exact-feedback", {"CTEQN": "B"}),
    Pair("bailey/fc18", BAILEY, "bailey/fc19", "exact-feedback", {"S11": "integral only"}),
    Pair(
        "bailey/fc18",
        {"KP": 2, "KI": 0.5, "KD": 0.1, **HUNDRED},
        "emerson/deltav",
        "exact-feedback",
        {"FORM": "Standard", "STRUCTURE": "1"},
    ),
    Pair("arduino/pid", {"Kp": 2, "Ki": 0.1, "Kd": 3}, "arduino/pid", "exact-feedback", {"POn": "P_ON_M"}),
]
