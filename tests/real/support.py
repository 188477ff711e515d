"""What the tests of real controllers share: records to run them on, the outputs of the real thing, and how close is close."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats as Floats  # noqa: PLC0414  # the tests take it from here

DATA = Path(__file__).parents[1] / "data"


@dataclass(frozen=True, slots=True)
class Signals:
    """A record, one entry per scan.

    Attributes
    ----------
    sp, pv : ndarray
        Setpoint and measurement [%, or engineering units of that size].
    auto : ndarray
        1 in automatic, 0 in manual.
    manual : ndarray
        The operator's output [%], also while in automatic.
    """

    sp: Floats
    pv: Floats
    auto: Floats
    manual: Floats

    def __len__(self) -> int:
        return self.sp.size

    def part(self, start: int, end: int) -> Signals:
        """Return some of the scans."""
        return Signals(self.sp[start:end], self.pv[start:end], self.auto[start:end], self.manual[start:end])

    def always_auto(self) -> Signals:
        """Return the same signals without manual spells."""
        return Signals(self.sp, self.pv, np.ones(len(self)), self.manual)


class Oracle(Protocol):
    """A controller written down step by step from its documentation, and not from this project.

    Attributes
    ----------
    size : float
        The largest term so far, which differences are measured by.
    """

    size: float

    def scan(self, sp: float, pv: float, auto: bool, manual: float, dt: float) -> float:
        """Return the output of one scan, `dt` seconds after the last."""
        ...


def outputs(oracle: Oracle, record: Signals, dt: float | Floats) -> Floats:
    """Return what an oracle makes of a record, with one interval or one for every scan [s]."""
    intervals = np.broadcast_to(dt, record.sp.shape)
    columns = zip(record.sp, record.pv, record.auto > 0, record.manual, intervals, strict=True)
    return np.array([oracle.scan(float(r), float(y), bool(a), float(m), float(h)) for r, y, a, m, h in columns])


def uneven(seed: int, n: int, dt: float) -> Floats:
    """Return intervals between a quarter of `dt` and twice that [s], in whole milliseconds."""
    return np.random.default_rng(seed).uniform(0.25 * dt, 2 * dt, n).round(3) + 0.001


def signals(seed: int, n: int = 200) -> Signals:
    """Return setpoint steps, a measurement that follows with lag, steps and noise, and spells in manual of 1 to 20 scans.

    With the same seed the record is the same. Steps of up to 80 % drive a controller of ordinary gain to both its limits; every
    second record begins in manual. The numbers have three digits after the point, like those of a real record.
    """
    rng = np.random.default_rng(seed)
    sp, pv, auto, manual = np.empty(n), np.empty(n), np.ones(n), np.empty(n)
    target = value = rng.uniform(20, 80)
    held, bump = rng.uniform(0, 100), 0.0
    for k in range(n):
        if rng.random() < 0.03:
            target = rng.uniform(5, 95)
        if rng.random() < 0.02:
            bump = rng.uniform(-20, 20)
        value += 0.1 * (target + bump - value) + rng.normal(0, 0.3)
        held = min(max(held + rng.normal(0, 4), 0.0), 100.0)
        sp[k], pv[k], manual[k] = target, value, held
    for _ in range(3):
        start = rng.integers(0, n)
        auto[start : start + rng.integers(1, 21)] = 0.0
    auto[: rng.integers(1, 8)] = rng.integers(0, 2)
    return Signals(sp.round(3), pv.round(3), auto, manual.round(3))


def trace(name: str) -> dict[str, Floats]:
    """Return the columns of ``tests/data/<name>.csv``; lines that begin with ``#`` say where it is from."""
    lines = [line for line in (DATA / f"{name}.csv").read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    return {column: rows[:, i] for i, column in enumerate(lines[0].split(","))}


def common_record() -> Signals:
    """Return the record that the traces of real controllers were made on: 300 scans at 0.5 s."""
    columns = trace("real_inputs")
    return Signals(columns["sp"], columns["pv"], columns["auto"], columns["man"])


def close(a: npt.ArrayLike, b: npt.ArrayLike, tolerance: float, size: float = 1.0) -> bool:
    """Tell whether two outputs agree, and raise with the worst scan if not.

    Parameters
    ----------
    a, b : array_like
        What is found and what is expected; NaN and infinity agree with themselves.
    tolerance : float
        Largest difference, as a share of the largest number involved.
    size : float
        The largest term that goes into the outputs, where terms cancel or are cut off; the numbers of `b` count as well.
    """
    found, expected = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    assert found.shape == expected.shape, f"{found.shape} and {expected.shape} scans"
    finite = np.isfinite(expected)
    same = (found == expected) | (np.isnan(found) & np.isnan(expected))
    scale = max([size, *np.abs(expected[finite]).tolist()])
    difference = np.where(same, 0.0, np.where(finite & np.isfinite(found), np.abs(found - expected), np.inf))
    worst = int(np.argmax(difference)) if difference.size else 0
    assert not (difference > tolerance * scale).any(), (
        f"scan {worst} of {found.size}: {found.flat[worst]!r}, expected {expected.flat[worst]!r}; "
        f"the difference is {difference.flat[worst] / scale:.2g} of {scale:.4g}, allowed is {tolerance:g}; "
        f"first beyond it is scan {int(np.argmax(difference > tolerance * scale))}"
    )
    return True
