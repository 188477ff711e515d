"""Kill fleets at random moments, and see what is left: ``python -m tests.fleet.killing [RUNS] [SEED]``.

Each run is a command of its own that writes signals, a Parquet file and a table, killed (SIGKILL, SIGTERM or SIGINT) after a random
time, most often while it writes. What is there afterwards must be readable and complete as far as it goes, and the command with
``--resume`` must end, with the very numbers of a run that nobody disturbed.
"""

from __future__ import annotations

import csv
import random
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow.parquet as pq

from pidemu.fleet.folder import INDEX

KILLS: Final = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
COUNT: Final = 130
_HEAD: Final = "tag,card,settings,process,scan,time\n"
_WORDS: Final = ("--signals", "signals", "--parquet", "fleet.parquet", "--table", "table.csv", "--cores", "2", "--no-margins")
_ELSEWHERE: Final = ("engine",)
"""Columns that are not the loop's but those of whatever ran it."""


def write_loops(path: Path, count: int = COUNT) -> None:
    """Write a file of loops of several structures and lengths, so that many blocks are done one after the other."""
    rows = []
    for i in range(count):
        card, settings = (("generic/standard", f"K={1 + i % 7 / 10}; Ti={10 + i % 11}"), ("fisher/provox", "GAIN=1; RESET=2"))[
            i % 2
        ]
        rows.append(f'L{i},{card},{settings},"gain=1,lag={5 + i % 9},delay={2 + i % 3}",0.5,{5000 + 500 * (i % 13)}\n')
    path.write_text(_HEAD + "".join(rows), encoding="utf-8")


def start(folder: Path, *more: str) -> subprocess.Popen[str]:
    """Start the command in a folder with ``loops.csv``."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # as in the background of a shell; it would ignore it, too
        signal.signal(signal.SIGINT, signal.default_int_handler)
    words = [sys.executable, "-m", "pidemu", "fleet", "loops.csv", "--engine", "python", *_WORDS, *more]
    return subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def table_of(path: Path) -> dict[str, dict[str, str]]:
    """Return the rows of a table by tag, without what depends on how they were run."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {row["tag"]: {name: x for name, x in row.items() if name not in _ELSEWHERE} for row in rows}


def signals_of(folder: Path) -> dict[str, bytes]:
    """Return the signals that the index of a folder lists, by tag."""
    with (folder / INDEX).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    blocks: dict[str, Any] = {}
    found = {}
    for row in rows:
        if row["file"] not in blocks:
            blocks[row["file"]] = np.load(folder / row["file"])
        found[row["tag"]] = blocks[row["file"]][:, : int(row["scans"]), int(row["loop"])].tobytes()
    return found


def parquet_of(path: Path) -> dict[str, bytes]:
    """Return the signals of a Parquet file, by tag."""
    table = pq.read_table(path, columns=["tag", "output", "measurement"])
    return {r["tag"]: np.array([r["output"], r["measurement"]]).tobytes() for r in table.to_pylist()}


@dataclass
class Whole:
    """What a run gives that nobody disturbs."""

    table: dict[str, dict[str, str]]
    signals: dict[str, bytes]
    first: float
    seconds: float

    @classmethod
    def run(cls, folder: Path) -> Whole:
        """Run it."""
        write_loops(folder / "loops.csv")
        begun = time.monotonic()
        process = start(folder)
        while not (folder / "signals" / INDEX).exists() and process.poll() is None:
            time.sleep(0.01)
        first = time.monotonic() - begun
        out, err = process.communicate(timeout=300)
        assert (process.returncode, err) == (0, ""), (out, err)
        found = cls(table_of(folder / "table.csv"), signals_of(folder / "signals"), first, time.monotonic() - begun)
        assert parquet_of(folder / "fleet.parquet") == found.signals
        assert len(found.table) == len(found.signals) == COUNT
        return found

    def moment(self, share: float) -> float:
        """Return when a share of the time is over in which blocks are written [s]."""
        return self.first + share * (self.seconds - self.first)


def kill_and_resume(folder: Path, whole: Whole, number: int, after: float) -> int:
    """Kill a run after some seconds, check what is left, and go on; return how many loops were done by then."""
    folder.mkdir()
    write_loops(folder / "loops.csv")
    process = start(folder)
    try:
        process.wait(timeout=after)
    except subprocess.TimeoutExpired:
        process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert "Traceback" not in err, err
    # Python ends itself with SIGINT, after all is done, where the interrupt came while it executed a text, as dataclasses do
    assert process.returncode in (0, -number, 128 + number, -signal.SIGINT), (process.returncode, err)
    done = check_what_is_left(folder, whole)
    if process.returncode == 128 + number:  # it had time to say and to write what it had done
        assert err.splitlines()[-1].startswith("interrupted"), err
    process = start(folder, "--resume")
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, (process.returncode, out, err)
    assert table_of(folder / "table.csv") == whole.table
    assert signals_of(folder / "signals") == whole.signals
    assert parquet_of(folder / "fleet.parquet") == whole.signals
    listed = {INDEX, *(row for row in files_listed(folder / "signals"))}
    assert {path.name for path in (folder / "signals").iterdir()} == listed
    assert {path.name for path in folder.iterdir()} - {"loops.csv", "signals", "fleet.parquet", "table.csv"} == unfinished(folder)
    return done


def unfinished(folder: Path) -> set[str]:
    """Return the names of files that a kill left half written beside what they were to become."""
    return {path.name for path in folder.iterdir() if path.name.endswith(".unfinished")}


def files_listed(folder: Path) -> set[str]:
    """Return the names of the files that an index lists."""
    with (folder / INDEX).open(encoding="utf-8", newline="") as file:
        return {row["file"] for row in csv.DictReader(file)}


def check_what_is_left(folder: Path, whole: Whole) -> int:
    """Check that all that can be read after a kill is complete; return how many loops are done."""
    done = 0
    if (folder / "signals" / INDEX).exists():
        found = signals_of(folder / "signals")
        assert found.items() <= whole.signals.items()
        done = len(found)
    for path in [folder / "fleet.parquet", *(folder / "fleet.parquet.parts").glob("part-*.parquet")]:
        if path.exists():
            assert parquet_of(path).items() <= whole.signals.items()
    if (folder / "table.csv").exists():
        rows = table_of(folder / "table.csv")
        assert rows.keys() == whole.table.keys()
        ran = {tag: row for tag, row in rows.items() if row["status"] != "not run"}
        assert ran.items() <= whole.table.items()
    return done


def kill_many(folder: Path, runs: int, seed: int) -> list[int]:
    """Kill so many runs at random moments; return how many loops each had done."""
    chance = random.Random(seed)
    (folder / "whole").mkdir()
    whole = Whole.run(folder / "whole")
    found = []
    for i in range(runs):
        number = KILLS[i % len(KILLS)]
        found.append(kill_and_resume(folder / str(i), whole, number, whole.moment(chance.uniform(-0.2, 1.1))))
        shutil.rmtree(folder / str(i))
    return found


if __name__ == "__main__":
    import tempfile

    runs, seed = (int(x) for x in (sys.argv[1:] + ["50", "1"][len(sys.argv) - 1 :])[:2])
    with tempfile.TemporaryDirectory() as where:
        begun = time.monotonic()
        done = kill_many(Path(where), runs, seed)
    print(f"seed {seed}: {runs} runs killed, with {done} loops of {COUNT} done by then; all went on to the same numbers")
    print(f"{time.monotonic() - begun:.0f} s")
