"""Terms whose gain is 0 and that run on all the same, where the card says so: what a gain that comes back finds (section 6).

Such a controller runs the program that it has with a gain of 1 in place of each 0, and the coefficients that belong to these gains
are 0 in it. So sums and histories go on unseen, and nothing else changes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

from pidemu.algorithm.model import Algorithm
from pidemu.errors import PidemuError
from pidemu.program.ir import Program
from pidemu.settings.settings import Settings

_GAINS: Final = ("gain", "integral", "derivative")


def idle_dials(settings: Settings) -> Mapping[str, str]:
    """Return the dials that are 0 and whose terms run on, with what each sets; none where the card says nothing of it.

    An integral time of 0 is no gain of 0: it switches the integral off.
    """
    equation = settings.equation
    if equation.transfer.zero_gain != "runs-on":
        return {}
    found = {n: equation.settings[n].sets for n, v in settings.items() if v.active and v.value == 0}
    per_time = {n for n in found if equation.settings[n].unit.startswith(("1/", "repeat"))}
    return {n: sets for n, sets in found.items() if sets in _GAINS and (sets != "integral" or n in per_time)}


def with_gains(settings: Settings, dials: Mapping[str, str]) -> Settings | None:
    """Return the settings with 1 on dials that are 0; ``None`` where that cannot be set."""
    try:
        return settings.changed(dict.fromkeys(dials, 1.0))
    except PidemuError:
        return None


def silenced(built: Callable[[Algorithm, float], Program], a: Algorithm, h: float, sets: frozenset[str]) -> Program:
    """Return the program of an algorithm with the coefficients of some gains at 0.

    Parameters
    ----------
    built : callable
        From an algorithm and a scan interval [s] to its program.
    a : Algorithm
        The algorithm with gains that are not 0.
    h : float
        Scan interval [s].
    sets : frozenset of str
        Which gains are 0: ``gain``, ``integral``, ``derivative``.
    """
    program = built(a, h)
    whole = "gain" in sets and a.form != "parallel"  # one gain for all terms
    ki, kd = (2.0 if whole or name in sets else 1.0 for name in ("integral", "derivative"))
    if whole and "derivative" in sets:
        kd = 4.0  # the derivative time doubles as well
    other = built(replace(a, kp=(2.0 if "gain" in sets else 1.0) * a.kp, ki=ki * a.ki, kd=kd * a.kd), h)
    values = (0.0 if x != y else x for x, y in zip(program.values, other.values, strict=True))
    return replace(program, values=tuple(values))
