"""The command that prints a scan program: what it prints runs, and gives the emulator's bits."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest

import pidemu
from pidemu.card.library import card_files
from tests.cli.helpers import told

Scan = tuple[float, float, bool, float | None]

_EXAMPLES = [(i, e.given) for i in card_files() for e in pidemu.load_card(i).data.examples]


def signals(low: float, high: float, count: int = 60) -> list[Scan]:
    """A run with setpoint steps, noise, saturation and two spells in manual."""
    chance = random.Random(7)
    low, high = max(low, -1000), min(high, 1000)
    middle, width = (low + high) / 2, (high - low) / 2
    found: list[Scan] = []
    for i in range(count):
        sp = middle + width * (0.1 if i < 20 else 0.9 if i < 40 else -0.5)
        pv = middle + width * chance.uniform(-0.3, 0.3)
        manual = middle + width * chance.uniform(-0.5, 0.5) if i % 3 else None
        found.append((sp, pv, not (i < 4 or 25 <= i < 31), manual))
    return found


def printed(*words: str) -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(told("code", *words), names)
    return names


def run_scan_by_scan(module: dict[str, Any], scans: list[Scan]) -> list[float]:
    state = list(module["INITIAL"])
    return [module["scan"](state, sp, pv, float(auto), math.nan if man is None else man) for sp, pv, auto, man in scans]


@pytest.mark.parametrize(("card_id", "given"), _EXAMPLES, ids=str)
def test_the_printed_python_gives_the_same_outputs_as_the_controller(card_id: str, given: dict[str, str | float]) -> None:
    controller = pidemu.Controller(pidemu.load_card(card_id).settings(given))
    scans = signals(*controller.settings.equation.output.limits)
    words = [f"{name}={value}" for name, value in given.items()]
    assert run_scan_by_scan(printed(card_id, *words, "--lang", "python"), scans) == [controller.scan(*s) for s in scans]


@pytest.mark.parametrize("action", ["reverse", "direct"])
def test_scan_interval_action_and_limits_are_printed_in(action: Any) -> None:
    settings = pidemu.load_card("emerson/deltav").settings(GAIN=1.5, RESET=20, RATE=4, FORM="Series")
    controller = pidemu.Controller(settings, 0.25, action, (10, 90))
    module = printed(
        "emerson/deltav", "GAIN=1.5", "RESET=20", "RATE=4", "FORM=Series",
        "--scan", "0.25", "--action", action, "--limits", "10,90",
    )  # fmt: skip
    scans = signals(0, 100)
    assert run_scan_by_scan(module, scans) == [controller.scan(*s) for s in scans]
    words = ("GAIN=1.5", "RESET=20", "RATE=4", "FORM=Series", "--scan", "0.25", "--action", action, "--limits", "10,90")
    assert told("code", "emerson/deltav", *words).splitlines()[0].endswith(f"scan 0.25 s, {action} acting")


def test_the_printed_run_does_what_scan_after_scan_does() -> None:
    module = printed("generic/standard", "K=2", "Ti=10", "Td=1", "Tf=0.5")
    scans = signals(0, 100)
    sp, pv, auto, manual = ([float("nan") if x is None else float(x) for x in column] for column in zip(*scans, strict=True))
    assert module["run"](list(module["INITIAL"]), sp, pv, auto, manual) == run_scan_by_scan(module, scans)


def test_the_printed_module_imports_nothing() -> None:
    assert "import" not in told("code", "emerson/deltav", "GAIN=2", "RESET=60", "RATE=16")


def test_two_calls_print_the_same() -> None:
    words = ("code", "honeywell/udc", "PB=50", "RSET=20", "MINorRPM=RPM")
    assert told(*words) == told(*words)
