"""The dead time at which a closed loop becomes unstable, for many gains at once (specs/equations.md, section 9, point 6).

When the dead time ``d`` grows, roots of ``1 + g L`` cross the edge of stability where the loop gain is 1: outwards where it falls
with frequency, inwards where it rises. `Crossings` are all of these, and the critical dead time is found by walking along them from
the process's own: up to the first one of a loop that is stable there, down until none is left of one that is not.

A sampled loop is exact at the scans, with dead times that end between them. There the gain depends on the dead time as well, so
that frequency and dead time of a crossing are found together, and a root may also leave the unit circle at -1.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from pidemu.analysis.crossings import zeros
from pidemu.analysis.figures import crossovers_of, gain_factors
from pidemu.analysis.open_loop import OpenLoop, OpenLoopResponse, picture_of
from pidemu.analysis.stability import outside_the_unit_circle, turns_for_ever, without_delay
from pidemu.law.rational import Response
from pidemu.process.hold import responses
from pidemu.process.process import Process

Floats = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]

_MOST_TURNS: Final = 2000
_FEW_TURNS: Final = 4
"""Crossings of one frequency below the process's own dead time, at most; fewer where only the next one counts."""
_STEPS: Final = 30
_MISSED: Final = 1e-11
_GOOD: Final = 1e-6
"""How far from -1 the loop may be at a crossing, to stop looking, and for it to be one."""
_PER_SCAN: Final = 48
"""Dead times per scan interval at which the loop is looked at where z is -1."""
_SAME: Final = 1e-7
"""Two crossings nearer than this are one."""


@dataclass(frozen=True)
class Crossings:
    """Roots that cross the edge of stability as the dead time grows.

    Attributes
    ----------
    which : ndarray of int, shape (n,)
        Place of the gain.
    delay : ndarray, shape (n,)
        Dead time at which it happens [s].
    change : ndarray, shape (n,)
        How many roots become unstable; negative where they become stable.
    """

    which: Places
    delay: Floats
    change: Floats


def critical_delays(loop: OpenLoop, gains: Floats) -> Floats:
    """Return the dead time at which the loop becomes unstable [s], for each factor of the loop gain.

    Parameters
    ----------
    loop : OpenLoop
        Controller and process.
    gains : ndarray, shape (n,)
        Factors of the loop gain, above 0.

    Returns
    -------
    ndarray, shape (n,)
        The upper end of the interval of stable dead times that holds the process's own or, where the loop is unstable with that, of
        the highest one below. Infinite where no dead time makes the loop unstable, 0 where it is unstable with all of these.
    """
    own = loop.process.delay
    if not loop.gain:
        return np.full(gains.size, math.inf if loop.process.is_stable else 0.0)
    unstable, found = _continuous(loop, gains) if loop.law.scan is None else _sampled(loop, gains)
    limits = np.array([_walked(own, unstable[i], found, i) for i in range(gains.size)])
    lost = limits == 0
    if loop.law.scan is not None and own and lost.any():  # a crossing that was not seen from so far off: up from no dead time
        limits[lost] = critical_delays(replace(loop, process=replace(loop.process, delay=0.0)), gains[lost])
    return limits


def _walked(own: float, unstable: float, found: Crossings, i: int) -> float:
    """Return the critical dead time of one gain, from the roots that are unstable at the process's own."""
    mine = found.which == i
    delay, change = found.delay[mine], found.change[mine]
    if not unstable:
        later = delay[(delay > own) & (change > 0)]
        return float(later.min()) if later.size else math.inf
    before = np.flatnonzero(delay <= own)
    if change[before].sum() > unstable:
        return 0.0  # not all were seen
    for k in before[np.argsort(-delay[before])]:
        unstable -= change[k]
        if unstable < 0.5:
            return float(delay[k])
    return 0.0


def _pairs(sizes: Floats, gains: Floats) -> tuple[Places, Places, npt.NDArray[np.bool_]]:
    """Return gain and interval of frequencies of all places where the loop gain is 1, and whether it falls there."""
    with np.errstate(divide="ignore"):
        loud = np.log(sizes) + np.log(gains)[:, None] >= 0
    which, at = np.nonzero(loud[:, 1:] != loud[:, :-1])
    return which, at, loud[which, at]


def _continuous(loop: OpenLoop, gains: Floats) -> tuple[Floats, Crossings]:
    """Return how many roots are unstable at the process's own dead time, and the crossings, of a continuous loop."""
    own = loop.process.delay
    bare = OpenLoop(loop.law, replace(loop.process, delay=0.0), loop.factor)
    num, den = bare.polynomials
    picture = picture_of(bare)
    w, sizes = picture.all_sizes
    which, at, falls = _pairs(sizes, gains)
    x, level = np.log(w), np.log(gains)[which]

    def size(x: Floats) -> Floats:
        return np.log(np.abs(bare(np.exp(x)))) + level

    with np.errstate(divide="ignore"):
        ends = np.log(sizes)
    w = np.exp(zeros(x[at], x[at + 1], ends[at] + level, ends[at + 1] + level, size))
    first = np.mod(np.angle(-bare(w)), 2 * math.pi)  # of w times the dead time
    passed = np.where(w * own >= first, np.floor((w * own - first) / (2 * math.pi)) + 1, 0.0)
    change = np.where(falls, 2.0, -2.0)
    unstable = np.zeros(gains.size)
    np.add.at(unstable, which, change * passed)
    for i, g in enumerate(gains):
        count, at_zero = without_delay(g * num, den)
        unstable[i] += math.inf if at_zero or turns_for_ever(g * num, den) else count
    parts = [Crossings(which, (first + 2 * math.pi * passed) / w, change)]
    behind = np.minimum(passed, _MOST_TURNS) * (unstable[which] > 0)
    for turn in range(int(behind.max(initial=0.0))):
        some = behind > turn
        parts.append(Crossings(which[some], ((first + 2 * math.pi * (passed - 1 - turn)) / w)[some], change[some]))
    return unstable, _joined(parts)


def _joined(parts: list[Crossings]) -> Crossings:
    fields = zip(*((p.which, p.delay, p.change) for p in parts), strict=True)
    which, delay, change = (np.concatenate(x) for x in fields)
    return Crossings(which, delay, change)


@dataclass(frozen=True)
class _Sampled:
    """A sampled loop with any dead time."""

    loop: OpenLoop
    scan: float

    def __call__(self, w: Floats, delays: Floats) -> Response:
        P: Process = self.loop.damped
        held = responses(P.gain, P.poles, P.zeros, self.scan, w, delays)
        return np.asarray(self.loop.gain * self.loop.law.response(w) * held, dtype=np.complex128)


def _sampled(loop: OpenLoop, gains: Floats) -> tuple[Floats, Crossings]:
    """Return the same of a sampled loop."""
    h = loop.law.scan
    assert h is not None
    picture = picture_of(loop)
    unstable = _unstable_by_gain(loop, picture, gains)
    exact = _Sampled(loop, h)
    parts = [_pair_crossings(exact, picture, gains, unstable), _real_crossings(exact, gains, unstable)]
    return unstable, _joined(parts)


def _unstable_by_gain(loop: OpenLoop, picture: OpenLoopResponse, gains: Floats) -> Floats:
    """Return how many roots are outside the unit circle, by gain: between two gains at which one crosses, as many for all."""
    edges = np.unique(gain_factors(loop, picture))
    edges = edges[np.isfinite(edges) & (edges > 0)]
    middles = np.sqrt(edges[1:] * edges[:-1])
    inside = np.concatenate([edges[:1] / 2, middles, edges[-1:] * 2]) if edges.size else np.ones(1)
    at = np.searchsorted(edges, gains)
    counts = np.zeros(inside.size)
    for k in np.unique(at):
        counts[k] = _count(replace(loop, factor=loop.factor * float(inside[k])))
    return counts[at]


def _count(loop: OpenLoop) -> float:
    picture = picture_of(loop)
    if np.any(np.abs(picture.beyond) >= 1):
        return math.inf
    poles = sum(p.real > 0 for p in loop.process.poles)
    return max(0.0, round(outside_the_unit_circle(picture.values, poles, loop.integrates)))


def _pair_crossings(exact: _Sampled, picture: OpenLoopResponse, gains: Floats, unstable: Floats) -> Crossings:
    """Return where pairs of roots cross the unit circle: the next of each frequency, and those before it for unstable gains.

    They are looked for from the process's own dead time, and from one that is half a scan longer, where the gain differs.
    """
    own, h = exact.loop.process.delay, exact.scan
    starts = []
    for base in (own, own + h / 2):
        values = exact(picture.w, np.full(picture.w.size, base))
        which, at, _ = _pairs(np.abs(values), gains)
        w = np.sqrt(picture.w[at] * picture.w[at + 1])
        phases = np.mod(np.angle(-exact(w, np.full(w.size, base))) + w * (base - own), 2 * math.pi)
        starts.append((which, w, own + phases / w))
    which, w, delay = (np.concatenate(x) for x in zip(*starts, strict=True))
    most = np.where(unstable[which] > 0, _MOST_TURNS, _FEW_TURNS)
    back = np.minimum(np.floor(delay * w / (2 * math.pi)) + 2, most).astype(np.intp)
    turns = np.concatenate([np.arange(-1.0, n) for n in back]) if back.size else np.zeros(0)
    which, w, delay = (np.repeat(x, back + 1) for x in (which, w, delay))
    delay -= turns * 2 * math.pi / w
    some = delay > -h
    return _solved(exact, gains, which[some], w[some], np.maximum(delay[some], 0.0))


def _solved(exact: _Sampled, gains: Floats, which: Places, w: Floats, delay: Floats) -> Crossings:
    """Return the crossings near some frequencies and dead times, by Newton's method for both."""
    h = exact.scan
    level = np.log(gains)[which]
    w_slope = d_slope = np.ones(which.size, dtype=np.complex128)
    left = np.full(which.size, math.inf)
    for _ in range(_STEPS if which.size else 0):
        dw, dd = 1e-6 * w, np.full(w.size, 1e-6 * h)
        values = exact(np.concatenate([w, w - dw, w]), np.concatenate([delay, delay, delay + dd]))
        here, lower, later = np.split(np.log(-values) + np.tile(level, 3), 3)
        w_slope, d_slope = (here - lower) / dw, (later - here) / dd
        left = np.abs(here)
        if np.all(left < _MISSED):
            break
        with np.errstate(divide="ignore", invalid="ignore"):
            determinant = (w_slope * d_slope.conj()).imag
            dw, dd = (here * d_slope.conj()).imag / determinant, (w_slope * here.conj()).imag / determinant
        w = np.clip(w - np.clip(np.nan_to_num(dw), -0.3 * w, 0.3 * w), 1e-12 / h, math.pi / h * (1 - 1e-9))
        far = np.maximum(h, 1 / w)
        delay = np.maximum(delay - np.clip(np.nan_to_num(dd), -far, far), 0.0)
    outwards = (-1j * d_slope / w_slope).real
    good = (left < _GOOD) & (delay > 0) & (w < math.pi / h * (1 - 1e-6))  # at the end, a single root crosses
    return _distinct(Crossings(which[good], delay[good], np.where(outwards[good] > 0, 2.0, -2.0)), w[good])


def _distinct(found: Crossings, w: Floats) -> Crossings:
    """Return crossings without those that were found twice."""
    order = np.lexsort((w, found.delay, found.which))
    which, delay, w = found.which[order], found.delay[order], w[order]
    same = (np.diff(which) == 0) & (np.diff(w) < _SAME * w[1:]) & (np.abs(np.diff(delay)) < _SAME * delay[1:])
    keep = np.r_[True, ~same] if which.size else np.zeros(0, dtype=bool)
    return Crossings(which[keep], delay[keep], found.change[order][keep])


def _real_crossings(exact: _Sampled, gains: Floats, unstable: Floats) -> Crossings:
    """Return where a root crosses the unit circle at -1: within two scans, or from no dead time on where a gain is unstable."""
    own, h = exact.loop.process.delay, exact.scan
    edge = math.pi / h

    def real(delays: Floats) -> Floats:
        return np.asarray(exact(np.full(delays.size, edge), delays).real, dtype=np.float64)

    largest = np.abs(real(np.linspace(own, own + h, _PER_SCAN))).max()  # from scan to scan the sign alone changes
    if largest * gains.max() < 1 - 2 / _PER_SCAN:
        return Crossings(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0))
    start = 0.0 if unstable.any() else own
    count = min(math.ceil((own - start) / h), _MOST_TURNS) + 2
    delays = np.asarray(own + 2 * h - np.arange(count * _PER_SCAN + 1)[::-1] * (h / _PER_SCAN), dtype=np.float64)
    delays = delays[delays >= 0]
    values = 1 + gains[:, None] * real(delays)
    which, at = np.nonzero((values[:, 1:] < 0) != (values[:, :-1] < 0))
    g = gains[which]
    delay = zeros(delays[at], delays[at + 1], values[which, at], values[which, at + 1], lambda d: 1 + g * real(d))
    near = 1e-5
    slope = exact(np.full(delay.size, edge * (1 - near)), delay).imag / (edge * near * h)  # of L by z, at -1
    little = 1e-6 * h
    grows = (real(delay + little) - real(delay)) / little
    return Crossings(which, delay, np.where(grows / slope > 0, 1.0, -1.0))


def edge_gains(loop: OpenLoop, picture: OpenLoopResponse) -> tuple[float, float]:
    """Return between which factors of the loop gain the loop is stable: the interval that holds 1, or else the nearest one.

    Parameters
    ----------
    loop : OpenLoop
        Controller and process.
    picture : OpenLoopResponse
        The loop at its frequencies.

    Returns
    -------
    low, high : float
        0 where the gain may fall to any value above 0, infinite where it may rise without limit; both NaN where no gain is stable.
    """
    edges = np.unique(gain_factors(loop, picture))
    edges = edges[np.isfinite(edges) & (edges > 0)]
    ends = [0.0, *edges.tolist(), math.inf]
    intervals = sorted(itertools.pairwise(ends), key=lambda x: abs(math.log(_inner(x[0], x[1], 1.0))))
    for low, high in intervals:
        inner = replace(loop, factor=loop.factor * _inner(low, high))
        seen = picture_of(inner)
        if not inner.unstable(seen, crossovers_of(inner, seen)):
            return low, high
    return math.nan, math.nan


def _inner(low: float, high: float, wanted: float | None = None) -> float:
    """Return a factor between two: the one nearest to a wanted one, or else one in the middle."""
    if wanted is not None:
        return min(max(wanted, low), high)
    if not low:
        return high / 2 if math.isfinite(high) else 1.0
    return 2 * low if math.isinf(high) else math.sqrt(low * high)
