"""Many processes behind a zero-order hold, sampled at once: to the last bit what `pidemu.process.hold.sample` gives for each."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats
from pidemu.columns.functions import isfinite, whole
from pidemu.columns.traced import value_of
from pidemu.errors import ProcessError
from pidemu.process.hold import SampledProcess, chain, held, outputs


def sampled_traced(gain: Any, poles: Sequence[Any], zeros: Sequence[Any], delay: Any, h: Any) -> SampledProcess:
    """Return the model of a process whose numbers are traced."""
    if not (isfinite(h) and h > 0):
        raise ProcessError("the scan interval is not a positive number")
    n, roots = len(poles), (*poles, *zeros)
    signs = tuple(0 if not r.imag else 1 if r.imag > 0 else -1 for r in roots)
    parts = [part for r, sign in zip(roots, signs, strict=True) if sign >= 0 for part in ((r.real, r.imag) if sign else (r.real,))]
    numbers = (gain, delay, h, *parts)
    sampled = partial(sampled_columns, n, signs)
    flat, fits = sampled(*(np.array([float(value_of(x))]) for x in numbers))
    if not fits[0]:
        raise ProcessError("the process outgrows all numbers within one scan")
    found = np.array(whole(sampled, numbers, flat[0].tolist()), dtype=object)
    growth, early, late, row, (through, scans) = np.split(found, np.cumsum([n * n, n, n, n]))
    return SampledProcess(h, growth.reshape(n, n), early, late, row, through, scans)


def sampled_columns(
    n: int, signs: Sequence[int], gain: Floats, delay: Floats, h: Floats, *parts: Floats
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Return the sampled models of many processes, and which of them there are.

    Parameters
    ----------
    n : int
        How many of the roots are poles; the others are zeros.
    signs : sequence of int
        Of each root the sign of its imaginary part: 0, or 1 and -1 one after the other.
    gain, delay, h : ndarray, shape (processes,)
        Gains [%/%], dead times and scan intervals [s].
    *parts : ndarray, shape (processes,)
        Roots [rad/s], of a pair real and imaginary part of the upper one.

    Returns
    -------
    ndarray, shape (processes, n * n + 3 n + 2)
        In a row each: F, E, G, c, D and d, as `SampledProcess` names them.
    """
    roots = _roots(signs, parts, gain.size)
    poles, zeros = roots[:, :n], roots[:, n:]
    if any(signs[:n]):
        made = [chain(p) for p in poles.tolist()]
        A, B = np.array([A for A, _ in made]), np.array([B for _, B in made])
    else:
        A, B = _real_chains(poles.real)
    growth, early, late, scans = held(A, B, delay, h)
    fits = np.isfinite(np.concatenate([growth.reshape(gain.size, -1), early, late], axis=1)).all(axis=1)
    if len(signs) > n or any(signs):
        found = [outputs(p, z) for p, z in zip(poles.tolist(), zeros.tolist(), strict=True)]
        row, through = np.array([row for row, _ in found]), np.array([through for _, through in found])
    else:  # the states are in a row, and the last one is what comes out
        row, through = np.eye(n)[-1:] if n else np.zeros((1, 0)), np.array([0.0 if n else 1.0])
    parts = (growth.reshape(gain.size, -1), early, late, gain[:, None] * row, (gain * through)[:, None], scans[:, None])
    return np.concatenate(parts, axis=1), fits


def _roots(signs: Sequence[int], parts: Sequence[Floats], count: int) -> npt.NDArray[np.complex128]:
    """Return the roots of many processes, shape (processes, roots)."""
    found, left = np.zeros((count, len(signs)), dtype=np.complex128), iter(parts)
    for i, sign in enumerate(signs):
        if sign < 0:
            found[:, i] = found[:, i - 1].conjugate()
            continue
        found.real[:, i] = next(left)
        if sign:
            found.imag[:, i] = next(left)
    return found


def _real_chains(poles: Floats) -> tuple[Floats, Floats]:
    """Return what `chain` does, for many processes without complex poles."""
    count, n = poles.shape
    poles = np.take_along_axis(poles, np.argsort(-np.abs(poles), axis=1, kind="stable"), axis=1)
    drive = np.where(poles == 0, 1.0, -poles)
    A, B = np.zeros((count, n, n)), np.zeros((count, n))
    A[:, range(n), range(n)], A[:, range(1, n), range(n - 1)], B[:, :1] = poles, drive[:, 1:], drive[:, :1]
    return A, B
