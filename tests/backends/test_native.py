"""The engine "c": programs compiled by the machine's C compiler and run in this process."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.backends import native, python
from pidemu.card.library import card_files
from pidemu.errors import EngineError
from pidemu.files import cache
from pidemu.program.ir import Assign, Line, Name, Program, Quantity
from tests.backends.c_compiler import needs_compiler
from tests.helpers import Floats

_PID = {"kp": 2, "ki": 0.1, "kd": 1, "Tf": 1}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty cache folder, and nothing compiled so far."""
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path))
    cache.folder.cache_clear()
    native._compiled.cache_clear()
    yield cache.folder()
    cache.folder.cache_clear()
    native._compiled.cache_clear()


def signals(seed: int, scans: int) -> list[Floats]:
    rng = np.random.default_rng(seed)
    auto = np.repeat(rng.integers(0, 2, scans // 10), 10).astype(float)
    manual = np.where(rng.random(scans) < 0.5, rng.uniform(0, 100, scans), np.nan)
    return [np.repeat(rng.uniform(-40, 140, scans // 10), 10), 50 + rng.normal(0, 40, scans), auto, manual]


def beginning(program: Program) -> list[Any]:
    return [*python.starting(program), *(deque([0.0] * length) for length in program.lengths)]


def check(program: Program, made: list[Floats], *parts: tuple[int, int]) -> None:
    """Run a program here and in Python, part after part: the same outputs, and the same state to go on from."""
    expected, found = beginning(program), beginning(program)
    one, other = python.runner(program).run, native.runner(program).run
    for start, end in parts:
        now = [s[start:end] for s in made]
        with np.errstate(all="ignore"):
            assert one(expected, now, end - start).tolist() == other(found, now, end - start).tolist()
        assert expected == found
        assert [type(x) for x in expected] == [type(x) for x in found]


@needs_compiler
@pytest.mark.parametrize("card_id", list(card_files())[::3])
def test_outputs_and_states_are_those_of_python(card_id: str) -> None:
    card = pidemu.load_card(card_id)
    program = pidemu.Controller(card.settings(card.data.examples[0].given)).program
    check(program, signals(5, 100), (0, 40), (40, 41), (41, 100))


def delaying(lengths: tuple[int, int], precision: Any = "float64") -> Program:
    names = ("x", "k", "total")
    x, k, total = (Quantity(n, "", "") for n in names)
    return Program(
        "", (x,), (k,), (0.1,), (total,), (1.0,),
        (
            Assign("u", Name("x") * Name("k") + Name("late"), ""),
            Assign("total", Name("total") + Name("u") * Name("later"), ""),
        ),
        lines=(Line("late", "", "", "u"), Line("later", "", "", "total")), lengths=lengths, also=("total",), precision=precision,
        wide=frozenset({"later", "total"}) if precision == "float32" else frozenset(),
    )  # fmt: skip


@needs_compiler
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_delay_lines_hold_afterwards_what_is_under_way(precision: Any) -> None:
    x = np.random.default_rng(1).normal(0, 1, 60)
    check(delaying((7, 3), precision), [x], (0, 5), (5, 6), (6, 29), (29, 60))


@needs_compiler
def test_loops_that_differ_in_numbers_and_dead_times_share_what_is_compiled(folder: Path) -> None:
    x = np.random.default_rng(1).normal(0, 1, 60)
    for program in (delaying((7, 3)), delaying((1, 20)), replace(delaying((2, 2)), values=(0.3,), initial=(0.0,), title="other")):
        check(program, [x], (0, 60))
    assert [path.suffix for path in folder.iterdir()] == [".so"]


@needs_compiler
def test_what_is_compiled_once_is_there_the_next_time(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    native.runner(delaying((1, 1)))
    native._compiled.cache_clear()
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: pytest.fail("compiled again"))
    check(delaying((1, 1)), [np.ones(9)], (0, 9))


@needs_compiler
def test_processes_that_compile_the_same_at_once_do_not_meet(folder: Path) -> None:
    text = (
        "import pidemu; from pidemu.backends import native;"
        f"c = pidemu.Controller(pidemu.load_card('generic/parallel').settings({_PID!r}));"
        "native.runner(c.program)"
    )
    environment = {**os.environ, "PIDEMU_CACHE": str(folder.parent)}
    both = [subprocess.Popen([sys.executable, "-c", text], env=environment) for _ in range(2)]
    assert [process.wait() for process in both] == [0, 0]
    assert [path.suffix for path in folder.iterdir() if path.is_file()] == [".so"]


@needs_compiler
def test_a_controller_and_a_simulation_run_with_the_engine() -> None:
    settings = pidemu.load_card("generic/parallel").settings(_PID)
    made = signals(3, 200)
    with_c, in_python = (pidemu.Controller(settings, engine=e).run(*made[:3]) for e in ("c", "python"))
    assert with_c.tolist() == in_python.tolist()
    process = pidemu.Process(gain=1.0, poles=[-0.05, -0.2], delay=5.3)
    one, other = (pidemu.simulate(settings, process, scan=1.0, engine=e) for e in ("c", "python"))
    assert one.output.tolist() == other.output.tolist()
    assert one.measurement.tolist() == other.measurement.tolist()


@needs_compiler
def test_signals_of_another_length_than_the_scans_are_refused() -> None:
    program = delaying((1, 1))
    with pytest.raises(ValueError, match=r"\(9,\).* for 10 scans"):
        native.runner(program).run(beginning(program), [np.ones(9)], 10)


# --- where there is no compiler ---------------------------------------------------------------------------------------------------


def test_without_a_compiler_the_engine_says_what_to_install(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.delenv("CC", raising=False)
    assert not native.available()
    with pytest.raises(
        EngineError, match=r"needs a C compiler, and there is no cc, gcc or clang on the PATH; install one, or name"
    ):
        native.runner(delaying((1, 1)))


def test_a_compiler_that_is_named_and_not_there_is_told(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "nocc -m64")
    assert not native.available()
    with pytest.raises(EngineError, match="the C compiler 'nocc', which the environment variable CC names, is not there"):
        native.runner(delaying((1, 1)))


@pytest.mark.skipif(os.name != "posix", reason="the stand-in for a compiler is a shell script")
def test_what_a_compiler_says_is_told_and_nothing_is_left(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in = folder.parent / "mycc"
    stand_in.write_text("#!/bin/sh\necho 'mycc: no licence' >&2\nexit 3\n", encoding="utf-8")
    stand_in.chmod(0o755)
    monkeypatch.setenv("CC", str(stand_in))
    with pytest.raises(EngineError, match="mycc' does not compile a scan program: mycc: no licence; name another one in CC"):
        native.runner(delaying((1, 1)))
    assert list(folder.iterdir()) == []


@needs_compiler
@pytest.mark.parametrize("damage", ["emptied", "cut short", "a bit turned"])
def test_a_damaged_library_is_compiled_again_and_never_loaded(damage: str, folder: Path) -> None:
    native.runner(delaying((1, 1)))
    (path,) = folder.iterdir()
    sound = path.read_bytes()
    middle = len(sound) // 2
    turned = sound[:middle] + bytes([sound[middle] ^ 1]) + sound[middle + 1 :]
    path.unlink()  # a library that is loaded is not written to
    path.write_bytes({"emptied": b"", "cut short": sound[:middle], "a bit turned": turned}[damage])
    native._compiled.cache_clear()
    check(delaying((1, 1)), [np.ones(9)], (0, 9))
    (again,) = folder.iterdir()
    assert again.read_bytes() == sound


@needs_compiler
def test_a_full_disk_is_an_error_with_the_remedy(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*args: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(native, "keep", full)
    message = "the engine 'c' cannot write what it compiles: No space left on device; name another folder in PIDEMU_CACHE"
    with pytest.raises(EngineError, match=message):
        native.runner(delaying((1, 1)))
    assert list(folder.iterdir()) == []


@needs_compiler
def test_a_library_that_the_system_does_not_load_is_an_error_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(path: str) -> None:
        raise OSError(f"{path}: failed to map segment from shared object")

    monkeypatch.setattr("ctypes.CDLL", refused)
    with pytest.raises(EngineError, match=r"cannot load what it compiled: .*failed to map segment.*; name another folder in"):
        native.runner(delaying((1, 1)))


@needs_compiler
@pytest.mark.skipif(os.name != "posix", reason="who may write is said otherwise there")
def test_without_a_folder_that_is_safe_the_engine_says_so(no_code_yet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    no_code_yet.mkdir()
    no_code_yet.chmod(0o777)
    monkeypatch.setattr("tempfile.tempdir", str(no_code_yet))
    settings = pidemu.load_card("generic/standard").settings(K=1, Ti=10, Td=0)
    message = (
        f"the engine 'c' cannot write what it compiles: others can write to {no_code_yet}, where temporary files go (TMPDIR); "
        f"name another folder in PIDEMU_CACHE"
    )
    with pytest.raises(EngineError, match=re.escape(message)):
        pidemu.Controller(settings, 1.0, engine="c").run(50.0, [49.0] * 3)
    assert list(no_code_yet.iterdir()) == []
