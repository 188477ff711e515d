"""What stands around the terms: transfers, action, scan, output, arithmetic, faults."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from pidemu.card.model.base import Count, Flag, Model, Name, Number, Reference

STARTS: Final = {
    "bumpless": "does not bump",
    "load-output": "loads the output into the integral and bumps by its other terms",
    "tracked": "lets the integral track the output in manual and goes on from there",
    "keep": "keeps the integral as it stood",
    "zero": "starts with an integral of zero",
    "running": "computes on in manual, so that the output jumps to what it has computed",
}
"""What a transfer to automatic does, by `transfer.start`: said of a controller, as in "X does not bump"."""


class Transfer(Model):
    """What happens when the controller is put into automatic, and in manual before that."""

    start: Literal["bumpless", "load-output", "tracked", "keep", "zero", "running"] = Field(
        description="`bumpless`: the first automatic output equals the last output, `I = u - P - D`. `load-output`: the integral "
        "sum is loaded with the last output and the terms come on top, a bump of `P + D`. `tracked`: in manual the integral is "
        "set every scan to what the output leaves for it, and the first automatic scan moves on from there. `keep`: the integral "
        "stands as it stood. `zero`: it starts at zero. `running`: the algorithm runs on in manual, and only its output is not "
        "used."
    )
    preset: Literal["none", "output", "integral", "initial"] = Field(
        default="none",
        description="What a user can set by hand for the transfer. `none`: no source says that there is such a thing. `output`, "
        "with `load-output`: the value that is loaded, which may be another than the last output. `integral`, with `keep`, `zero` "
        "and `running`: what the integral holds (`integral.holds`), at any time. `initial`, with these: the same, before the first "
        "scan of all only.",
    )
    derivative: Literal["running", "restarted", "zeroed", "preset"] = Field(
        default="running",
        description="`running`: filters and differences go on in manual. `restarted`: they start afresh at the transfer. "
        "`zeroed`: at the transfer the previous signal counts as zero, so that the derivative kicks. `preset`: in manual the "
        "history is the present sample and the term is zero.",
    )
    without_integral: Literal["kept", "zero"] = Field(
        default="kept",
        description="With the integral switched off: what it holds stays as a constant (with `load-output` what was loaded, "
        "otherwise what it held when it was switched off while running), or is zero.",
    )
    first_scan: Literal["integrates", "holds"] = Field(
        default="integrates",
        description="Whether the integral grows in the first automatic scan after `load-output`, `keep` or `zero`; with "
        "`running`, in the very first scan.",
    )
    loaded: Literal["limited", "as-it-is"] = Field(
        default="limited", description="With `load-output`: whether the output is limited to the output limits before it is loaded."
    )
    power_up: Literal["transfer", "zero"] = Field(
        default="transfer",
        description="The very first scan, in automatic: a `transfer` from the initial output, or the integral begins at `zero`, "
        "whatever the output was.",
    )
    first_output: Literal["computed", "zero"] = Field(
        default="computed",
        description="The output of the very first scan: computed, or zero because that scan only prepares the block.",
    )
    manual_output: Literal["operator", "gain-times-operator", "zero"] = Field(
        default="operator",
        description="The output in manual: the operator's, that multiplied by the gain, or zero.",
    )
    changes: Literal["as-held", "bumpless"] = Field(
        default="as-held",
        description="A setting changed in automatic: the new setting acts on what the integral holds (`integral.holds`), or the "
        "integral is set so that the output does not move.",
    )


class Faults(Model):
    """What happens with signals that are not numbers and with scan intervals that are none."""

    signal: Literal["hold", "propagate", "nan", "zero"] = Field(
        default="hold",
        description="Setpoint or measurement is NaN or infinite: `hold` the output, nothing is computed and the state stands "
        "still; `propagate`: it is computed with; `nan`, `zero`: that is the output for this scan, and the state stands still.",
    )
    zero_interval: Literal["hold", "compute"] = Field(
        default="hold", description="An interval of zero: nothing is done and the last output stands, or it is computed with."
    )
    negative_interval: Literal["hold", "refuse", "zero"] = Field(
        default="hold", description="A negative interval: nothing is done, an error is raised, or it counts as zero."
    )


class Arithmetic(Model):
    """How numbers are computed."""

    type: Literal["float64", "float32", "integer"] = Field(
        description="`float64`. `float32`, the REAL of most PLCs: every operation is rounded to 24 bits. `integer`: whole counts, "
        "with remainders that are carried to the next scan (specs/equations.md, section 7)."
    )
    literals: Literal["float32", "float64"] = Field(
        default="float32",
        description="With `float32`: the width of the numbers written in the program; an operation with a `float64` literal is "
        "computed in float64 until it is stored.",
    )
    counts: Count | None = Field(
        default=None,
        description="With `integer`: counts per percent of setpoint, measurement and output; 100 where 10000 counts are 100 %.",
    )
    gain_counts: Count | None = Field(
        default=None, description="With `integer`: counts per unit of the gain; 100 where a dial of 1.00 is 100 counts."
    )


class ActionExample(Model):
    """One scan that shows which way the output moves, since vendors disagree on the words."""

    name: Name = Field(description="The vendor's word, one of `names`.")
    sp: Number = Field(description="Setpoint; the measurement starts there.")
    pv: Number = Field(description="Measurement at the next scan.")
    output: Literal["rises", "falls"] = Field(description="Which way the output moves.")


def _both(names: dict[str, str]) -> dict[str, str]:
    if len(names) < 2:
        raise PydanticCustomError("two_names", "names needs both 'reverse' and 'direct'")
    return names


class Action(Model):
    """Control action."""

    fixed: Flag = Field(
        default=False,
        description="Whether there is no choice of action: the error is always the one under `reverse`, and the sign of the gain "
        "decides. With `pv - sp` a negative gain is reverse acting.",
    )

    reverse: Literal["sp - pv", "pv - sp"] = Field(
        default="sp - pv",
        description="The error of a reverse-acting controller with positive gain, as the vendor writes it. `pv - sp` means the "
        "vendor writes the direct-acting equation and changes the sign elsewhere; the output falls when the measurement rises all "
        "the same.",
    )
    names: Annotated[dict[Literal["reverse", "direct"], Name], AfterValidator(_both)] = Field(
        description="The vendor's words for reverse acting (output falls when the measurement rises) and direct acting."
    )
    example: ActionExample = Field(description="One scan that shows the meaning of the words; a test runs it.")


class Scan(Model):
    """Scan interval."""

    default: Name = Field(description="Interval used when none is given, such as `1 s`.")
    interval: Literal["nominal", "measured"] = Field(
        default="nominal",
        description="What the equations use where scans come unevenly: the nominal interval, or the one measured since the last "
        "scan.",
    )


class Output(Model):
    """Output."""

    limits: tuple[Number, Number] = Field(
        description="Output limits used when none are given: % of span, or engineering units with `signals: engineering`."
    )
    rate: Reference | None = Field(
        default=None, description="Fastest change of the output [as the limits, per second]: a number, or the name of a setting."
    )
    deadband: Reference | None = Field(
        default=None, description="The output moves only by more than this [as the limits]: a number, or the name of a setting."
    )
    resolution: Reference | None = Field(
        default=None, description="Step of the output [as the limits], to the nearest: a number, or the name of a setting."
    )
