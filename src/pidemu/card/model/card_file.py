"""The card language, version 1: what a card may say.

Every field's description is its reference: ``specs/card-language.md`` and ``specs/card.schema.json`` are generated from here and
from the modules that this one puts together: those beside it, and the windup schemes and transfers.
"""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, Any, Literal

from pidemu.card.model.base import Evidence, Form, Name, Number, Part, Reference, SettingName, Size, Source, Text, means
from pidemu.card.model.declared import Only
from pidemu.card.model.integral import Integral
from pidemu.card.model.marks import PerScan
from pidemu.card.model.operation import Action, Arithmetic, Faults, Output, Scan
from pidemu.card.model.signals import ErrorShape, Measurement, Setpoint
from pidemu.card.model.terms import Cascade, Derivative, Feedforward, Proportional
from pidemu.card.model.verification import CardVerification
from pidemu.card.transfer import Transfer
from pidemu.part import part
from pidemu.units import Role, parse_quantity, to_canonical


@part(frozen=True, slots=True, kw_only=True)
class Setting(Part):
    """A dial."""

    sets: Annotated[Literal[
        "gain", "multiplier", "integral", "derivative", "filter-time", "filter-ratio", "filter-gain",
        "proportional-weight", "derivative-weight", "tracking-time", "filter-factor", "integral-limit", "windup-limit", "deadband",
        "gap-gain", "linearity", "feedforward-gain", "bias", "output-rate", "setpoint-rate", "resolution", "process-gain",
        "process-time", "process-delay", "closed-loop-time",
    ], means("What the dial sets, and with that its unit's meaning; see *Settings* above, and specs/equations.md, "
              "section 1.")]  # fmt: skip
    unit: Annotated[
        Name,
        means(
            "Unit of a bare number, such as `%/%`, `%` (proportional band), `s/repeat`, `repeat/min`, `1/s`, `min`, `Hz`, "
            "`eu`, `%/s`."
        ),
    ]
    about: Annotated[Text | None, means("The vendor's own name or words for it.")] = None
    default: Annotated[
        Number | None,
        means(
            "Value taken when the setting is not given. Either the vendor's delivered value (then with evidence), or the "
            "value that switches the term off, or leaves it as it is."
        ),
    ] = None
    range: Annotated[tuple[Number, Number] | None, means("Smallest and largest value, in `unit`; off values may lie outside.")] = (
        None
    )
    off: Annotated[
        Number | Annotated[list[Number], Only(max_length=10)] | None,
        means("Value, or values, that switch the term off; the first is used in conversions."),
    ] = None
    scope: Annotated[
        Literal["loop", "module"],
        means("`module`: a setting that many loops share; conversions leave it at its default unless told otherwise."),
    ] = "loop"
    resolution: Annotated[Size | None, means("Smallest step of the dial, in `unit`.")] = None


@part(frozen=True, slots=True, kw_only=True)
class Option(Part):
    """Something the vendor lets you choose per loop."""

    about: Annotated[Text | None, means("The vendor's own name or words for it.")] = None
    default: Annotated[Name, means("The choice taken when none is given.")]
    choices: Annotated[
        dict[Name, dict[str, Any]],
        Only(min_length=1, max_length=50),
        means(
            "What each choice changes: the fields of the algorithm that it overlays, as in the card itself. `filter` and "
            "`windup` are replaced whole; null removes a key."
        ),
    ]


@part(frozen=True, slots=True, kw_only=True)
class Quirk(Part):
    """A fact worth knowing that the equation does not show."""

    text: Annotated[Text, means("The fact.")]
    source: Annotated[Name | None, means("Key of an entry under `sources`.")] = None
    at: Annotated[Text | None, means("Place in the source.")] = None


@part(frozen=True, slots=True, kw_only=True)
class Canonical(Part):
    """Parallel gains and filter time of the feedback path (specs/equations.md, section 3, exact conversion to parallel)."""

    kp: Annotated[Number, means("Proportional gain [%/%].")]
    ki: Annotated[Number, means("Integral gain [1/s].")]
    kd: Annotated[Number, means("Derivative gain [s].")]
    Tf: Annotated[Number, means("Filter time [s].")] = 0.0


@part(frozen=True, slots=True, kw_only=True)
class Example(Part):
    """Settings and what they amount to; a test runs every one."""

    given: Annotated[dict[Name, Name | Number], means("Settings and options by name.")]
    canonical: Annotated[
        Canonical | None,
        means("The equivalent parallel gains of the feedback path, to six digits. At least one of `canonical` and `outputs`."),
    ] = None
    outputs: Annotated[
        list[Number] | None,
        Only(max_length=1000),
        means(
            "The output of the first automatic scans after a setpoint step of 1 from rest at 50, less the output before, "
            "at the card's scan interval and without limits; to six digits."
        ),
    ] = None
    source: Annotated[
        Name | None, means("Key of an entry under `sources`, where the example is printed; absent if it is our own arithmetic.")
    ] = None
    at: Annotated[Text | None, means("Place in the source.")] = None
    note: Annotated[Text | None, means("What the example shows.")] = None


@part(frozen=True, slots=True, kw_only=True)
class Equation(Part):
    """The fields of a card that make its equation; options overlay them."""

    signals: Annotated[
        Literal["percent", "engineering"],
        means("Whether the controller computes in percent of span or in engineering units, so that its gains carry them."),
    ] = "percent"
    form: Annotated[
        Form,
        means(
            "`parallel`: `kp + ki/s + kd s`. `standard` (ideal, ISA): `K (1 + 1/(Ti s) + Td s)`. `series` (interacting): "
            "`K (1 + 1/(Ti s)) (1 + Td s)`. `dahlin`: pole cancellation, `D(z)` of a first-order process with dead time "
            "(specs/equations.md, section 4)."
        ),
    ]
    implementation: Annotated[
        Literal["positional", "velocity"],
        PerScan(),
        means(
            "`positional`: the output is the sum of the terms. `velocity`: their increments are added to the last limited output."
        ),
    ]
    setpoint: Annotated[
        Setpoint[Reference] | None, means("What is done to the setpoint before the algorithm; nothing if absent.")
    ] = None
    measurement: Annotated[
        Measurement[Reference] | None, means("What is done to the measurement before it; nothing if absent.")
    ] = None
    error: Annotated[ErrorShape[Reference] | None, means("What is done to the error; nothing if absent.")] = None
    proportional: Annotated[Proportional[Reference], means("The proportional term.")]
    cascade: Annotated[
        Cascade[Reference] | None, PerScan(), means("What is different in cascade, with a remote setpoint; nothing if absent.")
    ] = None
    integral: Annotated[Integral[Reference], means("The integral term.")]
    derivative: Annotated[Derivative[Reference], means("The derivative term.")]
    feedforward: Annotated[Feedforward[Reference] | None, PerScan(), means("Feedforward input; none if absent.")] = None
    transfer: Annotated[Transfer, PerScan(), means("What happens when the controller is put into automatic.")]
    action: Annotated[Action, PerScan(), means("Control action.")]
    scan: Annotated[Scan, PerScan(), means("Scan interval.")]
    output: Annotated[Output[Reference], PerScan(), means("Output.")]
    arithmetic: Annotated[Arithmetic | None, PerScan(), means("How numbers are computed; float64 if absent.")] = None
    faults: Annotated[
        Faults | None,
        PerScan(),
        means(
            "What signals that are not numbers and scan intervals of zero or less do; nothing is computed "
            "and the output stands, if absent."
        ),
    ] = None
    settings: Annotated[
        dict[SettingName, Setting], Only(min_length=1, max_length=50), means("The dials, by the vendor's own names.")
    ]


def interval_of(text: str) -> float:
    """Return an interval that a card states, such as ``500 ms`` [s]."""
    number, unit = parse_quantity(text)
    return number if unit is None else to_canonical(Role.FILTER_TIME, number, unit)


def default_scan(equation: Equation) -> float:
    """Return the card's scan interval [s]."""
    return interval_of(equation.scan.default)


@part(frozen=True, slots=True, kw_only=True)
class CardFile(Equation):
    """One PID algorithm of one product."""

    card: Annotated[Literal[1], means("Version of the card language.")]
    vendor: Annotated[Name, means("Maker, or the community that keeps the program.")]
    product: Annotated[Name, means("Product line.")]
    algorithm: Annotated[Name, means("The algorithm within the product.")]
    kind: Annotated[
        Literal["product", "software", "equation"],
        means(
            "`product`: what is not stated of a loop was set at the site, and is asked for where it matters. `software`: "
            "what is not given runs with its documented default. `equation`: a textbook's, which takes the signals of the other "
            "side."
        ),
    ] = "product"
    about: Annotated[Text | None, means("What a reader should know first, in a few sentences.")] = None
    sources: Annotated[dict[Name, Source], Only(max_length=100), means("What the card rests on, by a short key.")]
    options: Annotated[dict[SettingName, Option], Only(max_length=20), means("What the vendor lets you choose per loop.")] = field(
        default_factory=dict
    )
    evidence: Annotated[
        dict[Name, Evidence],
        means(
            "Where each statement comes from: a path in the card, such as `derivative.filter` or "
            "`options.FORM.choices.Series`, covers everything below it; the longest path wins."
        ),
    ]
    verification: Annotated[
        CardVerification | None, means("How the scan program was verified; a card that does not say counts as `V3`.")
    ] = None
    quirks: Annotated[list[Quirk], Only(max_length=100), means("Facts worth knowing that the equation does not show.")] = field(
        default_factory=list
    )
    examples: Annotated[
        list[Example], Only(min_length=1, max_length=50), means("Settings and what they amount to; every one is run.")
    ]
