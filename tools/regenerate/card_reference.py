"""The field reference of the card language: the generated part of ``specs/card-language.md``, made from the models."""

from __future__ import annotations

import re
import types
import typing
from enum import StrEnum
from typing import Any, Final, Literal

from pidemu.card.model.base import R, hyphenated
from pidemu.card.model.card_file import CardFile, Equation
from pidemu.card.model.marks import LanguageField, fields_of, parts_in
from pidemu.card.windup import SCHEMES, Scheme

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
        for name, field in fields_of(model).items():
            if model is CardFile and name in fields_of(Equation):
                continue
            need = "required" if field.is_required else _default(field)
            meaning = field.meaning.replace("|", "\\|")
            lines.append(f"| `{hyphenated(name)}` | {_type(field)} | {need} | {meaning} |")
        lines.append("")
    return "\n".join(lines)


def _parts() -> list[type[Any]]:
    """Return the models of a card in the order in which its fields name them, the fields of its equation first."""
    found: list[type[Any]] = [CardFile, Equation]

    def walk(model: type[Any]) -> None:
        for field in fields_of(model).values():
            for part in _parts_of(field.annotation):
                if part not in found:
                    found.append(part)
                    walk(part)

    walk(Equation)
    walk(CardFile)
    return found


def _parts_of(annotation: Any) -> list[type[Any]]:
    """Return the parts that an annotation names; of the windup schemes all."""
    found = parts_in(annotation)
    return list(SCHEMES) if found == [Scheme] else found


def _heading(model: type[Any]) -> str:
    name = {"CardFile": "Card"}.get(model.__name__, model.__name__)
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)


def _default(field: LanguageField) -> str:
    if field.default in (None, {}, []):
        return "optional"
    shown = str(field.default).lower() if isinstance(field.default, bool) else field.default
    return f"default `{shown}`"


def _type(field: LanguageField) -> str:
    return _name(field.annotation)


def _name(t: Any) -> str:
    origin, arguments = typing.get_origin(t), typing.get_args(t)
    if origin is Literal:
        return ", ".join(f"`{a}`" for a in arguments)
    if origin is typing.Annotated:
        return "setting's name" if arguments[0] is str and "pattern" in repr(arguments[1:]) else _name(arguments[0])
    if origin in (typing.Union, types.UnionType):
        names = [_name(a) for a in arguments if a is not type(None)]
        return " or ".join(dict.fromkeys(names))
    if t is R:
        return "setting's name or number"
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
    parts = parts_in(t)
    if parts and all(issubclass(part, Scheme) for part in parts):
        return "one of the windup schemes below"
    if parts:
        (part,) = parts
        return f"[{part.__name__}](#{_heading(part).lower().replace(' ', '-')})"
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
