"""The JSON Schema of what ``pidemu convert --json`` prints: ``specs/conversion.schema.json``.

The models of a conversion are those that `pidemu.verify` reads certificates with; those of a question and a refusal, which nothing
reads back, stand here.
"""

from __future__ import annotations

import json
from dataclasses import make_dataclass
from typing import Annotated, Any, Final, Literal, get_type_hints

from pydantic import Field, RootModel, TypeAdapter

from pidemu.certificate import models
from pidemu.certificate.models import Certificate, EmulationFigures
from pidemu.certificate.proof import Proof
from pidemu.conversion.document import SCHEMA
from pidemu.conversion.questions import Kind
from pidemu.conversion.schema import ConversionPart, Dial, Name, Side
from pidemu.files.documents import DocumentPart

_CERTIFICATE: Final = "Certificate"
_LINES: Final = {"type": "array", "items": {"type": "string"}}


class Card(DocumentPart):
    """A target of which nothing but the card is known."""

    card: Name


class Reading(DocumentPart):
    """One way to answer a question."""

    value: str
    says: str
    settings: dict[Name, Dial] | None = Field(description="What it leads to; null where the target refuses or more is asked.")
    options: dict[Name, str] | None
    outcome: str = Field(description="Why there are no settings.")
    command: str = Field(description="The command that states it.")
    alike: list[str]


class QuestionPart(DocumentPart):
    """Something that only the user can know, and that changes the result."""

    kind: Kind
    about: str
    text: str
    readings: Annotated[list[Reading], Field(max_length=6)]


class QuestionsPart(DocumentPart):
    """Questions that have to be answered first."""

    schema_: Literal["pidemu-conversion-1"] = Field(alias="schema")
    source: Side | None = Field(default=None, alias="from")
    to: Card | None = None
    verdict: Literal["question"]
    questions: Annotated[list[QuestionPart], Field(min_length=1)]


class RefusalPart(DocumentPart):
    """Why the target cannot do what the source does."""

    schema_: Literal["pidemu-conversion-1"] = Field(alias="schema")
    source: Side | None = Field(default=None, alias="from")
    to: Card | None = None
    verdict: Literal["refused"]
    reason: str
    nearest: ConversionPart | None = Field(description="The nearest settings, as `--allow-approximate` gives them.")
    alternatives: list[str]


class Outcome(RootModel[ConversionPart | QuestionsPart | RefusalPart]):
    """What ``pidemu convert --json`` prints."""


def schema() -> dict[str, Any]:
    """Return the JSON Schema of what ``pidemu convert --json`` prints."""
    plain: dict[str, Any] = Outcome.model_json_schema(by_alias=True, mode="serialization")
    definitions: dict[str, Any] = plain.pop("$defs")
    figures = TypeAdapter(_printed_certificate()).json_schema(mode="serialization")
    definitions |= {**figures.pop("$defs"), _CERTIFICATE: figures}
    definitions["Number"] = {"anyOf": [{"type": "number"}, {"enum": ["inf", "-inf", "nan"]}]}
    for name in (*figures_of(figures, definitions), _CERTIFICATE):
        _close(definitions[name])
    definitions["Kick"]["properties"]["ratio"] = {"$ref": "#/$defs/Number", "description": "Target's kick per source's."}
    definitions["Kick"]["required"].append("ratio")
    more = {"feedback_equal": {"type": "boolean"}, "setpoint_equal": {"type": "boolean"}, "text": _LINES}
    definitions["Proof"]["properties"] |= more
    definitions["Proof"]["required"] += list(more)
    reference = {"$ref": f"#/$defs/{_CERTIFICATE}"}
    definitions["ConversionPart"]["properties"]["certificate"] = reference
    definitions["TextbookPart"]["properties"]["certificate"] = {"anyOf": [reference, {"type": "null"}]}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": SCHEMA}
    found: dict[str, Any] = without_titles(
        {**head, **{k: v for k, v in plain.items() if k != "title"}, "$defs": definitions}, SCHEMA
    )
    return found


def _printed_certificate() -> type[Any]:
    """Return the certificate as it is printed: what the emulation has shown stands among its own figures."""
    known = {**vars(models), "Proof": Proof}
    own, shown = (get_type_hints(part, known) for part in (Certificate, EmulationFigures))
    del own["emulation"]
    return make_dataclass(_CERTIFICATE, list((own | shown).items()), namespace={"__doc__": Certificate.__doc__})


def figures_of(figures: dict[str, Any], definitions: dict[str, Any]) -> set[str]:
    """Return the names of the definitions that the certificate's figures are made of."""
    found: set[str] = set()
    waiting: list[Any] = [figures]
    while waiting:
        node = waiting.pop()
        if isinstance(node, dict):
            name = str(node.get("$ref", "")).rpartition("/")[2]
            if name and name not in found:
                found.add(name)
                waiting.append(definitions[name])
            waiting += node.values()
        elif isinstance(node, list):
            waiting += node
    return found


def _close(definition: dict[str, Any]) -> None:
    """Require all properties of a dataclass, allow no others, and write infinite numbers as words."""
    definition["required"] = list(definition["properties"])
    definition["additionalProperties"] = False
    definition["description"] = definition.get("description", "").partition("\n")[0]
    definition["properties"] = {name: _numbers(p) for name, p in definition["properties"].items()}


def _numbers(node: Any) -> Any:
    if isinstance(node, dict):
        if node.get("type") == "number":
            return {"$ref": "#/$defs/Number"}
        return {k: _numbers(v) for k, v in node.items() if k != "default"}
    return [_numbers(v) for v in node] if isinstance(node, list) else node


def without_titles(node: Any, title: str) -> Any:
    """Remove the titles that repeat a property's name; only the document's own stays."""
    if isinstance(node, dict):
        return {k: without_titles(v, title) for k, v in node.items() if k != "title" or not isinstance(v, str) or v == title}
    return [without_titles(v, title) for v in node] if isinstance(node, list) else node


def text() -> str:
    """Return the schema's file."""
    return json.dumps(schema(), indent=2, ensure_ascii=False) + "\n"
