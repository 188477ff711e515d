"""The closed loop of ``c/pid_loop.c``, compiled, and the same loop as a scan program."""

from __future__ import annotations

import ctypes
import functools
import subprocess
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import pidemu
from pidemu.backends.native import compiler
from pidemu.card.windup import Scheme
from pidemu.card.windup.conditional import WindupConditional
from pidemu.program.builder import build
from pidemu.program.ir import Program
from pidemu.program.specialise import specialise
from pidemu.simulation.closed import closed_loop
from pidemu.simulation.experiment import Steps, experiment

Floats = npt.NDArray[np.float64]
FOLDER = Path(__file__).parent / "c"
LOOPS = 64
H = 0.5


@dataclass(frozen=True)
class Numbers:
    """What defines the loop: the gains of a parallel controller, and the process."""

    kp: float = 2.0
    ki: float = 0.2
    kd: float = 1.0
    Tf: float = 0.5
    lag: float = 10.0
    delay: float = 2.0


def program(numbers: Numbers = Numbers()) -> Program:
    """Return the closed loop as a program that reads setpoint and load."""
    dials = {"kp": numbers.kp, "ki": numbers.ki, "kd": numbers.kd, "Tf": numbers.Tf, "b": 1, "c": 0}
    algorithm = pidemu.load_card("generic/parallel").settings(dials).algorithm()
    windup: Scheme[float] = WindupConditional(scheme="conditional", last_increment="dropped")
    algorithm = replace(algorithm, integral=replace(algorithm.integral, windup=windup))
    controller = build(algorithm, H, limits=(0.0, 100.0))
    at_rest = {"u": 50.0, "I": 50.0, "x1": 50.0, "on": 1.0, "begun": 1.0}
    controller = replace(controller, initial=tuple(at_rest.get(q.name, 0.0) for q in controller.states))
    process = pidemu.Process.from_lags(1.0, [numbers.lag], delay=numbers.delay)
    return closed_loop(specialise(controller), process.sampled(H), (50.0, 50.0))


def stepping(numbers: Numbers, scans: int) -> Program:
    """Return the closed loop with steps of its own: the setpoint at a tenth, the load at half of the scans."""
    return experiment(program(numbers), Steps(50.0, 10.0, scans // 10, 5.0, scans // 2))


@functools.cache
def library(*flags: str) -> ctypes.CDLL:
    """Return the handwritten loop, compiled with flags."""
    path = Path(tempfile.mkdtemp()) / "pid_loop.so"
    subprocess.run([*compiler(), "-std=c99", *flags, "-shared", "-fPIC", str(FOLDER / "pid_loop.c"), "-o", str(path)], check=True)
    return ctypes.CDLL(str(path))


def coefficients(numbers: Numbers) -> dict[str, Any]:
    """Return the settings of the handwritten loop by the names of its struct."""
    p = pidemu.Process.from_lags(1.0, [numbers.lag], delay=numbers.delay).sampled(H)
    return {
        "kp": numbers.kp,
        "ki_h": numbers.ki * H,
        "d_decay": numbers.Tf / (numbers.Tf + H),
        "d_gain": -numbers.kd / (numbers.Tf + H),
        "low": 0.0,
        "high": 100.0,
        "growth": p.growth.item(),
        "early": p.early.item(),
        "late": p.late.item(),
        "row": p.row.item(),
        "y_rest": 50.0,
        "u_rest": 50.0,
        "delay": p.scans,
    }


_SETTINGS = ("kp", "ki_h", "d_decay", "d_gain", "low", "high", "growth", "early", "late", "row", "y_rest", "u_rest")
_STATE = ("integral", "derivative", "y_last", "x", "was")
_POINTER = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")


class OneSettings(ctypes.Structure):
    _fields_ = [*((name, ctypes.c_double) for name in _SETTINGS), ("delay", ctypes.c_size_t)]


class OneState(ctypes.Structure):
    _fields_ = [*((name, ctypes.c_double) for name in _STATE), ("ring", ctypes.c_void_p), ("at", ctypes.c_size_t)]


def run_one(c: ctypes.CDLL, numbers: Numbers, sp: Floats, load: Floats, y: Floats, u: Floats) -> None:
    """Run one loop over arrays."""
    settings = OneSettings(**coefficients(numbers))
    ring = np.zeros(settings.delay + 1)
    state = OneState(50.0, 0.0, 50.0, 0.0, 0.0, ring.ctypes.data, 0)
    c.run_one(
        ctypes.byref(settings),
        ctypes.byref(state),
        ctypes.c_size_t(sp.size),
        *(ctypes.c_void_p(x.ctypes.data) for x in (sp, load, y, u)),
    )


_LANES = ctypes.c_double * LOOPS
_STEPS = ("sp", "sp_step", "sp_at", "load_step", "load_at")


class BlockSettings(ctypes.Structure):
    _fields_ = [*((name, _LANES) for name in (*_SETTINGS, *_STEPS)), ("delay", ctypes.c_size_t * LOOPS)]


class BlockState(ctypes.Structure):
    _fields_ = [
        *((name, _LANES) for name in _STATE),
        ("ring", ctypes.c_void_p),
        ("rows", ctypes.c_size_t),
        ("scans", ctypes.c_size_t),
    ]


class CBlocks:
    """Fleets of the handwritten loop, 64 side by side."""

    def __init__(self, c: ctypes.CDLL, numbers: list[Numbers], scans: int) -> None:
        self._c, self._scans = c, scans
        self._blocks = [self._block(numbers[i : i + LOOPS]) for i in range(0, len(numbers), LOOPS)]
        self.y, self.u = (np.empty((scans, LOOPS)) for _ in range(2))

    def _block(self, some: list[Numbers]) -> tuple[BlockSettings, int]:
        filled = [coefficients(n) for n in [*some, *[some[-1]] * (LOOPS - len(some))]]
        settings = BlockSettings()
        for name in (*_SETTINGS, "delay"):
            getattr(settings, name)[:] = [c[name] for c in filled]
        for name, value in zip(_STEPS, (50.0, 10.0, self._scans // 10, 5.0, self._scans // 2), strict=True):
            getattr(settings, name)[:] = [value] * LOOPS
        longest = max(c["delay"] for c in filled)
        return settings, 1 << longest.bit_length()

    def run(self) -> None:
        """Run all blocks; measurement and output of each go where those of the one before went."""
        for settings, rows in self._blocks:
            ring, state = np.zeros((rows, LOOPS)), BlockState()
            state.integral[:] = state.y_last[:] = [50.0] * LOOPS
            state.ring, state.rows, state.scans = ring.ctypes.data, rows, 0
            self._c.run_block(
                ctypes.byref(settings), ctypes.byref(state), ctypes.c_size_t(self._scans),
                ctypes.c_void_p(self.y.ctypes.data), ctypes.c_void_p(self.u.ctypes.data),
            )  # fmt: skip
