"""The command that compares cards on the same signals."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest

import pidemu
from pidemu.records.standard import standard_record
from tests.checks.bench import VALID, written
from tests.cli.helpers import Said, said, strict_json, told

A = ("generic/standard", "K=2", "Ti=40")
B = ("generic/standard", "K=2", "Ti=40", "b=0.5")
USAGE = (
    "Usage: pidemu compare [OPTIONS] CARD [NAME=VALUE]... CARD [NAME=VALUE]...\n"
    "Try 'pidemu compare --help' for help.\n\nError: {}\n"
)
EXAMPLE = "pidemu compare fisher/provox GAIN=2 RESET=4 RATE=0.1 emerson/deltav GAIN=2 RESET=15 RATE=6"


def after(text: str, title: str) -> list[list[str]]:
    """Return the cells of the table below a title, split where there are two blanks or more."""
    lines = text.split(title)[1].split("\n\n", maxsplit=1)[0].splitlines()[1:]
    return [[cell.strip() for cell in line.split("  ") if cell.strip()] for line in lines if line.startswith("  ")]


RULES = "INTEGRAL_RULE=backward, DERIVATIVE_RULE=backward"


def test_differences_are_stated_overall_and_by_part_of_the_record() -> None:
    out = told("compare", *A, *B)
    assert out.splitlines()[:4] == [
        "standard record: 1,360 scans, 1359 s; moves of 4 %, 40 s each",
        "  card                  scan  settings",
        "  generic/standard       1 s  K=2 %/%, Ti=40 s, Td=0 s, Tf=0 s, b=1, c=1, " + RULES,
        "  generic/standard (2)   1 s  K=2 %/%, Ti=40 s, Td=0 s, Tf=0 s, b=0.5, c=1, " + RULES,
    ]
    parts = {row[0]: row[1:] for row in after(out, "Largest difference in each part of the record")}
    assert parts["setpoint steps"] == ["40 s", "160 s", "4"]  # 2 * (1 - 0.5) * 4 %
    assert parts["PV noise"] == ["520 s", "600 s", "none"]
    [_, overall] = after(out, "Difference from generic/standard [% of the output span]")
    expected = pidemu.compare([pidemu.load_card(c).settings(K=2, Ti=40, b=b) for c, b in ((A[0], 1), (A[0], 0.5))]).differences[0]
    assert overall == [
        "generic/standard (2)",
        f"{expected.largest:.3g}",
        expected.segment,
        f"{expected.time:g} s",
        f"{expected.rms:.3g}",
    ]


def test_bumps_and_time_at_the_limits_are_stated_for_every_card() -> None:
    out = told("compare", *A, "arduino/pid", "Kp=2", "Ki=0.05", "--limits", "0,100")
    moves = {row[0]: row[1:] for row in after(out, "What the output moves by at transfers")}
    assert moves["manual to automatic"] == ["960 s", "0", "-4.1"]  # P = -2 * 2 and the first integral step -0.1
    found = pidemu.compare(
        [pidemu.load_card(A[0]).settings(K=2, Ti=40), pidemu.load_card("arduino/pid").settings(Kp=2, Ki=0.05)],
        scan=1.0,
        output_limits=(0, 100),
    )
    spent = [[f"{run.playback.saturated(limit):g} s" for limit in ("low", "high")] for run in found.runs]
    assert [row[1:] for row in after(out, "Time at the output limits, in automatic")[1:]] == spent


def test_cards_that_do_the_same_differ_nowhere() -> None:
    out = told("compare", *A, "generic/series", "K=2", "Ti=40")
    assert after(out, "Difference from")[1] == ["generic/series", "none", "none"]
    assert {row[-1] for row in after(out, "Largest difference in each part")[1:]} == {"none"}


def test_three_cards_give_three_columns() -> None:
    out = told("compare", *A, "generic/series", "K=2", "Ti=40", "generic/parallel", "kp=2", "ki=0.05")
    assert after(out, "Largest difference in each part")[0] == ["from", "to", "generic/series", "generic/parallel"]


def test_settings_belong_to_the_card_before_them_and_a_file_is_a_card(folder: Path) -> None:
    written(folder, VALID)
    out = told(
        "compare", "nobody/bench.yaml", "GAIN=1", "RESET=20 s/repeat", "nobody/bench", "GAIN=3", "RESET=20", "--vendors", "."
    )
    first, second = out.splitlines()[2:4]
    assert "GAIN=1" in first
    assert second.startswith("  nobody/bench")
    assert "GAIN=3" in second


def test_all_outputs_are_written_as_columns(folder: Path) -> None:
    assert said("compare", *A, *B, "-o", "out.csv").status == 0
    with (folder / "out.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == ["time", "sp", "pv", "auto", "manual", "generic/standard", "generic/standard (2)"]
    record = standard_record(1.0, time=40.0, size=4.0)
    assert [float(row["sp"]) for row in rows] == record.sp.tolist()
    assert (rows[0]["manual"], rows[850]["manual"]) == ("", "60.0")
    controller = pidemu.Controller(pidemu.load_card(A[0]).settings(K=2, Ti=40), 1.0, initial_output=50.0)
    expected = controller.run(record.sp, record.pv, record.auto, record.manual)
    assert [float(row["generic/standard"]) for row in rows] == expected.tolist()


def test_what_is_written_is_a_record_that_runs_again(folder: Path) -> None:
    assert said("compare", *A, *B, "-o", "out.csv").status == 0
    text = (folder / "out.csv").read_text(encoding="utf-8").replace("generic/standard,", "output,", 1)
    (folder / "again.csv").write_text(text, encoding="utf-8")
    err = said("run", *A, "--record", "again.csv", "-o", "x.csv").err
    assert err.splitlines()[-1].startswith("largest difference from the recorded output: 0 in sample 0")


def test_a_recorded_file_keeps_its_columns_and_gets_the_outputs(folder: Path) -> None:
    (folder / "record.csv").write_text("time,sp,pv,note\n0,50,50,a\n2,51,50,\n", encoding="utf-8")
    status, out, err = said("compare", *A, *B, "--record", "record.csv", "-o", "out.csv")
    assert (status, err) == (0, "")
    assert out.splitlines()[0] == "record.csv: 2 scans, 2 s"
    assert [row[:2] for row in after(out, "Largest difference in each part")[1:]] == [["automatic", "0 s"]]
    rows = list(csv.reader(io.StringIO((folder / "out.csv").read_text(encoding="utf-8"))))
    assert rows[0] == ["time", "sp", "pv", "note", "generic/standard", "generic/standard (2)"]
    assert rows[2][:4] == ["2", "51", "50", ""]
    assert [float(x) for x in rows[2][4:]] == pytest.approx([2 + 2 * 2 / 40, 1 + 2 * 2 / 40])


def test_the_interval_of_a_record_without_time_is_noted(folder: Path) -> None:
    (folder / "record.csv").write_text("sp,pv\n50,50\n51,50\n", encoding="utf-8")
    assert said("compare", *A, *B, "--record", "record.csv", "--scan", "3").err == (
        "note: record.csv has no time column; its lines are taken to be 3 s apart\n"
    )


def test_an_initial_output_may_be_given(folder: Path) -> None:
    (folder / "record.csv").write_text("time,sp,pv\n0,50,50\n1,50,50\n", encoding="utf-8")
    words = ("--record", "record.csv", "--initial-output", "33", "-o", "out.csv")
    assert said("compare", *A, *B, *words).status == 0
    assert (folder / "out.csv").read_text(encoding="utf-8").splitlines()[1] == "0,50,50,33.0,33.0"


def test_a_scan_interval_of_each_is_shown_with_it() -> None:
    out = told("compare", *A, *A, "--scan", "1,0.25")
    assert [line.split("  ")[-2].strip() for line in out.splitlines()[2:4]] == ["1 s", "0.25 s"]


def test_json_is_what_python_gives() -> None:
    settings = [pidemu.load_card(A[0]).settings(K=2, Ti=40, **more) for more in ({}, {"b": 0.5})]
    assert strict_json(told("compare", *A, *B, "--json")) == pidemu.compare(settings).to_dict()


def test_notes_go_to_stderr_in_json_as_well() -> None:
    words = ("compare", *A, "bailey/fc18", "K=1", "KP=2", "KI=1", "--json")
    status, out, err = said(*words)
    assert status == 0
    assert [f"note: {note}" for note in strict_json(out)["notes"]] == err.splitlines()
    assert err.startswith("note: the output limits differ: generic/standard 0 to 100, bailey/fc18 -5 to 105 %; ")


def test_a_long_table_ends_with_how_many_more_there_are(folder: Path) -> None:
    rows = "".join(f"{i},50,50,{i % 2},40\n" for i in range(1, 31))
    (folder / "record.csv").write_text("time,sp,pv,auto,manual\n" + rows, encoding="utf-8")
    out = told("compare", *A, *B, "--record", "record.csv")
    assert out.count("  and 10 more; --json lists all\n") == 1  # 30 spells; all but the first of the 30 transfers move nothing
    assert len(after(out, "Largest difference in each part")) == 1 + 20 + 1


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("", f"no card is given, and a comparison needs two; for example: {EXAMPLE}"),
        ("generic/standard K=2 Ti=40", f"one card is given, and a comparison needs two; for example: {EXAMPLE}"),
        ("K=2 generic/standard", f"'K=2' comes before any card; write for example: {EXAMPLE}"),
        ("provox GAIN=2 generic/standard", "'provox' is neither a card, such as emerson/deltav, nor a setting, such as GAIN=2"),
        ("generic/standard K=2 Ti", "'Ti' is neither a card, such as emerson/deltav, nor a setting, such as GAIN=2"),
        (
            "generic/standard K=2 Ti=40 generic/standard K=2 Ti=40 --scan 1,2,3",
            "3 scan intervals for 2 cards; give one for all, or one for each",
        ),
        (
            "generic/standard K=2 Ti=40 generic/standard K=2 Ti=40 --scan 1,fast",
            "Invalid value for '--scan': '1,fast' is not a scan interval; write seconds, such as 0.5, or 1,0.5 for one per card",
        ),
        (
            "generic/standard K=2 Ti=40 generic/standard K=2 Ti=40 --scan 0",
            "Invalid value for '--scan': '0' is not a scan interval; write seconds, such as 0.5, or 1,0.5 for one per card",
        ),
    ],
)
def test_wrong_usage_is_said_with_the_usage_and_status_2(line: str, message: str) -> None:
    assert said("compare", *line.split()) == Said(2, "", USAGE.format(message))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            (*A, "generic/standrad", "K=2"),
            "no card 'generic/standrad' (did you mean 'generic/standard'?); 'pidemu cards' lists them",
        ),
        ((*A, "generic/standard", "Ti=4"), "generic/standard: K: missing; it sets the gain (gain of all terms), in %/%"),
        ((*A, *A, "k=3"), "k is given twice, 2 and 3; give it once"),
        ((*A, *B, "--record", "none.csv"), "none.csv: cannot be read: No such file or directory"),
        ((*A, *B, "-o", "nowhere/x.csv"), "nowhere/x.csv: cannot be written: No such file or directory"),
        ((*A, *B, "--plot", "x.pdf"), "x.pdf: pictures are written as .png or .svg; give the file such an ending"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_message_with_status_2(words: tuple[str, ...], message: str) -> None:
    assert said("compare", *words) == Said(2, "", f"error: {message}\n")


def test_an_uneven_record_is_refused_by_the_card_that_cannot_follow_it(folder: Path) -> None:
    (folder / "record.csv").write_text("time,sp,pv\n0,50,50\n1,50,50\n3,50,50\n4,50,50\n", encoding="utf-8")
    status, out, err = said("compare", "epics/epid", "KP=1", "KI=1", *A, "--record", "record.csv")
    assert (status, out) == (2, "")
    assert err.startswith("error: record.csv: the time column goes on by 2 s after sample 1 (counted from 0), elsewhere by 1 s; ")
    assert "since generic/standard computes with a fixed interval" in err
    assert said("compare", "epics/epid", "KP=1", "KI=1", *A, "--record", "record.csv", "--scan", "1").status == 0


def test_the_example_that_is_given_with_an_error_runs() -> None:
    assert float(after(told(*EXAMPLE.split()[1:]), "Difference from")[1][1]) > 1
