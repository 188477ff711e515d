"""A fleet gives what each of its loops gives alone, whatever is beside it; what goes wrong with one stops no other."""

from __future__ import annotations

import csv
import io
import math
import signal
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu import Fleet, FleetError, FleetResult, Loop, Process
from pidemu.backends.choice import block
from pidemu.backends.engine_names import Engine
from pidemu.files.cache import warn
from pidemu.fleet import blocks, local, prepare
from pidemu.fleet.blocks import COLUMNS
from pidemu.fleet.group import Group, grouped
from pidemu.fleet.judgement import RAN
from pidemu.fleet.lists import LoopList, PlacedLoops
from pidemu.fleet.loops import FleetPlan
from pidemu.fleet.progress import Progress
from pidemu.fleet.result import HEADER
from pidemu.program.ir import Structure
from tests.fleet.support import EVERY_ENGINE, alike, alone, check_figures, check_signals, few, mixed, same

STEPS: dict[str, Any] = {"setpoint": (5.0, 6.0), "load": (31.0, -20.0), "time": 60.0}


@pytest.mark.parametrize("engine", EVERY_ENGINE)
def test_a_mixed_fleet_has_the_numbers_of_its_loops_alone_in_every_engine(engine: Engine) -> None:
    loops = few() if engine == "numba" else mixed()
    result = Fleet(loops).simulate(**STEPS, keep=True, engine=engine)
    assert set(result.engines) == {engine}
    assert sum(result.counts[status] for status in RAN) == len(loops)
    expected = [alone(loop, **STEPS) for loop in loops]
    check_signals(result, loops, expected)
    check_figures(result, expected, [loop.initial[2] for loop in loops])


def test_a_mixed_fleet_has_all_kinds_of_arithmetic_and_moves() -> None:
    for loops in (mixed(), few()):
        assert {loop.settings.algorithm().arithmetic.type for loop in loops} == {"float64", "float32", "integer"}
    columns = Fleet(mixed()).simulate(**STEPS).columns
    assert np.median(columns["travel"]) > 10
    assert (columns["at_low"] > 0).any()
    assert (columns["at_high"] > 0).any()


@pytest.mark.parametrize("engine", EVERY_ENGINE)
def test_loops_that_run_as_long_as_each_needs_have_the_numbers_of_simulate(engine: Engine) -> None:
    loops = [replace(loop, process=Process.from_lags(1, [3.0 + i % 13], delay=i % 4 / 3)) for i, loop in enumerate(alike(70))]
    expected = [alone(loop) for loop in loops]
    assert len({one.times.size for one in expected}) > 20
    result = Fleet(loops).simulate(keep=True, engine=engine)
    check_signals(result, loops, expected)
    check_figures(result, expected, [50.0] * 70)


@settings(max_examples=12)
@given(data=st.data(), engine=st.sampled_from([None, "numpy", "numba", "python"]), cores=st.sampled_from([1, 2, None]))
def test_neither_order_nor_neighbours_nor_cores_change_a_bit(data: st.DataObject, engine: Engine | None, cores: int | None) -> None:
    whole = [*few(), *alike(70), *alike(20, scan=0.25, time=41.0)]
    whole = [replace(loop, tag=f"{i}") for i, loop in enumerate(whole)]
    reference = Fleet(whole).simulate(**STEPS, engine="numpy", cores=1)
    shuffled = data.draw(st.permutations(whole))
    some = shuffled[: data.draw(st.integers(1, len(whole)))]
    found = Fleet(some).simulate(**STEPS, engine=engine, cores=cores)
    assert same(found, reference, [loop.tag for loop in some])


@pytest.mark.parametrize("engine", EVERY_ENGINE)
def test_nor_do_the_ends_of_blocks_of_batches_and_of_stretches_in_time(engine: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    loops = [*alike(130, scan=0.1), *few()]  # dead times of 20 to 120 scans
    assert max(loop.process.delay / 0.1 for loop in loops[:130]) > 64
    expected = [alone(loop, **STEPS) for loop in loops]
    monkeypatch.setattr(local, "_AT_ONCE", 50)
    monkeypatch.setattr(prepare, "_SLICE", 7)
    monkeypatch.setattr(blocks, "_IN_CACHE", 1)  # 64 scans in one go
    result = Fleet(loops).simulate(**STEPS, keep=True, engine=engine)
    check_signals(result, loops, expected)
    check_figures(result, expected, [loop.initial[2] for loop in loops])


def test_the_error_counts_from_the_scan_of_the_load_step_on_or_from_the_first() -> None:
    at_once = [replace(loop, process=Process.from_lags(1, [4.0 + i])) for i, loop in enumerate(alike(3))]  # no dead time
    for steps in ({"setpoint": (0.0, 10.0), "load": 0.0}, {"setpoint": (10.0, 10.0), "load": (10.0, 1.0)}):
        expected = [alone(loop, **steps, time=30.0) for loop in at_once]
        result = Fleet(at_once).simulate(**steps, time=30.0)
        assert result.columns["peak"].tolist() == [10.0] * 3  # in that very scan; the next ones have less
        check_figures(result, expected, [50.0] * 3)


def test_loops_of_unlike_length_share_a_block_up_to_twice_the_scans() -> None:
    loops = [replace(loop, time=float(seconds)) for loop, seconds in zip(alike(6), (90, 10, 20, 21, 11, 50), strict=True)]
    ready = prepare.Preparation(FleetPlan()).prepared(PlacedLoops.of(enumerate(loops)))
    (group,) = grouped(one for one in ready if isinstance(one, Group))

    def times(width: int, longer: int) -> list[list[int | None]]:
        return [[round(loops[m.place].time or 0) for m in part] for part in group.parts(width, longer)]

    assert times(64, 2) == [[10, 11, 20], [21], [50, 90]]
    assert times(2, 2) == [[10, 11], [20, 21], [50, 90]]
    assert times(64, 1) == [[10], [11], [20], [21], [50], [90]]
    assert group.mean_scans == 69  # the mean of 21, 23, 41, 43, 101 and 181, rounded up


def test_a_dead_time_longer_than_the_run_takes_no_room() -> None:
    loop = replace(alike(1)[0], process=Process.from_lags(1, [5], delay=1e9))
    result = Fleet([loop]).simulate(**STEPS, keep=True)
    assert result.counts == {"unstable": 1}  # 90 % of what the integral does comes back when it is long since elsewhere
    assert set(result["L0"].measurement) == {50.0}


def test_a_loop_that_cannot_be_run_is_reported_and_the_others_are_done() -> None:
    good = alike(3)
    wrong = [
        Loop("no such scan", good[0].settings, good[0].process, scan=0.0),
        Loop("positive feedback", pidemu.load_card("mathworks/pid2").settings(Kp=2, Ki=0.2), Process.from_lags(-1, [10]), 0.5),
        Loop("late step", good[0].settings, good[0].process, 0.5, load=(1e6, 5)),
        Loop("not a number", good[0].settings, good[0].process, scan="soon"),  # type: ignore[arg-type]  # what a caller may do
    ]
    result = Fleet([good[0], *wrong[:2], good[1], *wrong[2:], good[2]]).simulate(**STEPS, keep=True)
    assert result.counts == {"done": 3, "failed": 4}
    assert list(result.failures) == [loop.tag for loop in wrong]
    assert "scan interval 0 s is not a positive number" in result.failures["no such scan"]
    assert "has no choice of control action" in result.failures["positive feedback"]
    assert "a load step of 5 % at 1e+06 s is not within the 60 s" in result.failures["late step"]
    assert "scan interval is 'soon'; give a number" in result.failures["not a number"]
    check_signals(result, good, [alone(loop, **STEPS) for loop in good])
    assert np.isnan(result.columns["iae"][1])
    with pytest.raises(FleetError, match=r"loop 'late step' has no signals: a load step of 5 %"):
        result["late step"]


@pytest.mark.parametrize("engine", EVERY_ENGINE)
def test_a_loop_that_runs_away_says_so_and_has_the_signals_of_simulate(engine: Engine) -> None:
    unstable = [replace(loop, process=Process(-1, [5.0]), time=400.0) for loop in alike(2)]
    float32 = Loop("narrow", mixed_settings("oscat/ft-pid"), Process(-1, [5.0]), 0.5, time=400.0, action="reverse")
    loops = [*(replace(loop, tag=f"away {loop.tag}") for loop in unstable), float32, *alike(2)]
    result = Fleet(loops).simulate(**STEPS | {"time": 80.0}, keep=True, engine=engine)
    assert result.status == ["ran away"] * 3 + ["done"] * 2
    expected = [alone(loop, **STEPS | {"time": 80.0}) for loop in loops]
    check_signals(result, loops, expected)
    assert not np.isfinite(result["away L0"].measurement[-1])
    for name in ("iae", "peak"):
        assert not np.isfinite(result.columns[name][:3]).any()
        assert np.isfinite(result.columns[name][3:]).all()


def mixed_settings(card_id: str) -> pidemu.Settings:
    return next(loop.settings for loop in mixed() if loop.settings.card.id == card_id)


@pytest.mark.parametrize("how", ["in between", "by a signal while blocks run", "while loops are prepared"])
def test_an_interrupted_fleet_keeps_what_is_done(how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    loops, names = alike(300, time=200.0), {t.name for t in threading.enumerate()}
    monkeypatch.setattr(local, "_AT_ONCE_KEPT", 32)
    done: list[int] = []
    advance, real = Progress.advance, prepare.Preparation.prepared

    def interrupted(self: Progress, count: int) -> None:
        advance(self, count)
        done.append(count)
        if how == "in between":
            raise KeyboardInterrupt
        if how == "by a signal while blocks run" and len(done) == 1:
            threading.Timer(0.02, signal.raise_signal, [signal.SIGINT]).start()
            time.sleep(0.1)

    def prepared(*args: Any) -> Any:
        if done and how == "while loops are prepared":
            raise KeyboardInterrupt
        return real(*args)

    monkeypatch.setattr(Progress, "advance", interrupted)
    monkeypatch.setattr(prepare.Preparation, "prepared", prepared)
    result = Fleet(loops).simulate(engine="python", cores=2, keep=True)
    assert result.interrupted
    assert 0 < result.counts["done"] < 300
    assert result.counts["done"] + result.counts["not run"] == 300
    some = [loop for loop, status in zip(loops, result.status, strict=True) if status == "done"][::16]
    check_signals(result, some, [alone(loop) for loop in some])
    late = next(loop.tag for loop, status in zip(loops, result.status, strict=True) if status == "not run")
    with pytest.raises(FleetError, match=f"loop '{late}' has no signals: not run"):
        result[late]
    assert {t.name for t in threading.enumerate() if t.name.startswith("fleet")} <= names


def test_an_interrupt_stops_blocks_under_way() -> None:
    loops = alike(64, time=1e6)  # minutes, in plain Python
    timer = threading.Timer(0.5, signal.raise_signal, [signal.SIGINT])
    timer.start()
    start = time.perf_counter()
    result = Fleet(loops).simulate(engine="python")
    assert time.perf_counter() - start < 10
    assert result.interrupted
    assert result.counts == {"not run": 64}
    assert not any(t.name.startswith("fleet") for t in threading.enumerate())


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("shown", "large", "bar"), [(None, False, False), (True, False, True), (None, True, True), (False, True, False)]
)
def test_a_bar_is_shown_on_a_terminal_for_many_loops(
    shown: bool | None, large: bool, bar: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    if large:
        monkeypatch.setattr("pidemu.fleet.progress._LARGE", 3)
    Fleet(alike(5)).simulate(**STEPS, progress=shown)
    assert ("5/5" in terminal.getvalue()) == bar
    assert bool(terminal.getvalue()) == bar


def test_a_program_without_standard_error_shows_no_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr", None)
    monkeypatch.setattr("pidemu.fleet.progress._LARGE", 1)
    assert Fleet(alike(2)).simulate(**STEPS).counts == {"done": 2}


def test_the_table_reads_back_with_the_same_numbers(tmp_path: Path) -> None:
    loops = [*alike(3), Loop('FIC, "quoted" ü', alike(1)[0].settings, alike(1)[0].process, scan=math.nan)]
    loops.append(replace(loops[0], tag="away", process=Process(-1, [5.0]), time=400.0))
    result = Fleet(loops).simulate(**STEPS)
    result.write_table(tmp_path / "table.csv")
    with (tmp_path / "table.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == list(HEADER)
    assert [row["tag"] for row in rows] == [loop.tag for loop in loops]
    assert [row["status"] for row in rows] == ["done", "done", "done", "failed", "ran away"]
    for name in COLUMNS:
        back = np.array([float(row[name] or "nan") for row in rows])
        assert np.array_equal(back, result.columns[name], equal_nan=True)
    assert rows[3]["reason"] == result.failures[loops[3].tag]
    assert (rows[3]["scans"], rows[3]["engine"], rows[0]["scan"], rows[0]["scans"]) == ("", "", "0.5", "121")
    assert rows[0]["engine"] == result.engines[0]


def test_a_table_that_cannot_be_written_is_an_error_with_its_place(tmp_path: Path) -> None:
    result = FleetResult(LoopList(alike(1)), FleetPlan())
    with pytest.raises(FleetError, match=r"no[/\\]table.csv: cannot be written: No such file or directory$"):
        result.write_table(tmp_path / "no" / "table.csv")


def test_what_is_no_fleet_is_refused() -> None:
    with pytest.raises(FleetError, match="a fleet has no loops; give at least one"):
        Fleet([])
    with pytest.raises(FleetError, match="two loops have the tag 'L0'; give each its own"):
        Fleet([*alike(2), *alike(1)])
    assert len(Fleet(iter(alike(2)))) == 2


@pytest.mark.parametrize("cores", [0, -3])
def test_no_cores_run_nothing(cores: int) -> None:
    with pytest.raises(FleetError, match=f"{cores} cores cannot run anything; give at least 1"):
        Fleet(alike(1)).simulate(cores=cores)


def test_an_unknown_engine_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(pidemu.EngineError, match=r"there is no engine 'nump' \(did you mean 'numpy'\?\)"):
        Fleet(alike(1)).simulate(engine="nump", folder=tmp_path / "new", parquet=tmp_path / "new.parquet")  # type: ignore[arg-type]  # a slip
    assert list(tmp_path.iterdir()) == []


def test_signals_that_were_not_kept_and_loops_that_are_not_there_are_named() -> None:
    result = Fleet(alike(12)).simulate(**STEPS)
    with pytest.raises(FleetError, match="the signals of loop 'L1' were not kept; run the fleet with keep=True"):
        result["L1"]
    with pytest.raises(FleetError, match=r"there is no loop 'l1' \(did you mean 'L1'"):
        result["l1"]


def breaks(*args: Any) -> None:
    raise IndexError("out of the engine")


@pytest.mark.parametrize("engine", ["numpy", None])
def test_loops_of_a_block_that_fails_are_run_one_by_one_in_python_and_it_is_said_once(
    engine: Engine | None, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    warn.cache_clear()
    monkeypatch.setattr("pidemu.backends.choice.has_numba", lambda: False)
    expected = Fleet(alike(40)).simulate(**STEPS, keep=True, engine="python")
    monkeypatch.setattr(local, "block", lambda structure, engine: (breaks, 8))
    result = Fleet(alike(40)).simulate(**STEPS, keep=True, engine=engine)
    assert result.counts == {"done": 40}
    assert set(result.engines) == {"python"}
    assert same(result, expected, [loop.tag for loop in result.loops])
    assert all(np.array_equal(result[t].output, expected[t].output) for t in ("L0", "L17", "L39"))
    assert caplog.messages == [
        "note: the engine 'numpy' failed (IndexError: out of the engine); plain Python runs what it was to run"
    ]
    assert not any(t.name.startswith("fleet") for t in threading.enumerate())


@pytest.mark.parametrize("error", [RecursionError("too deep"), MemoryError(), KeyError("kp"), pidemu.EngineError("no compiler")])
def test_an_engine_that_cannot_begin_is_replaced_by_plain_python(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(structure: Structure, engine: Engine) -> Any:
        if engine != "python":
            raise error
        return block(structure, engine)

    monkeypatch.setattr(local, "block", broken)
    result = Fleet(alike(20)).simulate(**STEPS, engine="numpy")
    assert result.counts == {"done": 20}
    assert set(result.engines) == {"python"}


@pytest.mark.parametrize("error", [RecursionError("too deep"), MemoryError("no room"), KeyError("kp"), SyntaxError("a113")])
def test_a_loop_that_fails_in_running_costs_itself_only(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    real = blocks.run_block

    def run_block(members: Group, *rest: Any) -> Any:
        if any(m.tag == "L7" for m in members):
            raise error
        return real(members, *rest)

    monkeypatch.setattr(local, "run_block", run_block)
    for engine in ("python", "numpy", None):
        result = Fleet(alike(20)).simulate(**STEPS, engine=engine)
        assert result.counts == {"done": 19, "failed": 1}
        assert result.failures == {
            "L7": f"internal error of this loop ({type(error).__name__}: {error}); give the loop what pidemu.Loop documents, "
            f"and report it where that is done"
        }


@pytest.mark.parametrize("error", [RecursionError("too deep"), MemoryError("no room"), KeyError("kp"), SyntaxError("a113")])
def test_a_loop_that_fails_in_preparing_costs_itself_only(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    real = FleetPlan.trial

    def trial(self: FleetPlan, loop: Loop) -> Any:
        if loop.tag == "L7":
            raise error
        return real(self, loop)

    monkeypatch.setattr(FleetPlan, "trial", trial)
    result = Fleet(alike(20)).simulate(**STEPS)
    assert result.counts == {"done": 19, "failed": 1}
    assert f"internal error of this loop ({type(error).__name__}: {error})" in result.failures["L7"]


def test_what_is_in_memory_does_not_grow_with_blocks_that_nobody_has_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []

    def room(shape: tuple[int, int, int]) -> Any:
        made.append(1)
        return np.empty(shape)

    found = local.outcomes(enumerate(alike(640, time=20.0)), FleetPlan(keep=True, engine="python"), cores=2, room=room)
    taken = 0
    for _ in found:
        taken += 1
        time.sleep(0.02)
        assert len(made) <= taken + 4  # two for each core
    assert taken == len(made) == 10


def test_blocks_that_wait_until_others_are_taken_stop_too() -> None:
    found = local.outcomes(enumerate(alike(1280, time=5.0)), FleetPlan(keep=True, engine="python"), cores=2, room=np.empty)
    next(found)
    time.sleep(0.5)  # all that may be ahead is done, and the threads wait
    closing = threading.Thread(target=found.close, daemon=True)
    closing.start()
    closing.join(10)
    assert not closing.is_alive()
    assert not any(t.name.startswith("fleet") for t in threading.enumerate())
