"""The card language, version 1: what a card may say.

Every field's description is its reference: ``specs/card-language.md`` and ``specs/card.schema.json`` are generated from here.
"""

from __future__ import annotations

import re
from datetime import date
from enum import StrEnum
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema
from pydantic_core import PydanticCustomError


def _hyphen(name: str) -> str:
    return name.rstrip("_").replace("_", "-")


def _infinity(value: Any) -> Any:
    return float(value) if value in ("inf", "-inf") else value


def _day(value: Any) -> Any:
    if not (isinstance(value, str) and re.fullmatch(r"\d{4}-\d\d-\d\d", value)):  # 2026 and 0 are no days
        raise PydanticCustomError("date_type", "not a date")
    return value


class Model(BaseModel):
    """Base of every part of a card: frozen, and nothing but the documented keys."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        alias_generator=_hyphen,
        populate_by_name=False,
        str_strip_whitespace=True,
        defer_build=True,  # parts are built within the whole; by themselves only where they are used
    )


Text = Annotated[str, Field(min_length=1)]
Number = Annotated[
    float,
    Field(strict=True),
    BeforeValidator(_infinity),
    WithJsonSchema({"anyOf": [{"type": "number"}, {"enum": ["inf", "-inf"]}]}),
]
Day = Annotated[date, BeforeValidator(_day)]
Flag = Annotated[bool, Field(strict=True)]
SettingName = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]


class Form(StrEnum):
    """How the terms are put together."""

    PARALLEL = "parallel"
    STANDARD = "standard"
    SERIES = "series"
    DAHLIN = "dahlin"


class Rule(StrEnum):
    """What replaces ``s`` when the equation is computed scan by scan; the last three are rules of the derivative only."""

    BACKWARD = "backward"
    FORWARD = "forward"
    TRAPEZOIDAL = "trapezoidal"
    EXACT = "exact"
    LAGGED_DIFFERENCE = "lagged-difference"
    FOUR_POINT = "four-point"


GENERAL_RULES: Final = (Rule.BACKWARD, Rule.FORWARD, Rule.TRAPEZOIDAL)
"""Rules of everything that is integrated or filtered."""
GeneralRule = Literal[Rule.BACKWARD, Rule.FORWARD, Rule.TRAPEZOIDAL]


class Status(StrEnum):
    """How sure a statement is."""

    DOCUMENTED = "documented"
    MEASURED = "measured"
    INFERRED = "inferred"
    ASSUMED = "assumed"


class Source(Model):
    """A document or program that the card rests on."""

    title: Text = Field(description="Title of the document, with number and edition; or name and version of the program.")
    address: Text | None = Field(default=None, description="Where it can be read: address, document number or repository path.")
    read: Day = Field(description="The day it was read.")
    note: Text | None = Field(
        default=None, description="What kind of witness it is, where that matters (a forum post, third-party code)."
    )


class Evidence(Model):
    """Where a statement of the card comes from, and how sure it is."""

    status: Status = Field(
        description="`documented` (the source says so), `measured` (an output of the real thing shows it), `inferred` (it follows "
        "from something documented) or `assumed` (nobody says so; shown wherever a result rests on it)."
    )
    source: Text | None = Field(default=None, description="Key of an entry under `sources`. Required unless `assumed`.")
    at: Text | None = Field(
        default=None,
        description="Place in the source: page, section, function. Required for `documented` and `measured`.",
    )
    note: Text | None = Field(default=None, description="Why: required for `inferred` and `assumed`.")


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


Reference = SettingName | Number
"""A number, or the name of the setting that holds it."""


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
    over: Annotated[float, Field(gt=0, strict=True)] = Field(
        default=100.0, description="The |e| at which `squared` and `gain-linear` have gain 1 [as the measurement]."
    )
    on: Literal["error", "proportional", "integral"] = Field(
        default="error",
        description="Which terms the shape counts for: P and I alike, or one of them. The derivative never sees it.",
    )


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
        "integration while the output is beyond a limit and the increment would push it further."
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
    fast_return: Annotated[float, Field(ge=1, strict=True)] = Field(
        default=1.0,
        description="While the sum is beyond a limit and the integral on its way back, the integral time is divided by this.",
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


class WindupExternalReset(Model):
    """Integral by positive feedback."""

    scheme: Literal["external-reset"] = Field(
        description="The integral is a first-order lag, of the integral time, fed with the limited output less the other terms: "
        "it stands still while the output stands at a limit. Backward and forward rules only. An external reset signal takes the "
        "place of the limited output."
    )
    fast_return: Annotated[float, Field(ge=1, strict=True)] = Field(
        default=1.0,
        description="While the sum is beyond a limit and the integral on its way back, the integral time is divided by this.",
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
    of: Literal["derivative", "effective-derivative"] = Field(
        default="derivative",
        description="The time that `ratio` or `gain` refers to: the derivative setting, or `Ti Td/(Ti + Td)`, the derivative time "
        "of the equivalent standard form.",
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


class Transfer(Model):
    """What happens when the controller is put into automatic, and in manual before that."""

    start: Literal["bumpless", "load-output", "tracked", "keep", "zero", "running"] = Field(
        description="`bumpless`: the first automatic output equals the last output, `I = u - P - D`. `load-output`: the integral "
        "sum is loaded with the last output and the terms come on top, a bump of `P + D`. `tracked`: in manual the integral is "
        "set every scan to what the output leaves for it, and the first automatic scan moves on from there. `keep`: the integral "
        "stands as it stood. `zero`: it starts at zero. `running`: the algorithm runs on in manual, and only its output is not "
        "used."
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
    counts: Annotated[int, Field(gt=0, strict=True)] | None = Field(
        default=None,
        description="With `integer`: counts per percent of setpoint, measurement and output; 100 where 10000 counts are 100 %.",
    )
    gain_counts: Annotated[int, Field(gt=0, strict=True)] | None = Field(
        default=None, description="With `integer`: counts per unit of the gain; 100 where a dial of 1.00 is 100 counts."
    )


class Setting(Model):
    """A dial."""

    sets: Literal[
        "gain", "multiplier", "integral", "derivative", "filter-time", "filter-ratio", "filter-gain",
        "proportional-weight", "derivative-weight", "tracking-time", "filter-factor", "integral-limit", "deadband", "gap-gain",
        "linearity", "feedforward-gain", "bias", "output-rate", "setpoint-rate", "resolution", "process-gain", "process-time",
        "process-delay", "closed-loop-time",
    ] = Field(description="What the dial sets, and with that its unit's meaning; see *Settings* above, and specs/equations.md, "
              "section 1.")  # fmt: skip
    unit: Text = Field(
        description="Unit of a bare number, such as `%/%`, `%` (proportional band), `s/repeat`, `repeat/min`, `1/s`, `min`, `Hz`, "
        "`eu`, `%/s`."
    )
    about: Text | None = Field(default=None, description="The vendor's own name or words for it.")
    default: Number | None = Field(
        default=None,
        description="Value taken when the setting is not given. Either the vendor's delivered value (then with evidence), or the "
        "value that switches the term off, or leaves it as it is.",
    )
    range: tuple[Number, Number] | None = Field(
        default=None, description="Smallest and largest value, in `unit`; off values may lie outside."
    )
    off: Number | list[Number] | None = Field(
        default=None, description="Value, or values, that switch the term off; the first is used in conversions."
    )
    scope: Literal["loop", "module"] = Field(
        default="loop",
        description="`module`: a setting that many loops share; conversions leave it at its default unless told otherwise.",
    )
    resolution: Annotated[float, Field(gt=0, strict=True)] | None = Field(
        default=None, description="Smallest step of the dial, in `unit`."
    )


class Option(Model):
    """Something the vendor lets you choose per loop."""

    about: Text | None = Field(default=None, description="The vendor's own name or words for it.")
    default: Text = Field(description="The choice taken when none is given.")
    choices: dict[Text, dict[str, Any]] = Field(
        min_length=1,
        description="What each choice changes: the fields of the algorithm that it overlays, as in the card itself. `filter` and "
        "`windup` are replaced whole; null removes a key.",
    )


class ActionExample(Model):
    """One scan that shows which way the output moves, since vendors disagree on the words."""

    name: Text = Field(description="The vendor's word, one of `names`.")
    sp: Number = Field(description="Setpoint; the measurement starts there.")
    pv: Number = Field(description="Measurement at the next scan.")
    output: Literal["rises", "falls"] = Field(description="Which way the output moves.")


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
    names: dict[Literal["reverse", "direct"], Text] = Field(
        description="The vendor's words for reverse acting (output falls when the measurement rises) and direct acting."
    )
    example: ActionExample = Field(description="One scan that shows the meaning of the words; a test runs it.")


class Scan(Model):
    """Scan interval."""

    default: Text = Field(description="Interval used when none is given, such as `1 s`.")
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


class Quirk(Model):
    """A fact worth knowing that the equation does not show."""

    text: Text = Field(description="The fact.")
    source: Text | None = Field(default=None, description="Key of an entry under `sources`.")
    at: Text | None = Field(default=None, description="Place in the source.")


class Canonical(Model):
    """Parallel gains and filter time of the feedback path (specs/equations.md, section 3, exact conversion to parallel)."""

    kp: Number = Field(description="Proportional gain [%/%].")
    ki: Number = Field(description="Integral gain [1/s].")
    kd: Number = Field(description="Derivative gain [s].")
    Tf: Number = Field(default=0.0, description="Filter time [s].", alias="Tf")


class Example(Model):
    """Settings and what they amount to; a test runs every one."""

    given: dict[str, str | Number] = Field(description="Settings and options by name.")
    canonical: Canonical | None = Field(
        default=None,
        description="The equivalent parallel gains of the feedback path, to six digits. At least one of `canonical` and `outputs`.",
    )
    outputs: list[Number] | None = Field(
        default=None,
        description="The output of the first automatic scans after a setpoint step of 1 from rest at 50, less the output before, "
        "at the card's scan interval and without limits; to six digits.",
    )
    source: Text | None = Field(
        default=None,
        description="Key of an entry under `sources`, where the example is printed; absent if it is our own arithmetic.",
    )
    at: Text | None = Field(default=None, description="Place in the source.")
    note: Text | None = Field(default=None, description="What the example shows.")


class Equation(Model):
    """The fields of a card that make its equation; options overlay them."""

    signals: Literal["percent", "engineering"] = Field(
        default="percent",
        description="Whether the controller computes in percent of span or in engineering units, so that its gains carry them.",
    )
    form: Form = Field(
        description="`parallel`: `kp + ki/s + kd s`. `standard` (ideal, ISA): `K (1 + 1/(Ti s) + Td s)`. `series` (interacting): "
        "`K (1 + 1/(Ti s)) (1 + Td s)`. `dahlin`: pole cancellation, `D(z)` of a first-order process with dead time "
        "(specs/equations.md, section 4)."
    )
    implementation: Literal["positional", "velocity"] = Field(
        description="`positional`: the output is the sum of the terms. `velocity`: their increments are added to the last limited "
        "output."
    )
    setpoint: Setpoint | None = Field(
        default=None, description="What is done to the setpoint before the algorithm; nothing if absent."
    )
    measurement: Measurement | None = Field(
        default=None, description="What is done to the measurement before it; nothing if absent."
    )
    error: ErrorShape | None = Field(default=None, description="What is done to the error; nothing if absent.")
    proportional: Proportional = Field(description="The proportional term.")
    cascade: Cascade | None = Field(
        default=None, description="What is different in cascade, with a remote setpoint; nothing if absent."
    )
    integral: Integral = Field(description="The integral term.")
    derivative: Derivative = Field(description="The derivative term.")
    feedforward: Feedforward | None = Field(default=None, description="Feedforward input; none if absent.")
    transfer: Transfer = Field(description="What happens when the controller is put into automatic.")
    action: Action = Field(description="Control action.")
    scan: Scan = Field(description="Scan interval.")
    output: Output = Field(description="Output.")
    arithmetic: Arithmetic | None = Field(default=None, description="How numbers are computed; float64 if absent.")
    faults: Faults | None = Field(
        default=None,
        description="What signals that are no numbers and scan intervals of zero or less do; nothing is computed "
        "and the output stands, if absent.",
    )
    settings: dict[SettingName, Setting] = Field(min_length=1, description="The dials, by the vendor's own names.")


class CardFile(Equation):
    """One PID algorithm of one product."""

    card: Literal[1] = Field(description="Version of the card language.")
    vendor: Text = Field(description="Maker, or the community that keeps the program.")
    product: Text = Field(description="Product line.")
    algorithm: Text = Field(description="The algorithm within the product.")
    about: Text | None = Field(default=None, description="What a reader should know first, in a few sentences.")
    sources: dict[Text, Source] = Field(description="What the card rests on, by a short key.")
    options: dict[SettingName, Option] = Field(default={}, description="What the vendor lets you choose per loop.")
    evidence: dict[Text, Evidence] = Field(
        description="Where each statement comes from: a path in the card, such as `derivative.filter` or "
        "`options.FORM.choices.Series`, covers everything below it; the longest path wins."
    )
    quirks: list[Quirk] = Field(default=[], description="Facts worth knowing that the equation does not show.")
    examples: list[Example] = Field(min_length=1, description="Settings and what they amount to; every one is run.")
