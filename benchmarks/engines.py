"""What a scan costs in each engine, as a multiple of the same loop written by hand in C.

Run ``python -m benchmarks.engines [--quick] [--no-cluster]`` in the repository, with the extras ``fast``, ``cluster`` and ``test``,
and a C compiler. All jobs of a table run in turn, several times, in one process, and the best of each counts, so that a busy
machine disturbs all alike. Every engine's outputs are compared with those of the handwritten C first: they must be equal.

The loop is a positional PID with filtered derivative, conditional integration and clamp, and a first-order process with dead time.
The handwritten C is ``c/pid_loop.c``.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import advanced_pid
import control
import numpy as np
import numpy.typing as npt
import scipy.signal
import simple_pid

import pidemu
from benchmarks.handwritten import CBlocks, H, Numbers, library, program, run_one, stepping
from pidemu.backends.choice import block, runner
from pidemu.backends.engine_names import Engine
from pidemu.backends.python import starting
from pidemu.backends.runner import Run
from pidemu.program.ir import Program

Floats = npt.NDArray[np.float64]
Job = Callable[[], object]
POOL = ThreadPoolExecutor(2)
PLAIN = ("-O3", "-ffp-contract=off")
BLOCKS = ("-O3", "-march=native", "-ffp-contract=off", "-fno-trapping-math")


def best(jobs: dict[str, Job], rounds: int) -> dict[str, float]:
    """Return the shortest time of each job [s], run in turn after a first round that does not count."""
    found = dict.fromkeys(jobs, float("inf"))
    for number in range(rounds + 1):
        for name, job in jobs.items():
            start = time.perf_counter()
            job()
            spent = time.perf_counter() - start
            if number:
                found[name] = min(found[name], spent)
    return found


def told(title: str, spent: dict[str, float], scans: dict[str, float], base: str, wanted: dict[str, str]) -> None:
    """Print a table: nanoseconds per scan, and the ratio to the base."""
    per = {name: seconds / scans[name] * 1e9 for name, seconds in spent.items()}
    print(f"\n{title}")
    for name, ns in per.items():
        print(f"  {name:<44} {ns:9.2f} ns   {ns / per[base]:8.2f}   {wanted.get(name, '')}".rstrip())


def signals(scans: int) -> tuple[Floats, Floats]:
    n = np.arange(scans)
    return np.where(n >= scans // 10, 60.0, 50.0), np.where(n >= scans // 2, 5.0, 0.0)


def begun(p: Program) -> list[Any]:
    return [*starting(p), *(deque([0.0] * d) for d in p.lengths)]


def _run_again(run: Run, p: Program, sp: Floats, load: Floats) -> Floats:
    return run(begun(p), [sp, load], sp.size)


def one_loop(scans: int, slow: int, rounds: int) -> None:
    """One loop over a long record."""
    p, c = program(), library(*PLAIN)
    sp, load = signals(scans)

    def by_hand() -> tuple[Floats, Floats]:
        u, y = np.empty((2, scans))
        run_one(c, Numbers(), sp, load, y, u)
        return u, y

    jobs: dict[str, Job] = {"C by hand": by_hand}  # its arrays are made anew each time, as the others' are
    u, y = by_hand()
    kept = np.empty((2, scans))
    jobs["C by hand, into arrays that are there"] = lambda: run_one(c, Numbers(), sp, load, *kept)
    engines: dict[str, Engine] = {"C generated": "c", "numba": "numba", "python": "python"}
    for name, engine in engines.items():
        run = runner(p, engine).run
        found = run(begun(p), [sp, load], scans)
        assert (found[0] == u).all()
        assert (found[1] == y).all()
        jobs[name] = partial(_run_again, run, p, sp, load)
    jobs |= {
        "simple-pid, process in Python": lambda: with_package(simple_pid_step(), slow),
        "advanced-pid, process in Python": lambda: with_package(advanced_pid_step(), slow),
        "python-control forced_response (linear)": lambda: control.forced_response(*linear_loop(), U=sp[:slow]),
        "scipy lfilter (linear, closed loop)": lambda: scipy.signal.lfilter(*transfer_function(), sp),
    }
    counts = dict.fromkeys(jobs, float(scans)) | {n: float(slow) for n in jobs if "pid" in n or "control" in n}
    spent = best(jobs, rounds)
    wanted = {"C generated": "at most 0.85", "numba": "at most 1.2", "python": "at most 60"}
    told(f"One loop, {scans:,} scans ({slow:,} for packages)", spent, counts, "C by hand, into arrays that are there", wanted)
    times = spent["simple-pid, process in Python"] / slow / (spent["python"] / scans)
    print(f"  python is {times:.1f} times as fast as simple-pid (at least 5)")


def with_package(step: Callable[[float, float], float], scans: int) -> list[float]:
    """Close the loop of a package's controller with the process, as one would in Python."""
    sp, load = (s.tolist() for s in signals(scans))
    model = pidemu.Process.from_lags(1.0, [Numbers().lag], delay=Numbers().delay).sampled(H)
    growth, late = model.growth.item(), model.late.item()
    waiting, x, outputs = deque([0.0] * model.scans), 0.0, []
    for r, d in zip(sp, load, strict=True):
        u = step(r, 50.0 + x)
        waiting.append(u - 50.0 + d)
        x += growth * x + late * waiting.popleft()
        outputs.append(u)
    return outputs


def simple_pid_step() -> Callable[[float, float], float]:
    n = Numbers()
    pid = simple_pid.PID(n.kp, n.ki, n.kd, setpoint=50, sample_time=None, output_limits=(0, 100), differential_on_measurement=True)

    def step(r: float, y: float) -> float:
        pid.setpoint = r
        return pid(y, dt=H) or 0.0

    return step


def advanced_pid_step() -> Callable[[float, float], float]:
    n = Numbers()
    pid = advanced_pid.PID(n.kp, n.ki, n.kd, n.Tf)
    pid.set_output_limits(0, 100)
    clock = iter(range(10**9))
    return lambda r, y: float(pid.integrate(next(clock) * H, r - y))


def transfer_function() -> tuple[Floats, Floats]:
    """Return the closed loop from setpoint to measurement, without limits, as polynomials in ``z^-1``."""
    n, h = Numbers(), H
    model = pidemu.Process.from_lags(1.0, [n.lag], delay=n.delay).sampled(h)
    decay = n.Tf / (n.Tf + h)
    minus, settled = np.array([1.0, -1.0]), np.array([1.0, -decay])
    pi = np.polymul([n.kp + n.ki * h, -n.kp], settled)
    feedback = np.polyadd(pi, np.polymul(minus, minus) * n.kd / (n.Tf + h))
    process_num = np.r_[np.zeros(model.scans + 1), model.late.item()]
    process_den = np.array([1.0, -(1 + model.growth.item())])
    num = np.convolve(process_num, pi)
    den = np.convolve(np.convolve(minus, settled), process_den)
    loop = np.convolve(process_num, feedback)
    den = np.r_[den, np.zeros(loop.size - den.size)] + loop
    return num, den


def linear_loop() -> tuple[Any, None]:
    num, den = transfer_function()
    size = max(num.size, den.size)
    return control.ss(control.tf(np.r_[num, np.zeros(size - num.size)], np.r_[den, np.zeros(size - den.size)], H)), None


def fleet(loops: int, scans: int, rounds: int) -> None:
    """Many loops side by side: the scans alone, without what it takes to prepare them."""
    chance = np.random.default_rng(1)
    kinds = [
        Numbers(kp=2 + 0.2 * chance.random(), lag=10 + chance.random(), delay=H * int(chance.integers(2, 20))) for _ in range(640)
    ]
    numbers = sorted((kinds[i % len(kinds)] for i in range(loops)), key=lambda n: n.delay)
    programs = {n: stepping(n, scans) for n in kinds}
    by_hand = CBlocks(library(*BLOCKS), numbers, scans)
    halves = [CBlocks(library(*BLOCKS), numbers[i::2], scans) for i in range(2)]
    jobs: dict[str, Job] = {
        "C by hand, blocks of 64, one core": by_hand.run,
        "C by hand, two cores": lambda: list(POOL.map(CBlocks.run, halves)),
    }
    goals, wanted = {"c": "at most 1.2", "numba": "at most 2.0", "numpy": "at most 15"}, dict[str, str]()
    engines: tuple[Engine, ...] = ("c", "numba", "numpy")
    for engine in engines:
        run = Blocks([programs[n] for n in numbers], scans, engine)
        run(1)
        by_hand.run()
        assert (run.records[0, :, : len(numbers) % run.width or run.width][:, -1] == by_hand.u[:, (len(numbers) - 1) % 64]).all()
        name = f"{engine}, blocks of {run.width}, one core"
        jobs[name] = partial(run, 1)
        wanted[name] = goals[engine]
        if engine != "numpy":
            jobs[f"{engine}, two cores"] = partial(run, 2)
    spent = best(jobs, rounds)
    counts = dict.fromkeys(jobs, float(loops * scans))
    names = list(jobs)
    told(f"{loops:,} loops, {scans:,} scans, per loop and scan", spent, counts, names[0], wanted)
    gains = [f"{what} {spent[names[k]] / spent[names[k + 1]]:.2f}" for what, k in (("C by hand", 0), ("c", 2), ("numba", 4))]
    print(f"  times as fast on two cores as on one (at least 1.7): {', '.join(gains)}")


class Blocks:
    """A fleet of one structure, ready to run in an engine."""

    def __init__(self, programs: list[Program], scans: int, engine: Engine) -> None:
        self._function, self.width = block(programs[0].structure, engine)
        self._scans = scans
        self._parts = [self._arrays(programs[i : i + self.width]) for i in range(0, len(programs), self.width)]
        self._rows = [np.empty((2, scans, self.width)) for _ in range(2)]
        self.records = self._rows[0]

    def _arrays(self, some: list[Program]) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
        filled = [*some, *[some[-1]] * (self.width - len(some))]
        values, states, lengths = (
            np.array([getattr(p, what) for p in filled]).T.copy() for what in ("values", "initial", "lengths")
        )
        return values, states, lengths

    def __call__(self, cores: int) -> None:
        if cores == 1:
            self._share(self._parts, self.records)
        else:
            list(POOL.map(lambda i: self._share(self._parts[i::cores], self._rows[i]), range(cores)))

    def _share(self, parts: list[Any], records: Floats) -> None:
        for values, states, lengths in parts:
            rings = np.zeros((1, int(lengths.max()) + 1, self.width))
            self._function(values, states.copy(), np.empty((0, self._scans, self.width)), rings, lengths, 0, records)


def lengths(rounds: int, quick: bool) -> None:
    """The cost of a scan against the length of the run."""
    p = program()
    run = runner(p, "numba").run
    jobs: dict[str, Job] = {}
    counts: dict[str, float] = {}
    for scans in (10**4, 10**5, 10**6) if quick else (10**4, 10**5, 10**6, 10**7):
        sp, load = signals(scans)
        jobs[f"{scans:>10,} scans"] = partial(_run_again, run, p, sp, load)
        counts[f"{scans:>10,} scans"] = float(scans)
    told(
        "Numba, one loop, by length of the run",
        best(jobs, rounds),
        counts,
        f"{10**5:>10,} scans",
        {f"{10**7:>10,} scans": "at most 1.1"},
    )


def cluster(loops: int, scans: int) -> None:
    """A fleet from settings to figures: on this machine, and on Dask with one and two workers."""
    from distributed import LocalCluster

    card, chance = pidemu.load_card("generic/parallel"), np.random.default_rng(1)
    fleet = pidemu.Fleet(
        pidemu.Loop(
            f"L{i}",
            card.settings(kp=2 + 0.2 * chance.random(), ki=0.2, kd=1, Tf=0.5, c=0),
            pidemu.Process.from_lags(1.0, [10 + chance.random()], delay=1 + int(chance.integers(10))),
            scan=H,
        )
        for i in range(loops)
    )
    time_ = (scans - 1) * H
    spent = {}
    start = time.perf_counter()
    here = fleet.simulate(time=time_, engine="numba")
    spent["this process"] = time.perf_counter() - start
    for workers in (1, 2):
        with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as made:  # type: ignore[no-untyped-call]
            start = time.perf_counter()
            found = fleet.simulate(time=time_, engine="numba", cluster=made)
            spent[f"Dask, {workers} worker{'s' if workers > 1 else ''}"] = time.perf_counter() - start
        assert (found.columns["iae"] == here.columns["iae"]).all()
    print(f"\n{loops:,} loops of {scans:,} scans, from settings to figures")
    for name, seconds in spent.items():
        print(f"  {name:<44} {seconds:9.1f} s    {seconds / loops * 1e6:8.0f} us per loop   {seconds / spent['this process']:6.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--quick", action="store_true", help="a tenth of the work: figures are rough")
    parser.add_argument("--no-cluster", action="store_true", help="leave Dask out, which takes minutes")
    given = parser.parse_args()
    less = 10 if given.quick else 1
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.2f} before; last in a line: its ratio to the line with 1.00")
    one_loop(10**6 // less, 2 * 10**5 // less, 9)
    fleet(10**4 // less, 1000, 9)
    lengths(5, given.quick)
    if not given.no_cluster:
        cluster(10**5 // less, 1000)


if __name__ == "__main__":
    main()
