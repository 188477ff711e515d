"""What a scan of a settled loop costs after a million scans, against the first ten thousand.

States must not decay into denormal numbers.

Run with ``python benchmarks/settled.py [CARD...]``; by default every card. The ratio should be 1.
"""

from __future__ import annotations

import statistics
import sys
import time

import numpy as np

import pidemu
from pidemu.checks.runs import plausible
from pidemu.errors import PidemuError

FIRST, ALL, ROUNDS = 10_000, 1_000_000, 5


def seconds_per_scan(controller: pidemu.Controller, pv: np.ndarray) -> float:
    start = time.perf_counter()
    controller.run(50.0, pv)
    return (time.perf_counter() - start) / pv.size


def ratio(card_id: str) -> tuple[float, float]:
    """Return nanoseconds per scan at first, and how many times that at the end of a million settled scans."""
    controller = pidemu.Controller(plausible(pidemu.load_card(card_id).variant({})), initial_output=50.0)
    decay = 50.0 + 10.0 * 0.999 ** np.arange(float(ALL))  # to the setpoint, and through the denormal numbers of the difference
    first = [seconds_per_scan(controller, decay[i * FIRST : (i + 1) * FIRST]) for i in range(ROUNDS)]
    controller.run(50.0, decay[ROUNDS * FIRST :])
    last = [seconds_per_scan(controller, np.full(FIRST, decay[-1])) for _ in range(ROUNDS)]
    return 1e9 * statistics.median(first), statistics.median(last) / statistics.median(first)


def main() -> None:
    for card_id in sys.argv[1:] or pidemu.cards():
        try:
            nanoseconds, times = ratio(card_id)
            print(f"{card_id:<28} {nanoseconds:7.0f} ns per scan at first, {times:5.2f} times that after {ALL:,} scans")
        except PidemuError as error:
            print(f"{card_id:<28} {error}")


if __name__ == "__main__":
    main()
