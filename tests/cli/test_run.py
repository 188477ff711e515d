"""The command that runs a card on recorded signals."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import pytest

import pidemu
from tests.cli.helpers import Said, said

PI_SETTINGS = pidemu.load_card("generic/standard").settings(K=2, Ti=10)
PI = ("run", "generic/standard", "K=2", "Ti=10", "--scan", "1")
RECORD = "sp,pv\n50,50\n51,50\n51,50.5\n51,51.25\n"


def recorded(folder: Path, text: str, *words: str) -> Said:
    (folder / "record.csv").write_text(text, encoding="utf-8")
    result = said(*PI, "--record", "record.csv", *words)
    assert result.status == 0, result.err
    return result


def emulated(out: str) -> list[float]:
    return [float(row["emulated"]) for row in csv.DictReader(io.StringIO(out))]


def expected(sp: list[float], pv: list[float], **arguments: float) -> list[float]:
    settings = pidemu.load_card("generic/standard").settings(K=2, Ti=10)
    controller = pidemu.Controller(settings, 1.0, initial_output=arguments.get("initial_output", 0.0))
    return [controller.scan(a, b) for a, b in zip(sp, pv, strict=True)]


SP, PV = [50.0, 51.0, 51.0, 51.0], [50.0, 50.0, 50.5, 51.25]


def test_run_writes_the_record_with_one_more_column(folder: Path) -> None:
    _, out, err = recorded(folder, RECORD)
    assert out.splitlines()[:3] == ["sp,pv,emulated", "50,50,0.0", "51,50,2.2"]
    assert expected(SP, PV) == emulated(out)
    assert err == "4 scans of 1 s, reverse acting\n"


def test_the_scan_interval_is_that_of_record_and_controller(folder: Path) -> None:
    _, out, err = recorded(folder, RECORD, "--scan", "0.5")
    assert emulated(out)[1] == pytest.approx(2 + 2 * 0.5 / 10, rel=1e-15)
    assert err == "4 scans of 0.5 s, reverse acting\n"


def test_direct_action_moves_the_output_the_other_way(folder: Path) -> None:
    up = emulated(recorded(folder, RECORD, "--initial-output", "50").out)
    _, out, err = recorded(folder, RECORD, "--initial-output", "50", "--action", "direct")
    assert [100 - u for u in up] == pytest.approx(emulated(out), rel=1e-15)
    assert err == "4 scans of 1 s, direct acting\n"


def test_limits_hold_the_output(folder: Path) -> None:
    assert emulated(recorded(folder, RECORD, "--limits", "0.5,1.5").out)[:2] == [0.5, 1.5]
    assert emulated(recorded(folder, RECORD.replace("51,50\n", "40,50\n"), "--limits", "-10,10").out)[1] == -10


def test_the_bias_is_the_output_of_a_controller_without_integral(folder: Path) -> None:
    (folder / "record.csv").write_text(RECORD, encoding="utf-8")
    result = said("run", "generic/standard", "K=2", "Ti=inf", "--record", "record.csv", "--bias", "30")
    assert emulated(result.out) == [30, 32, 31, 29.5]


def test_a_recorded_output_is_where_the_emulation_starts_and_what_it_is_compared_with(folder: Path) -> None:
    text = "sp,pv,OP\n50,50,40\n51,50,42.2\n51,50.5,41.3\n51,51.25,39\n"
    _, out, err = recorded(folder, text)
    assert out.splitlines()[:2] == ["sp,pv,OP,emulated", "50,50,40,40.0"]
    found = expected(SP, PV, initial_output=40.0)
    assert found == emulated(out)
    assert err.splitlines()[1] == (
        f"largest difference from the recorded output: {abs(found[3] - 39):.6g} in sample 3 (counted from 0): "
        f"emulated {found[3]:.8g}, recorded 39"
    )


def test_an_empty_recorded_output_is_not_compared(folder: Path) -> None:
    err = recorded(folder, "sp,pv,out\n50,50,\n51,50,2\n51,50,\n").err
    assert "in sample 1 (counted from 0)" in err
    assert recorded(folder, "sp,pv,out\n50,50,\n").err.splitlines()[1] == "the recorded output is empty throughout"


def test_an_initial_output_given_counts_before_the_recorded_one(folder: Path) -> None:
    assert emulated(recorded(folder, "sp,pv,out\n50,50,40\n", "--initial-output", "30").out) == [30]


def test_in_manual_the_output_is_the_operator_s_and_is_held_where_none_is_set(folder: Path) -> None:
    text = "sp,pv,mode,auto,man\n50,50,x,0,20\n50,40,x,manual,\n50,40,x,no,25\n40,40,x,1,\n41,40,x,auto,\n"
    _, out, _ = recorded(folder, text)
    assert emulated(out) == [20, 20, 25, 25, 27.2]


def test_comments_and_empty_lines_are_passed_over(folder: Path) -> None:
    text = "# trend of TIC-101, 1 s\n\n" + RECORD.replace("51,50.5", "  # operator changed the setpoint\n51,50.5")
    assert recorded(folder, RECORD).out == recorded(folder, text).out


def test_columns_are_found_by_name_in_any_order_and_case(folder: Path) -> None:
    text = "time,Measurement, SetPoint \n0,50,50\n1,50,51\n2,50.5,51\n3,51.25,51\n"
    _, out, _ = recorded(folder, text)
    assert out.splitlines()[0] == "time,Measurement,SetPoint,emulated"
    assert expected(SP, PV) == emulated(out)


def test_cells_of_other_columns_are_kept_as_they_stand(folder: Path) -> None:
    _, out, _ = recorded(folder, 'sp,pv,note\n50,50,"a, ""b"""\n50,50,\n')
    assert out.splitlines()[1:] == ['50,50,"a, ""b""",0.0', "50,50,,0.0"]


def test_the_output_file_holds_what_would_be_printed(folder: Path) -> None:
    printed = recorded(folder, RECORD).out
    status, out, err = recorded(folder, RECORD, "-o", "out.csv")
    assert (status, out, err) == (0, "", "4 scans of 1 s, reverse acting\n")
    assert (folder / "out.csv").read_bytes() == printed.encode()


def test_what_is_written_can_be_run_again(folder: Path) -> None:
    recorded(folder, RECORD, "-o", "out.csv")
    again = said(*PI, "--record", "out.csv")
    assert again.status == 0
    assert again.out.splitlines()[0] == "sp,pv,emulated,emulated"


def test_a_file_from_a_spreadsheet_may_start_with_a_byte_order_mark(folder: Path) -> None:
    (folder / "record.csv").write_text(RECORD.replace("\n", "\r\n"), encoding="utf-8-sig", newline="")
    assert expected(SP, PV) == emulated(said(*PI, "--record", "record.csv").out)


def test_what_was_read_in_another_unit_is_noted(folder: Path) -> None:
    (folder / "record.csv").write_text(RECORD, encoding="utf-8")
    err = said("run", "generic/standard", "K=2", "Ti=0.5 min", "--scan", "1", "--record", "record.csv").err
    assert err == "note: Ti: 0.5 min is 30 s\n4 scans of 1 s, reverse acting\n"


def test_every_output_reads_back_as_the_same_number(folder: Path) -> None:
    sp = [50 + math.sin(i / 3) for i in range(50)]
    text = "sp,pv\n" + "".join(f"{x!r},50\n" for x in sp)
    assert expected(sp, [50.0] * 50) == emulated(recorded(folder, text).out)


LOOP = ("run", "generic/standard", "K=2", "Ti=10", "--record", "record.csv")


def noted(folder: Path, text: str, *words: str) -> list[str]:
    (folder / "record.csv").write_text(text, encoding="utf-8")
    result = said(*words)
    assert result.status == 0
    return [line.removeprefix("note: ") for line in result.err.splitlines() if line.startswith("note: ")]


def test_the_interval_of_a_time_column_is_the_scan_interval(folder: Path) -> None:
    (folder / "record.csv").write_text("time,sp,pv\n0,50,50\n10,51,50\n20,51,50\n", encoding="utf-8")
    result = said(*LOOP)
    assert result.err == "3 scans of 10 s, reverse acting\n"
    assert emulated(result.out) == list(pidemu.Controller(PI_SETTINGS, 10.0).run([50, 51, 51], 50))


def test_timestamps_are_a_time_column_too(folder: Path) -> None:
    rows = "".join(f"2026-11-22T08:00:{s:02d},50,50\n" for s in (0, 5, 10))
    (folder / "record.csv").write_text("timestamp,sp,pv\n" + rows, encoding="utf-8")
    assert said(*LOOP).err == "3 scans of 5 s, reverse acting\n"


@pytest.mark.parametrize(
    ("times", "words", "message"),
    [
        (
            ("0", "1", "2", "4"),
            (),
            "record.csv: the time column goes on by 2 s after sample 2 (counted from 0), elsewhere by 1 s; ",
        ),
        (
            ("0", "2", "4"),
            ("--scan", "1"),
            "record.csv: the time column has a step of 2 s, --scan says 1 s; leave --scan out, or the column",
        ),
        (("0", "1", "noon"), (), "record.csv:4: column time: 'noon' is neither a number of seconds nor a timestamp such as "),
        (("2", "1", "0"), (), "record.csv: the time column goes on by -1 s"),
    ],
    ids=["uneven", "contradicted", "no time", "backwards"],
)
def test_a_time_column_that_is_no_steady_clock_is_refused(
    folder: Path, times: tuple[str, ...], words: tuple[str, ...], message: str
) -> None:
    (folder / "record.csv").write_text("time,sp,pv\n" + "".join(f"{t},50,50\n" for t in times), encoding="utf-8")
    result = said(*LOOP, *words)
    assert (result.status, result.out) == (2, "")
    assert result.err.startswith(f"error: {message}")


def test_an_interval_that_nobody_states_is_noted(folder: Path) -> None:
    [note] = noted(folder, "sp,pv\n50,50\n", *LOOP)
    assert note == "the scan interval is the card's default, 1 s: the record has no time column, and --scan is not given"


def test_in_manual_the_recorded_output_is_followed_where_nothing_else_is_recorded(folder: Path) -> None:
    text = "sp,pv,auto,output\n50,50,0,40\n50,50,0,42\n50,50,0,44\n50,50,1,44\n"
    notes = noted(folder, text, *LOOP, "--scan", "1")
    assert notes == ["in manual the recorded output is taken for the operator's: the record has no column 'manual'"]
    assert emulated(said(*LOOP, "--scan", "1").out) == [40, 42, 44, 44]


def test_manual_outputs_beyond_the_limits_are_noted(folder: Path) -> None:
    notes = noted(folder, "sp,pv,auto,manual\n50,50,0,150\n50,50,0,-1\n50,50,1,0\n", *LOOP, "--scan", "1")
    assert notes == ["in 2 samples the manual output is outside the output limits; it is taken as it is"]


def test_a_controller_without_integral_and_bias_is_noted(folder: Path) -> None:
    words = ("run", "fisher/provox", "GAIN=2", "RESET=off", "--scan", "1", "--record", "record.csv")
    off, *notes = noted(folder, "sp,pv\n50,45\n", *words)
    assert off.startswith("RESET: off is 0")
    assert notes == ["there is no integral: in automatic the output is the terms alone, with a bias of 0; give --bias"]
    assert [n for n in noted(folder, "sp,pv\n50,45\n", *words, "--bias", "40") if "integral" in n] == []
