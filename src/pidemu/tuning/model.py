"""What a tuning rule needs to know of a process: gain, time constant and dead time, or ultimate gain and period."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from pidemu.errors import ProcessError
from pidemu.process.process import Process
from pidemu.process.reduction import half_rule

Kind = Literal["self-regulating", "integrating", "ultimate"]
"""What a formula is computed from."""


@dataclass(frozen=True)
class RuleModel:
    """A process as tuning rules see it.

    Attributes
    ----------
    kind : {"self-regulating", "integrating"} or None
        Which of the two short models the process is, or was reduced to; ``None`` where it is neither.
    numbers : dict
        ``Kp``, the gain without its sign (of an integrating process the velocity gain), ``T`` and ``L``, time constant and dead
        time [s], ``mu = L/T``, the unit reaction rate ``R1 = Kp/T``; ``Ku`` and ``Pu``, ultimate gain and period [s], if any.
    reduced : bool
        Whether time constant and dead time come from the half rule.
    why_not : str
        Why there is no short model.
    """

    kind: Kind | None
    numbers: dict[str, float]
    reduced: bool = False
    why_not: str = ""

    @property
    def text(self) -> str:
        """The short model in words; empty where there is none."""
        n = self.numbers
        if self.kind is None:
            return ""
        size = "Kp" if self.kind == "self-regulating" else "velocity gain"
        parts = [f"{size} {n['Kp']:.5g}", *([f"T {n['T']:.5g} s"] if "T" in n else []), f"L {n['L']:.5g} s"]
        return ", ".join(parts) + (" (by the half rule)" if self.reduced else "")


def rule_model(process: Process) -> RuleModel:
    """Return what tuning rules need to know of a process.

    More lags than one, and zeros, are reduced by the half rule (`pidemu.half_rule`).
    """
    numbers = _ultimate(process)
    why_not = _not_short(process)
    if why_not:
        return RuleModel(None, numbers, why_not=why_not)
    reduced = bool(process.zeros) or len(process.poles) > 1
    try:
        short = half_rule(process) if reduced else process
    except ProcessError as error:  # leads that are longer than all that they could be taken from
        return RuleModel(None, numbers, why_not=str(error))
    L, gain = short.delay, abs(short.gain)
    numbers |= {"Kp": gain, "L": L}
    if short.integrators:
        return RuleModel("integrating", numbers | {"R1": gain}, reduced)
    T = sum(-1 / p.real for p in short.poles)
    return RuleModel("self-regulating", numbers | {"T": T, **({"mu": L / T, "R1": gain / T} if T else {"mu": math.inf})}, reduced)


def _ultimate(process: Process) -> dict[str, float]:
    """Return ultimate gain and period: where the phase is -180 degrees, proportional control swings for ever."""
    w = process.w180
    if not math.isfinite(w) or process.integrators > 1 or any(p.real > 0 for p in process.poles):
        return {}
    return {"Ku": float(1 / abs(process.response(w))), "Pu": 2 * math.pi / w}


def _not_short(process: Process) -> str:
    """Return why a process is not gain, lags and dead time; empty where it is."""
    if any(p.real > 0 for p in process.poles):
        return "it is unstable"
    if any(p.imag for p in (*process.poles, *process.zeros)):
        return "it has complex poles or zeros"
    if process.integrators > 1:
        return "it has more than one integrator"
    return ""
