"""A run that did not end is gone on with: what is complete is taken, the rest is run, and the numbers are those of one run."""

from __future__ import annotations

import csv
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import pidemu
from pidemu import Fleet, FleetError, FleetResult, Loop, Process
from pidemu.files.cache import warn
from pidemu.fleet import finished, local
from pidemu.fleet.blocks import run_block
from pidemu.fleet.finished import keys
from pidemu.fleet.folder import INDEX
from pidemu.fleet.loops import FleetPlan
from tests.fleet.killing import parquet_of, signals_of
from tests.fleet.support import alike
from tests.helpers import copied

STEPS: dict[str, Any] = {"setpoint": 5.0, "load": (31.0, -20.0), "time": 60.0}
AWAY = Process(-1, [5.0])


def loops() -> list[Loop]:
    """Six blocks in plain Python, one loop that runs away, one that has no margins, and one that fails."""
    some = [replace(loop, time=40.0 + 5 * (i % 6)) for i, loop in enumerate(alike(24))]
    away = replace(some[0], tag="=away", process=AWAY, time=400.0)
    return [*some, away, replace(some[1], tag="positive", action="direct"), replace(some[2], tag="fails", scan=0.0)]


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> FleetResult:
    return Fleet(loops()).simulate(**STEPS, folder=tmp_path_factory.mktemp("whole") / "f", engine="python")


def interrupted(folder: Path | None, parquet: Path | None, monkeypatch: pytest.MonkeyPatch, blocks: int = 3) -> FleetResult:
    """Run the fleet until some blocks are done."""
    add, seen = FleetResult.add, []

    def stops(self: FleetResult, found: Any) -> int:
        seen.append(add(self, found))
        if len(seen) == blocks:
            raise KeyboardInterrupt
        return seen[-1]

    with monkeypatch.context() as patch:
        patch.setattr(FleetResult, "add", stops)
        found = Fleet(loops()).simulate(**STEPS, folder=folder, parquet=parquet, engine="python", cores=1)
    assert found.interrupted
    assert 0 < found.counts["done"] < 24
    return found


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The loops that are prepared to run."""
    tags: list[str] = []
    real = local.outcomes

    def noted(some: Any, *rest: Any, **named: Any) -> Any:
        some = list(some)
        tags.extend(loop.tag for _, loop in some)
        return real(some, *rest, **named)

    monkeypatch.setattr("pidemu.fleet.fleet.outcomes", noted)
    return tags


def check(found: FleetResult, expected: FleetResult, signals: bool = True) -> None:
    """Compare the tables and the signals, with ==."""
    unlike = {"engine": None}
    assert [repr(row | unlike) for row in found.rows()] == [repr(row | unlike) for row in expected.rows()]
    for loop in expected.loops if signals else ():
        if loop.tag != "fails":
            one, other = found[loop.tag], expected[loop.tag]
            for name in ("times", "setpoint", "measurement", "output"):
                assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)


@pytest.mark.parametrize("where", ["in a folder", "in a Parquet file", "in both"])
def test_what_is_complete_is_taken_and_the_rest_is_run(
    where: str, expected: FleetResult, ran: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = None if where == "in a Parquet file" else tmp_path / "f"
    parquet = None if where == "in a folder" else tmp_path / "fleet.parquet"
    first = interrupted(folder, parquet, monkeypatch)
    done = {loop.tag for loop, status in zip(first.loops, first.status, strict=True) if status in ("done", "unstable", "ran away")}
    ran.clear()
    result = Fleet(loops()).simulate(**STEPS, folder=folder, parquet=parquet, resume=True)
    assert set(ran) == {loop.tag for loop in loops()} - done
    assert result.resumed == len(done)
    check(result, expected, signals=folder is not None)
    if parquet is not None:
        table = pq.read_table(parquet)
        assert sorted(table["tag"].to_pylist()) == sorted(loop.tag for loop in loops() if loop.tag != "fails")
        assert not (tmp_path / "fleet.parquet.parts").exists()
    ran.clear()
    again = Fleet(loops()).simulate(**STEPS, folder=folder, parquet=parquet, resume=True)
    assert ran == ["fails"]  # which costs nothing, and may be mended by now
    check(again, expected, signals=folder is not None)


@pytest.mark.parametrize(("engine", "narrowest", "widths"), [("python", {}, [5, 5, 5, 5, 1]), ("numpy", {"numpy": 9}, [9, 9, 3])])
def test_a_fleet_of_one_structure_is_complete_block_by_block(
    engine: Any, narrowest: dict[str, int], widths: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """121 scans each: five loops are 605 scans, and what is not written has no such bound."""
    monkeypatch.setattr(local, "_WORK", 610)
    monkeypatch.setattr(local, "_NARROWEST", narrowest)
    some = alike(21)
    kept = Fleet(some).simulate(**STEPS, folder=tmp_path, engine=engine, cores=1)
    assert [np.load(path, mmap_mode="r").shape for path in sorted(tmp_path.glob("*.npy"))] == [(2, 121, n) for n in widths]
    blocks: list[int] = []

    def counted(part: Any, *rest: Any) -> Any:
        blocks.append(len(part))
        return run_block(part, *rest)

    monkeypatch.setattr(local, "run_block", counted)
    check(Fleet(some).simulate(**STEPS, engine=engine), kept, signals=False)
    assert blocks == [21]


def test_the_first_loops_that_are_kept_run_before_the_last_are_prepared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local, "_AT_ONCE_KEPT", 4)
    some = alike(9)
    Fleet(some).simulate(**STEPS, folder=tmp_path, engine="numpy")
    assert [np.load(path, mmap_mode="r").shape[2] for path in sorted(tmp_path.glob("*.npy"))] == [4, 4, 1]


def test_signals_are_complete_where_they_are_in_the_folder_and_in_the_parquet_file(
    expected: FleetResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ran: list[str]
) -> None:
    folder, parquet = tmp_path / "f", tmp_path / "fleet.parquet"
    interrupted(folder, parquet, monkeypatch)
    with (folder / INDEX).open(encoding="utf-8", newline="") as file:
        index = list(csv.reader(file))
    with (folder / INDEX).open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(index[:-2])  # two less than in the other
    ran.clear()
    check(Fleet(loops()).simulate(**STEPS, folder=folder, parquet=parquet, resume=True), expected)
    assert {row[0] for row in index[-2:]} <= set(ran)
    assert {tag.removeprefix("'") for tag in signals_of(folder)} == parquet_of(parquet).keys()  # =away is no formula


def torn(text: bytes) -> bytes:
    return text[:-30]


def without_end(text: bytes) -> bytes:
    return text[:-1]


def zeros(text: bytes) -> bytes:
    return text[:-200] + bytes(200)


def other_bytes(text: bytes) -> bytes:
    return text + b'\xff\xfe,\x00\x1b,\n"L1,block'


def emptied(text: bytes) -> bytes:
    return b""


@pytest.mark.parametrize("damage", [torn, without_end, zeros, other_bytes, emptied])
def test_an_index_that_was_not_written_whole_loses_its_last_rows_only(
    damage: Callable[[bytes], bytes], expected: FleetResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupted(tmp_path / "f", None, monkeypatch)
    index = tmp_path / "f" / INDEX
    index.write_bytes(damage(index.read_bytes()))
    result = Fleet(loops()).simulate(**STEPS, folder=tmp_path / "f", resume=True)
    assert (result.resumed == 0) == (damage is emptied)
    check(result, expected)
    listed = {INDEX, *(row["file"] for row in csv.DictReader(index.read_text(encoding="utf-8").splitlines()))}
    assert {path.name for path in (tmp_path / "f").iterdir()} == listed


@pytest.mark.parametrize("damage", ["gone", "emptied", "cut short", "other numbers", "a byte changed", "a link"])
def test_loops_of_a_block_whose_file_is_damaged_are_run_again(
    damage: str, expected: FleetResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    first = interrupted(tmp_path / "f", None, monkeypatch)
    block = sorted((tmp_path / "f").glob("*.npy"))[0]
    sound = block.read_bytes()
    if damage in ("gone", "a link"):
        block.unlink()
    if damage == "a link":
        (tmp_path / "elsewhere.npy").write_bytes(sound)
        block.symlink_to(tmp_path / "elsewhere.npy")
    elif damage == "other numbers":
        np.save(block, np.zeros((2, 300, 64), dtype=np.float32))
    elif damage != "gone":
        changed = sound[:-900] + bytes([sound[-900] ^ 1]) + sound[-899:]
        block.write_bytes({"emptied": b"", "cut short": sound[: len(sound) // 2], "a byte changed": changed}[damage])
    warn.cache_clear()
    result = Fleet(loops()).simulate(**STEPS, folder=tmp_path / "f", resume=True)
    what = {"gone": "missing", "a link": "no file of its own"}.get(damage, "damaged")
    assert caplog.messages == [f"note: {tmp_path / 'f'}: {block.name} is {what}; the loops in it are run again"]
    assert 0 < result.resumed < first.counts["done"]
    check(result, expected)


def test_where_every_block_is_damaged_all_loops_are_run_again(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """It was said that none of the loops was one of this fleet."""
    Fleet(alike(8)).simulate(**STEPS, folder=tmp_path / "f")
    (block,) = (tmp_path / "f").glob("*.npy")
    block.write_bytes(block.read_bytes()[:-1])
    warn.cache_clear()
    result = Fleet(alike(8)).simulate(**STEPS, folder=tmp_path / "f", resume=True)
    assert (result.resumed, result.counts) == (0, {"done": 8})
    assert caplog.messages == [f"note: {tmp_path / 'f'}: {block.name} is damaged; the loops in it are run again"]


@pytest.mark.parametrize("where", ["folder", "parquet"])
def test_what_a_run_is_still_writing_is_left_alone_by_another(where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place: dict[str, Any] = {where: tmp_path / "place"}
    locked = place[where] if where == "folder" else f"{place[where]}.parts"
    add = FleetResult.add
    refused: list[str] = []

    def another(self: FleetResult, found: Any) -> int:
        if not refused:
            with pytest.raises(FleetError) as error:
                Fleet(loops()).simulate(**STEPS, **place, resume=True)
            refused.append(str(error.value))
        return add(self, found)

    monkeypatch.setattr(FleetResult, "add", another)
    result = Fleet(loops()).simulate(**STEPS, **place, engine="python", cores=1)
    assert refused == [f"{locked}: another run is writing there; wait until it has ended, or give another place"]
    assert result.counts["failed"] == 1
    assert "not run" not in result.counts
    monkeypatch.undo()
    assert Fleet(loops()).simulate(**STEPS, **place, resume=True).resumed == len(loops()) - 1


def test_an_interrupted_run_goes_on_from_what_stands_beside_an_older_file(
    expected: FleetResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parquet = tmp_path / "fleet.parquet"
    parquet.write_bytes(b"older")
    first = interrupted(None, parquet, monkeypatch)
    assert parquet.read_bytes() == b"older"
    assert parquet_of(tmp_path / "fleet.interrupted.parquet").keys() >= {
        loop.tag for loop, status in zip(first.loops, first.status, strict=True) if status == "done"
    }
    result = Fleet(loops()).simulate(**STEPS, parquet=parquet, resume=True)
    assert result.resumed >= first.counts["done"]
    check(result, expected, signals=False)
    assert list(tmp_path.iterdir()) == [parquet]


def test_a_part_that_is_damaged_is_run_again(
    expected: FleetResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    parquet = tmp_path / "fleet.parquet"
    with monkeypatch.context() as patch:
        patch.setattr("pidemu.fleet.parquet.ParquetFile._join", lambda *_: None)  # as where the process is killed
        interrupted(None, parquet, monkeypatch)
    parts = sorted((tmp_path / "fleet.parquet.parts").iterdir())
    assert len(parts) == 2 or len(parts) == 3
    assert not parquet.exists()
    with pytest.raises(FleetError, match=r"fleet.parquet.parts holds what a run had done that did not end; go on with it"):
        Fleet(loops()).simulate(**STEPS, parquet=parquet)
    sound = parts[0].read_bytes()
    middle = len(sound) // 2  # in the signals
    parts[0].write_bytes(sound[:middle] + bytes([sound[middle] ^ 1]) + sound[middle + 1 :])
    warn.cache_clear()
    result = Fleet(loops()).simulate(**STEPS, parquet=parquet, resume=True)
    assert result.resumed > 0
    assert caplog.messages == [f"note: {parquet}: {parts[0].name} is damaged; the loops in it are run again"]
    check(result, expected, signals=False)
    assert sorted(parquet_of(parquet)) == sorted(loop.tag for loop in loops() if loop.tag != "fails")


def test_loops_that_changed_are_run_again_and_those_that_are_gone_are_dropped(tmp_path: Path, ran: list[str]) -> None:
    before = alike(8)
    Fleet(before).simulate(**STEPS, folder=tmp_path / "f", parquet=tmp_path / "p.parquet", engine="python")
    gain = pidemu.load_card("generic/standard").settings(K=0.7, Ti=8.0, Td=0.4, Tf=0.2)
    after = [replace(before[0], settings=gain), *before[1:6], replace(before[6], time=70.0), replace(before[7], tag="new")]
    ran.clear()
    result = Fleet(after).simulate(**STEPS, folder=tmp_path / "f", parquet=tmp_path / "p.parquet", resume=True)
    assert ran == ["L0", "L6", "new"]
    check(result, Fleet(after).simulate(**STEPS, keep=True))
    assert sorted(signals_of(tmp_path / "f")) == sorted(parquet_of(tmp_path / "p.parquet")) == sorted(x.tag for x in after)


def test_a_run_that_was_killed_before_its_second_place_held_anything_goes_on(tmp_path: Path, ran: list[str]) -> None:
    """The folder lists its first block when it is written; the Parquet file may have nothing yet."""
    where: dict[str, Any] = {"folder": tmp_path / "f", "parquet": tmp_path / "p.parquet"}
    Fleet(alike(8)).simulate(**STEPS, **where)
    where["parquet"].unlink()
    ran.clear()
    result = Fleet(alike(8)).simulate(**STEPS, **where, resume=True)
    assert len(ran) == 8
    check(result, Fleet(alike(8)).simulate(**STEPS, keep=True))
    assert sorted(parquet_of(where["parquet"])) == sorted(loop.tag for loop in alike(8))


def test_a_folder_of_another_fleet_is_refused_and_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Fleet(alike(8)).simulate(**STEPS, folder=tmp_path / "f", parquet=tmp_path / "p.parquet")
    before = {path.name: path.read_bytes() for path in (tmp_path / "f").iterdir()}
    changed: Sequence[tuple[list[Loop], dict[str, Any]]] = [
        ([replace(loop, tag=f"other {loop.tag}") for loop in alike(8)], STEPS),
        (alike(8), STEPS | {"setpoint": 6.0}),
        (alike(8, scan=0.25), STEPS),
    ]
    for others, steps in changed:
        places: list[dict[str, Any]] = [{"folder": tmp_path / "f"}, {"parquet": tmp_path / "p.parquet"}]
        for where in places:
            with pytest.raises(FleetError, match=r"none of the loops in .* is one of this fleet as it is run now"):
                Fleet(others).simulate(**steps, **where, resume=True)
    monkeypatch.setattr(finished, "__version__", "0.0.9")
    with pytest.raises(FleetError, match="with its settings, process, steps and this version of pidemu; give the place"):
        Fleet(alike(8)).simulate(**STEPS, folder=tmp_path / "f", resume=True)
    monkeypatch.undo()
    assert {path.name: path.read_bytes() for path in (tmp_path / "f").iterdir()} == before
    (tmp_path / "f" / INDEX).write_text("tag,file,loop,scan,scans\nL1,block-00001.npy,0,0.5,121\n", encoding="utf-8")
    with pytest.raises(FleetError, match="none of the loops in"):  # an index of an older version
        Fleet(alike(8)).simulate(**STEPS, folder=tmp_path / "f", resume=True)
    assert len(list((tmp_path / "f").glob("*.npy"))) == len(before) - 1


def test_there_is_nothing_to_go_on_with_where_signals_do_not_go_to_files() -> None:
    for where in ({}, {"keep": True}, {"keep": True, "parquet": "fleet.parquet"}):
        with pytest.raises(FleetError, match=r"there is nothing to go on with: .* give the folder \(--signals, folder=\) or"):
            Fleet(alike(1)).simulate(**STEPS, resume=True, **where)


def test_a_run_that_left_nothing_is_begun(tmp_path: Path) -> None:
    result = Fleet(alike(3)).simulate(**STEPS, folder=tmp_path / "new", parquet=tmp_path / "p.parquet", resume=True)
    assert (result.counts, result.resumed) == ({"done": 3}, 0)


def test_the_key_of_a_loop_depends_on_all_that_its_numbers_do_and_on_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "generic").mkdir()
    source = copied(Path(pidemu.__file__).parents[2] / "vendors" / "generic" / "standard.yaml")
    (tmp_path / "generic" / "standard.yaml").write_text(source.replace("limits: [0, 100]", "limits: [0, 95]"), encoding="utf-8")
    loop, plan = alike(1)[0], FleetPlan()
    others = [
        replace(loop, settings=pidemu.load_card("generic/standard").settings(K=0.51, Ti=8.0, Td=0.4, Tf=0.2)),
        replace(loop, settings=pidemu.load_card("generic/standard", [tmp_path]).settings(K=0.5, Ti=8.0, Td=0.4, Tf=0.2)),
        replace(loop, settings=pidemu.load_card("generic/standard").settings(K=0.5, Ti=8.0, Td=0.4, Tf=0.2, pv_range=(0, 50))),
        replace(loop, process=Process.from_lags(0.9, [5.0], delay=2.1)),
        replace(loop, scan=0.25),
        replace(loop, setpoint=5.0),
        replace(loop, load=(3.0, 1.0)),
        replace(loop, time=9.0),
        replace(loop, action="direct"),
        replace(loop, output_limits=(0, 90)),
        replace(loop, initial=(50, 50, 40)),
    ]
    found = [*keys([loop, *others], plan), *keys([loop], replace(plan, margins=False)), *keys([loop], replace(plan, load=3.0))]
    assert len(set(found)) == len(found)
    again = pidemu.load_card("generic/standard").settings(Tf=0.2, Td=0.4, Ti=8, K=0.5)
    same = replace(loop, tag="other name", settings=again, setpoint=10.0)
    assert keys([same], replace(plan, engine="python", keep=True)) == found[:1]


def test_keys_are_those_of_another_process() -> None:
    code = "from tests.fleet.test_resume import *; print(*keys(alike(3), FleetPlan()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2])
    assert done.stdout.split() == keys(alike(3), FleetPlan())
