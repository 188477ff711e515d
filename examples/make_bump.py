"""Writes ``bump.csv``, the record of a bump test on a computed process with noise.

Run as ``python examples/make_bump.py``.
"""

from __future__ import annotations

import random
from pathlib import Path

from pidemu.process.hold import Plant
from pidemu.process.process import Process

PROCESS = Process.from_lags(1.2, [18, 4], delay=6)
NOISE, SEED = 0.05, 3


def record() -> str:
    """Return the record's text."""
    plant, noise = Plant(PROCESS.sampled(1.0)), random.Random(SEED)
    lines = ["time,op,pv"]
    for t in range(301):
        op = 45 if 20 <= t < 160 else 40
        pv = 52 + plant.measure() + noise.gauss(0, NOISE)
        lines.append(f"{t},{op},{pv:.2f}")
        plant.move(op - 40)
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    (Path(__file__).parent / "bump.csv").write_text(record(), encoding="utf-8", newline="\n")
