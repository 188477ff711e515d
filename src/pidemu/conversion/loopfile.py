"""A loop in a file: what to convert from, with which settings, and to what."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import Discriminator, Field, Tag, ValidationError

from pidemu.card.library import not_an_id
from pidemu.card.model.base import Number, Text
from pidemu.card.reading import parse_file
from pidemu.card.validation import Model, problems
from pidemu.errors import CardError, CardNotFoundError
from pidemu.excerpt import visible
from pidemu.files.reading import Kind, is_folder

Interval = Annotated[
    Annotated[Number, Tag("one")] | Annotated[list[Number], Field(min_length=1, max_length=2), Tag("two")],
    Discriminator(lambda given: "two" if isinstance(given, list) else "one"),  # so that an error is about what was written
]
_KIND: Final = Kind("a loop file", "a loop file is YAML text that states card: and settings:", limit=2**20)


class LoopFile(Model):
    """Settings of one loop and the card they go to."""

    about: Text | None = Field(default=None, description="Where the loop comes from.")
    card: Text = Field(description="The card of the settings, by its id.")
    settings: dict[Text, str | Number] = Field(description="Settings and options by name.")
    to: Text | None = Field(default=None, description="The card to convert to, by its id.")
    set_: dict[Text, str | Number] = Field(
        default={}, description="Options of the target, and dials that shall have a value.", alias="set"
    )
    to_pv_range: Text | None = Field(default=None, description="Measurement range of the target: 0,1000 degF.")
    to_op_range: Text | None = Field(default=None, description="Output range of the target: 0,100 %.")
    process: Text | None = Field(default=None, description="The process, as `--process` takes it: gain=1.5,lag=10,delay=3.")
    scan: Interval | None = Field(default=None, description="Scan interval of both, or of source and target [s].")
    runs_every: Interval | None = Field(default=None, description="Interval at which the source, or both, are really executed [s].")
    mode: Literal["auto", "cascade", "both"] | None = Field(default=None, description="Which setpoint counts.")
    action: Literal["reverse", "direct"] | None = Field(default=None, description="Action of the loop.")
    bias: Number | None = Field(default=None, description="Output at SP = PV of a loop without integral action [%].")
    limits: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="Output limits that the source is set to, the lower one first."
    )
    tag: Text | None = Field(default=None, description="The loop's name.")


@dataclass(frozen=True, slots=True)
class WrittenLoop:
    """What a loop file says.

    Attributes
    ----------
    card, to : str
        Source and target card.
    settings, set : dict
        What is given for the source and for the target; ``pv_range`` and ``op_range`` among `settings` are the source's.
    scan : float, tuple of float or None
        Scan interval of both, or of source and target [s].
    process : str or None
        The process.
    to_pv_range, to_op_range : str or None
        The target's ranges, as they are written.
    others : dict
        What else is given of the conversion's arguments: runs_every, mode, action, bias, limits, tag.
    """

    card: str
    settings: dict[str, Any]
    to: str | None
    set: dict[str, Any]
    scan: float | tuple[float, float] | None
    process: str | None = None
    to_pv_range: str | None = None
    to_op_range: str | None = None
    others: Mapping[str, Any] = field(default_factory=dict)


def read_loop(file: Path) -> WrittenLoop:
    """Read a loop file.

    Parameters
    ----------
    file : Path
        The file.

    Raises
    ------
    CardError
        The file is missing, or wrong: every problem, located.
    """
    if not os.path.exists(file) or is_folder(file):
        raise CardNotFoundError(f"no file '{visible(str(file))}'")
    document = parse_file(file, kind=_KIND)
    try:
        loop = LoopFile.model_validate(document.value)
    except ValidationError as error:
        raise CardError(sorted(problems(error, document.value, LoopFile, document, lambda p: p))) from None
    faults = {key: not_an_id(name) for key, name in (("card", loop.card), ("to", loop.to)) if name is not None}
    if any(faults.values()):
        raise CardError([document.problem((key,), fault) for key, fault in faults.items() if fault is not None])
    ranges = (loop.to_pv_range, loop.to_op_range)
    given = {
        "mode": loop.mode,
        "action": loop.action,
        "bias": loop.bias,
        "limits": loop.limits and (loop.limits[0], loop.limits[1]),
        "tag": loop.tag,
        "runs_every": _intervals(loop.runs_every),
    }
    others = {name: value for name, value in given.items() if value is not None}
    return WrittenLoop(
        loop.card, dict(loop.settings), loop.to, dict(loop.set_), _intervals(loop.scan), loop.process, *ranges, others
    )


def _intervals(given: float | list[float] | None) -> float | tuple[float, float] | None:
    """Return one scan interval or two [s]."""
    if not isinstance(given, list):
        return given
    return given[0] if len(given) == 1 else (given[0], given[1])
