"""Numbers as they enter, from Python and in words."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

import pidemu
from pidemu.errors import PidemuError, ProcessError, ScanError, SettingError
from pidemu.parsing import pair, step
from pidemu.plausible import GAIN, INTERVAL, number, plain_number, plausible, shown

HUGE = 10**5000


@pytest.mark.parametrize("given", [2, 2.0, Fraction(2), Decimal("2"), np.float32(2), np.float64(2), np.int64(2), np.uint8(2)])
def test_every_kind_of_number_is_read(given: object) -> None:
    assert number(given) == 2.0
    assert type(number(given)) is float
    assert pidemu.load_card("fisher/provox").settings(GAIN=given, RESET=4)["GAIN"].value == 2.0


@pytest.mark.parametrize("given", [True, np.bool_(True), 2j, "2", b"2", None, [2], np.array([2.0]), object(), Decimal("sNaN")])
def test_what_is_no_number_is_refused(given: object) -> None:
    with pytest.raises(ValueError, match="is not a number"):
        number(given)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (HUGE, "a whole number of 5,001 digits is too large a number"),
        (-HUGE, "a whole number of 5,001 digits is too large a number"),
        (Fraction(HUGE, 3), "a Fraction is too large a number"),
        (Decimal("1e-500"), r"Decimal\('1E-500'\) is too small a number"),
        (Fraction(1, 10**400), "is too small a number"),
    ],
    ids=shown,
)
def test_a_number_beyond_floating_point_is_refused_in_a_few_words(given: object, message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        number(given)
    assert len(str(caught.value)) < 100


@pytest.mark.parametrize(
    ("text", "value"), [("2", 2.0), (" -.5e1 ", -5.0), ("inf", math.inf), ("-Infinity", -math.inf), ("0e-999", 0.0), ("007", 7.0)]
)
def test_a_plain_number_words_is_read(text: str, value: float) -> None:
    assert plain_number(text, words=True) == value


@pytest.mark.parametrize("text", ["1e400", "1e-400", "9" * 5000, "1_0", "٣", "1e", "", "0x10", "2,5", "\x002", "1\n2"])
def test_words_that_are_no_number_are_refused_in_a_few_words(text: str) -> None:
    with pytest.raises(ValueError, match=r"is not a number|has a comma|is too (large|small) a number") as caught:
        plain_number(text)
    assert len(str(caught.value)) < 150


def test_a_number_out_of_range_names_setting_range_and_remedy() -> None:
    with pytest.raises(SettingError) as caught:
        pidemu.load_card("fisher/provox").settings(GAIN=1e-308, RESET=4)
    assert str(caught.value) == (
        "fisher/provox: GAIN: 1e-308 %/% is not a gain that a loop has, 1e-30 to 1e+12 %/% in size; check the number and its unit"
    )
    with pytest.raises(ScanError, match="scan interval: 1e-10 s is not an interval at which a controller is executed, 1e-09 to 1e"):
        plausible("scan interval", 1e-10, INTERVAL, ScanError)
    assert [GAIN.has(x) for x in (0.0, 1e-30, -1e12, 1e-31, 1e13)] == [True, True, True, False, False]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("RESET", "1e300 ms/repeat"), ("RESET", 1e-300), ("RATE", 5e-324), ("RATE", "1e308 h"), ("GAIN", 1e300), ("GAIN", "1e400"),
        ("GAIN", HUGE), ("RATE", "9" * 5000),
    ],
    ids=shown,
)  # fmt: skip
def test_a_dial_that_no_controller_has_is_refused(name: str, value: object) -> None:
    with pytest.raises(SettingError, match=f"^fisher/provox: {name}: .{{1,250}}$"):
        pidemu.load_card("fisher/provox").settings({"GAIN": 2, "RESET": 4, name: value})


def test_what_plants_have_and_cards_state_is_not_refused() -> None:
    provox = pidemu.load_card("fisher/provox")
    for seconds in (1e-6, 1e-3, 1.0, 3600.0, 1e7):
        assert provox.settings(GAIN=2, RESET=f"{seconds} s/repeat").algorithm().ki == pytest.approx(2 / seconds)
    assert provox.settings(GAIN=2, RESET=0).algorithm().ki == 0.0
    for card in map(pidemu.load_card, pidemu.cards()):
        dials = card.variant({}).equation.settings
        card.settings({name: 1 for name, setting in dials.items() if setting.default is None})  # its defaults, 1e38 and 2e-16 too


@pytest.mark.parametrize(
    "make",
    [
        lambda: pidemu.Process(HUGE),
        lambda: pidemu.Process(1e-300),
        lambda: pidemu.Process(1, [HUGE]),
        lambda: pidemu.Process(1, [-1e300]),
        lambda: pidemu.Process(1, [-1] * 21),
        lambda: pidemu.Process(1, delay=1e300),
        lambda: pidemu.Process.from_lags(1, [1e300]),
        lambda: pidemu.Process.from_lags(1, [1], leads=[1e-300]),
        lambda: pidemu.Process.from_lags(1, integrators=50),
        lambda: pidemu.Process.from_lags(1, integrators=HUGE),
    ],
)
def test_a_process_that_no_plant_has_is_refused(make: object) -> None:
    assert callable(make)
    with pytest.raises(ProcessError) as caught:
        make()
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize("scan", [1e300, 5e-324, 1e10, HUGE, "1", True], ids=shown)
def test_an_interval_at_which_nothing_is_executed_is_refused_wherever_it_enters(scan: float) -> None:
    settings, process = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4), pidemu.Process.from_lags(1, [10])
    for use in (
        lambda: pidemu.Controller(settings, scan),
        lambda: settings.law(scan),
        lambda: pidemu.simulate(settings, process, scan),
        lambda: pidemu.convert(settings, "emerson/deltav", scan=scan),
    ):
        with pytest.raises(PidemuError, match="scan"):
            use()


@pytest.mark.parametrize("time", [1e-9, 1e300, -1.0, math.nan, HUGE], ids=shown)
def test_a_time_that_cannot_be_simulated_is_refused(time: float) -> None:
    settings, process = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4), pidemu.Process.from_lags(1, [10])
    with pytest.raises(ProcessError, match="time"):
        pidemu.simulate(settings, process, time=time)


@pytest.mark.parametrize("limits", ["100,0", "5,5", "nan,1", "0,inf,3", "1_0,20", "0,1e400"])
def test_limits_that_are_none_are_refused_where_they_are_written(limits: str) -> None:
    with pytest.raises(SettingError, match=r"low and high|is not two numbers"):
        pair(limits)


@pytest.mark.parametrize("given", [(-1e300, 100.0), (0.0, 1e41)])
def test_output_limits_that_no_loop_has_are_refused_wherever_they_enter(given: tuple[float, float]) -> None:
    settings, process = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4), pidemu.Process.from_lags(1, [10])
    for use in (
        lambda: pidemu.Controller(settings, 1.0, output_limits=given),
        lambda: pidemu.simulate(settings, process, 1.0, output_limits=given),
        lambda: pidemu.convert(settings, "emerson/deltav", limits=given),
    ):
        with pytest.raises(PidemuError, match=r"limit.*(1e\+300|1e\+41) % is not a signal"):
            use()


def test_an_infinite_output_limit_is_none() -> None:
    settings = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4)
    controller = pidemu.Controller(settings, 1.0, output_limits=(-math.inf, math.inf))
    controller.scan(50.0, 50.0)
    assert controller.scan(100.0, -1000.0) > 100


def test_limits_the_wrong_way_round_are_not_blamed_on_the_initial_output() -> None:
    settings, process = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4), pidemu.Process.from_lags(1, [10])
    with pytest.raises(ProcessError, match=r"output limits 100 to 0 % are not a range; give low, then high"):
        pidemu.simulate(settings, process, output_limits=(100, 0))


@pytest.mark.parametrize("size", ["nan", "inf", "60,nan", "nan,5", "1_0", "1e400"])
def test_a_step_without_a_size_is_no_step(size: str) -> None:
    with pytest.raises(SettingError, match="is not a step; write its size"):
        step(size)


@pytest.mark.parametrize("size", [math.nan, math.inf, HUGE, "5", (1, 2, 3), (math.nan, 5.0)], ids=shown)
def test_a_step_without_a_size_is_not_blamed_on_its_time(size: object) -> None:
    settings, process = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4), pidemu.Process.from_lags(1, [10])
    with pytest.raises(ProcessError, match="setpoint") as caught:
        pidemu.simulate(settings, process, setpoint=size)  # type: ignore[arg-type]
    assert "start it earlier" not in str(caught.value)


@pytest.mark.parametrize(
    ("card", "name", "value", "remedy"),
    [
        ("gnc-tools/cpid", "rRampMax", "1 1/scan", "write it in eu/scan"),
        ("toshiba/pid3", "DSV", "1 1/scan", "write it in %/scan"),
        ("generic/parallel", "ki", "0.1 repeat/scan", "write it in 1/s"),
        ("generic/parallel", "kp", "1 1/scan", "use one of: 1, %/%"),
    ],
)
def test_a_unit_in_scans_is_answered_with_one_that_the_dial_takes(card: str, name: str, value: str, remedy: str) -> None:
    dials = pidemu.load_card(card).variant({}).equation.settings
    given: dict[str, object] = {n: 1 for n, setting in dials.items() if setting.default is None}
    with pytest.raises(SettingError) as caught:
        pidemu.load_card(card).settings(given | {name: value})
    assert remedy in str(caught.value)


def test_anything_is_shown_in_a_few_characters() -> None:
    class Broken:
        def __repr__(self) -> str:
            raise RuntimeError

    for given in (HUGE, "x" * 5000, [HUGE], Broken(), Fraction(1, HUGE), None):
        assert 0 < len(shown(given)) < 60
