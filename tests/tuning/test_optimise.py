"""The optimiser against rules, an independent search, exact figures, and wrong input."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from scipy.optimize import differential_evolution

import pidemu
from pidemu.analysis.figures import loop_figures
from pidemu.analysis.load_response import load_iae
from pidemu.errors import PidemuError, SettingError
from pidemu.tuning.compare import tune_all
from pidemu.tuning.criteria import criterion_of
from pidemu.tuning.sampled_loops import LoopResponses, SampledLoops
from tests.cli.helpers import said, strict_json, told

LAG = pidemu.Process.from_lags(1.0, lags=[20], delay=4)
TWO_LAGS = pidemu.Process.from_lags(2.0, lags=[30, 10], delay=6)
TANK = pidemu.Process(gain=0.05, poles=[0], delay=3)


@pytest.mark.parametrize("process", [LAG, TWO_LAGS, TANK], ids=["lag", "two lags", "tank"])
@pytest.mark.parametrize("criterion", ["iae", "ise", "itae"])
@pytest.mark.parametrize("card", ["generic/standard", "fisher/provox"])
def test_no_rule_is_better_by_its_own_criterion(card: str, criterion: str, process: pidemu.Process) -> None:
    best = pidemu.optimise(card, process, criterion, scan=0.5, controller="PI")
    assert best.figures.stable
    assert best.rules
    assert best.criterion <= min(rule.criterion for rule in best.rules) * (1 + 1e-9)


@pytest.mark.parametrize("limit", [1.4, 1.8])
def test_an_independent_search_over_the_emulated_loop_finds_nothing_better(limit: float) -> None:
    """Differential evolution over the scan program with the process, with other bounds and the exact figures as the limit.

    Both stop before the optimum; near it the criterion is flat, so that half a percent is what a search leaves.
    """
    card = pidemu.load_card("generic/standard")

    def cost(x: Any) -> float:
        settings = card.settings(K=math.exp(x[0]), Ti=math.exp(x[1]), Td=0)
        figures = loop_figures(settings.law(0.5), LAG)
        if not figures.stable or figures.Ms > limit:
            return 1e6 * (1 + min(figures.Ms, 1e3))
        return load_iae(settings, LAG, 0.5)

    search = differential_evolution(cost, [(-2, 2), (0, 4)], rng=3, maxiter=25, popsize=10, polish=False)
    best = pidemu.optimise(card, LAG, limits={"Ms": limit}, controller="PI", scan=0.5)
    assert best.criterion == pytest.approx(search.fun, rel=5e-3)
    assert best.figures.Ms <= limit * (1 + 1e-3)


def test_the_criterion_is_that_of_the_emulated_loop() -> None:
    best = pidemu.optimise("emerson/deltav", LAG, limits={"Ms": 1.6}, scan=0.5)
    assert best.criterion == pytest.approx(load_iae(best.settings, LAG, 0.5), rel=1e-4)  # as the run ends
    emulated = pidemu.simulate(best.settings, LAG, 0.5, setpoint=0, load=(0.5, 1e-3), time=400)
    assert best.criterion == pytest.approx(
        emulated.iae / 1e-3, rel=1e-3
    )  # as far as the load step of 0.001 % is one of a linear loop


def test_least_integral_error_is_the_largest_integral_gain() -> None:
    """The integral of the error after a load step is 1/ki, so that the two are one."""
    best = pidemu.optimise("generic/standard", LAG, "ie", limits={"Ms": 1.4}, controller="PI", scan=0.5)
    assert best.criterion == pytest.approx(1 / best.gains["ki"], rel=1e-3)
    rules = [r for r in best.rules if r.within_limits]
    assert all(best.gains["ki"] >= r.settings.algorithm().ki for r in rules)


@pytest.mark.parametrize(
    ("limits", "disturbance"),
    [({"Ms": 1.4}, "load"), ({"Mt": 1.2}, "load"), ({"output_overshoot": 0.15}, "setpoint"), ({"overshoot": 0.1}, "load"),
     ({"decay_ratio": 0.25}, "load"), ({"travel": 1.5}, "load"), ({"noise_gain": 4.0, "Ms": 1.6}, "load")],
)  # fmt: skip
def test_limits_hold(limits: dict[str, float], disturbance: str) -> None:
    best = pidemu.optimise("generic/standard", LAG, "iae", disturbance, limits, scan=0.5)
    assert dict(best.limits) == limits
    for name, most in limits.items():
        assert best.bounded[name] <= most * (1 + 1e-3)
    exact = loop_figures(best.settings.law(0.5), LAG)
    assert exact.stable
    for name in {"Ms", "Mt"} & limits.keys():
        assert getattr(exact, name) <= limits[name] * (1 + 1e-3)


def test_a_tighter_limit_costs() -> None:
    found = [pidemu.optimise("generic/standard", LAG, limits={"Ms": ms}, scan=0.5).criterion for ms in (2.0, 1.6, 1.3)]
    assert found == sorted(found)
    assert found[2] > 1.5 * found[0]


def test_settings_for_a_family_serve_all_of_it() -> None:
    family = [pidemu.Process.from_lags(1.5, lags=[20], delay=4), pidemu.Process.from_lags(1.0, lags=[20], delay=6)]
    alone = pidemu.optimise("generic/standard", LAG, limits={"Ms": 1.8}, controller="PI", scan=0.5)
    best = pidemu.optimise("generic/standard", LAG, limits={"Ms": 1.8}, controller="PI", scan=0.5, family=family)
    assert all(loop_figures(best.settings.law(0.5), p).Ms <= 1.8 * (1 + 1e-3) for p in (LAG, *family))
    assert any(loop_figures(alone.settings.law(0.5), p).Ms > 1.8 for p in family)
    assert best.settings["K"].value < alone.settings["K"].value


@pytest.mark.parametrize("card", ["simple-pid/simple-pid", "iec/61131-3-pid", "bailey/fc18", "honeywell/tdc3000"])
@pytest.mark.parametrize("gain", [1.0, -1.0])
def test_the_sign_of_the_process_is_met_by_action_or_gain(card: str, gain: float) -> None:
    process = pidemu.Process.from_lags(gain, lags=[20], delay=4)
    best = pidemu.optimise(card, process, limits={"Ms": 1.6}, controller="PI", pv_range=(0, 100), op_range=(0, 100), scan=0.5)
    assert best.action == ("reverse" if gain > 0 else "direct")
    emulated = pidemu.simulate(best.settings, process, 0.5, setpoint=(1, 1), load=0, time=400, action=best.action)
    assert emulated.measurement[-1] == pytest.approx(51, abs=0.01)


def test_dials_keep_their_range_and_resolution() -> None:
    best = pidemu.optimise("allen-bradley/plc5", LAG, limits={"Ms": 1.6}, scan=0.5, digits=3, pv_range=(0, 100), op_range=(0, 100))
    for value in best.settings.values():
        low, high = value.setting.range or (0.0, math.inf)
        assert value.off or not value.active or low <= value.value <= high
        assert not value.active or not value.given or value.value == float(f"{value.value:.3g}")


def test_options_and_dials_that_are_named_stay() -> None:
    given = {"ALPHA": 0.2}
    best = pidemu.optimise("emerson/deltav", LAG, limits={"Ms": 1.6}, options={"FORM": "Series"}, given=given, scan=0.5)
    assert best.settings.options["FORM"] == "Series"
    assert best.settings["ALPHA"].value == 0.2


def test_the_same_request_has_the_same_answer() -> None:
    first, second = (pidemu.optimise("generic/series", LAG, limits={"Ms": 1.5}, scan=0.5) for _ in range(2))
    assert first.settings == second.settings
    assert first.to_dict() == second.to_dict()


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"criterion": "best"}, "the criterion is 'best'; it is one of iae, ise, itae, ie"),
        ({"disturbance": "noise"}, "the disturbance is 'noise'; it is one of load, setpoint"),
        ({"limits": {"ms": 1.6}}, r"no limit 'ms' \(did you mean 'Ms'\?\); limits: Ms, Mt"),
        ({"limits": {"Ms": 1.0}}, "the limit Ms is 1.0; give a number above 1"),
        ({"limits": {"travel": "x"}}, "the limit travel is 'x'; give a number above 0"),
        ({"limits": {"Ms": 1.0001}}, "no settings of generic/standard were found that keep the limits Ms 1.0001; widen them"),
        ({"action": "direct"}, "makes the feedback positive"),
    ],
)
def test_wrong_requests_are_told(how: dict[str, Any], message: str) -> None:
    with pytest.raises((PidemuError, SettingError), match=message):
        pidemu.optimise("generic/standard", LAG, **{"scan": 0.5, "controller": "PI", **how})


def test_criteria_of_a_straight_line_are_worked_out_by_hand() -> None:
    """An error of 1 that falls to 0 in 2 s and stays: area 1, square 2/3, first moment 2/3."""
    error = np.concatenate([np.linspace(1, 0, 201), np.zeros(100)])[:, None]
    response = LoopResponses(0.01, error, error)
    assert criterion_of("iae", response)[0] == pytest.approx(1, rel=1e-12)
    assert criterion_of("ise", response)[0] == pytest.approx(2 / 3, rel=1e-12)
    assert criterion_of("itae", response)[0] == pytest.approx(2 / 3, rel=1e-4)
    assert criterion_of("ie", response)[0] == pytest.approx(1, rel=1e-12)


def test_loops_side_by_side_are_those_of_the_scan_program() -> None:
    """Difference equations of many laws, and the emulated controller of each with the exactly sampled process."""
    settings = [t.settings for t in tune_all(pidemu.load_card("emerson/deltav"), LAG, scan=0.7).tunings][:5]
    loops = SampledLoops(LAG, 0.7, 300, [s.law(0.7) for s in settings])
    for disturbance in ("load", "setpoint"):
        found = loops.responses(disturbance)
        for i, s in enumerate(settings):
            step = {"setpoint": 0.0, "load": 0.0, disturbance: (0.0, 1e-3)}
            emulated = pidemu.simulate(s, LAG, 0.7, time=299 * 0.7, **step)  # type: ignore[arg-type]
            np.testing.assert_allclose(1e-3 * found.error[:, i], emulated.error, rtol=0, atol=1e-9)
    for i, s in enumerate(settings):
        exact = loop_figures(s.law(0.7), LAG)
        Ms, Mt = loops.sensitivities()
        assert (Ms[i], Mt[i]) == (pytest.approx(exact.Ms, rel=0.02), pytest.approx(exact.Mt, rel=0.02))  # on a grid


COMMAND = ("optimise", "emerson/deltav", "--process", "gain=1,lag=20,delay=4", "--limit", "Ms=1.6", "--scan", "0.5")


def test_the_command_prints_dials_limits_figures_and_rules() -> None:
    text = told(*COMMAND)
    parts = (
        "Emerson",
        "GAIN",
        "largest sensitivity, at most 1.6",
        "The loop, at a scan every 0.5 s",
        "What rules would give",
        "amigo-pid",
    )
    assert all(part in text for part in parts)


def test_the_command_gives_plain_values() -> None:
    found = strict_json(told(*COMMAND, "--json"))
    schema = json.loads((Path(__file__).parents[2] / "specs" / "optimum.schema.json").read_text("utf-8"))
    jsonschema.validate(found, schema, jsonschema.Draft202012Validator)
    best = pidemu.optimise("emerson/deltav", LAG, limits={"Ms": 1.6}, scan=0.5, digits=5)
    assert found["settings"]["GAIN"] == {"value": best.settings["GAIN"].value, "unit": "%/%"}
    assert found["figures"]["Ms"] <= 1.6 * (1 + 1e-3)
    assert found["limits"] == {"Ms": 1.6}
    assert {"kp", "ki", "kd", "Tf"} == found["gains"].keys()


def test_a_limit_that_is_not_a_number_is_told() -> None:
    result = said(*COMMAND[:-4], "--limit", "Ms=high")
    assert result.status == 2
    assert "the limit Ms is 'high'; give a number above 1" in result.err
