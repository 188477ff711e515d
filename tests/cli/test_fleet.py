"""The command that runs a file of loops."""

from __future__ import annotations

import csv
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import pidemu
from pidemu.analysis.figures import loop_figures
from pidemu.fleet.blocks import BlockOutcome
from pidemu.fleet.prepare import Failed
from pidemu.fleet.result import FleetResult
from tests.cli.helpers import said, strict_json, told

HEAD = "tag,card,settings,process,scan,time\n"
FAST = 'FIC-1,generic/standard,K=2; Ti=10,"gain=1,lag=10,delay=2",0.5,100\n'
SLOW = 'TIC-2,fisher/provox,GAIN=1; RESET=2,"gain=1,lag=40,delay=5",1,\n'
WRONG = "LIC-3,fisher/provox,GIAN=1; RESET=2,gain=1,,\n"
UNFIT = 'PIC-4,generic/standard,K=2; Ti=10,"gain=1,lag=10",-1,\n'
RUNAWAY = 'XIC-5,generic/standard,K=0.1; Ti=10,"gain=1,pole=2",0.5,400\n'
WHY = "fisher/provox: unknown setting 'GIAN' (did you mean 'GAIN'?); settings: GAIN, RESET, RATE"


@pytest.fixture(autouse=True)
def _loops(folder: Path) -> None:
    (folder / "good.csv").write_text(HEAD + FAST + SLOW, encoding="utf-8")
    (folder / "loops.csv").write_text(HEAD + FAST + WRONG + SLOW + UNFIT, encoding="utf-8")
    (folder / "many.csv").write_text(HEAD + "".join(FAST.replace("FIC-1", f"FIC-{i}") for i in range(1, 31)), encoding="utf-8")


def rows(path: str) -> dict[str, dict[str, str]]:
    with Path(path).open(encoding="utf-8", newline="") as file:
        return {row["tag"]: row for row in csv.DictReader(file)}


def simulated() -> pidemu.Simulation:
    settings = pidemu.load_card("fisher/provox").settings(GAIN=1, RESET=2)
    return pidemu.simulate(settings, pidemu.Process.from_lags(1.0, lags=[40], delay=5), 1.0)


def chosen() -> str:
    """The engine that is chosen for the loops of good.csv."""
    (engine,) = set(pidemu.Fleet(pidemu.read_loops("good.csv").loops).simulate().engines)
    return engine


def test_the_loops_are_run_and_shown_the_largest_iae_first() -> None:
    out = told("fleet", "good.csv")
    lines = out.splitlines()
    assert lines[0] == "good.csv: 2 loops, 2 done; 1 not settled at the end"  # 100 s are too short for FIC-1
    assert lines[2] == "Loops, the largest IAE first"
    assert [line.split()[:4] for line in lines[4:]] == [
        ["TIC-2", "fisher/provox", "1", "s"],
        ["FIC-1", "generic/standard", "0.5", "s"],
    ]
    assert float(lines[4].split()[4]) == pytest.approx(simulated().iae, rel=5e-4)  # four digits are shown
    assert "engine" not in out


def test_a_wrong_row_and_a_loop_that_cannot_be_run_are_said_at_their_lines_and_do_not_stop_the_others() -> None:
    status, out, err = said("fleet", "loops.csv", "--table", "out.csv")
    assert status == 1
    unfit = "the scan interval -1 s is not a positive number; give the time between two scans"
    assert err.splitlines() == [f"loops.csv:3: LIC-3: {WHY}", f"loops.csv:5: PIC-4: {unfit}"]
    assert out.splitlines()[0] == "loops.csv: 4 loops, 2 done, 2 failed; 1 not settled at the end"
    assert out.splitlines()[-3:] == ["Failed", "  line 3  LIC-3  fisher/provox", "  line 5  PIC-4  generic/standard"]
    found = rows("out.csv")
    assert {tag: row["status"] for tag, row in found.items()} == {
        "FIC-1": "done", "LIC-3": "failed", "TIC-2": "done", "PIC-4": "failed",
    }  # fmt: skip
    assert (found["LIC-3"]["reason"], found["PIC-4"]["reason"]) == (WHY, unfit)
    assert float(found["TIC-2"]["error"]) == simulated().error[-1]


def test_a_file_of_which_no_row_makes_a_loop_fails(folder: Path) -> None:
    (folder / "bad.csv").write_text(HEAD + WRONG, encoding="utf-8")
    status, out, err = said("fleet", "bad.csv", "-v")
    assert (status, err) == (1, f"bad.csv:2: LIC-3: {WHY}\n")
    assert out.splitlines()[:2] == ["bad.csv: 1 loop, 1 failed", "engine: none, as nothing was run"]


def test_a_loop_that_runs_away_is_a_result_and_stands_first(folder: Path) -> None:
    (folder / "away.csv").write_text(HEAD + FAST + RUNAWAY, encoding="utf-8")
    out = told("fleet", "away.csv")
    assert out.splitlines()[0] == "away.csv: 2 loops, 1 done, 1 ran away; 2 not settled at the end"
    first = out.splitlines()[4].split()
    assert (first[0], first[-2:]) == ("XIC-5", ["ran", "away"])


OSCILLATES = 'YIC-6,generic/standard,K=12; Ti=10,"gain=1,lag=10,delay=2",0.5,\n'


def test_an_unstable_loop_is_called_so_and_stands_first_and_the_table_has_the_margins_of_all(folder: Path) -> None:
    (folder / "swing.csv").write_text(HEAD + FAST + OSCILLATES, encoding="utf-8")
    out = told("fleet", "swing.csv", "--table", "out.csv")
    lines = out.splitlines()
    assert lines[0] == "swing.csv: 2 loops, 1 done, 1 unstable; 2 not settled at the end"
    assert lines[3].split()[-4:] == ["GM", "PM", "[deg]", "Ms"]
    assert (lines[4].split()[0], lines[4].split()[-2:]) == ("YIC-6", ["inf", "unstable"])
    assert lines[5].split()[-2:] == ["not", "settled"]
    found = rows("out.csv")
    assert [(row["status"], row["stable"], row["settled"]) for row in found.values()] == [
        ("done", "True", "False"), ("unstable", "False", "False"),
    ]  # fmt: skip
    settings = pidemu.load_card("generic/standard").settings(K=2, Ti=10)
    figures = loop_figures(settings.law(0.5), pidemu.Process.from_lags(1.0, lags=[10], delay=2))
    row = found["FIC-1"]
    assert (float(row["gain_margin"]), float(row["phase_margin"]), float(row["Ms"])) == (
        figures.gain_margin, figures.phase_margin, figures.Ms,
    )  # fmt: skip


def test_without_margins_there_are_none_and_an_unstable_loop_has_only_not_settled(folder: Path) -> None:
    (folder / "swing.csv").write_text(HEAD + OSCILLATES, encoding="utf-8")
    lines = told("fleet", "swing.csv", "--no-margins", "--table", "out.csv").splitlines()
    assert lines[0] == "swing.csv: 1 loop, 1 done; 1 not settled at the end"
    assert "GM" not in lines[3]
    row = rows("out.csv")["YIC-6"]
    assert [row[name] for name in ("status", "stable", "gain_margin", "phase_margin", "Ms")] == ["done", "", "", "", ""]


def test_twenty_loops_of_a_plant_are_shown() -> None:
    lines = told("fleet", "many.csv").splitlines()
    assert lines[0] == "many.csv: 30 loops, 30 done; 30 not settled at the end"
    assert lines[2] == "The 20 loops with the largest IAE"
    assert len(lines) == 4 + 20


def test_twenty_failures_are_shown_and_all_are_said(folder: Path) -> None:
    (folder / "bad.csv").write_text(HEAD + "".join(WRONG.replace("LIC-3", f"LIC-{i}") for i in range(25)), encoding="utf-8")
    _, out, err = said("fleet", "bad.csv")
    assert len(err.splitlines()) == 25
    assert out.splitlines()[-1] == "  and 5 more; --table and --json list all"
    assert sum(line.startswith("  line ") for line in out.splitlines()) == 20


def test_steps_and_time_count_for_loops_that_do_not_say(folder: Path) -> None:
    (folder / "own.csv").write_text(
        "tag,card,settings,process,scan,setpoint,load,time\n"
        'A,fisher/provox,GAIN=1; RESET=2,"gain=1,lag=40,delay=5",1,0,"5,3",200\n'
        'B,fisher/provox,GAIN=1; RESET=2,"gain=1,lag=40,delay=5",1,,,\n',
        encoding="utf-8",
    )
    told("fleet", "own.csv", "--setpoint", "0", "--load", "20,-4", "--time", "5 min", "--table", "out.csv")
    settings = pidemu.load_card("fisher/provox").settings(GAIN=1, RESET=2)
    process = pidemu.Process.from_lags(1.0, lags=[40], delay=5)
    own = pidemu.simulate(settings, process, 1.0, setpoint=0, load=(5, 3), time=200)
    fleet = pidemu.simulate(settings, process, 1.0, setpoint=0, load=(20, -4), time=300)
    found = rows("out.csv")
    for tag, ran in (("A", own), ("B", fleet)):
        assert (int(found[tag]["scans"]), float(found[tag]["error"])) == (ran.times.size, ran.error[-1])


@pytest.mark.parametrize("engine", ["python", "numpy"])
def test_an_engine_that_is_asked_for_runs_and_is_named_and_the_numbers_are_the_same(engine: str) -> None:
    told("fleet", "good.csv", "--table", "auto.csv")
    out = told("fleet", "good.csv", "--engine", engine, "--table", "forced.csv")
    assert out.splitlines()[1] == f"engine: {engine} (2 loops)"
    auto, forced = rows("auto.csv"), rows("forced.csv")
    for tag, row in forced.items():
        assert row["engine"] == engine
        assert {**row, "engine": ""} == {**auto[tag], "engine": ""}


@pytest.mark.parametrize("word", ["-v", "--verbose", "--engine=auto"])
def test_the_engine_that_was_chosen_is_named_on_request(word: str) -> None:
    assert told("fleet", "good.csv", word).splitlines()[1] == f"engine: {chosen()} (2 loops)"


def test_verbose_says_how_settings_were_read(folder: Path) -> None:
    (folder / "unit.csv").write_text(HEAD + FAST.replace("Ti=10", "Ti=0.5 min"), encoding="utf-8")
    assert said("fleet", "unit.csv").err == ""
    assert said("fleet", "unit.csv", "-v").err == "unit.csv:2: FIC-1: note: Ti: 0.5 min is 30 s\n"


def test_signals_and_parquet_hold_what_a_simulation_gives(folder: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    told("fleet", "good.csv", "--signals", "kept", "--parquet", "kept.parquet", "--cores", "1")
    place = rows("kept/signals.csv")["TIC-2"]
    block = np.load(folder / "kept" / place["file"])
    ran = simulated()
    assert block[0, : int(place["scans"]), int(place["loop"])].tolist() == ran.output.tolist()
    table = {row["tag"]: row for row in pq.read_table(folder / "kept.parquet").to_pylist()}
    assert table["TIC-2"]["measurement"] == ran.measurement.tolist()


def test_json_holds_every_loop_with_its_line() -> None:
    status, out, err = said("fleet", "loops.csv", "--json")
    found = strict_json(out)
    assert status == 1
    assert len(err.splitlines()) == 2
    assert (found["file"], found["counts"], found["engines"]) == ("loops.csv", {"done": 2, "failed": 2}, {chosen(): 2})
    assert found["interrupted"] is False
    assert [(row["tag"], row["line"], row["status"]) for row in found["loops"]] == [
        ("FIC-1", 2, "done"), ("LIC-3", 3, "failed"), ("TIC-2", 4, "done"), ("PIC-4", 5, "failed"),
    ]  # fmt: skip
    assert [row["settled"] for row in found["loops"]] == [False, None, True, None]
    assert (found["not_settled"], found["loops"][2]["stable"]) == (1, True)
    assert found["loops"][1]["reason"] == WHY
    assert found["loops"][2]["error"] == simulated().error[-1]


def test_progress_is_shown_on_request() -> None:
    assert "2/2" in said("fleet", "good.csv", "--progress").err
    assert said("fleet", "good.csv", "--no-progress").err == ""


def test_an_interrupted_fleet_gives_what_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    add = FleetResult.add

    def interrupted(self: FleetResult, found: BlockOutcome | Failed) -> int:
        if "done" in self.status:
            raise KeyboardInterrupt
        return add(self, found)

    monkeypatch.setattr(FleetResult, "add", interrupted)
    status, out, err = said("fleet", "loops.csv", "--cores", "1", "--table", "out.csv")
    assert status == 130
    assert err.splitlines()[-1] == "interrupted: 1 of 4 loops are done"
    assert out.splitlines()[0].startswith("loops.csv: 4 loops, 1 done, ")
    assert "not run" in {row["status"] for row in rows("out.csv").values()}


@pytest.mark.skipif(sys.platform == "win32", reason="signals are another matter there")
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_ctrl_c_and_sigterm_end_the_run_and_print_and_write_what_is_done(number: int, status: int, folder: Path) -> None:
    loops = "".join(SLOW.replace("TIC-2", f"TIC-{i}").replace(",1,\n", ",1,2e4\n") for i in range(300))
    (folder / "long.csv").write_text(HEAD + FAST + loops, encoding="utf-8")
    words = ["fleet", "long.csv", "--engine", "python", "--cores", "1", "--signals", "kept", "--table", "out.csv"]
    process = subprocess.Popen([sys.executable, "-m", "pidemu", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while len(list(folder.glob("kept/block-*.npy"))) < 3:  # two blocks are done then
        time.sleep(0.02)
        assert process.poll() is None, process.communicate()
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    done = [tag for tag, row in rows("out.csv").items() if row["status"] == "done"]
    assert 0 < len(done) < 301
    assert (process.returncode, err) == (status, f"interrupted: {len(done)} of 301 loops are done\n")
    assert out.splitlines()[0] == f"long.csv: 301 loops, {len(done)} done, {301 - len(done)} not run; 1 not settled at the end"


REFUSED = {
    "fleet none.csv": "none.csv: cannot be read: No such file or directory",
    "fleet good.csv --table nowhere/out.csv": "nowhere/out.csv: cannot be written: No such file or directory",
    "fleet good.csv --vendors nowhere": "no folder 'nowhere'; a folder of cards holds <vendor>/<block>.yaml",
    "fleet wrong.csv": (
        "wrong.csv:1: unknown column 'tga' (did you mean 'tag'?); columns: tag, card, settings, process, scan, action, limits, "
        "setpoint, load, time"
    ),
}


@pytest.mark.parametrize(("line", "message"), REFUSED.items())
def test_what_cannot_be_done_is_said_with_status_2(line: str, message: str, folder: Path) -> None:
    (folder / "wrong.csv").write_text("tga,card,settings,process\nA,b,c,d\n", encoding="utf-8")
    assert said(*line.split()) == (2, "", f"error: {message}\n")


def test_a_folder_that_holds_signals_already_is_refused() -> None:
    told("fleet", "good.csv", "--signals", "kept")
    status, _, err = said("fleet", "good.csv", "--signals", "kept")
    remedy = "go on with them (--resume, resume=True), give another folder, or empty it"
    assert (status, err) == (2, f"error: kept holds the signals of a fleet already; {remedy}\n")


def test_a_run_that_did_not_end_is_gone_on_with(monkeypatch: pytest.MonkeyPatch) -> None:
    add = FleetResult.add

    def interrupted(self: FleetResult, found: BlockOutcome | Failed) -> int:
        if "done" in self.status:
            raise KeyboardInterrupt
        return add(self, found)

    words = ("fleet", "loops.csv", "--signals", "kept", "--parquet", "kept.parquet", "--table", "out.csv", "--engine", "python")
    whole = "fleet loops.csv --table whole.csv --engine python"
    said(*whole.split())
    with monkeypatch.context() as patch:
        patch.setattr(FleetResult, "add", interrupted)
        assert said(*words, "--cores", "1").status == 130
    status, out, err = said(*words, "--resume", "--json")
    assert (status, strict_json(out)["resumed"]) == (1, 2)  # two rows are wrong; the second loop was written, if not shown
    assert err.splitlines()[-1] == "resumed: 2 of 4 loops were done already"
    assert rows("out.csv") == rows("whole.csv")


def test_there_must_be_something_to_go_on_with() -> None:
    status, _, err = said("fleet", "good.csv", "--resume")
    assert (status, err.partition(";")[0]) == (
        2, "error: there is nothing to go on with: what is done is kept where signals go to files",
    )  # fmt: skip


@pytest.mark.parametrize("damage", ["emptied", "cut short", "a bit turned"])
@pytest.mark.parametrize(("engine", "ending"), [("numba", ".numba"), ("c", ".so")])
def test_a_damaged_cache_is_no_matter_to_a_fleet(engine: str, ending: str, damage: str, folder: Path) -> None:
    """With Numba's own files it ended with status 130 and without a word."""
    if engine == "c" and shutil.which("cc") is None:
        pytest.skip("there is no C compiler")
    (folder / "long.csv").write_text(HEAD + SLOW.replace(",1,\n", ",1,1e7\n"), encoding="utf-8")
    command = [sys.executable, "-m", "pidemu", "fleet", "long.csv", "--engine", engine, "--table", "out.csv"]
    environment = {**os.environ, "PIDEMU_CACHE": str(folder / "code")}
    found = []
    for _ in range(2):
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
        assert (done.returncode, done.stderr) == (0, "")
        assert f"engine: {engine} (1 loop)" in done.stdout
        found.append((done.stdout, rows("out.csv")))
        for path in (folder / "code").rglob(f"*{ending}"):
            sound = path.read_bytes()
            middle = len(sound) // 2
            turned = sound[:middle] + bytes([sound[middle] ^ 1]) + sound[middle + 1 :]
            path.write_bytes({"emptied": b"", "cut short": sound[:middle], "a bit turned": turned}[damage])
    assert found[0] == found[1]


def test_a_card_with_a_name_longer_than_that_of_any_file_costs_its_row(folder: Path) -> None:
    cards = ("generic/" + "x" * 300, "generic/" + "y" * 5000)
    lines = [FAST.replace("FIC-1", f"LONG-{i}").replace("generic/standard", card) for i, card in enumerate(cards)]
    (folder / "names.csv").write_text(HEAD + FAST + "".join(lines), encoding="utf-8")
    status, out, err = said("fleet", "names.csv")
    assert (status, out.splitlines()[0]) == (1, "names.csv: 3 loops, 1 done, 2 failed; 1 not settled at the end")
    assert [line.partition(": no ")[0] for line in err.splitlines()] == ["names.csv:3: LONG-0", "names.csv:4: LONG-1"]
    assert max(map(len, (out + err).splitlines())) < 2500


def test_cores_and_a_scheduler_are_one_too_many() -> None:
    status, out, err = said("fleet", "good.csv", "--cores", "2", "--scheduler", "tcp://127.0.0.1:8786")
    assert (status, out) == (2, "")
    assert err.endswith("Error: --cores is for this machine, and --scheduler runs the loops elsewhere; leave one of them out\n")


def test_one_long_cell_does_not_widen_the_table_on_the_screen(folder: Path) -> None:
    (folder / "long.csv").write_text(HEAD + FAST + FAST.replace("FIC-1", "T" * 100_000), encoding="utf-8")
    out = told("fleet", "long.csv")
    assert max(map(len, out.splitlines())) < 200
    assert "T" * 40 + "…" + "T" * 20 in out


def interrupt_after(blocks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupt the next fleet where so many blocks, or loops that failed, are done."""
    add = FleetResult.add
    seen: list[BlockOutcome | Failed] = []

    def interrupted(self: FleetResult, found: BlockOutcome | Failed) -> int:
        if len(seen) == blocks:
            raise KeyboardInterrupt
        seen.append(found)
        return add(self, found)

    monkeypatch.setattr(FleetResult, "add", interrupted)


def test_an_interrupted_fleet_replaces_no_older_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyarrow")
    words = ["fleet", "good.csv", "--table", "out.csv", "--parquet", "out.pq", "--no-margins", "--cores", "1", "--engine", "python"]
    told(*words)
    before = {name: (folder / name).read_bytes() for name in ("out.csv", "out.pq")}
    with monkeypatch.context() as patch:
        interrupt_after(1, patch)
        status, _, err = said(*words)
    stay = "out.csv and out.pq are as they were, what is done is in out.interrupted.csv and out.interrupted.pq"
    assert (status, err) == (130, f"interrupted: 1 of 2 loops are done; {stay}\n")
    assert {name: (folder / name).read_bytes() for name in before} == before
    assert [row["status"] for row in rows("out.interrupted.csv").values()].count("done") == 1
    assert said(*words, "--resume").err == "resumed: 2 of 2 loops were done already\n"


def test_a_fleet_that_is_interrupted_before_anything_is_done_writes_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyarrow")
    there = set(folder.iterdir())
    interrupt_after(0, monkeypatch)
    monkeypatch.setattr("pidemu.fleet.signals.SignalStore.stored", lambda self, outcome: outcome)
    words = ["fleet", "good.csv", "--table", "out.csv", "--parquet", "out.pq", "--signals", "kept"]
    assert said(*words).err == "interrupted: 0 of 2 loops are done\n"
    assert set(folder.iterdir()) == there
    (folder / "out.csv").write_text("older", encoding="utf-8")
    assert said(*words).err == "interrupted: 0 of 2 loops are done; out.csv is as it was\n"
    assert (folder / "out.csv").read_text(encoding="utf-8") == "older"


OVERLAPPING = {
    "--table o.csv --parquet o.csv": "--table o.csv and --parquet o.csv are the same; give each its own name",
    "--table o.csv --parquet ./o.csv": "--table o.csv and --parquet ./o.csv are the same; give each its own name",
    "--table s --signals s": "--table s and --signals s are the same; give each its own name",
    "--table s/signals.csv --signals s": (
        "--table s/signals.csv lies in --signals s, where nothing else may be written; give another place"
    ),
    "--parquet s/o.pq --signals s": "--parquet s/o.pq lies in --signals s, where nothing else may be written; give another place",
    "--parquet o.pq --signals o.pq.parts": (
        "--signals o.pq.parts and the parts of --parquet in o.pq.parts are the same; give each its own name"
    ),
    "--parquet o.pq --table o.pq.parts/o.csv": (
        "--table o.pq.parts/o.csv lies in the parts of --parquet in o.pq.parts, where nothing else may be written; "
        "give another place"
    ),
}


@pytest.mark.parametrize(("words", "message"), OVERLAPPING.items())
def test_outputs_that_would_destroy_each_other_are_refused_before_the_work(words: str, message: str, folder: Path) -> None:
    there = set(folder.iterdir())
    assert said("fleet", "good.csv", *words.split(" ")) == (2, "", f"error: {message}\n")
    assert set(folder.iterdir()) == there


def test_the_index_of_a_folder_of_signals_is_not_overwritten_by_a_table(folder: Path) -> None:
    told("fleet", "good.csv", "--signals", "s")
    before = (folder / "s" / "signals.csv").read_bytes()
    assert said("fleet", "good.csv", "--signals", "s", "--resume", "--table", "s/signals.csv").status == 2
    assert (folder / "s" / "signals.csv").read_bytes() == before


@pytest.mark.parametrize("time", ["-5", "0", "-1 min"])
def test_a_time_that_is_none_is_wrong_usage_and_no_fault_of_the_rows(time: str) -> None:
    status, out, err = said("fleet", "good.csv", "--time", time)
    message = f"Error: Invalid value for '--time': '{time}' is not more than 0 s; write a time such as 0.5 or 10 min"
    assert (status, out, err.splitlines()[-1]) == (2, "", message)


def test_what_is_wrong_is_told_in_the_order_of_the_lines(folder: Path) -> None:
    rows = (
        UNFIT,
        FAST,
        WRONG,
        FAST.replace("FIC-1", "B").replace(",0.5,", ",1e300,"),
        FAST.replace("FIC-1", "C").replace("100", "1e300"),
    )
    (folder / "mixed.csv").write_text(HEAD + "".join(rows) + WRONG.replace("LIC-3", "D"), encoding="utf-8")
    status, _, err = said("fleet", "mixed.csv")
    assert status == 1
    assert [line.split(": ")[:2] for line in err.splitlines()] == [
        ["mixed.csv:2", "PIC-4"], ["mixed.csv:4", "LIC-3"], ["mixed.csv:5", "B"], ["mixed.csv:6", "C"], ["mixed.csv:7", "D"],
    ]  # fmt: skip


def test_rows_that_make_no_loop_are_told_though_the_others_cannot_be_run(folder: Path) -> None:
    (folder / "signals").write_text("mine", encoding="utf-8")
    status, _, err = said("fleet", "loops.csv", "--signals", "signals")
    assert status == 2
    assert err.splitlines()[0] == f"loops.csv:3: LIC-3: {WHY}"
    assert err.splitlines()[1].startswith("error: ")


def test_a_row_says_where_its_scan_interval_is_longer_than_it_would_take(folder: Path) -> None:
    (folder / "quick.csv").write_text(
        'tag,card,settings,process,time\nFIC-1,generic/standard,K=2; Ti=10,"gain=1,lag=0.0001,delay=0.000001",3\n', encoding="utf-8"
    )
    found = said("fleet", "quick.csv", "--table", "out.csv")
    assert found.status == 0
    assert "quick.csv:2: FIC-1: a scan interval of 3e-05 s is taken, since with the " in found.err
    assert "a scan interval of 3e-05 s is taken" in (folder / "out.csv").read_text(encoding="utf-8")
