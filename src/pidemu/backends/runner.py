"""What every back end makes of a program: functions for one loop over a record, and for a block of loops side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from pidemu.arrays import Floats, Integers

Run = Callable[[list[Any], Sequence[Floats], int], Floats]


@dataclass(frozen=True, slots=True)
class Runner:
    """A program that runs one loop over a record.

    Attributes
    ----------
    run : callable
        ``run(state, signals, scans)``: so many scans. `state` is a list as `pidemu.backends.python.starting` and the program's
        delay lines (deques) make it, and is changed in place; `signals` holds an array of shape (scans,) per input. Returns an
        array of shape (recorded names, scans).
    run_automatic : callable
        The same for scans after the first automatic one, with the signals in `read_in_automatic`.
    read_in_automatic : tuple of str
        Inputs that `run_automatic` reads, in its order.
    """

    run: Run
    run_automatic: Run
    read_in_automatic: tuple[str, ...]


class Block(Protocol):
    """A program structure that runs loops side by side."""

    def __call__(
        self,
        values: Floats,
        states: Floats,
        signals: Floats,
        rings: Floats,
        lengths: Integers,
        at: int,
        records: Floats,
    ) -> None:
        """Do scans of all loops of a block.

        Parameters
        ----------
        values : ndarray, shape (coefficients, loops)
            The coefficients.
        states : ndarray, shape (states, loops)
            The states, changed in place.
        signals : ndarray, shape (inputs, scans, loops)
            The inputs.
        rings : ndarray, shape (delay lines, rows, loops)
            What is under way in the delay lines, changed in place; zeros at first. More rows than any delay has scans.
        lengths : ndarray of int, shape (delay lines, loops)
            Scans that each line delays by.
        at : int
            How many scans there have been before.
        records : ndarray, shape (recorded names, scans, loops)
            Where the recorded values go.
        """
