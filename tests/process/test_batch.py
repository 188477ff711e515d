"""The test batch, the half rule, and gains in engineering units."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pidemu
from pidemu.analysis.frequency import loop_response
from pidemu.errors import ProcessError
from pidemu.process.process import Process, parse_process
from pidemu.process.reduction import half_rule
from pidemu.process.text import written
from tests.process.curves import reference


def refused(message: str) -> Any:
    return pytest.raises(ProcessError, match="^" + re.escape(message))


def test_the_batch_has_nine_families() -> None:
    batch = pidemu.test_batch()
    families = [name.split()[0] for name in batch]
    assert {name: families.count(name) for name in dict.fromkeys(families)} == {
        "P1": 21, "P2": 21, "P3": 10, "P4": 6, "P5": 9, "P6": 9, "P7": 36, "P8": 11, "P9": 10,
    }  # fmt: skip
    assert list(pidemu.test_batch("P4")) == [f"P4 n={n}" for n in range(3, 9)]


W = np.geomspace(0.01, 30, 50)
S = 1j * W
FORMULAS = {
    "P1 T=0.3": np.exp(-S) / (1 + 0.3 * S),
    "P2 T=0.3": np.exp(-S) / (1 + 0.3 * S) ** 2,
    "P3 T=0.2": 1 / ((S + 1) * (1 + 0.2 * S) ** 2),
    "P4 n=5": 1 / (S + 1) ** 5,
    "P5 alpha=0.4": 1 / ((1 + S) * (1 + 0.4 * S) * (1 + 0.16 * S) * (1 + 0.064 * S)),
    "P6 L1=0.3": np.exp(-0.3 * S) / (S * (1 + 0.7 * S)),
    "P6 L1=1": np.exp(-S) / S,
    "P7 T=5 L1=0.3": 5 * np.exp(-0.3 * S) / ((1 + 5 * S) * (1 + 0.7 * S)),
    "P8 alpha=0.6": (1 - 0.6 * S) / (S + 1) ** 3,
    "P9 T=0.4": 1 / ((S + 1) * ((0.4 * S) ** 2 + 1.4 * 0.4 * S + 1)),
}


@pytest.mark.parametrize("name", FORMULAS)
def test_a_process_of_the_batch_is_its_formula(name: str) -> None:
    np.testing.assert_allclose(pidemu.test_batch()[name].response(W), FORMULAS[name], rtol=1e-12)


def test_a_family_that_is_none_is_refused() -> None:
    with refused("no family 'P0' in the test batch"):
        pidemu.test_batch("P0")


@pytest.mark.parametrize("case", reference()["half rule"]["cases"], ids=lambda case: case["case"])
def test_the_half_rule_gives_the_published_models(case: dict[str, Any]) -> None:
    process = Process.from_lags(case["gain"], case["lags"], case["zeros (1+z s)"], delay=case["dead time"])
    first, second = case["FOPDT"], case["SOPDT"]
    assert half_rule(process).delay == pytest.approx(first["theta"], abs=1e-12)
    assert -1 / half_rule(process).poles[0].real == pytest.approx(first["tau"])
    found = half_rule(process, order=2)
    assert found.delay == pytest.approx(second["theta"], abs=1e-12)
    assert [-1 / p.real for p in found.poles] == pytest.approx([second["tau1"], second["tau2"]])


def test_the_half_rule_takes_an_integrator_for_the_largest_lag() -> None:
    process = Process.from_lags(0.5, [4, 1], integrators=1, delay=2, unit="degC/%")
    assert half_rule(process) == Process.from_lags(0.5, integrators=1, delay=5, unit="degC/%")
    assert half_rule(process, 2) == Process.from_lags(0.5, [4.5], integrators=1, delay=2.5, unit="degC/%")


@pytest.mark.parametrize(
    ("process", "order", "message"),
    [
        (Process(1, [-1 + 1j, -1 - 1j]), 1, "the half rule is for real lags, and the pole -1+1j rad/s is none"),
        (Process(1, [1, -1]), 1, "the half rule is for real lags, and the pole 1+0j rad/s is none"),
        (Process.from_lags(1, [2], integrators=2), 1, "1/(s^2(2 s + 1)) has 2 integrators; the half rule is for one at most"),
        (Process.from_lags(1, [5, 1], [3]), 1, "the leads of 1 (3 s + 1)/((5 s + 1)(s + 1)) are longer than the dead time and"),
        (Process(1, [-1, -2], [0]), 1, "the half rule is for real leads, and the zero 0+0j rad/s is none"),
        (Process(1, [-1]), 3, "order is 3; give 1 or 2, the number of lags that are kept"),
    ],
)
def test_what_the_half_rule_is_not_for_is_refused(process: Process, order: Any, message: str) -> None:
    with refused(message):
        half_rule(process, order)


@pytest.mark.parametrize(
    ("text", "gain", "unit"),
    [("gain=2 degC/%", 2, "degC/%"), ("gain=-0.5 t/h/%", -0.5, "t/h/%"), ("gain=2", 2, "%/%"), ("gain=2 %/%", 2, "%/%")],
)
def test_a_gain_is_read_and_written_with_its_unit(text: str, gain: float, unit: str) -> None:
    process = parse_process(f"{text},lag=10", any_unit=True)
    assert (process.gain, process.unit) == (gain, unit)
    assert parse_process(written(process), any_unit=True) == process
    assert str(process) == f"{gain:g}/(10 s + 1)" + (f" [{unit}]" if unit != "%/%" else "")


def test_a_gain_in_engineering_units_becomes_one_in_percent_with_the_ranges() -> None:
    process = Process(2, [-0.1], delay=3, unit="degC/%")
    assert process.in_percent("0,400 degC") == Process(0.5, [-0.1], delay=3)
    assert Process(2, [-0.1], unit="degC/mA").in_percent((0, 400), (4, 20, "mA")).gain == pytest.approx(0.08)
    with refused(
        "the gain of 2 exp(-3 s)/(10 s + 1) [degC/%] is in degC/%, and the range of the measurement, 0 to 10 bar, in another"
    ):
        process.in_percent("0,10 bar")


def test_a_loop_refuses_a_gain_that_is_not_in_percent() -> None:
    settings = pidemu.load_card("generic/standard").settings(K=1, Ti=10)
    message = "the gain of 2/(10 s + 1) [degC/%] is in degC/%, and a loop is computed in %/%; give process.in_percent(pv_range)"
    with refused(message):
        pidemu.simulate(settings, Process(2, [-0.1], unit="degC/%"), scan=1)
    with refused(message):
        pidemu.convert(settings, "emerson/deltav", process=Process(2, [-0.1], unit="degC/%"))
    with refused(message):
        pidemu.robustness(settings, Process(2, [-0.1], unit="degC/%"))
    with refused(message):
        loop_response(settings, Process(2, [-0.1], unit="degC/%"))
    with refused("gain=2 degC/%: a process gain is in %/% of the signal ranges; convert it and leave out the unit"):
        parse_process("gain=2 degC/%,lag=10")


@pytest.mark.parametrize("unit", ["degC", "/%", "degC/", 3, "a,b/%"])
def test_a_unit_that_is_not_one_per_another_is_refused(unit: Any) -> None:
    with refused("the unit of a process gain is"):
        Process(1, unit=unit)


@given(st.sampled_from(list(pidemu.test_batch().values())), st.floats(0.1, 10), st.just(0.0) | st.floats(0.01, 20))
def test_a_rounded_process_is_nearly_the_same(process: Process, rate: float, delay: float) -> None:
    process = Process(process.gain / 3, [rate * p for p in process.poles], [rate * z for z in process.zeros], delay)
    np.testing.assert_allclose(process.rounded().response(W[:20]), process.response(W[:20]), rtol=2e-4)
