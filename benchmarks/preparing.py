"""What it takes to prepare a loop of a fleet from the row of a table: each alone, and those of a kind together.

Run with ``python -m benchmarks.preparing [LOOPS]``; by default 10,000. Processor time, in one process. Aimed at: 20 us a loop
together. Of 10,000 loops each bears a ten thousandth of 18 recordings of some 4 ms, one for each structure.
"""

from __future__ import annotations

import random
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import pidemu
from pidemu.fleet.lists import LoopList, PlacedLoops
from pidemu.fleet.loops import FleetPlan
from pidemu.fleet.prepare import Preparation

PLAN = FleetPlan(time=600.0, margins=False)
ALONE = 500
"""Loops that are prepared alone: more of them take the same, each."""
SETTINGS = {
    "generic/standard": "K={a}; Ti={b}; Td={c}",
    "emerson/deltav": "GAIN={a}; RESET={b}; RATE={c}",
    "fisher/provox": "GAIN={a}; RESET={b}; RATE={c} s",
    "honeywell/tdc3000": "K={a}; T1={c}; T2=0.1",
    "bailey/fc19": "K={a}; KP=1; KI={c}; KD=0",
    "arduino/pid": "Kp={a}; Ki={c}; Kd={a}",
}


def table(path: Path, loops: int) -> Path:
    """Write a table of loops of six cards."""
    chance = random.Random(14)
    rows = ["tag,card,settings,process,scan"]
    for i in range(loops):
        card = list(SETTINGS)[i % len(SETTINGS)]
        a, b, c = (f"{x:.4g}" for x in (chance.uniform(0.5, 3), chance.uniform(5, 40), chance.uniform(0.2, 3)))
        rows.append(f'LIC-{i},{card},{SETTINGS[card].format(a=a, b=b, c=c)},"gain={a}, lag={b}, lag={c}, delay={c}",0.5')
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def microseconds(job: Callable[[], object], loops: int) -> float:
    """Return processor time per loop."""
    start = time.process_time()
    job()
    return 1e6 * (time.process_time() - start) / loops


def prepare(loops: LoopList, at_once: int) -> None:
    """Prepare loops, so many at once."""
    preparation, left = Preparation(PLAN), PlacedLoops(loops, range(len(loops)))
    for start in range(0, len(left), at_once):
        for _ in preparation.prepared(left[start : start + at_once]):
            pass


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    with tempfile.TemporaryDirectory() as folder:
        few, many = (table(Path(folder) / f"{n}.csv", n) for n in (ALONE, count))
        loops = pidemu.read_loops(few).loops  # the cards are known now
        prepare(LoopList(loops[i] for i in range(6)), 1)  # and what is compiled for each of them
        made, found = LoopList(loops), pidemu.read_loops(many).loops
        print(f"{count:,} loops of {len(SETTINGS)} cards, us of processor time per loop")
        print(f"{'':<28}{'reading':>10}{'preparing':>11}{'both':>9}{'ratio':>8}")
        times = {
            "each alone": (
                microseconds(lambda: list(pidemu.read_loops(few).loops), ALONE),
                microseconds(lambda: [prepare(LoopList([loop]), 1) for loop in made], ALONE),  # type: ignore[func-returns-value]
            ),
            "those of a kind together": (
                microseconds(lambda: pidemu.read_loops(many), count),
                microseconds(lambda: prepare(found, 8192), count),
            ),
        }
    for name, (reading, preparing) in times.items():
        ratio = (reading + preparing) / sum(times["each alone"])
        print(f"{name:<28}{reading:>10.1f}{preparing:>11.1f}{reading + preparing:>9.1f}{ratio:>8.4f}")


if __name__ == "__main__":
    main()
