"""How a controller is operated and computed: action, scan, output, arithmetic, faults."""

from __future__ import annotations

from typing import Annotated, Any, Generic, Literal

from pidemu.card.model.base import Count, Flag, Name, Number, Part, R, means
from pidemu.card.model.declared import Only, refusal
from pidemu.card.model.marks import Beyond, Names
from pidemu.part import part


@part(frozen=True, slots=True, kw_only=True)
class Faults(Part):
    """What happens with signals that are not numbers and with scan intervals that are none."""

    signal: Annotated[
        Literal["hold", "propagate", "nan", "zero"],
        means(
            "Setpoint or measurement is NaN or infinite: `hold` the output, nothing is computed and the state stands "
            "still; `propagate`: it is computed with; `nan`, `zero`: that is the output for this scan, and the state stands still."
        ),
    ] = "hold"
    zero_interval: Annotated[
        Literal["hold", "compute"],
        means("An interval of zero: nothing is done and the last output stands, or it is computed with."),
    ] = "hold"
    negative_interval: Annotated[
        Literal["hold", "refuse", "zero"], means("A negative interval: nothing is done, an error is raised, or it counts as zero.")
    ] = "hold"


def _arithmetic(arithmetic: Any) -> str | None:
    return f"{arithmetic.type} arithmetic" if arithmetic.type != "float64" else None


@part(frozen=True, slots=True, kw_only=True)
class Arithmetic(Part):
    """How numbers are computed."""

    type: Annotated[
        Literal["float64", "float32", "integer"],
        means(
            "`float64`. `float32`, the REAL of most PLCs: every operation is rounded to 24 bits. `integer`: whole counts, "
            "with remainders that are carried to the next scan (specs/equations.md, section 7)."
        ),
        Beyond("float64", _arithmetic),
    ]
    literals: Annotated[
        Literal["float32", "float64"],
        means(
            "With `float32`: the width of the numbers written in the program; an operation with a `float64` literal is "
            "computed in float64 until it is stored."
        ),
    ] = "float32"
    counts: Annotated[
        Count | None,
        means("With `integer`: counts per percent of setpoint, measurement and output; 100 where 10000 counts are 100 %."),
    ] = None
    gain_counts: Annotated[
        Count | None, means("With `integer`: counts per unit of the gain; 100 where a dial of 1.00 is 100 counts.")
    ] = None


@part(frozen=True, slots=True, kw_only=True)
class ActionExample(Part):
    """One scan that shows which way the output moves, since vendors disagree on the words."""

    name: Annotated[Name, means("The vendor's word, one of `names`.")]
    sp: Annotated[Number, means("Setpoint; the measurement starts there.")]
    pv: Annotated[Number, means("Measurement at the next scan.")]
    output: Annotated[Literal["rises", "falls"], means("Which way the output moves.")]


def _both(names: dict[str, str]) -> dict[str, str]:
    if len(names) < 2:
        raise refusal("two_names", "names needs both 'reverse' and 'direct'")
    return names


@part(frozen=True, slots=True, kw_only=True)
class Action(Part):
    """Control action."""

    fixed: Annotated[
        Flag,
        means(
            "Whether there is no choice of action: the error is always the one under `reverse`, and the sign of the gain "
            "decides. With `pv - sp` a negative gain is reverse acting."
        ),
    ] = False
    reverse: Annotated[
        Literal["sp - pv", "pv - sp"],
        means(
            "The error of a reverse-acting controller with positive gain, as the vendor writes it. `pv - sp` means the "
            "vendor writes the direct-acting equation and changes the sign elsewhere; the output falls when the measurement rises "
            "all the same."
        ),
    ] = "sp - pv"
    names: Annotated[
        Annotated[dict[Literal["reverse", "direct"], Name], Only(after=_both)],
        means("The vendor's words for reverse acting (output falls when the measurement rises) and direct acting."),
    ]
    example: Annotated[ActionExample, means("One scan that shows the meaning of the words; a test runs it.")]

    @property
    def gain_sign(self) -> float:
        """-1 where a positive gain is direct acting (`fixed` with ``pv - sp``), else 1."""
        return -1.0 if self.fixed and self.reverse == "pv - sp" else 1.0


@part(frozen=True, slots=True, kw_only=True)
class Scan(Part):
    """Scan interval."""

    default: Annotated[Name, means("Interval used when none is given, such as `1 s`.")]
    interval: Annotated[
        Literal["nominal", "measured"],
        means("What the equations use where scans come unevenly: the nominal interval, or the one measured since the last scan."),
    ] = "nominal"


def _rate(output: Any) -> str | None:
    return f"output rate limit of {output.rate:g} per s" if output.rate is not None else None


def _deadband(output: Any) -> str | None:
    return f"output deadband of {output.deadband:g}" if output.deadband else None


def _step(output: Any) -> str | None:
    return f"output in steps of {output.resolution:g}" if output.resolution else None


@part(frozen=True, slots=True, kw_only=True)
class Output(Part, Generic[R]):
    """Output."""

    limits: Annotated[
        tuple[Number, Number],
        means("Output limits used when none are given: % of span, or engineering units with `signals: engineering`."),
    ]
    rate: Annotated[
        R | None,
        means("Fastest change of the output [as the limits, per second]: a number, or the name of a setting."),
        Names("output-rate"),
        Beyond(None, _rate),
    ] = None
    deadband: Annotated[
        R | None,
        means("The output moves only by more than this [as the limits]: a number, or the name of a setting."),
        Names("deadband"),
        Beyond(None, _deadband),
    ] = None
    resolution: Annotated[
        R | None,
        means("Step of the output [as the limits], to the nearest: a number, or the name of a setting."),
        Names("resolution"),
        Beyond(None, _step),
    ] = None
