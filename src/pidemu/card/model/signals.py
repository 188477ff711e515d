"""What is done to the signals before the algorithm: setpoint, measurement, error."""

from __future__ import annotations

import math
from typing import Annotated, Any, Generic, Literal

from pidemu.card.model.base import Flag, GeneralRule, Part, R, Rule, Size, means
from pidemu.card.model.marks import AtRest, Beyond, Names, PerScan
from pidemu.part import part


@part(frozen=True, slots=True, kw_only=True)
class SignalFilter(Part, Generic[R]):
    """A first-order filter on a signal before the algorithm, `1/(1 + Tf s)`."""

    time: Annotated[
        R | None,
        means(
            "Filter time Tf: seconds, or the name of a setting, which may be a corner frequency in Hz. "
            "Exactly one of `time` and `factor`."
        ),
        Names("filter-time"),
    ] = None
    factor: Annotated[
        R | None,
        means(
            "In place of a time: the share k of the new sample per scan, `f += k (x - f)`, from above 0 to 1 (no filter); "
            "a number, or the name of a setting. The filter time goes with the scan interval, `Tf = h (1 - k)/k`."
        ),
        Names("filter-factor"),
    ] = None
    rule: Annotated[
        GeneralRule,
        means("How the filter is computed (specs/equations.md, section 4). A `factor` is the backward rule."),
        PerScan(),
    ] = Rule.BACKWARD

    @property
    def seconds(self) -> Any:
        """The filter time in an algorithm, at the card's own scan interval [s]."""
        assert self.time is not None
        return self.time

    def at(self, h: float) -> Any:
        """Return the filter time at a scan interval `h` [s] in an algorithm."""
        factor: Any = self.factor
        return self.seconds if factor is None else h * (1 - factor) / factor


@part(frozen=True, slots=True, kw_only=True)
class Measurement(Part, Generic[R]):
    """What is done to the measurement before the algorithm."""

    filter: Annotated[SignalFilter[R] | None, means("Filter on the measurement; P, I and D see what it lets through.")] = None
    previous_scan: Annotated[
        Flag, means("Whether the algorithm uses the measurement of the previous scan: one scan more of dead time."), PerScan()
    ] = False


def _rate(sp: Any) -> str | None:
    return f"setpoint rate limit of {sp.rate:g} per s" if sp.rate is not None and math.isfinite(sp.rate) else None


def _fall(sp: Any) -> str | None:
    other = sp.rate_down is not None and math.isfinite(sp.rate_down) and sp.rate_down != sp.rate
    return f"setpoint rate limit of {sp.rate_down:g} per s downwards" if other else None


@part(frozen=True, slots=True, kw_only=True)
class Setpoint(Part, Generic[R]):
    """What is done to the setpoint before the algorithm."""

    filter: Annotated[SignalFilter[R] | None, means("Filter on the setpoint.")] = None
    rate: Annotated[
        R | None,
        means(
            "Fastest change of the setpoint that the algorithm sees [as the measurement, per second]: a "
            "number, or the name of a setting."
        ),
        Names("setpoint-rate"),
        PerScan(),
        Beyond(None, _rate),
    ] = None
    rate_down: Annotated[
        R | None,
        means("Fastest fall of the setpoint, where that is another; `rate` is then the fastest rise."),
        Names("setpoint-rate"),
        PerScan(),
        Beyond(None, _fall),
    ] = None
    rate_counts: Annotated[
        Literal["always", "local"],
        means("Whether the rates limit a remote setpoint too, in cascade, or the local one only."),
        PerScan(),
    ] = "always"
    starts: Annotated[
        Literal["setpoint", "zero"],
        means("Where the limited setpoint starts at power-up: at the setpoint, or at zero."),
        PerScan(),
        AtRest("setpoint"),
    ] = "setpoint"
    tracks: Annotated[
        Flag,
        means(
            "Whether the setpoint follows the measurement in manual, and stays there after the transfer until the "
            "setpoint is changed."
        ),
        PerScan(),
    ] = False

    @property
    def fall(self) -> R | None:
        """Fastest fall of an algorithm's setpoint: as any change, unless the card says otherwise; ``None``: no limit."""
        found = self.rate if self.rate_down is None else self.rate_down
        return None if found == math.inf else found


def _shape(error: Any) -> str | None:
    if error.shape == "linear":
        return None
    name = "deadband" if error.shape == "gap" and not error.gain else error.shape
    return f"error: {name}{f' of {error.band:g}' if error.shape == 'gap' else ''}"


@part(frozen=True, slots=True, kw_only=True)
class ErrorShape(Part, Generic[R]):
    """What is done to the error before P and I use it (specs/equations.md, section 8)."""

    filter: Annotated[SignalFilter[R] | None, means("Filter on the error; P, I and D on error see what it lets through.")] = None
    shape: Annotated[
        Literal["linear", "gap", "squared", "gain-linear"],
        means(
            "`linear`. `gap`: within `band` of zero the error counts with `gain`; with a gain of 0 that is a deadband. "
            "`squared`: `e |e|/over`. `gain-linear`: `e (L + (1 - L) |e|/over)` with L = `linearity`."
        ),
        Beyond("linear", _shape),
    ] = "linear"
    band: Annotated[
        R | None, means("Half width of the band [as the measurement], with `gap`."), Names("deadband"), Beyond(None)
    ] = None
    gain: Annotated[R, means("Gain within the band, with `gap`: a number, or the name of a setting."), Names("gap-gain")] = 0.0  # type: ignore[assignment]  # of every R
    subtracted: Annotated[
        Flag, means("With `gap`: outside the band the error is less by what the band took, so that nothing jumps at its edge.")
    ] = False
    zero_crossing: Annotated[
        Flag, means("With `gap`: the band counts only after the error has changed its sign within it, until the error leaves it.")
    ] = False
    edge: Annotated[Literal["inside", "outside"], means("With `gap`: whether an error of exactly the band is inside it.")] = (
        "inside"
    )
    linearity: Annotated[R | None, means("L, with `gain-linear`: a number, or the name of a setting."), Names("linearity")] = None
    over: Annotated[Size, means("The |e| at which `squared` and `gain-linear` have gain 1 [as the measurement].")] = 100.0
    on: Annotated[
        Literal["error", "proportional", "integral"],
        means("Which terms the shape counts for: P and I alike, or one of them. The derivative never sees it."),
    ] = "error"
