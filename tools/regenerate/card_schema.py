"""The JSON Schema of a card, for editors: ``specs/card.schema.json``, made from the models of the card language."""

from __future__ import annotations

import copy
import json
from typing import Any, Final

from pydantic import TypeAdapter

from pidemu.card.model.base import hyphenated
from pidemu.card.model.card_file import CardFile, Equation
from pidemu.card.model.marks import fields_of

_LAST: Final = ("default", "description", "title")
_WHOLE: Final = ("Filter", "SignalFilter", "Windup")
"""Parts that a choice replaces as a whole, by the beginning of their names."""


def schema() -> dict[str, Any]:
    """Return the JSON Schema of a card, with unions as ``if``/``then`` so that editors follow them."""
    plain = _plainly_named(_of(CardFile))
    definitions = plain["$defs"]
    definitions["Overlay"] = _overlay(definitions)
    definitions["Option"]["properties"]["choices"]["additionalProperties"] = {"$ref": "#/$defs/Overlay"}
    _unions(plain, definitions)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "pidemu card, version 1", **plain}


def _of(part: type[CardFile] | type[Equation]) -> dict[str, Any]:
    """Return the JSON Schema of a part as pydantic makes it, with the defaults that are made anew each time."""
    found = TypeAdapter(part).json_schema(by_alias=True)
    for name, field in fields_of(part).items():
        if field.default in ({}, []):
            found["properties"][hyphenated(name)] = dict(
                sorted({**found["properties"][hyphenated(name)], "default": field.default}.items())
            )
    for definition in found["$defs"].values():
        own = definition.get("properties", {}).get("default")  # a key of this name: what it holds, pydantic leaves unsorted
        if own is not None:
            definition["properties"]["default"] = dict(
                sorted(own.items(), key=lambda item: item[0] in _LAST and _LAST.index(item[0]) + 1)
            )
    return found


def _overlay(definitions: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of what a choice overlays: the equation with nothing required."""
    full = _plainly_named(_of(Equation))
    definitions.update({name: d for name, d in full.get("$defs", {}).items() if name not in definitions})
    for name in list(full["$defs"]):
        if full["$defs"][name].get("type") == "object" and not name.startswith(_WHOLE):
            definitions[f"Partial{name}"] = _partial(full["$defs"][name], definitions)
    body = _partial({k: v for k, v in full.items() if k != "$defs"}, definitions)
    return {**body, "title": "Overlay", "description": "Fields of the equation that a choice changes."}


def _plainly_named(found: dict[str, Any]) -> dict[str, Any]:
    """Return a schema with parts under the names of their classes, without what they are made generic with."""
    text = json.dumps(found)
    for name in sorted(found["$defs"], key=len, reverse=True):
        text = text.replace(name, name.partition("_Union_")[0])
    plain: dict[str, Any] = json.loads(text)
    return plain


def _partial(definition: dict[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    changed = copy.deepcopy(definition)
    changed.pop("required", None)
    for key, value in changed.get("properties", {}).items():
        changed["properties"][key] = {"anyOf": [_partial_references(value, definitions), {"type": "null"}]}
    return changed


def _partial_references(value: Any, definitions: dict[str, Any]) -> Any:
    if isinstance(value, dict):
        if "discriminator" in value:
            return value
        reference = value.get("$ref", "")
        name = reference.rsplit("/", 1)[-1]
        if reference and definitions.get(name, {}).get("type") == "object" and not name.startswith(_WHOLE):
            return {**value, "$ref": f"#/$defs/Partial{name}"}
        found = {k: _partial_references(v, definitions) for k, v in value.items()}
        if "patternProperties" in found:  # a choice may remove an entry of a mapping
            found["patternProperties"] = {k: {"anyOf": [v, {"type": "null"}]} for k, v in found["patternProperties"].items()}
        return found
    return [_partial_references(v, definitions) for v in value] if isinstance(value, list) else value


def _unions(node: Any, definitions: dict[str, Any]) -> None:
    """Rewrite every discriminated union in place."""
    if isinstance(node, dict):
        if "discriminator" in node:
            key = node.pop("discriminator")["propertyName"]
            members = [m["$ref"] for m in node.pop("oneOf")]
            branches = []
            for reference in members:
                tag = definitions[reference.rsplit("/", 1)[-1]]["properties"][key]
                words = tag["enum"] if "enum" in tag else [tag["const"]]
                branches.append((words, reference))
            node.update(
                type="object",
                required=[key],
                properties={key: {"enum": [w for words, _ in branches for w in words]}},
                allOf=[{"if": {"properties": {key: {"enum": words}}}, "then": {"$ref": ref}} for words, ref in branches],
            )
        for value in list(node.values()):
            _unions(value, definitions)
    elif isinstance(node, list):
        for value in node:
            _unions(value, definitions)


def text() -> str:
    """Return the JSON Schema as it stands in the file."""
    return json.dumps(schema(), indent=2) + "\n"
