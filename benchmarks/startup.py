"""How long whole commands take, as a multiple of importing NumPy, pydantic and PyYAML.

Run ``python -m benchmarks.startup`` in an environment where pidemu is installed and byte-compiled (a machine that forbids this, as
with ``PYTHONDONTWRITEBYTECODE``, measures the compiler of Python instead). Cards are compiled before, as in a wheel. All processes
take turns, so that a noisy machine disturbs all of them alike; what counts is CPU time, the least of all rounds.
"""

from __future__ import annotations

import subprocess
import sys
import time

from pidemu.card.library import builtin_folder

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

BASE = [sys.executable, "-c", "import numpy, pydantic, yaml"]
PIDEMU = [sys.executable, "-m", "pidemu"]
CONVERT = [*PIDEMU, "convert", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav"]
COMMANDS = {
    "pidemu --help": ([*PIDEMU, "--help"], 0.8),
    "pidemu cards": ([*PIDEMU, "cards"], 0.8),
    "pidemu show": ([*PIDEMU, "show", "fisher/provox"], 0.8),
    "pidemu check, again": ([*PIDEMU, "check", str(builtin_folder() / "fisher" / "provox.yaml")], 0.8),
    "pidemu convert": (CONVERT, 1.5),
    "  with scans and process": ([*CONVERT, "--scan", "1,0.5", "--process", "gain=1,lag=10,delay=2"], 2.0),
}
"""What is measured, and what is aimed at."""
ROUNDS = 15


def seconds(command: list[str]) -> float:
    """Return the CPU time of a process, or what the clock says where nobody counts that of other processes [s]."""
    if resource is None:
        start = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return time.perf_counter() - start
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    commands = [BASE, *(command for command, _ in COMMANDS.values())]
    for command in commands:
        seconds(command)  # compiles modules and cards
    rounds = [[seconds(command) for command in commands] for _ in range(ROUNDS)]
    base, *found = (min(column) for column in zip(*rounds, strict=True))
    print(f"import numpy, pydantic, yaml   {1000 * base:7.0f} ms")
    for (name, (_, aim)), least in zip(COMMANDS.items(), found, strict=True):
        print(f"{name:30} {1000 * least:7.0f} ms {least / base:7.2f}   (at most {aim:g})")


if __name__ == "__main__":
    main()
