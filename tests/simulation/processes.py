"""What python-control makes of a process."""

from __future__ import annotations

from typing import Any

import control

from pidemu.process.process import Process
from pidemu.testing.strategies import processes as processes  # noqa: PLC0414  # the tests take it from here


def transfer_function(p: Process) -> Any:
    return control.tf(list(p.rational.num[::-1]), list(p.rational.den[::-1]))
