"""Writes ``record.csv``: pidemu's PROVOX controller on a simulated process, so that the record is reproduced to the last bit.

Run as ``python examples/make_record.py``.
"""

from __future__ import annotations

import math
from collections import deque
from pathlib import Path

import pidemu

SCANS = 120
GAIN, LAG, DELAY = 0.8, 40.0, 3
"""Process: gain [%/%], time constant [s], dead time [s]."""

HEAD = """\
# The output column is pidemu's own: fisher/provox GAIN=2 RESET=4 RATE=0.1, scan 1 s, reverse acting, limits 0 to 100.
# The process is simulated: gain 0.8, time constant 40 s, dead time 3 s; the transmitter resolves 0.01 %.
# Setpoint step after 10 s, load disturbance from 45 s, manual from 75 to 89 s. To check:
# pidemu run fisher/provox GAIN=2 RESET=4 RATE=0.1 --scan 1 --record examples/record.csv
sp,pv,auto,manual,output
"""


def record() -> str:
    """Return the record's text."""
    settings = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
    controller = pidemu.Controller(settings, scan=1.0, initial_output=40.0)
    pole = math.exp(-1 / LAG)
    level = 50.0
    pipe = deque([40.0] * DELAY)
    lines = []
    for n in range(SCANS):
        load = -8.0 if n >= 45 else 0.0
        sp, pv = (55.0 if n >= 10 else 50.0), round(level, 2)
        auto = not 75 <= n < 90
        manual = 56.0 if n < 82 else 60.0
        output = controller.scan(sp, pv, auto, None if auto else manual)
        lines.append(f"{sp:g},{pv:g},{auto:d},{'' if auto else f'{manual:g}'},{output!r}")
        pipe.append(output)
        level = pole * level + (1 - pole) * (50.0 + GAIN * (pipe.popleft() - 40.0) + load)
    return HEAD + "\n".join(lines) + "\n"


if __name__ == "__main__":
    Path(__file__).with_name("record.csv").write_text(record(), encoding="utf-8", newline="\n")
