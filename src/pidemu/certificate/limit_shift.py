"""What an output limit leaves behind in controllers without integral action (specs/equations.md, section 5)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from pidemu.card.load import Card
from pidemu.certificate.scaled_controller import ScaledController, scaled_controllers
from pidemu.controller.bench import Bench, limits_in_percent
from pidemu.records.standard import REST
from pidemu.settings.settings import Settings

_ERROR: Final = 40.0
"""The excursion of the measurement [% of span], less where the gain is above 2."""
_MOVE: Final = 80.0
"""The largest move of the output that it asks for [% of the way between the limits]."""
_ROOM: Final = 0.625
"""Part of that move for which there is room before the limit: at 80 % the output starts at 50 %."""
_SHIFTED: Final = 0.1
"""Shift that is worth a word [% of the output span]."""
_SCANS: Final = 50
_MOST_SCANS: Final = 20_000
_SLOW: Final = 100.0
"""The measurement moves in so many derivative and filter times, so that the derivative is next to nothing."""


@dataclass(frozen=True, slots=True)
class LimitShift:
    """Outputs of two controllers after the measurement has driven them to a limit and come back.

    A positional controller without integral action comes back to where it was. A velocity one forgets what the limit cut off: it
    comes back lower by that.

    Attributes
    ----------
    error : float
        The excursion of the measurement [% of the source's span].
    start : float
        Both outputs before it [% of the output span].
    limit : float
        The limit that it reaches [% of the output span].
    source, target : float
        The outputs after it, with the error that there was before [% of the output span].
    source_integrates, target_integrates : bool
        Whether they have integral action.
    """

    error: float
    start: float
    limit: float
    source: float
    target: float
    source_integrates: bool
    target_integrates: bool

    @property
    def shift(self) -> float:
        """By how much the target's output is above the source's [% of the output span]."""
        return self.target - self.source

    @property
    def permanent(self) -> bool:
        """Whether the outputs differ and nothing removes it: the target has no integral action that would."""
        return abs(self.shift) > _SHIFTED and not self.target_integrates

    @property
    def source_forgets(self) -> bool:
        """Whether the source does not come back to where it was, and has no integral that moved it."""
        return not self.source_integrates and abs(self.source - self.start) > _SHIFTED

    @property
    def target_forgets(self) -> bool:
        """The same for the target."""
        return not self.target_integrates and abs(self.target - self.start) > _SHIFTED

    @property
    def refuses(self) -> bool:
        """Whether the target loses what the source held: a shift that is permanent and new."""
        return self.permanent and self.target_forgets and not self.source_forgets

    @property
    def text(self) -> str:
        """The difference in two sentences; nothing where there is none that lasts."""
        if not self.permanent:
            return ""
        story = (
            f"From an output of {self.start:.4g} %, PV moves by {self.error:.3g} %, so that the output stands at {self.limit:g} %, "
            f"and comes back: then the old controller is at {self.source:.4g} %, the new one at {self.target:.4g} %."
        )
        if self.source_forgets and not self.target_forgets:
            return f"{story} Without integral action the old controller was shifted after every limit; the new one keeps its bias."
        return f"{story} Without integral action nothing removes this difference, and every limit adds to it."


def limit_shift(source: Settings, target: Settings, scans: tuple[float, float], factor: float = 1.0) -> LimitShift:
    """Run two controllers to an output limit and back to the error before it.

    Parameters
    ----------
    source, target : Settings
        The settings. The result says something where both have no integral action.
    scans : tuple of float
        Scan intervals of both [s].
    factor : float
        What the source's gain is multiplied by for new signal ranges; its sign does not matter.

    Returns
    -------
    LimitShift
        Where both end.

    Raises
    ------
    ScanError
        A controller cannot be run at its interval.

    Examples
    --------
    >>> import pidemu
    >>> old = pidemu.load_card("emerson/deltav").settings({"GAIN": 2, "STRUCTURE": 4})
    >>> new = pidemu.load_card("allen-bradley/pide").settings({"PGain": 2, "IGain": 0, "DGain": 0, "DependIndepend": "false"})
    >>> found = limit_shift(old, new, (0.5, 0.5))  # PV from 50 to 90 and back, direct acting: 50 + 2 x 40 = 130, limited to 100
    >>> (found.source, found.target, found.permanent)
    (50.0, 20.0, True)
    """
    both = scaled_controllers(source, target, scans)
    low, high = limits_in_percent(source, None)
    gain = abs(source.law().moments()[1])
    move = min(_MOVE * (high - low) / 100, _ERROR * gain)
    error = move / gain if gain else _ERROR
    start = high - _ROOM * move
    ends = [_after(side, e, start, (low, high)) for side, e in zip(both, (error, error / abs(factor)), strict=True)]
    return LimitShift(error, start, high, ends[0], ends[1], both[0].integrates, both[1].integrates)


def _after(side: ScaledController, error: float, start: float, limits: tuple[float, float]) -> float:
    """Return the output [% of its span] after the measurement has moved by `error`, such that the output rises, and come back."""
    a = side.own
    times = (
        (abs(a.kd / a.kp) if a.kp else 0.0)
        + a.Tf
        + sum(f.at(side.scan) for f in (a.measurement.filter, a.error.filter) if f is not None)
    )
    n = int(min(max(_SLOW * times / side.scan, _SCANS), _MOST_SCANS))
    x = np.arange(5 * n + 1) / n
    pv = REST - side.sign * error * np.interp(x, [0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 1.0, 0.0])
    bench = Bench.in_percent(side.settings, side.scan, sp=REST, pv=REST, op=start, limits=limits)
    last = float(bench.at_rest().run(bench.sp, side.pv.from_percent(pv))[-1])
    return round(side.op.in_percent(last), 6) + 0.0


def choices_that_hold(card: Card, chosen: Mapping[str, str]) -> tuple[dict[str, str], ...]:
    """Return choices of a card's options, one changed at a time, with which its block is positional and so holds a bias.

    Parameters
    ----------
    card : Card
        The target.
    chosen : mapping
        All its options as they are, as ``settings.options`` has them.

    Returns
    -------
    tuple of dict
        What would be changed; empty where the block is incremental whatever is chosen.
    """
    one_changed = ({name: choice} for name, choices in card.options.items() for choice in choices if choice != chosen[name])
    return tuple(c for c in one_changed if card.variant({**chosen, **c}).equation.implementation == "positional")
