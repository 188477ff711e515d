"""A disk that is full is said in one line; what was there stays, what is listed is complete, and the run can be gone on with."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest

from pidemu.fleet.folder import INDEX
from tests.fleet.killing import parquet_of, signals_of, table_of

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the size of files is not limited there")
LIMITED = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv.pop(1)),) * 2)
from pidemu.cli import main
main()
"""
FOLDER, PARQUET = ("--signals", "s"), ("--parquet", "fleet.parquet")
HEAD = "tag,card,settings,process,scan,time\n"


def write_loops(folder: Path) -> None:
    """Write loops of which the later ones take more room: 16 bytes per scan."""
    rows = (f'L{i},generic/standard,K=1; Ti=10,"gain=1,lag=5,delay=2",0.5,{100 * 2**i}\n' for i in range(10))
    (folder / "loops.csv").write_text(HEAD + "".join(rows), encoding="utf-8")


def run(folder: Path, limit: int | None, *words: str) -> subprocess.CompletedProcess[str]:
    begin = ["-m", "pidemu"] if limit is None else ["-c", LIMITED, str(limit)]
    command = [sys.executable, *begin, "fleet", "loops.csv", "--cores", "1", "--engine", "python", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=120)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_loops(tmp_path)
    (tmp_path / "table.csv").write_text("an older one", encoding="utf-8")
    (tmp_path / "fleet.parquet").write_bytes(b"an older one")
    return tmp_path


@pytest.mark.parametrize("limit", [300, 3_000, 30_000, 100_000])
@pytest.mark.parametrize("words", [FOLDER, PARQUET, FOLDER + PARQUET])
def test_signals_for_which_there_is_no_room_are_an_error_and_the_run_is_gone_on_with(
    words: tuple[str, ...], limit: int, folder: Path
) -> None:
    done = run(folder, limit, *words, "--table", "table.csv")
    assert (done.returncode, done.stdout) == (2, ""), done
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("error: ")
    assert "cannot be written: " in done.stderr
    assert (folder / "table.csv").read_text(encoding="utf-8") == "an older one"
    assert (folder / "fleet.parquet").read_bytes() == b"an older one"
    whole = folder / "whole"
    whole.mkdir()
    write_loops(whole)
    assert run(whole, None, *words, "--table", "table.csv").returncode == 0
    if (folder / "s" / INDEX).exists():
        assert signals_of(folder / "s").items() <= signals_of(whole / "s").items()
        assert {p.name for p in (folder / "s").iterdir()} == {INDEX, *files_of(folder / "s")}
    again = run(folder, None, *words, "--table", "table.csv", "--resume")
    assert again.returncode == 0, again
    assert table_of(folder / "table.csv") == table_of(whole / "table.csv")
    if "--signals" in words:
        assert signals_of(folder / "s") == signals_of(whole / "s")
    if "--parquet" in words:
        assert parquet_of(folder / "fleet.parquet") == parquet_of(whole / "fleet.parquet")


def files_of(folder: Path) -> set[str]:
    with (folder / INDEX).open(encoding="utf-8", newline="") as file:
        return {row["file"] for row in csv.DictReader(file)}


def test_a_table_for_which_there_is_no_room_is_an_error_and_the_old_one_stays(folder: Path) -> None:
    done = run(folder, 300, "--table", "table.csv")
    assert (done.returncode, done.stderr) == (2, "error: table.csv: cannot be written: the disk is full\n")
    assert (folder / "table.csv").read_text(encoding="utf-8") == "an older one"
    assert {p.name for p in folder.iterdir()} == {"loops.csv", "table.csv", "fleet.parquet"}


@pytest.mark.parametrize("engine", ["c", "numba"])
def test_a_cache_for_which_there_is_no_room_costs_nothing_but_time(engine: str, folder: Path) -> None:
    whole = run(folder, None, "--table", "whole.csv")
    command = [sys.executable, "-c", LIMITED, "20000", "fleet", "loops.csv", "--engine", engine, "--table", "t.csv"]
    environment = {**os.environ, "PIDEMU_CACHE": str(folder / "code"), "TMPDIR": str(folder)}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=120, env=environment)
    assert (done.returncode, whole.returncode) == (0, 0), done
    assert len(done.stderr.splitlines()) <= 1
    assert "Traceback" not in done.stderr
    assert table_of(folder / "t.csv") == table_of(folder / "whole.csv")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0 or sys.platform != "linux", reason="only root may mount")
def test_a_file_system_that_is_full_is_an_error_and_the_run_is_gone_on_with(tmp_path: Path) -> None:
    small = tmp_path / "small"
    small.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", str(small)], capture_output=True, text=True, check=False
    )
    if mounted.returncode:
        pytest.skip(f"no file system may be mounted here: {mounted.stderr.strip()}")
    try:
        write_loops(small)
        done = run(small, None, "--signals", "s", "--table", "table.csv")
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith("error: ")
        assert "No space left on device" in done.stderr
        assert not (small / "table.csv").exists()
        there = signals_of(small / "s")
        assert there
        subprocess.run(["mount", "-o", "remount,size=20m", str(small)], check=True)
        again = run(small, None, "--signals", "s", "--table", "table.csv", "--resume")
        assert again.returncode == 0, again
        assert there.items() <= signals_of(small / "s").items()
        assert len(table_of(small / "table.csv")) == 10
    finally:
        subprocess.run(["umount", str(small)], check=True)
