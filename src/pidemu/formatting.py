"""Plain values: for JSON, and numbers in words."""

from __future__ import annotations

import math
from typing import Any


def json_safe(value: Any) -> Any:
    """Return nested plain values with infinities and NaN as strings (``"inf"``), which JSON cannot hold as numbers."""
    if isinstance(value, dict):
        return {k: json_safe(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [json_safe(v) for v in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def number(x: float, digits: int = 6) -> str:
    """Return a number in so many significant digits, as people write it."""
    if math.isinf(x):
        return "inf" if x > 0 else "-inf"
    x = float(f"{x:.{digits}g}") if digits < 6 else x
    text = f"{x:.{max(digits, 6)}g}"
    return text if "e" not in text or abs(x) < 1e-4 else f"{x:.0f}" if abs(x) < 1e9 else text


def exactly(x: float) -> str:
    """Return a number that reads back as the same one."""
    short = f"{x:.12g}"
    return short if float(short) == x else repr(x)
