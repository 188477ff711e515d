"""The card language, version 1: what a card may say.

Every field's description is its reference: ``specs/card-language.md`` and ``specs/card.schema.json`` are generated from here and
from the modules that this one puts together: those beside it, and the windup schemes and transfers.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from pidemu.card.model.base import Evidence, Form, Model, Name, Number, Reference, SettingName, Size, Source, Text
from pidemu.card.model.integral import Integral
from pidemu.card.model.marks import PerScan
from pidemu.card.model.operation import Action, Arithmetic, Faults, Output, Scan
from pidemu.card.model.signals import ErrorShape, Measurement, Setpoint
from pidemu.card.model.terms import Cascade, Derivative, Feedforward, Proportional
from pidemu.card.transfer import Transfer
from pidemu.units import Role, parse_quantity, to_canonical


class Setting(Model):
    """A dial."""

    sets: Literal[
        "gain", "multiplier", "integral", "derivative", "filter-time", "filter-ratio", "filter-gain",
        "proportional-weight", "derivative-weight", "tracking-time", "filter-factor", "integral-limit", "windup-limit", "deadband",
        "gap-gain", "linearity", "feedforward-gain", "bias", "output-rate", "setpoint-rate", "resolution", "process-gain",
        "process-time", "process-delay", "closed-loop-time",
    ] = Field(description="What the dial sets, and with that its unit's meaning; see *Settings* above, and specs/equations.md, "
              "section 1.")  # fmt: skip
    unit: Name = Field(
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
    off: Number | Annotated[list[Number], Field(max_length=10)] | None = Field(
        default=None, description="Value, or values, that switch the term off; the first is used in conversions."
    )
    scope: Literal["loop", "module"] = Field(
        default="loop",
        description="`module`: a setting that many loops share; conversions leave it at its default unless told otherwise.",
    )
    resolution: Size | None = Field(default=None, description="Smallest step of the dial, in `unit`.")


class Option(Model):
    """Something the vendor lets you choose per loop."""

    about: Text | None = Field(default=None, description="The vendor's own name or words for it.")
    default: Name = Field(description="The choice taken when none is given.")
    choices: dict[Name, dict[str, Any]] = Field(
        min_length=1,
        max_length=50,
        description="What each choice changes: the fields of the algorithm that it overlays, as in the card itself. `filter` and "
        "`windup` are replaced whole; null removes a key.",
    )


class Quirk(Model):
    """A fact worth knowing that the equation does not show."""

    text: Text = Field(description="The fact.")
    source: Name | None = Field(default=None, description="Key of an entry under `sources`.")
    at: Text | None = Field(default=None, description="Place in the source.")


class Canonical(Model):
    """Parallel gains and filter time of the feedback path (specs/equations.md, section 3, exact conversion to parallel)."""

    kp: Number = Field(description="Proportional gain [%/%].")
    ki: Number = Field(description="Integral gain [1/s].")
    kd: Number = Field(description="Derivative gain [s].")
    Tf: Number = Field(default=0.0, description="Filter time [s].", alias="Tf")


class Example(Model):
    """Settings and what they amount to; a test runs every one."""

    given: dict[Name, Name | Number] = Field(description="Settings and options by name.")
    canonical: Canonical | None = Field(
        default=None,
        description="The equivalent parallel gains of the feedback path, to six digits. At least one of `canonical` and `outputs`.",
    )
    outputs: list[Number] | None = Field(
        default=None,
        max_length=1000,
        description="The output of the first automatic scans after a setpoint step of 1 from rest at 50, less the output before, "
        "at the card's scan interval and without limits; to six digits.",
    )
    source: Name | None = Field(
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
    implementation: Annotated[Literal["positional", "velocity"], PerScan()] = Field(
        description="`positional`: the output is the sum of the terms. `velocity`: their increments are added to the last limited "
        "output."
    )
    setpoint: Setpoint[Reference] | None = Field(
        default=None, description="What is done to the setpoint before the algorithm; nothing if absent."
    )
    measurement: Measurement[Reference] | None = Field(
        default=None, description="What is done to the measurement before it; nothing if absent."
    )
    error: ErrorShape[Reference] | None = Field(default=None, description="What is done to the error; nothing if absent.")
    proportional: Proportional[Reference] = Field(description="The proportional term.")
    cascade: Annotated[Cascade[Reference] | None, PerScan()] = Field(
        default=None, description="What is different in cascade, with a remote setpoint; nothing if absent."
    )
    integral: Integral[Reference] = Field(description="The integral term.")
    derivative: Derivative[Reference] = Field(description="The derivative term.")
    feedforward: Annotated[Feedforward[Reference] | None, PerScan()] = Field(
        default=None, description="Feedforward input; none if absent."
    )
    transfer: Annotated[Transfer, PerScan()] = Field(description="What happens when the controller is put into automatic.")
    action: Annotated[Action, PerScan()] = Field(description="Control action.")
    scan: Annotated[Scan, PerScan()] = Field(description="Scan interval.")
    output: Annotated[Output[Reference], PerScan()] = Field(description="Output.")
    arithmetic: Annotated[Arithmetic | None, PerScan()] = Field(
        default=None, description="How numbers are computed; float64 if absent."
    )
    faults: Annotated[Faults | None, PerScan()] = Field(
        default=None,
        description="What signals that are not numbers and scan intervals of zero or less do; nothing is computed "
        "and the output stands, if absent.",
    )
    settings: dict[SettingName, Setting] = Field(min_length=1, max_length=50, description="The dials, by the vendor's own names.")


def default_scan(equation: Equation) -> float:
    """Return the card's scan interval [s]."""
    number, unit = parse_quantity(equation.scan.default)
    return number if unit is None else to_canonical(Role.FILTER_TIME, number, unit)


class CardFile(Equation):
    """One PID algorithm of one product."""

    card: Literal[1] = Field(description="Version of the card language.")
    vendor: Name = Field(description="Maker, or the community that keeps the program.")
    product: Name = Field(description="Product line.")
    algorithm: Name = Field(description="The algorithm within the product.")
    kind: Literal["product", "software", "equation"] = Field(
        default="product",
        description="`product`: what is not stated of a loop was set at the site, and is asked for where it matters. `software`: "
        "what is not given runs with its documented default. `equation`: a textbook's, which takes the signals of the other side.",
    )
    about: Text | None = Field(default=None, description="What a reader should know first, in a few sentences.")
    sources: dict[Name, Source] = Field(max_length=100, description="What the card rests on, by a short key.")
    options: dict[SettingName, Option] = Field(default={}, max_length=20, description="What the vendor lets you choose per loop.")
    evidence: dict[Name, Evidence] = Field(
        description="Where each statement comes from: a path in the card, such as `derivative.filter` or "
        "`options.FORM.choices.Series`, covers everything below it; the longest path wins."
    )
    quirks: list[Quirk] = Field(default=[], max_length=100, description="Facts worth knowing that the equation does not show.")
    examples: list[Example] = Field(min_length=1, max_length=50, description="Settings and what they amount to; every one is run.")
