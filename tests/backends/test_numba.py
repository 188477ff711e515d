"""What Numba compiled is there the next time, for every process that looks; blocks of loops give the bits of Python."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu import Process
from pidemu.backends import numba as target
from pidemu.backends import python
from pidemu.backends.python import starting
from pidemu.checks.runs import plausible
from pidemu.files import cache
from pidemu.program.ir import Program
from pidemu.simulation.measured import measured
from pidemu.simulation.trial import trial

SOURCE = Path(pidemu.__file__).parent.parent
OTHER_PROCESS = """
import json
import numpy as np
import pidemu
from pidemu.backends import numba
from pidemu.files import cache

s = pidemu.load_card("generic/standard").settings(K=1.5, Ti=10, Td=0)
c = pidemu.Controller(s, 0.5, engine="numba")
out = c.run(50 + np.arange(200) % 7, np.full(200, 49.0))
module, _ = numba._record_module(c.program.structure)
stats = module.run_automatic.stats
print(json.dumps([sum(stats.cache_hits.values()), sum(stats.cache_misses.values()), out.tolist(), str(cache.folder())]))
"""


def started(folder: Path, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", OTHER_PROCESS],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=SOURCE,
        env={**os.environ, "PIDEMU_CACHE": str(folder), **environment},
    )


def said(process: subprocess.Popen[str]) -> tuple[int, int, list[float], str]:
    out, error = process.communicate(timeout=60)
    assert error == ""
    hits, misses, outputs, file = json.loads(out)
    return hits, misses, outputs, file


def expected() -> list[float]:
    settings = pidemu.load_card("generic/standard").settings(K=1.5, Ti=10, Td=0)
    found: list[float] = pidemu.Controller(settings, 0.5, engine="python").run(50 + np.arange(200) % 7, np.full(200, 49.0)).tolist()
    return found


def test_a_second_process_loads_what_the_first_compiled(tmp_path: Path) -> None:
    first = said(started(tmp_path))
    second = said(started(tmp_path))
    assert first[:2] == (0, 1)
    assert second[:2] == (1, 0)
    assert first[2] == second[2] == expected()
    assert Path(first[3]).is_relative_to(tmp_path)
    assert first[3] == second[3]


def test_two_processes_that_compile_at_once_do_not_disturb_each_other(tmp_path: Path) -> None:
    both = [started(tmp_path), started(tmp_path)]
    found = [said(process) for process in both]
    assert found[0][2] == found[1][2] == expected()
    assert said(started(tmp_path))[:2] == (1, 0)
    files = list((tmp_path / pidemu.__version__).iterdir())
    assert {path.suffix for path in files if path.is_file()} == {".numba"}  # half-written files do not stay


@pytest.mark.parametrize("folder", ["/dev/null/pidemu", "~nobody-of-that-name/pidemu"])
def test_a_cache_folder_that_cannot_be_written_is_replaced_by_a_temporary_one(folder: str, tmp_path: Path) -> None:
    hits, misses, outputs, file = said(started(Path(folder), TMPDIR=str(tmp_path)))
    assert (hits, misses, outputs) == (0, 1, expected())
    assert Path(file).is_relative_to(tmp_path)
    assert list(tmp_path.glob("pidemu-*")) == []  # it is gone when the process is


def program_of(card_id: str, process: Process) -> Program:
    settings = plausible(pidemu.load_card(card_id).variant({}))
    return measured(trial(settings, process, 0.5, time=60, output_limits=(0, 100), action="reverse"))


def alone(program: Program, scans: int) -> tuple[Any, list[Any]]:
    state: list[Any] = [*starting(program), *(deque([0.0] * n) for n in program.lengths)]
    with np.errstate(all="ignore"):
        return python.runner(program).run(state, [], scans), state


@pytest.mark.parametrize("card_id", ["emerson/deltav", "oscat/ft-pid", "toshiba/pid3"])
def test_a_block_gives_the_bits_of_its_loops_each_with_its_delay(card_id: str) -> None:
    program, scans, width = program_of(card_id, Process.from_lags(1.1, [7, 2], delay=2.3)), 130, target.WIDTH
    chance = np.random.default_rng(7)
    lengths = chance.integers(1, 90, (1, width))
    values = np.array(program.values)[:, None] * np.ones(width)
    moved = [i for i, q in enumerate(program.coefficients) if q.name.startswith(("process_", "sp_step"))]
    values[moved] *= chance.uniform(0.9, 1.1, (len(moved), width))
    states = np.repeat(np.array(program.initial)[:, None], width, axis=1)
    rings, found = np.zeros((1, 91, width)), np.empty((2, scans, width))
    run = target.block(program.structure)
    for a, b in ((0, 1), (1, 40), (40, 130)):
        run(values, states, np.empty((0, b - a, width)), rings, lengths, a, found[:, a:b])
    for i in range(width):
        expected, state = alone(replace(program, values=tuple(values[:, i].tolist()), lengths=(int(lengths[0, i]),)), scans)
        assert np.array_equal(found[:, :, i], expected, equal_nan=True)
        assert np.array_equal(states[:, i], [float(x) for x in state[: len(program.states)]], equal_nan=True)
    assert np.ptp(found, axis=1).max() > 1


def test_what_is_compiled_and_loaded_is_known(no_code_yet: Path) -> None:
    structure = program_of("generic/standard", Process.from_lags(1.1, [7])).structure
    assert (target.is_compiled(structure, blocks=True), target.is_loaded(structure, blocks=True)) == (False, False)
    run, width = target.block(structure), target.WIDTH
    assert not target.is_loaded(structure, blocks=True)  # nothing is compiled before it is called
    run(
        np.zeros((len(structure.coefficients), width)),
        np.zeros((len(structure.states), width)),
        np.empty((0, 1, width)),
        np.empty((0, 1, width)),
        np.empty((0, width), dtype=np.int64),
        0,
        np.empty((2, 1, width)),
    )
    assert target.is_loaded(structure, blocks=True)
    assert target.is_compiled(structure, blocks=True)
    assert (target.is_compiled(structure), target.is_loaded(structure)) == (False, False)  # one loop is another function
    assert [path.suffix for path in (no_code_yet / pidemu.__version__).iterdir()] == [".numba"]


def test_programs_that_differ_in_numbers_share_what_is_compiled(no_code_yet: Path) -> None:
    card = pidemu.load_card("generic/standard")
    for K in (1.5, 2.5):
        controller = pidemu.Controller(card.settings(K=K, Ti=10, Td=0), 0.5, engine="numba")
        controller.run(50.0, np.full(100, 49.0))
    module, _ = target._record_module(controller.program.structure)
    assert len(module.run_automatic.signatures) == 1
    assert len(list((no_code_yet / pidemu.__version__).iterdir())) == 1


BAIT = """
import os, pickle, sys
class Bait:
    def __reduce__(self):
        return os.system, (f"echo unpickled > {sys.argv[1]}",)
sys.stdout.buffer.write(pickle.dumps(Bait()))
"""


@pytest.mark.parametrize("damage", ["emptied", "cut short", "a bit turned", "a pickle that runs something"])
def test_a_damaged_or_foreign_file_is_never_unpickled_and_is_compiled_anew(damage: str, tmp_path: Path) -> None:
    code, bait = tmp_path / "code", tmp_path / "bait"
    first = said(started(code))
    (path,) = (code / pidemu.__version__).glob("*.numba")
    sound = path.read_bytes()
    middle = len(sound) // 2
    turned = sound[:middle] + bytes([sound[middle] ^ 1]) + sound[middle + 1 :]
    foreign = subprocess.run([sys.executable, "-c", BAIT, str(bait)], capture_output=True, check=True).stdout
    damaged = {"emptied": b"", "cut short": sound[:middle], "a bit turned": turned, "a pickle that runs something": foreign}
    path.write_bytes(damaged[damage])
    second = said(started(code))
    assert (second[:2], second[2]) == ((0, 1), first[2])
    assert not bait.exists()
    assert said(started(code))[:2] == (1, 0)


def test_what_fits_another_version_of_numba_is_compiled_anew(no_code_yet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = pidemu.load_card("generic/standard").settings(K=1.5, Ti=10, Td=0)
    pidemu.Controller(settings, 0.5, engine="numba").run(50.0, np.full(100, 49.0))
    (path,) = (no_code_yet / pidemu.__version__).iterdir()
    stem = path.name.partition("-")[0]
    path.unlink()
    cache.keep(stem, ".numba", b"sound, and no pickle that this Numba knows")
    target._record_module.cache_clear()
    found = pidemu.Controller(settings, 0.5, engine="numba").run(50.0, np.full(100, 49.0))
    assert found.tolist() == pidemu.Controller(settings, 0.5, engine="python").run(50.0, np.full(100, 49.0)).tolist()


def test_a_disk_without_room_costs_nothing_but_the_next_compilation(no_code_yet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*args: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pidemu.backends.numba_store.keep", full)
    settings = pidemu.load_card("generic/standard").settings(K=1.5, Ti=10, Td=0)
    found = pidemu.Controller(settings, 0.5, engine="numba").run(50.0, np.full(100, 49.0))
    assert found.tolist() == pidemu.Controller(settings, 0.5, engine="python").run(50.0, np.full(100, 49.0)).tolist()
    assert list((no_code_yet / pidemu.__version__).iterdir()) == []
