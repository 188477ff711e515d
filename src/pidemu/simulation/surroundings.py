"""What a loop has around controller and process."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pidemu.process.process import Process
from pidemu.simulation.noise import Noise
from pidemu.simulation.valve import Valve


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What is around controller and process; by default nothing.

    Attributes
    ----------
    noise : Noise or None
        Noise on the measurement.
    valve : Valve or None
        The valve; ``None`` where the output reaches the process as it is.
    load_process : Process or None
        From the load [%] to the measurement [%], where the load does not go the process's way.
    setpoint_time, load_time : float
        How long setpoint and load take to move [s]; 0 for a step.
    """

    noise: Noise | None = None
    valve: Valve | None = None
    load_process: Process | None = None
    setpoint_time: float = 0.0
    load_time: float = 0.0


NOTHING_ELSE: Final = Surroundings()
"""A controller and a process alone, and steps."""
