"""Typical settings of every card, and their conversions to every card."""

from __future__ import annotations

import csv
import io
import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.conversion.unstated import unstated
from pidemu.errors import CardNotFoundError, SettingError
from pidemu.matrix import cell as cell_module
from pidemu.matrix.cell import Cell, Work
from pidemu.matrix.matrix import COLUMNS, Matrix, counts, matrix
from pidemu.matrix.pairs import computed
from pidemu.matrix.typical import held_dials, typical_settings
from pidemu.settings.settings import Settings
from pidemu.units import Role
from tests.checks.bench import VALID, edited, written
from tests.cli.helpers import told
from tests.helpers import WIDE

FOUR = ("fisher/provox", "emerson/deltav", "generic/standard", "bailey/fc19")
CARDS = [c for c in pidemu.cards() if c != "generic/dahlin"]


@pytest.fixture(scope="module")
def four() -> Matrix:
    return matrix(FOUR)


def terms(s: Settings) -> tuple[float, ...]:
    return tuple(v.canonical if (v := s.by_role(role)) else 0.0 for role in (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE))


@pytest.mark.parametrize("name", CARDS)
@pytest.mark.parametrize("derivative", [True, False])
def test_typical_settings_are_the_same_three_numbers_on_every_dial(name: str, derivative: bool) -> None:
    settings = typical_settings(pidemu.load_card(name), derivative=derivative)
    gain, integral, time = terms(settings)
    scale = abs(gain) if settings.equation.form == "parallel" else 1
    assert abs(gain) == 2
    half = {v.role: v.setting.resolution / 2 / v.value for v in settings.values() if v.setting.resolution and v.value}  # of a step
    assert abs(integral) == pytest.approx(scale / 90, rel=max(5e-4, half.get(Role.INTEGRAL, 0)))  # four digits, else the dial's
    acts = derivative and settings.equation.derivative.on != "none"
    assert abs(time) == pytest.approx(10 * scale if acts else 0, rel=max(5e-4, half.get(Role.DERIVATIVE, 0)))


def test_a_dial_with_a_resolution_is_set_to_what_it_can_show() -> None:
    """UDC shows hundredths of a minute: a typical derivative time of 10 s is 0.17 min there."""
    assert typical_settings(pidemu.load_card("honeywell/udc"))["RATE"].value == 0.17
    [cell] = matrix(["honeywell/udc"], emulate=False).cells
    assert cell.verdict == "exact"


@pytest.mark.parametrize("name", CARDS)
def test_no_typical_value_is_out_of_range(name: str) -> None:
    settings = typical_settings(pidemu.load_card(name))
    assert settings.notes == ()


@pytest.mark.parametrize("name", CARDS)
def test_of_typical_settings_nothing_is_left_to_be_asked(name: str) -> None:
    settings = typical_settings(pidemu.load_card(name))
    assert settings.defaulted == ()
    assert [o for o in unstated(settings) if o.asked] == []


@pytest.mark.parametrize("name", CARDS)
def test_typical_settings_make_a_controller_whose_output_falls_when_the_measurement_rises(name: str) -> None:
    settings = typical_settings(pidemu.load_card(name))
    steady, risen = (
        pidemu.Controller(settings, 1.0, output_limits=WIDE, initial_output=50.0).run(50.0, np.repeat([50.0, pv], [5, 300]))
        for pv in (50.0, 51.0)
    )
    assert risen[-1] <= steady[-1] - 2  # by the gain at least, the integral comes on top where it may


def test_a_typical_value_outside_a_range_gives_way_to_the_nearest_inside_and_is_noted(tmp_path: Path) -> None:
    text = edited(
        VALID, ("RESET: {sets: integral, unit: s, off: inf}", "RESET: {sets: integral, unit: s, range: [0.1, 60], off: inf}")
    )
    settings = typical_settings(pidemu.load_card(written(tmp_path, text)))
    assert settings["RESET"].value == 60
    assert settings.notes == ("RESET: 90 s is outside 0.1 to 60; 60 is the nearest inside",)


def test_dials_without_default_that_no_conversion_computes_get_sensible_values() -> None:
    assert held_dials(pidemu.load_card("astrom-hagglund/listing")) == {"Tt": 30}  # the root of 90 s and 10 s
    assert held_dials(pidemu.load_card("ardupilot/ac-pid")) == {"IMAX": 100}
    assert typical_settings(pidemu.load_card("astrom-hagglund/listing"))["N"].value == 10


def test_a_card_without_pid_settings_has_no_typical_ones_and_is_left_out() -> None:
    with pytest.raises(SettingError, match="generic/dahlin has no PID settings"):
        typical_settings(pidemu.load_card("generic/dahlin"))
    found = matrix(["generic/standard", "generic/dahlin"], emulate=False)
    assert found.cards == ("generic/standard",)
    assert list(found.left_out) == ["generic/dahlin"]
    with pytest.raises(ConversionRefusedError, match="no card is left"):
        matrix(["generic/dahlin"])


def test_every_ordered_pair_has_its_cell_and_the_diagonal_is_exact(four: Matrix) -> None:
    assert [(c.source, c.target) for c in four.cells] == [(a, b) for a in FOUR for b in FOUR]
    assert {four.row(card)[i].verdict for i, card in enumerate(FOUR)} == {"exact"}
    assert [c.source for c in four.column("bailey/fc19")] == list(FOUR)
    assert {c.target for c in four.column("bailey/fc19")} == {"bailey/fc19"}
    assert sum(counts(four.cells).values()) == 16


def test_the_command_of_a_cell_shows_what_the_cell_says(four: Matrix) -> None:
    for cell in four.cells:
        words = shlex.split(cell.command)
        assert words[0] == "pidemu"
        said = json.loads(told(*words[1:], "--json"))
        assert (said["verdict"], said["match"], said["sentence"]) == (cell.verdict, cell.match, cell.sentence)
        assert said["chosen"] == cell.chosen
        for path, stated in (("feedback", cell.deviation), ("setpoint", cell.setpoint_deviation)):
            shown, before = (said["certificate"][name] for name in (path, f"{path}_before_rounding"))
            same = (before or shown)["loop_band"]["max_deviation"] < 1e-9
            assert stated == (0 if same else shown["loop_band"]["max_deviation"])


def test_an_equation_that_depends_on_the_mode_is_converted_as_in_automatic() -> None:
    """No choice of DeltaV's STRUCTURE does in both modes what the block of Yokogawa does: as such it would be asked about."""
    [cell] = [c for c in matrix(["yokogawa/fieldbus-pid", "emerson/deltav"], emulate=False).cells if c.source != c.target][:1]
    assert (cell.source, cell.verdict, cell.setpoint_deviation) == ("yokogawa/fieldbus-pid", "approximate", 0)
    assert cell.command.endswith("--mode auto")
    assert cell.given.endswith("; in automatic")
    assert cell.chosen == {"STRUCTURE": "2"}


def test_ranges_are_stated_where_a_span_changes_a_dial() -> None:
    cells = {
        c.target: c.command for c in matrix(["fisher/provox", "bailey/fc19", "emerson/deltav"], emulate=False).row("fisher/provox")
    }
    assert "--pv-range=0,100" in cells["bailey/fc19"]
    assert "-range" not in cells["emerson/deltav"]


def test_all_options_of_the_source_are_stated_and_those_that_decide_it_are_told() -> None:
    [cell] = matrix(["emerson/deltav"], emulate=False).cells
    assert "FORM=Standard STRUCTURE=1 FRSIPID_OPTS=none --to" in cell.command
    assert cell.given == "GAIN=2 %/%, RESET=90 s/repeat, RATE=10 s, ALPHA=0.125, FORM=Standard, STRUCTURE=1, FRSIPID_OPTS=none"


def test_a_derivative_without_filter_gets_a_usual_filter_where_the_target_delivers_none() -> None:
    """Not the lowest that the dial takes: N = 1 would leave hardly a derivative."""
    cell = matrix(["generic/standard", "astrom-hagglund/listing"], emulate=False).row("generic/standard")[1]
    assert cell.settings == "K=2 eu/eu, Ti=90 s, Td=10 s, Tt=30 s, N=10, b=1"
    assert cell.deviation == pytest.approx(0.029, abs=5e-4)


def test_the_deviation_is_that_of_the_two_responses(four: Matrix) -> None:
    """A law by hand: PROVOX is series with a lead-lag of ratio 1/8, DeltaV's standard form has the filter on its derivative."""
    cell = four.row("emerson/deltav")[0]
    found = pidemu.convert(typical_settings(pidemu.load_card("emerson/deltav")), "fisher/provox")
    K, repeats, minutes = (found.settings[n].value for n in ("GAIN", "RESET", "RATE"))
    band = found.certificate.feedback.loop_band
    s = 1j * np.geomspace(band.low, band.high, 4000)
    old = 2 * (1 + 1 / (90 * s) + 10 * s / (1 + 10 * 0.125 * s))
    new = K * (1 + repeats / 60 / s) * (1 + 60 * minutes * s) / (1 + 7.5 * minutes * s)
    assert cell.deviation == pytest.approx(np.max(np.abs(new / old - 1)), rel=1e-3)  # the grids differ


@pytest.mark.parametrize(
    ("cell", "mark", "stands_out"),
    [
        (Cell("a/a", "b/b", "exact", 0.0, 0.0), "=", False),
        (Cell("a/a", "b/b", "exact-feedback", 0.0, 0.5), "=", True),
        (Cell("a/a", "b/b", "approximate", 0.0, 0.0, 0.1, 0.1, 80.0), "~", False),
        (Cell("a/a", "b/b", "approximate", 0.0123, 0.0123), "1.2", False),
        (Cell("a/a", "b/b", "approximate", 0.00004, 0.9), "<.01", True),
        (Cell("a/a", "b/b", "question"), "?", False),
        (Cell("a/a", "b/b", "refused", 0.2, 0.2), "x", False),
        (Cell("a/a", "b/b", "failed"), "!", False),
    ],
)
def test_a_cell_has_a_mark(cell: Cell, mark: str, stands_out: bool) -> None:
    assert (cell.mark, cell.setpoint_stands_out) == (mark, stands_out)


def test_the_csv_holds_every_cell_with_its_figures(four: Matrix) -> None:
    [head, *rows] = csv.reader(io.StringIO(four.to_csv()))
    assert tuple(head) == COLUMNS
    for row, cell in zip(rows, four.cells, strict=True):
        said = dict(zip(head, row, strict=True))
        assert (said["source"], said["target"], said["verdict"]) == (cell.source, cell.target, cell.verdict)
        assert cell.deviation is not None
        assert float(said["feedback_deviation"]) == pytest.approx(cell.deviation, rel=5e-4)  # four digits
        assert said["command"] == cell.command


def test_a_target_that_refuses_shows_its_nearest_settings(tmp_path: Path) -> None:
    text = edited(
        VALID,
        ('GAIN: {sets: gain, unit: "%/%"}', 'GAIN: {sets: gain, unit: "%/%", range: [3, 9]}'),
        ("GAIN: 2,", "GAIN: 4,"),
        ("kp: 2, ki: 0.0333333, kd: 32", "kp: 4, ki: 0.0666667, kd: 64"),
    )
    cell = matrix(["generic/standard", written(tmp_path, text)], emulate=False).row("generic/standard")[1]
    assert (cell.verdict, cell.mark) == ("refused", "x")
    assert "GAIN" in cell.sentence
    assert "GAIN=3 %/%" in cell.settings
    assert cell.deviation is not None
    assert cell.deviation > 0.1


def test_one_conversion_that_fails_does_not_lose_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(source: Settings, target: Any, **rest: Any) -> pidemu.Conversion:
        if (source.card.id, target.id) == ("fisher/provox", "generic/standard"):
            raise ZeroDivisionError("by chance")
        return pidemu.convert(source, target, **rest)

    monkeypatch.setattr(cell_module, "convert", broken)
    found = matrix(["fisher/provox", "generic/standard"], emulate=False)
    assert [c.verdict for c in found.cells].count("failed") == 1
    assert [(c.source, c.target, c.sentence) for c in found.failed] == [
        ("fisher/provox", "generic/standard", "ZeroDivisionError: by chance")
    ]


def test_what_cannot_be_sent_to_a_process_fails_and_is_named() -> None:
    names: Any = {"generic/standard": lambda: None}  # a function without a name cannot be sent
    found = computed(Work(names, (), True, False), [("generic/standard", "generic/standard")], jobs=2)
    assert [c.verdict for c in found.values()] == ["failed"]


def test_processes_find_the_user_s_cards_and_give_what_one_process_gives(tmp_path: Path) -> None:
    written(tmp_path, VALID)
    cards = ["nobody/bench", "generic/standard", "fisher/provox", "emerson/deltav"]
    seen: list[tuple[int, int]] = []
    alone = matrix(cards, emulate=False, vendors=(tmp_path,), jobs=1)
    shared = matrix(cards, emulate=False, vendors=(tmp_path,), jobs=2, progress=lambda *p: seen.append(p))
    assert shared == alone
    assert shared.failed == ()
    assert seen[-1] == (16, 16)


def test_a_card_that_does_not_exist_is_named() -> None:
    with pytest.raises(CardNotFoundError, match="fisher/provx"):
        matrix(["fisher/provx"])


INTERRUPTED = """\
from pidemu.matrix.matrix import matrix
if __name__ == "__main__":
    try:
        matrix(jobs=2, emulate=False, progress=lambda done, total: print(done, flush=True))
    except KeyboardInterrupt:
        print("ended")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="process groups are sent signals otherwise there")
def test_an_interrupt_ends_all_processes_without_a_traceback(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(INTERRUPTED, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout is not None
    process.stdout.readline()  # the first share is done: both processes are at work
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert out.splitlines()[-1] == "ended"
    assert (process.returncode, err) == (0, "")


def test_typical_times_of_a_card_that_counts_in_scans_are_those_seconds(tmp_path: Path) -> None:
    text = edited(
        VALID,
        ("integral, unit: s,", "integral, unit: scan,"),
        ("scan: {default: 1 s}", "scan: {default: 0.5 s}"),
        ("RESET: 60", "RESET: 120"),
    )
    settings = typical_settings(pidemu.load_card(written(tmp_path, text)))
    assert settings["RESET"].value == 180  # 90 s
