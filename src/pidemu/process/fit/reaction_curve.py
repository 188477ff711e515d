"""Reading a reaction curve as by hand: the tangent at its steepest point, and the time to 63.2 % of its change.

Miller, Lopez, Smith and Murrill, *A Comparison of Controller Tuning Techniques* (1967): ``Fit 1`` has the lag ``K/Rr`` of the
tangent with the slope ``Rr``, ``Fit 2`` the lag that brings 63.2 % of the change at its time; both have the tangent's dead time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.errors import FitRefusedError
from pidemu.process.fit.bump import BumpTest, name_moves
from pidemu.process.fit.optimum import Optimum

_POINT: Final = 0.632
_AT_REST: Final = 0.1
"""Share of the time after the step over which the end of the curve is averaged."""
_SETTLED: Final = 0.03
"""Share of the change that the end may still move by."""
_SURE: Final = 4.0
"""Standard errors that the steepest slope has to stand out by: a wider window is surer, and less steep."""
_ELSE: Final = "method='least-squares' does without"


@dataclass(frozen=True)
class _Line:
    """A straight line through a window of samples: its middle and its slope."""

    time: float
    value: float
    slope: float

    def reaches(self, value: float) -> float:
        return self.time + (value - self.value) / self.slope


def read_curve(test: BumpTest, *, by_point: bool) -> Optimum:
    """Return the first-order model of a reaction curve.

    Parameters
    ----------
    test : BumpTest
        A record with one step of the output.
    by_point : bool
        Whether the lag is that of the 63.2 % point (Fit 2) instead of the tangent's (Fit 1).

    Raises
    ------
    FitRefusedError
        There are several steps, the measurement does not answer or does not settle, or no tangent can be told from noise.
    """
    when, size = _single(test)
    start = float(test.measurement[: test.first + 1].mean())
    noise = _noise(test.measurement)
    change = _end(test, noise) - start
    if abs(change) <= 5 * noise or not change:
        raise FitRefusedError(
            f"the measurement does not answer the output: it changes by {change:.3g} with a noise of {noise:.2g}; "
            f"make a larger bump, or look whether the output reaches the process"
        )
    tangent, width = _steepest(test, noise, math.copysign(1.0, change))
    delay = tangent.reaches(start) - when
    lag = change / tangent.slope
    if by_point:
        lag = _crossing(test, start + _POINT * change, width) - when - delay
    if not lag > 0:
        raise FitRefusedError(f"the curve has no lag that a tangent could show: it is over within a sample; {_ELSE} one")
    return Optimum(change / size, (lag,), delay if delay > 1e-9 else 0.0, start, 0.0)


def read_slopes(test: BumpTest) -> Optimum:
    """Return the integrating model of a reaction curve: from its slopes before and after the step, and where these lines meet.

    Raises
    ------
    FitRefusedError
        There are several steps, or the slope does not change.
    """
    when, size = _single(test)
    t, y, k = test.time, test.measurement, test.first + 1
    before = _line(t[:k], y[:k]) if k >= 5 else _Line(float(t[:k].mean()), float(y[:k].mean()), 0.0)
    late = t >= when + test.duration / 2
    after = _line(t[late], y[late])
    bend = after.slope - before.slope
    if abs(bend) * test.duration <= 5 * _noise(y) or not bend:
        raise FitRefusedError(
            "the slope of the measurement does not change after the step; make a larger bump, or look whether the output reaches "
            "the process"
        )
    meet = (before.value - before.slope * before.time - after.value + after.slope * after.time) / bend
    start = before.value + before.slope * (float(t[0]) - before.time)
    return Optimum(bend / size, (), meet - when if meet - when > 1e-9 else 0.0, start, before.slope)


def _single(test: BumpTest) -> tuple[float, float]:
    moves = test.moves
    if len(moves) > 1:
        raise FitRefusedError(f"a curve is read after one step, and the output moves by {name_moves(moves)}; {_ELSE}")
    return moves[0]


def _noise(y: Floats) -> float:
    """Return the standard deviation of the noise, from second differences; at least what the resolution of the record makes."""
    moved = np.abs(np.diff(y))
    resolution = float(moved[moved > 0].min(initial=math.inf))
    found = float(np.median(np.abs(np.diff(y, 2)))) / (0.6745 * math.sqrt(6))
    return max(found, resolution / math.sqrt(12) if math.isfinite(resolution) else 0.0)


def _end(test: BumpTest, noise: float) -> float:
    """Return where the measurement settles."""
    t, y = test.time, test.measurement
    end = float(t[-1])
    share = _AT_REST * test.duration
    last, before = y[t >= end - share], y[(t < end - share) & (t >= end - 2 * share)]
    if before.size < 2 or last.size < 2:
        raise FitRefusedError(f"too few samples at the end of the curve to see where it settles; {_ELSE}")
    moved = abs(float(last.mean() - before.mean()))
    change = abs(float(last.mean()) - float(y[: test.first + 1].mean()))
    if moved > _SETTLED * change + 4 * noise / math.sqrt(before.size):
        raise FitRefusedError(
            f"the measurement has not settled: it still moves by {moved:.3g} over the last tenth of the curve; record for longer, "
            f"or use model='ipdt' where it never settles; {_ELSE}"
        )
    return float(last.mean())


def _steepest(test: BumpTest, noise: float, sign: float) -> tuple[_Line, int]:
    """Return the tangent at the steepest point, from the window whose slope is steepest for sure, and its width in samples."""
    t, y = test.time[test.first :], test.measurement[test.first :]
    best, surest, width, chosen = None, 0.0, 2, 2
    while width <= max(2, t.size // 3):
        (middles, levels, slopes), errors = _windows(t - t[0], y, width, noise)
        sure = sign * slopes - _SURE * errors
        i = int(np.argmax(sure))
        if sure[i] > surest:
            best, surest, chosen = _Line(float(middles[i] + t[0]), float(levels[i]), float(slopes[i])), float(sure[i]), width
        width += max(1, width // 4)
    if best is None:
        raise FitRefusedError(f"the noise, {noise:.2g}, hides the slope of the curve; make a larger bump; {_ELSE} a tangent")
    return best, chosen


def _windows(t: Floats, y: Floats, width: int, noise: float) -> tuple[tuple[Floats, Floats, Floats], Floats]:
    """Return the lines through all windows of so many samples, and the standard errors of their slopes."""
    frames = np.lib.stride_tricks.sliding_window_view
    tt, yy = frames(t, width), frames(y, width)
    middle, level = tt.mean(axis=1), yy.mean(axis=1)
    apart = tt - middle[:, None]
    spread = (apart**2).sum(axis=1)
    return (middle, level, (apart * yy).sum(axis=1) / spread), noise / np.sqrt(spread)


def _line(t: Floats, y: Floats) -> _Line:
    (middle, level, slope), _ = _windows(t, y, t.size, 0.0)
    return _Line(float(middle[0]), float(level[0]), float(slope[0]))


def _crossing(test: BumpTest, value: float, width: int) -> float:
    """Return when the curve crosses a value: where fewest samples lie on the wrong side, by a line through those around."""
    t, y = test.time[test.first :], test.measurement[test.first :]
    rises = float(y[-1]) > float(y[0])
    beyond = (y >= value) == rises
    wrong = np.cumsum(np.concatenate([[0], beyond])) + np.concatenate([np.cumsum(~beyond[::-1])[::-1], [0]])
    at = int(np.argmin(wrong))
    around = slice(max(0, at - (width + 1) // 2), max(0, at - (width + 1) // 2) + max(2, width))
    line = _line(t[around], y[around])
    return line.reaches(value) if line.slope else float(t[min(at, t.size - 1)])
