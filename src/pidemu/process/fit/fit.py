"""A process from the record of a test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final, Literal, get_args

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats
from pidemu.errors import FitRefusedError, ProcessError, RecordError, suggest
from pidemu.excerpt import quoted
from pidemu.process.fit.bump import BumpTest, read_bump
from pidemu.process.fit.feedback import CLOSED, feedback_share
from pidemu.process.fit.goodness import Goodness, Interval, intervals, judge
from pidemu.process.fit.least_squares import LeastSquaresSearch
from pidemu.process.fit.optimum import Optimum
from pidemu.process.fit.reaction_curve import read_curve, read_slopes
from pidemu.process.process import Process
from pidemu.process.text import PERCENT

Model = Literal["fopdt", "sopdt", "ipdt"]
Method = Literal["least-squares", "tangent", "two-point"]
MODELS: Final[tuple[Model, ...]] = get_args(Model)
METHODS: Final[tuple[Method, ...]] = get_args(Method)
_LAGS: Final[dict[Model, int]] = {"fopdt": 1, "sopdt": 2, "ipdt": 0}
_READERS: Final[dict[tuple[str, str], Callable[[BumpTest], Optimum]]] = {
    ("fopdt", "tangent"): lambda test: read_curve(test, by_point=False),
    ("fopdt", "two-point"): lambda test: read_curve(test, by_point=True),
    ("ipdt", "tangent"): read_slopes,
}
_EVIDENCE: Final = 25.0
"""Below this F ratio an answer of the measurement may be chance."""
_EXCITED: Final = 10.0
"""Setpoint steps that allow a fit in a closed loop are so many times the residuals."""
_EXPLAINED: Final = 0.9
"""Share of the variance that such a fit must explain."""
_STEEP: Final = 6.0
"""Slopes before the first move count as a drift from so many standard errors on."""
_ALIKE: Final = 0.2
"""Correlation of neighbouring residuals that a note is made of, in a record of many samples."""


@dataclass(frozen=True)
class FitFigures:
    """How a process was fitted, and how good the fit is.

    Attributes
    ----------
    model, method : str
        What was fitted, and how.
    start, drift : float
        Measurement at the first sample without the output's moves, and how fast it drifts [1/s].
    rms : float
        Root mean square of the residuals, in units of the measurement.
    r_squared : float
        Share of the measurement's variance that the model explains.
    correlation : float
        Correlation of neighbouring residuals; noise has none.
    intervals : dict of str to (float, float)
        95 % confidence intervals of ``gain``, ``start``, ``drift``, ``lag`` (``lag 1``, ``lag 2``) and ``delay``, if the model is
        true; empty for what is read off a curve.
    samples : int
        How many samples were used.
    moves : int
        How often the output moves.
    closed_loop : bool
        Whether the loop was closed, and the setpoint moved it enough for a fit.
    notes : tuple of str
        What should be known beside the numbers.
    time, output, measurement, simulated, residuals : ndarray of float, shape (n,)
        The samples that were used [s], the recorded output and measurement, the model's measurement, and what it leaves.
    """

    model: Model
    method: Method
    start: float
    drift: float
    rms: float
    r_squared: float
    correlation: float
    intervals: dict[str, Interval]
    samples: int
    moves: int
    closed_loop: bool
    notes: tuple[str, ...]
    time: Floats = field(repr=False)
    output: Floats = field(repr=False)
    measurement: Floats = field(repr=False)
    simulated: Floats = field(repr=False)
    residuals: Floats = field(repr=False)


@dataclass(frozen=True)
class ProcessFit:
    """A process, and how it was found.

    Attributes
    ----------
    process : Process
        The process. Its gain is in its own unit, %/% where both signals are in percent.
    fit : FitFigures
        How it was fitted, and how good the fit is.
    """

    process: Process
    fit: FitFigures

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the signals as plain values, the form of ``pidemu fit --json`` (specs/fit.schema.json)."""
        from pidemu.process.fit.document import plain

        return plain(self)


def fit_process(
    time: npt.ArrayLike,
    output: npt.ArrayLike,
    measurement: npt.ArrayLike,
    model: Model = "fopdt",
    method: Method = "least-squares",
    *,
    setpoint: npt.ArrayLike | None = None,
    auto: npt.ArrayLike | None = None,
    drift: bool | None = None,
    unit: str = PERCENT,
) -> ProcessFit:
    """Fit a process to the record of a test.

    Parameters
    ----------
    time : array_like, shape (n,)
        Times of the samples [s], rising, at any intervals.
    output : array_like, shape (n,)
        The controller's output, which holds from one sample to the next. It may move once or often.
    measurement : array_like, shape (n,)
        The measurement; samples that are NaN are left out.
    model : {"fopdt", "sopdt", "ipdt"}
        First or second order (two real lags) plus dead time, or an integrator plus dead time.
    method : {"least-squares", "tangent", "two-point"}
        Least squares of all samples; or a curve after one step, read by its tangent (Miller's Fit 1; for ``ipdt`` by its slopes) or
        by tangent and 63.2 % point (his Fit 2).
    setpoint : array_like, shape (n,), optional
        The setpoint, if the loop was closed.
    auto : array_like, shape (n,), optional
        1 where the controller was in automatic; by default that is told from the signals.
    drift : bool, optional
        Whether the measurement drifts evenly besides (least squares alone). By default where it plainly does so before the output
        first moves.
    unit : str
        Unit of the gain: of the measurement per unit of the output, such as ``degC/%``; by default both are in percent.

    Raises
    ------
    FitRefusedError
        The output does not move, the measurement does not answer, or the loop was closed and no setpoint step moved it.
    RecordError
        The columns are no signals.
    ProcessError
        There is no such model or method, or the fitted numbers are not those of a process.

    Examples
    --------
    >>> t = np.arange(0.0, 200.0)
    >>> u = np.where(t < 20, 40.0, 45.0)
    >>> y = 50 + 10 * (1 - np.exp(-np.maximum(t - 24, 0) / 30))
    >>> print(fit_process(t, u, y).process)
    2 exp(-4 s)/(30 s + 1)
    """
    _check_words(model, method)
    test = read_bump(time, output, measurement, setpoint)
    closed = _is_closed(test, auto)
    if closed and not _setpoint_move(test):
        raise FitRefusedError(closed)
    drifts = _drifts(test) if drift is None else drift
    reader = _READERS.get((model, method))
    found = LeastSquaresSearch(test, _LAGS[model], drifts).optimum() if reader is None else reader(test)
    goodness = judge(test, found)
    _check_answer(test, found, goodness, closed, fitted=reader is None)
    sure = {} if reader else intervals(test, found, goodness)
    process = Process.from_lags(found.gain, found.lags, integrators=not found.lags, delay=found.delay, unit=unit)
    notes = [*test.notes, *_notes(test, found)]
    if reader is None:
        notes += _doubts(test, found, goodness, model, automatic=drift is None and drifts)
    if closed:
        notes.append("the loop was closed; the setpoint moved it enough for a fit, and a bump in manual is still the better test")
    return ProcessFit(
        process,
        FitFigures(
            model, method, found.start, found.drift, goodness.rms, goodness.r_squared, goodness.correlation, sure, test.time.size,
            len(test.moves), bool(closed), tuple(notes), test.time, test.output, test.measurement, goodness.simulated,
            goodness.residuals,
        ),
    )  # fmt: skip


def _check_words(model: str, method: str) -> None:
    for what, word, known in (("model", model, MODELS), ("method", method, METHODS)):
        if word not in known:
            raise ProcessError(f"{what} is '{quoted(word)}'{suggest(str(word), known)}; {what}s: {', '.join(known)}")
    if method != "least-squares" and (model, method) not in _READERS:
        readable = " or ".join(m for m, way in _READERS if way == method)
        raise ProcessError(f"the method {method} reads no {model} off a curve, but {readable}; use method='least-squares'")


def _is_closed(test: BumpTest, auto: npt.ArrayLike | None) -> str:
    """Return why the loop was closed while the record was made; empty where it was not."""
    remedy = "make the bump in manual, or record a setpoint step that is well above the noise, with its column"
    if auto is not None:
        modes = np.asarray(auto, dtype=float)
        if modes.shape != np.shape(test.given_time):
            raise RecordError(
                f"auto has {modes.size:,} samples, and time {len(test.given_time):,}; give one value of each per sample"
            )
        if not modes.any():
            return ""
        if modes.all():
            return f"the controller was in automatic: what moved the output is the measurement itself; {remedy}"
        at = test.given_time[modes > 0]
        return (
            f"the controller was in automatic from {at[0]:g} s to {at[-1]:g} s, for a part of the record; cut the record to its "
            f"part in manual"
        )
    share = feedback_share(test.output, test.measurement, test.setpoint)
    if share < CLOSED:
        return ""
    return (
        f"the loop was closed: the measurement explains {100 * share:.0f} % of the output's moves, so that a fit would find the "
        f"controller turned round and not the process; {remedy}"
    )


def _setpoint_move(test: BumpTest) -> float:
    """Return how far the setpoint moves."""
    known = np.empty(0) if test.setpoint is None else test.setpoint[np.isfinite(test.setpoint)]
    return float(np.ptp(known)) if known.size else 0.0


def _drifts(test: BumpTest) -> bool:
    """Tell whether the measurement plainly drifts before the output first moves."""
    t, y = test.time[: test.first + 1], test.measurement[: test.first + 1]
    if t.size < 10:
        return False
    apart = t - t.mean()
    slope = float(apart @ y) / float(apart @ apart)
    rest = y - y.mean() - slope * apart
    error = np.sqrt(float(rest @ rest) / (t.size - 2) / float(apart @ apart))
    rounding = 1e-12 * float(np.abs(y).max()) / float(np.ptp(t))
    return bool(abs(slope) > _STEEP * error + rounding)


def _check_answer(test: BumpTest, found: Optimum, goodness: Goodness, closed: str, *, fitted: bool) -> None:
    """Refuse a fit in which the measurement does not answer the output, or does so in a closed loop that nothing else moved."""
    if not np.ptp(test.measurement) or not found.gain or (fitted and goodness.evidence < _EVIDENCE):
        raise FitRefusedError(
            f"the measurement does not answer the output's move: beside its noise, {goodness.rms:.2g}, no response can be told; "
            f"make a larger bump, record for longer, or look whether the output reaches the process"
        )
    if closed and (_setpoint_move(test) < _EXCITED * goodness.rms or goodness.r_squared < _EXPLAINED):
        raise FitRefusedError(f"{closed} (the setpoint moves by {_setpoint_move(test):.3g}, the fit leaves {goodness.rms:.2g})")


def _notes(test: BumpTest, found: Optimum) -> Iterator[str]:
    """Yield what should be known beside the numbers, whatever the method."""
    if found.lags and test.duration - found.delay < 2 * found.lags[0]:
        yield (
            f"the record ends {test.duration:.3g} s after the output first moved, before the measurement has settled: gain and lag "
            f"are unsure together, and their ratio is what the record tells; record for longer, or use the model ipdt"
        )
    if found.delay < test.spacing:
        yield f"the dead time is shorter than the time between two samples, {test.spacing:.3g} s"


def _doubts(test: BumpTest, found: Optimum, goodness: Goodness, model: Model, *, automatic: bool) -> Iterator[str]:
    """Yield what the residuals of least squares say against the model."""
    if automatic:
        yield f"the measurement drifts before the output moves: a drift of {60 * found.drift:.3g} per minute was fitted as well"
    if len(found.lags) == 2 and found.lags[1] < test.spacing:
        yield "the second lag is shorter than the time between two samples: fopdt says as much"
    if goodness.correlation > max(_ALIKE, 4 / test.time.size**0.5) and goodness.rms > 1e-6 * float(np.ptp(test.measurement)):
        more = {"fopdt": "; try the model sopdt", "ipdt": "; try the model fopdt"}.get(model, "")
        yield (
            f"neighbouring residuals are alike (correlation {goodness.correlation:.2f}): the process has more dynamics than this "
            f"model, or something else disturbed it{more}"
        )
