"""Which engine runs what, and why; what was chosen or forced is said, and changes no bit."""

from __future__ import annotations

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
from pidemu import Fleet, Process
from pidemu.backends import native, numba
from pidemu.backends.choice import Choice, block, checked, for_loops, for_record, runner
from pidemu.backends.engine_names import ENGINES, Engine
from pidemu.backends.python import starting
from pidemu.backends.runner import Runner
from pidemu.checks.runs import plausible
from pidemu.errors import EngineError
from pidemu.files.cache import warn
from pidemu.program.ir import Program, Structure
from pidemu.simulation.simulate import run_scan_by_scan
from pidemu.simulation.trial import trial
from tests.fleet.support import EVERY_ENGINE, alike

PROCESS = Process.from_lags(1.1, [7, 2], delay=1.3)


def loop_program() -> Program:
    made = trial(alike(1)[0].settings, PROCESS, 0.5, time=60)
    return made.program(made.controller())


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> dict[str, bool]:
    """What has been compiled or loaded, as the choice is to see it; Numba is imported already, and there is no C compiler."""
    state = {"loaded": False, "compiled": False}

    def is_compiled(structure: Structure, *, blocks: bool = False) -> bool:
        return state["compiled"]

    def is_loaded(structure: Structure, *, blocks: bool = False) -> bool:
        return state["loaded"]

    monkeypatch.setattr(numba, "is_compiled", is_compiled)
    monkeypatch.setattr(numba, "is_loaded", is_loaded)
    monkeypatch.setattr(native, "available", lambda: False)
    monkeypatch.setitem(sys.modules, "numba", sys)  # it is asked for its name only
    return state


def test_a_short_record_is_run_in_python_even_where_all_is_compiled(compiled: dict[str, bool]) -> None:
    compiled |= {"loaded": True, "compiled": True}
    assert for_record(loop_program(), 20) == Choice("python", "too short to be worth a call into compiled code")


@pytest.mark.parametrize(
    ("loaded", "on_disk", "scans", "engine", "reason"),
    [
        (True, True, 5_000, "numba", "compiled already"),
        (False, True, 2_000, "python", "too short to be worth compiling"),
        (False, True, 500_000, "numba", "compiled by an earlier run"),
        (False, False, 50_000, "python", "too short to be worth compiling"),
        (False, False, 20_000_000, "numba", "long enough to be worth compiling"),
    ],
)
def test_a_record_is_run_by_numba_where_that_pays(
    loaded: bool, on_disk: bool, scans: int, engine: Engine, reason: str, compiled: dict[str, bool]
) -> None:
    compiled |= {"loaded": loaded, "compiled": on_disk}
    assert for_record(loop_program(), scans) == Choice(engine, reason)


def test_importing_numba_counts_where_that_has_not_been_done(compiled: dict[str, bool], monkeypatch: pytest.MonkeyPatch) -> None:
    compiled |= {"compiled": True}
    program = loop_program()
    scans = next(n for n in range(1_000, 10**6, 1_000) if for_record(program, n).engine == "numba")
    monkeypatch.delitem(sys.modules, "numba")
    assert for_record(program, scans).engine == "python"
    assert for_record(program, 20 * scans).engine == "numba"


def test_many_loops_are_run_by_numpy_or_numba_and_few_by_python(compiled: dict[str, bool]) -> None:
    structure = loop_program().structure
    assert for_loops(structure, 500, 3) == Choice("python", "few loops, too short to be worth compiling")
    assert for_loops(structure, 500, 300) == Choice("numpy", "many loops, too short to be worth compiling")
    assert for_loops(structure, 5_000, 10_000) == Choice("numba", "long enough to be worth compiling")
    compiled |= {"compiled": True}
    assert for_loops(structure, 5_000, 2_000) == Choice("numba", "compiled by an earlier run")
    compiled |= {"loaded": True}
    assert for_loops(structure, 5_000, 1) == Choice("numba", "compiled already")


def test_without_numba_loops_are_run_by_numpy_or_python_and_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "available", lambda: False)
    monkeypatch.setattr("pidemu.backends.choice.has_numba", lambda: False)
    program = loop_program()
    assert for_record(program, 10**7) == Choice("python", "Numba is not installed")
    assert for_loops(program.structure, 10**5, 10**4) == Choice("numpy", "many loops, and Numba is not installed")
    assert for_loops(program.structure, 10**5, 3) == Choice("python", "few loops, and Numba is not installed")
    result = Fleet(alike(30)).simulate(time=20.0)
    assert set(result.engines) == {"numpy"}
    assert pidemu.simulate(alike(1)[0].settings, PROCESS, 0.5, time=20_000).engine == Choice("python", "Numba is not installed")


def test_with_a_compiler_fleets_are_run_by_c_where_that_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "available", lambda: True)
    monkeypatch.setattr(native, "is_compiled", lambda structure: False)
    monkeypatch.setattr("pidemu.backends.choice._BROKEN", set())
    structure = loop_program().structure
    assert for_loops(structure, 5_000, 10_000) == Choice("c", "long enough to be worth compiling")
    assert for_loops(structure, 100, 30) == Choice("numpy", "many loops, too short to be worth compiling")
    monkeypatch.setattr(native, "is_compiled", lambda structure: True)
    assert for_loops(structure, 5_000, 300) == Choice("c", "compiled already")


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_asked_for_is_taken_whatever_it_costs(engine: Engine) -> None:
    program = loop_program()
    assert for_record(program, 1, engine) == Choice(engine, "asked for")
    assert for_loops(program.structure, 1, 1, engine) == Choice(engine, "asked for")
    assert str(Choice(engine, "asked for")) == f"{engine} (asked for)"


def test_a_name_that_is_no_engine_is_refused_with_those_that_are() -> None:
    message = r"there is no engine 'nuba' \(did you mean 'numba'\?\); engines: python, numpy, numba, c"
    settings = alike(1)[0].settings
    wrong: Any = "nuba"
    with pytest.raises(EngineError, match=message):
        checked(wrong)
    with pytest.raises(EngineError, match=message):
        pidemu.Controller(settings, engine=wrong)
    with pytest.raises(EngineError, match=message):
        pidemu.simulate(settings, PROCESS, 0.5, engine=wrong)
    with pytest.raises(EngineError, match=message):
        Fleet(alike(1)).simulate(engine=wrong)
    assert checked(None) is None


def test_an_engine_whose_library_is_missing_is_refused_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pidemu.backends.choice.has_numba", lambda: False)
    with pytest.raises(EngineError, match=r"the engine 'numba' needs Numba, which is not installed; pip install 'pidemu\[fast\]'"):
        pidemu.Controller(alike(1)[0].settings, engine="numba")
    monkeypatch.setattr("shutil.which", lambda *_, **__: None)
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(EngineError, match=r"the engine 'c' needs a C compiler.*install one, or name one in.*CC"):
        Fleet(alike(1)).simulate(engine="c")


def test_a_controller_says_what_ran_its_last_record(compiled: dict[str, bool]) -> None:
    controller = pidemu.Controller(alike(1)[0].settings, 0.5)
    assert controller.engine == Choice("python", "nothing has been run")
    controller.run(50.0, np.full(20, 49.0))
    assert controller.engine == Choice("python", "too short to be worth a call into compiled code")
    controller.run(50.0, np.full(5_000, 49.0))
    assert controller.engine == Choice("python", "too short to be worth compiling")
    forced = pidemu.Controller(alike(1)[0].settings, 0.5, engine="numpy")
    assert forced.engine == Choice("numpy", "asked for")
    forced.run(50.0, [49.0] * 3)
    assert forced.engine == Choice("numpy", "asked for")


def test_a_simulation_says_what_ran_it(compiled: dict[str, bool]) -> None:
    settings = alike(1)[0].settings
    assert pidemu.simulate(settings, PROCESS, 0.5, time=10).engine.engine == "python"
    assert pidemu.simulate(settings, PROCESS, 0.5, time=10, engine="numpy").engine == Choice("numpy", "asked for")
    away = pidemu.simulate(settings, Process(-1, [5.0]), 0.5, time=400, engine="numpy")
    assert away.engine == Choice("python", "scan by scan, as the measurement outgrows all numbers")


@pytest.mark.parametrize("engine", EVERY_ENGINE)
@pytest.mark.parametrize("card_id", ["emerson/deltav", "oscat/ft-pid", "toshiba/pid3", "mathworks/pid2", "generic/dahlin"])
def test_a_closed_loop_has_the_same_bits_in_every_engine(engine: Engine, card_id: str) -> None:
    settings = plausible(pidemu.load_card(card_id).variant({}))
    asked: dict[str, Any] = {"time": 300.0, "load": (40.0, 35.0), "initial": (40.0, 40.0, 60.0)}
    expected = pidemu.simulate(settings, PROCESS, 0.5, **asked, engine="python")
    found = pidemu.simulate(settings, PROCESS, 0.5, **asked, engine=engine)
    assert found.engine.engine == engine
    assert np.array_equal(found.output, expected.output)
    assert np.array_equal(found.measurement, expected.measurement)
    assert np.ptp(found.output) > 1


@pytest.mark.parametrize("engine", EVERY_ENGINE)
def test_a_run_goes_on_where_the_last_one_ended_its_delay_lines_too(engine: Engine) -> None:
    program = loop_program()
    assert program.lengths == (2,)
    sp, load = 50 + 10 * np.sin(np.arange(300) / 9), np.where(np.arange(300) > 77, 5.0, 0.0)
    state, parts = fresh(program), fresh(program)
    whole = runner(program, engine).run(state, [sp, load], 300)
    run = runner(program, engine).run
    cut = [run(parts, [sp[a:b], load[a:b]], b - a) for a, b in ((0, 1), (1, 2), (2, 5), (5, 150), (150, 300))]
    assert np.array_equal(np.concatenate(cut, axis=1), whole)
    assert parts == state
    assert [len(line) for line in parts[len(program.states) :]] == [2]
    reference = fresh(program)
    assert np.array_equal(runner(program, "python").run(reference, [sp, load], 300), whole)
    assert state == reference


def fresh(program: Program) -> list[Any]:
    return [*starting(program), *(deque([0.0] * n) for n in program.lengths)]


@pytest.mark.parametrize("engine", EVERY_ENGINE)
def test_blocks_of_every_engine_go_on_where_they_ended_with_delays_of_their_own(engine: Engine) -> None:
    program = loop_program()
    function, most = block(program.structure, engine)
    width, scans = (most if engine in ("numba", "c") else 6), 90
    lengths = np.array([[1 + 5 * i % 17 for i in range(width)]], dtype=np.int64)
    values = np.array([[x * (1 + 0.001 * i) for i in range(width)] for x in program.values])
    sp, load = (base + 5 * np.sin(np.arange(scans)[:, None] / (5 + np.arange(width))) for base in (50, 0))
    states = np.repeat(np.array(program.initial)[:, None], width, axis=1)
    rings, found = np.zeros((1, 18, width)), np.empty((2, scans, width))
    for a, b in ((0, 1), (1, 18), (18, 19), (19, 90)):
        function(values, states, np.array([sp[a:b], load[a:b]]), rings, lengths, a, found[:, a:b])
    for i in range(min(width, 20)):
        alone = replace(program, values=tuple(values[:, i].tolist()), lengths=(int(lengths[0, i]),))
        state = fresh(alone)
        assert np.array_equal(found[:, :, i], runner(alone, "python").run(state, [sp[:, i].copy(), load[:, i].copy()], scans))
        assert states[:, i].tolist() == state[: len(program.states)]


@pytest.mark.parametrize("engine", EVERY_ENGINE)
@pytest.mark.parametrize("lags", [11, 12, 20])
def test_a_process_of_many_lags_has_the_numbers_of_the_emulator_scan_by_scan(engine: Engine, lags: int) -> None:
    process = Process.from_lags(1.0, [1 + i / 3 for i in range(lags)], delay=2.25)
    made = trial(alike(1)[0].settings, process, 0.5, time=60)
    out, pv = run_scan_by_scan(made)
    found = pidemu.simulate(made.settings, process, 0.5, time=60, engine=engine)
    assert found.measurement.tolist() == pv.tolist()
    assert found.output.tolist() == out.tolist()
    program = made.program(made.controller())
    names = [q.name for q in program.inputs + program.coefficients + program.states] + [line.name for line in program.lines]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("engine", ["numpy", "python"])  # the compilers take seconds for as much
@pytest.mark.parametrize("scans", [500, 1000])
def test_a_history_of_a_thousand_outputs_has_the_same_bits_in_every_engine(engine: Engine, scans: int) -> None:
    settings = pidemu.load_card("generic/dahlin").settings({"Kp": 1, "tau": 100, "theta": scans, "lambda": 50})
    process = Process.from_lags(1.0, [100.0], delay=scans)
    asked: dict[str, Any] = {"time": 2.5 * scans, "load": (scans / 4, 20.0)}
    made = trial(settings, process, 1.0, **asked)
    out, pv = run_scan_by_scan(made)
    result = Fleet([pidemu.Loop("A", settings, process, 1.0)]).simulate(**asked, engine=engine, keep=True)
    assert result.counts == {"done": 1}
    assert result.engines == [engine]
    assert result["A"].output.tolist() == out.tolist()
    assert result["A"].measurement.tolist() == pv.tolist()


# --- where an engine fails --------------------------------------------------------------------------------------------------------


@pytest.fixture
def failures(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> Iterator[pytest.LogCaptureFixture]:
    """What is said about engines that fail; what is broken here works again afterwards."""
    monkeypatch.setattr("pidemu.backends.choice._BROKEN", set())
    warn.cache_clear()
    yield caplog
    warn.cache_clear()


def broken(*args: Any, **named: Any) -> Any:
    raise ImportError("numba needs another NumPy\nmore of that")


SAID = "note: the engine 'numba' failed (ImportError: numba needs another NumPy); plain Python runs what it was to run"


@pytest.mark.parametrize("when", ["at once", "when it is called"])
def test_an_engine_that_fails_and_was_not_asked_for_is_replaced_with_one_line(
    when: str, compiled: dict[str, bool], failures: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled |= {"loaded": True}
    program = loop_program()
    expected = pidemu.simulate(alike(1)[0].settings, PROCESS, 0.5, time=20_000, engine="python")
    made = Runner(broken, broken, tuple(q.name for q in program.inputs))
    monkeypatch.setattr(numba, "runner", broken if when == "at once" else lambda program: made)
    for _ in range(2):
        found = pidemu.simulate(alike(1)[0].settings, PROCESS, 0.5, time=20_000)
        assert found.output.tolist() == expected.output.tolist()
    assert failures.messages == [SAID]
    assert found.engine == Choice("python", "Numba does not work here")
    assert for_loops(program.structure, 10**5, 10**4) == Choice("numpy", "many loops, and Numba does not work here")


def test_an_engine_that_was_asked_for_and_fails_is_an_error(
    failures: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(numba, "runner", broken)
    with pytest.raises(ImportError, match="numba needs another NumPy"):
        pidemu.simulate(alike(1)[0].settings, PROCESS, 0.5, time=100, engine="numba")
    assert failures.messages == []


def test_a_controller_goes_on_in_python_where_the_engine_fails(
    compiled: dict[str, bool], failures: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled |= {"loaded": True}
    pv = 50 + np.sin(np.arange(20_000) / 9)
    expected = pidemu.Controller(alike(1)[0].settings, 0.5, engine="python").run(50.0, pv)
    monkeypatch.setattr(numba, "runner", broken)
    assert pidemu.Controller(alike(1)[0].settings, 0.5).run(50.0, pv).tolist() == expected.tolist()
    assert failures.messages == [SAID]


def test_a_compiler_that_fails_leaves_a_fleet_to_the_next_engine_with_one_line(
    failures: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(structure: Structure) -> Any:
        raise EngineError("the C compiler 'cc' does not compile a scan program: exit status -9; name another one in CC")

    monkeypatch.setattr(native, "available", lambda: True)
    monkeypatch.setattr(native, "is_compiled", lambda structure: True)
    monkeypatch.setattr(native, "block", killed)
    monkeypatch.setattr("pidemu.backends.choice.has_numba", lambda: False)
    expected = Fleet(alike(100)).simulate(time=4_000.0, engine="python")
    found = Fleet(alike(100)).simulate(time=4_000.0)
    assert set(found.engines) == {"numpy"}
    assert found.columns["iae"].tolist() == expected.columns["iae"].tolist()
    assert len(failures.messages) == 1
    assert failures.messages[0].startswith("note: the engine 'c' failed (EngineError: the C compiler 'cc' does not compile")
    assert failures.messages[0].endswith("; the engine 'numpy' runs what it was to run")


def test_a_structure_that_takes_long_to_compile_is_weighed_as_that(compiled: dict[str, bool]) -> None:
    structure = loop_program().structure
    long = structure._replace(body=structure.body * 300)
    assert for_loops(structure, 10_000, 2_400).engine == "numba"
    assert for_loops(long, 10_000, 2_400).engine == "numpy"  # it would take minutes


def test_a_run_in_python_imports_no_compiler() -> None:
    code = (
        "import sys, pidemu\n"
        "s = pidemu.load_card('generic/standard').settings(K=1, Ti=10, Td=0)\n"
        "p = pidemu.Process.from_lags(1, [10])\n"
        "found = pidemu.simulate(s, p, 0.5, time=100)\n"
        "pidemu.Fleet([pidemu.Loop('a', s, p, 0.5)]).simulate(time=100.0)\n"
        "assert found.engine.engine == 'python'\n"
        "print([m for m in ('numba', 'distributed', 'pyarrow', 'scipy', 'matplotlib') if m in sys.modules])"
    )
    source = Path(pidemu.__file__).parent.parent
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=source)
    assert done.stdout.strip() == "[]"
