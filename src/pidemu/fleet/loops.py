"""A loop of a fleet, and what is done to all of them."""

from __future__ import annotations

from dataclasses import dataclass

from pidemu.backends.engine_names import Engine
from pidemu.process.process import Process
from pidemu.settings.action import Action
from pidemu.settings.settings import Settings
from pidemu.simulation.trial import Step, Trial, trial


@dataclass(frozen=True)
class Loop:
    """A controller and its process; what is ``None`` is the fleet's, or is chosen as `pidemu.simulate` does.

    Attributes
    ----------
    tag : str
        Its name, unique in a fleet.
    settings : Settings
        Card and settings of the controller.
    process : Process
        The process, from output [%] to measurement [%].
    scan : float or None
        Scan interval [s].
    setpoint, load : float, tuple of float or None
        Size of a step of setpoint and of load [%], or when [s] and size.
    time : float or None
        How long [s].
    action : {"reverse", "direct"} or None
        Control action.
    output_limits : tuple of float or None
        Low and high output limit [%].
    initial : tuple of float
        Setpoint, measurement and output before [%].
    """

    tag: str
    settings: Settings
    process: Process
    scan: float | None = None
    setpoint: float | Step | None = None
    load: float | Step | None = None
    time: float | None = None
    action: Action | None = None
    output_limits: tuple[float, float] | None = None
    initial: tuple[float, float, float] = (50.0, 50.0, 50.0)


@dataclass(frozen=True)
class FleetPlan:
    """What is done to every loop of a fleet that does not say otherwise.

    Attributes
    ----------
    setpoint, load : float or tuple of float
        Steps, as in `Loop`.
    time : float or None
        How long [s]; by default as long as each loop takes to settle.
    keep : bool
        Keep measurement and output of every scan.
    engine : {"python", "numpy", "numba", "c"} or None
        The engine; by default the quickest for each group.
    margins : bool
        Compute margins and stability of every loop.
    """

    setpoint: float | Step = 10.0
    load: float | Step = 10.0
    time: float | None = None
    keep: bool = False
    engine: Engine | None = None
    margins: bool = True

    def trial(self, loop: Loop) -> Trial:
        """Return the trial of a loop.

        Raises
        ------
        PidemuError
            The loop cannot be run as asked.
        """
        return trial(
            loop.settings,
            loop.process,
            loop.scan,
            setpoint=self.setpoint if loop.setpoint is None else loop.setpoint,
            load=self.load if loop.load is None else loop.load,
            time=self.time if loop.time is None else loop.time,
            action=loop.action,
            output_limits=loop.output_limits,
            initial=loop.initial,
        )
