"""Conversions from one scan interval and rule to another: what a process sees of both, found by emulation."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

import hypothesis
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import pidemu
from pidemu.card.load import Card
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.errors import ScanError
from pidemu.settings.settings import Settings
from tests.conversion.support import Floats, difference, outputs, random_signal
from tests.helpers import WIDE, made_up_card

RULES = ("backward", "forward", "trapezoidal")
CARDS = {rule: made_up_card(integral={"rule": rule, "windup": {"scheme": "none"}}) for rule in RULES}
"""A parallel PID without filter under each rule of the integral."""
H = 0.5

KP, KI, KD = 2.0, 0.1, 8.0
BY_HAND = {
    "PI": {"backward": (2.05, -2.0, 0.0), "forward": (2.0, -1.95, 0.0), "trapezoidal": (2.025, -1.975, 0.0)},
    "PID": {"backward": (18.05, -34.0, 16.0), "forward": (18.0, -33.95, 16.0), "trapezoidal": (18.025, -33.975, 16.0)},
}
"""What a scan adds to the output, ``q0 e_n + q1 e_(n-1) + q2 e_(n-2)``, for KP, KI, KD (none for PI) at H, in the head."""
KP_FOR = {
    ("backward", "forward"): 2.05, ("backward", "trapezoidal"): 2.025, ("forward", "backward"): 1.95,
    ("forward", "trapezoidal"): 1.975, ("trapezoidal", "backward"): 1.975, ("trapezoidal", "forward"): 2.025,
}  # fmt: skip
"""The proportional gain that makes one rule's increments of the other's: by half a scan of the integral, or by a whole one."""


def settings(card: str | Card, **values: object) -> Settings:
    return (pidemu.load_card(card) if isinstance(card, str) else card).settings(values)


def convert(source: Settings, target: str | Card, **more: object) -> pidemu.Conversion:
    """Convert with compensation, which has to be asked for."""
    return pidemu.convert(source, target, **{"emulate": False, "compensate": "scan" in more, **more})  # type: ignore[arg-type]


def increments(s: Settings, h: float, scans: int) -> Floats:
    """What an emulated controller at rest adds to its output, scan by scan, after the measurement fell by 1 for one scan."""
    controller = pidemu.Controller(s, h, output_limits=WIDE)
    controller.rest(0.0, 0.0, 0.0)
    pulse = np.zeros(scans)
    pulse[0] = 1.0
    return np.asarray(np.diff(controller.run(np.zeros(scans), -pulse), prepend=0.0))


def memory(s: Settings, h: float) -> int:
    """Return how many scans it takes until nothing is left of a pulse: by the pole of the derivative filter under its rule."""
    a = s.algorithm()
    pole = {
        "backward": a.Tf / (a.Tf + h),
        "forward": 1 - h / a.Tf if a.Tf else 0.0,
        "trapezoidal": (2 * a.Tf - h) / (2 * a.Tf + h) if a.Tf else 0.0,
        "lagged-difference": math.exp(-h / a.Tf) if a.Tf else 0.0,
    }[a.derivative.rule.value]
    return 10 + math.ceil(30 / -math.log(abs(pole))) if pole else 10


def seen(s: Settings, h: float, terms: int = 4) -> list[float]:
    """Moments of what a process sees: ``s C(z) (1 - z^-1)/(s h) = sum g_n exp(-n h s)/h``, with the increments ``g_n``."""
    g, n = increments(s, h, memory(s, h)), np.arange(memory(s, h))
    return [float(np.sum(g * (-n * h) ** k)) / (h * math.factorial(k)) for k in range(terms)]


@pytest.mark.parametrize("kind", BY_HAND)
@pytest.mark.parametrize("rule", RULES)
def test_the_increments_worked_out_by_hand_are_those_of_the_emulated_controller(kind: str, rule: str) -> None:
    found = increments(settings(CARDS[rule], kp=KP, ki=KI, kd=KD if kind == "PID" else 0), H, 6)
    assert found == pytest.approx([*BY_HAND[kind][rule], 0, 0, 0], abs=1e-13)  # sums of numbers up to 34


@pytest.mark.parametrize("kind", BY_HAND)
@pytest.mark.parametrize(("rule", "other"), list(itertools.permutations(RULES, 2)))
def test_from_rule_to_rule_at_one_interval_a_pid_without_filter_is_exact(kind: str, rule: str, other: str) -> None:
    kd = KD if kind == "PID" else 0.0
    found = convert(settings(CARDS[rule], kp=KP, ki=KI, kd=kd), CARDS[other], scan=H, emulate=True)
    assert (found.match, found.verdict) == ("exact", "exact")
    dials = {name: found.settings[name].value for name in ("kp", "ki", "kd")}
    assert dials == pytest.approx({"kp": KP_FOR[rule, other], "ki": KI, "kd": kd}, rel=1e-12)
    assert increments(found.settings, H, 6) == pytest.approx([*BY_HAND[kind][rule], 0, 0, 0], abs=1e-12)
    for seed in range(3):
        sp, pv = random_signal(seed), random_signal(100 + seed)
        a, b = (outputs(s, sp, pv, H) for s in (found.source, found.settings))
        assert np.ptp(a) > 1
        assert difference(a, b) < 1e-9  # 200 scans of doubles


@pytest.mark.parametrize("kp", [0.0, 0.02])
def test_where_the_gain_would_have_to_be_negative_the_settings_of_the_continuous_law_stay(kp: float) -> None:
    found = convert(settings(CARDS["forward"], kp=kp, ki=KI), CARDS["backward"], scan=H)  # kp - ki h is below zero
    assert {n: v.value for n, v in found.settings.items()} == {"kp": kp, "ki": KI, "kd": 0.0}
    assert not found.certificate.compensated
    assert found.verdict == "exact"  # the same law, and the backward rule is the earlier of the two


def test_the_textbook_s_rule_to_scale_the_gain_by_the_intervals_is_not_followed() -> None:
    found = convert(settings(CARDS["backward"], kp=KP, ki=KI), CARDS["backward"], scan=(1.0, 0.25))
    assert {n: v.value for n, v in found.settings.items()} == {"kp": KP, "ki": KI, "kd": 0.0}


TARGETS: dict[str, tuple[str, Mapping[str, object]]] = {
    "backward": ("generic/parallel", {}),
    "backward, standard": ("generic/standard", {}),
    "forward": ("mathworks/pid2", {"FORM": "parallel", "IFormula": "ForwardEuler", "DFormula": "ForwardEuler"}),
    "trapezoidal": ("mathworks/pid2", {"FORM": "standard", "IFormula": "Trapezoidal", "DFormula": "Trapezoidal"}),
    "lagged difference": ("advanced-pid/advanced-pid", {}),
    "series": ("generic/series", {}),
}


@pytest.mark.parametrize("name", TARGETS)
@hypothesis.settings(max_examples=15)
@given(Ti=st.floats(20, 60), Td=st.floats(0.05, 0.15), Tf=st.floats(0.1, 0.3), h=st.floats(0.2, 1.0), times=st.floats(0.2, 5.0))
def test_the_moments_of_what_a_process_sees_agree(name: str, Ti: float, Td: float, Tf: float, h: float, times: float) -> None:
    target, options = TARGETS[name]
    source = settings("generic/standard", K=1.5, Ti=Ti, Td=Td * Ti, Tf=Tf * Td * Ti)
    scans = h, h * times
    try:
        found = convert(source, target, options=options, scan=scans)
    except ScanError:  # the forward rule needs a filter longer than half a scan
        assume(False)
    # else moments that agree would be farther off in the loop band
    assume(found.certificate.compensated and found.match == "low-frequency")
    assume(memory(found.settings, scans[1]) < 500)  # the trapezoidal rule rings with a short filter, and the sums lose digits
    wanted, reached = seen(source, scans[0]), seen(found.settings, scans[1])
    sizes = 1.5 / Ti, 1.5, 1.5 * Ti, 1.5 * Ti**2
    for k in range(3):
        assert abs(wanted[k] - reached[k]) < 1e-8 * sizes[k]  # the sums have n^2 h^2 as factors
    longer = found.settings.algorithm().Tf > 0.5 * scans[1]
    if name in ("backward", "backward, standard") and found.settings["Tf"].value > 0 and longer:  # m3 by the free filter
        assert abs(wanted[3] - reached[3]) < 1e-4 * sizes[3]


@pytest.mark.parametrize("name", [n for n in TARGETS if n != "series"])
@pytest.mark.parametrize("scans", [(1.0, 0.5), (1.0, 0.1)])
def test_a_faster_scan_is_made_up_for_with_less_derivative(name: str, scans: tuple[float, float]) -> None:
    target, options = TARGETS[name]
    found = convert(settings("generic/standard", K=1.5, Ti=40, Td=6, Tf=1), target, options=options, scan=scans)
    plain = convert(found.source, target, options=options, scan=scans, compensate=False)
    assert found.certificate.compensated
    assert not plain.certificate.compensated
    assert deviation(plain, scans) > 2 * deviation(found, scans)
    m0, m1, m2 = seen(found.settings, scans[1], 3)
    assert (m0, m1, m2) == pytest.approx((1.5 / 40, 1.5, 1.5 * (6 - scans[0] / 2)), rel=1e-9)  # kd - kp h/2, of the source


@hypothesis.settings(max_examples=25)
@given(
    Ti=st.floats(5, 100),
    Td=st.just(0.0) | st.floats(1e-6, 0.25),
    alpha=st.floats(0, 0.4),
    h=st.floats(0.05, 2),
    times=st.floats(0.1, 10),
    name=st.sampled_from([*TARGETS]),
)
def test_settings_made_up_for_the_scans_are_never_farther_off(
    Ti: float, Td: float, alpha: float, h: float, times: float, name: str
) -> None:
    target, options = TARGETS[name]
    source = settings("generic/series", K=1.5, Ti=Ti, Td=Td * Ti if Td > 0.02 else 0.0, alpha=alpha if alpha > 0.02 else 0.0)
    try:
        own, plain = (convert(source, target, options=options, scan=(h, h * times), compensate=c) for c in (True, False))
    except (ConversionRefusedError, ScanError):
        assume(False)
    assume(all(memory(c.settings, h * times) < 1000 for c in (own, plain)))
    off, without = (deviation(c, (h, h * times)) for c in (own, plain))
    assert off <= without * (1 + 1e-6)
    assert not plain.certificate.compensated
    assert own.certificate.compensated == (own.settings != plain.settings)
    at_scan = own.certificate.feedback_at_scan
    assert at_scan is not None
    assert at_scan.loop_band.max_deviation == pytest.approx(off, rel=2e-3, abs=1e-9)  # it looks closer at its peaks


def deviation(c: pidemu.Conversion, scans: tuple[float, float]) -> float:
    """Largest deviation over the loop band, both sampled and held, by the increments that emulations show."""
    m0, m1, _ = c.source.law().moments()
    w = np.geomspace(0.01 * m0 / m1, min(5 * m0 / m1, math.pi / max(scans)), 200)
    held = []
    for s, h in zip((c.source, c.settings), scans, strict=True):
        g = increments(s, h, memory(s, h))
        held.append(np.exp(-1j * np.outer(w, np.arange(g.size) * h)) @ g / (1j * w * h))
    return float(np.max(np.abs(held[1] / held[0] - 1)))


@pytest.mark.parametrize(
    ("scans", "phase"),
    [
        ((1.0, 0.5), -1.140248),  # the hold alone: 0.1 x (-0.5)/2 rad, -1.43 degrees; the sum that integrates leads by the rest
        ((0.5, 1.0), 1.140248),
        ((2.0, 2.0), 0.0),
        ((1.0, 20.0), 40.527261),
        ((1.0, 40.0), math.inf),  # beyond half the slower scan's rate
    ],
)
def test_the_scan_cost_is_the_phase_that_hold_and_rule_lose_where_the_crossover_usually_lies(
    scans: tuple[float, float], phase: float
) -> None:
    plain = convert(settings("generic/standard", K=2, Ti=20), "generic/parallel", scan=scans, compensate=False)
    cost = plain.certificate.scan_cost
    assert cost is not None
    assert cost.at == pytest.approx(0.1, rel=1e-12)  # 2/Ti
    assert cost.phase_deg == pytest.approx(phase, rel=1e-6)
    assert math.isinf(phase) or cost.phase_deg == pytest.approx(lost(*scans), rel=1e-9, abs=1e-12)


def lost(h: float, to: float) -> float:
    """Phase lost by a PI of 2 and 20 s at 0.1 rad/s, backward rule and hold written out, from one interval to another [deg]."""

    def held(h: float) -> complex:
        z = np.exp(-0.1j * h)
        return complex((2 + 0.1 * h / (1 - z)) * (1 - z) / (0.1j * h))

    return math.degrees(np.angle(held(h) / held(to)))


def test_without_scan_intervals_there_is_no_scan_cost() -> None:
    assert convert(settings("generic/standard", K=2, Ti=20), "generic/parallel").certificate.scan_cost is None


def test_the_same_equation_at_the_same_scan_costs_nothing() -> None:
    found = convert(settings("generic/standard", K=2, Ti=20, Td=4, Tf=0.5), "generic/parallel", scan=1.0)
    cost = found.certificate.scan_cost
    assert cost is not None
    assert cost.phase_deg == pytest.approx(0.0, abs=1e-9)  # two laws multiplied out in another order
    assert not cost.matters
    assert not found.certificate.compensated
    assert not any("scan intervals" in w for w in found.warnings)


@pytest.mark.parametrize("name", TARGETS)
@pytest.mark.parametrize("scans", [(1.0, 0.25), (0.25, 1.0), (1.0, 1.0)])
def test_without_compensation_the_settings_are_those_of_the_continuous_law(name: str, scans: tuple[float, float]) -> None:
    target, options = TARGETS[name]
    source = settings("generic/series", K=1.5, Ti=40, Td=6, alpha=0.2)
    plain = convert(source, target, options=options, scan=scans, compensate=False)
    assert plain.settings == convert(source, target, options=options).settings
    assert plain.settings == pidemu.convert(source, target, options=options, scan=scans, emulate=False).settings  # the default
    assert not plain.certificate.compensated


@pytest.mark.parametrize("name", TARGETS)
@pytest.mark.parametrize("scans", [(0.1, 1.0), (1.0, 0.1), (0.5, 5.0), (1.0, 1.0)])
def test_a_pi_controller_gets_no_derivative_for_another_scan(name: str, scans: tuple[float, float]) -> None:
    target, options = TARGETS[name]
    found = convert(settings("generic/standard", K=2, Ti=20), target, options=options, scan=scans)
    assert found.settings.algorithm().kd == 0
    assert seen(found.settings, scans[1], 1) == pytest.approx([0.1], rel=1e-9)


@pytest.mark.parametrize("Tf", [0.0, 0.05, 0.5])
@pytest.mark.parametrize("scans", [(0.1, 1.0), (0.5, 2.0), (1.0, 1.0), (1.0, 0.1)])
def test_a_lagged_difference_keeps_a_filter_that_leaves_its_derivative_work_to_do(scans: tuple[float, float], Tf: float) -> None:
    found = convert(settings("generic/standard", K=2, Ti=20, Td=4, Tf=Tf), "advanced-pid/advanced-pid", scan=scans)
    h = scans[1]
    assert found.settings["Tf"].value >= 0.5 * h * (1 - 1e-9)
    share = (h / found.settings["Tf"].value) / math.expm1(h / found.settings["Tf"].value)  # of kd that the rule leaves
    assert share > 0.3
    assert share * found.settings["Kd"].value == pytest.approx(8 - 2 * (scans[0] - h) / 2, rel=1e-9)


@pytest.mark.parametrize("scans", [(1.0, 0.1), (0.1, 1.0), (0.2, 2.0)])
@pytest.mark.parametrize("name", TARGETS)
def test_intervals_ten_times_apart_are_converted_with_usable_numbers(name: str, scans: tuple[float, float]) -> None:
    target, options = TARGETS[name]
    source = settings("generic/standard", K=2, Ti=30, Td=5, Tf=2)
    found = convert(source, target, options=options, scan=scans, emulate=True)
    plain = convert(source, target, options=options, scan=scans, compensate=False)
    off, without = (c.certificate.feedback_at_scan for c in (found, plain))
    assert off is not None
    assert without is not None
    assert off.loop_band.max_deviation <= without.loop_band.max_deviation
    gains = [abs(x) for x in (found.settings.algorithm().kp, found.settings.algorithm().ki, found.settings.algorithm().kd)]
    assert all(0.3 * x < y < 3 * x for x, y in zip((2, 2 / 30, 10), gains, strict=True) if "lagged" not in name)
    run = found.certificate.scan_by_scan
    assert run is not None
    assert run.scan == scans
    assert not run.taken
    assert any(f"{scans[0]:g} s and {scans[1]:g} s" in w for w in found.warnings)


def test_an_exact_match_is_refused_where_the_scans_leave_none() -> None:
    source = settings("generic/standard", K=2, Ti=20, Td=4, Tf=0.5)
    with pytest.raises(ConversionRefusedError, match="no settings give the same law at these scan intervals and rules"):
        convert(source, "generic/parallel", scan=(1.0, 0.5), match="exact")
    assert convert(source, "generic/parallel", scan=1.0, match="exact").match == "exact"


def test_setpoint_weights_are_those_of_the_sampled_path() -> None:
    found = convert(settings("generic/standard", K=2, Ti=20, Td=4, Tf=0.5, b=0.6, c=0.2), "generic/parallel", scan=(1.0, 0.25))

    def setpoint(s: Settings, h: float) -> list[float]:
        controller = pidemu.Controller(s, h, output_limits=WIDE)
        controller.rest(0.0, 0.0, 0.0)
        pulse = np.zeros(2000)
        pulse[0] = 1.0
        g = np.diff(controller.run(pulse, np.zeros(2000)), prepend=0.0)
        return [float(np.sum(g * (-np.arange(2000) * h) ** k)) / (h * math.factorial(k)) for k in range(3)]

    assert setpoint(found.settings, 0.25) == pytest.approx(setpoint(found.source, 1.0), rel=1e-9)
    assert found.settings["b"].value == pytest.approx(0.6, rel=1e-9)


def test_a_forward_rule_gets_a_filter_with_which_it_is_stable_at_the_scan() -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=30, Td=5, Tf=0.5)
    options = {"FORM": "parallel", "IFormula": "ForwardEuler", "DFormula": "ForwardEuler"}
    with pytest.raises(ScanError, match=r"too short for the scan interval 1 s: the forward rule is unstable"):
        convert(source, "mathworks/pid2", scan=(0.1, 1.0), options=options, compensate=False)
    conversion = convert(source, "mathworks/pid2", scan=(0.1, 1.0), options=options)
    assert conversion.settings["Tf"].canonical >= 1.0  # 1 - h/Tf is the pole: below h it rings, below h/2 it is unstable
    out = pidemu.Controller(conversion.settings, 1.0, output_limits=WIDE).run(50.0, 50.0 + (np.arange(60) >= 5))
    steps = np.diff(out[7:])
    assert np.all(steps < 0), "after its kick the output goes on falling with the integral, and does not ring"


def test_a_filter_that_rings_is_named_among_the_warnings() -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=20, Td=4, Tf=0.5)
    method = {"METHOD": "continuous"}  # trapezoidal rules
    conversion = pidemu.convert(source, "modelica/limpid", options=method, scan=(0.5, 2.0), given={"Nd": 50}, emulate=False)
    assert conversion.settings.algorithm().Tf < 1.0
    assert any("A scan interval of 2 s is long for modelica/limpid" in w and "rings" in w for w in conversion.warnings)
