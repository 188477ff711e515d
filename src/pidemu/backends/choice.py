"""Engines: which back end runs a program.

All give the same bits; they differ in what a scan costs and in what it costs to begin. Plain Python begins at once and costs some
hundred nanoseconds a scan; what Numba compiles costs some nanoseconds, but has to be compiled, or loaded from the cache folder,
first; NumPy does every operation for many loops at once. The figures behind the choice are measured ones, rounded; they decide
about time and nothing else.
"""

from __future__ import annotations

import importlib.util
import sys
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pidemu.arrays import Floats, Integers
from pidemu.backends import python
from pidemu.backends.engine_names import ENGINES, Engine
from pidemu.backends.runner import Block, Run, Runner
from pidemu.errors import EngineError, suggest
from pidemu.files.cache import warn
from pidemu.program.ir import Program, Structure

_PYTHON: Final = 15e-9
"""Seconds per assignment and scan in plain Python."""
_IMPORT: Final = 0.4
"""Seconds to import Numba."""
_COMPILE: Final = 0.7
"""Seconds in which it compiles a structure of up to a hundred assignments."""
_LONGER: Final = 1.5
"""With what power of their number the seconds grow beyond that."""
_COMPILE_C: Final = 0.3
"""Seconds in which a C compiler makes a block of up to a hundred assignments; its blocks are quicker than Numba's, too."""
_LOAD_C: Final = 0.005
"""Seconds to load a block of C that was compiled."""
_LOAD: Final = 0.05
"""Seconds to load one that was compiled."""
_CALL: Final = 2e-4
"""Seconds to look up one that is loaded, and to call it."""
_LOOPS_FOR_NUMPY: Final = 12
"""Loops side by side from which on NumPy is quicker than loop after loop in plain Python."""
_ASKED: Final = "asked for"
_BROKEN: Final[set[Engine]] = set()
"""Engines that failed in this process: they are not chosen any more."""


@dataclass(frozen=True, slots=True)
class Choice:
    """Which engine runs something, and why.

    Attributes
    ----------
    engine : {"python", "numpy", "numba", "c"}
        The engine.
    reason : str
        Why this one.
    """

    engine: Engine
    reason: str

    def __str__(self) -> str:
        return f"{self.engine} ({self.reason})"


def checked(engine: str | None) -> Engine | None:
    """Return the name of an engine that can run here; ``None`` leaves the choice.

    Raises
    ------
    EngineError
        There is no such engine, or what it needs is not installed.
    """
    if engine is None:
        return None
    known = next((e for e in ENGINES if e == engine), None)
    if known is None:
        raise EngineError(f"there is no engine '{engine}'{suggest(engine, ENGINES)}; engines: {', '.join(ENGINES)}")
    if known == "numba" and not has_numba():
        raise EngineError("the engine 'numba' needs Numba, which is not installed; pip install 'pidemu[fast]' brings it")
    if known == "c":
        from pidemu.backends import native

        native.compiler()
    return known


def has_numba() -> bool:
    """Tell whether Numba is installed."""
    return "numba" in sys.modules or importlib.util.find_spec("numba") is not None


def for_record(program: Program, scans: int, forced: Engine | None = None) -> Choice:
    """Return the engine for one loop over a record.

    Parameters
    ----------
    program : Program
        What runs.
    scans : int
        Samples of the record.
    forced : {"python", "numpy", "numba", "c"}, optional
        The engine that was asked for.
    """
    if forced is not None:
        return Choice(forced, _ASKED)
    in_python = _PYTHON * len(program.body) * scans
    if in_python < _CALL:
        return Choice("python", "too short to be worth a call into compiled code")
    if without := _no_numba():
        return Choice("python", without)
    return _weighed(program.structure, in_python, blocks=False)


def for_loops(structure: Structure, scans: int, loops: int, forced: Engine | None = None) -> Choice:
    """Return the engine for loops of one structure side by side.

    Parameters
    ----------
    structure : Structure
        What runs.
    scans, loops : int
        Scans of each loop, and how many loops.
    forced : {"python", "numpy", "numba", "c"}, optional
        The engine that was asked for.
    """
    if forced is not None:
        return Choice(forced, _ASKED)
    alone: Choice = Choice("numpy", "many loops") if loops >= _LOOPS_FOR_NUMPY else Choice("python", "few loops")
    otherwise = _PYTHON * len(structure.body) * scans * loops / (8 if alone.engine == "numpy" else 1)
    if _has_c():
        found = _weighed_c(structure, otherwise)
        return found if found.engine == "c" else Choice(alone.engine, f"{alone.reason}, {found.reason}")
    if without := _no_numba():
        return Choice(alone.engine, f"{alone.reason}, and {without}")
    found = _weighed(structure, otherwise, blocks=True)
    return found if found.engine == "numba" else Choice(alone.engine, f"{alone.reason}, {found.reason}")


def _no_numba() -> str:
    """Return why Numba is not chosen, whatever it would save; empty where it may be."""
    return "Numba does not work here" if "numba" in _BROKEN else "" if has_numba() else "Numba is not installed"


def _has_c() -> bool:
    """Tell whether a C compiler is there and has not failed."""
    from pidemu.backends import native

    return "c" not in _BROKEN and native.available()


def _weighed_c(structure: Structure, otherwise: float) -> Choice:
    """Weigh the seconds without C against those that the compiler needs."""
    from pidemu.backends import native

    if otherwise > _LOAD_C and native.is_compiled(structure):
        return Choice("c", "compiled already")
    if otherwise > _COMPILE_C * max(1.0, len(structure.body) / 100) ** _LONGER:
        return Choice("c", "long enough to be worth compiling")
    return Choice("python", "too short to be worth compiling")


def _weighed(structure: Structure, otherwise: float, *, blocks: bool) -> Choice:
    """Weigh the seconds without Numba against those that it needs to begin."""
    from pidemu.backends import numba

    begun = 0.0 if "numba" in sys.modules else _IMPORT
    if numba.is_loaded(structure, blocks=blocks):
        return Choice("numba", "compiled already")
    if otherwise > begun + _LOAD and numba.is_compiled(structure, blocks=blocks):
        return Choice("numba", "compiled by an earlier run")
    if otherwise > begun + _COMPILE * max(1.0, len(structure.body) / 100) ** _LONGER:
        return Choice("numba", "long enough to be worth compiling")
    return Choice("python", "too short to be worth compiling")


def runner(program: Program, engine: Engine) -> Runner:
    """Return a program as functions over records, run by an engine.

    Parameters
    ----------
    program : Program
        The program.
    engine : {"python", "numpy", "numba", "c"}
        The engine.
    """
    if engine == "python":
        return python.runner(program)
    if engine == "numba":
        from pidemu.backends import numba

        return numba.runner(program)
    if engine == "numpy":
        from pidemu.backends import numpy

        return numpy.runner(program)
    from pidemu.backends import native

    return native.runner(program)


def safe_runner(program: Program, choice: Choice) -> Runner:
    """Return a program as functions over records; where the engine fails and nobody asked for it, plain Python goes on.

    Parameters
    ----------
    program : Program
        The program.
    choice : Choice
        What runs it.
    """
    if choice.engine == "python" or choice.reason == _ASKED:
        return runner(program, choice.engine)
    try:
        quick, plain = runner(program, choice.engine), python.runner(program)
    except Exception as error:
        return runner(program, instead(choice.engine, error).engine)

    def safe(run: Run, otherwise: Run) -> Run:
        def over(state: list[Any], signals: Sequence[Floats], scans: int) -> Floats:
            try:
                return run(state, signals, scans)  # which changes the state when all is done
            except Exception as error:
                instead(choice.engine, error)
                return otherwise(state, signals, scans)

        return over

    return Runner(safe(quick.run, plain.run), safe(quick.run_automatic, plain.run_automatic), quick.read_in_automatic)


def instead(engine: Engine, error: Exception, then: Choice | None = None) -> Choice:
    """Return what runs something after an engine failed, by default plain Python, which needs nothing; say so.

    Parameters
    ----------
    engine : {"python", "numpy", "numba", "c"}
        What failed.
    error : Exception
        How.
    then : Choice, optional
        What runs it instead.
    """
    give_up(engine)
    next_one = "plain Python" if then is None or then.engine == "python" else f"the engine '{then.engine}'"
    if engine != "python":
        first = next(iter(str(error).splitlines()), "")
        warn(f"the engine '{engine}' failed ({type(error).__name__}: {first[:200]}); {next_one} runs what it was to run")
    return then or Choice("python", f"{engine} failed")


def give_up(engine: Engine) -> None:
    """Choose a compiler no more: what is wrong with it, such as a library it does not fit, is wrong with every program."""
    if engine in ("numba", "c"):
        _BROKEN.add(engine)


def block(structure: Structure, engine: Engine) -> tuple[Block, int]:
    """Return what runs loops of a structure side by side, and how many loops a block has.

    Parameters
    ----------
    structure : Structure
        What the loops have in common.
    engine : {"python", "numpy", "numba", "c"}
        The engine. Plain Python runs one loop after the other.
    """
    if engine == "numba":
        from pidemu.backends import numba

        return numba.block(structure), numba.WIDTH
    if engine == "numpy":
        from pidemu.backends import numpy

        return numpy.block(structure), numpy.WIDTH
    if engine == "c":
        from pidemu.backends import native

        return native.block(structure), native.WIDTH
    return one_by_one(structure, engine), 64


def one_by_one(structure: Structure, engine: Engine) -> Block:
    """Return what runs the loops of a block one after the other."""
    bare = structure.bare()

    def run(values: Floats, states: Floats, signals: Floats, rings: Floats, lengths: Integers, at: int, records: Floats) -> None:
        scans, rows = records.shape[1], rings.shape[1]
        for i in range(records.shape[2]):
            program = replace(bare, values=tuple(values[:, i].tolist()), initial=tuple(states[:, i].tolist()))
            places = [(at - np.arange(length, 0, -1)) % rows for length in lengths[:, i]]  # the oldest first
            lines = [deque(ring[place, i].tolist()) for ring, place in zip(rings, places, strict=True)]
            state: list[Any] = [*python.starting(program), *lines]
            records[:, :, i] = runner(program, engine).run(state, list(signals[:, :, i]), scans)
            states[:, i] = state[: len(structure.states)]
            for ring, length, line in zip(rings, lengths[:, i], lines, strict=True):
                ring[(at + scans - np.arange(length, 0, -1)) % rows, i] = list(line)

    return run
