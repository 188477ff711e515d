"""Cards with options: overlays, variants, evidence by path, assumptions."""

from __future__ import annotations

from pathlib import Path

import pytest

import pidemu
from pidemu.card.library import card_files
from pidemu.card.load import Card, leaves, load_file, overlay, variants
from pidemu.card.model.base import Status
from pidemu.card.windup.clamp import WindupClamp
from pidemu.errors import CardError, SettingError
from tests.checks.bench import CHOICE, VALID, WINDUP, edited, loaded

OPTIONS = """\
options:
  STRUCTURE:
    default: PID
    choices:
      I-PD: {proportional: {on: pv}}
      PID: {}
      PI: {derivative: {filter: null}, settings: {ALPHA: null}}
  ANTIWINDUP:
    default: track
    choices:
      track: {}
      clamp: {integral: {windup: {scheme: clamp}}}
      Clamp: {integral: {windup: {scheme: none}}}
"""


def two_options(folder: Path) -> Card:
    old = VALID[VALID.index("options:\n  STRUCTURE") : VALID.index("action:\n  names")]
    return loaded(folder, edited(VALID, (old, OPTIONS)))


def test_an_overlay_goes_key_by_key() -> None:
    base = {"proportional": {"on": "error", "accumulated": True}, "form": "series"}
    assert overlay(base, {"proportional": {"on": "pv"}}) == {"proportional": {"on": "pv", "accumulated": True}, "form": "series"}


@pytest.mark.parametrize("key", ["filter", "windup"])
def test_an_overlay_replaces_filter_and_windup_whole(key: str) -> None:
    assert {"d": {"on": "pv", key: {"b": 2}}} == overlay({"d": {"on": "pv", key: {"a": 1}}}, {"d": {key: {"b": 2}}})


def test_null_in_an_overlay_removes_a_key() -> None:
    assert overlay({"settings": {"GAIN": 1, "PB": 2}}, {"settings": {"GAIN": None}}) == {"settings": {"PB": 2}}


def test_null_for_what_is_not_there_changes_nothing() -> None:
    assert overlay({"a": 1}, {"b": None}) == {"a": 1}


def test_an_overlay_adds_what_is_not_there() -> None:
    assert overlay({"a": 1}, {"b": {"c": 2}}) == {"a": 1, "b": {"c": 2}}


def test_an_overlay_leaves_the_base_as_it_is() -> None:
    base = {"a": {"b": 1}}
    overlay(base, {"a": {"b": 2}})
    assert base == {"a": {"b": 1}}


def test_leaves_are_the_paths_of_scalars_lists_and_empty_mappings() -> None:
    assert list(leaves({"a": {"b": 1}, "c": [1, 2], "d": {}})) == [("a", "b"), ("c",), ("d",)]


def test_a_variant_replaces_the_windup_of_another_scheme(tmp_path: Path) -> None:
    windup = two_options(tmp_path).variant({"ANTIWINDUP": "clamp"}).equation.integral.windup
    assert windup == WindupClamp(scheme="clamp")


def test_a_variant_without_its_setting_has_lost_it(tmp_path: Path) -> None:
    equation = two_options(tmp_path).variant({"STRUCTURE": "PI"}).equation
    assert list(equation.settings) == ["GAIN", "RESET", "RATE"]
    assert equation.derivative.filter is None


def test_a_filter_in_a_choice_does_not_inherit_keys_of_the_card_s_filter(tmp_path: Path) -> None:
    choice = "{derivative: {filter: {applies-to: measurement, time: 2}}}"
    card = loaded(tmp_path, edited(VALID, (CHOICE, choice)))
    filt = card.variant({"STRUCTURE": "I-PD"}).equation.derivative.filter
    assert filt is not None
    assert (filt.ratio, filt.time, filt.applies_to) == (None, 2, "measurement")


def test_options_take_their_defaults(tmp_path: Path) -> None:
    assert two_options(tmp_path).variant().chosen == {"STRUCTURE": "PID", "ANTIWINDUP": "track"}


def test_the_default_choice_is_listed_first(tmp_path: Path) -> None:
    card = two_options(tmp_path)
    assert card.options == {"STRUCTURE": ("PID", "I-PD", "PI"), "ANTIWINDUP": ("track", "clamp", "Clamp")}


def test_variants_are_every_combination_of_choices(tmp_path: Path) -> None:
    assert len({tuple(v.chosen.values()) for v in variants(two_options(tmp_path))}) == 9


def test_a_card_without_options_has_one_variant() -> None:
    assert [v.chosen for v in variants(pidemu.load_card("fisher/provox"))] == [{}]


def test_a_variant_is_made_once(tmp_path: Path) -> None:
    card = two_options(tmp_path)
    assert card.variant({"STRUCTURE": "I-PD"}) is card.variant({"structure": "i-pd", "ANTIWINDUP": "track"})


def test_options_and_choices_are_found_in_upper_or_lower_case(tmp_path: Path) -> None:
    assert two_options(tmp_path).variant({"Structure": "i-Pd"}).chosen["STRUCTURE"] == "I-PD"


def test_a_choice_may_be_a_number_in_python() -> None:
    assert pidemu.load_card("emerson/deltav").variant({"STRUCTURE": 3}).chosen["STRUCTURE"] == "3"


@pytest.mark.parametrize("word", ["clamp", "Clamp"])
def test_choices_that_differ_in_case_only_are_told_apart_by_case(word: str, tmp_path: Path) -> None:
    assert word == two_options(tmp_path).variant({"ANTIWINDUP": word}).chosen["ANTIWINDUP"]


def test_an_ambiguous_choice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"^nobody/bench: option ANTIWINDUP has no choice 'CLAMP' .*track, clamp, Clamp$"):
        two_options(tmp_path).variant({"ANTIWINDUP": "CLAMP"})


def test_an_unknown_option_is_refused_with_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(SettingError) as caught:
        two_options(tmp_path).variant({"STRUCTUR": "PID"})
    assert (
        str(caught.value) == "nobody/bench: unknown option 'STRUCTUR' (did you mean 'STRUCTURE'?); options: STRUCTURE, ANTIWINDUP"
    )


def test_a_field_stands_where_the_choice_put_it(tmp_path: Path) -> None:
    variant = two_options(tmp_path).variant({"STRUCTURE": "I-PD"})
    assert variant.home(("proportional", "on")) == ("options", "STRUCTURE", "choices", "I-PD", "proportional", "on")
    assert variant.home(("derivative", "on")) == ("derivative", "on")


def test_the_longest_evidence_path_wins(tmp_path: Path) -> None:
    found = {s.path: s.key for s in loaded(tmp_path, VALID).variant().statements}
    assert found["settings.ALPHA.unit"] == "settings"
    assert found["settings.ALPHA.default"] == "settings.ALPHA.default"


def test_evidence_of_a_choice_covers_what_it_overlays(tmp_path: Path) -> None:
    variant = loaded(tmp_path, VALID).variant({"STRUCTURE": "I-PD"})
    [statement] = [s for s in variant.statements if s.path == "proportional.on"]
    assert (statement.value, statement.key) == ("pv", "options")
    assert statement.evidence is not None
    assert statement.evidence.at == "p. 6"


def test_statements_come_in_one_order_and_with_their_values(tmp_path: Path) -> None:
    statements = loaded(tmp_path, VALID).variant().statements
    assert {"form": "standard", "integral.windup.tracking-time": "Ti", "settings.ALPHA.range": [0.05, 1]}.items() <= {
        s.path: s.value for s in statements
    }.items()
    assert len({s.path for s in statements}) == len(statements)


def test_a_path_without_evidence_has_none(tmp_path: Path) -> None:
    card = loaded(tmp_path, VALID)
    assert card.evidence_key(("card",)) is None
    assert card.evidence_key(("integral", "windup", "scheme")) == "integral"


def test_assumptions_are_one_per_evidence_entry(tmp_path: Path) -> None:
    assumed = loaded(tmp_path, VALID).variant().assumptions()
    assert [a.key for a in assumed] == ["derivative", "transfer", "scan", "output"]
    assert {Status.ASSUMED} == {a.evidence.status for a in assumed if a.evidence}


def test_an_assumed_field_that_a_choice_replaces_is_no_longer_assumed(tmp_path: Path) -> None:
    choice = "{transfer: {start: load-output}, scan: {default: 2 s}}"
    variant = loaded(tmp_path, edited(VALID, (CHOICE, choice))).variant({"STRUCTURE": "I-PD"})
    assert [a.key for a in variant.assumptions()] == ["derivative", "output"]


def test_all_settings_are_those_of_any_choice() -> None:
    assert list(pidemu.load_card("honeywell/udc").all_settings()) == ["GAIN", "RSET", "RATE", "PB"]


def test_all_settings_keep_what_the_card_itself_says_first(tmp_path: Path) -> None:
    card = loaded(tmp_path, edited(VALID, (CHOICE, "{settings: {RESET: {unit: min}, GAIN: null, PB: {sets: gain, unit: '%'}}}")))
    found = card.all_settings()
    assert list(found) == ["GAIN", "RESET", "RATE", "ALPHA", "PB"]
    assert found["RESET"].unit == "s"


def test_the_id_comes_from_the_path_unless_it_is_given(tmp_path: Path) -> None:
    file = tmp_path / "nobody" / "bench.yaml"
    file.parent.mkdir()
    file.write_text(VALID, encoding="utf-8")
    assert load_file(file).id == "nobody/bench"
    assert load_file(file, "some/other").id == "some/other"


def test_the_title_names_vendor_product_and_algorithm(tmp_path: Path) -> None:
    assert loaded(tmp_path, VALID).title == "Nobody test bench: PID"


def test_a_file_that_is_not_there_is_an_error_of_its_own(tmp_path: Path) -> None:
    with pytest.raises(CardError, match=r"none\.yaml:1:1: cannot be read: No such file or directory"):
        load_file(tmp_path / "none.yaml")


def test_a_file_in_another_encoding_is_refused_on_its_line(tmp_path: Path) -> None:
    file = tmp_path / "bench.yaml"
    file.write_bytes(VALID.replace("Bench manual", "Handbuch für").encode("latin-1"))
    with pytest.raises(CardError, match=r"bench\.yaml:6:\d+: not UTF-8 text \(byte 0xFC\); save the file as UTF-8"):
        load_file(file)


def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    file = tmp_path / "bench.yaml"
    file.write_text(VALID, encoding="utf-8-sig")
    assert load_file(file).data.algorithm == "PID"


def test_windows_line_ends_do_no_harm(tmp_path: Path) -> None:
    file = tmp_path / "bench.yaml"
    file.write_bytes(VALID.replace("\n", "\r\n").encode())
    assert load_file(file).data.algorithm == "PID"


def test_every_problem_of_a_card_is_found_at_once(tmp_path: Path) -> None:
    with pytest.raises(CardError) as caught:
        loaded(tmp_path, edited(VALID, ("form: standard", "form: serial"), (WINDUP, "{}"), ("card: 1", "card: one")))
    assert [p.line for p in caught.value.problems] == [1, 7, 10]


@pytest.mark.parametrize("card_id", card_files())
def test_every_built_in_card_has_evidence_for_every_statement_of_every_variant(card_id: str) -> None:
    card = pidemu.load_card(card_id)
    assert [(v.chosen, s.path) for v in variants(card) for s in v.statements if s.evidence is None] == []
