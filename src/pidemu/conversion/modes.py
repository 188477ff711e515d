"""The modes that a conversion looks at: automatic with the operator's setpoint, and cascade with a remote one."""

from __future__ import annotations

from typing import Final, Literal, get_args

from pidemu.algorithm.model import Algorithm
from pidemu.errors import SettingError, suggest
from pidemu.law.law import Law
from pidemu.settings.settings import Settings

Mode = Literal["auto", "cascade"]
Modes = Literal["auto", "cascade", "both"]
MODES: Final[tuple[Mode, Mode]] = get_args(Mode)
CHOICES: Final[tuple[Modes, ...]] = get_args(Modes)


def read_mode(mode: object) -> Modes:
    """Return the mode asked for.

    Raises
    ------
    SettingError
        It is not one of auto, cascade and both.
    """
    found: Modes | None = next((m for m in CHOICES if m == mode), None)
    if found is None:
        raise SettingError(f"mode is '{mode}'; it is one of {', '.join(CHOICES)}{suggest(str(mode), CHOICES)}")
    return found


def in_mode(a: Algorithm, mode: Mode) -> Algorithm:
    """Return the algorithm as it is in one mode: some change the setpoint weight of P in cascade (specs, section 6)."""
    return a if mode == "auto" else a.in_cascade


def depends_on_mode(settings: Settings) -> bool:
    """Whether the equation of these settings is another one in cascade."""
    a = settings.algorithm()
    return a.cascade_b is not None and a.kp != 0


def law_in(settings: Settings, mode: Mode, scan: float | None = None) -> Law:
    """Return the law of settings in one mode; continuous, or discrete at a scan interval [s]."""
    law = settings.law(scan)
    a = in_mode(law.algorithm, mode)
    return law if a is law.algorithm else Law(a, scan)


def looked_at(mode: Modes, *settings: Settings) -> tuple[Mode, ...]:
    """Return the modes in which a verdict is given: one where nothing depends on the mode, or where one was asked for."""
    if mode != "both":
        return (mode,)
    return ("auto", "cascade") if any(depends_on_mode(s) for s in settings) else ("auto",)
