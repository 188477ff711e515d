"""Eighteen migrations with what an engineer would type, worked out by hand from the two cards' equations.

They were written by two people who did not look at pidemu's answers, one as a DCS and one as a PLC engineer; this is their result
in pidemu's terms. Dials are in the target card's units; `accepted` holds other answers that they took for as good.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Typed:
    """What one would type: options and dials."""

    options: Mapping[str, str]
    dials: Mapping[str, float]
    within: float = 0.003


@dataclass(frozen=True)
class Migration:
    """One case."""

    tag: str
    source: str
    given: Mapping[str, object]
    target: str
    typed: Typed | None
    accepted: tuple[Typed, ...] = ()
    arguments: Mapping[str, Any] = field(default_factory=dict)
    asked: str = ""
    """Kind of the question that is asked instead."""
    about: str = ""
    refused: str = ""
    says: tuple[str, ...] = ()
    """Words that must stand in the answer."""
    not_exact: bool = False


DEG_C = {"pv_range": (0, 300, "degC"), "op_range": (0, 100, "%")}
CASES = (
    Migration(
        "PIC-303", "honeywell/tdc3000", {"K": 2.5, "T1": 0.5, "T2": 0.08, "FORM": "interactive", "CTEQN": "B"}, "emerson/deltav",
        Typed({"FORM": "Series", "STRUCTURE": "1"}, {"GAIN": 2.5, "RESET": 30, "RATE": 4.32, "ALPHA": 0.1111}),
        arguments={"scan": (1, 0.2), "action": "reverse"}, says=("18.5 %", "ALPHA 0.2"),
    ),
    Migration(
        "LIC-404", "fisher/provox", {"GAIN": 0.8, "RESET": 0, "RATE": 0}, "emerson/deltav",
        Typed({"STRUCTURE": "4"}, {"GAIN": 0.8, "RATE": 0}), arguments={"scan": 1, "action": "direct"},
        says=("bias", "PV - SP"),
    ),
    Migration(
        "TIC-506", "foxboro/ia-pid", {"PBAND": 80, "INT": 5, "DERIV": 1.25, "KD": 10, "MODOPT": "PID"}, "emerson/deltav",
        Typed({"FORM": "Series", "STRUCTURE": "1"}, {"GAIN": 1.25, "RESET": 300, "RATE": 69, "ALPHA": 0.08696}),
        arguments={"scan": 1}, says=("noise",), not_exact=True,
    ),
    Migration(
        "PIC-912", "allen-bradley/plc5",
        {"KC": 1.5, "TI": 0.5, "TD": 0.05, "EQUATION": "ISA", "DERIVATIVE": "PV"}, "emerson/deltav",
        Typed({"FORM": "Standard", "STRUCTURE": "1"}, {"GAIN": 1.5, "RESET": 6, "RATE": 0.6, "ALPHA": 0.0625}),
        arguments={"scan": 1.0, "runs_every": 0.2},
    ),
    Migration(
        "TIC-1013", "fisher/provox", {"GAIN": 1.8, "RESET": "0.4 min", "RATE": 0.3}, "honeywell/tdc3000",
        Typed({"FORM": "interactive", "CTEQN": "B"}, {"K": 1.8, "T1": 2.5, "T2": 0.3}), asked="unit", about="RESET",
    ),
    Migration(
        "TIC-1216", "honeywell/tdc3000",
        {"K": 1.2, "T1": 4, "T2": 0.2, "FORM": "interactive", "CTEQN": "B"}, "foxboro/ia-pid",
        Typed({"MODOPT": "PID"}, {"PBAND": 83.33, "INT": 4, "DERIV": 0.2, "KD": 9.524}, 0.005),
        (Typed({"MODOPT": "PID"}, {"PBAND": 83.33, "INT": 4, "DERIV": 0.2, "KD": 10}, 0.005),), {"scan": (1, 0.5)},
    ),
    Migration(
        "TIC-1218", "honeywell/tdc3000", {"K": 1.1, "T1": 1.0, "T2": 1.0, "CTEQN": "B"}, "foxboro/ia-pid",
        Typed({"MODOPT": "PID"}, {"PBAND": 90.91, "INT": 1, "DERIV": 1, "KD": 5}, 0.01), asked="option", about="FORM",
    ),
    Migration(
        "TIC-1320", "fisher/provox", {"GAIN": 4, "RESET": 0.2, "RATE": 0.5}, "honeywell/udc",
        Typed({"ALGO": "B", "PBorGAIN": "GAIN", "MINorRPM": "MIN"}, {"GAIN": 4.35, "RSET": 5.44, "RATE": 0.4}, 0.01),
        arguments={"scan": (1, 0.333), "digits": 5}, says=("does not jump", "ALGO=A"), not_exact=True,
    ),
    Migration(
        "FIC-1523", "fisher/provox", {"GAIN": 0.8, "RESET": 10, "RATE": 0}, "yokogawa/fieldbus-pid",
        Typed({}, {"GAIN": 0.8, "RESET": 6, "RATE": 0, "PV_FTIME": 0}), arguments={"scan": 0.5, "mode": "cascade"},
    ),
    Migration(
        "PLC 01", "allen-bradley/plc5", {"KC": 1.8, "TI": 1.25, "TD": 0.2, "EQUATION": "ISA", "DERIVATIVE": "PV"},
        "allen-bradley/logix-pid",
        Typed({"PE": "dependent", "DOE": "PV", "NDF": "off"}, {"KP": 1.8, "KI": 1.25, "KD": 0.2}), arguments={"scan": 0.5},
    ),
    Migration(
        "PLC 06", "honeywell/udc", {"PB": 40, "RSET": 2, "RATE": 0.1, "ALGO": "A", "PBorGAIN": "PB PCT", "MINorRPM": "RPM"},
        "allen-bradley/pide",
        Typed(
            {"DependIndepend": "true", "PVEProportional": "false", "PVEDerivative": "false"},
            {"PGain": 2.5, "IGain": 0.5, "DGain": 0.1},
        ),
        arguments={"scan": (0.333, 0.25)}, says=("standard form (assumed)", "PGain 3, IGain 0.6, DGain 0.0833"),
    ),
    Migration(
        "PLC 07a", "honeywell/udc", {"PB": 25, "RSET": 3.0, "RATE": 0, "ALGO": "B", "PBorGAIN": "PB PCT", "MINorRPM": "MIN"},
        "allen-bradley/pide",
        Typed(
            {"DependIndepend": "true", "PVEProportional": "true", "PVEDerivative": "true"},
            {"PGain": 4.0, "IGain": 3.0, "DGain": 0.0},
        ),
        arguments={"scan": 0.25},
    ),
    Migration(
        "PLC 10", "automationdirect/directlogic",
        {
            "ALGORITHM": "POSITION", "DERIVATIVE_GAIN_LIMIT": "ON", "RESET_UNITS": "SECONDS", "ERROR_TERM": "LINEAR",
            "GAIN": 3.0, "RESET": 40.0, "RATE": 8.0, "LIMIT": 8, "FILTER": 1,
        },
        "allen-bradley/logix-pid",
        Typed({"PE": "dependent", "DOE": "PV", "NDF": "off"}, {"KP": 3.0, "KI": 0.66667, "KD": 0.13333}),
        arguments={"scan": (1.0, 0.1)}, says=("noise", "at the old scan interval"),
    ),
    Migration(
        "PLC 13", "arduino/pid",
        {"POn": "P_ON_E", "Kp": 20, "Ki": 0.5, "Kd": 30, "pv_range": (0, 300, "degC"), "op_range": (0, 255, "pwm")},
        "simple-pid/simple-pid",
        Typed(
            {"proportional_on_measurement": "false", "differential_on_measurement": "true"},
            {"Kp": 0.078431, "Ki": 0.0019608, "Kd": 0.11765},
        ),
        arguments={"to_op_range": (0, 1, "duty"), "scan": 0.1}, says=("0 to 1 duty",),
    ),
    Migration(
        "PLC 17", "oscat/ft-pid", {"KP": 0.15, "TN": 25, "pv_range": (0, 120, "degC"), "op_range": (0, 10, "V")},
        "allen-bradley/logix-pid",
        Typed({"PE": "dependent", "DOE": "error", "NDF": "on"}, {"KP": 1.8, "KI": 0.41667, "KD": 0.016667}),
        arguments={"to_op_range": (0, 100, "%"), "scan": 0.1}, asked="input", about="TV",
    ),
    Migration(
        "PLC 20", "allen-bradley/plc5", {"KC": 1.0, "TI": 2.0, "TD": 0.2, "EQUATION": "ISA", "DERIVATIVE": "PV"},
        "allen-bradley/logix-pid",
        Typed({"PE": "dependent", "DOE": "PV", "NDF": "off"}, {"KP": 1.0, "KI": 0.5, "KD": 0.05}),
        arguments={"scan": 1.0, "runs_every": 0.25},
    ),
    Migration(
        "PLC 21", "allen-bradley/plc5", {"KC": 4, "TI": 0, "TD": 0, "EQUATION": "ISA", "DERIVATIVE": "PV"}, "allen-bradley/pide",
        None, arguments={"scan": 0.5, "action": "direct"}, refused="allen-bradley/logix-pid",
    ),
    Migration(
        "PLC 23a", "honeywell/udc", {"ALGO": "A", "PBorGAIN": "GAIN", "GAIN": 2, "RSET": 0.5, "RATE": 0}, "allen-bradley/pide",
        Typed({"DependIndepend": "true", "PVEProportional": "false"}, {"PGain": 2.0, "IGain": 0.5, "DGain": 0.0}),
        asked="option", about="MINorRPM",
    ),
)  # fmt: skip
