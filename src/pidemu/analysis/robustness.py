"""How far gain and dead time of a process may change before its loop becomes unstable: Hansen's robustness plot, in numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pidemu.analysis.critical_delay import critical_delays, edge_gains
from pidemu.analysis.figures import loop_figures
from pidemu.analysis.open_loop import OpenLoop, low_frequency_sign, picture_of
from pidemu.errors import ProcessError
from pidemu.formatting import json_safe
from pidemu.process.process import Process
from pidemu.settings.settings import Settings

Floats = npt.NDArray[np.float64]

SCHEMA: Final = "pidemu-robustness-1"
"""Name and version of the form of ``pidemu robustness --json``; a change that breaks a reader counts the version up."""
_PER_OCTAVE: Final = 12
_OCTAVES: Final = (2, 6)
"""The curve goes so many octaves to either side; where the gain limits lie beyond, up to so many."""
AID: Final = 2.0
"""The design aid is passed by where gain and dead time are off by this factor together."""


@dataclass(frozen=True)
class Robustness:
    """How far gain and dead time of a process may change.

    Attributes
    ----------
    gain_ratio, delay_ratio : ndarray, shape (n,)
        The limit of stability: gains of the process as multiples of the one tuned for, and the dead time at which the loop becomes
        unstable with each, as a multiple as well. It is the upper end of the interval of stable dead times that holds 1 or, where
        the loop is unstable at 1, of the highest one below; infinite where there is no limit, 0 where the loop is unstable with any
        dead time.
    gain_margin, lower_gain_limit : float
        Between these gain ratios, and with the process's own dead time, the loop is stable; infinite and 0 where there is no limit.
        Of an unstable loop, the stable interval nearest to 1; NaN where no gain is stable.
    delay_margin : float
        What may be added to the dead time [s]; 0 for an unstable loop.
    Ms, Mt : float
        Largest sensitivity and complementary sensitivity; infinite for an unstable loop.
    stable : bool
        Whether the loop is stable as it is.
    scan : float or None
        Scan interval of the sampled loop [s]; ``None`` for the continuous one.
    """

    gain_ratio: Floats
    delay_ratio: Floats
    gain_margin: float
    lower_gain_limit: float
    delay_margin: float
    Ms: float
    Mt: float
    stable: bool
    scan: float | None

    @property
    def holds_the_aid(self) -> bool:
        """Whether the limit stays outside the design aid: gain and dead time may be off by a factor of two together."""
        inside = (self.gain_ratio > 1 / AID) & (self.gain_ratio < AID)
        return (
            self.stable
            and bool(np.all(self.delay_ratio[inside] >= aid(self.gain_ratio[inside])))
            and self.lower_gain_limit <= 1 / AID
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain values, the form of ``--json`` (``specs/robustness.schema.json``)."""
        plain: dict[str, Any] = json_safe(
            {
                "schema": SCHEMA,
                "gain_ratio": self.gain_ratio.tolist(),
                "delay_ratio": self.delay_ratio.tolist(),
                **{name: getattr(self, name) for name in ("gain_margin", "lower_gain_limit", "delay_margin", "Ms", "Mt")},
                "stable": self.stable,
                "scan": self.scan,
            }
        )
        return plain


def aid(gain_ratio: Floats) -> Floats:
    """Return the upper side of the design aid, ``|log2 gain| + |log2 delay| = 1``, for gain ratios between 1/2 and 2."""
    return np.asarray(AID / np.maximum(gain_ratio, 1 / gain_ratio), dtype=np.float64)


def robustness(settings: Settings, process: Process, scan: float | None = None) -> Robustness:
    """Return how far gain and dead time of a process may change before its loop becomes unstable.

    Parameters
    ----------
    settings : Settings
        Card and settings of the controller; its action is taken to be that of negative feedback.
    process : Process
        The process that it is tuned for.
    scan : float, optional
        Scan interval [s]: the sampled loop, exact at the scans. Without it, the continuous one.

    Raises
    ------
    ProcessError
        The sign of the gain is the action, and the wrong one for the process; or the process cannot be sampled so, or has its
        gain in other units than %/%.
    ScanError
        The scan interval cannot be used.
    UndefinedError
        The controller is a recursion in scans, and no scan interval is given.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("generic/standard").settings(K=2, Ti=20)
    >>> found = robustness(s, pidemu.Process.from_lags(1.0, lags=[20], delay=5))
    >>> round(found.gain_margin, 4), round(found.delay_margin, 3), round(found.Ms, 2)  # pi, 5 (pi - 1)
    (3.1416, 10.708, 1.59)
    """
    law = settings.law(scan)
    process.check_percent()
    refuse_positive_feedback(settings, process)
    figures, loop = loop_figures(law, process), OpenLoop(law, process)
    if not loop.gain:
        low, high = (0.0, math.inf) if figures.stable else (math.nan, math.nan)
    else:
        low, high = edge_gains(loop, picture_of(loop))
    gains = _gains(low, high)
    limits = critical_delays(loop, gains)
    own = process.delay
    margin = limits[gains == 1.0][0] - own if figures.stable else 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = limits / own if own else np.where(limits > 0, math.inf, 0.0)
    return Robustness(gains, ratios, high, low, float(margin), figures.Ms, figures.Mt, figures.stable, law.scan)


def refuse_positive_feedback(settings: Settings, process: Process) -> None:
    """Refuse a controller whose sign of the gain is its action, and the wrong one for the process.

    Raises
    ------
    ProcessError
        It is.
    """
    if settings.equation.action.fixed and process.feedback_sign * low_frequency_sign(settings.algorithm()) < 0:
        raise ProcessError(
            f"{settings.card.id} has no choice of control action, and with the sign of its gain the feedback from {process} would "
            f"be positive; give the gain the other sign"
        )


def _gains(low: float, high: float) -> Floats:
    """Return the gain ratios of the curve, with 1 among them."""
    least, most = (_PER_OCTAVE * n for n in _OCTAVES)
    ends = []
    for sign, limit in ((-1, low), (1, high)):
        beyond = math.ceil(_PER_OCTAVE * sign * math.log2(limit)) + 2 if 0 < limit < math.inf else 0
        ends.append(sign * min(max(least, beyond), most))
    return np.asarray(2.0 ** (np.arange(ends[0], ends[1] + 1) / _PER_OCTAVE), dtype=np.float64)
