"""Whether the loop was closed while a record was made: whether the measurement tells where the output moves next.

An operator's bumps come whatever the measurement does. A controller's moves follow from it: what the past of the output leaves open
of each move, the measurement of that moment explains. A fit of such a record tends to the controller turned round, ``-1/C``, and
not to the process, unless something that is neither, such as a setpoint step, moves the loop.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pidemu.arrays import Floats

_FEWEST: Final = 30
"""Moves of the output below which nothing can be told."""
_MOST: Final = 5000
"""Moves that are looked at."""
_UNUSUAL: Final = 0.05
"""Share of the moves that may have another cause."""
_NOTHING: Final = 1e-12
"""Share of the output's variance below which nothing is left open by its own past."""
CLOSED: Final = 0.7
"""Share of what is left open that the measurement explains in a closed loop."""


def feedback_share(output: Floats, measurement: Floats, setpoint: Floats | None = None) -> float:
    """Return which share of the output's moves the measurement explains, beyond what the output's own past does: 0 to 1.

    Parameters
    ----------
    output, measurement : ndarray of float, shape (n,)
        The samples.
    setpoint : ndarray of float, shape (n,), optional
        The setpoint, whose steps explain moves in a closed loop as well.

    Notes
    -----
    Two linear regressions of the output at its moves are compared, with and without the measurement, by their variances per degree
    of freedom. The measurement counts as it was at the move, a sample before, and at the two moves before: enough for a PID
    controller with a filter. The twentieth of the moves that is explained worst does not count: an unrecorded setpoint step is
    one. Moves that are no larger than the resolution of the record tell nothing.
    """
    at = np.flatnonzero(np.diff(output)) + 1
    at = at[1:] if at.size and at[0] == 1 else at
    at = at[:_MOST]
    if at.size < _FEWEST:
        return 0.0
    levels = [setpoint] if setpoint is not None and np.isfinite(setpoint).all() else []
    now, before, earlier = at[2:], at[1:-1], at[:-2]
    own = [np.ones(now.size), output[before], output[earlier]]
    seen = [measurement[k] for k in (now, now - 1, before, before - 1, earlier)]
    seen += [level[k] for level in levels for k in (now, before)]
    wanted, all_columns = output[now], np.column_stack([*own, *seen])
    size = np.abs(_rest(all_columns, wanted)[0])
    usual = size <= np.quantile(size, 1 - _UNUSUAL)
    alone, with_it = (_variance(columns[usual], wanted[usual]) for columns in (np.column_stack(own), all_columns))
    return max(0.0, 1 - with_it / alone) if alone > _NOTHING * float(np.var(output)) else 0.0


def _variance(columns: Floats, wanted: Floats) -> float:
    """Return the variance per degree of freedom that a linear regression leaves."""
    rest, rank = _rest(columns, wanted)
    return float(rest @ rest) / max(1, wanted.size - rank)


def _rest(columns: Floats, wanted: Floats) -> tuple[Floats, int]:
    """Return what a linear regression leaves, and how many numbers it has found."""
    size = np.abs(columns).max(axis=0)
    scaled = columns / np.where(size > 0, size, 1.0)
    weights, _, rank, _ = np.linalg.lstsq(scaled, wanted, rcond=1e-12)
    return wanted - scaled @ weights, int(rank)
