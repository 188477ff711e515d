"""The terms of an equation but the integral: proportional, derivative with its filter, feedforward; and cascade."""

from __future__ import annotations

from typing import Annotated, Generic, Literal

from pidemu.card.model.base import Flag, GeneralRule, Part, R, Rule, means
from pidemu.card.model.marks import AtRest, Names, PerScan
from pidemu.part import part


@part(frozen=True, slots=True, kw_only=True)
class Proportional(Part, Generic[R]):
    """The proportional term."""

    on: Annotated[
        Literal["error", "pv", "weighted", "none"],
        means("What the term acts on: `error` (b = 1), `pv` (b = 0), `weighted` (b = `weight`), or `none`: no such term."),
    ]
    weight: Annotated[
        R | None,
        means("Setpoint weight b where `on: weighted`: a number, or the name of the setting that holds it."),
        Names("proportional-weight"),
    ] = None
    accumulated: Annotated[
        Flag,
        means(
            "Whether a term on PV is accumulated from its value at the start, `P -= kp (y_n - y_{n-1})`, instead of being "
            "`-kp y_n`. With `windup.scheme: clamp-sum` it accumulates into the integral's own sum."
        ),
    ] = False


@part(frozen=True, slots=True, kw_only=True)
class Filter(Part, Generic[R]):
    """The filter that goes with the derivative."""

    applies_to: Annotated[
        Literal["term", "lead-lag", "measurement", "output"],
        means(
            "`term`: the derivative term alone. `lead-lag` (series form): `(1 + Td s)/(1 + alpha Td s)`. `measurement`: "
            "the whole measurement path, P and I as well. `output`: the sum of the terms."
        ),
    ]
    order: Annotated[
        Literal[1, 2], means("1: `1/(1 + Tf s)`. 2: Butterworth, `1/(1 + Tf s + Tf^2 s^2/2)`, on the measurement only.")
    ] = 1
    ratio: Annotated[
        R | None,
        means(
            "`Tf` as a multiple of the derivative dial's time: a number, or the name of a setting. Exactly one of "
            "`ratio`, `gain`, `time`."
        ),
        Names("filter-ratio"),
    ] = None
    gain: Annotated[
        R | None, means("Derivative gain N, the inverse of `ratio`: a number, or the name of a setting."), Names("filter-gain")
    ] = None
    time: Annotated[R | None, means("`Tf` itself: seconds, or the name of a setting."), Names("filter-time")] = None
    of: Annotated[
        Literal["derivative", "derivative-time", "effective-derivative"],
        means(
            "The time that `ratio` or `gain` refers to. `derivative`: the derivative setting. `derivative-time`: `Td`, "
            "which is `kd/kp` in the parallel form, so that the filter time there is `kd/(kp N)`. `effective-derivative`: "
            "`Ti Td/(Ti + Td)`, the derivative time of the equivalent standard form."
        ),
    ] = "derivative"
    rule: Annotated[
        GeneralRule | None, means("Scan rule of a filter on measurement or output; by default the derivative's rule."), PerScan()
    ] = None


@part(frozen=True, slots=True, kw_only=True)
class Derivative(Part, Generic[R]):
    """The derivative term."""

    on: Annotated[
        Literal["error", "pv", "weighted", "none"],
        means("What the term acts on: `error` (c = 1), `pv` (c = 0), `weighted` (c = `weight`), or `none`: no such term."),
    ]
    weight: Annotated[
        R | None,
        means("Setpoint weight c where `on: weighted`: a number, or the name of the setting that holds it."),
        Names("derivative-weight"),
    ] = None
    rule: Annotated[
        Rule,
        means(
            "Scan rule of the filtered derivative (specs/equations.md, section 4). Without a filter the derivative is the "
            "backward difference; `lagged-difference` has none without a filter, `four-point` has no filter."
        ),
        PerScan(),
    ] = Rule.BACKWARD
    starts: Annotated[
        Literal["sample", "zero"],
        means("At power-up the previous signal is the first sample, so that nothing moves, or zero, so that the first scan kicks."),
        PerScan(),
        AtRest("sample"),
    ] = "sample"
    filter: Annotated[Filter[R] | None, means("The filter; none if absent.")] = None
    holds: Annotated[
        Literal["kd d", "d"],
        means(
            "What a filtered derivative remembers, which shows when its gain is changed while running: `kd d`, the term, or `d`, "
            "the derivative without its gain, on which a changed gain acts at once."
        ),
        PerScan(),
    ] = "kd d"


@part(frozen=True, slots=True, kw_only=True)
class Cascade(Part, Generic[R]):
    """What is different in cascade, with a remote setpoint."""

    proportional: Annotated[
        Proportional[R],
        means("What the proportional term acts on in cascade (`on` and `weight`), in place of what it does in automatic."),
    ]


@part(frozen=True, slots=True, kw_only=True)
class Feedforward(Part, Generic[R]):
    """A feedforward input."""

    summed: Annotated[
        Literal["before-limits", "after-limits"],
        means(
            "Where the feedforward signal is added: to the sum before the output limits, or to the limited output, which "
            "is limited again."
        ),
    ]
    gain: Annotated[R, means("Gain of the feedforward signal: a number, or the name of a setting."), Names("feedforward-gain")] = (
        1.0  # type: ignore[assignment]  # of every R
    )
