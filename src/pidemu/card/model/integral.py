"""The integral term, its limits, and what happens to it at an output limit."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pidemu.card.model.base import Flag, GeneralRule, Model, Number, Reference, SettingName


class WindupNone(Model):
    """The integral goes on whatever the output does."""

    scheme: Literal["none"] = Field(description="Integrate always.")


class WindupClamp(Model):
    """The integral sum is limited."""

    scheme: Literal["clamp", "clamp-sum"] = Field(
        description="`clamp`: limit the integral sum to the output limits, before it is used. `clamp-sum`: the same for an "
        "accumulator that also holds P on PV."
    )
    without_integral: Literal["zero", "limited"] = Field(
        default="zero",
        description="With the integral switched off and nothing loaded: the sum is zero, or what the limits make of zero.",
    )


class WindupGate(Model):
    """Integration stops at a limit."""

    scheme: Literal["freeze", "conditional"] = Field(
        description="`freeze`: no integration that pushes further while the last output is at a limit. `conditional`: no "
        "integration beyond a limit; an increment that leads there counts as far as the limit."
    )
    judged_on: Literal["output", "sum-without-derivative", "sum"] = Field(
        default="output",
        description="What `freeze` looks at: the last output; P + I of the last scan, before the derivative was added; or this "
        "scan's sum with the increment, which then counts for the output but is not kept.",
    )
    direction: Literal["further", "both", "unless-smaller"] = Field(
        default="further",
        description="With `freeze`: stop only what pushes further; stop the integral whichever way it would move; or stop it "
        "unless its size becomes smaller.",
    )
    resumes_from: Literal["last", "last-integrated"] = Field(
        default="last",
        description="With `freeze` and the trapezoidal rule: after a freeze the increment starts from the last error, or from the "
        "last one that was integrated.",
    )
    test: Literal["increment", "error-times-output"] = Field(
        default="increment",
        description="What `conditional` takes for pushing further: the sign of the increment, or that of error times the sum "
        "before limits.",
    )
    last_increment: Literal["to-the-limit", "dropped"] = Field(
        default="to-the-limit",
        description="What `conditional` does with an increment that leads beyond the limit: it keeps what leads to the limit, or "
        "nothing. `dropped` stops short of the limit for as long as the error stays: only with a source that says so.",
    )


class WindupRecompute(Model):
    """At a limit the integral is set to what the limit leaves for it."""

    scheme: Literal["recompute"] = Field(description="Where the sum reaches a limit: `I = limit - P - D`, after the output.")
    without_derivative: Flag = Field(
        default=False,
        description="Whether the derivative comes last: `P + I` is limited, with `I = limit - P`, then D is added and the sum "
        "limited again.",
    )
    clamped: Flag = Field(default=False, description="Whether the integral is limited to the output limits as well.")


class WindupResetOutsideBand(Model):
    """The integral is cleared while the measurement is outside the proportional band."""

    scheme: Literal["reset-outside-band"] = Field(
        description="`I = 0` while the proportional action alone, `kp |e|`, is larger than the output span."
    )


class WindupBackCalculation(Model):
    """The integral is pulled back by the amount cut off."""

    scheme: Literal["back-calculation"] = Field(description="After the output: `I += (h/Tt) (u - v)`, v before limits, u after.")
    tracking_time: SettingName | Number | Literal["Ti", "sqrt(Ti Td)"] = Field(
        description="Tracking time Tt: seconds, the name of a setting, `Ti`, or `sqrt(Ti Td)` (`Ti` where there is no derivative)."
    )
    times: Literal["Ti"] | None = Field(
        default=None, description="`Ti`: the number or setting under `tracking-time` is a multiple of the integral time."
    )
    when_off: Literal["Ti", "sqrt(Ti Td)"] | None = Field(
        default=None, description="The tracking time taken where the setting under `tracking-time` has its off value."
    )
    implicit: Flag = Field(
        default=False, description="Whether the share per scan is `h/(Tt + h)`, as an implicit solver has it, instead of `h/Tt`."
    )


class FastReturn(Model):
    """An integral that comes back faster from beyond limits of its own."""

    factor: Annotated[float, Field(ge=1, le=1e6, strict=True, allow_inf_nan=False)] = Field(
        description="The integral time is divided by this while the output is beyond one of the limits and the integral on its "
        "way back, until the output is back at that limit."
    )
    high: Reference = Field(description="High limit [as the output]: a number, or the name of a setting.")
    low: Reference = Field(description="Low limit, likewise.")


class WindupExternalReset(Model):
    """Integral by positive feedback."""

    scheme: Literal["external-reset"] = Field(
        description="The integral is a first-order lag, of the integral time, fed with the limited output, less the derivative, "
        "plus what P does not see of the error, `K (e - p)`: it stands still while the output stands at a limit. Backward and "
        "forward rules only. An external reset signal takes the place of the limited output."
    )
    fast_return: FastReturn | None = Field(
        default=None, description="How the integral comes back from beyond limits that are not the output's; as ever, if absent."
    )


class WindupVelocity(Model):
    """What the incremental form does by itself."""

    scheme: Literal["velocity"] = Field(
        description="The increment is added to the last limited output; nothing else is done. Required, and only allowed, with "
        "`implementation: velocity`."
    )
    reads_back: Flag = Field(
        default=False,
        description="Whether the increment is added to the external reset signal, the output read back from downstream, where "
        "there is one.",
    )


Windup = Annotated[
    WindupNone
    | WindupClamp
    | WindupGate
    | WindupRecompute
    | WindupBackCalculation
    | WindupExternalReset
    | WindupVelocity
    | WindupResetOutsideBand,
    Field(discriminator="scheme"),
]


class IntegralLimits(Model):
    """Limits of the integral itself."""

    high: Reference | Literal["output"] = Field(
        description="Upper limit: a number, the name of a setting, or `output`: the output's own limit."
    )
    low: Reference | Literal["output"] | None = Field(
        default=None, description="Lower limit, likewise; by default the upper one negated."
    )


class Integral(Model):
    """The integral term."""

    on: Literal["error", "none"] = Field(default="error", description="`error`, or `none`: no such term.")
    rule: GeneralRule = Field(
        description="Scan rule of the integral (specs/equations.md, section 4). `forward` adds this scan's error after the output."
    )
    holds: Literal["ki e", "e/Ti", "e"] = Field(
        default="ki e",
        description="What the integral remembers. The sum of `ki e`: a changed gain or integral time counts for what is still to "
        "come. The sum of `e/Ti`, multiplied by the gain afterwards, or of `e`, multiplied by gain and 1/Ti afterwards: a change "
        "counts for the whole sum, and bumps (specs/equations.md, section 6).",
    )
    limits: IntegralLimits | None = Field(
        default=None,
        description="Limits of what the integral remembers, besides what `windup` does: in output units for `ki e`, "
        "otherwise before the gain.",
    )
    starts: Literal["sample", "zero"] = Field(
        default="sample",
        description="With the trapezoidal rule: at power-up the previous error is the first one, or zero, so that half of the "
        "first counts.",
    )
    deadband: Reference | None = Field(
        default=None,
        description="The integral stands still while |e| is at most this [as the measurement]: a number, or the name of a setting.",
    )
    windup: Windup = Field(description="What happens to the integral at an output limit (specs/equations.md, section 5).")
