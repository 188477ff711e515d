"""Matches on request: at one frequency, for one process, and the nearest inside the ranges."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.optimize import brentq

import pidemu
from pidemu.conversion.match_method import MATCHES
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.errors import SettingError
from pidemu.settings.settings import Settings
from tests.conversion.support import Complex, Floats, continuous
from tests.helpers import made_up_card

ROUNDING = 1e-9
"""Newton's method ends at 1e-12 of the response; the dials' units cost some digits more."""


def convert(source: Settings, target: str | Any, match: str, **more: Any) -> pidemu.Conversion:
    return pidemu.convert(source, target, match=match, emulate=False, **more)


def standard(**values: float) -> Settings:
    return pidemu.load_card("generic/standard").settings(values)


def series(**values: float) -> Settings:
    return pidemu.load_card("generic/series").settings(values)


def diagram(s: Settings, w: Floats) -> Complex:
    """Feedback path as it is drawn, from the dials; with the filter on measurement or output before or behind all of it."""
    a, e = s.algorithm(), s.equation
    if a.filter_on == "term":
        return continuous(s, w)
    dial = {v.role.value: v.canonical for v in s.values() if v.active}
    x, K, rate, Td = 1j * w, dial["gain"], dial["integral"], dial["derivative"]
    assert e.derivative.filter is not None
    lag = 1 + a.Tf * x + (a.Tf * x) ** 2 / 2 if e.derivative.filter.order == 2 else 1 + a.Tf * x
    return np.asarray(K * ((1 + rate / x) * (1 + Td * x) if e.form == "series" else 1 + rate / x + Td * x) / lag)


def integral_gain(s: Settings) -> float:
    """``m0`` by the dials: no filter touches it."""
    dial = {v.role.value: v.canonical for v in s.values() if v.active}
    alone = s.equation.form == "parallel"
    return dial["integral"] if alone else dial["gain"] * dial["integral"]


TARGETS: dict[str, tuple[str, Mapping[str, object], Mapping[str, object]]] = {
    "parallel": ("generic/parallel", {}, {"Tf": 1.5}),
    "standard": ("generic/standard", {}, {"Tf": 0.3}),
    "series": ("generic/series", {}, {"alpha": 0.2}),
    "ratio": ("emerson/deltav", {"FORM": "Standard"}, {"ALPHA": 0.125}),
    "series, ratio": ("emerson/deltav", {"FORM": "Series"}, {"ALPHA": 0.3}),
    "output filtered": ("honeywell/tdc3000", {"FORM": "ideal"}, {}),
    "measurement filtered": ("foxboro/ia-pid", {}, {"KD": 10}),
}


class TestFrequency:
    """Gain and phase agree at one frequency, and ``m0`` with them."""

    @pytest.mark.parametrize("name", TARGETS)
    @given(Ti=st.floats(5, 100), ratio=st.floats(0.05, 0.2), alpha=st.floats(0.05, 0.3), at=st.floats(0.1, 3))
    def test_the_responses_agree_there_by_their_block_diagrams_and_the_integral_gain_stays(
        self, name: str, Ti: float, ratio: float, alpha: float, at: float
    ) -> None:
        target, options, dials = TARGETS[name]
        source = series(K=1.7, Ti=Ti, Td=ratio * Ti, alpha=alpha)
        w = at / Ti
        try:
            found = convert(source, target, f"frequency:{w!r}rad/s", options=options, given=dials)
        except ConversionRefusedError:
            assume(False)
        assert found.match == "frequency"
        assert all(found.settings[dial].value == value for dial, value in dials.items())
        here, there = (diagram(s, np.array([w])) for s in (found.source, found.settings))
        assert abs(there[0] / here[0] - 1) < ROUNDING
        assert integral_gain(found.settings) == pytest.approx(1.7 / Ti, rel=1e-12)

    def test_elsewhere_they_differ_where_no_settings_are_exact(self) -> None:
        found = convert(series(K=1.7, Ti=30, Td=6, alpha=0.1), "generic/parallel", "frequency:0.05rad/s", given={"Tf": 1.5})
        w = np.array([0.2])
        assert abs(diagram(found.settings, w)[0] / diagram(found.source, w)[0] - 1) > 0.01

    @pytest.mark.parametrize(
        ("text", "w"),
        [("3 rad/min", 0.05), ("180 rad/h", 0.05), ("0.01 Hz", 0.02 * math.pi), ("10mHz", 0.02 * math.pi), (" 0.05rad/s ", 0.05)],
    )
    def test_the_frequency_may_have_any_of_the_units(self, text: str, w: float) -> None:
        found = convert(series(K=1.7, Ti=30, Td=6, alpha=0.1), "generic/parallel", f"frequency:{text}", given={"Tf": 1.5})
        here, there = (diagram(s, np.array([w]))[0] for s in (found.source, found.settings))
        assert abs(there / here - 1) < ROUNDING

    @pytest.mark.parametrize("scans", [(1.0, 1.0), (2.0, 0.5), (0.5, 2.0)])
    def test_with_scan_intervals_it_is_the_sampled_and_held_responses_that_agree(self, scans: tuple[float, float]) -> None:
        source = standard(K=2, Ti=40, Td=8, Tf=1)
        fixed = {"Tf": 3.0, "INTEGRAL_RULE": "backward", "DERIVATIVE_RULE": "backward"}
        found = convert(source, "generic/parallel", "frequency:0.1rad/s", given=fixed, scan=scans, compensate=True)

        def held(kp: float, ki: float, kd: float, Tf: float, h: float) -> complex:
            x, s = np.exp(-0.1j * h), 0.1j
            sampled = kp + ki * h / (1 - x) + kd * (1 - x) / (Tf * (1 - x) + h)
            return complex(sampled * (1 - x) / (s * h))

        wanted = held(2, 2 / 40, 16, 1, scans[0])
        s = found.settings
        reached = held(s["kp"].value, s["ki"].value, s["kd"].value, 3.0, scans[1])
        assert abs(reached / wanted - 1) < ROUNDING
        assert s["ki"].value == pytest.approx(2 / 40, rel=1e-12)

    @pytest.mark.parametrize(
        "process",
        [
            pidemu.Process.from_lags(1.2, lags=[10, 3], delay=2),
            pidemu.Process.from_lags(-1.4, lags=[25], delay=6),
            pidemu.Process.from_lags(0.03, integrators=1, lags=[4], delay=3),
        ],
        ids=str,
    )
    def test_at_the_crossover_of_a_process_crossover_and_phase_margin_stay(self, process: pidemu.Process) -> None:
        source = series(K=1.2, Ti=30, Td=3, alpha=0.1)
        found = convert(source, "generic/parallel", "frequency", given={"Tf": 2.0}, process=process)

        def margin(s: Settings) -> tuple[float, float]:
            def loop(w: float) -> complex:
                x = 1j * w
                P = abs(process.gain) * np.exp(-process.delay * x) / np.prod([1 - x / p if p else x for p in process.poles])
                return complex(diagram(s, np.array([w]))[0] * P)

            w = brentq(lambda x: abs(loop(x)) - 1, 1e-3, 2.0, xtol=1e-15)
            return w, math.degrees(np.angle(-loop(w)))

        # the crossover is the point that is matched: what differs is the bisection's last digits
        assert margin(found.settings) == pytest.approx(margin(source), rel=1e-8)
        elsewhere = convert(source, "generic/parallel", "low-frequency", given={"Tf": 2.0}, process=process)
        assert abs(margin(elsewhere.settings)[1] - margin(source)[1]) > 0.1

    def test_a_frequency_beyond_nyquist_is_refused(self) -> None:
        with pytest.raises(ConversionRefusedError, match=r"4 rad/s is beyond half the scan rate; match at a lower frequency$"):
            convert(standard(K=2, Ti=40, Td=8, Tf=1), "generic/parallel", "frequency:4rad/s", scan=(0.5, 1.0), given={"Tf": 2.0})
        near = {"given": {"Tf": 1.2}, "scan": 1.0, "compensate": True}
        assert convert(standard(K=2, Ti=40, Td=8, Tf=1), "generic/parallel", "frequency:3rad/s", **near).match == "frequency"

    def test_a_crossover_beyond_the_nyquist_frequency_of_the_target_is_refused(self) -> None:
        source, process = standard(K=8, Ti=20, Td=2, Tf=0.2), pidemu.Process.from_lags(1.2, lags=[10], delay=0.3)
        with pytest.raises(ConversionRefusedError, match=r"the source's crossover, 7\.5\d* rad/s, is beyond half the scan rate"):
            convert(source, "generic/parallel", "frequency", given={"Tf": 0.5}, process=process, scan=(0.1, 5.0))

    def test_a_loop_without_a_crossover_is_refused(self) -> None:
        pd = standard(K=0.5, Ti=math.inf, Td=2, Tf=1)
        with pytest.raises(ConversionRefusedError, match="no gain crossover with this process; give the frequency"):
            convert(pd, "generic/parallel", "frequency", process=pidemu.Process.from_lags(0.1, lags=[10], delay=2))

    def test_it_needs_derivative_action(self) -> None:
        # measurement and its filter: a lag that P and I of the target cannot have
        lagged = pidemu.load_card("yokogawa/fieldbus-pid").settings(GAIN=2, RESET=30, PV_FTIME=4)
        with pytest.raises(ConversionRefusedError, match="without derivative action, gain and phase cannot both be kept"):
            convert(lagged, PI, "frequency:0.1rad/s")

    def test_a_response_that_needs_a_negative_derivative_is_refused(self) -> None:
        lagged = pidemu.load_card("yokogawa/fieldbus-pid").settings(GAIN=2, RESET=30, PV_FTIME=4)
        with pytest.raises(ConversionRefusedError, match="negative"):
            convert(lagged, "emerson/deltav", "frequency:0.1rad/s", options={"FORM": "Standard", "STRUCTURE": "1"})


PI = made_up_card(
    derivative={"on": "none"},
    settings={"kp": {"sets": "gain", "unit": "%/%"}, "ki": {"sets": "integral", "unit": "1/s", "off": 0, "default": 0}},
    examples=[{"given": {"kp": 1}, "canonical": {"kp": 1, "ki": 0, "kd": 0}}],
)
"""A card with P and I alone."""


@dataclass(frozen=True)
class Loop:
    """A process of lags and dead time with a parallel PID, simulated after a unit load step by exact steps in the time domain."""

    gain: float
    lags: tuple[float, ...]
    delay: float
    step: float
    end: float

    @property
    def process(self) -> pidemu.Process:
        """An infinite lag is an integrator, a negative one an unstable pole."""
        poles = [0.0 if math.isinf(t) else -1 / t for t in self.lags]
        return pidemu.Process(self.gain, poles, delay=self.delay)

    def measurement(self, kp: float, ki: float, kd: float, Tf: float) -> Floats:
        """Return the response; the states are the lags in a row, the integral of the error and the filtered measurement.

        The delayed output is taken as straight between two steps.
        """
        n = len(self.lags)
        A, B = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
        for i, lag in enumerate(self.lags):
            drive = 1.0 if math.isinf(lag) else 1 / lag
            A[i, i] = 0.0 if math.isinf(lag) else -1 / lag
            if i:
                A[i, i - 1] = drive
            else:
                B[0] = drive * abs(self.gain) * math.copysign(1, lag)  # 1/(s - 1) has the low-frequency gain -1
        y, integral, slow = np.eye(n + 2)[[n - 1, n, n + 1]]
        A[n], A[n + 1] = -y, (y - slow) / Tf
        control = -kp * y + ki * integral - kd / Tf * (y - slow)
        big = np.zeros((n + 4, n + 4))
        big[: n + 2, : n + 2], big[: n + 2, n + 2], big[n + 2, n + 3] = A, B, 1
        E = expm(big * self.step)
        F, G, H = E[: n + 2, : n + 2], E[: n + 2, n + 2], E[: n + 2, n + 3] / self.step
        late, steps = round(self.delay / self.step), round(self.end / self.step)
        x, out, u = np.zeros(n + 2), np.zeros(steps + 1), np.zeros(steps + 1 + late)  # u[k + late]: u at step k
        for k in range(steps):
            x = F @ x + G * (1 + u[k]) + H * (u[k + 1] - u[k])
            out[k + 1], u[k + 1 + late] = y @ x, control @ x
        return out


LOOPS = {
    "lags": (Loop(1.2, (10, 3), 2, 0.1, 80), {"K": 1.2, "Ti": 12, "Td": 2.5, "alpha": 0.1}),
    "integrating": (Loop(0.05, (math.inf, 2), 3, 0.1, 200), {"K": 2.0, "Ti": 40, "Td": 3, "alpha": 0.1}),
    "unstable": (Loop(-1.5, (-10,), 0.5, 0.05, 80), {"K": 4.0, "Ti": 20, "Td": 1, "alpha": 0.1}),
    "negative gain": (Loop(-1.2, (10, 3), 2, 0.1, 80), {"K": 1.2, "Ti": 12, "Td": 2.5, "alpha": 0.1}),
}


class TestLoop:
    """The measurement after a load step changes least."""

    @pytest.mark.parametrize("name", LOOPS)
    @pytest.mark.parametrize("Tf", [1.0, 2.5])
    def test_no_other_settings_with_the_integral_gain_change_a_load_response_less(self, name: str, Tf: float) -> None:
        loop, dials = LOOPS[name]
        source = series(**dials)
        found = convert(source, "generic/parallel", "loop", given={"Tf": Tf}, process=loop.process)
        lead, lag = dials["Td"], dials["alpha"] * dials["Td"]
        ki = dials["K"] / dials["Ti"]
        kp = dials["K"] * (1 + lead / dials["Ti"]) - ki * lag
        reference = loop.measurement(kp, ki, dials["K"] * lead - kp * lag, lag)

        def squared(kp: float, kd: float) -> float:
            return float(np.sum((loop.measurement(kp, ki, kd, Tf) - reference) ** 2) * loop.step)

        best = found.settings
        assert found.match == "loop"
        assert best["ki"].value == pytest.approx(ki, rel=1e-12)
        own = squared(best["kp"].value, best["kd"].value)
        rng = np.random.default_rng(1)
        size = 10 ** rng.uniform(-2.5, -0.7, 24)  # 0.3 to 20 % away
        angle = rng.uniform(0, 2 * math.pi, 24)
        others = [
            squared(best["kp"].value * (1 + r * math.cos(a)), best["kd"].value * (1 + r * math.sin(a)))
            for r, a in zip(size, angle, strict=True)
        ]
        # the program's integral ends with the loop band: its minimum lies a little beside that over all frequencies
        assert min(others) > own * (1 - 2e-3)
        assert np.median(others) > 1.05 * own
        low = convert(source, "generic/parallel", "low-frequency", given={"Tf": Tf}, process=loop.process).settings
        assert squared(low["kp"].value, low["kd"].value) > 1.1 * own

    def test_a_target_that_can_be_exact_stays_so(self) -> None:
        loop, dials = LOOPS["lags"]
        found = convert(series(**dials), "generic/parallel", "loop", process=loop.process)
        assert found.certificate.feedback.loop_band.max_deviation < 1e-6  # a minimum is as sharp as the root of the rounding

    def test_without_derivative_the_gain_alone_is_chosen_and_no_other_is_better(self) -> None:
        loop = Loop(1.2, (10.0, 3.0), 2, 0.1, 120)
        source = pidemu.load_card("yokogawa/fieldbus-pid").settings(GAIN=1.2, RESET=12, PV_FTIME=2)
        found = convert(source, PI, "loop", process=loop.process)
        assert found.settings["ki"].value == pytest.approx(0.1, rel=1e-12)
        # the lag of the measurement is one more lag of the loop; seen from the load, before it
        lagged = Loop(1.2, (10.0, 3.0, 2.0), 2, 0.1, 120)
        filtered = lagged.measurement(1.2, 0.1, 0.0, 1.0)
        reference = filtered + 2.0 * np.gradient(filtered, loop.step)

        def squared(kp: float) -> float:
            return float(np.sum((loop.measurement(kp, 0.1, 0.0, 1.0) - reference) ** 2))

        best = found.settings["kp"].value
        assert min(squared(best * x) for x in (0.9, 0.97, 1.03, 1.1)) > squared(best)
        assert best != pytest.approx(1.2 - 0.1 * 2, rel=1e-3)  # which the low-frequency match gives

    def test_the_same_gain_under_another_sign_of_the_process_is_found(self) -> None:
        both = [
            convert(
                series(**LOOPS[name][1]), "generic/parallel", "loop", given={"Tf": 2.0}, process=LOOPS[name][0].process
            ).settings
            for name in ("lags", "negative gain")
        ]
        assert both[0]["kp"].value == pytest.approx(both[1]["kp"].value, rel=1e-9)


def largest(source: Settings, target: Settings, low: float, high: float) -> float:
    """Largest deviation by the block diagrams."""
    w = np.geomspace(low, high, 2000)
    return float(np.max(np.abs(diagram(target, w) / diagram(source, w) - 1)))


class TestConstrained:
    """The largest deviation over the loop band is least."""

    @pytest.mark.parametrize("name", TARGETS)
    @pytest.mark.parametrize("ratio", [0.06, 0.2])
    def test_it_deviates_no_more_than_the_low_frequency_match(self, name: str, ratio: float) -> None:
        target, options, dials = TARGETS[name]
        source = series(K=1.7, Ti=30, Td=ratio * 30, alpha=0.1)
        near, low = (convert(source, target, m, options=options, given=dials) for m in ("constrained", "low-frequency"))
        assert (near.match, near.refusal) == ("constrained", "")
        band = near.certificate.feedback.loop_band
        ends = band.low, band.high
        # it looks at 40 frequencies of the band
        assert largest(source, near.settings, *ends) <= largest(source, low.settings, *ends) * 1.001
        assert band.max_deviation == pytest.approx(largest(source, near.settings, *ends), rel=1e-4)
        assert integral_gain(near.settings) == pytest.approx(1.7 / 30, rel=1e-9)

    @pytest.mark.parametrize("name", ["parallel", "series", "measurement filtered"])
    def test_no_settings_beside_it_deviate_less(self, name: str) -> None:
        target, options, dials = TARGETS[name]
        source = series(K=1.7, Ti=30, Td=5, alpha=0.1)
        near = convert(source, target, "constrained", options=options, given=dials)
        band = near.certificate.feedback.loop_band
        gain, time = ("kp", "kd") if name == "parallel" else ("K", "Td") if name == "series" else ("PBAND", "DERIV")
        rng = np.random.default_rng(2)
        own = largest(source, near.settings, band.low, band.high)
        for _ in range(60):
            x, y = np.exp(0.1 * rng.normal(size=2))
            changed = {gain: near.settings[gain].value * x, time: near.settings[time].value * y}
            if name != "parallel":  # K/Ti stays
                rate = "Ti" if name == "series" else "INT"
                changed[rate] = near.settings[rate].value * (x if name == "series" else 1 / x)
            assert largest(source, near.settings.changed(changed), band.low, band.high) > own * 0.995  # 40 frequencies again

    def test_it_stays_inside_the_ranges(self) -> None:
        found = convert(standard(K=2, Ti=600, Td=2400, Tf=300), "honeywell/udc", "constrained")
        dial = found.settings["RATE"]
        assert dial.setting.range is not None
        assert dial.setting.range[0] <= dial.value <= dial.setting.range[1]

    def test_without_derivative_the_nearest_of_a_pi_is_itself(self) -> None:
        found = convert(standard(K=2, Ti=40), PI, "constrained")
        assert found.settings["kp"].value == pytest.approx(2, rel=1e-4)  # where the grid ends to close in
        assert found.settings["ki"].value == pytest.approx(0.05, rel=1e-9)


def refused(raise_it: Callable[[], object]) -> str:
    with pytest.raises(SettingError) as error:
        raise_it()
    return str(error.value)


SOURCE = {"K": 2.0, "Ti": 40.0, "Td": 8.0}
ALL = ", ".join(MATCHES)


@pytest.mark.parametrize("text", ["best", "", "Exact", "low frequency", "moments", "frequncy", ":0.1rad/s", "frequency 0.1rad/s"])
def test_a_wrong_match_is_refused_with_the_list_of_all(text: str) -> None:
    said = refused(lambda: convert(standard(**SOURCE), "generic/parallel", text))
    assert said.startswith(f"match is '{text}'; it is one of {ALL}, or frequency:0.02rad/s")


@pytest.mark.parametrize(("text", "near"), [("frequncy", "frequency"), ("low frequency", "low-frequency"), ("Exact", "exact")])
def test_the_nearest_word_is_suggested(text: str, near: str) -> None:
    assert refused(lambda: convert(standard(**SOURCE), "generic/parallel", text)).endswith(f" (did you mean '{near}'?)")


@pytest.mark.parametrize("word", [m for m in MATCHES if m != "frequency"])
def test_only_a_frequency_takes_a_number(word: str) -> None:
    said = refused(lambda: convert(standard(**SOURCE), "generic/parallel", f"{word}:0.1rad/s"))
    assert said == f"match is '{word}:0.1rad/s'; only 'frequency' takes a number, such as frequency:0.02rad/s"


@pytest.mark.parametrize("number", ["", "0.1", "rad/s", "fast rad/s", "0.1 rpm", "0,1rad/s", "1e rad/s"])
def test_a_frequency_that_cannot_be_read_is_refused_with_the_units(number: str) -> None:
    said = refused(lambda: convert(standard(**SOURCE), "generic/parallel", f"frequency:{number}"))
    units = "rad/s, rad/min, rad/h, Hz, mHz"
    assert said == f"match is 'frequency:{number}'; write the frequency as a number with one of the units {units}"


@pytest.mark.parametrize("number", ["0", "-0.1", "inf", "nan"])
def test_a_frequency_must_be_above_zero_and_finite(number: str) -> None:
    said = refused(lambda: convert(standard(**SOURCE), "generic/parallel", f"frequency:{number}rad/s"))
    assert said.startswith(f"match is 'frequency:{number}rad/s'; the frequency must be ")


@pytest.mark.parametrize("match", ["loop", "frequency"])
def test_a_missing_process_is_named(match: str) -> None:
    said = refused(lambda: convert(standard(**SOURCE), "generic/parallel", match))
    assert said.startswith(f"the match '{match}' needs the process")
    assert said.endswith("give process=, or --process gain=...,lag=...,delay=...")
