"""Cards with one thing wrong: a name taken away or changed, a value that no engineer would write."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable, Iterator
from typing import Any, Final

from pidemu.card.document import Path_
from pidemu.card.library import card_files
from pidemu.card.reading import parse

ABSURD: Final[tuple[Any, ...]] = (
    0, -1, 1, 2, 1e300, -1e300, 1e-300, 5e-324, math.inf, -math.inf, math.nan, 10**298, "9" * 5000, "", " ", "x" * 5000, "\0",
    "\x1b[2J", "\u202e", "a\nb", "0 s", "1e300 h", "1e-300 ms", "nan s", "-1 s", "inf", "none", None, True, False, [], {}, [0, 0],
    [1, 0], {"on": "none"}, [math.nan, math.nan], [-math.inf, math.inf],
)  # fmt: skip
"""Values to stand in place of any other."""
_NUMBER: Final = "\ue000number:"

Mutation = tuple[str, Any]
"""What was done, and the card's values."""


def document(card_id: str) -> Any:
    """Return the values of a built-in card."""
    return parse(card_files()[card_id].read_text(encoding="utf-8"), card_id).value


def written_out(value: Any) -> str:
    """Return values as YAML."""

    def plain(x: Any) -> Any:
        if isinstance(x, dict):
            return {k: plain(v) for k, v in x.items()}
        if isinstance(x, list):
            return [plain(v) for v in x]
        if isinstance(x, float) and not math.isfinite(x):
            return f"{_NUMBER}{'.nan' if math.isnan(x) else '.inf' if x > 0 else '-.inf'}"
        return f"{_NUMBER}{x}" if isinstance(x, str) and len(x) == 5000 and x.isdigit() else x

    text = json.dumps(plain(value), indent=1)
    for word in (".nan", "-.inf", ".inf", "9" * 5000):
        text = text.replace(json.dumps(f"{_NUMBER}{word}"), word)
    return text


def scalars(value: Any, path: Path_ = ()) -> Iterator[Path_]:
    """Yield the path of everything that is neither a mapping nor a list of mappings."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from scalars(item, (*path, key))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for i, item in enumerate(value):
            yield from scalars(item, (*path, i))
    else:
        yield path


def changed(value: Any, path: Path_, change: Callable[[Any, Any], None]) -> Any:
    """Return a copy in which the container of a path was changed by ``change(container, key)``."""
    found = copy.deepcopy(value)
    at = found
    for step in path[:-1]:
        at = at[step]
    change(at, path[-1])
    return found


def _named(value: Any) -> Iterator[Path_]:
    """Yield the paths of settings, options and choices, and of sections that can be taken away."""
    for key in value:
        yield (key,)
    for key in value["settings"]:
        yield ("settings", key)
    for key, option in value.get("options", {}).items():
        yield ("options", key)
        for choice, fields in option["choices"].items():
            yield ("options", key, "choices", choice)
            yield from (("options", key, "choices", choice, "settings", name) for name in fields.get("settings") or ())


def _deleted(at: Any, key: Any) -> None:
    del at[key]


def _renamed(at: Any, key: Any) -> None:
    entries = list(at.items())
    at.clear()
    at.update((f"{k}x" if k == key else k, v) for k, v in entries)


def _another_name(at: Any, key: Any) -> None:
    at[key] = f"{at[key]}x"


def wrong_names(value: Any) -> Iterator[Mutation]:
    """Yield a card with every setting, option, choice and section deleted and renamed in turn, and every text that is a name."""
    names = {str(n) for path in _named(value) for n in path}
    for path in _named(value):
        yield f"delete {path}", changed(value, path, _deleted)
        yield f"rename {path}", changed(value, path, _renamed)
    for path in scalars(value):
        at = value
        for step in path:
            at = at[step]
        if isinstance(at, str) and (at in names or path[-1] in ("name", "default", "source")):
            yield f"another name at {path}", changed(value, path, _another_name)
        yield f"delete {path}", changed(value, path, _deleted)


def absurd_values(value: Any) -> Iterator[Mutation]:
    """Yield a card with every scalar replaced by every absurd value."""
    for path in scalars(value):
        for absurd in ABSURD:

            def replaced(at: Any, key: Any, absurd: Any = absurd) -> None:
                at[key] = copy.deepcopy(absurd)

            yield f"{absurd!r:.40} at {path}", changed(value, path, replaced)
