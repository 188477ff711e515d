"""Cards held against the card language by pydantic, and what it says of a wrong one, in words and with its place.

What imports this module imports pydantic. It is needed only where a card is read that was not compiled before.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any, Final, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from pidemu.card.document import Document, Path_
from pidemu.card.model.base import CONFIG, hyphenated
from pidemu.card.model.card_file import CardFile, Equation
from pidemu.card.model.marks import fields_of, parts_in
from pidemu.errors import CardError, Problem, capped, suggest
from pidemu.excerpt import shortened

_LONGEST: Final = 60
"""Characters of a value that are shown."""
_OF_NUMBERS: Final = ("not_a_number", "implausible")
_UNKNOWN: Final = ("extra_forbidden", "unexpected_keyword_argument")
Locate = Callable[[Path_], Path_]
"""From a path in the value that was validated to the path in the file."""
_LANGUAGE: Final[dict[type[Any], TypeAdapter[Any]]] = {part: TypeAdapter(part) for part in (CardFile, Equation)}
Whole = TypeVar("Whole", CardFile, Equation)


class Model(BaseModel):
    """Base of files that are written like cards: frozen, and nothing but the documented keys."""

    model_config = ConfigDict(**CONFIG)  # type: ignore[typeddict-item]


def _walk(value: Any, loc: tuple[str | int, ...]) -> tuple[Path_, Any]:
    """Return the part of `loc` that exists in `value`: pydantic mixes names of union branches into it."""
    path: list[str | int] = []
    for step in loc:
        in_list = isinstance(value, list) and isinstance(step, int) and step < len(value)
        if in_list or (isinstance(value, dict) and step in value):
            value = value[step]
            path.append(step)
    return tuple(path), value


def _fields(model: type[Any], path: Path_) -> list[str]:
    """Return the keys that may stand in the mapping at `path`, for a suggestion."""
    keys: set[str] = set()
    _collect(model, list(path), keys)
    return sorted(keys)


def _collect(annotation: Any, path: list[str | int], keys: set[str]) -> None:
    part = get_origin(annotation) or annotation
    if isinstance(part, type) and (parts_in(part) or issubclass(part, BaseModel)):
        for key, inner in _keys(part):
            if not path:
                keys.add(key)
            elif key == path[0]:
                _collect(inner, path[1:], keys)
        return
    container = part in (dict, list, tuple)
    for argument in get_args(annotation):
        _collect(argument, path[1:] if container and path else path, keys)


def _keys(part: type[Any]) -> list[tuple[str, Any]]:
    """Return the keys of a part and their types."""
    if issubclass(part, BaseModel):
        return [(field.alias or hyphenated(name), field.annotation) for name, field in part.model_fields.items()]
    return [(hyphenated(name), field.annotation) for name, field in fields_of(part).items()]


def _message(error: ErrorDetails, path: Path_, value: Any, model: type[Any], scheme: object) -> str:
    kind, context = error["type"], error.get("ctx", {})
    shown = _shown(value)
    if kind in _UNKNOWN:
        known = _fields(model, path[:-1])
        if path[-1] in known and scheme is not None:
            return f"'{path[-1]}' does not go with scheme '{scheme}'"
        return f"unknown key '{path[-1]}'{suggest(str(path[-1]), known)}"
    if kind == "missing" and isinstance(error["loc"][-1], int):
        return _wrong_length(2, len(value))  # every tuple of the language is a pair
    if kind == "missing":
        return f"missing key '{error['loc'][-1]}'"
    shapeless = kind in ("model_type", "dataclass_type", "dict_type", "model_attributes_type", "list_type", "tuple_type")
    if (value is None and not shapeless) or kind in ("string_too_short", "too_short"):
        return "empty; write it, or remove the key"
    match kind:
        case "literal_error" if path == ("card",):
            return f"card language {shown} is unknown; this version of pidemu reads 1"
        case "literal_error" | "enum":
            return _not_one_of(shown, str(value), str(context["expected"]))
        case "union_tag_invalid":
            return _not_one_of(f"'{context['tag']}'", str(context["tag"]), str(context["expected_tags"]))
        case "union_tag_not_found":
            return "missing key 'scheme'"
        case "string_type":
            return f"{shown} is not a text; put it in quotes if it is meant as one"
        case "int_type" | "int_from_float":
            return f"{shown} is not a whole number"
        case "float_type" | "float_parsing" | "int_parsing":
            return f"{shown} is not a number"
        case "bool_type" | "bool_parsing":
            return f"{shown} is neither true nor false"
        case "model_type" | "dataclass_type" | "dict_type" | "model_attributes_type":
            return f"expected a mapping (key: value), found {_kind(value)}"
        case "list_type" | "tuple_type":
            return f"expected a list, found {_kind(value)}"
        case "too_long":
            most = int(context["max_length"])
            return _wrong_length(most, len(value), most if context.get("field_type") == "Tuple" else 1)
        case "less_than_equal":
            return f"{shown} is more than {context['le']:g}, the largest that makes sense"
        case "finite_number":
            return f"{shown} is not a finite number"
        case "greater_than":
            return f"{shown} is not above {'zero' if context['gt'] == 0 else context['gt']}"
        case "one_line" | "two_names" | "not_a_number" | "implausible":
            return str(error["msg"])
        case "string_too_long":
            return f"{len(value)} characters, at most {context['max_length']} are allowed"
        case "string_pattern_mismatch":
            return f"{shown} is not a name: letters, digits and underscores, starting with a letter"
        case _ if kind.startswith(("date_", "datetime_")):
            return f"{shown} is not a date such as 2026-11-22"
        case _:
            return f"{shown}: {error['msg'][0].lower()}{error['msg'][1:]}"


def _not_one_of(shown: str, word: str, expected: str) -> str:
    expected = re.sub(r"<\w+\.\w+: ('[^']*')>", r"\1", expected)
    options = [w.strip("' ") for w in expected.replace(" or ", ", ").split(",")]
    return f"{shown} is not one of {expected}{suggest(word, options)}"


def _wrong_length(expected: int, found: int, least: int | None = None) -> str:
    wanted = str(expected) if least in (None, expected) else f"{least} to {expected}"
    return f"expected {wanted} values, found {found}"


def _kind(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return "a mapping"
    return "a list" if isinstance(value, list) else f"'{shortened(str(value), _LONGEST)}'"


def _shown(value: Any) -> str:
    if isinstance(value, dict | list):
        return _kind(value)
    return f"'{shortened(value, _LONGEST)}'" if isinstance(value, str) else shortened(repr(value), _LONGEST)


def validated(part: type[Whole], value: Any, document: Document, locate: Locate = lambda path: path) -> Whole:
    """Return a card, or an equation, made of plain values.

    Parameters
    ----------
    part : type
        `CardFile` or `Equation`.
    value : object
        The plain values.
    document, locate
        See `problems`.

    Raises
    ------
    CardError
        They do not obey the language: every problem, located.
    """
    try:
        found: Whole = _LANGUAGE[part].validate_python(value)
    except ValidationError as error:
        raise CardError(capped(problems(error, value, part, document, locate))) from None
    return found


def problems(error: ValidationError, value: Any, model: type[Any], document: Document, locate: Locate) -> Iterable[Problem]:
    """Yield one located problem per faulty place.

    Parameters
    ----------
    error : ValidationError
        What pydantic found in `value`.
    value : dict
        The plain value that was validated against `model`.
    model : type
        The part of the language, or a `Model`.
    document : Document
        The file.
    locate : callable
        Maps a path in `value` to its path in the file.
    """
    found: dict[tuple[Path_, bool], list[str]] = {}
    of_numbers: dict[tuple[Path_, bool], str] = {}
    for detail in error.errors(include_url=False):
        path, here = _walk(value, detail["loc"])
        of_key = detail["loc"][-1] == "[key]"
        at_key = of_key or detail["type"] in (*_UNKNOWN, "union_tag_not_found")
        at_key = at_key or (detail["type"] == "missing" and isinstance(detail["loc"][-1], str))
        scheme = _walk(value, (*path[:-1], "scheme"))[1] if path and detail["type"] in _UNKNOWN else None
        message = _message(detail, path, path[-1] if of_key else here, model, scheme if isinstance(scheme, str) else None)
        messages = found.setdefault((path, at_key), [])
        if detail["type"] in _OF_NUMBERS:  # that no text may stand there either is beside the point
            of_numbers[path, at_key] = message
        if message not in messages:
            messages.append(message)
    above = {inner[:n] for inner, _ in found for n in range(len(inner))}
    for (path, at_key), messages in found.items():
        if path in above and not at_key:
            continue  # one branch of a union dislikes the whole, another says which part
        missing = [m for m in messages if m.startswith("missing")]
        for message in missing or [of_numbers.get((path, at_key)) or _united(messages)]:
            key = (message.split("'")[1],) if missing else ()
            yield document.problem(locate((*path, *key)), message, at_key=at_key)


def _united(messages: list[str]) -> str:
    if len(messages) == 1 or not all(" is not " in m for m in messages):
        return messages[0]
    shown = messages[0].split(" is not ")[0]
    wants = [m.split(" is not ", 1)[1] for m in messages]
    return f"{shown} is not {', nor '.join(w.split(';')[0] for w in wants)}"
