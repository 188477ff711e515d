"""What one loop's numbers were computed by, done with columns: the numbers of many loops."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats
from pidemu.columns.traced import Constant, Each, Guard, NotTracedError, Step, Tape, Traced, Whole, value_of

Fits = npt.NDArray[np.bool_]
"""Which loops are of the structure."""

_FUNCTIONS: Final[dict[str, Callable[..., Any]]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "//": np.floor_divide,
    "negative": np.negative, "absolute": np.absolute,
    "floor": lambda x: np.floor(x) + 0.0, "ceil": lambda x: np.ceil(x) + 0.0, "rint": lambda x: np.rint(x) + 0.0,
    "single": np.float32, "double": np.float64,
    "<": np.less, ">": np.greater, "<=": np.less_equal, ">=": np.greater_equal, "==": np.equal, "!=": np.not_equal,
}  # fmt: skip
"""What signs and words stand for; whole numbers have no negative zero."""


@dataclass(frozen=True)
class Recording:
    """A computation of one loop that can be done for many.

    Attributes
    ----------
    steps : tuple of Step
        The operations, by place; what nothing depends on is ``None``.
    guards : tuple of Guard
        The decisions.
    results : tuple of int or float
        Places of the results; a float is a result that is the same for all loops.
    """

    steps: tuple[Step | None, ...]
    guards: tuple[Guard, ...]
    results: tuple[int | Constant, ...]

    @classmethod
    def of(cls, tape: Tape, given: Sequence[float], results: Sequence[Any]) -> Recording:
        """Return what is on a tape, as far as results and decisions depend on it.

        Parameters
        ----------
        tape : Tape
            The tape; what is recorded later does not count.
        given : sequence of float
            The inputs.
        results : sequence
            Traced numbers, and plain ones.

        Raises
        ------
        NotTracedError
            What was recorded does not give the results back.
        """
        places = tuple(x.place if isinstance(x, Traced) else Constant(float(x)) for x in results)
        needed = {place for place in places if isinstance(place, int)}
        needed |= {place for _, one, other, _ in tape.guards for place in (one, other)}
        for place in range(len(tape.steps) - 1, -1, -1):
            if place in needed:
                needed.update(tape.steps[place][1])
        steps = tuple(step if place in needed or step[0] == "input" else None for place, step in enumerate(tape.steps))
        recording = cls(steps, tuple(tape.guards), places)
        found, fits = recording.replay(np.array([given], dtype=np.float64).T)
        if not fits[0] or not np.array_equal(found[:, 0], [value_of(x) for x in results], equal_nan=True):
            raise NotTracedError("what was recorded does not give back what it was recorded from")
        return recording

    def replay(self, columns: Floats) -> tuple[Floats, Fits]:
        """Return the results for many loops, shape (results, loops), and which of these are of the structure.

        Parameters
        ----------
        columns : ndarray, shape (inputs, loops)
            The inputs. Results of loops that are of another structure are no numbers of theirs.
        """
        fits = np.ones(columns.shape[1], dtype=bool)
        at: list[Any] = [None] * len(self.steps)
        given = iter(columns)
        with np.errstate(all="ignore"):  # of what does not fit
            for place, step in enumerate(self.steps):
                if step is not None:
                    operation, operands = step
                    at[place] = next(given) if operation == "input" else _done(operation, [at[i] for i in operands], fits)
            for comparison, one, other, outcome in self.guards:
                fits &= _FUNCTIONS[comparison](at[one], at[other]) == outcome
        found = np.empty((len(self.results), columns.shape[1]))
        for row, result in zip(found, self.results, strict=True):
            row[:] = result.value if isinstance(result, Constant) else at[result]
        return found, fits


def _done(operation: Any, operands: list[Any], fits: Fits) -> Any:
    """Return the result of an operation; `fits` loses the loops for which it cannot be done."""
    match operation:
        case Constant(value=value):
            return value
        case Each(function=function):
            return _one_by_one(function, operands, fits)
        case Whole(function=function):
            results, done = function(*(np.broadcast_to(x, fits.shape) for x in operands))
            fits &= done
            return results
        case ("result", int(column)):
            return operands[0][:, column]
    return _FUNCTIONS[operation](*operands)


def _one_by_one(function: Callable[..., float], operands: list[Any], fits: Fits) -> Floats:
    """Return what a function of plain numbers gives for each loop: another one for arrays may round otherwise."""
    lists = [np.broadcast_to(x, fits.shape).tolist() for x in operands]
    try:
        return np.fromiter(map(function, *lists), np.float64, fits.size)
    except Exception:  # it refuses one of them, or exp(1000) is none
        pass
    found = np.full(fits.size, np.nan)
    for i, numbers in enumerate(zip(*lists, strict=True)):
        try:
            found[i] = function(*numbers)
        except Exception:
            fits[i] = False
    return found
