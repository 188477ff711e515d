"""Tuning rules as data: every number against an independent computation, and what the rules claim against what comes out."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.analysis.figures import loop_figures
from pidemu.process.process import Process
from pidemu.tuning.choice import kind_for
from pidemu.tuning.formula import names_in, value
from pidemu.tuning.model import rule_model

REFERENCE: dict[str, Any] = json.loads((Path(__file__).parents[1] / "data" / "tuning_rules.json").read_text("utf-8"))
RULES = {rule.name: rule for rule in pidemu.tuning_rules()}
ROWS = [(p, name, settings) for p in REFERENCE["processes"] for name, settings in p["rules"].items()]
lags = Process.from_lags


def says(name: str, process: Process) -> dict[str, float]:
    return dict(pidemu.tune("generic/standard", process, name).standard)


@pytest.mark.parametrize(("p", "name", "expected"), ROWS, ids=[f"{name}, mu {p['L'] / p['T']:g}" for p, name, _ in ROWS])
def test_a_rule_gives_the_numbers_of_an_independent_computation(p: dict[str, Any], name: str, expected: dict[str, float]) -> None:
    process = lags(p["Kp"], lags=[p["T"]], delay=p["L"])
    low, high = RULES[name].mu
    if not low <= p["L"] / p["T"] <= high:
        with pytest.raises(pidemu.TuningError, match=r"stated for a dead time of 0\.1 to 1 time constants"):
            says(name, process)
        return
    assert pytest.approx(expected, rel=1e-7) == says(name, process)


def test_every_rule_was_compared() -> None:
    assert set(RULES) - {name for _, name, _ in ROWS} == {"tyreus-luyben-pi", "tyreus-luyben-pid"}


def test_tyreus_luyben_follows_the_table() -> None:
    process = lags(2.0, lags=[60], delay=6)
    n = rule_model(process).numbers
    assert pytest.approx({"K": n["Ku"] / 3.2, "Ti": 2.2 * n["Pu"]}) == says("tyreus-luyben-pi", process)
    assert pytest.approx({"K": n["Ku"] / 2.2, "Ti": 2.2 * n["Pu"], "Td": n["Pu"] / 6.3}) == says("tyreus-luyben-pid", process)


@pytest.mark.parametrize("rule", RULES.values(), ids=list(RULES))
def test_a_rule_says_where_it_is_from_and_uses_known_names(rule: pidemu.TuningRule) -> None:
    known = {"Kp", "T", "L", "mu", "R1", "Ku", "Pu", *rule.parameters}
    assert all((rule.source, rule.place, rule.criterion, rule.form, rule.title))
    terms = {"P": {"K"}, "PI": {"K", "Ti"}, "PID": {"K", "Ti", "Td"}}[rule.controller]
    for formulas in rule.formulas.values():
        assert terms == set(formulas)
        assert all(names_in(formula) <= known for formula in formulas.values())


@pytest.mark.parametrize("name", [n for n, r in RULES.items() if {"self-regulating", "integrating"} <= set(r.formulas)])
def test_formulas_for_integrating_processes_are_the_limit_of_the_others_for_a_long_lag(name: str) -> None:
    T, L = 1e7, 4.0
    short, long = lags(0.1, integrators=1, delay=L), lags(0.1 * T, lags=[T], delay=L)
    given = {"lam": 20.0} if "lam" in RULES[name].parameters else {}
    model = [rule_model(p) for p in (short, long)]
    formulas = [RULES[name].formulas[kind_for(RULES[name], m)] for m in model]
    found = [{k: value(f, {**m.numbers, "Tcl": L, **given}) for k, f in fs.items()} for m, fs in zip(model, formulas, strict=True)]
    if name == "lambda":  # a first-order closed loop there, a double pole here
        assert pytest.approx({"K": 44 / (0.1 * 24**2), "Ti": 44}) == found[0]
        return
    assert pytest.approx(found[1], rel=1e-5) == found[0]


def test_lambda_on_an_integrator_is_a_double_pole_with_the_dead_time_as_a_zero() -> None:
    lam, L, gain = 15.0, 4.0, 0.1
    s = pidemu.tune("generic/standard", lags(gain, integrators=1, delay=L), "lambda", lam=lam).standard
    a = s["K"] * gain  # s^2 Ti + a (Ti s + 1)(1 - L s)
    roots = np.roots([s["Ti"] - a * s["Ti"] * L, a * (s["Ti"] - L), a])
    assert pytest.approx([-1 / lam, -1 / lam], rel=1e-6) == roots.real


@pytest.mark.parametrize("case", REFERENCE["half rule"], ids=lambda c: c["case"])
def test_the_half_rule_gives_the_published_reductions(case: dict[str, Any]) -> None:
    zeros = case["zeros (1+z s)"]
    model = rule_model(lags(1.0, lags=case["lags"], leads=zeros, delay=case["dead time"]))
    assert pytest.approx((case["FOPDT"]["tau"], case["FOPDT"]["theta"])) == (model.numbers["T"], model.numbers["L"])


@pytest.mark.parametrize("mu", [0.05, 0.1, 0.2, 0.5, 1.0, 2.0])
def test_amigo_is_as_robust_as_it_comes_out(mu: float) -> None:
    process = lags(1.0, lags=[1 / mu], delay=1.0)
    Ms = [loop_figures(pidemu.tune("generic/standard", process, f"amigo-{c}").settings.law(), process).Ms for c in ("pi", "pid")]
    assert 1.2 < Ms[0] < 1.38  # PI stays below the 1.4 that it is meant for
    assert 1.38 < Ms[1] < 1.45


@pytest.mark.parametrize("mu", [0.1, 0.3, 1.0])
def test_the_ise_rule_has_the_least_ise_of_the_six_and_the_itae_rule_is_never_far(mu: float) -> None:
    process, families = lags(1.0, lags=[1.0], delay=mu), ("ziegler-nichols-step", "cohen-coon", "3c", "iae", "ise", "itae")
    found = {}
    for family in families:
        settings = pidemu.tune("generic/standard", process, family, controller="PI").settings
        run = pidemu.simulate(settings, process, mu / 200, setpoint=0, load=(mu / 200, 1.0), time=40 * mu + 20)
        e, t = np.abs(run.error), run.times
        found[family] = (np.sum(e**2), np.sum(t * e))
    ise, itae = ({f: float(x[i]) for f, x in found.items()} for i in (0, 1))
    assert min(ise, key=ise.__getitem__) == "ise"
    assert itae["itae"] < 1.13 * min(itae.values())


def test_quarter_amplitude_damping_is_what_ziegler_and_nichols_get_on_an_integrator_with_dead_time() -> None:
    L = 1.0
    P = says("ziegler-nichols-step-p", lags(1.0, integrators=1, delay=L))
    s = complex(-0.3, 1.3)
    for _ in range(60):  # s exp(s L) + K = 0, the published period is 4.7 L
        f, slope = s * np.exp(s * L) + P["K"], np.exp(s * L) * (1 + s * L)
        s -= f / slope
    assert pytest.approx((0.224, 4.7), rel=0.01) == (math.exp(2 * math.pi * s.real / s.imag), 2 * math.pi / s.imag / L)


def test_the_title_of_the_paper_of_1942_is_the_printed_one() -> None:
    assert RULES["ziegler-nichols-pid"].source.startswith(
        "Ziegler and Nichols, Optimum Settings for Automatic Controllers, Trans. ASME 64"
    )
