"""How much work a conversion is: counts of what takes long, which no noisy machine changes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

import pidemu
from pidemu.certificate import linear
from pidemu.conversion import certify, options
from pidemu.errors import PidemuError
from pidemu.matrix.typical import typical_settings
from pidemu.settings.ranges import SignalRange
from pidemu.settings.settings import Settings

RANGE = SignalRange(0.0, 100.0)


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Calls of what takes long, from here on."""
    counted: Counter[str] = Counter()

    def counting(module: Any, name: str) -> None:
        real: Callable[..., Any] = getattr(module, name)

        def call(*given: Any, **named: Any) -> Any:
            counted[name] += 1
            return real(*given, **named)

        monkeypatch.setattr(module, name, call)

    counting(options, "_attempt")
    counting(certify, "emulated")
    counting(certify, "nonlinear_differences")
    counting(certify, "prove")
    counting(linear, "differences")
    return counted


def provox() -> Settings:
    return pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)


def test_options_that_cannot_win_are_not_tried(calls: Counter[str]) -> None:
    found = pidemu.convert(provox(), "emerson/deltav")
    assert len(found.ranking) == 32
    assert calls["_attempt"] == 6
    assert calls["differences"] <= 20
    assert len(list(found.ranking)) == calls["_attempt"]


def test_choices_with_one_law_are_solved_once(calls: Counter[str]) -> None:
    """Nine pairs of scan rules are one continuous law; the first of them is what the card delivers."""
    found = pidemu.convert(pidemu.load_card("generic/parallel").settings(kp=2, ki=4, kd=0.1), "generic/standard")
    assert (len(found.ranking), calls["_attempt"]) == (9, 1)
    assert found.chosen == {}


def test_options_that_are_named_are_tried_alone(calls: Counter[str]) -> None:
    pidemu.convert(provox(), "emerson/deltav", options={"FORM": "Series", "STRUCTURE": "1", "FRSIPID_OPTS": "none"})
    assert calls["_attempt"] == 1


def test_controllers_are_run_against_each_other_when_somebody_asks(calls: Counter[str]) -> None:
    found = pidemu.convert(provox(), "emerson/deltav")
    assert (calls["emulated"], calls["nonlinear_differences"]) == (0, 0)
    assert found.verdict == "exact"
    assert (calls["emulated"], calls["nonlinear_differences"], calls["prove"]) == (1, 0, 1)
    assert found.sentence == found.sentence
    assert (calls["emulated"], calls["nonlinear_differences"]) == (1, 1)


def test_a_law_that_is_another_one_needs_no_emulation_for_its_verdict(calls: Counter[str]) -> None:
    found = pidemu.convert(pidemu.load_card("generic/standard").settings(K=2, Ti=20, Td=3, Tf=1), "honeywell/tdc3000")
    assert (found.verdict, calls["emulated"], calls["prove"]) == ("approximate", 0, 0)


@pytest.mark.parametrize("scan", [None, (1.0, 0.5)])
@pytest.mark.parametrize("source", ["fisher/provox", "generic/parallel", "yokogawa/fieldbus-pid", "allen-bradley/plc5"])
def test_no_choice_is_better_than_its_bound(source: str, scan: tuple[float, float] | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every choice of every card: what bounds its merit holds, and the order is that of sorting all of them."""
    tried: list[tuple[options.OptionChoice, options.Attempt]] = []
    real = options._attempt

    def attempt(choice: options.OptionChoice, *rest: Any) -> options.Attempt:
        found = real(choice, *rest)
        tried.append((choice, found))
        return found

    monkeypatch.setattr(options, "_attempt", attempt)
    settings = replace(typical_settings(pidemu.load_card(source)), pv_range=RANGE, op_range=RANGE)
    for target in pidemu.cards():
        tried.clear()
        try:
            found = pidemu.convert(settings, target, scan=scan, mode="auto", assume=True, allow_approximate=True, emulate=False)
        except PidemuError:
            continue
        ranks = [one.rank for one in found.ranking]
        assert ranks == sorted(ranks)
        for choice, one in tried:
            assert one.merit is None or options._rank(choice.floor) <= one.rank
            assert not (choice.is_hopeless and one.merit)
