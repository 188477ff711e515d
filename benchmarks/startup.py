"""How long a whole ``pidemu convert`` takes, as a multiple of importing what it is built on.

Run ``python benchmarks/startup.py`` in an environment where pidemu is installed and byte-compiled. Both processes alternate, so
that a noisy machine disturbs both; the ratio of the medians is printed, with the spread of the ratio of neighbours.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

BASE = [sys.executable, "-c", "import numpy, pydantic, yaml"]
CONVERT = [sys.executable, "-m", "pidemu", "convert", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav"]
ROUNDS = 25


def seconds(command: list[str]) -> float:
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def main() -> None:
    for command in (BASE, CONVERT):
        seconds(command)  # warm the file cache
    pairs = [(seconds(BASE), seconds(CONVERT)) for _ in range(ROUNDS)]
    base, convert = (statistics.median(column) for column in zip(*pairs, strict=True))
    ratios = sorted(c / b for b, c in pairs)
    print(f"import numpy, pydantic, yaml   {1000 * base:7.0f} ms")
    print(f"pidemu convert                 {1000 * convert:7.0f} ms")
    low, high = ratios[ROUNDS // 4], ratios[3 * ROUNDS // 4]
    print(f"ratio of medians               {convert / base:7.2f}   (quartiles {low:.2f} to {high:.2f}; at most 2.5)")


if __name__ == "__main__":
    main()
