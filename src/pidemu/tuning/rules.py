"""The tuning rules: formulas, where each was read, the form it is meant for, and for which processes.

Names in formulas: ``Kp``, ``T``, ``L`` [s], ``mu = L/T``; ``R1``, unit reaction rate, ``Kp/T`` or an integrating process's velocity
gain; ``Ku`` and ``Pu`` [s]; parameters such as ``Tcl``. All are for ``K (1 + 1/(Ti s) + Td s)``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

from pidemu.tuning.model import Kind

Controller = Literal["P", "PI", "PID"]
Formulas = Mapping[str, str]


@dataclass(frozen=True)
class TuningRule:
    """A tuning rule.

    Attributes
    ----------
    name : str
        What it is called by.
    family : str
        What rules for P, PI and PID of one source have in common; alone it means the one with the most terms.
    controller : {"P", "PI", "PID"}
        Terms that it tunes.
    title : str
        Whose rule it is.
    formulas : mapping
        By kind of process, or ``ultimate``: formulas of ``K``, ``Ti`` and ``Td`` [s].
    source, place : str
        Where it was read.
    criterion : str
        What it aims at.
    form : str
        Form of the controller that it is meant for.
    on_measurement : bool
        Whether P and D act on the measurement, instead of P on the error.
    mu : tuple of float
        Smallest and largest ``L/T`` that it is stated for.
    parameters : mapping of str to str
        What the user may choose, with the formula of its default.
    least : mapping of str to str
        Formula of the least value of a parameter.
    note : str
        What else should be known.
    """

    name: str
    family: str
    controller: Controller
    title: str
    formulas: Mapping[Kind, Formulas]
    source: str
    place: str
    criterion: str
    form: str = "standard"
    on_measurement: bool = False
    mu: tuple[float, float] = (0.0, math.inf)
    parameters: Mapping[str, str] = field(default_factory=dict)
    least: Mapping[str, str] = field(default_factory=dict)
    note: str = ""

    @property
    def reference(self) -> str:
        """Source and place in one line."""
        return f"{self.source}, {self.place}"


_QUARTER: Final = "quarter-amplitude damping"
_ZN: Final = "Ziegler and Nichols, Optimum Settings for Automatic Controllers, Trans. ASME 64 (1942)"
_MILLER: Final = "Miller, Lopez, Smith and Murrill, A Comparison of Controller Tuning Techniques, Control Engineering (1967)"
_LUND: Final = "Astrom and Hagglund, PID Control (slides, Lund 2020)"
_TYREUS: Final = "Tyreus and Luyben; as printed in T. Co, Standard PID Tuning Methods (Michigan Tech, 2012)"
_TESTED: Final = (0.1, 1.0)
_POWERS: Final[Mapping[str, tuple[str, str, Mapping[Controller, tuple[float, ...]]]]] = {
    "3c": ("3C (three constraints)", f"{_QUARTER} and two constraints more, for PID K Kp Td/T = 0.5", {
        "P": (1.208, 0.936), "PI": (0.928, 0.946, 0.928, 0.583), "PID": (1.370, 0.950, 0.740, 0.738, 0.365, 0.950)}),
    "iae": ("minimum IAE", "least IAE after a load step", {
        "P": (0.902, 0.985), "PI": (0.984, 0.986, 1.644, 0.707), "PID": (1.435, 0.921, 1.139, 0.749, 0.482, 1.137)}),
    "ise": ("minimum ISE", "least ISE after a load step", {
        "P": (1.411, 0.917), "PI": (1.305, 0.959, 2.033, 0.739), "PID": (1.495, 0.945, 0.917, 0.771, 0.560, 1.006)}),
    "itae": ("minimum ITAE", "least ITAE after a load step", {
        "P": (0.490, 1.084), "PI": (0.859, 0.977, 1.484, 0.680), "PID": (1.357, 0.947, 1.176, 0.738, 0.381, 0.995)}),
}  # fmt: skip
"""Miller's table: ``K Kp = A mu^-B``, ``Ti/T = C mu^D``, ``Td/T = E mu^F``; A to F by controller."""


def _miller() -> Iterator[TuningRule]:
    for family, (title, criterion, rows) in _POWERS.items():
        for controller, row in rows.items():
            A, B, C, D, E, F = (*row, *[0.0] * (6 - len(row)))
            formulas = {"K": f"{A}*mu**-{B}/Kp"}
            formulas |= {"Ti": f"{C}*T*mu**{D}"} if C else {}
            formulas |= {"Td": f"{E}*T*mu**{F}"} if E else {}
            note = ""
            if controller == "PID" and family in ("ise", "itae"):
                other = {"ise": "mu^0.771/1.101", "itae": "mu^0.738/0.842"}[family]
                note = f"Lopez (1967) prints Ti/T = {other}, within 1 % of this"
            yield TuningRule(
                f"{family}-{controller.lower()}", family, controller, title, {"self-regulating": formulas}, _MILLER,
                "table of constants", criterion, mu=_TESTED, note=note,
            )  # fmt: skip


def _by_ultimate_point() -> Iterator[TuningRule]:
    zn: Mapping[Controller, tuple[Formulas, Formulas]] = {
        "P": ({"K": "0.5*Ku"}, {"K": "1/(R1*L)"}),
        "PI": ({"K": "0.45*Ku", "Ti": "Pu/1.2"}, {"K": "0.9/(R1*L)", "Ti": "L/0.3"}),
        "PID": ({"K": "0.6*Ku", "Ti": "Pu/2", "Td": "Pu/8"}, {"K": "1.2/(R1*L)", "Ti": "L/0.5", "Td": "0.5*L"}),
    }
    for controller, (ultimate, step) in zn.items():
        small = controller.lower()
        yield TuningRule(
            f"ziegler-nichols-{small}", "ziegler-nichols", controller, "Ziegler-Nichols by the ultimate point",
            {"ultimate": ultimate}, _ZN, "ultimate sensitivity", _QUARTER,
        )  # fmt: skip
        yield TuningRule(
            f"ziegler-nichols-step-{small}", "ziegler-nichols-step", controller, "Ziegler-Nichols by the reaction curve",
            {"self-regulating": step, "integrating": step}, _ZN, "reaction curve", _QUARTER,
        )  # fmt: skip
    luyben: Mapping[Controller, Formulas] = {
        "PI": {"K": "Ku/3.2", "Ti": "2.2*Pu"},
        "PID": {"K": "Ku/2.2", "Ti": "2.2*Pu", "Td": "Pu/6.3"},
    }
    for controller, formulas in luyben.items():
        yield TuningRule(
            f"tyreus-luyben-{controller.lower()}", "tyreus-luyben", controller, "Tyreus-Luyben", {"ultimate": formulas}, _TYREUS,
            "table 2", "more damping than Ziegler-Nichols",
        )  # fmt: skip
    yield TuningRule(
        "st-clair", "st-clair", "PID", "St. Clair", {"ultimate": {"K": "Ku/2", "Ti": "Pu", "Td": "Pu/8"}},
        "Blickley, PID Tuning Without the Math (on St. Clair), Control Engineering", "rule of thumb",
        "a start without model: Ti the natural period",
    )  # fmt: skip


def _cohen_coon() -> Iterator[TuningRule]:
    rows: Mapping[Controller, Formulas] = {
        "P": {"K": "(1/mu + 0.333)/Kp"},
        "PI": {"K": "(0.9/mu + 0.082)/Kp", "Ti": "T*(3.33*mu + 0.3*mu**2)/(1 + 2.2*mu)"},
        "PID": {
            "K": "(1.35/mu + 0.270)/Kp",
            "Ti": "T*(2.5*mu + 0.5*mu**2)/(1 + 0.6*mu)",
            "Td": "T*0.37*mu/(1 + 0.2*mu)",
        },
    }
    for controller, formulas in rows.items():
        yield TuningRule(
            f"cohen-coon-{controller.lower()}", "cohen-coon", controller, "Cohen-Coon", {"self-regulating": formulas}, _MILLER,
            "Cohen-Coon, as printed there", _QUARTER, mu=_TESTED, note="other printings differ by up to 4.6 %",
        )  # fmt: skip


def _others() -> Iterator[TuningRule]:
    closed = {"Tcl": "L"}
    note = "Tcl is the time constant wanted of the closed loop, L unless given"
    for name, T in (("simc", "T"), ("simc+", "(T + L/3)")):
        yield TuningRule(
            name, name, "PI", "SIMC (Skogestad)" if name == "simc" else "SIMC+, improved", {
                "self-regulating": {"K": f"{T}/(Kp*(L + Tcl))", "Ti": f"min({T}, 4*(Tcl + L))"},
                **({"integrating": {"K": "1/(Kp*(L + Tcl))", "Ti": "4*(Tcl + L)"}} if name == "simc" else {}),
            },
            _LUND, "SIMC", "a first-order closed loop with the time constant Tcl", mu=(0.0, math.inf), parameters=closed, note=note,
        )  # fmt: skip
    yield TuningRule(
        "lambda", "lambda", "PI", "lambda tuning", {
            "self-regulating": {"K": "T/(Kp*(lam + L))", "Ti": "T"},
            "integrating": {"K": "(2*lam + L)/(Kp*(lam + L)**2)", "Ti": "2*lam + L"},
        },
        "Beall, Loop tuning basics: Self-regulating processes, InTech", "lambda rule; integrating: derived in docs/tuning.md",
        "a closed loop with the time constant lam", form="standard or series", parameters={"lam": "3*max(L, T)"},
        least={"lam": "L"},
        note="lam is three times the larger of T and L unless given, and never less than L",
    )  # fmt: skip
    yield TuningRule(
        "one-third", "one-third", "PI", "one third rule", {"self-regulating": {"K": "1/(3*Kp)", "Ti": "T + L/3"}}, _LUND,
        "one third rule", "a safe start",
    )  # fmt: skip
    yield TuningRule(
        "amigo-pi", "amigo", "PI", "AMIGO", {
            "self-regulating": {
                "K": "0.15/Kp + (0.35 - L*T/(L + T)**2)*T/(Kp*L)",
                "Ti": "0.35*L + 13*L*T**2/(T**2 + 12*L*T + 7*L**2)",
            },
            "integrating": {"K": "0.35/(Kp*L)", "Ti": "13.35*L"},
        },
        _LUND, "AMIGO", "most integral gain with Ms and Mt of 1.4", note="integrating: the limit of the formulas for a long T",
    )  # fmt: skip
    yield TuningRule(
        "amigo-pid", "amigo", "PID", "AMIGO", {
            "self-regulating": {
                "K": "(0.2 + 0.45*T/L)/Kp",
                "Ti": "L*(0.4*L + 0.8*T)/(L + 0.1*T)",
                "Td": "0.5*L*T/(0.3*L + T)",
            },
            "integrating": {"K": "0.45/(Kp*L)", "Ti": "8*L", "Td": "0.5*L"},
        },
        _LUND, "AMIGO", "most integral gain with Ms and Mt of 1.4", note="integrating: the limit of the formulas for a long T",
    )  # fmt: skip
    yield TuningRule(
        "king", "king", "PID", "King", {
            "self-regulating": {
                "K": "((1.038*mu + 0.353)**-1.644 + 0.583)/Kp",
                "Ti": "T*((0.588*mu + 4.164)**0.929 - 2.971)",
                "Td": "T*((1.190*mu + 3.850)**0.487 - 1.857)",
            },
        },
        "King, Update your process control algorithms, Hydrocarbon Processing", "equations 10 to 12",
        "least ITAE after a setpoint step, the output at most 15 % beyond its change", form="standard, P and D on PV",
        on_measurement=True,
    )  # fmt: skip


_RULES: Final = (*_others(), *_by_ultimate_point(), *_cohen_coon(), *_miller())


def tuning_rules() -> tuple[TuningRule, ...]:
    """Return all tuning rules."""
    return _RULES
