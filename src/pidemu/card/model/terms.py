"""Signals and terms of an equation: setpoint, measurement, error, proportional, derivative, feedforward."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pidemu.card.model.base import Flag, GeneralRule, Model, Number, Reference, Rule, SettingName, Size


class Proportional(Model):
    """The proportional term."""

    on: Literal["error", "pv", "weighted", "none"] = Field(
        description="What the term acts on: `error` (b = 1), `pv` (b = 0), `weighted` (b = `weight`), or `none`: no such term."
    )
    weight: SettingName | Number | None = Field(
        default=None,
        description="Setpoint weight b where `on: weighted`: a number, or the name of the setting that holds it.",
    )
    accumulated: Flag = Field(
        default=False,
        description="Whether a term on PV is accumulated from its value at the start, `P -= kp (y_n - y_{n-1})`, instead of being "
        "`-kp y_n`. With `windup.scheme: clamp-sum` it accumulates into the integral's own sum.",
    )


class SignalFilter(Model):
    """A first-order filter on a signal before the algorithm, `1/(1 + Tf s)`."""

    time: Reference | None = Field(
        default=None,
        description="Filter time Tf: seconds, or the name of a setting, which may be a corner frequency in Hz. "
        "Exactly one of `time` and `factor`.",
    )
    factor: Reference | None = Field(
        default=None,
        description="In place of a time: the share k of the new sample per scan, `f += k (x - f)`, from above 0 to 1 (no filter); "
        "a number, or the name of a setting. The filter time goes with the scan interval, `Tf = h (1 - k)/k`.",
    )
    rule: GeneralRule = Field(
        default=Rule.BACKWARD,
        description="How the filter is computed (specs/equations.md, section 4). A `factor` is the backward rule.",
    )


class Measurement(Model):
    """What is done to the measurement before the algorithm."""

    filter: SignalFilter | None = Field(default=None, description="Filter on the measurement; P, I and D see what it lets through.")
    previous_scan: Flag = Field(
        default=False, description="Whether the algorithm uses the measurement of the previous scan: one scan more of dead time."
    )


class Setpoint(Model):
    """What is done to the setpoint before the algorithm."""

    filter: SignalFilter | None = Field(default=None, description="Filter on the setpoint.")
    rate: Reference | None = Field(
        default=None,
        description="Fastest change of the setpoint that the algorithm sees [as the measurement, per second]: a "
        "number, or the name of a setting.",
    )
    rate_down: Reference | None = Field(
        default=None, description="Fastest fall of the setpoint, where that is another; `rate` is then the fastest rise."
    )
    rate_counts: Literal["always", "local"] = Field(
        default="always", description="Whether the rates limit a remote setpoint too, in cascade, or the local one only."
    )
    starts: Literal["setpoint", "zero"] = Field(
        default="setpoint", description="Where the limited setpoint starts at power-up: at the setpoint, or at zero."
    )
    tracks: Flag = Field(
        default=False,
        description="Whether the setpoint follows the measurement in manual, and stays there after the transfer until the "
        "setpoint is changed.",
    )


class ErrorShape(Model):
    """What is done to the error before P and I use it (specs/equations.md, section 8)."""

    filter: SignalFilter | None = Field(
        default=None, description="Filter on the error; P, I and D on error see what it lets through."
    )
    shape: Literal["linear", "gap", "squared", "gain-linear"] = Field(
        default="linear",
        description="`linear`. `gap`: within `band` of zero the error counts with `gain`; with a gain of 0 that is a deadband. "
        "`squared`: `e |e|/over`. `gain-linear`: `e (L + (1 - L) |e|/over)` with L = `linearity`.",
    )
    band: Reference | None = Field(default=None, description="Half width of the band [as the measurement], with `gap`.")
    gain: Reference = Field(default=0.0, description="Gain within the band, with `gap`: a number, or the name of a setting.")
    subtracted: Flag = Field(
        default=False,
        description="With `gap`: outside the band the error is less by what the band took, so that nothing jumps at its edge.",
    )
    zero_crossing: Flag = Field(
        default=False,
        description="With `gap`: the band counts only after the error has changed its sign within it, until the error leaves it.",
    )
    edge: Literal["inside", "outside"] = Field(
        default="inside", description="With `gap`: whether an error of exactly the band is inside it."
    )
    linearity: Reference | None = Field(default=None, description="L, with `gain-linear`: a number, or the name of a setting.")
    over: Size = Field(default=100.0, description="The |e| at which `squared` and `gain-linear` have gain 1 [as the measurement].")
    on: Literal["error", "proportional", "integral"] = Field(
        default="error",
        description="Which terms the shape counts for: P and I alike, or one of them. The derivative never sees it.",
    )


class Filter(Model):
    """The filter that goes with the derivative."""

    applies_to: Literal["term", "lead-lag", "measurement", "output"] = Field(
        description="`term`: the derivative term alone. `lead-lag` (series form): `(1 + Td s)/(1 + alpha Td s)`. `measurement`: "
        "the whole measurement path, P and I as well. `output`: the sum of the terms."
    )
    order: Literal[1, 2] = Field(
        default=1,
        description="1: `1/(1 + Tf s)`. 2: Butterworth, `1/(1 + Tf s + Tf^2 s^2/2)`, on the measurement only.",
    )
    ratio: SettingName | Number | None = Field(
        default=None,
        description="`Tf` as a multiple of the derivative dial's time: a number, or the name of a setting. Exactly one of "
        "`ratio`, `gain`, `time`.",
    )
    gain: SettingName | Number | None = Field(
        default=None, description="Derivative gain N, the inverse of `ratio`: a number, or the name of a setting."
    )
    time: SettingName | Number | None = Field(default=None, description="`Tf` itself: seconds, or the name of a setting.")
    of: Literal["derivative", "derivative-time", "effective-derivative"] = Field(
        default="derivative",
        description="The time that `ratio` or `gain` refers to. `derivative`: the derivative setting. `derivative-time`: `Td`, "
        "which is `kd/kp` in the parallel form, so that the filter time there is `kd/(kp N)`. `effective-derivative`: "
        "`Ti Td/(Ti + Td)`, the derivative time of the equivalent standard form.",
    )
    rule: GeneralRule | None = Field(
        default=None, description="Scan rule of a filter on measurement or output; by default the derivative's rule."
    )


class Derivative(Model):
    """The derivative term."""

    on: Literal["error", "pv", "weighted", "none"] = Field(
        description="What the term acts on: `error` (c = 1), `pv` (c = 0), `weighted` (c = `weight`), or `none`: no such term."
    )
    weight: SettingName | Number | None = Field(
        default=None,
        description="Setpoint weight c where `on: weighted`: a number, or the name of the setting that holds it.",
    )
    rule: Rule = Field(
        default=Rule.BACKWARD,
        description="Scan rule of the filtered derivative (specs/equations.md, section 4). Without a filter the derivative is the "
        "backward difference; `lagged-difference` has none without a filter, `four-point` has no filter.",
    )
    starts: Literal["sample", "zero"] = Field(
        default="sample",
        description="At power-up the previous signal is the first sample, so that nothing moves, or zero, so that the first scan "
        "kicks.",
    )
    filter: Filter | None = Field(default=None, description="The filter; none if absent.")


class Cascade(Model):
    """What is different in cascade, with a remote setpoint."""

    proportional: Proportional = Field(
        description="What the proportional term acts on in cascade (`on` and `weight`), in place of what it does in automatic."
    )


class Feedforward(Model):
    """A feedforward input."""

    summed: Literal["before-limits", "after-limits"] = Field(
        description="Where the feedforward signal is added: to the sum before the output limits, or to the limited output, which "
        "is limited again."
    )
    gain: Reference = Field(default=1.0, description="Gain of the feedforward signal: a number, or the name of a setting.")
