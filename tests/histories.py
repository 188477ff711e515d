"""Records with everything a controller can be given: modes, operators, remote setpoints, outputs to follow, feedforward, holds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pidemu import Controller
from pidemu.algorithm.model import Algorithm
from tests.helpers import Floats

_OPTIONAL = ("manual", "cascade", "track", "external_reset", "feedforward")


@dataclass(frozen=True)
class History:
    """Signals by the names of the arguments of `Controller.run`."""

    columns: dict[str, Floats]

    def scans(self) -> Iterator[dict[str, Any]]:
        """The same as arguments of `Controller.scan`, scan by scan; what is NaN is left out."""
        for n in range(len(self.columns["sp"])):
            now: dict[str, Any] = {name: float(x[n]) for name, x in self.columns.items()}
            for name in _OPTIONAL:
                if math.isnan(now.get(name, 0.0)):
                    del now[name]
            yield now | {name: bool(now[name]) for name in ("auto", "hold") if name in now}

    def run(self, controller: Controller) -> Floats:
        """Run the whole record at once."""
        return controller.run(**self.columns)

    def step(self, controller: Controller) -> list[float]:
        """Run it scan by scan."""
        return [controller.scan(**now) for now in self.scans()]

    def moved(self, **columns: Floats) -> History:
        """The same with some columns in place of others."""
        return History(self.columns | columns)


def history(seed: int, a: Algorithm | None = None, n: int = 80) -> History:
    """A random record; external reset and feedforward where the algorithm `a` takes them. Signals are multiples of 1/1024."""
    rng = np.random.default_rng(seed)

    def spells(p: float, length: int = 6) -> Any:
        return np.repeat(rng.uniform(size=n // length + 1) < p, length)[:n]

    def short(x: Any) -> Floats:
        rounded: Floats = np.round(x * 1024) / 1024
        return rounded

    sp = short(np.repeat(rng.uniform(30, 70, n // 20 + 1), 20)[:n])
    columns = {
        "sp": sp,
        "pv": short(0.5 * sp + 25 + np.cumsum(rng.normal(0, 2, n))),
        "auto": spells(0.7).astype(float),
        "manual": np.where(rng.uniform(size=n) < 0.5, rng.uniform(5, 95, n), math.nan),
        "cascade": np.where(spells(0.3), short(rng.uniform(30, 70, n)), math.nan),
        "track": np.where(spells(0.15), rng.uniform(5, 95, n), math.nan),
        "hold": (rng.uniform(size=n) < 0.08).astype(float),
    }
    if a is not None and a.integral.windup.scheme == "external-reset":
        columns["external_reset"] = np.where(spells(0.4), rng.uniform(0, 100, n), math.nan)
    if a is not None and a.feedforward is not None:
        columns["feedforward"] = np.where(spells(0.6), rng.uniform(-5, 5, n), math.nan)
    return History(columns)
