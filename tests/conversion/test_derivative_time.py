"""A parallel form whose derivative filter goes with the derivative time, ``Tf = kd/(kp N)``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.errors import SettingError
from tests.checks.bench import ALPHA, ALPHA_EVIDENCE, VALID, Edit, edited, written

EXACT = 1e-9
"""Relative: rounding of the conversion's own arithmetic, with a margin."""
_PARALLEL: tuple[Edit, ...] = (
    ("form: standard", "form: parallel"),
    ("unit: s, off: inf", "unit: 1/s, off: 0"),
    ("tracking-time: Ti", "tracking-time: 5"),
    ("{GAIN: 2, RESET: 60, RATE: 16}", "{GAIN: 2, RESET: 0.0333333, RATE: 32}"),
)
FREE: tuple[Edit, ...] = (
    *_PARALLEL,
    ("ratio: ALPHA", "gain: N, of: derivative-time"),
    (ALPHA, '  N: {sets: filter-gain, unit: "1", range: [1, 100], default: 8}\n'),
    (ALPHA_EVIDENCE, "  settings.N.default: {status: documented, source: manual, at: p. 5}\n"),
)
"""N free; the example's filter is 32 s/(2 x 8) = 2 s."""
FIXED: tuple[Edit, ...] = (*_PARALLEL, ("ratio: ALPHA", "ratio: 0.125, of: derivative-time"), (ALPHA, ""), (ALPHA_EVIDENCE, ""))
MEASUREMENT: tuple[Edit, ...] = (
    *FIXED,
    ("applies-to: term", "applies-to: measurement"),
    (", kd: 32, Tf: 2}", ", kd: 28.1333333, Tf: 2}"),  # kp = 2 - 2/30, kd = 32 - 2 kp, of (ki + 2 s + 32 s^2)/(s (1 + 2 s))
    ("kp: 2, ki", "kp: 1.9333333, ki"),
)


def card(folder: Path, edits: tuple[Edit, ...]) -> pidemu.Card:
    return pidemu.load_card(written(folder, edited(VALID, *edits)))


def parallel(**dials: float) -> pidemu.Settings:
    return pidemu.load_card("generic/parallel").settings(dials)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cards")


@pytest.fixture(scope="module")
def free(folder: Path) -> pidemu.Card:
    return card(folder / "free", FREE)


@pytest.fixture(scope="module")
def fixed(folder: Path) -> pidemu.Card:
    return card(folder / "fixed", FIXED)


def test_the_filter_time_is_kd_over_kp_and_n(free: pidemu.Card) -> None:
    assert free.settings(GAIN=20, RESET=0.1, RATE=60, N=10).algorithm().Tf == pytest.approx(0.3, rel=1e-15)  # 60/(20 x 10)


def test_the_law_has_that_filter(free: pidemu.Card) -> None:
    w = np.geomspace(1e-3, 1e2, 50)
    s = 1j * w
    found = free.settings(GAIN=4, RESET=0.1, RATE=60, N=10).law().response(w)
    assert np.allclose(found, 4 + 0.1 / s + 60 * s / (1 + 60 / (4 * 10) * s), rtol=1e-12)


@settings(max_examples=40)
@given(kp=st.floats(0.05, 50), ki=st.floats(1e-4, 1), Td=st.floats(0.1, 100), N=st.floats(1.01, 99))
def test_a_free_n_is_solved_exactly_from_the_filter_time(free: pidemu.Card, kp: float, ki: float, Td: float, N: float) -> None:
    source = parallel(kp=kp, ki=ki, kd=kp * Td, Tf=Td / N)
    conversion = pidemu.convert(source, free, emulate=False)
    values = [conversion.settings[n].value for n in ("GAIN", "RESET", "RATE", "N")]
    assert values == pytest.approx([kp, ki, kp * Td, N], rel=EXACT)
    back = pidemu.convert(conversion.settings, "generic/parallel", emulate=False)
    assert back.settings["Tf"].value == pytest.approx(Td / N, rel=EXACT)


def test_a_standard_form_with_a_fixed_ratio_converts_exactly_to_the_same_ratio(fixed: pidemu.Card, folder: Path) -> None:
    standard = card(folder / "standard", ()).settings(GAIN=20, RESET=60, RATE=16)  # ALPHA 0.125
    conversion = pidemu.convert(standard, fixed)
    assert [conversion.settings[n].value for n in ("GAIN", "RESET", "RATE")] == pytest.approx([20, 1 / 3, 320], rel=EXACT)
    assert conversion.verdict == "exact"
    back = pidemu.convert(conversion.settings, standard.card)
    assert [back.settings[n].value for n in ("GAIN", "RESET", "RATE")] == pytest.approx([20, 60, 16], rel=EXACT)
    assert back.verdict == "exact"


def test_behind_a_fixed_filter_the_moments_are_kept(fixed: pidemu.Card) -> None:
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE="4 s")
    conversion = pidemu.convert(source, fixed, match="low-frequency", emulate=False)
    assert conversion.settings.law().moments() == pytest.approx(source.law().moments(), rel=EXACT)


def test_a_filter_on_the_measurement_is_solved_in_closed_form_too(folder: Path) -> None:
    target = card(folder / "measurement", MEASUREMENT)
    source = pidemu.load_card("generic/standard").settings(K=3, Ti=60, Td=10)
    conversion = pidemu.convert(source, target, match="low-frequency", emulate=False)
    assert conversion.settings.law().moments() == pytest.approx(source.law().moments(), rel=EXACT)
    itself = pidemu.convert(conversion.settings, target, emulate=False)
    names = ("GAIN", "RESET", "RATE")
    assert [itself.settings[n].value for n in names] == pytest.approx([conversion.settings[n].value for n in names], rel=EXACT)


@pytest.mark.parametrize("gain", [0.0, -2.0])
def test_a_derivative_without_a_proportional_gain_of_its_sign_has_no_such_time(gain: float, folder: Path) -> None:
    edits = (*FIXED, ('unit: "%/%"', 'unit: "%/%", range: [-9, 9]'))
    with pytest.raises(
        SettingError, match=f"goes with the derivative time kd/kp, and kp is {gain:g} with kd 5; give a proportional gain"
    ):
        card(folder / "signed", edits).settings(GAIN=gain, RESET=0.1, RATE=5).algorithm()


def test_a_source_without_proportional_action_but_with_a_derivative_is_refused(fixed: pidemu.Card) -> None:
    with pytest.raises(ConversionRefusedError, match="no proportional action; the derivative's filter of nobody/bench"):
        pidemu.convert(parallel(kp=0, ki=0.1, kd=3), fixed)
    conversion = pidemu.convert(parallel(kp=0, ki=0.1), fixed)
    assert [conversion.settings[n].value for n in ("GAIN", "RESET", "RATE")] == [0, 0.1, 0]


def test_a_negative_derivative_of_the_size_of_the_integral_gain_is_solved_too() -> None:
    """A lag of 5 s on PV: ki = 0.2, kp = 2 - 5 ki = 1, kd = -5 kp, where 1 + kd ki, no time of a parallel form, is zero."""
    card = pidemu.load_card("yokogawa/fieldbus-pid")
    source = card.settings(GAIN=2, RESET=10, PV_FTIME=5, pv_range=(0, 100), op_range=(0, 100))
    conversion = pidemu.convert(source, "advanced-pid/advanced-pid", match="low-frequency", emulate=False)
    a = conversion.settings.algorithm()
    assert (a.kp, a.ki, a.kd) == pytest.approx((1, 0.2, -5), rel=EXACT)
    assert conversion.settings.law().moments() == pytest.approx(source.law().moments(), rel=EXACT)
