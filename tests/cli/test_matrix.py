"""The command that converts every card to every card."""

from __future__ import annotations

import csv
import shlex
from pathlib import Path
from typing import Any

import pytest

import pidemu
from pidemu.conversion.questions import Question
from pidemu.matrix import cell as cell_module
from tests.checks.bench import VALID, written
from tests.cli.helpers import said, strict_json, told

TWO = ("fisher/provox", "generic/standard")
QUICK = ("--no-emulation", "--jobs", "1")


def test_the_table_shows_marks_for_every_pair() -> None:
    out = told("matrix", *TWO, *QUICK)
    to_provox = pidemu.convert(pidemu.load_card(TWO[1]).settings(K=2, Ti=90, Td=10), TWO[0]).certificate.feedback.loop_band
    rows = [line.split() for line in out.splitlines()[:3]]
    assert rows == [[*TWO], [TWO[0], "=", "="], [TWO[1], f"{100 * to_provox.max_deviation:.1f}*", "="]]
    assert out.splitlines()[4] == "4 conversions: 3 exact, 1 approximate"
    assert "Verdicts rest on the continuous laws alone." in out


def test_a_table_that_is_too_wide_comes_in_numbered_blocks() -> None:
    cards = pidemu.cards()[:8]
    lines = told("matrix", *cards, *QUICK).splitlines()
    assert lines[0].split() == [str(i + 1) for i in range(8)]
    assert lines[1].split()[:2] == ["1", cards[0]]
    assert max(map(len, lines)) <= 110


def test_json_holds_every_cell() -> None:
    found = strict_json(told("matrix", *TWO, *QUICK, "--json"))
    assert found["cards"] == list(TWO)
    assert [(c["source"], c["target"]) for c in found["cells"]] == [(a, b) for a in TWO for b in TWO]
    assert sum(found["counts"].values()) == 4
    assert found["emulated"] is False


def test_files_are_written_beside_the_table(folder: Path) -> None:
    told("matrix", *TWO, *QUICK, "--csv", "m.csv", "--html", "m.html")
    with (folder / "m.csv").open(encoding="utf-8", newline="") as stream:
        assert [(r["source"], r["target"]) for r in csv.DictReader(stream)] == [(a, b) for a in TWO for b in TWO]
    assert "fisher/provox" in (folder / "m.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("option", ["--csv", "--html"])
def test_a_file_that_cannot_be_written_is_named(option: str) -> None:
    status, _, err = said("matrix", TWO[0], *QUICK, option, "nowhere/m.file")
    assert (status, err) == (2, "error: nowhere/m.file: cannot be written: No such file or directory\n")


def test_without_derivative_the_settings_have_none() -> None:
    [cell] = strict_json(told("matrix", "fisher/provox", *QUICK, "--no-derivative", "--json"))["cells"]
    assert cell["given"] == "GAIN=2 %/%, RESET=0.6667 repeat/min, RATE=0 min"


def test_a_card_without_pid_settings_is_left_out_with_a_note() -> None:
    status, out, err = said("matrix", "generic/standard", "generic/dahlin", *QUICK)
    assert (status, err) == (
        0,
        "note: generic/dahlin is left out: it cancels the pole of a process model and has no PID settings\n",
    )
    assert "1 conversion: 1 exact" in out


def test_a_conversion_that_fails_is_reported_and_the_exit_status_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*words: Any, **rest: Any) -> pidemu.Conversion:
        raise ZeroDivisionError("by chance")

    monkeypatch.setattr(cell_module, "convert", broken)
    status, out, err = said("matrix", "generic/standard", *QUICK)
    assert (status, err) == (1, "error: generic/standard to generic/standard: ZeroDivisionError: by chance\n")
    assert "1 conversion: 1 failed" in out


def test_a_question_is_shown_as_one_and_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def asks(*words: Any, **rest: Any) -> pidemu.Conversion:
        raise pidemu.QuestionError([Question("mode", "mode", "In which mode does the loop run?")])

    monkeypatch.setattr(cell_module, "convert", asks)
    status, out, err = said("matrix", "generic/standard", *QUICK)
    assert (status, err) == (0, "")
    assert out.splitlines()[1].split() == ["generic/standard", "?"]
    assert "1 conversion: 1 question" in out


def test_folders_of_one_s_own_cards_are_searched(tmp_path: Path) -> None:
    written(tmp_path, VALID)
    found = strict_json(told("matrix", "nobody/bench", *QUICK, "--vendors", str(tmp_path), "--json"))
    assert found["cells"][0]["verdict"] == "exact"
    [pidemu_, *words] = shlex.split(found["cells"][0]["command"])  # it names the card by its file, so that it runs anywhere
    assert pidemu_ == "pidemu"
    assert strict_json(told(*words, "--json"))["verdict"] == "exact"


def test_an_unknown_card_is_wrong_usage() -> None:
    status, _, err = said("matrix", "fisher/provx")
    assert (status, err) == (2, "error: no card 'fisher/provx' (did you mean 'fisher/provox'?); 'pidemu cards' lists them\n")
