"""The command that runs a card on recorded signals."""

from __future__ import annotations

import contextlib
import csv
import io
import itertools
import math
from pathlib import Path

import pytest

import pidemu
from pidemu.cli import main
from tests.cli.helpers import Said, said, strict_json

PI_SETTINGS = pidemu.load_card("generic/standard").settings(K=2, Ti=10)
PI = ("run", "generic/standard", "K=2", "Ti=10", "--scan", "1")
RECORD = "sp,pv\n50,50\n51,50\n51,50.5\n51,51.25\n"


def recorded(folder: Path, text: str, *words: str) -> Said:
    (folder / "record.csv").write_text(text, encoding="utf-8")
    result = said(*PI, "--record", "record.csv", *words)
    assert result.status == 0, result.err
    return result


def first(err: str) -> str:
    """The first line on stderr; a table of what happened may follow."""
    return err.splitlines()[0]


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
    assert first(err) == "4 scans of 1 s, reverse acting"


def test_the_scan_interval_is_that_of_record_and_controller(folder: Path) -> None:
    _, out, err = recorded(folder, RECORD, "--scan", "0.5")
    assert emulated(out)[1] == pytest.approx(2 + 2 * 0.5 / 10, rel=1e-15)
    assert first(err) == "4 scans of 0.5 s, reverse acting"


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


@pytest.mark.filterwarnings("error")
def test_a_recorded_output_whose_square_overflows_is_compared(folder: Path) -> None:
    _, _, err = recorded(folder, "sp,pv,auto,manual,out\n50,50,0,1,1\n50,50,1,1,1e200\n")
    assert "largest difference from the recorded output: 1e+200 in sample 1" in err


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("outputs", "said_of_them"),
    [(("", "1"), "0 in sample 1 (counted from 0): emulated 1, recorded 1"), (("1", "1e20"), "1e+20 in sample 1")],
)
def test_the_largest_difference_is_of_a_sample_with_a_recorded_output(
    folder: Path, outputs: tuple[str, str], said_of_them: str
) -> None:
    text = "sp,pv,auto,out\n50,50,0,{}\n50,50,1,{}\n".format(*outputs)
    _, _, err = recorded(folder, text, "--initial-output", "1")
    assert f"largest difference from the recorded output: {said_of_them}" in err


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
    assert recorded(folder, "sp,pv,out\n50,50,\n").err.splitlines()[-1] == "the recorded output is empty throughout"


def test_an_initial_output_given_counts_before_the_recorded_one(folder: Path) -> None:
    assert emulated(recorded(folder, "sp,pv,out\n50,50,40\n", "--initial-output", "30").out) == [30]


def test_in_manual_the_output_is_the_operator_s_and_is_held_where_none_is_set(folder: Path) -> None:
    text = "sp,pv,mode,auto,man\n50,50,x,0,20\n50,40,x,manual,\n50,40,x,no,25\n40,40,x,1,\n41,40,x,auto,\n"
    _, out, _ = recorded(folder, text)
    assert emulated(out) == [20, 20, 25, 25, 27.2]


def test_comments_and_empty_lines_are_passed_over(folder: Path) -> None:
    text = "# trend of TIC-101, 1 s\n\n" + RECORD.replace("51,50.5", "\n51,50.5")
    assert f"# trend of TIC-101, 1 s\n{recorded(folder, RECORD).out}" == recorded(folder, text).out


def test_columns_are_found_by_name_in_any_order_and_case(folder: Path) -> None:
    text = "time,Measurement, SetPoint \n0,50,50\n1,50,51\n2,50.5,51\n3,51.25,51\n"
    _, out, _ = recorded(folder, text)
    assert out.splitlines()[0] == "time,Measurement,SetPoint,emulated"
    assert expected(SP, PV) == emulated(out)


def test_cells_of_other_columns_are_kept_as_they_stand(folder: Path) -> None:
    _, out, _ = recorded(folder, 'sp,pv,note\n50,50,"a, ""b"""\n50,50,\n')
    assert out.splitlines()[1:] == ['50,50,"a, ""b""",0.0', "50,50,,0.0"]


def test_the_output_file_holds_what_would_be_printed(folder: Path) -> None:
    printed = recorded(folder, RECORD, "--initial-output", "40").out
    status, out, err = recorded(folder, RECORD, "-o", "out.csv", "--initial-output", "40")
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
    words = ("K=2", "Ti=0.5 min", "--scan", "1", "--record", "record.csv", "--initial-output", "40")
    err = said("run", "generic/standard", *words).err
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
    assert first(result.err) == "3 scans of 10 s, reverse acting"
    assert emulated(result.out) == list(pidemu.Controller(PI_SETTINGS, 10.0).run([50, 51, 51], 50))


def test_timestamps_are_a_time_column_too(folder: Path) -> None:
    rows = "".join(f"2026-11-22T08:00:{s:02d},50,50\n" for s in (0, 5, 10))
    (folder / "record.csv").write_text("timestamp,sp,pv\n" + rows, encoding="utf-8")
    assert first(said(*LOOP).err) == "3 scans of 5 s, reverse acting"


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
    assert notes == ["without integral action the output in automatic is the terms alone, with a bias of 0; give --bias"]
    assert [n for n in noted(folder, "sp,pv\n50,45\n", *words, "--bias", "40") if "integral" in n] == []


# --- signals beyond setpoint, measurement and mode ---------------------------------------------------------------------


def test_a_remote_setpoint_an_output_to_follow_and_a_hold_are_columns(folder: Path) -> None:
    text = "sp,pv,RSP,tracking,hold\n50,50,,,\n50,50,51,,\n50,50,51,,0\n50,50,,60,no\n50,50,,,1\n50,50,,,\n"
    _, out, err = recorded(folder, text, "--initial-output", "40")
    # cascade: K e = 2 and K h e/Ti = 0.2 per scan with e = 1; tracking 60; held; a transfer without bump
    assert emulated(out) == pytest.approx([40, 42.2, 42.4, 60, 60, 60], rel=1e-15)
    assert [line.split(maxsplit=2)[2].strip() for line in err.splitlines()[2:6]] == [
        "automatic to cascade             +2.2",
        "cascade to tracking             +17.6",
        "tracking to hold                    0",
        "hold to automatic                   0",
    ]
    assert err.splitlines()[6] == "largest bump into automatic or cascade: +2.2 in scan 1 (automatic to cascade)"


def test_feedforward_and_external_reset_go_to_the_cards_that_have_them(folder: Path) -> None:
    (folder / "record.csv").write_text("sp,pv,FF\n0,0,0\n0,0,0.25\n", encoding="utf-8")
    on_record = ("--scan", "1", "--record", "record.csv")
    assert emulated(said("run", "modelica/limpid", "k=2", "Ti=10", "Td=0", *on_record).out) == [0, 0.25]
    (folder / "record.csv").write_text("sp,pv,ext_reset\n50,50,\n51,50,90\n51,50,90\n", encoding="utf-8")
    out = said("run", "fisher/provox", "GAIN=2", "RESET=6", "--initial-output", "40", *on_record).out
    # the integral is a lag of 10 s fed with the reset signal, backward: I += (90 - I)/11 after the first such scan
    sum_before = 2 + 40 + 2 / 10
    after = 42.2 - 2 + (90 - 42.2) / 11
    assert emulated(out) == pytest.approx([40, sum_before, after + 2 / 10 + 2], rel=1e-12)


@pytest.mark.parametrize(
    ("column", "reason"),
    [
        ("FF", "generic/standard states no feedforward input; leave the column out"),
        ("reset_signal", "generic/standard takes no external reset: its windup scheme is 'back-calculation'; leave the column out"),
    ],
)
def test_a_signal_that_the_card_has_no_use_for_is_refused_by_its_column(folder: Path, column: str, reason: str) -> None:
    (folder / "record.csv").write_text(f"sp,pv,{column}\n50,50,\n50,50,1\n", encoding="utf-8")
    assert said(*PI, "--record", "record.csv") == Said(2, "", f"error: record.csv: column {column}: {reason}\n")
    (folder / "record.csv").write_text(f"sp,pv,{column}\n50,50,\n50,50,\n", encoding="utf-8")
    assert said(*PI, "--record", "record.csv").status == 0  # empty throughout: no signal


def test_a_column_of_modes_in_place_of_a_remote_setpoint_is_noted(folder: Path) -> None:
    [note] = noted(folder, "sp,pv,cas\n50,50,0\n50,50,1\n", *PI, "--record", "record.csv")
    assert note == "column cas holds 0 and 1 only; it is taken for the remote setpoint, not for a mode"


def test_a_measurement_that_is_no_number_holds_the_output_and_is_told_once_per_spell(folder: Path) -> None:
    text = "sp,pv\n50,50\n51,50\n51,nan\n51,NaN\n51,-inf\n51,50\n"
    _, out, err = recorded(folder, text, "--initial-output", "40")
    assert emulated(out) == pytest.approx([40, 42.2, 42.2, 42.2, 42.2, 42.4], rel=1e-15)
    assert err.splitlines()[2:] == [
        "  2 to 3         2  measurement is nan: output held",
        "       4         4  measurement is -inf: output held",
    ]


def test_an_action_that_the_card_does_not_offer_is_noted(folder: Path) -> None:
    words = ("run", "advanced-pid/advanced-pid", "Kp=2", "Ki=1", "Kd=0", "Tf=0", "--scan", "1", "--record", "record.csv")
    [note] = noted(folder, RECORD, *words, "--action", "direct")
    assert note == "advanced-pid/advanced-pid has no choice of action: the sign of the gain decides"
    assert noted(folder, RECORD, *words) == []


def test_a_remark_that_comes_back_later_is_told_again(folder: Path) -> None:
    _, _, err = recorded(folder, "sp,pv\n50,50\n50,nan\n50,50\n50,nan\n50,nan\n", "--initial-output", "40")
    assert [line.split("  m")[0].split() for line in err.splitlines()[2:]] == [["1", "1"], ["3", "to", "4", "3"]]


# --- scans that come unevenly -----------------------------------------------------------------------------------------

MEASURES = ("run", "epics/epid", "KP=2", "KI=0.1", "--initial-output", "40", "--record", "record.csv")
"""EPICS: dI = KP KI dt e, KI in repeats per second; it measures dt."""


@pytest.mark.parametrize("header", ["time", "interval", "dt"])
def test_a_card_that_measures_the_interval_follows_uneven_scans(folder: Path, header: str) -> None:
    cells = ("0", "1", "2", "4.5", "5.5") if header == "time" else ("", "1", "1", "2.5", "")
    rows = [f"{cell},{sp},50" for cell, sp in zip(cells, (50, 51, 51, 51, 51), strict=True)]
    (folder / "record.csv").write_text(f"{header},sp,pv\n" + "\n".join(rows) + "\n", encoding="utf-8")
    result = said(*MEASURES)
    assert result.err.splitlines()[0] == "5 scans of 1 s, as the intervals were recorded, reverse acting"
    steps = [b - a for a, b in itertools.pairwise(emulated(result.out))]
    assert steps == pytest.approx([2 + 2 * 0.1, 2 * 0.1, 2 * 0.1 * 2.5, 2 * 0.1], rel=1e-12)


def test_a_time_column_with_little_jitter_is_even(folder: Path) -> None:
    (folder / "record.csv").write_text("time,sp,pv\n0,50,50\n1.004,51,50\n2,51,50\n", encoding="utf-8")
    assert said(*MEASURES).err.splitlines()[0] == "3 scans of 1 s, reverse acting"


def test_what_to_do_about_an_uneven_record_is_said(folder: Path) -> None:
    (folder / "record.csv").write_text("dt,sp,pv\n,50,50\n1,50,50\n3,50,50\n1,50,50\n", encoding="utf-8")
    assert said(*PI, "--record", "record.csv") == Said(
        2,
        "",
        "error: record.csv: the column dt goes on by 3 s after sample 1 (counted from 0), elsewhere by 1 s; one line per scan is "
        "needed, since generic/standard computes with a fixed interval: bring the record to even steps, or, if every line is a "
        "scan of the controller, leave the column out and give --scan\n",
    )


def test_time_that_never_goes_on_is_refused_by_every_card(folder: Path) -> None:
    (folder / "record.csv").write_text("time,sp,pv\n2,50,50\n1,50,50\n", encoding="utf-8")
    result = said(*MEASURES)
    assert (result.status, result.out) == (2, "")
    assert result.err.endswith(
        "goes on by -1 s after sample 0 (counted from 0); one line per scan is needed, in the order of time\n"
    )


# --- initial states ----------------------------------------------------------------------------------------------------


def test_initial_states_set_what_the_controller_goes_on_from(folder: Path) -> None:
    _, out, _ = recorded(folder, RECORD, "--initial", "I=30", "--initial", "output=35")
    assert emulated(out)[:2] == pytest.approx([30, 30 + 0.2 + 2], rel=1e-15)  # no transfer: P + I, not 35


def test_an_initial_output_by_its_state_is_the_initial_output(folder: Path) -> None:
    assert recorded(folder, RECORD, "--initial", "u=40").out == recorded(folder, RECORD, "--initial-output", "40").out


def test_states_that_are_left_at_zero_are_noted_when_the_controller_goes_on(folder: Path) -> None:
    words = ("run", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--scan", "1", "--record", "record.csv")
    [note] = noted(folder, RECORD, *words, "--initial", "I=30")
    assert note.startswith("with I given the controller goes on as if it had been running; what else it holds is 0: ")
    assert noted(folder, RECORD, *words, "--initial", "u=30") == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--initial", "J=1"), "--initial J: no such state; states: u, on, I, output"),
        (("--initial", "outptu=1"), "--initial outptu: no such state (did you mean 'output'?); states: u, on, I, output"),
        (("--initial", "I=high"), "--initial I: 'high' is not a number"),
        (("--initial", "I=nan"), "--initial I is nan; give a finite number"),
        (
            ("--initial", "I=1e300"),
            "--initial I: 1e+300 % is not a signal or a rate that a loop has, 0 to 1e+40 % in size; check the number and its unit",
        ),
        (("--initial", "I"), "'I' is not NAME=VALUE after --initial; write for example I=30"),
        (("--initial", "u=1", "--initial", "output=2"), "the output before the first scan is given twice; give it once"),
        (("--initial", "u=1", "--initial-output", "2"), "the output before the first scan is given twice; give it once"),
    ],
)
def test_an_initial_state_that_is_none_is_refused(folder: Path, words: tuple[str, ...], message: str) -> None:
    (folder / "record.csv").write_text(RECORD, encoding="utf-8")
    assert said(*PI, "--record", "record.csv", *words) == Said(2, "", f"error: {message}\n")


# --- what happened -----------------------------------------------------------------------------------------------------


def test_transfers_and_spells_at_a_limit_are_told(folder: Path) -> None:
    rows = ["50,50,1,", "90,50,1,", "90,50,1,", "90,50,0,30", "90,50,0,30", "90,50,1,", "10,50,1,"]
    _, _, err = recorded(folder, "sp,pv,auto,manual\n" + "\n".join(rows) + "\n", "--initial-output", "50", "--scan", "2")
    assert err.splitlines() == [
        "7 scans of 2 s, reverse acting",
        "    scan  time [s]  what happened        output moves by",
        "  1 to 2         2  at the high limit",
        "       3         6  automatic to manual              -70",
        "       5        10  manual to automatic                0",
        "       6        12  at the low limit",
    ]


def test_a_long_table_ends_with_how_many_more_there_are(folder: Path) -> None:
    rows = "".join(f"50,50,{i % 2},40\n" for i in range(1, 21))
    err = recorded(folder, "sp,pv,auto,manual\n" + rows, "--initial-output", "40").err.splitlines()
    assert len(err) == 1 + 1 + 12 + 1
    assert err[-1] == "  and 7 more; --json lists all"  # 19 transfers after the first scan, which moves nothing


def test_json_holds_outputs_events_saturation_and_difference(folder: Path) -> None:
    text = "sp,pv,auto,output\n50,50,1,40\n90,50,1,41\n90,nan,1,100\n90,50,0,30\n90,50,1,\n"
    status, out, err = recorded(folder, text, "--json")
    found = strict_json(out)
    assert (status, found["card"], found["scan"], found["options"]) == (
        0, "generic/standard", 1.0, {"INTEGRAL_RULE": "backward", "DERIVATIVE_RULE": "backward"},
    )  # fmt: skip
    assert found["settings"]["Ti"] == {"value": 10.0, "unit": "s"}
    assert found["outputs"] == pytest.approx([40, 100, 100, 30, 30])
    assert found["events"] == [
        {"scan": 0, "kind": "transfer", "text": "power-up to automatic", "bump": 0.0},
        {"scan": 2, "kind": "signal", "text": "measurement is nan: output held", "bump": 0.0},
        {"scan": 3, "kind": "transfer", "text": "automatic to manual", "bump": -70.0},
        {"scan": 4, "kind": "transfer", "text": "manual to automatic", "bump": 0.0},
    ]
    assert found["saturations"] == [{"from": 1, "to": 2, "limit": "high"}]
    assert found["difference"] == {"largest": 59.0, "scan": 1, "emulated": 100.0, "recorded": 41.0, "rms": 59 / 2}
    assert err.splitlines()[-2:] == [
        "5 scans of 1 s, reverse acting",
        "largest difference from the recorded output: 59 in sample 1 (counted from 0): emulated 100, recorded 41",
    ]


def test_json_goes_to_the_screen_and_the_record_to_its_file(folder: Path) -> None:
    out = recorded(folder, RECORD, "--json", "-o", "out.csv").out
    assert strict_json(out)["outputs"] == emulated((folder / "out.csv").read_text(encoding="utf-8"))
    assert strict_json(out)["difference"] is None


def test_an_engine_is_forced_and_named_and_gives_the_same_outputs(folder: Path) -> None:
    plain = recorded(folder, RECORD)
    assert "engine" not in plain.err
    for engine in ("python", "numpy"):
        forced = recorded(folder, RECORD, "--engine", engine)
        assert forced.out == plain.out
        assert forced.err.splitlines()[:2] == ["4 scans of 1 s, reverse acting", f"engine: {engine} (asked for)"]


def test_the_choice_of_the_engine_is_told_with_its_reason(folder: Path) -> None:
    err = recorded(folder, RECORD, "--engine", "auto").err
    assert err.splitlines()[1] == "engine: python (too short to be worth a call into compiled code)"
    found = strict_json(recorded(folder, RECORD, "--json").out)
    assert found["engine"] == {"name": "python", "reason": "too short to be worth a call into compiled code"}


@pytest.mark.parametrize("terminal", [False, True])
def test_what_a_record_hides_is_written_out_on_a_terminal_and_kept_in_a_pipe(terminal: bool, tmp_path: Path) -> None:
    class Screen(io.StringIO):
        def isatty(self) -> bool:
            return terminal

    (tmp_path / "r.csv").write_text("sp,pv,note\n50,49,a\u202eb\u200bc\n", encoding="utf-8")
    screen, words = Screen(), ["run", "fisher/provox", "GAIN=2", "RESET=4", "--record", str(tmp_path / "r.csv"), "--scan", "1"]
    with contextlib.redirect_stdout(screen), pytest.raises(SystemExit):
        main(words)
    expected = "50,49,a\\u202eb\\u200bc,0.0" if terminal else "50,49,a\u202eb\u200bc,0.0"
    assert screen.getvalue().splitlines()[1] == expected
