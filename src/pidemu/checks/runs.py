"""Rules that compute with a card: its examples, and a scan program for every combination of options."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

from pidemu.algorithm.model import Algorithm
from pidemu.backends.python import compiled
from pidemu.card.document import Path_
from pidemu.card.load import Card, Variant, variants
from pidemu.card.model.base import Form, Status
from pidemu.card.model.card_file import Canonical
from pidemu.controller.bench import Bench
from pidemu.controller.controller import Controller
from pidemu.errors import PidemuError, Problem, UndefinedError
from pidemu.program.builder import build
from pidemu.settings.settings import Settings, limits, off_values

_EXAMPLE_TOLERANCE: Final = 5.1e-6
"""Examples are printed with six digits."""
_AT_REST: Final = 300
"""Scans at rest before the step of an example."""
_ERROR: Final = 7.31
"""A constant error [%] that P alone does not reach a limit with, at a gain of 1."""
_INCREMENT: Final = 0.317
"""What it moves the integral by in one scan [%]; no whole number of them reaches a limit."""
_FAILURES: Final = (PidemuError, ArithmeticError)
"""What computing with a card may end in: its numbers may each be plausible and not go together."""
_CONSTANT: Final = 1000
"""Scans for which the error stays: five times what reaching the limit takes."""


def reject_wrong_examples(card: Card) -> Iterator[Problem]:
    """Every example is run."""
    for i, example in enumerate(card.data.examples):
        place = ("examples", i)
        if example.canonical is None and not example.outputs:
            yield card.document.problem(place, "an example needs 'canonical' or 'outputs', or both")
        try:
            settings = card.settings(example.given)
            if example.canonical is not None:
                yield from _wrong_gains(card, i, settings, example.canonical)
            if example.outputs:
                yield from _wrong_outputs(card, i, settings, example.outputs)
        except _FAILURES as error:
            for line in _told(error).splitlines():
                yield card.document.problem((*place, "given"), line, at_key=True)


def _told(error: Exception) -> str:
    return str(error) if isinstance(error, PidemuError) else "these numbers do not go together: they cannot be computed with"


def _wrong_gains(card: Card, i: int, settings: Settings, stated: Canonical) -> Iterator[Problem]:
    try:
        n0, n1, n2, d1, d2 = settings.law().coefficients()
    except UndefinedError as error:
        yield card.document.problem(
            ("examples", i, "canonical"), f"{str(error).partition(';')[0]}; state 'outputs' instead", at_key=True
        )
        return
    if abs(d2) > 1e-12:
        message = "two filters, or one of second order, have no parallel gains; choose settings without, or state 'outputs'"
        yield card.document.problem(("examples", i), message)
        return
    kp = n1 - n0 * d1
    for name, value in {"kp": kp, "ki": n0, "kd": n2 - kp * d1, "Tf": d1}.items():
        if not math.isclose(getattr(stated, name), value, rel_tol=_EXAMPLE_TOLERANCE, abs_tol=1e-9):
            yield card.document.problem(
                ("examples", i, "canonical", name),
                f"{name} is {getattr(stated, name):g}, the settings amount to {value:.6g}",
            )


def _wrong_outputs(card: Card, i: int, settings: Settings, stated: list[float]) -> Iterator[Problem]:
    controller = Bench(settings, None, sp=50.0, pv=50.0, op=50.0).at_rest()
    rest = controller.run(50.0, [50.0] * _AT_REST)[-1]
    for n, value in enumerate(controller.run(51.0, [50.0] * len(stated)) - rest):
        if not math.isclose(stated[n], value, rel_tol=_EXAMPLE_TOLERANCE, abs_tol=1e-6):
            message = f"output {n + 1} is {stated[n]:g}, the settings amount to {value:.6g}"
            yield card.document.problem(("examples", i, "outputs", n), message)


def reject_unrunnable(card: Card) -> Iterator[Problem]:
    """Every combination of options compiles to a scan program, or says that it is not defined."""
    for variant in variants(card):
        try:
            Controller(plausible(variant)).scan(50.0, 49.0)
        except UndefinedError:
            continue
        except _FAILURES as error:
            chosen = variant.choice_text
            message = f"with {chosen}: {_told(error)}" if chosen else _told(error)
            yield card.document.problem(("options",) if chosen else ("settings",), message)


def reject_windup_that_stops_short(card: Card) -> Iterator[Problem]:
    """Under a constant error the output reaches its limit, unless a source says that on the real thing it does not."""
    seen: set[Path_] = set()
    for variant in variants(card):
        home = variant.home(("integral", "windup"))
        evidence = card.data.evidence.get(card.evidence_key(home) or "")
        proven = evidence is not None and evidence.status in (Status.DOCUMENTED, Status.MEASURED)
        if proven or home in seen or variant.equation.form is Form.DAHLIN:
            continue
        try:
            reached = farthest(plausible(variant).algorithm())
        except _FAILURES:
            continue  # not defined, or refused by another rule
        if reached is not None and reached != (0.0, 100.0):
            seen.add(home)
            message = (
                f"under a constant error the output stays at {reached[1]:.4g} % and never reaches its limit; only what is "
                "documented or measured may do that"
            )
            yield card.document.problem(home, message, at_key=True)


def farthest(algorithm: Algorithm) -> tuple[float, float] | None:
    """Return the outputs that constant errors of either sign lead to, with limits of 0 and 100 %; ``None`` without integral.

    The error is so small that P does not reach the limit by itself; what filters signals, and the derivative, are left out.
    """
    if not algorithm.ki:
        return None
    per_gain = 1 / abs(algorithm.kp) if algorithm.kp else 1.0
    kp, ki = algorithm.kp * per_gain, algorithm.ki * per_gain
    bare = replace(
        algorithm.linear, kp=kp, ki=ki, kd=0.0, Tf=0.0,
        setpoint=replace(algorithm.linear.setpoint, filter=None), error=replace(algorithm.linear.error, filter=None),
    ).filtered(None)  # fmt: skip
    h = _INCREMENT / (_ERROR * abs(ki))
    run = compiled(program := build(bare, h, limits=(0.0, 100.0), initial_output=50.0)).run
    ends = []
    for error in (-_ERROR, _ERROR):
        sp = [50.0, *[50.0 + math.copysign(error, error * ki)] * _CONSTANT]
        n = len(sp)
        ends.append(float(run(list(program.initial), sp, [50.0] * n, [1.0] * n, [math.nan] * n)[-1]))
    return ends[0], ends[1]


def plausible(variant: Variant) -> Settings:
    """Return settings with every term of the variant at work."""
    values: dict[str, object] = dict(variant.chosen)
    for name, s in variant.equation.settings.items():
        if name in variant.active and (s.default is None or s.default in off_values(s)):
            values[name] = working(*limits(s))
    return variant.card.settings(values)


def working(low: float, high: float) -> float:
    """Return a value inside a range: 1 where that fits, else something in the middle."""
    if low <= 1 <= high:
        return 1.0
    if math.isinf(high):
        return low * 2 if low > 0 else low + abs(low) + 1
    return (low + high) / 2 if math.isfinite(low) else high - abs(high) - 1


RULES: Final[tuple[Callable[[Card], Iterator[Problem]], ...]] = (
    reject_wrong_examples,
    reject_unrunnable,
    reject_windup_that_stops_short,
)
