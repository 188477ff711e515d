"""How fast a specialised program runs in pure Python, as a multiple of simple-pid doing the same.

Run ``python benchmarks/scan.py``. The same record goes through simple-pid, called with explicit dt, and through the card
``simple-pid/simple-pid``, in turn and several times; the best of each is compared. The outputs must agree to 1e-9.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import simple_pid

import pidemu
from pidemu.backends.python import compiled

SCANS = 200_000
ROUNDS = 7
H = 0.1


def best(jobs: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Return nanoseconds per scan of each job, run in turn."""
    found = dict.fromkeys(jobs, float("inf"))
    for _ in range(ROUNDS):
        for name, job in jobs.items():
            start = time.perf_counter()
            job()
            found[name] = min(found[name], (time.perf_counter() - start) / SCANS * 1e9)
    return found


def main() -> None:
    pv = 50 + 10 * np.random.default_rng(1).standard_normal(SCANS)
    samples, setpoints = pv.tolist(), [50.0] * SCANS
    settings = pidemu.load_card("simple-pid/simple-pid").settings(Kp=2, Ki=0.1, Kd=0.3)
    controller = pidemu.Controller(settings, scan=H, output_limits=(0, 100))
    program = compiled(controller.program)

    def package() -> list[float | None]:
        pid = simple_pid.PID(2, 0.1, 0.3, setpoint=50, sample_time=None, output_limits=(0, 100))
        return [pid(y, dt=H) for y in samples]

    def specialised() -> list[float]:
        state = list(controller.program.initial)
        first = program.scan(state, 50.0, samples[0], 1.0, 0.0)
        return [first, *program.run_automatic(state, setpoints[1:], samples[1:])]

    def arrays() -> object:
        controller.reset()
        return controller.run(50.0, pv)

    def calls() -> list[float]:
        controller.reset()
        return [controller.scan(50.0, y) for y in samples]

    difference = max(abs(a - (b or 0.0)) for a, b in zip(specialised(), package(), strict=True))
    assert difference < 1e-9, difference
    found = best({"simple-pid": package, "program": specialised, "Controller.run": arrays, "Controller.scan": calls})
    for name, ns in found.items():
        print(f"{name:<16} {ns:7.0f} ns per scan   {found['simple-pid'] / ns:5.2f} times as fast as simple-pid")


if __name__ == "__main__":
    main()
