"""A scan program as NumPy operations on blocks of loops: the fast engine that needs no compiler."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from itertools import cycle
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats, Integers
from pidemu.backends.numpy_text import BlockPlan, planned
from pidemu.backends.numpy_values import scan_of
from pidemu.backends.python import in_precision
from pidemu.backends.runner import Block, Run, Runner
from pidemu.program.ir import Program, Structure
from pidemu.program.specialise import specialise

WIDTH: Final = 4096
"""Loops per block: the calls' own time is then a quarter of the whole; wider blocks gain little and take more memory."""

_Array = npt.NDArray[Any]


@lru_cache(maxsize=512)
def block(structure: Structure) -> Block:
    """Return what runs blocks of loops of a structure, with any number of loops; within a scan it allocates nothing.

    Parameters
    ----------
    structure : Structure
        What the loops have in common.
    """
    program = structure.bare()
    kinds = [np.dtype(np.float64 if program.is_wide(q.name) else np.float32) for q in program.coefficients + program.states]
    count = len(program.coefficients)
    plan, scans = _scans(program)

    def run(values: Floats, states: Floats, signals: Floats, rings: Floats, lengths: Integers, at: int, records: Floats) -> None:
        width = records.shape[2]
        rows = zip(
            *records,
            *(signals[i] for i in plan.inputs),
            *(_leaving(ring, length, at) for ring, length in zip(rings, lengths, strict=True)),
            *(_from(ring, at) for ring in rings),
            strict=False,  # the rings go round without end
        )
        with np.errstate(all="ignore"):
            coefficients = [_coefficient(x.astype(kind)) for x, kind in zip(values, kinds[:count], strict=True)]
            kept = [x.astype(kind) for x, kind in zip(states, kinds[count:], strict=True)]
            buffers = [np.empty(width, kind) for kind in plan.buffers]
            for state, buffer in plan.carried.items():
                buffers[buffer] = kept[state]
            for state, final in zip(states, scans(coefficients, kept, buffers, rows), strict=True):
                state[...] = final

    return run


def _scans(program: Program) -> tuple[BlockPlan, Callable[..., list[_Array]]]:
    scan = scan_of(program)
    plan = planned(scan)
    ufuncs = {v.what for i, v in enumerate(scan.values) if scan.computed(i)} - {"copy", "select"} | {"logical_not"}
    names = {name: getattr(np, name) for name in ufuncs}
    names |= {name: np.array(value, kind) for name, (value, kind) in plan.numbers.items()}
    names["put"] = _put
    exec(plan.text, names)  # our own text: nothing of the user's goes into it
    return plan, names["scans"]


def _coefficient(row: _Array) -> _Array:
    """Return a coefficient of all loops, as one number where they have it in common: it takes no room in the cache."""
    bits = row.view(np.int64 if row.dtype == np.float64 else np.int32)
    return row[0].reshape(()) if bits.size and (bits == bits[0]).all() else row


def _put(into: _Array, where: _Array, x: _Array) -> None:
    """Put values where a mask holds; in most scans it holds nowhere or everywhere."""
    found = np.count_nonzero(where)
    if not found:
        return
    if found == where.size:
        into[...] = x
    elif found * 16 < where.size:
        np.copyto(into, x, where=where)  # quick between the places
    else:
        np.putmask(into, where, x)  # takes the same time whatever the mask


def _from(ring: Floats, scan: int) -> Iterator[Floats]:
    """Return the rows of a ring, over and over, from that of a scan on."""
    first = scan % len(ring)
    return cycle([*ring[first:], *ring[:first]])


def _leaving(ring: Floats, lengths: Integers, at: int) -> Iterator[Floats]:
    """Return what leaves a delay line, scan after scan, the first being scan `at`."""
    if lengths.size and (lengths == lengths[0]).all():
        return _from(ring, at - int(lengths[0]))
    return _gathered(ring, lengths, at)


def _gathered(ring: Floats, lengths: Integers, at: int) -> Iterator[Floats]:
    assert ring.flags.c_contiguous  # its rows are read from one row after the other
    rows, width = ring.shape
    flat = ring.reshape(-1)
    row = at % rows
    index = (row - lengths) * width + np.arange(width)
    now, last = np.empty(width), np.empty(width)  # two, as a state may be bound to that of the last scan
    while True:
        yield flat.take(index, None, now, "wrap")
        now, last = last, now
        index += width
        row += 1
        if row == rows:
            index -= ring.size
            row = 0


def runner(program: Program) -> Runner:
    """Return the program as functions over records, one scan of one loop after the other; slow, but the same bits.

    Parameters
    ----------
    program : Program
        The program.
    """
    automatic = specialise(program)
    return Runner(_over(program), _over(automatic), tuple(q.name for q in automatic.inputs))


def _over(program: Program) -> Run:
    run_block = block(program.structure)
    values = np.array(program.values, dtype=np.float64)[:, None]

    def run(state: list[Any], signals: Sequence[Floats], scans: int) -> Floats:
        count = len(program.states)
        states = np.array(state[:count], dtype=np.float64)[:, None]
        lengths = [len(line) for line in state[count:]]  # a dead time that is longer than the run is held in part only
        rings = np.zeros((len(lengths), 1 + max(lengths, default=0), 1))
        places = [np.arange(-length, 0) for length in lengths]
        for ring, held, place in zip(rings, state[count:], places, strict=True):
            ring[place, 0] = held
        inputs = np.array(signals, dtype=np.float64).reshape(len(signals), scans, 1)
        records = np.empty((len(program.recorded), scans, 1))
        run_block(values, states, inputs, rings, np.array(lengths, dtype=np.int64)[:, None], 0, records)
        state[:count] = [in_precision(program, q.name, x) for q, x in zip(program.states, states[:, 0].tolist(), strict=True)]
        for ring, held, place, line in zip(rings, state[count:], places, program.lines, strict=True):
            held.clear()
            held.extend(in_precision(program, line.name, x) for x in ring[(place + scans) % len(ring), 0].tolist())
        return records[:, :, 0]

    return run
