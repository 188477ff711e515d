"""The card language for editors and readers: JSON Schema and the field reference, both generated from the models.

``python -m pidemu.card.schema`` in the repository writes ``specs/card.schema.json`` and the generated part of
``specs/card-language.md``; a test fails while they are not current.
"""

from __future__ import annotations

import copy
import json
import re
import types
import typing
from enum import StrEnum
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from pidemu.card import base, integral, models, stages, terms
from pidemu.card.models import CardFile, Equation

BEGIN: Final = "<!-- generated from src/pidemu/card/models.py: begin -->"
END: Final = "<!-- generated from src/pidemu/card/models.py: end -->"

_WHOLE: Final = ("Filter", "SignalFilter", "Windup")
_ORDER: Final = (
    CardFile, base.Source, models.Equation, terms.Setpoint, terms.Measurement, terms.SignalFilter, terms.ErrorShape,
    terms.Proportional, terms.Cascade, integral.Integral, integral.IntegralLimits, integral.WindupNone, integral.WindupClamp,
    integral.WindupGate, integral.WindupRecompute, integral.WindupBackCalculation, integral.WindupExternalReset,
    integral.FastReturn, integral.WindupVelocity, integral.WindupResetOutsideBand, terms.Derivative, terms.Filter,
    terms.Feedforward, stages.Transfer, models.Setting, models.Option, stages.Action, stages.ActionExample, stages.Scan,
    stages.Output, stages.Arithmetic, stages.Faults, base.Evidence, models.Quirk, models.Example, models.Canonical,
)  # fmt: skip


def schema() -> dict[str, Any]:
    """Return the JSON Schema of a card, with unions as ``if``/``then`` so that editors follow them."""
    plain: dict[str, Any] = CardFile.model_json_schema(by_alias=True)
    definitions = plain["$defs"]
    definitions["Overlay"] = _overlay(definitions)
    definitions["Option"]["properties"]["choices"]["additionalProperties"] = {"$ref": "#/$defs/Overlay"}
    _unions(plain, definitions)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "pidemu card, version 1", **plain}


def _overlay(definitions: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of what a choice overlays: the equation with nothing required."""
    full: dict[str, Any] = Equation.model_json_schema(by_alias=True)
    definitions.update({name: d for name, d in full.get("$defs", {}).items() if name not in definitions})
    for name in list(full["$defs"]):
        if full["$defs"][name].get("type") == "object" and not name.startswith(_WHOLE):
            definitions[f"Partial{name}"] = _partial(full["$defs"][name], definitions)
    body = _partial({k: v for k, v in full.items() if k != "$defs"}, definitions)
    return {**body, "title": "Overlay", "description": "Fields of the equation that a choice changes."}


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


def reference() -> str:
    """Return the field reference in Markdown: one table per part of a card."""
    lines: list[str] = []
    for model in _ORDER:
        lines += [
            f"### {_heading(model)}",
            "",
            (model.__doc__ or "").strip(),
            "",
            "| key | value | | meaning |",
            "|---|---|---|---|",
        ]
        for name, field in model.model_fields.items():
            if model is CardFile and name in Equation.model_fields:
                continue
            need = "required" if field.is_required() else _default(field)
            meaning = (field.description or "").replace("|", "\\|")
            lines.append(f"| `{field.alias or name}` | {_type(field)} | {need} | {meaning} |")
        lines.append("")
    return "\n".join(lines)


def _heading(model: type[BaseModel]) -> str:
    name = {"CardFile": "Card"}.get(model.__name__, model.__name__)
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)


def _default(field: FieldInfo) -> str:
    if field.default in (None, {}, []):
        return "optional"
    shown = str(field.default).lower() if isinstance(field.default, bool) else field.default
    return f"default `{shown}`"


def _type(field: FieldInfo) -> str:
    return _name(field.annotation)


def _name(t: Any) -> str:
    origin, arguments = typing.get_origin(t), typing.get_args(t)
    if origin is Literal:
        return ", ".join(f"`{a}`" for a in arguments)
    if origin is typing.Annotated:
        return "setting's name" if arguments[0] is str and "pattern" in repr(arguments[1:]) else _name(arguments[0])
    if origin in (typing.Union, types.UnionType):
        names = [_name(a) for a in arguments if a is not type(None)]
        if all(n.startswith("[Windup") for n in names):
            return "one of the windup schemes below"
        return " or ".join(dict.fromkeys(names))
    if t is Any:
        return "anything"
    if origin is dict:
        return f"mapping of {_name(arguments[1])}"
    if origin is list:
        return f"list of {_name(arguments[0])}"
    if origin is tuple:
        return f"[{', '.join(_name(a) for a in arguments)}]"
    if isinstance(t, type) and issubclass(t, StrEnum):
        return ", ".join(f"`{m.value}`" for m in t)
    if isinstance(t, type) and issubclass(t, BaseModel):
        heading = _heading(t)
        return f"[{t.__name__}](#{heading.lower().replace(' ', '-')})"
    return {str: "text", float: "number", bool: "true or false", int: "integer"}.get(t, getattr(t, "__name__", "anything"))


def updated(text: str) -> str:
    """Return the language document with its generated part made anew.

    Raises
    ------
    ValueError
        The marks of the generated part are missing.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the document needs the lines '{BEGIN}' and '{END}'")
    return f"{before}{BEGIN}\n\n{reference()}\n{END}{after}"


def schema_text() -> str:
    """Return the JSON Schema as it stands in the file."""
    return json.dumps(schema(), indent=2) + "\n"


def main() -> None:
    """Write both files of the repository."""
    specs = Path(__file__).resolve().parents[3] / "specs"
    (specs / "card.schema.json").write_text(schema_text(), encoding="utf-8", newline="\n")
    language = specs / "card-language.md"
    language.write_text(updated(language.read_text(encoding="utf-8")), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
