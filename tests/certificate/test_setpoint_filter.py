"""Setpoint filters: target behind filter is source, by block diagrams; and where there is none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import pidemu
from pidemu.certificate.setpoint_filter import SetpointFilter, setpoint_filter
from pidemu.law.law import Law
from pidemu.settings.settings import Settings
from tests.conversion.support import Complex, Floats, continuous

W = np.geomspace(1e-4, 1e2, 200)
weights = st.floats(0.05, 1) | st.just(0.0) | st.just(1.0)


def settings(card: str, **values: object) -> Settings:
    return pidemu.load_card(card).settings(values)


def between(source: Settings, target: Settings, factor: float = 1.0) -> SetpointFilter | None:
    return setpoint_filter(source.law(), target.law(), factor)


def response(f: SetpointFilter, w: Floats = W) -> Complex:
    s = 1j * w
    top, bottom = (sum(x * s**k for k, x in enumerate(p)) for p in (f.numerator, f.denominator))
    return np.asarray(top / bottom)


@given(
    names=st.tuples(st.sampled_from(["parallel", "standard"]), st.sampled_from(["parallel", "standard", "series"])),
    K=st.floats(0.2, 5),
    Ti=st.floats(5, 100),
    ratio=st.floats(0.02, 0.2),
    share=st.floats(0.05, 0.5),
    b=weights,
    c=weights,
    other=st.tuples(weights, weights),
    factor=st.floats(0.2, 5),
)
def test_the_target_behind_its_filter_is_the_source(
    names: tuple[str, str],
    K: float,
    Ti: float,
    ratio: float,
    share: float,
    b: float,
    c: float,
    other: tuple[float, float],
    factor: float,
) -> None:
    Td = ratio * Ti
    numbers = {"K": K, "Ti": Ti, "Td": Td, "Tf": share * Td}
    parallel = {"kp": K, "ki": K / Ti, "kd": K * Td, "Tf": share * Td}
    source = settings(f"generic/{names[0]}", **(parallel if names[0] == "parallel" else numbers), b=b, c=c)
    if names[1] == "series":
        target = settings("generic/series", K=factor * K, Ti=Ti, Td=Td, alpha=share)
    else:
        scaled = (
            {**parallel, "kp": factor * K, "ki": factor * K / Ti, "kd": factor * K * Td}
            if names[1] == "parallel"
            else {
                **numbers,
                "K": factor * K,
            }
        )
        target = settings(f"generic/{names[1]}", **scaled, b=other[0], c=other[1])
    found = between(source, target, factor)
    here, there = (continuous(s, W, setpoint=True) for s in (source, target))
    wanted = factor * here / there
    if found is None:
        high = np.abs(wanted[-1]) / np.abs(wanted[-40])  # beyond all time constants
        equal = np.allclose(wanted, 1, rtol=1e-8)
        assert equal or high > 2 or unstable(target)
        return
    # roots of cubics that nearly cancel cost half the digits where two of them are close
    assert np.max(np.abs(response(found) / wanted - 1)) < 1e-6
    assert response(found, np.array([1e-9]))[0] == pytest.approx(1, rel=1e-6)  # both integrate alike: the setpoint is reached
    assert np.all(np.roots(found.denominator[::-1]).real < 0)
    assert len(found.numerator) <= len(found.denominator)


def unstable(target: Settings) -> bool:
    """Whether the setpoint path has a zero on the right, or on the imaginary axis, which the filter would have as a pole."""
    dial = {v.role.value: v.canonical for v in target.values()}
    Tf = target.algorithm().Tf
    if target.equation.form == "series":
        return False
    rate, b, c = dial["integral"], dial["proportional-weight"], dial["derivative-weight"]
    if target.equation.form == "parallel":
        kp, kd, ki = dial["gain"], dial["derivative"], rate
    else:
        kp, kd, ki = dial["gain"], dial["gain"] * dial["derivative"], dial["gain"] * rate
    # ki + (b kp + ki Tf) s + (b kp Tf + c kd) s^2: all coefficients positive, so all roots lie on the left
    return not (ki > 0 and b * kp + ki * Tf > 0 and b * kp * Tf + c * kd >= 0)


def roots_apart(f: SetpointFilter) -> bool:
    """Whether no zero of a filter is also a pole."""
    zeros, poles = (np.roots(p[::-1]) for p in (f.numerator, f.denominator))
    return all(abs(z - p) > 1e-7 * max(abs(z), abs(p)) for z in zeros for p in poles)


@given(b=st.floats(0.05, 0.95), K=st.floats(0.1, 10), Ti=st.floats(1, 500))
def test_for_p_and_i_it_is_the_published_one(b: float, K: float, Ti: float) -> None:
    found = between(settings("generic/standard", K=K, Ti=Ti, b=b), settings("generic/standard", K=K, Ti=Ti))
    assert found is not None
    assert found.numerator == pytest.approx((1.0, b * Ti), rel=1e-9)
    assert found.denominator == pytest.approx((1.0, Ti), rel=1e-9)


def test_from_p_on_the_measurement_to_p_on_the_error_it_is_a_lag_of_the_integral_time() -> None:
    found = between(settings("generic/standard", K=2, Ti=40, b=0), settings("generic/standard", K=2, Ti=40))
    assert str(found) == "1/(1 + 40 s)"


def test_the_other_way_round_it_would_differentiate_and_there_is_none() -> None:
    assert between(settings("generic/standard", K=2, Ti=40), settings("generic/standard", K=2, Ti=40, b=0)) is None


def test_for_equal_setpoint_paths_there_is_none() -> None:
    source = settings("generic/standard", K=2, Ti=40, Td=8, Tf=1, b=0.5, c=0.25)
    assert between(source, source) is None
    assert between(source, settings("generic/parallel", kp=2, ki=0.05, kd=16, Tf=1, b=0.5, c=0.25)) is None
    half = settings("generic/parallel", kp=1, ki=0.025, kd=8, Tf=1, b=0.5, c=0.25)
    assert between(source, half, 0.5) is None


def test_an_unstable_one_is_none() -> None:
    source = settings("generic/standard", K=2, Ti=40, b=0.5)
    backwards = Law(replace(settings("generic/standard", K=2, Ti=40).algorithm(), b=-0.5))  # the setpoint path has a zero at 0.05
    assert setpoint_filter(source.law(), backwards) is None
    assert setpoint_filter(backwards, source.law()) == SetpointFilter(
        pytest.approx((1.0, -20.0)),  # type: ignore[arg-type]
        pytest.approx((1.0, 20.0)),  # type: ignore[arg-type]
    )


def test_a_target_without_integral_would_need_a_filter_that_integrates_and_there_is_none() -> None:
    assert between(settings("generic/standard", K=2, Ti=40), settings("generic/parallel", kp=2, ki=0)) is None


def test_an_unfiltered_derivative_on_the_error_of_the_source_alone_gives_none() -> None:
    assert between(settings("generic/standard", K=2, Ti=40, Td=8), settings("generic/standard", K=2, Ti=40, Td=8, c=0)) is None


def test_an_unfiltered_derivative_on_the_error_of_the_target_alone_is_filtered_away() -> None:
    found = between(settings("generic/standard", K=2, Ti=40, Td=8, c=0), settings("generic/standard", K=2, Ti=40, Td=8))
    assert str(found) == "(1 + 40 s)/(1 + 40 s + 320 s^2)"


def test_a_target_that_does_not_answer_the_setpoint_has_none() -> None:
    on_pv = settings("generic/standard", K=2, Ti="off", Td=8, Tf=1, b=0, c=0)
    assert between(settings("generic/standard", K=2, Ti="off", Td=8, Tf=1), on_pv) is None
    assert between(on_pv, settings("generic/standard", K=2, Ti="off", Td=8, Tf=1)) is None


def test_common_roots_are_left_out() -> None:
    # both paths hold the same lag-filtered derivative: the filter is of third order before and of second after
    found = between(
        settings("generic/standard", K=2, Ti=40, Td=8, Tf=1, b=0.5, c=0), settings("generic/standard", K=2, Ti=40, Td=8, Tf=1, c=0)
    )
    assert str(found) == "(1 + 20 s)/(1 + 40 s)"


@given(b=st.floats(0.1, 0.9), c=st.floats(0.1, 0.9), Tf=st.floats(0.1, 5))
def test_no_root_is_left_on_both_sides(b: float, c: float, Tf: float) -> None:
    source = settings("generic/standard", K=2, Ti=40, Td=8, Tf=Tf, b=b, c=c)
    found = between(source, settings("generic/standard", K=2, Ti=40, Td=8, Tf=Tf))
    assume(found is not None)
    assert found is not None
    assert roots_apart(found)
    assert len(found.denominator) <= 3


@pytest.mark.parametrize(
    ("numerator", "denominator", "text"),
    [
        ((1.0,), (1.0, 35.4), "1/(1 + 35.4 s)"),
        ((1.0, 15.0), (1.0, 20.25), "(1 + 15 s)/(1 + 20.25 s)"),
        ((1.0, 0.0, 3.0), (1.0, 2.0, 1.0), "(1 + 3 s^2)/(1 + 2 s + s^2)"),
        ((1.0, 1.0), (1.0, -0.5, 7.0), "(1 + s)/(1 - 0.5 s + 7 s^2)"),
        ((0.5,), (1.0,), "0.5"),
        ((0.0, 2.0), (1.0, 2.0), "(2 s)/(1 + 2 s)"),
        ((1.0, 123456.0), (1.0, 0.000123456), "(1 + 1.235e+05 s)/(1 + 0.0001235 s)"),
        ((0.0,), (1.0, 2.0), "0/(1 + 2 s)"),
    ],
)
def test_it_is_written_as_people_write_transfer_functions(
    numerator: tuple[float, ...], denominator: tuple[float, ...], text: str
) -> None:
    f = SetpointFilter(numerator, denominator)
    assert str(f) == text
    assert f.to_dict() == {"numerator": list(numerator), "denominator": list(denominator), "text": text}


def test_the_conversion_of_the_documentation_names_its_filter_in_a_warning() -> None:
    source = settings("fisher/provox", GAIN=2, RESET=4, RATE=0.1)
    found = pidemu.convert(source, "emerson/deltav", options={"FORM": "Standard", "STRUCTURE": "1"}, emulate=False)
    f = found.setpoint_filter
    assert f is not None
    assert f.numerator == pytest.approx((1, 15))
    assert f.denominator == pytest.approx((1, 20.25))
    assert any(f"A setpoint filter {f} before the new controller gives the old setpoint response" in w for w in found.warnings)
    assert found.to_dict()["setpoint_filter"] == f.to_dict()


def test_a_filtered_step_makes_the_target_s_output_that_of_the_source() -> None:
    """By emulation: the filter of the documentation, run at a short scan."""
    h, n = 0.05, 4000
    source = settings("generic/standard", K=2, Ti=20, b=0.4)
    target = settings("generic/standard", K=2, Ti=20)
    f = between(source, target)
    assert f is not None
    sp = np.where(np.arange(n) * h < 1, 50.0, 60.0)
    (_, lead), (_, lag) = f.numerator, f.denominator
    state, filtered = 50.0, []
    for x in sp.tolist():
        state += (x - state) * (1 - math.exp(-h / lag))
        filtered.append(x * lead / lag + state * (1 - lead / lag))
    outputs = []
    for s, signal in ((source, sp), (target, np.array(filtered))):
        controller = pidemu.Controller(s, h, output_limits=(-1e12, 1e12))
        controller.rest(50.0, 50.0, 50.0)
        outputs.append(controller.run(signal, np.full(n, 50.0)))
    assert np.ptp(outputs[0]) > 100
    # the filter is continuous, the controllers integrate scan by scan: half a scan of the integral of a step of 10
    assert np.max(np.abs(outputs[0] - outputs[1])) < 2 / 20 * 10 * h
