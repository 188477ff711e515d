"""A controller that runs: one scan at a time, or over recorded signals."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from pidemu.errors import ScanError
from pidemu.scan.build import Action, build
from pidemu.scan.program import Program
from pidemu.settings import Settings
from pidemu.units import Role, parse_quantity, to_canonical

if TYPE_CHECKING:
    from pidemu.targets.python import Compiled

Engine = Literal["python"]
Floats = npt.NDArray[np.float64]


def default_scan(settings: Settings) -> float:
    """Return the card's scan interval [s]."""
    number, unit = parse_quantity(settings.equation.scan.default)
    return number if unit is None else to_canonical(Role.FILTER_TIME, number, unit)


def _pair(limits: Sequence[float]) -> tuple[float, float]:
    try:
        low, high = (float(x) for x in limits)
    except (TypeError, ValueError):
        raise ScanError(f"output limits {limits!r} are no pair of numbers such as (0, 100)") from None
    return low, high


class Controller:
    """The controller of a card, with settings, running at a scan interval.

    Parameters
    ----------
    settings : Settings
        Card and settings.
    scan : float, optional
        Scan interval [s]; by default the card's.
    action : {"reverse", "direct"}
        Control action in the ISA sense: reverse means that the output falls when the measurement rises. The card's own words are in
        ``settings.equation.action.names``.
    output_limits : tuple of float, optional
        Low and high output limit [% of span; engineering units for a card with ``signals: engineering``]; by default the card's.
    bias : float
        Output at zero error of a positional controller without integral action [as limits].
    initial_output : float
        Output before the first scan [as limits]; the first automatic scan is a transfer from there.
    engine : {"python"}, optional
        Which back end runs the program.

    Attributes
    ----------
    program : Program
        The scan program.

    Raises
    ------
    ScanError
        Scan interval, limits, action or engine cannot be used.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("generic/standard").settings(K=2, Ti=10, Td=0)
    >>> ctl = pidemu.Controller(s, scan=1.0, initial_output=40.0)
    >>> [ctl.scan(sp=50.0, pv=50.0), ctl.scan(sp=51.0, pv=50.0)]
    [40.0, 42.2]
    """

    def __init__(
        self,
        settings: Settings,
        scan: float | None = None,
        action: Action = "reverse",
        output_limits: tuple[float, float] | None = None,
        *,
        bias: float = 0.0,
        initial_output: float = 0.0,
        engine: Engine | None = None,
    ) -> None:
        if engine not in (None, "python"):
            raise ScanError(f"engine '{engine}' is not available; use 'python'")
        if action not in ("reverse", "direct"):
            names = settings.equation.action.names
            words = ", ".join(f"'{k}' ({v})" for k, v in names.items())
            raise ScanError(f"action is '{action}'; it is one of {words}")
        self.settings = settings
        self.interval = default_scan(settings) if scan is None else float(scan)
        self.program: Program = build(
            settings.algorithm(own_units=True),
            self.interval,
            action=action,
            limits=_pair(settings.equation.output.limits if output_limits is None else output_limits),
            bias=bias,
            initial_output=initial_output,
            title=f"{settings.summary}; scan {self.interval:g} s, {action} acting",
        )
        from pidemu.targets.python import compiled

        self._compiled: Compiled = compiled(self.program)
        self._scan = self._compiled.scan
        self._state: list[float] = list(self.program.initial)

    @property
    def state(self) -> dict[str, float]:
        """What the program keeps from scan to scan, by name."""
        return {q.name: value for q, value in zip(self.program.states, self._state, strict=True)}

    @property
    def output(self) -> float:
        """The last output."""
        return self.state["u"]

    def reset(self) -> None:
        """Go back to before the first scan."""
        self._state[:] = self.program.initial

    def scan(self, sp: float, pv: float, auto: bool = True, manual: float | None = None) -> float:
        """Do one scan.

        Parameters
        ----------
        sp, pv : float
            Setpoint and measurement [% of span; engineering units for a card with ``signals: engineering``].
        auto : bool
            Automatic; otherwise manual.
        manual : float, optional
            Output set by the operator in manual [as output limits]; without it the output is held.

        Returns
        -------
        float
            The output.

        Raises
        ------
        ScanError
            Setpoint or measurement is not a finite number, or the manual output is infinite.
        """
        if not (math.isfinite(sp) and math.isfinite(pv)):
            raise ScanError(f"setpoint {sp} and measurement {pv} must be finite numbers")
        if manual is not None and math.isinf(manual):
            raise ScanError(f"the manual output {manual} is not a finite number")
        return self._scan(self._state, sp, pv, 1.0 if auto else 0.0, math.nan if manual is None else manual)

    def run(
        self,
        sp: npt.ArrayLike,
        pv: npt.ArrayLike,
        auto: npt.ArrayLike | None = None,
        manual: npt.ArrayLike | None = None,
    ) -> Floats:
        """Do one scan per sample, going on from the present state.

        Parameters
        ----------
        sp, pv : array_like, shape (n,) or scalar
            Setpoint and measurement, as in `scan`; a scalar counts for every sample.
        auto : array_like of bool, shape (n,) or scalar, optional
            Automatic; by default throughout.
        manual : array_like, shape (n,) or scalar, optional
            Output set by the operator; NaN or nothing holds the output.

        Returns
        -------
        ndarray of float, shape (n,)
            The outputs.

        Raises
        ------
        ScanError
            The signals have different lengths, or setpoint or measurement hold what is not a finite number, or the manual
            output is infinite.
        """
        columns = [sp, pv, True if auto is None else auto, math.nan if manual is None else manual]
        arrays = [np.asarray(c, dtype=float) for c in columns]
        try:
            signals = np.broadcast_arrays(*(np.atleast_1d(a) for a in arrays))
        except ValueError:
            lengths = ", ".join(str(a.size) for a in arrays)
            raise ScanError(f"the signals have different lengths: {lengths}") from None
        if signals[0].ndim != 1:
            raise ScanError("the signals must be one-dimensional")
        bad = np.flatnonzero(~np.isfinite(signals[0]) | ~np.isfinite(signals[1]))
        if bad.size:
            raise ScanError(f"setpoint or measurement is not a finite number in sample {bad[0]} (counted from 0)")
        if np.isnan(signals[2]).any():
            raise ScanError(f"the mode is not a number in sample {np.flatnonzero(np.isnan(signals[2]))[0]} (counted from 0)")
        if np.isinf(signals[3]).any():
            raise ScanError(f"the manual output is infinite in sample {np.flatnonzero(np.isinf(signals[3]))[0]} (counted from 0)")
        out = np.empty(signals[0].size)
        auto_on = signals[2] > 0
        edges = [0, *(np.flatnonzero(np.diff(auto_on)) + 1).tolist(), out.size]
        for start, end in itertools.pairwise(edges):
            self._spell(out[start:end], *(s[start:end] for s in signals))
        return out

    def _spell(self, out: Floats, sp: Floats, pv: Floats, auto: Floats, manual: Floats) -> None:
        """Run a spell in one mode; in automatic, after its first scan, with the program specialised to that."""
        general = 1 if auto.size and auto[0] > 0 else auto.size
        head = [s[:general].tolist() for s in (sp, pv, auto, manual)]
        out[:general] = self._compiled.run(self._state, *head)
        if general < out.size:
            tail = self._compiled.run_automatic(self._state, sp[general:].tolist(), pv[general:].tolist())
            out[general:] = np.fromiter(tail, float, len(tail))
