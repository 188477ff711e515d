"""Loops in files: everything that a conversion can be given, and what of it the command line overrides."""

from __future__ import annotations

from pathlib import Path

from tests.cli.helpers import said, told

LOOP = """\
card: yokogawa/fieldbus-pid
settings: {GAIN: 0.6, RESET: 8}
to: emerson/deltav
mode: cascade
tag: FIC-1
scan: 0.5
"""


def written(folder: Path, text: str) -> str:
    file = folder / "loop.yaml"
    file.write_text(text, encoding="utf-8")
    return str(file)


def test_one_scan_interval_mode_and_tag_stand_in_the_file(tmp_path: Path) -> None:
    out = told("convert", "--loop", written(tmp_path, LOOP))
    assert out.startswith("FIC-1: yokogawa/fieldbus-pid  ->  emerson/deltav\n")
    assert "STRUCTURE=1" in out


def test_the_command_line_counts_before_the_file(tmp_path: Path) -> None:
    out = told("convert", "--loop", written(tmp_path, LOOP), "--mode", "auto", "--tag", "FIC-2")
    assert out.startswith("FIC-2: ")
    assert "STRUCTURE=2" in out


def test_the_real_interval_and_the_action_stand_in_the_file(tmp_path: Path) -> None:
    loop = """\
card: allen-bradley/plc5
settings: {EQUATION: ISA, DERIVATIVE: PV, KC: 2, TI: 1, TD: 0.1}
to: allen-bradley/logix-pid
scan: 0.2
runs-every: 0.02
action: direct
"""
    out = told("convert", "--loop", written(tmp_path, loop))
    assert "Action: direct acting, PV - SP: CA 1." in out
    assert [line.split()[1] for line in out.splitlines() if line.strip().startswith(("KP ", "KI ", "KD "))] == ["2", "0.1", "0.01"]


def test_the_output_limits_and_the_bias_stand_in_the_file(tmp_path: Path) -> None:
    loop = """\
card: fisher/provox
settings: {GAIN: 2, RESET: 4}
to: emerson/deltav
limits: [20, 80]
action: reverse
"""
    out = told("convert", "--loop", written(tmp_path, loop))
    assert "Output limits: set 20 to 80 %." in out


def test_cards_stand_there_by_id_and_no_file_is_looked_for(tmp_path: Path) -> None:
    loop = "card: evil/fisher/provox.yaml\nsettings: {GAIN: 2}\nto: /etc/other.yml\n"
    status, out, err = said("convert", "--loop", written(tmp_path, loop))
    assert (status, out) == (1, "")
    assert "loop.yaml:1:7: 'evil/fisher/provox.yaml' is a file, not the id of a card; name its folder with --vendors" in err
    assert "loop.yaml:3:5: '/etc/other.yml' is a file, not the id of a card; name its folder with --vendors" in err
