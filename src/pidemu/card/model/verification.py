"""How the emulation of a card was verified: against the real program, against a printed scan equation, or by its law alone."""

from __future__ import annotations

import re
from dataclasses import field
from typing import Annotated, Final, Literal

from pidemu.card.model.base import Name, Number, Part, Text, means
from pidemu.card.model.declared import Only, refusal
from pidemu.part import part

VerificationClass = Literal["V1", "V2", "V3"]

MEANING: Final[dict[str, str]] = {
    "V1": "against the real program",
    "V2": "against the printed equations",
    "V3": "by its law alone",
}
"""What each class says, in few words: alike in lists, data sheets, pages and certificates."""


def _beside(value: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*\.csv", value):
        raise refusal("file_name", "not the name of a CSV file beside the card, such as trace.csv")
    return value


FileName = Annotated[str, Only(min_length=5, max_length=100, after=_beside)]
"""A CSV file of the same folder: no path leads out of it."""


@part(frozen=True, slots=True, kw_only=True)
class TraceChange(Part):
    """Settings changed while the recorded program ran."""

    at: Annotated[int, Only(gt=0, le=10**6, strict=True), means("The scan, from 0, before which they were changed.")]
    given: Annotated[dict[Name, Name | Number], means("The settings that changed, by name.")]


@part(frozen=True, slots=True, kw_only=True)
class RecordedTrace(Part):
    """A recorded trace: outputs of the real program, or of a second reading of the equation, which the card reproduces."""

    file: Annotated[
        FileName,
        means(
            "CSV file with the outputs, beside the card; of a card that comes with pidemu in `tests/data`. Its first lines, after "
            "`#`, say what ran."
        ),
    ]
    inputs: Annotated[
        FileName | None, means("CSV file with `sp`, `pv`, `auto`, `manual` and perhaps `interval`; by default `file` itself.")
    ] = None
    column: Annotated[Name, means("Name of the column that holds the outputs.")] = "output"
    given: Annotated[dict[Name, Name | Number], means("Settings and options by name.")]
    changes: Annotated[list[TraceChange], Only(max_length=20), means("Settings changed while it ran, in order.")] = field(
        default_factory=list
    )
    scan: Annotated[Name, means("Scan interval, such as `500 ms`.")]
    limits: Annotated[tuple[Number, Number] | None, means("Output limits; by default the card's.")] = None
    action: Annotated[Literal["reverse", "direct"], means("Control action.")] = "reverse"
    initial_output: Annotated[Number, means("Output before the first scan.")] = 0.0
    modes: Annotated[
        Literal["recorded", "automatic"],
        means("`automatic`: the program has no manual mode, and was in automatic throughout, whatever the inputs say."),
    ] = "recorded"
    rows: Annotated[
        Literal["all", "automatic"], means("Which scans are compared; `automatic` where the program says nothing in manual.")
    ] = "all"
    tolerance: Annotated[
        Number,
        Only(ge=0, le=1e-3),
        means("Largest difference, as a share of the largest recorded output; 0: every bit is the same."),
    ] = 0.0


@part(frozen=True, slots=True, kw_only=True)
class CardVerification(Part):
    """How the scan program was verified."""

    class_: Annotated[
        VerificationClass,
        means(
            "`V1`: against the real program, run by a test or recorded. `V2`: against the equations that its maker prints, "
            "by a computation that somebody else wrote from it. `V3`: by its law alone; rules, windup and transfers are what the "
            "card says of them."
        ),
    ]
    source: Annotated[Name | None, means("The program or document, a key of `sources`. Required for `V1` and `V2`.")] = None
    at: Annotated[Text | None, means("Place in it: function, equation, page. Required for `V1` and `V2`.")] = None
    test: Annotated[
        Text | None,
        means("The test that compares, a file of pidemu's own tests. Of cards that come with pidemu; others have `records`."),
    ] = None
    package: Annotated[
        Name | None,
        means("With `V1`: the package of the Python package index that the test runs, with its version: `simple-pid 2.0.1`."),
    ] = None
    records: Annotated[
        list[RecordedTrace], Only(max_length=50), means("Recorded traces, which `pidemu check` runs the card against.")
    ] = field(default_factory=list)
    note: Annotated[Text | None, means("What was compared, and what was not; with `V3` why there is nothing better.")] = None


UNSTATED: Final = CardVerification(class_="V3", note="the card does not say")
"""What holds of a card that does not say how it was verified."""


def short_basis(verification: CardVerification | None) -> str:
    """Return what an emulation rests on in few words: ``V3, by its law alone``."""
    found = verification or UNSTATED
    return f"{found.class_}, {MEANING[found.class_]}"


def basis(verification: CardVerification | None) -> str:
    """Return what an emulation rests on, with what was compared."""
    found = verification or UNSTATED
    compared = [f"the package {found.package}"] if found.package else []
    if found.records:
        compared.append(f"{len(found.records)} recorded trace{'s' if len(found.records) > 1 else ''}")
    place = f"[{found.source}] {found.at or ''}".strip() if found.source else ""
    parts = (short_basis(found), place, ", ".join(compared), found.test or "", found.note or "")
    return "; ".join(filter(None, parts))
