"""Kinds of loops: those of one kind differ in their numbers only."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from pidemu.columns.functions import is_traced
from pidemu.columns.traced import Traced, TracedRoot
from pidemu.fleet.loops import Loop

_STATED: Final = ("scan", "setpoint", "load", "time", "output_limits", "initial")
"""What a loop may state with a number or two, or leave to the fleet."""
_EXACT: Final = 2**53
"""Whole numbers below are the same as floats."""


Kind = tuple[Hashable, ...]
"""What is the same for all loops of a kind."""


@dataclass(frozen=True, slots=True)
class Numbered:
    """A loop as its kind and its numbers.

    Attributes
    ----------
    kind : Kind
        Its kind.
    numbers : list of float
        The values of the dials; gain, dead time, poles and zeros of the process, of a pair the upper one's two parts; then what the
        loop states of scan interval, steps, time, limits and start.
    """

    kind: Kind
    numbers: list[float]


def numbered(loop: Loop) -> Numbered | None:
    """Return kind and numbers of a loop, or ``None`` where it is of a kind of its own: its numbers are no plain ones."""
    settings, process = loop.settings, loop.process
    dials = settings.values_by_name.values()
    numbers: list[Any] = [dial.value for dial in dials]
    numbers += (process.gain, process.delay)
    signs = []
    for root in (*process.poles, *process.zeros):
        sign = 0 if not root.imag else 1 if root.imag > 0 else -1
        signs.append(sign)
        numbers += () if sign < 0 else (root.real, root.imag) if sign else (root.real,)
    stated: list[int | None] = []
    for name in _STATED:
        given = getattr(loop, name)
        several = isinstance(given, tuple)
        stated.append(None if given is None else len(given) if several else 0)
        numbers += given if several else () if given is None else (given,)
    if not all(type(x) is float or type(x) is Traced or (type(x) is int and -_EXACT < x < _EXACT) for x in numbers):
        return None
    kind = (
        settings.variant,
        *(settings.pv_range, settings.op_range, settings.pace, settings.lag, settings.scan),
        tuple((dial.name, dial.unit, dial.spans, dial.given, dial.active) for dial in dials),
        *(len(process.poles), tuple(signs), process.unit),
        *stated,
        loop.action,
    )
    return Numbered(kind, numbers)


def with_numbers(loop: Loop, numbers: Sequence[Any]) -> Loop:
    """Return a loop of the same kind with other numbers, in the order of `Numbered`; they may be traced."""
    left = iter(numbers)
    settings, process = loop.settings, loop.process
    values = {name: replace(dial, value=next(left)) for name, dial in settings.items()}
    gain, delay = next(left), next(left)
    return replace(
        loop,
        settings=replace(settings, values_by_name=values),
        process=process.with_numbers(gain, delay, list(_roots((*process.poles, *process.zeros), left))),
        **{name: _stated(getattr(loop, name), left) for name in _STATED},
    )


def _roots(like: Sequence[complex], left: Iterator[Any]) -> Iterator[Any]:
    """Yield roots of these kinds: real ones, and pairs of which the upper one comes first."""
    upper: tuple[Any, Any] = (0.0, 0.0)
    for root in like:
        if not root.imag:
            yield next(left)
            continue
        upper = (next(left), next(left)) if root.imag > 0 else (upper[0], -upper[1])
        yield TracedRoot(*upper) if is_traced(*upper) else complex(*upper)


def _stated(given: Any, left: Iterator[Any]) -> Any:
    if given is None:
        return None
    return tuple(next(left) for _ in given) if isinstance(given, tuple) else next(left)
