"""Which dials an equation uses: by their role alone, or because a field names them."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from typing import Any, Final

from pidemu.card.model.base import Form, hyphenated
from pidemu.card.model.card_file import Equation, Setting
from pidemu.card.model.marks import Beyond, Names, PerScan, fields_of, marked, parts_in, walk

BY_ROLE: Final = (
    "gain", "multiplier", "integral", "derivative", "bias", "process-gain", "process-time", "process-delay", "closed-loop-time",
)  # fmt: skip
"""Roles that need no field to name them."""


def references(equation: Equation) -> Iterator[tuple[tuple[str, ...], object, Names]]:
    """Yield every field that may name a setting: its path, its value, and what the setting must set."""
    for path, owner, mark in walk(equation, Names):
        value = getattr(owner, path[-1])
        if value is not None:
            yield tuple(map(hyphenated, path)), value, mark


def named_settings(equation: Equation) -> Iterator[tuple[tuple[str, ...], str, str]]:
    """Yield every field that names a setting: its path, the name, and the role that the setting must have."""
    for path, name, mark in references(equation):
        if isinstance(name, str) and name not in mark.words:
            yield path, name, mark.sets


def is_active(equation: Equation, name: str, setting: Setting) -> bool:
    """Tell whether an equation uses a dial: its term exists, or a field at work names it."""
    has_derivative, filt = equation.derivative.on != "none", equation.derivative.filter
    if setting.sets == "gain":
        return not (equation.form is Form.PARALLEL and equation.proportional.on == "none")
    if setting.sets in ("integral", "derivative"):
        return equation.integral.on != "none" if setting.sets == "integral" else has_derivative
    if setting.sets in BY_ROLE:
        return True
    without_derivative = filt is not None and filt.applies_to not in ("term", "lead-lag") and filt.time == name
    for path, value, mark in references(equation):
        if value != name or mark.sets != setting.sets:
            continue
        of_the_integral = path[0] == "integral" and equation.integral.on == "none"
        of_the_derivative = path[0] == "derivative" and not has_derivative and not without_derivative
        if not of_the_integral and not of_the_derivative:
            return True
    return False


def makes_the_law(path: Sequence[str], sets: str = "") -> bool:
    """Tell whether the linear law depends on a field; the rest matters scan by scan, at limits and at transfers only.

    Parameters
    ----------
    path : sequence of str
        The keys that lead to it in the card.
    sets : str
        Of a field of a dial, what that dial sets.
    """
    return sets not in _sets_beyond_the_law() and not _is_per_scan(path)


def _is_per_scan(path: Sequence[str]) -> bool:
    parts: list[type[Any]] = [Equation]
    for key in path:
        found = [(part, name) for part in parts for name in fields_of(part) if hyphenated(name) == key]
        if any(name in marked(part, PerScan) for part, name in found):
            return True
        parts = [inner for part, name in found for inner in parts_in(fields_of(part)[name].annotation)]
    return False


@functools.cache
def _sets_beyond_the_law() -> frozenset[str]:
    """Return what dials set that only fields beyond the law name; and the bias, which no field names."""
    inside: set[str] = set()
    beyond = {"bias"}

    def look(part: type[Any], outside: bool) -> None:
        for name, field in fields_of(part).items():
            out = outside or name in marked(part, PerScan) or name in marked(part, Beyond)
            if name in marked(part, Names):
                (beyond if out else inside).add(marked(part, Names)[name].sets)
            for inner in parts_in(field.annotation):
                look(inner, out)

    look(Equation, outside=False)
    return frozenset(beyond - inside)
