"""What a conversion has to ask before it can answer: one question, its readings, what each would give."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from pidemu.formatting import json_safe

if TYPE_CHECKING:
    from pidemu.conversion.result import Conversion

Kind = Literal["option", "unit", "range", "scale", "action", "mode", "input"]


@dataclass(frozen=True)
class Answer:
    """One way to answer a question.

    Attributes
    ----------
    value : str
        The answer.
    says : str
        What it means, in a few words; empty where the value says it.
    given : dict of str to object
        Settings and options of the source that state it.
    asked : dict of str to object
        Arguments of `pidemu.convert` that state it.
    conversion : Conversion or None
        What the answer leads to; ``None`` where more is to be asked, or where the target refuses.
    outcome : str
        Why there is no conversion.
    command : str
        The command that states it.
    alike : tuple of str
        Other ways to read it that amount to the same law for measurement.
    """

    value: str
    says: str = ""
    given: Mapping[str, object] = field(default_factory=dict)
    asked: Mapping[str, object] = field(default_factory=dict)
    conversion: Conversion | None = field(default=None, repr=False)
    outcome: str = ""
    command: str = ""
    alike: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON."""
        to = {} if self.conversion is None else self.conversion.settings.to_dict()
        return {
            "value": self.value,
            "says": self.says,
            "settings": json_safe(to.get("settings")),
            "options": to.get("options"),
            "outcome": self.outcome,
            "command": self.command,
            "alike": list(self.alike),
        }


@dataclass(frozen=True)
class Question:
    """Something that only the user can know, and that changes the result.

    Attributes
    ----------
    kind : {"option", "unit", "range", "scale", "action", "mode", "input"}
        What is open.
    about : str
        The option, dial or argument it is about.
    text : str
        The question, in one or two sentences.
    readings : tuple of Answer
        The ways to answer it, at most six.
    """

    kind: Kind
    about: str
    text: str
    readings: tuple[Answer, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON."""
        plain: dict[str, Any] = json_safe(
            {"kind": self.kind, "about": self.about, "text": self.text, "readings": [a.to_dict() for a in self.readings]}
        )
        return plain
