"""What the model says of a wrong card, in words and with its place."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from pidemu.card.source import Document, Path_
from pidemu.errors import Problem, suggest

Locate = Callable[[Path_], Path_]
"""From a path in the value that was validated to the path in the file."""


def _walk(value: Any, loc: tuple[str | int, ...]) -> tuple[Path_, Any]:
    """Return the part of `loc` that exists in `value`: pydantic mixes names of union branches into it."""
    path: list[str | int] = []
    for step in loc:
        if (isinstance(value, dict) and step in value) or (isinstance(value, list) and isinstance(step, int)):
            value = value[step]  # type: ignore[index]
            path.append(step)
    return tuple(path), value


def _fields(model: type[BaseModel], path: Path_) -> list[str]:
    """Return the keys that may stand in the mapping at `path`, for a suggestion."""
    keys: set[str] = set()
    _collect(model, list(path), keys)
    return sorted(keys)


def _collect(annotation: Any, path: list[str | int], keys: set[str]) -> None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        if not path:
            keys.update(f.alias or name for name, f in annotation.model_fields.items())
            return
        for name, f in annotation.model_fields.items():
            if (f.alias or name) == path[0]:
                _collect(f.annotation, path[1:], keys)
        return
    args = getattr(annotation, "__args__", ())
    container = getattr(annotation, "__origin__", None) in (dict, list, tuple)
    for arg in args:
        _collect(arg, path[1:] if container and path else path, keys)


def _message(error: ErrorDetails, path: Path_, value: Any, model: type[BaseModel]) -> str:
    kind, context = error["type"], error.get("ctx", {})
    shown = f"'{value}'" if isinstance(value, str) else f"{value!r}"
    match kind:
        case "extra_forbidden":
            return f"unknown key '{path[-1]}'{suggest(str(path[-1]), _fields(model, path[:-1]))}"
        case "missing":
            return f"missing key '{error['loc'][-1]}'"
        case "literal_error" | "enum":
            expected = str(context["expected"])
            options = [w.strip("' ") for w in expected.replace(" or ", ", ").split(",")]
            return f"{shown} is not one of {expected}{suggest(str(value), options)}"
        case "union_tag_invalid":
            expected = str(context["expected_tags"])
            options = [w.strip("' ") for w in expected.split(",")]
            return f"'{context['tag']}' is not one of {expected}{suggest(str(context['tag']), options)}"
        case "union_tag_not_found":
            return "missing key 'scheme'"
        case "string_type":
            return f"{shown} is not a text; put it in quotes if it is meant as one"
        case "float_type" | "float_parsing" | "int_type" | "int_parsing":
            return f"{shown} is not a number"
        case "bool_type" | "bool_parsing":
            return f"{shown} is neither true nor false"
        case "model_type" | "dict_type" | "model_attributes_type":
            return f"expected a mapping (key: value), found {_kind(value)}"
        case "list_type" | "tuple_type":
            return f"expected a list, found {_kind(value)}"
        case "string_too_short" | "too_short":
            return "empty; write it, or remove the key"
        case "string_pattern_mismatch":
            return f"{shown} is not a name: letters, digits and underscores, starting with a letter"
        case "date_type" | "date_parsing" | "date_from_datetime_parsing":
            return f"{shown} is not a date such as 2026-11-22"
        case _:
            return f"{shown}: {error['msg'][0].lower()}{error['msg'][1:]}"


def _kind(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return "a mapping"
    return "a list" if isinstance(value, list) else f"'{value}'"


def problems(error: ValidationError, value: Any, model: type[BaseModel], document: Document, locate: Locate) -> Iterable[Problem]:
    """Yield one located problem per faulty place.

    Parameters
    ----------
    error : ValidationError
        What pydantic found in `value`.
    value : dict
        The plain value that was validated against `model`.
    model : type of BaseModel
        The model.
    document : Document
        The file.
    locate : callable
        Maps a path in `value` to its path in the file.
    """
    found: dict[tuple[Path_, bool], list[str]] = {}
    for detail in error.errors(include_url=False):
        path, here = _walk(value, detail["loc"])
        if detail["type"] == "string_pattern_mismatch" and detail["loc"][-1] == "[key]":
            here = path[-1]
        at_key = detail["type"] in ("extra_forbidden", "missing", "union_tag_not_found") or detail["loc"][-1] == "[key]"
        messages = found.setdefault((path, at_key), [])
        message = _message(detail, path, here, model)
        if message not in messages:
            messages.append(message)
    for (path, at_key), messages in found.items():
        missing = [m for m in messages if m.startswith("missing")]
        shown = messages if missing else [_united(messages)]
        for message in shown:
            yield document.problem(locate(path), message, at_key=at_key)


def _united(messages: list[str]) -> str:
    if len(messages) == 1:
        return messages[0]
    shown = messages[0].split(" is not ")[0]
    wants = [m.split(" is not ", 1)[1] for m in messages if " is not " in m]
    return f"{shown} is not {', nor '.join(w.split(';')[0] for w in wants)}"
