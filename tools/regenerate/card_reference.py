"""The field reference of the card language: the generated part of ``specs/card-language.md``, made from the models."""

from __future__ import annotations

import re
import types
import typing
from enum import StrEnum
from typing import Any, Final, Literal

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from pidemu.card.model.card_file import CardFile, Equation

BEGIN: Final = "<!-- generated from src/pidemu/card/model/card_file.py: begin -->"
END: Final = "<!-- generated from src/pidemu/card/model/card_file.py: end -->"


def reference() -> str:
    """Return the field reference in Markdown: one table per part of a card."""
    lines: list[str] = []
    for model in _parts():
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


def _parts() -> list[type[BaseModel]]:
    """Return the models of a card in the order in which its fields name them, the fields of its equation first."""
    found: list[type[BaseModel]] = [CardFile, Equation]

    def walk(model: type[BaseModel]) -> None:
        for field in model.model_fields.values():
            for part in _models(field.annotation):
                if part not in found:
                    found.append(part)
                    walk(part)

    walk(Equation)
    walk(CardFile)
    return found


def _models(annotation: Any) -> list[type[BaseModel]]:
    """Return the models that an annotation names."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for argument in typing.get_args(annotation) for model in _models(argument)]


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
