"""Settings of which nobody is sure what they mean: every reading, and none chosen."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest

import pidemu
from pidemu.card.library import card_files
from pidemu.cli.common import assignments
from pidemu.conversion.ambiguity.readings import apart, command_line
from pidemu.errors import CardNotFoundError, SettingError
from pidemu.settings.ranges import SignalRange
from pidemu.settings.settings import Settings
from tests.checks.bench import VALID

W = np.geomspace(1e-4, 1e2, 60)


def agree(a: Settings, b: Settings) -> bool:
    return bool(np.allclose(a.law().response(W), b.law().response(W), rtol=1e-9, atol=0))  # rounding, many times over


def test_a_bare_reset_is_repeats_per_minute_or_minutes_per_repeat() -> None:
    first, second = pidemu.readings("fisher/provox", GAIN=2, RESET=0.75)
    assert first.text == "RESET = 0.75 repeat/min (80 s per repeat), card fisher/provox"
    assert second.text == "RESET = 0.75 min/repeat (45 s per repeat), card fisher/provox"
    assert first.command == 'fisher/provox GAIN=2 "RESET=0.75 repeat/min"'
    assert second.command == 'fisher/provox GAIN=2 "RESET=0.75 min/repeat"'
    assert [r.settings["RESET"].to("s/repeat") for r in (first, second)] == [80, 45]


def test_numbers_as_text_and_in_a_mapping_are_read_alike() -> None:
    wanted = pidemu.readings("fisher/provox", GAIN=2, RESET=0.75)
    assert pidemu.readings("fisher/provox", {"gain": "2", "reset": "0.75"}) == wanted


def test_a_bare_time_in_seconds_may_be_repeats_per_second() -> None:
    algorithms = [r.settings.algorithm() for r in pidemu.readings("generic/standard", K=2, Ti=4)]
    assert [a.kp / a.ki for a in algorithms] == pytest.approx([4, 0.25])


@pytest.mark.parametrize("reset", ["0.75 repeat/min", "80 s per repeat", "0.75 min", "off", 0, "0"])
def test_a_value_with_a_unit_or_switched_off_is_not_open(reset: object) -> None:
    (only,) = pidemu.readings("fisher/provox", GAIN=2, RESET=reset)
    assert only.settings == pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=reset)
    assert only.alike == ()


def test_an_independent_gain_is_read_per_second_per_minute_and_as_a_reset_rate() -> None:
    found = pidemu.readings("allen-bradley/plc5", KP=2, KI=0.75)
    assert [r.settings.algorithm().ki for r in found] == pytest.approx([0.75, 0.75 / 60, 2 * 0.75, 2 * 0.75 / 60])
    assert [r.text.split(",")[0] for r in found] == [
        "KI = 0.75 1/s",
        "KI = 0.75 1/min",
        "KI = 0.75 repeat/s",
        "KI = 0.75 repeat/min",
    ]
    assert found[3].command == 'allen-bradley/plc5 KP=2 "KI=1.5 1/min"'


def test_the_two_unit_sets_of_logix_are_readings_of_the_same_numbers() -> None:
    found = pidemu.readings("allen-bradley/logix-pid", KP=2, KI=0.75)
    gains = {r.settings.algorithm().ki: r.settings.options["PE"] for r in found}
    wanted = {0.75: "independent", 2 / 45: "dependent", 0.0125: "independent", 2 / 80: "dependent", 1.5: "independent"}
    assert list(gains) == pytest.approx(list(wanted))
    assert list(gains.values()) == list(wanted.values())
    assert "a reset rate" in found[3].alike[0]  # independent, per minute, times the gain


def test_a_gain_of_one_makes_no_difference_between_a_gain_and_a_rate() -> None:
    found = pidemu.readings("allen-bradley/plc5", KP=1, KI=0.75)
    assert [r.settings.algorithm().ki for r in found] == pytest.approx([0.75, 0.75 / 60])
    assert [len(r.alike) for r in found] == [1, 1]
    assert found[0].alike[0].startswith("KI = 0.75 repeat/s, a reset rate")


@pytest.mark.parametrize(
    ("word", "dials"),
    [
        ("bailey/fc19", {"K": 2, "KP": 3, "KI": 0.5}),
        ("arduino/pid", {"Kp": 3, "Ki": 0.5}),
        ("gnc-tools/cpid", {"Kp": -3, "Ki": 0.5}),
    ],
)
def test_a_reset_rate_does_what_it_does_on_a_card_whose_dial_is_one(word: str, dials: dict[str, object]) -> None:
    ranges: dict[str, object] = {"pv_range": (0, 200), "op_range": (0, 255)}
    gain = float(str(dials.get("Kp", dials.get("KP")))) * float(str(dials.get("K", 1)))
    rates = [r for r in pidemu.readings(word, {**dials, **ranges}) if "a reset rate" in r.text]
    assert len(rates) == 2
    for reading in rates:
        rate = "0.5 repeat/min" if "0.5 repeat/min" in reading.text else "0.5 repeat/s"
        assert agree(reading.settings, pidemu.load_card("epics/epid").settings({"KP": gain, "KI": rate, **ranges}))


def test_without_a_proportional_gain_there_is_no_reset_rate() -> None:
    assert [r.settings.algorithm().ki for r in pidemu.readings("generic/parallel", kp=0, ki=3)] == pytest.approx([3, 0.05])


def test_the_form_is_open_where_it_matters() -> None:
    found = pidemu.readings("emerson/deltav", GAIN=2, RESET="60 s", RATE=5)
    assert [r.text for r in found] == [
        "RESET = 60 s, FORM=Standard, card emerson/deltav",
        "RESET = 60 s, FORM=Series, card emerson/deltav",
    ]
    assert [r.settings.options["FORM"] for r in found] == ["Standard", "Series"]
    assert not any("FORM" in r.settings.defaulted for r in found)
    assert found[1].command == 'emerson/deltav GAIN=2 "RESET=60 s" RATE=5 FORM=Series'


def test_without_derivative_the_form_does_not_matter() -> None:
    (only,) = pidemu.readings("emerson/deltav", GAIN=2, RESET="60 s")
    assert only.text == "RESET = 60 s, card emerson/deltav"
    assert set(only.settings.defaulted) == {"FORM", "STRUCTURE", "FRSIPID_OPTS"}


def test_an_option_that_is_given_is_not_open() -> None:
    (only,) = pidemu.readings("emerson/deltav", GAIN=2, RESET="60 s", RATE=5, form="series")
    assert only.settings.options["FORM"] == "Series"
    assert only.command == 'emerson/deltav GAIN=2 "RESET=60 s" RATE=5 FORM=Series'


def test_a_choice_that_leaves_a_given_setting_without_effect_is_no_reading() -> None:
    found = pidemu.readings("emerson/deltav", GAIN=2, RESET="60 s", RATE=5)
    assert all(r.settings.options["STRUCTURE"] == "1" for r in found)  # 3 to 6 have no P or no I
    (asked,) = pidemu.readings("emerson/deltav", GAIN=2, RESET="60 s", STRUCTURE=6)
    assert asked.settings.algorithm().kp == 0


def test_a_choice_that_takes_away_a_term_nobody_gave_is_a_reading() -> None:
    found = pidemu.readings("modelica/limpid", k=2, Ti="5 s")
    assert [r.settings.options["controllerType"] for r in found] == ["PID", "PI"]  # Td is 0.1 s by default


def test_options_and_units_are_combined_the_card_s_own_units_first() -> None:
    found = pidemu.readings("honeywell/tdc3000", K=2, T1=0.75, T2=0.5)
    assert [(r.settings["T1"].to("s/repeat"), r.settings.options["FORM"]) for r in found] == [
        (45, "interactive"),
        (45, "ideal"),
        (80, "interactive"),
        (80, "ideal"),
    ]


def test_a_choice_of_units_adds_nothing_to_what_is_open_anyway() -> None:
    found = pidemu.readings("honeywell/udc", GAIN=2, RSET=0.75)
    assert [r.settings["RSET"].to("s/repeat") for r in found] == [45, 80]
    assert all("MINorRPM" not in r.text for r in found)


def test_options_that_the_names_imply_are_stated() -> None:
    (only,) = pidemu.readings("honeywell/udc", PB=50, RSET="2 min")
    assert only.command == 'honeywell/udc PB=50 "RSET=2 min" "PBorGAIN=PB PCT"'


def test_what_changes_the_setpoint_path_alone_is_not_open() -> None:
    found = pidemu.readings("allen-bradley/plc5", KP=2, KI="0.05 1/s", KD=16)
    assert len(found) == 1
    assert found[0].settings.defaulted == ("EQUATION", "DERIVATIVE")


def test_a_derivative_time_keeps_the_card_s_unit() -> None:
    found = pidemu.readings("fisher/provox", GAIN=2, RESET=0.75, RATE=0.1)
    assert {r.settings["RATE"].to("s") for r in found} == {6}


def test_a_reading_out_of_the_dial_s_range_is_none() -> None:
    (only,) = pidemu.readings("foxboro/pneumatic", PB=50, INT=60)  # 60 min per repeat is more than 50
    assert only.text == "INT = 60 repeat/min (1 s per repeat), card foxboro/pneumatic"


def test_a_vendor_s_name_stands_for_all_its_cards_that_take_the_settings() -> None:
    assert {r.settings.card.id for r in pidemu.readings("honeywell", K=2, T1=1)} == {"honeywell/tdc3000"}
    assert "honeywell/udc" in {r.settings.card.id for r in pidemu.readings("Honeywell", GAIN=2, RSET=1)}
    assert [r.settings.card.id for r in pidemu.readings("generic", K=2, Ti="15 s", Td=5)] == ["generic/series", "generic/standard"]


def test_readings_of_several_cards_that_agree_are_one_with_all_descriptions() -> None:
    (only,) = pidemu.readings("bailey", K=1, KP=2, KI="0.5 1/min", KD=0.1)
    assert only.text == "KI = 0.5 1/min, a gain of its own (0.00833333 1/s), card bailey/fc18"
    assert only.alike == ("KI = 0.5 1/min, a gain of its own (0.00833333 1/s), card bailey/fc19",)


@pytest.mark.parametrize("word", ["provox", "PROVOX", "Fisher/Provox", "fish", "ovox", "FISHER"])
def test_a_word_names_cards_by_any_part_of_id_vendor_and_product(word: str) -> None:
    assert [r.settings.card.id for r in pidemu.readings(word, GAIN=2, RESET="4 rep/min")] == ["fisher/provox"]


def test_the_beginning_of_a_word_counts_before_its_inside() -> None:
    assert {r.settings.card.id for r in pidemu.readings("ni", Kc=1, Ti=1)} == {"ni/pid"}  # not generic


def test_hyphens_and_spaces_in_names_are_alike() -> None:
    assert pidemu.readings("allen bradley/plc5", KC=2, TI=1) == pidemu.readings("allen-bradley/plc5", KC=2, TI=1)


def test_a_word_that_names_nothing_is_refused() -> None:
    with pytest.raises(CardNotFoundError, match=r"no card, vendor or product 'fisher/provoks' \(did you mean 'fisher/provox'\?\)"):
        pidemu.readings("fisher/provoks", GAIN=2, RESET=1)
    with pytest.raises(CardNotFoundError, match="no card, vendor or product ' '"):
        pidemu.readings(" ", GAIN=2, RESET=1)


def test_settings_that_fit_no_card_are_refused_with_the_nearest_names_card_by_card() -> None:
    with pytest.raises(SettingError) as caught:
        pidemu.readings("honeywell", KK=1, T1=1)
    first, *rest = str(caught.value).splitlines()
    assert first == "no card that 'honeywell' names takes these settings; correct them for one of these:"
    assert any(line.startswith("honeywell/tdc3000: unknown setting 'KK' (did you mean 'K'?)") for line in rest)
    assert any(line.startswith("honeywell/udc: unknown setting 'T1'") for line in rest)


def test_a_single_card_refuses_as_it_always_does() -> None:
    card = pidemu.load_card("fisher/provox")
    for values in ({"GIAN": 2, "RESET": 4}, {"GAIN": 2}, {"GAIN": 2, "RESET": "4 furlongs"}, {"GAIN": 2, "RESET": -1}):
        with pytest.raises(SettingError) as plain:
            card.settings(values)
        with pytest.raises(SettingError) as caught:
            pidemu.readings("fisher/provox", values)
        assert str(caught.value) == str(plain.value)


def test_a_recursion_without_pid_settings_has_no_readings() -> None:
    with pytest.raises(SettingError, match="generic/dahlin: cancels the pole of a process model"):
        pidemu.readings("generic/dahlin", {"Kp": 1, "tau": 30, "lambda": 20})


@pytest.fixture
def own_cards(tmp_path: Path) -> Path:
    """Two cards of one vendor, with times in seconds and in minutes."""
    (tmp_path / "acme").mkdir()
    seconds = VALID.replace("vendor: Nobody", "vendor: Acme").replace("RESET: 60, RATE: 16", "RESET: 60 s, RATE: 16 s")
    (tmp_path / "acme" / "seconds.yaml").write_text(seconds, encoding="utf-8")
    minutes = seconds.replace("sets: integral, unit: s", "sets: integral, unit: min")
    minutes = minutes.replace("sets: derivative, unit: s", "sets: derivative, unit: min")
    (tmp_path / "acme" / "minutes.yaml").write_text(minutes, encoding="utf-8")
    return tmp_path


def test_seconds_and_minutes_are_alternatives_where_cards_have_both(own_cards: Path) -> None:
    found = pidemu.readings("acme", GAIN=2, RESET=3, RATE=0.5, vendors=[own_cards])
    times = [(r.settings["RESET"].to("s/repeat"), r.settings["RATE"].to("s")) for r in found]
    assert times == [(180, 30), (3, 0.5), (20, 30), (pytest.approx(1 / 3), 0.5)]


def test_commands_for_cards_of_one_s_own_name_their_folder_or_file(own_cards: Path) -> None:
    first, *_ = pidemu.readings("seconds", GAIN=2, RESET=3, vendors=[own_cards])
    assert shlex.split(first.command)[-1] == f"--vendors={own_cards}"
    file = own_cards / "acme" / "seconds.yaml"
    first, *_ = pidemu.readings(str(file), GAIN=2, RESET=3)
    assert shlex.split(first.command) == [str(file), "GAIN=2", "RESET=3 s"]


def test_ranges_are_kept_and_stated() -> None:
    first, *_ = pidemu.readings("arduino/pid", Kp=2, Ki=0.1, pv_range=(-50, 150), op_range=(0, 255))
    assert first.settings.pv_range == SignalRange(-50, 150)
    assert first.command == 'arduino/pid Kp=2 "Ki=0.1 1/s" --pv-range=-50,150 --op-range=0,255'


def test_how_far_readings_are_apart_is_the_ratio_of_integral_gains_and_the_deviation_of_the_laws() -> None:
    far = apart(pidemu.readings("fisher/provox", GAIN=2, RESET=0.75))
    assert far.integral == pytest.approx(80 / 45)
    assert far.deviation == pytest.approx(80 / 45 - 1, rel=1e-3)  # at the low end of the band, where the integral is nearly all
    forms = apart(pidemu.readings("emerson/deltav", GAIN=2, RESET="60 s", RATE=5))
    assert forms.integral == pytest.approx(1)
    assert forms.deviation > 0.05


def test_readings_with_and_without_integral_action_are_infinitely_far_apart(own_cards: Path) -> None:
    text = (own_cards / "acme" / "minutes.yaml").read_text(encoding="utf-8")
    (own_cards / "acme" / "minutes.yaml").write_text(text.replace("off: inf", "off: 3"), encoding="utf-8")
    found = pidemu.readings("acme", GAIN=2, RESET=3, vendors=[own_cards])
    assert found[0].text == "RESET off, card acme/minutes"
    assert apart(found).integral == np.inf


def test_words_are_quoted_as_a_shell_needs_it() -> None:
    words = ["a/b", "RESET=4 rep/min", "X=$HOME", "C:\\my cards\\x.yaml", "Y=!"]
    assert command_line(words[:2]) == 'a/b "RESET=4 rep/min"'
    assert shlex.split(command_line(words)) == words


@pytest.mark.parametrize("card_id", [i for i in card_files() if i != "generic/dahlin"])
def test_every_example_is_among_its_own_readings_and_every_command_states_one(card_id: str) -> None:
    card = pidemu.load_card(card_id)
    for example in card.data.examples:
        found = pidemu.readings(card_id, example.given)
        documented = card.settings(example.given)
        assert sum(agree(r.settings, documented) for r in found) == 1
        for reading in found:
            name, *words = shlex.split(reading.command)
            assert name == card_id
            ranges = {k: v for k, v in example.given.items() if k in ("pv_range", "op_range")}
            (again,) = pidemu.readings(name, {**assignments(w for w in words if not w.startswith("--")), **ranges})
            assert agree(again.settings, reading.settings)
        assert sum(agree(a.settings, b.settings) for a in found for b in found) == len(found)
