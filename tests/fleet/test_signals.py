"""Signals in memory, in a folder and in a Parquet file are those of each loop alone; what cannot be written is said."""

from __future__ import annotations

import builtins
import csv
import math
import os
import sys
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq
import pytest

from pidemu import Fleet, FleetError, FleetResult, Loop, Simulation
from pidemu.backends.engine_names import Engine
from pidemu.fleet import local
from pidemu.fleet.blocks import COLUMNS
from pidemu.fleet.finished import FIELDS
from pidemu.fleet.folder import INDEX
from pidemu.fleet.judgement import MARGINS, RAN
from pidemu.fleet.signals import SignalStore
from tests.fleet.support import EVERY_ENGINE, alike, alone, check_signals, few

STEPS: dict[str, Any] = {"setpoint": 5.0, "load": (31.0, -20.0), "time": 60.0}


def fleet() -> list[Loop]:
    """Several blocks, loops of unlike length in them, and one that fails."""
    loops = [*alike(70), *(replace(loop, tag=f"short {loop.tag}", time=45.0 + i) for i, loop in enumerate(alike(5))), *few()]
    return [*loops, replace(loops[0], tag="fails", scan=0.0)]


@pytest.fixture(scope="module")
def each() -> list[Simulation]:
    return [alone(loop, **STEPS) for loop in fleet()[:-1]]


def read_index(folder: Path) -> list[dict[str, str]]:
    if not (folder / INDEX).exists():
        return []
    with (folder / INDEX).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("engine", EVERY_ENGINE)
def test_a_folder_holds_the_signals_of_every_loop(engine: Engine, tmp_path: Path, each: list[Simulation]) -> None:
    loops = fleet()
    result = Fleet(loops).simulate(**STEPS, folder=tmp_path / "deep" / "signals", engine=engine)
    folder = tmp_path / "deep" / "signals"
    index = read_index(folder)
    assert list(index[0]) == ["tag", "file", "loop", "sha256", *FIELDS]
    assert sorted(row["tag"] for row in index) == sorted(loop.tag for loop in loops[:-1])
    assert {path.name for path in folder.iterdir()} == {INDEX, *(row["file"] for row in index)}
    places = {loop.tag: i for i, loop in enumerate(loops)}
    for row in index:
        one, scans = each[places[row["tag"]]], int(row["scans"])
        output, measurement = np.load(folder / row["file"])[:, :, int(row["loop"])]
        assert (float(row["scan"]), scans) == (one.scan, one.times.size)
        assert np.array_equal(output[:scans], one.output)
        assert np.array_equal(measurement[:scans], one.measurement)
        assert np.isnan([output[scans:], measurement[scans:]]).all()
    check_signals(result, loops[:-1], each)
    with pytest.raises(FleetError, match="loop 'fails' has no signals: the scan interval"):
        result["fails"]


def test_a_folder_is_used_once(tmp_path: Path) -> None:
    Fleet(alike(3)).simulate(**STEPS, folder=tmp_path)
    before = {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    with pytest.raises(
        FleetError, match=r"holds the signals of a fleet already; go on with them \(--resume, resume=True\), give another"
    ):
        Fleet(alike(4)).simulate(**STEPS, folder=tmp_path)
    assert {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == before
    (tmp_path / INDEX).unlink()  # as after a run that was killed
    with pytest.raises(FleetError, match="holds the signals of a fleet already"):
        Fleet(alike(4)).simulate(**STEPS, folder=tmp_path)


def test_other_files_in_a_folder_do_not_matter(tmp_path: Path) -> None:
    (tmp_path / "loops.csv").write_text("mine", encoding="utf-8")
    assert Fleet(alike(3)).simulate(**STEPS, folder=tmp_path)["L1"].output.size == 121
    assert (tmp_path / "loops.csv").read_text(encoding="utf-8") == "mine"


def test_signals_in_a_folder_take_no_memory(tmp_path: Path) -> None:
    loops, scans = alike(200), 10_001
    signals = 2 * 200 * scans * 8
    Fleet(loops[:2]).simulate(**STEPS, engine="numpy", folder=tmp_path / "warm")  # whatever is imported and made once
    tracemalloc.start()
    try:
        result = Fleet(loops).simulate(time=5000.0, folder=tmp_path / "new", engine="numpy", cores=1)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert result.scans.tolist() == [scans] * 200
    assert sum(path.stat().st_size for path in (tmp_path / "new").glob("*.npy")) >= signals
    assert peak < signals / 5


@pytest.mark.skipif(sys.platform == "win32", reason="the number of open files is not limited there")
def test_more_blocks_than_a_process_may_have_files_open_are_kept(tmp_path: Path) -> None:
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    loops = [replace(loop, time=20.0 + i) for i, loop in enumerate(alike(150))]  # in Python, every one is a block
    resource.setrlimit(resource.RLIMIT_NOFILE, (len(os.listdir("/dev/fd")) + 40, hard))
    try:
        result = Fleet(loops).simulate(folder=tmp_path, engine="python")
        signals = [result[loop.tag] for loop in loops]
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert len(list(tmp_path.glob("*.npy"))) == 150
    assert [s.output.size for s in signals] == [41 + 2 * i for i in range(150)]


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.skipif(sys.platform == "win32", reason="the size of files is not limited there")
def test_a_file_that_there_is_no_room_for_is_an_error_and_what_is_stored_can_be_read(tmp_path: Path) -> None:
    loops = [*alike(4, time=20.0), *(replace(loop, tag=f"long {loop.tag}") for loop in alike(4, time=5000.0))]
    with files_up_to(100_000), pytest.raises(FleetError, match=r"block-00002.npy: cannot be written: .*with enough room"):
        Fleet(loops).simulate(folder=tmp_path, engine="numpy", cores=1)
    index = read_index(tmp_path)
    assert {row["tag"] for row in index} in (set(), {f"L{i}" for i in range(4)})
    assert {path.name for path in tmp_path.iterdir()} == ({INDEX} if index else set()) | {row["file"] for row in index}


def test_a_place_that_cannot_be_written_is_an_error_with_its_name(tmp_path: Path) -> None:
    taken = tmp_path / "taken"
    taken.write_text("a file", encoding="utf-8")
    with pytest.raises(FleetError, match=r"taken: cannot be written: File exists; give a folder that can be made"):
        Fleet(alike(1)).simulate(**STEPS, folder=taken)
    with pytest.raises(FleetError, match=r"below: cannot be written: Not a directory; give a folder"):
        Fleet(alike(1)).simulate(**STEPS, folder=taken / "below")
    with pytest.raises(FleetError, match=r"fleet.parquet: cannot be written: No such file or directory"):
        Fleet(alike(1)).simulate(**STEPS, parquet=tmp_path / "no" / "fleet.parquet")
    with pytest.raises(FleetError, match=r"cannot be written: it is a folder"):
        Fleet(alike(1)).simulate(**STEPS, parquet=tmp_path)
    assert list(tmp_path.iterdir()) == [taken]


def test_a_folder_that_is_taken_away_while_the_fleet_runs_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*args: Any, **named: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(np.lib.format, "open_memmap", refused)
    with pytest.raises(FleetError, match=r"block-00001.npy: cannot be written: Permission denied; give a folder"):
        Fleet(alike(1)).simulate(**STEPS, folder=tmp_path / "new")
    monkeypatch.undo()
    Fleet(alike(1)).simulate(**STEPS, folder=tmp_path / "new")  # nothing is left that would be in the way
    assert [row["tag"] for row in read_index(tmp_path / "new")] == ["L0"]


def test_an_interrupted_fleet_leaves_an_index_of_what_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loops, add, seen = alike(200, time=200.0), FleetResult.add, []

    def interrupted(self: FleetResult, found: Any) -> int:
        seen.append(add(self, found))
        if len(seen) == 2:
            raise KeyboardInterrupt
        return seen[-1]

    monkeypatch.setattr(FleetResult, "add", interrupted)
    result = Fleet(loops).simulate(folder=tmp_path / "f", parquet=tmp_path / "fleet.parquet", engine="python", cores=2)
    done = {loop.tag for loop, status in zip(loops, result.status, strict=True) if status in RAN}
    index = read_index(tmp_path / "f")
    assert result.interrupted
    assert 0 < len(done) < 200
    assert {row["tag"] for row in index} == done == set(pq.read_table(tmp_path / "fleet.parquet")["tag"].to_pylist())
    assert {path.name for path in (tmp_path / "f").iterdir()} == {INDEX, *(row["file"] for row in index)}


def lists(table: Any, name: str) -> list[npt.NDArray[np.float64]]:
    return [row.values.to_numpy() for row in table[name]]


@pytest.mark.parametrize("kept", ["nowhere else", "in memory", "in a folder"])
def test_a_parquet_file_holds_figures_and_signals(kept: str, tmp_path: Path, each: list[Simulation]) -> None:
    loops, path = fleet(), tmp_path / "fleet.parquet"
    path.write_bytes(b"an older one")
    folder = tmp_path / "f" if kept == "in a folder" else None
    result = Fleet(loops).simulate(**STEPS, parquet=path, folder=folder, keep=kept == "in memory")
    table = pq.read_table(path)
    assert table.column_names == ["tag", "card", *FIELDS, "output", "measurement"]
    places = [[loop.tag for loop in loops].index(tag) for tag in table["tag"].to_pylist()]
    assert sorted(places) == list(range(len(loops) - 1))
    assert table["card"].to_pylist() == [loops[i].settings.card.id for i in places]
    for name in COLUMNS:
        assert np.array_equal(table[name].to_numpy(), result.columns[name][places])
    for name in MARGINS:
        found = [math.nan if x is None else x for x in table[name].to_pylist()]
        assert np.array_equal(found, result.columns[name][places], equal_nan=True)
    for name, known in (("status", result.status), ("settled", result.settled), ("stable", result.stable)):
        assert table[name].to_pylist() == [known[i] for i in places]
    for output, measurement, i in zip(lists(table, "output"), lists(table, "measurement"), places, strict=True):
        assert np.array_equal(output, each[i].output)
        assert np.array_equal(measurement, each[i].measurement)
    assert {p.name for p in tmp_path.iterdir()} == {"fleet.parquet"} | ({"f"} if kept == "in a folder" else set())
    if kept == "nowhere else":
        with pytest.raises(FleetError, match="were not kept; run the fleet with keep=True"):
            result["L0"]
    else:
        check_signals(result, loops[:-1], each)


def test_a_parquet_file_that_is_there_stays_where_the_run_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "fleet.parquet"
    path.write_bytes(b"an older one")
    monkeypatch.setattr(local, "grouped", lambda ready: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        Fleet(alike(3)).simulate(**STEPS, parquet=path)
    assert path.read_bytes() == b"an older one"
    assert list(tmp_path.iterdir()) == [path]


def test_without_pyarrow_the_remedy_is_named_and_nothing_is_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    there = builtins.__import__

    def without(name: str, *args: Any, **named: Any) -> Any:
        if name.partition(".")[0] == "pyarrow":
            raise ImportError(name)
        return there(name, *args, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    monkeypatch.setattr(local, "outcomes", lambda *_, **__: pytest.fail("it ran"))
    with pytest.raises(
        FleetError, match=r"a Parquet file needs pyarrow, which is not installed; pip install 'pidemu\[parquet\]' brings it"
    ):
        Fleet(alike(1)).simulate(**STEPS, parquet=tmp_path / "fleet.parquet")
    assert list(tmp_path.iterdir()) == []


def test_a_store_keeps_in_memory_what_it_is_asked_to() -> None:
    with SignalStore() as store:
        assert store.room((2, 3, 4)).shape == (2, 3, 4)


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="room cannot be reserved there")
def test_the_room_of_a_block_is_reserved_before_it_is_run(tmp_path: Path) -> None:
    with SignalStore(folder=tmp_path) as store:
        records = store.room((2, 1000, 64))
        (path,) = tmp_path.glob("*.npy")
        assert path.stat().st_blocks * 512 >= records.nbytes  # a full disk is met here, not while a thread writes
