"""How a controller of the user's own is made, and driven scan by scan or over arrays."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Final

from pidemu.errors import PidemuError
from pidemu.plausible import number, shown
from pidemu.settings.action import Action
from pidemu.settings.settings import Settings
from pidemu.testing.record import ScanSignals, SignalRecord

_ABOUT: Final = ("settings", "scan", "limits", "action", "initial_output")
_SIGNALS: Final = ("sp", "pv", "auto", "manual")
_METHODS: Final = ("scan", "step", "update")


class AdapterError(PidemuError):
    """A controller of the user's own cannot be made or driven."""


@dataclass(frozen=True, slots=True)
class MadeFor:
    """What a controller is made for.

    Attributes
    ----------
    settings : Settings or None
        Its settings; ``None`` where none are compared with.
    scan : float or None
        Scan interval [s].
    limits : tuple of float or None
        Output limits.
    action : {"reverse", "direct"}
        Control action.
    initial_output : float
        Output before the first scan.
    """

    settings: Settings | None
    scan: float | None
    limits: tuple[float, float] | None
    action: Action
    initial_output: float


@dataclass(frozen=True, slots=True)
class OverArrays:
    """A function over whole records; `over_arrays` makes it."""

    function: Callable[..., Iterable[Any]]


def over_arrays(function: Callable[..., Iterable[Any]]) -> OverArrays:
    """Return a controller that computes a whole record at once.

    Parameters
    ----------
    function : callable
        Called with those of ``settings``, ``scan``, ``limits``, ``action``, ``initial_output``, and of the lists ``sp``, ``pv``,
        ``auto`` and ``manual`` (a float for each scan; ``None`` where the operator sets nothing) that it names; returns
        an output for each scan. It is not given changes of settings.
    """
    return OverArrays(function)


def outputs_of(mine: Any, asked: MadeFor, record: SignalRecord) -> list[float]:
    """Return what a user's controller makes of a record, made anew.

    Parameters
    ----------
    mine : callable or OverArrays
        What makes the controller: see `pidemu.testing.assert_equals`.
    asked : MadeFor
        What it is made for.
    record : SignalRecord
        The scans.

    Raises
    ------
    AdapterError
        It cannot be made or driven so, or an output is not a number.
    """
    if isinstance(mine, OverArrays):
        if record.changes:
            raise AdapterError("a function over arrays is not told of changed settings; leave 'changes' out of the modes")
        found = list(_called(mine.function, _about(asked) | {name: getattr(record, name) for name in _SIGNALS}))
        if len(found) != len(record.scans):
            raise AdapterError(
                f"{_name(mine)} returned {len(found)} outputs for {len(record.scans)} scans; return one for each scan"
            )
        return [_output(mine, u, n) for n, u in enumerate(found)]
    controller = _made(mine, asked)
    scan = _method(mine, controller)
    found = []
    for n, signals in enumerate(record.scans):
        if signals.changes is not None:
            _change(mine, controller, signals.changes)
        found.append(_output(mine, _scanned(scan, signals), n))
    return found


def name_of(mine: Any) -> str:
    """Return what a user's controller is called in a report."""
    return _name(mine)


def _about(asked: MadeFor) -> dict[str, Any]:
    return {name: getattr(asked, name) for name in _ABOUT}


def _made(mine: Any, asked: MadeFor) -> Any:
    """Make the controller: with what its maker names, or with the settings where it has one other argument."""
    if not callable(mine):
        raise AdapterError(
            f"{shown(mine)} makes no controllers; give a class, or a function that takes the settings and returns one"
        )
    names = _parameters(mine)
    if {"sp", "pv"} <= set(names):
        raise AdapterError(
            f"{_name(mine)} takes sp and pv itself, and would keep its state from one try to the next; give what makes it, "
            f"such as lambda settings: {_name(mine)}, or over_arrays({_name(mine)}) where it takes whole records"
        )
    if not set(names) & set(_ABOUT):
        needed = [p for p in _signature(mine) if p.default is p.empty and p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
        if len(needed) == 1:
            return mine(asked.settings)
    return _called(mine, _about(asked))


def _method(mine: Any, controller: Any) -> Callable[..., Any]:
    """Return what does a scan of a controller."""
    for name in _METHODS:
        if callable(method := getattr(controller, name, None)):
            return method  # type: ignore[no-any-return]
    if callable(controller):
        return controller  # type: ignore[no-any-return]
    raise AdapterError(
        f"{_name(mine)} made {shown(controller)}, which has no method {', '.join(_METHODS)} and cannot be called; "
        f"give the controller a method scan(sp, pv)"
    )


def _scanned(scan: Callable[..., Any], signals: ScanSignals) -> Any:
    names = _parameters(scan)
    if not {"sp", "pv"} & set(names):
        return scan(signals.sp, signals.pv)
    return scan(**{name: getattr(signals, name) for name in _SIGNALS if name in names})


def _change(mine: Any, controller: Any, settings: Settings) -> None:
    change = getattr(controller, "change", None)
    if not callable(change):
        raise AdapterError(
            f"what {_name(mine)} made has no method change(settings); give it one, or leave 'changes' out of the modes"
        )
    change(settings)


def _called(function: Callable[..., Any], offered: dict[str, Any]) -> Any:
    """Call a function with what it names of what is offered."""
    parameters = _signature(function)
    if any(p.kind is p.VAR_KEYWORD for p in parameters):
        return function(**offered)
    return function(**{p.name: offered[p.name] for p in parameters if p.name in offered})


def _signature(function: Any) -> list[inspect.Parameter]:
    try:
        return list(inspect.signature(function).parameters.values())
    except (TypeError, ValueError):  # written in another language
        return []


def _parameters(function: Any) -> list[str]:
    return [p.name for p in _signature(function)]


def _output(mine: Any, given: Any, scan: int) -> float:
    """Return an output as a number, which may be NaN or infinite."""
    scalar = given.item() if hasattr(given, "item") and getattr(given, "size", 1) == 1 else given
    try:
        return number(scalar)
    except ValueError:
        remedy = "return the output" if given is None else "return the output as a number"
        raise AdapterError(f"{_name(mine)} returned {shown(given)} in scan {scan}; {remedy}") from None


def _name(mine: Any) -> str:
    function = mine.function if isinstance(mine, OverArrays) else mine
    return str(getattr(function, "__name__", type(function).__name__))


def differs(ours: float, theirs: float, tolerance: float) -> bool:
    """Tell whether two outputs are farther apart than a tolerance; NaN equals NaN."""
    if math.isnan(ours) or math.isnan(theirs):
        return math.isnan(ours) != math.isnan(theirs)
    return not (ours == theirs or abs(ours - theirs) <= tolerance)
