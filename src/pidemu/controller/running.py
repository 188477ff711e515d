"""A program under way: its functions and states, and what becomes of the states when another program takes over."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from math import nan
from typing import Any, Final

import numpy as np

from pidemu.algorithm.model import Algorithm
from pidemu.backends.choice import Choice, safe_runner
from pidemu.backends.python import Compiled, compiled, in_precision
from pidemu.backends.runner import Runner
from pidemu.columns.functions import isfinite, isnan, plain
from pidemu.errors import ScanError
from pidemu.program.ir import Program, StateRole

_REMEMBERED: Final = 64
"""Programs kept for other scan intervals."""


class Running:
    """A program with its states.

    Parameters
    ----------
    algorithm : callable
        From a scan interval [s] to the algorithm.
    built : callable
        From an algorithm and a scan interval [s] to the program.
    interval : float
        Nominal scan interval [s].
    plain : Program, optional
        The program without terms whose gain is 0, where this one has them all the same.

    Attributes
    ----------
    program : Program
        The program at the nominal interval.
    compiled : Compiled
        Its functions.
    state : list of float
        Its states, in its order and precision; this list is changed in place.
    """

    def __init__(
        self,
        algorithm: Callable[[float], Algorithm],
        built: Callable[[Algorithm, float], Program],
        interval: float,
        plain: Program | None = None,
    ) -> None:
        self.interval, self.plain = interval, plain
        self.program = built(algorithm(interval), interval)
        self.compiled: Compiled = compiled(self.program)
        self.state: list[float] = list(self.compiled.initial)
        self._algorithm, self._built = algorithm, built
        self._places = {q.name: i for i, q in enumerate(self.program.states)}
        self._others: dict[float, Compiled] = {}
        self._runners: dict[Choice, Runner] = {}

    def at(self, h: float) -> Compiled:
        """Return the functions for another scan interval [s].

        Raises
        ------
        ScanError
            The algorithm has another structure there.
        """
        if h == self.interval:
            return self.compiled
        found = self._others.get(h)
        if found is None:
            if len(self._others) >= _REMEMBERED:
                self._others.clear()
            program = self._built(self._algorithm(h), h)
            if [q.name for q in program.states] != list(self._places):
                raise ScanError(
                    f"the algorithm has another structure at a scan interval of {h:g} s; it cannot change while running"
                )
            found = self._others[h] = compiled(program)
        return found

    def runner(self, choice: Choice) -> Runner:
        """Return the functions that run the program over a record."""
        if choice not in self._runners:
            self._runners[choice] = safe_runner(self.program, choice)
        return self._runners[choice]

    def reset(self) -> None:
        """Go back to before the first scan."""
        self.state[:] = self.compiled.initial

    def __contains__(self, name: str) -> bool:
        return name in self._places

    def __getitem__(self, name: str) -> float:
        found: float = plain(self.state[self._places[name]])
        return found

    def __setitem__(self, name: str, value: float) -> None:
        """Set a state, in the program's precision."""
        self.state[self._places[name]] = in_precision(self.program, name, plain(value))

    def named(self) -> dict[str, float]:
        """Return the states by name."""
        return {name: plain(self.state[place]) for name, place in self._places.items()}

    def not_finite(self, state: Sequence[float] | None = None) -> dict[str, float]:
        """Return the states that are not finite numbers, by name; of these states, or of the present ones."""
        return {name: plain(x) for name, x in zip(self._places, state or self.state, strict=True) if not isfinite(x)}

    def inputs(self, last: Mapping[str, float]) -> tuple[float, ...]:
        """Return the program's inputs from signals by name; what is missing is no signal."""
        return tuple(last.get(q.name, 0.0 if q.name == "feedforward" else nan) for q in self.program.inputs)

    def quiet(self) -> contextlib.AbstractContextManager[Any]:
        """Let float32 arithmetic overflow and make NaN without a warning, as the real thing does."""
        return np.errstate(all="ignore") if self.program.precision == "float32" else contextlib.nullcontext()

    def would_be(self, last: Mapping[str, float], name: str = StateRole.OUTPUT) -> float:
        """Return what the next scan would compute under a name; nothing changes."""
        functions = self.compiled if name == StateRole.OUTPUT else compiled(replace(self.program, output=name))
        with self.quiet():
            found: float = plain(functions.scan(list(self.state), *self.inputs(last)))
        return found

    def computes(self, name: str) -> bool:
        """Tell whether the program computes something under a name."""
        return any(assign.name == name for assign in self.program.body)

    def rest(self, sp: float, pv: float, output: float) -> dict[str, float]:
        """Start as if there had been these signals and this output for ever, in automatic; return the signals by name."""
        signals = {"sp": sp, "pv": pv, "auto": 1.0, "manual": nan}
        self.take_over({StateRole.OUTPUT: output}, signals)
        return signals

    def take_over(self, old: Mapping[str, float], last: Mapping[str, float]) -> None:
        """Take over the states of the program before, by name.

        States that it did not have start at rest, from the last signals; an integral that it did not have starts where the output
        stays.

        Parameters
        ----------
        old : mapping
            States by name.
        last : mapping
            The last signals by name; empty before the first scan.
        """
        new = [name for name in self._places if name not in old]
        for name in self._places.keys() & old.keys():
            self[name] = old[name]
        if not last or not new:
            return
        other = self._before_a_scan_that_moves_nothing()
        rest = _resting(other, self._by_hand(last, old[StateRole.OUTPUT]))
        rest |= {
            StateRole.OWN_OUTPUT: old[StateRole.OUTPUT],
            StateRole.BEGUN: 1.0,
            StateRole.MODE: float(last["auto"] > 0 and isnan(last.get("track", nan))),
        }
        for name in new:
            self[name] = rest.get(name, self[name])
        if StateRole.INTEGRAL in new:
            other.reset()
            self[StateRole.INTEGRAL] = self._left_for_the_integral(other, last, old[StateRole.OUTPUT])

    def _before_a_scan_that_moves_nothing(self) -> Running:
        """Return this controller before the first scan, and that one such that it moves nothing."""
        a = self._algorithm(self.interval)
        still = a.at_rest
        if still is not a:
            return Running(lambda _h: still, self._built, self.interval)
        other = copy(self)
        other.state = list(self.compiled.initial)
        return other

    def _by_hand(self, last: Mapping[str, float], u: float) -> dict[str, float]:
        return {**last, "auto": 0.0, "manual": u, "track": nan}

    def _left_for_the_integral(self, other: Running, last: Mapping[str, float], u: float) -> float:
        """Return the integral with which the output stays where it is; `other` is this controller at rest."""
        if StateRole.INTEGRAL not in other:  # a loaded sum without integral action
            self[StateRole.INTEGRAL] = 0.0
            return u - self.would_be(last, "v")
        for name in other.named().keys() & self.named().keys():
            other[name] = self[name]
        for name in {StateRole.MODE, StateRole.BEGUN} & other.named().keys():
            other[name] = float(name == StateRole.BEGUN)
        with other.quiet():
            other.compiled.scan(other.state, *other.inputs(self._by_hand(last, u)))
        return other[StateRole.INTEGRAL]

    def keep_output(self, old: Running, last: Mapping[str, float]) -> None:
        """Move the integral by what the proportional term becomes less, at the last signals: the listing's parameter change."""
        if StateRole.INTEGRAL in self and old.computes("P") and self.computes("P"):
            moved = old.would_be(last, "P") - self.would_be(last, "P")
            if not isnan(moved):
                self[StateRole.INTEGRAL] += moved


def _resting(other: Running, by_hand: Mapping[str, float]) -> dict[str, float]:
    """Return the states of a controller that has had the last signals for ever, in manual."""
    other[StateRole.OUTPUT] = by_hand["manual"]
    with other.quiet():
        other.compiled.scan(other.state, *other.inputs(by_hand))
    return other.named()
