"""Kinds of inputs whose faults are planted, for tests of the harness; processes of its own import them from here."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from random import Random

from tools.fuzz.case import Case, Kind, Said
from tools.fuzz.failures import Breach


def make(rng: Random) -> Case:
    """Return a file of numbers; in a tenth of the inputs one line is bad."""
    lines = [str(rng.randint(0, 99)) for _ in range(30)]
    if rng.random() < 0.1:
        lines[rng.randrange(30)] = "a bad line"
    return Case(("planted", "numbers.txt", "--much", "--more"), {"numbers.txt": "\n".join(lines).encode()}, limit=0.3)


def is_bad(case: Case) -> bool:
    return b"bad" in case.files.get("numbers.txt", b"")


def crash(case: Case) -> int:
    if is_bad(case):
        raise ZeroDivisionError("planted")
    return 0


def spin(case: Case) -> int:
    while is_bad(case):
        pass
    return 0


def sleep(case: Case) -> int:
    if is_bad(case):
        time.sleep(3600)
    return 0


def die(case: Case) -> int:
    if is_bad(case):
        os._exit(3)
    return 0


def paint(case: Case) -> int:
    print("\x1b[31mred" if is_bad(case) else "plain")
    return 0


def destroy(case: Case) -> int:
    if is_bad(case):
        Path("numbers.txt").write_text("")
    return 0


def litter(case: Case) -> int:
    if is_bad(case):
        Path("tmp8f3a").write_text("half a result")
    return 0


def fail_silently(case: Case) -> int:
    return int(is_bad(case))


def flood(case: Case) -> int:
    print("no " * 100_000 if is_bad(case) else "", file=sys.stderr)
    return 0


def lose_a_row(case: Case, _said: Said) -> None:
    if is_bad(case):
        raise Breach("row lost", "planted", "29 rows of 30")


def well(_case: Case) -> int:
    return 0


RUNS: dict[str, Callable[[Case], int]] = {
    f.__name__: f for f in (crash, spin, sleep, die, paint, destroy, litter, fail_silently, flood)
}
EXPECTED = {
    "crash": ("ZeroDivisionError", "tests/tools/planted.py"),
    "spin": ("over 0.3 s", "pidemu planted"),
    "sleep": ("hangs", "planted.py"),
    "die": ("died", "?"),
    "paint": ("control character", "pidemu planted: stdout"),
    "destroy": ("file destroyed", "pidemu planted"),
    "litter": ("file left behind", "pidemu planted"),
    "fail_silently": ("fails without a word", "pidemu planted"),
    "flood": ("floods stderr", "pidemu planted"),
}
"""What the harness says of each: what, and where."""


def kind(name: str) -> Kind:
    """Return the kind whose fault has a name."""
    return Kind("planted", make, run=RUNS[name])
