"""A valve between output and process that is not ideal, as a part of a loop's program and one scan at a time."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Final

from pidemu.errors import ProcessError
from pidemu.excerpt import quoted
from pidemu.formatting import exactly
from pidemu.plausible import LEVEL, plain_number, plausible
from pidemu.program.blocks import limited, rounded, towards
from pidemu.program.ir import Expr, Name, expr, select
from pidemu.simulation.parts import Parts

_PARTS: Final = ("deadband", "stiction", "resolution")


@dataclass(frozen=True, slots=True)
class Valve:
    """A valve between output and process, or another final element: where it goes, scan by scan, from where it rests.

    The output passes dead band, stiction, resolution and rate, in this order. The valve stands between scans.

    Attributes
    ----------
    deadband : float
        Backlash: how far the output moves after it has turned round before the valve follows [%].
    stiction : float
        The valve stays until the output is farther than this from it, then goes to the output: the model of one parameter of
        Stenman, Gustafsson and Forsman, A segmentation-based method for detection of stiction in control valves (2003) [%].
    resolution : float
        The valve stands at multiples of this from where it rests [%].
    rate : float
        How fast it travels [%/s]; infinite where nothing limits it.

    Raises
    ------
    ProcessError
        A number is negative, the rate is 0, or it is not one that a loop has.
    """

    deadband: float = 0.0
    stiction: float = 0.0
    resolution: float = 0.0
    rate: float = math.inf

    def __post_init__(self) -> None:
        for name in _PARTS:
            value = plausible(f"valve: {name}", getattr(self, name), LEVEL, ProcessError)
            if value < 0:
                raise ProcessError(f"valve: {name} is {value:g} %; give 0 or more")
            object.__setattr__(self, name, value)
        if self.rate == math.inf:
            return
        rate = plausible("valve: rate", self.rate, LEVEL, ProcessError)
        if not rate > 0:
            raise ProcessError(f"valve: with a rate of {rate:g} %/s it never gets anywhere; give one above 0, or leave it out")
        object.__setattr__(self, "rate", rate)

    @property
    def is_ideal(self) -> bool:
        """Whether it goes where the output is, at once."""
        return self.rate == math.inf and not any(getattr(self, name) for name in _PARTS)

    @property
    def text(self) -> str:
        """The valve as `read_valve` takes it."""
        numbers = {name: getattr(self, name) for name in (*_PARTS, "rate")}
        return ",".join(f"{name}={exactly(x)}" for name, x in numbers.items() if x and x != math.inf)


def read_valve(text: str) -> Valve:
    """Read a valve as it is written on a command line.

    Parameters
    ----------
    text : str
        ``NAME=VALUE``, comma-separated, such as ``deadband=1,rate=5``.

    Raises
    ------
    ProcessError
        A name is unknown or comes twice, or a value is not a number that a valve has.

    Examples
    --------
    >>> read_valve("deadband=1, rate=5")
    Valve(deadband=1.0, stiction=0.0, resolution=0.0, rate=5.0)
    """
    names, found = [field.name for field in fields(Valve)], dict[str, float]()
    for item in text.split(","):
        name, equals, value = (part.strip() for part in item.partition("="))
        if not equals or name not in names:
            raise ProcessError(f"valve: '{quoted(item.strip(), 40)}' is not one of {'=..., '.join(names)}=...")
        if name in found:
            raise ProcessError(f"valve: {name} comes twice; give it once")
        try:
            found[name] = plain_number(value)
        except ValueError as error:
            raise ProcessError(f"valve: {name}: {error}") from None
    return Valve(**found)


def valve_position(p: Parts, u: Expr, valve: Valve, rest: Name, scan: float) -> Name:
    """Add a valve to a loop's program, and return where it stands in a scan [%].

    Parameters
    ----------
    p : Parts
        What is added around the controller.
    u : Expr
        The output [%].
    valve : Valve
        The valve.
    rest : Name
        Where it rests before the first scan [%].
    scan : float
        Scan interval [s].
    """
    moved = u - rest
    if valve.deadband:
        half = p.coefficient("valve_play", valve.deadband / 2, "half the dead band")
        geared = p.state("valve_geared", "what has taken up the dead band, from rest on")
        moved = p.then(geared.id, limited(geared, moved - half, moved + half), "dead band of the valve (section 11)")
    if valve.stiction:
        most = p.coefficient("valve_stiction", valve.stiction, "what the valve sticks within")
        stuck = p.state("valve_stuck", "where the valve sticks, from rest on")
        apart = p.then("valve_apart", moved - stuck, "how far the output is from the valve")
        frees = (apart > most) | (apart < expr(0.0) - most)
        moved = p.then(stuck.id, select(frees, moved, stuck), "stiction of the valve (section 11)")
    if valve.resolution:
        step = p.coefficient("valve_step", valve.resolution, "resolution of the valve")
        moved = p.then("valve_stepped", rounded(moved, step), "resolution of the valve (section 11)")
    if valve.rate < math.inf:
        reach = p.coefficient("valve_reach", valve.rate * scan, "what the valve travels in a scan")
        travelled = p.state("valve_travelled", "where the valve is, from rest on")
        moved = p.then(travelled.id, towards(moved, travelled, reach, reach), "rate of the valve (section 11)")
    return p.then("valve", rest + moved, "position of the valve")


class MovingValve:
    """A valve, one scan at a time: the arithmetic of `valve_position`, in its order.

    Parameters
    ----------
    valve : Valve
        The valve.
    rest : float
        Where it rests before the first scan [%].
    scan : float
        Scan interval [s].
    """

    def __init__(self, valve: Valve, rest: float, scan: float) -> None:
        self._valve, self._rest, self._reach = valve, rest, valve.rate * scan
        self._geared = self._stuck = self._travelled = 0.0

    def move(self, u: float) -> float:
        """Return where the valve stands [%] in a scan with an output [%]."""
        valve, moved = self._valve, u - self._rest
        if valve.deadband:
            half = valve.deadband / 2
            low, high = moved - half, moved + half
            moved = self._geared = high if self._geared > high else low if self._geared < low else self._geared
        if valve.stiction:
            if abs(moved - self._stuck) > valve.stiction:
                self._stuck = moved
            moved = self._stuck
        if valve.resolution and math.isfinite(moved):
            moved = math.floor(moved / valve.resolution + 0.5) * valve.resolution
        if valve.rate < math.inf:
            last = self._travelled
            moved = last - self._reach if moved < last - self._reach else moved
            moved = self._travelled = last + self._reach if moved > last + self._reach else moved
        return self._rest + moved
