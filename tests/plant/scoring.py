"""What a reader should make of the small list, and how far rows are off it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

DATA: Final = Path(__file__).parents[1] / "data" / "plant"
MAP: Final = DATA / "plant_small_map.yaml"
RULES: Final = DATA / "plant_small_rules.yaml"
TARGETS: Final = {"deltav": "emerson/deltav", "pide": "allen-bradley/pide"}
_WITHIN: Final = 5e-4


def expected_rows() -> list[dict[str, Any]]:
    """Return what is expected of each row."""
    rows: list[dict[str, Any]] = json.loads((DATA / "plant_small.expected.json").read_text("utf-8"))["rows"]
    return rows


def canonical(target: str, settings: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return proportional, integral and derivative gain of a target's settings [%/%, 1/s, s], worked out apart from pidemu."""
    if target == "pide":
        return settings.get("PGain", 0.0), settings.get("IGain", 0.0) / 60, settings.get("DGain", 0.0) * 60
    k, ti, td, alpha = (settings.get(n, d) for n, d in (("GAIN", 0.0), ("RESET", math.inf), ("RATE", 0.0), ("ALPHA", 0.125)))
    if settings.get("STRUCTURE") in ("5", "6"):
        return 0.0, k / ti, 0.0
    if settings.get("FORM") == "Series":
        return k * (1 + td / ti), k / ti, k * td * (1 - alpha * td / ti)
    return k, k / ti, k * td


def faults(rows: Iterable[Mapping[str, Any]], kind: str, target: str) -> list[tuple[Any, ...]]:
    """Return everything in which rows are not as expected; `kind` is xlsx or csv."""
    where = {(row["sheet"] if kind == "xlsx" else None, row["row"]): row for row in rows}
    found: list[tuple[Any, ...]] = []
    for want in expected_rows():
        got = where.pop((want["sheet"] if kind == "xlsx" else None, want["xlsx_row" if kind == "xlsx" else "csv_line"]), None)
        found += [(want["no"], "lost")] if got is None else list(_of_row(want, got, kind, target))
    return found + [("more", key) for key in where]


def _of_row(want: Mapping[str, Any], got: Mapping[str, Any], kind: str, target: str) -> Iterable[tuple[Any, ...]]:
    expected = want["class"]
    if expected == "decision" and want["why_any_of"] == ["D-refused"]:
        expected = want[target].get("class", expected)
    if got["class"] != expected:
        yield want["no"], want["tag"], "class", expected, got["class"], got["codes"]
        return
    if expected != "converted":
        if not set(want["why_any_of"]) & set(got["codes"]):
            yield want["no"], want["tag"], "why", want["why_any_of"], got["codes"]
        return
    flags = set(want["must_flag"]) - ({"F-hidden-row"} if kind == "csv" else set())
    if not flags <= set(got["codes"]):
        yield want["no"], want["tag"], "flags", flags, got["codes"]
    numbers = tuple(want["canonical"][name] for name in ("kp", "ki", "kd"))
    have = canonical(target, got["settings"])
    if any(abs(x - y) > _WITHIN * abs(y) + 1e-9 for x, y in zip(have, numbers, strict=True)):
        yield want["no"], want["tag"], "numbers", numbers, have
