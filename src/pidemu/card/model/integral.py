"""The integral term and its own limits; what happens to it at an output limit is in `pidemu.card.windup`."""

from __future__ import annotations

from typing import Annotated, Any, Generic, Literal

from pidemu.card.model.base import GeneralRule, Part, R, means
from pidemu.card.model.marks import AtRest, Beyond, Names, PerScan
from pidemu.card.windup import Windup
from pidemu.part import part


@part(frozen=True, slots=True, kw_only=True)
class IntegralLimits(Part, Generic[R]):
    """Limits of the integral itself."""

    high: Annotated[
        R | Literal["output"],
        means("Upper limit: a number, the name of a setting, or `output`: the output's own limit."),
        Names("integral-limit", ("output",)),
    ]
    low: Annotated[
        R | Literal["output"] | None,
        means("Lower limit, likewise; by default the upper one negated."),
        Names("integral-limit", ("output",)),
    ] = None


def _deadband(integral: Any) -> str | None:
    return f"integral deadband of {integral.deadband:g}" if integral.deadband else None


@part(frozen=True, slots=True, kw_only=True)
class Integral(Part, Generic[R]):
    """The integral term."""

    on: Annotated[Literal["error", "none"], means("`error`, or `none`: no such term.")] = "error"
    rule: Annotated[
        GeneralRule,
        means("Scan rule of the integral (specs/equations.md, section 4). `forward` adds this scan's error after the output."),
        PerScan(),
    ]
    holds: Annotated[
        Literal["ki e", "e/Ti", "e"],
        means(
            "What the integral remembers. The sum of `ki e`: a changed gain or integral time counts for what is still to "
            "come. The sum of `e/Ti`, multiplied by the gain afterwards, or of `e`, multiplied by gain and 1/Ti afterwards (in the "
            "parallel form by the integral gain): a change counts for the whole sum, and bumps (specs/equations.md, section 6)."
        ),
        PerScan(),
    ] = "ki e"
    limits: Annotated[
        IntegralLimits[R] | None,
        means(
            "Limits of what the integral remembers, besides what `windup` does: in output units for `ki e`, "
            "otherwise before the gain, for `e` in error times seconds."
        ),
        PerScan(),
        Beyond(None),
    ] = None
    starts: Annotated[
        Literal["sample", "zero"],
        means(
            "With the trapezoidal rule: at power-up the previous error is the first one, or zero, so that half of the first counts."
        ),
        PerScan(),
        AtRest("sample"),
    ] = "sample"
    deadband: Annotated[
        R | None,
        means("The integral stands still while |e| is at most this [as the measurement]: a number, or the name of a setting."),
        Names("deadband"),
        PerScan(),
        Beyond(None, _deadband),
    ] = None
    windup: Annotated[
        Windup[R], means("What happens to the integral at an output limit (specs/equations.md, section 5)."), PerScan()
    ]
