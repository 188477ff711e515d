"""Fleets to try, and what each of their loops is alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, Final

import numpy as np
import pytest

import pidemu
from pidemu import FleetResult, Loop, Process, Simulation
from pidemu.backends import native
from pidemu.backends.engine_names import ENGINES, Engine
from pidemu.card.library import card_files
from pidemu.checks.runs import plausible
from pidemu.errors import PidemuError
from pidemu.simulation.trial import trial

COMPILER: Final = pytest.mark.skipif(not native.available(), reason="no C compiler on this machine")
EVERY_ENGINE: Final = [pytest.param(e, marks=COMPILER) if e == "c" else e for e in ENGINES]
PROCESSES: Final = (
    Process.from_lags(1.2, [8], delay=2.3),
    Process.from_lags(0.8, [6]),
    Process(1.0, [-0.1 + 0.6j, -0.1 - 0.6j], delay=0.4),
    Process.from_lags(0.1, [2], integrators=1, delay=1.0),
    Process.from_lags(1.0, [5, 3], leads=[-1.5, 1], delay=3.7),
)


def runs(loop: Loop) -> bool:
    try:
        trial(loop.settings, loop.process, loop.scan, time=10, output_limits=(0, 100), action=loop.action).controller()
    except PidemuError:
        return False
    return True


@cache
def mixed() -> tuple[Loop, ...]:
    """Every card at several processes, scan intervals, steps, durations, limits and starts."""
    loops = []
    for n, card_id in enumerate(card_files()):
        settings = plausible(pidemu.load_card(card_id).variant({}))
        for k in range(3):
            process = PROCESSES[(n + k) % len(PROCESSES)]
            loop = Loop(f"{card_id} {k}", settings, process, (0.5, 0.2, 1.0)[k], output_limits=(0, 100))
            loop = loop if runs(loop) else replace(loop, action="reverse")
            own: dict[str, Any] = [
                {},
                {"setpoint": (3.1, -7.5), "load": 0, "initial": (40.0, 40.0, 60.0)},
                {"setpoint": 0, "load": (20, 15.0), "time": 70 + n % 4, "output_limits": (10.5, 77.25)},
            ][k]
            loops.append(replace(loop, **own))
    return tuple(loops)


@cache
def few() -> tuple[Loop, ...]:
    """Some of them, all kinds of arithmetic among them: Numba compiles each card anew."""
    chosen = ("generic/dahlin 1", "oscat/ft-pid 0", "modelica/limpid 2", "toshiba/pid3 0", "mathworks/pid2 1", "emerson/deltav 0")
    found = tuple(loop for loop in mixed() if loop.tag in chosen)
    assert len(found) == len(chosen)
    return found


def alike(count: int, **fields: Any) -> list[Loop]:
    """Loops of one structure, with dead times of 2 to 12 s."""
    card = pidemu.load_card("generic/standard")
    return [
        Loop(
            f"L{i}",
            card.settings(K=0.5 + i / 90, Ti=8.0 + i % 7, Td=0.4, Tf=0.2),
            Process.from_lags(0.9, [5.0 + i % 11], delay=2.0 + i * 7 % 20 / 2),
            **{"scan": 0.5} | fields,
        )
        for i in range(count)
    ]


def alone(loop: Loop, setpoint: Any = 10.0, load: Any = 10.0, time: float | None = None) -> Simulation:
    """Run one loop of a fleet with `pidemu.simulate`, in plain Python."""
    return pidemu.simulate(
        loop.settings,
        loop.process,
        loop.scan,
        setpoint=setpoint if loop.setpoint is None else loop.setpoint,
        load=load if loop.load is None else loop.load,
        time=time if loop.time is None else loop.time,
        action=loop.action,
        output_limits=loop.output_limits,
        initial=loop.initial,
        engine="python",
    )


def check_signals(result: FleetResult, loops: Sequence[Loop], expected: Sequence[Simulation]) -> None:
    """Compare the signals of every loop, bit by bit."""
    for loop, one in zip(loops, expected, strict=True):
        found = result[loop.tag]
        assert np.array_equal(found.output, one.output, equal_nan=True), loop.tag
        assert np.array_equal(found.measurement, one.measurement, equal_nan=True), loop.tag
        assert np.array_equal(found.setpoint, one.setpoint), loop.tag
        assert np.array_equal(found.times, one.times), loop.tag


def check_figures(result: FleetResult, expected: Sequence[Simulation], initial: Sequence[float]) -> None:
    """Compare the figures with those of the signals, which differ by the order of summation at most."""
    columns = result.columns
    for i, one in enumerate(expected):
        start = 0 if one.load_step is None else int(np.argmax(one.times >= one.load_step[0]))
        rounding = one.times.size * float(np.finfo(float).eps)
        assert columns["iae"][i] == pytest.approx(one.iae, rel=rounding)
        assert columns["peak"][i] == np.max(np.abs(one.error[start:]))
        travel = np.sum(np.abs(np.diff(one.output, prepend=initial[i])))
        assert columns["travel"][i] == pytest.approx(travel, rel=rounding, abs=1e-9)  # differences of outputs near 50
        low, high = one.limits
        assert columns["at_low"][i] == pytest.approx(np.sum(one.output <= low) * one.scan, rel=rounding)
        assert columns["at_high"][i] == pytest.approx(np.sum(one.output >= high) * one.scan, rel=rounding)
        assert columns["error"][i] == one.error[-1]
        last_fifth = one.error[-max(10, -(-one.times.size // 5)) :]
        assert columns["swing"][i] == np.max(last_fifth) - np.min(last_fifth)
        assert (result.scan[i], result.scans[i]) == (one.scan, one.times.size)


def same(one: FleetResult, other: FleetResult, tags: Sequence[str]) -> bool:
    """Tell whether two fleets have the same numbers for loops that both have, bit by bit."""
    places = [[[loop.tag for loop in r.loops].index(tag) for tag in tags] for r in (one, other)]
    pairs = [(r.columns[name][p] for r, p in zip((one, other), places, strict=True)) for name in one.columns]
    return all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)


__all__ = ["EVERY_ENGINE", "PROCESSES", "Engine", "alike", "alone", "check_figures", "check_signals", "few", "mixed", "same"]
