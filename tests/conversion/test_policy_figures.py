"""What a conversion states in figures, worked out again by other means: emulations, margins, dials, the proof."""

from __future__ import annotations

import itertools
import math
import random
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
import scipy.signal
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.certificate.models import EXACT
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.errors import PidemuError
from pidemu.process.process import parse_process
from pidemu.settings.settings import Settings, off_values
from pidemu.units import Role
from tests.conversion.policy import RANGES, convert, converted, drawn
from tests.conversion.support import continuous, random_signal
from tests.conversion.usual import CARDS, usual
from tests.helpers import WIDE, Floats, scans_of

START = 50.0


def run(s: Settings, pv: Floats, h: float, sp: Floats | None = None, limits: tuple[float, float] = WIDE) -> Floats:
    """Output of a controller that has been at rest at 50 %."""
    controller = pidemu.Controller(s, h, output_limits=limits, initial_output=START)
    controller.rest(START, START, START)
    return controller.run(np.full_like(pv, START) if sp is None else sp, pv)


def rules(s: Settings) -> tuple[object, ...]:
    """Scan rules of the terms at work."""
    a = s.algorithm()
    lags = [x.rule for x in (a.setpoint.filter, a.measurement.filter, a.error.filter) if x is not None]
    terms = (a.integral.rule if a.ki else None, (a.derivative.rule, a.filter_rule) if a.kd else None)
    return (
        *terms,
        a.filter_rule if a.Tf and a.filter_on != "term" else None,
        a.measurement.previous_scan,
        a.arithmetic.type,
        *lags,
    )


@given(data=st.data())
@settings(max_examples=40)
def test_where_exact_is_said_and_the_scan_rules_are_the_same_the_outputs_are_the_same_scan_by_scan(data: st.DataObject) -> None:
    source, target = drawn(data)
    h = data.draw(scans_of(source.algorithm()))
    found = converted(source, target, scan=h, emulate=True)
    assume(found.verdict == "exact" and found.factor > 0 and rules(found.source) == rules(found.settings))
    assume(all(s.algorithm().integral.limits is None for s in (source, found.settings)))
    pv, sp = random_signal(data.draw(st.integers(0, 99)), 100), random_signal(data.draw(st.integers(0, 99)), 100)
    a, b = (run(s, pv, h, sp) for s in (source, found.settings))
    if not source.algorithm().ki:
        a, b = a - a[0], b - b[0]  # positional: counted from the bias; velocity: from the output at the transfer
    size = max(100.0, float(np.max(np.abs(a))))
    assert float(np.max(np.abs(a - b))) / size <= EXACT


def without_integral(card: str) -> list[Settings]:
    """Proportional action alone, on a card that can do that."""
    for s in usual(card):
        off = {n: off_values(v.setting)[0] for n, v in s.items() if v.role in _TERMS and v.active and off_values(v.setting)}
        with suppress(PidemuError):
            found = s.changed({**off, **RANGES})
            a = found.algorithm()
            if a.kp and a.b and not a.ki and not a.kd:
                return [found]
    return []


_TERMS = (Role.INTEGRAL, Role.DERIVATIVE)
P_ONLY = [s for card in CARDS for s in without_integral(card)]
MOVE = np.interp(np.arange(121), [0, 20, 80, 100, 120], [0.0, 90.0, 90.0, 0.0, 0.0])
"""What the error asks of the output, there and back [%]: from 50 % there is room for 50 %."""
NO_BIAS = "epics/epid"
"""With KI = 0 the record sets I to 0, so that its output is KP (VAL - CVAL) and nothing else."""


def left_by_a_limit(s: Settings) -> float:
    """How far an excursion to a limit leaves the output from where it was, though the error is what it was."""
    a = s.algorithm()
    own = a.velocity or a.transfer.start == "load-output" or a.bias  # it counts from its last output, or holds what its output was
    controller = pidemu.Controller(s, 1.0, output_limits=(0.0, 100.0), bias=0.0 if own else START, initial_output=START)
    controller.rest(START, START, START)
    return abs(float(controller.run(np.full_like(MOVE, START), START - MOVE / a.kp)[-1]) - START)


@pytest.mark.parametrize("source", P_ONLY, ids=lambda s: s.card.id)
def test_what_holds_its_output_after_a_limit_is_not_converted_to_what_does_not(source: Settings) -> None:
    if left_by_a_limit(source) > 0.1:
        return  # it forgets, as its target may
    for target in CARDS[P_ONLY.index(source) % 3 :: 3]:  # every pair would take half a minute
        try:
            found = convert(source, target)
        except ConversionRefusedError as error:
            refusal = error
        else:
            assert found.settings.algorithm().ki == 0
            assert left_by_a_limit(found.settings) < 0.1, target
            continue
        if "cannot hold the output" in str(refusal):
            assert refusal.nearest is not None
            assert left_by_a_limit(refusal.nearest.settings) > 0.1
            assert refusal.alternatives


def test_a_target_without_a_place_for_a_bias_is_refused() -> None:
    source = pidemu.load_card("fisher/provox").settings({"GAIN": 2, "RESET": 0, **RANGES})
    with pytest.raises(ConversionRefusedError, match="it has no place for a bias, and its output is 0 at SP = PV"):
        convert(source, NO_BIAS, emulate=True)
    found = convert(source, NO_BIAS, emulate=True, allow_approximate=True)
    assert left_by_a_limit(found.settings) == START
    assert found.verdict == "approximate"
    assert "does not hold the output as the old one did" in found.sentence


LAG, DELAY = 100.0, 10.0
PROCESS = parse_process("gain=1,lag=100,delay=10")


def margins(w: Floats, loop: Any) -> tuple[float, float, float]:
    """Gain margin, phase margin and Ms of a response on a dense grid: where it crosses the real axis, and the unit circle."""
    real_axis = np.flatnonzero((np.diff(np.sign(loop.imag)) != 0) & (loop.real[:-1] < 0))
    circle = np.flatnonzero(np.diff(np.sign(np.abs(loop) - 1)) != 0)
    gains = [1 / abs(loop[k]) for k in real_axis]
    phases = [math.degrees(np.angle(-loop[k])) for k in circle]
    gm, pm = min(gains, key=lambda g: abs(math.log(g)), default=math.inf), min(phases, key=abs, default=math.inf)
    return float(gm), float(pm), float(np.max(1 / np.abs(1 + loop)))


BY_DIALS = [
    s
    for card in ("generic/series", "fisher/provox", "honeywell/tdc3000", "emerson/deltav", "bailey/fc18", "allen-bradley/plc5")
    for s in usual(card)[:1]
    if s.algorithm().filter_on == "term"
]
LOOPS = [(s.changed(RANGES), t) for s, t in itertools.product(BY_DIALS, ("emerson/deltav", "allen-bradley/pide", "generic/series"))]


@pytest.mark.parametrize(("source", "target"), LOOPS[::2], ids=lambda x: x if isinstance(x, str) else x.card.id)
def test_the_margins_that_are_stated_are_those_of_the_two_laws_and_the_process(source: Settings, target: str) -> None:
    found = convert(source, target, process=PROCESS, emulate=True)
    w = np.geomspace(1e-4, 1e2, 60_000)
    process = np.exp(-1j * w * DELAY) / (1 + 1j * w * LAG)
    loop = found.certificate.loop
    assert loop is not None
    for s, stated in ((source, loop.source), (found.settings, loop.target)):
        assert s.algorithm().filter_on == "term"
        gm, pm, Ms = margins(w, continuous(s, w) * process)
        assert stated.stable
        # 2e-3: the nearest of 10,000 points a decade
        assert (stated.gain_margin, stated.phase_margin, stated.Ms) == pytest.approx((gm, pm, Ms), rel=2e-3)


@pytest.mark.parametrize(("source", "target"), LOOPS[1::4], ids=lambda x: x if isinstance(x, str) else x.card.id)
def test_at_scan_intervals_the_margins_are_those_of_the_sampled_loops(source: Settings, target: str) -> None:
    scans = (1.0, 2.0)
    found = convert(source, target, process=PROCESS, scan=scans, emulate=True)
    loop = found.certificate.loop
    assert loop is not None
    for s, h, stated in ((source, scans[0], loop.source), (found.settings, scans[1], loop.target)):
        w = np.geomspace(1e-4, math.pi / h, 40_000)
        gm, pm, Ms = margins(w, sampled_controller(s, h, w) * sampled_process(h, w))
        assert (stated.gain_margin, stated.phase_margin, stated.Ms) == pytest.approx((gm, pm, Ms), rel=2e-3)


def sampled_controller(s: Settings, h: float, w: Floats) -> Any:
    """Response of the running controller, from what a measurement that is 1 % off for one scan does to its increments."""
    pulse = np.full(200, START)
    pulse[0] -= 1.0
    increments = np.diff(run(s, pulse, h), prepend=START)
    z = np.exp(-1j * w * h)
    return np.polyval(increments[::-1], z) / (1 - z)


def sampled_process(h: float, w: Floats) -> Any:
    """Response of the held process: its pulse transfer function by scipy, the dead time in whole scans."""
    num, den, _ = scipy.signal.cont2discrete(([1.0], [LAG, 1.0]), h, method="zoh")
    z = np.exp(1j * w * h)
    return np.polyval(np.ravel(num), z) / np.polyval(den, z) * z ** -round(DELAY / h)


@given(data=st.data(), digits=st.sampled_from([None, 5]), scan=st.sampled_from([None, (1.0, 0.5)]))
@settings(max_examples=50)
def test_the_verdict_on_what_is_returned_is_that_of_the_proof_and_of_floats(
    data: st.DataObject, digits: int | None, scan: tuple[float, float] | None
) -> None:
    source, target = drawn(data)
    found = converted(source, target, digits=digits, scan=scan)
    w = np.geomspace(0.01, 100, 600) / found.certificate.time_scale
    equal = {
        path: same(found.factor * source.law().response(w, path), found.unrounded.law().response(w, path))
        for path in ("feedback", "setpoint")
    }
    proof = found.proof
    if proof is not None and proof.decided:
        assert proof.feedback_equal == equal["feedback"]
        if proof.feedback_equal and found.certificate.setpoint_in_cascade is None and found.request.mode == "both":
            assert proof.setpoint_equal == equal["setpoint"]
    if found.verdict in ("exact", "exact-feedback"):
        assert equal["feedback"]
        assert proof is not None
    if found.verdict == "exact":
        assert equal["setpoint"]


def same(a: Any, b: Any) -> bool:
    """Whether two responses agree to 1e-9 of each, or of what rounding leaves where one all but vanishes."""
    return bool(np.all(np.abs(a - b) <= EXACT * np.abs(a) + 1e-14 * np.max(np.abs(a))))


def seeds(target: str) -> list[random.Random]:
    return [random.Random(f"{target} {n}") for n in range(6)]


def card(name: str, **dials: float | str) -> Settings:
    return pidemu.load_card(name).settings(dials)


@pytest.mark.parametrize("r", seeds("provox"))
def test_provox_into_deltav_by_hand(r: random.Random) -> None:
    """Lead-lag (1 + Td s)/(1 + Td s/8) is 1 + 7/8 Td s/(1 + Td s/8): the derivative time is 7/8, the filter factor 1/7."""
    gain, reset, rate = r.uniform(0.2, 5), r.uniform(0.1, 6), r.uniform(0.02, 1)
    found = convert(card("fisher/provox", GAIN=gain, RESET=reset, RATE=rate), "emerson/deltav")
    assert found.settings.options["FORM"] == "Series"
    wanted = {"GAIN": gain, "RESET": 60 / reset, "RATE": 60 * rate * 7 / 8, "ALPHA": 1 / 7}
    assert {n: found.settings[n].value for n in wanted} == pytest.approx(wanted, rel=1e-12)
    assert found.verdict == "exact"


@pytest.mark.parametrize("r", seeds("parallel"))
def test_a_filtered_parallel_pid_into_deltav_by_hand(r: random.Random) -> None:
    kp, Ti, Td, ratio = r.uniform(0.2, 5), r.uniform(10, 900), r.uniform(1, 60), r.uniform(0.06, 0.9)
    source = card("generic/parallel", kp=kp, ki=kp / Ti, kd=kp * Td, Tf=ratio * Td)
    found = convert(source, "emerson/deltav", options={"FORM": "Standard"})
    wanted = {"GAIN": kp, "RESET": Ti, "RATE": Td, "ALPHA": ratio}
    assert {n: found.settings[n].value for n in wanted} == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("r", seeds("tdc"))
def test_tdc_into_pide_by_its_moments(r: random.Random) -> None:
    """Moments of a lead-lag with a tenth: a = 0.9; independent gains in 1/min and min, dependent in minutes."""
    K, T1, T2 = r.uniform(0.2, 5), r.uniform(0.5, 20), r.uniform(0.05, 0.4)
    m0, m1, m2 = K / T1, K * (1 + 0.9 * T2 / T1), K * 0.9 * T2 * (1 - 0.1 * T2 / T1)  # with minutes
    source = card("honeywell/tdc3000", K=K, T1=T1, T2=T2, FORM="interactive", CTEQN="A")
    for dependent, wanted in (("false", (m1, m0, m2)), ("true", (m1, m1 / m0, m2 / m1))):
        found = convert(source, "allen-bradley/pide", options={"DependIndepend": dependent}, match="low-frequency")
        assert tuple(found.settings[n].value for n in ("PGain", "IGain", "DGain")) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("r", seeds("standard"))
def test_a_standard_pid_into_tdc_by_its_moments(r: random.Random) -> None:
    """Td = (A - sqrt(A^2 - 4 B/a))/2, Ti = A - a Td, K = m0 Ti, with A = m1/m0, B = m2/m0, a = 0.9 (specs/equations.md, 3)."""
    K, Ti, Td = r.uniform(0.2, 5), r.uniform(60, 900), r.uniform(1, 12)
    found = convert(
        card("generic/standard", K=K, Ti=Ti, Td=Td), "honeywell/tdc3000", options={"FORM": "interactive"}, match="low-frequency"
    )
    T2 = (Ti - math.sqrt(Ti**2 - 4 * Ti * Td / 0.9)) / 2
    T1 = Ti - 0.9 * T2
    assert tuple(found.settings[n].value for n in ("K", "T1", "T2")) == pytest.approx((K * T1 / Ti, T1 / 60, T2 / 60), rel=1e-9)


@pytest.mark.parametrize("r", seeds("tdc deltav"))
def test_tdc_into_deltav_by_hand(r: random.Random) -> None:
    """Series into series: gain and integral time stay; RATE is 0.9 T2 and the filter factor a ninth."""
    K, T1, T2 = r.uniform(0.2, 5), r.uniform(0.5, 20), r.uniform(0.05, 0.4)
    found = convert(card("honeywell/tdc3000", K=K, T1=T1, T2=T2, FORM="interactive", CTEQN="B"), "emerson/deltav")
    wanted = {"GAIN": K, "RESET": 60 * T1, "RATE": 54 * T2, "ALPHA": 1 / 9}
    assert {n: found.settings[n].value for n in wanted} == pytest.approx(wanted, rel=1e-12)
