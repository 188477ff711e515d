"""Formulas of tuning rules: the text that is shown is the one that is computed."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from functools import cache
from typing import Any, Final

_FUNCTIONS: Final = {"min": min, "max": max}
_ALLOWED: Final = (
    ast.Expression, ast.BinOp, ast.UnaryOp, ast.Call, ast.Name, ast.Load, ast.Constant, ast.Add, ast.Sub, ast.Mult, ast.Div,
    ast.Pow, ast.USub,
)  # fmt: skip


def value(formula: str, names: Mapping[str, float]) -> float:
    """Return the value of a formula.

    Parameters
    ----------
    formula : str
        Numbers, names, ``+ - * / **``, ``min`` and ``max``.
    names : mapping of str to float
        What the names stand for.

    Examples
    --------
    >>> value("T/(Kp*(L + Tcl))", {"T": 10, "Kp": 2, "L": 1, "Tcl": 4})
    1.0
    """
    return float(eval(_compiled(formula), {"__builtins__": {}, **_FUNCTIONS}, dict(names)))


def names_in(formula: str) -> frozenset[str]:
    """Return the names that a formula uses."""
    return frozenset(n.id for n in ast.walk(ast.parse(formula, mode="eval")) if isinstance(n, ast.Name)) - set(_FUNCTIONS)


@cache
def _compiled(formula: str) -> Any:
    tree = ast.parse(formula, mode="eval")
    for node in ast.walk(tree):
        if not isinstance(node, _ALLOWED):
            raise ValueError(f"'{formula}' is not a formula: {type(node).__name__}")
    return compile(tree, "formula", "eval")
