"""One small valid card, a way to spoil it, and what the checks say of the result."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from pidemu.card.load import Card, load_file, variants
from pidemu.checks import check_file
from pidemu.errors import Problem

VALID = """\
card: 1
vendor: Nobody
product: test bench
algorithm: PID
sources:
  manual: {title: Bench manual, read: 2026-01-02}
form: standard
implementation: positional
proportional: {on: error}
integral: {on: error, rule: backward, windup: {scheme: back-calculation, tracking-time: Ti}}
derivative: {on: pv, filter: {applies-to: term, ratio: ALPHA}}
transfer: {start: bumpless}
settings:
  GAIN: {sets: gain, unit: "%/%"}
  RESET: {sets: integral, unit: s, off: inf}
  RATE: {sets: derivative, unit: s, off: 0, default: 0}
  ALPHA: {sets: filter-ratio, unit: "1", range: [0.05, 1], default: 0.125}
options:
  STRUCTURE:
    default: PID
    choices:
      PID: {}
      I-PD: {proportional: {on: pv}}
action:
  names: {reverse: Reverse, direct: Direct}
  example: {name: Reverse, sp: 50, pv: 51, output: falls}
scan: {default: 1 s}
output: {limits: [0, 100]}
evidence:
  form: {status: documented, source: manual, at: p. 3}
  implementation: {status: measured, source: manual, at: trace 1}
  proportional: {status: documented, source: manual, at: p. 3}
  integral: {status: inferred, source: manual, note: from the step response}
  derivative: {status: assumed, note: not stated}
  transfer: {status: assumed, note: not stated}
  settings: {status: documented, source: manual, at: p. 4}
  settings.ALPHA.default: {status: documented, source: manual, at: p. 5}
  options: {status: documented, source: manual, at: p. 6}
  action: {status: documented, source: manual, at: p. 7}
  scan: {status: assumed, note: not stated}
  output: {status: assumed, note: not stated}
quirks:
  - {text: The bench hums., source: manual, at: p. 8}
examples:
  - given: {GAIN: 2, RESET: 60, RATE: 16}
    canonical: {kp: 2, ki: 0.0333333, kd: 32, Tf: 2}
"""

WINDUP = "{scheme: back-calculation, tracking-time: Ti}"
CHOICE = "{proportional: {on: pv}}"
GAIN = '  GAIN: {sets: gain, unit: "%/%"}\n'
ALPHA = '  ALPHA: {sets: filter-ratio, unit: "1", range: [0.05, 1], default: 0.125}\n'
ALPHA_EVIDENCE = "  settings.ALPHA.default: {status: documented, source: manual, at: p. 5}\n"

Edit = tuple[str, str]
Case = tuple[str, tuple[Edit, ...], tuple[str, ...]]
"""A rule's name, edits that break it, and what is said of the result."""

VELOCITY: tuple[Edit, ...] = (("implementation: positional", "implementation: velocity"), (WINDUP, "{scheme: velocity}"))
"""Edits that make the card's implementation velocity."""
_DIALS = VALID[VALID.index("settings:\n") : VALID.index("options:")]
_PROCESS = """\
settings:
  GAIN: {sets: process-gain, unit: "%/%"}
  TIME: {sets: process-time, unit: s}
  LAMBDA: {sets: closed-loop-time, unit: s}
"""
_EXAMPLE = VALID[VALID.index("  - given") :]
DAHLIN: tuple[Edit, ...] = (
    *VELOCITY,
    ("form: standard", "form: dahlin"),
    ("proportional: {on: error}", "proportional: {on: none}"),
    ("derivative: {on: pv, filter: {applies-to: term, ratio: ALPHA}}", "derivative: {on: none}"),
    (_DIALS, _PROCESS),
    (ALPHA_EVIDENCE, ""),
    (CHOICE, "{}"),
    (_EXAMPLE, "  - given: {GAIN: 2, TIME: 10, LAMBDA: 10}\n    outputs: [0.5, 0.547581]\n"),
)
"""Edits that make the card a pole-cancellation algorithm."""


def added(field: str, value: str, *, line: int = 9) -> tuple[Edit, ...]:
    """Return edits that add a field to the card, on line 9 or 8, with its evidence at the end of the other."""
    before = {9: "proportional: {on: error}", 8: "implementation: "}[line]
    evidence = {9: "  proportional: {status", 8: "  implementation: {status"}[line]
    return (
        (f"\n{before}", f"\n{field}: {value}\n{before}"),
        (f"\n{evidence}", f"\n  {field}: {{status: assumed, note: so}}\n{evidence}"),
    )


def found_by(rules: Iterable[Callable[..., Iterable[Problem]]], name: str, folder: Path, text: str) -> set[str]:
    """Return what one rule finds in any combination of a card's options."""
    [rule] = [r for r in rules if r.__name__ == name]
    return {headline for variant in variants(loaded(folder, text)) for headline in headlines(list(rule(variant)))}


def edited(text: str, *edits: Edit) -> str:
    """Return the text with each old part, which occurs exactly once, replaced by the new."""
    for old, new in edits:
        assert text.count(old) == 1, f"{old!r} occurs {text.count(old)} times"
        text = text.replace(old, new)
    return text


def written(folder: Path, text: str) -> Path:
    """Write a card nobody/bench below a folder and return its file."""
    file = folder / "nobody" / "bench.yaml"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return file


def loaded(folder: Path, text: str) -> Card:
    """Return the card that a text makes."""
    return load_file(written(folder, text), shown="bench.yaml")


def faults(folder: Path, text: str) -> list[Problem]:
    """Return what the checks find."""
    return check_file(written(folder, text), shown="bench.yaml")


def headlines(problems: list[Problem]) -> list[str]:
    """Return ``line:column: message`` of each problem, in the order of the file."""
    return [p.headline().removeprefix("bench.yaml:") for p in problems]
