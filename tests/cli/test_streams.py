"""Standard streams that are closed or full, and text that would control the terminal."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.helpers import said, strict_json

POSIX = pytest.mark.skipif(os.name != "posix", reason="streams are closed by a shell of POSIX")
RECORD = Path(__file__).parents[2] / "examples" / "record.csv"
COMMANDS = (
    "cards",
    "cards --json",
    "show fisher/provox",
    "--help",
    f"run fisher/provox GAIN=2 RESET=4 --scan 1 --record {RECORD}",
)


def shell(line: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", "-c", f"{sys.executable} -m pidemu {line}"], capture_output=True, text=True, timeout=60, check=False
    )


@POSIX
@pytest.mark.parametrize("command", COMMANDS)
def test_a_closed_output_is_said_in_one_line(command: str) -> None:
    run = shell(f"{command} >&-")
    assert (run.returncode, run.stderr.splitlines()[-1]) == (1, "error: the standard output cannot be written: it is closed")
    assert "Traceback" not in run.stderr
    assert "ignored" not in run.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full, as Linux has it")
@pytest.mark.parametrize("command", COMMANDS)
def test_a_full_output_is_said_in_one_line(command: str) -> None:
    run = shell(f"{command} >/dev/full")
    assert run.returncode == 1
    assert run.stderr.splitlines()[-1] == "error: the standard output cannot be written: No space left on device"
    assert "Traceback" not in run.stderr
    assert "ignored" not in run.stderr


@POSIX
def test_nothing_is_lost_where_the_other_streams_are_closed() -> None:
    whole = shell("cards")
    for closed in ("<&-", "2>&-", "<&- 2>&-"):
        run = shell(f"cards {closed}")
        assert (run.returncode, run.stdout, run.stderr) == (0, whole.stdout, "")
    for closed in (">&- 2>&-", ">&- <&- 2>&-"):
        run = shell(f"cards {closed}")
        assert (run.returncode, run.stdout, run.stderr) == (1, "", "")


@POSIX
def test_a_result_is_whole_where_there_is_no_output_to_tell_of_it(tmp_path: Path) -> None:
    target = tmp_path / "out.csv"
    run = shell(f"run fisher/provox GAIN=2 RESET=4 --scan 1 --record {RECORD} -o {target} --json <&- >&-")
    assert (run.returncode, run.stderr) == (1, "error: the standard output cannot be written: it is closed\n")
    assert target.read_text(encoding="utf-8").startswith("# The output column is pidemu's own")


HOSTILE = "\x1b[2J\x9b1m\u202ecards"


@pytest.mark.parametrize(
    "line",
    [
        ("show", f"{HOSTILE}/x"),
        ("show", f"{HOSTILE}.yaml"),
        ("check", HOSTILE),
        ("cards", "--vendors", HOSTILE),
        ("show", "fisher/provox", f"{HOSTILE}=1"),
        ("convert", "--loop", HOSTILE),
        ("verify", HOSTILE),
        ("fleet", HOSTILE),
        ("run", "fisher/provox", "GAIN=2", "RESET=4", "--record", HOSTILE),
        ("run", "fisher/provox", "GAIN=2", "RESET=4", "--record", str(RECORD), "--scan", "1", "-o", f"{HOSTILE}/x"),
        (HOSTILE,),
        ("cards", f"--{HOSTILE}"),
        ("simulate", "fisher/provox", "GAIN=2", "RESET=4", "--process", HOSTILE),
    ],
)
def test_no_word_of_a_command_line_controls_the_terminal(line: tuple[str, ...]) -> None:
    status, out, err = said(*line)
    assert status != 0
    assert "cards" in err
    assert not set("\x1b\x9b\u202e") & set(out + err)


def test_no_cell_of_a_table_controls_the_terminal(folder: Path) -> None:
    head = "tag,card,settings,process\n"
    rows = f'{HOSTILE},generic/standard,K=2; Ti=10,gain=1\n"a\u202eb",generic/standard,K=2; Ti=10,"gain=1,lag=5"\n'
    (folder / "loops.csv").write_text(head + rows, encoding="utf-8")
    status, out, err = said("fleet", "loops.csv", "--time", "20")
    assert status == 1
    shown = "\\x1b[2J\\x9b1m\\u202ecards"
    assert err == f"loops.csv:2: {shown}: column tag: character 1: U+001B, an escape, stands in the text; remove it\n"
    assert "a\\u202eb" in out
    assert not set("\x1b\x9b\u202e") & set(out + err)
    plain = strict_json(said("fleet", "loops.csv", "--time", "20", "--json").out)
    assert [row["tag"] for row in plain["loops"]] == [shown, "a\u202eb"]


def test_a_tag_on_a_certificate_does_not_control_the_terminal() -> None:
    line = ("convert", "fisher/provox", "GAIN=2", "RESET=4", "--to", "emerson/deltav", "--tag", HOSTILE)
    status, out, err = said(*line)
    assert status == 0
    assert out.startswith("\\x1b[2J\\x9b1m\\u202ecards: fisher/provox")
    plain = said(*line, "--json").out
    assert not set("\x1b\x9b\u202e") & set(out + err + plain)
    assert strict_json(plain)["request"]["tag"] == HOSTILE


def test_a_file_that_is_overwritten_must_not_be_read(folder: Path) -> None:
    text = RECORD.read_text(encoding="utf-8")
    (folder / "record.csv").write_text(text, encoding="utf-8")
    run = ("run", "fisher/provox", "GAIN=2", "RESET=4", "--scan", "1", "--record", "record.csv")
    compare = ("compare", "fisher/provox", "GAIN=2", "RESET=4", "emerson/deltav", "GAIN=2", "RESET=15", "--record", "record.csv")
    for line in (run, compare):
        status, out, err = said(*line, "-o", "record.csv")
        assert (status, out) == (2, "")
        assert err == "error: record.csv: is read, too, as record.csv; give another file for the result\n"
    (folder / "loops.csv").write_text("tag,card,settings,process\nA,generic/standard,K=2; Ti=10,gain=1\n", encoding="utf-8")
    for option in ("--table", "--parquet"):
        status, out, err = said("fleet", "loops.csv", option, "./loops.csv")
        assert (status, out) == (2, "")
        assert err == "error: ./loops.csv: is read, too, as loops.csv; give another file for the result\n"
    assert (folder / "record.csv").read_text(encoding="utf-8") == text


def test_an_old_result_stays_where_the_run_is_refused(folder: Path) -> None:
    (folder / "record.csv").write_text("sp,pv\n1,2\n", encoding="utf-8")
    (folder / "out.csv").write_text("old", encoding="utf-8")
    line = ("run", "fisher/provox", "GAIN=2", "RESET=4", "--record", "record.csv", "-o", "out.csv")
    assert said(*line, "--limits", "5,5").status == 2
    assert (folder / "out.csv").read_text(encoding="utf-8") == "old"
    assert said(*line).status == 0
    assert (folder / "out.csv").read_text(encoding="utf-8").startswith("sp,pv,emulated\n")
    assert sorted(path.name for path in folder.iterdir()) == ["out.csv", "record.csv"]


def test_what_is_skipped_of_a_record_is_said_and_its_comments_are_kept(folder: Path) -> None:
    (folder / "record.csv").write_text("# TIC-101\n\nsp,pv\n1,2\n", encoding="utf-8")
    line = ("run", "fisher/provox", "GAIN=2", "RESET=4", "--scan", "1", "--record", "record.csv", "-o", "out.csv")
    status, _, err = said(*line)
    assert status == 0
    assert "note: record.csv: skipped: 1 comment line above the header and 1 empty line\n" in err
    assert (folder / "out.csv").read_text(encoding="utf-8").startswith("# TIC-101\nsp,pv,emulated\n")


@pytest.mark.parametrize("name", ["plant.L5X", "loop.yaml"])
def test_a_loop_file_that_is_an_l5x_is_called_so(folder: Path, name: str) -> None:
    (folder / name).write_bytes(b"\xef\xbb\xbf<?xml version='1.0'?>\r\n<RSLogix5000Content SchemaRevision='1.0'>\r\n")
    assert said("convert", "--loop", name) == (
        1,
        "",
        f"error: {name}:1:1: an L5X file (XML that Logix Designer exports), not a loop file; "
        "a loop file is YAML text that states card: and settings:\n",
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty; a loop file is YAML text that states card: and settings:"),
        ("- 1\n", "the file is not a mapping; a loop file is YAML text that states card: and settings:"),
        ("card: a/b\nto: !x y\n", "tag '!x' is not used in loop files; remove it"),
        ("card: a/b\n---\ncard: a/b\n", "a second document; a loop file is one document, put it in a file of its own"),
    ],
)
def test_the_errors_of_a_loop_file_speak_of_a_loop_file(folder: Path, text: str, message: str) -> None:
    (folder / "loop.yaml").write_text(text, encoding="utf-8")
    status, out, err = said("convert", "--loop", "loop.yaml")
    assert (status, out) == (1, "")
    assert message in err


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_a_name_that_is_not_utf_8_is_read_and_written(folder: Path) -> None:
    record, target = (os.fsdecode(name) for name in (b"K\xfchler.csv", b"Erg\xe4nzt.csv"))
    (folder / record).write_text("# a\nsp,pv\n1,2\n", encoding="utf-8")
    status, _, err = said("run", "fisher/provox", "GAIN=2", "RESET=4", "--scan", "1", "--record", record, "-o", target)
    assert status == 0
    assert "note: K\\xfchler.csv: skipped: 1 comment line above the header\n" in err
    assert (folder / target).read_text(encoding="utf-8").startswith("# a\nsp,pv,emulated\n")


@POSIX
def test_a_loop_of_links_is_said_whatever_should_be_read(folder: Path) -> None:
    (folder / "x.yaml").symlink_to(folder / "x.yaml")
    for line in (
        ("check", "x.yaml"),
        ("show", "x.yaml"),
        ("convert", "--loop", "x.yaml"),
        ("verify", "x.yaml"),
        ("fleet", "x.yaml"),
        ("run", "fisher/provox", "GAIN=2", "RESET=4", "--record", "x.yaml"),
        ("simulate", "fisher/provox", "GAIN=2", "RESET=4", "--process", "gain=1,lag=5", "-o", "x.yaml"),
    ):
        status, out, err = said(*line)
        assert status in (1, 2), line
        assert out in ("", "1 card, 1 problem\n"), line
        assert len(err.splitlines()) == 1, line
