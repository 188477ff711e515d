"""A scan program as Numba functions, compiled once per structure and kept in the cache folder (extra ``fast``)."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import chain
from types import ModuleType
from typing import Any, Final

import numpy as np

from pidemu.arrays import Floats, Integers
from pidemu.backends.numba_store import SUFFIX, Store, python_version
from pidemu.backends.numba_text import WIDTH, block_text, module_text, record_text
from pidemu.backends.runner import Block, Run, Runner
from pidemu.files.cache import is_kept
from pidemu.program.ir import Program, Structure
from pidemu.program.specialise import specialise

_FUNCTIONS: Final[dict[tuple[Structure, bool], Any]] = {}
"""What is in use in this process: the function for blocks, or that for records in automatic."""

__all__ = ["WIDTH", "block", "is_compiled", "is_loaded", "runner"]


def runner(program: Program) -> Runner:
    """Return the program as compiled functions over records.

    Parameters
    ----------
    program : Program
        The program.

    Raises
    ------
    ImportError
        Numba is not installed.
    """
    module, read = _record_module(program.structure)
    values = np.array(program.values, dtype=np.float64)
    return Runner(_over(program, values, module.run), _over(program, values, module.run_automatic), read)


def block(structure: Structure) -> Block:
    """Return what runs blocks of `WIDTH` loops of a structure.

    Parameters
    ----------
    structure : Structure
        What the loops have in common.

    Raises
    ------
    ImportError
        Numba is not installed.
    """
    function = _block_module(structure).block

    def run(values: Floats, states: Floats, signals: Floats, rings: Floats, lengths: Integers, at: int, records: Floats) -> None:
        assert states.flags.c_contiguous
        assert rings.flags.c_contiguous
        assert all(x.flags.c_contiguous for x in records)  # what is written to must not be a copy
        rows = [np.ravel(x) for parts in (signals, rings, lengths) for x in parts]
        left = [np.empty(WIDTH) for _ in rings]
        function(np.ravel(values), np.ravel(states), at, *rows, *left, *(np.ravel(x) for x in records))

    return run


def is_compiled(structure: Structure, *, blocks: bool = False) -> bool:
    """Tell whether a structure has been compiled, in this process or an earlier one.

    Parameters
    ----------
    structure : Structure
        The structure.
    blocks : bool
        For blocks of loops, or for one loop over a record.
    """
    name = _name(_block_source(structure) if blocks else _record_source(structure)[0])
    return is_kept(f"{name}.{'block' if blocks else 'run_automatic'}.{python_version()}.*", SUFFIX)


def is_loaded(structure: Structure, *, blocks: bool = False) -> bool:
    """Tell whether a structure is compiled and loaded in this process.

    Parameters
    ----------
    structure : Structure
        The structure.
    blocks : bool
        For blocks of loops, or for one loop over a record.
    """
    return (structure, blocks) in _FUNCTIONS and bool(_FUNCTIONS[structure, blocks].signatures)


@lru_cache(maxsize=512)
def _record_source(structure: Structure) -> tuple[str, tuple[str, ...]]:
    program = structure.bare()
    automatic = specialise(program)
    text = module_text(record_text(program, "run"), record_text(automatic, "run_automatic"))
    return text, tuple(q.name for q in automatic.inputs)


@lru_cache(maxsize=512)
def _block_source(structure: Structure) -> str:
    return module_text(block_text(structure.bare()))


@lru_cache(maxsize=512)
def _record_module(structure: Structure) -> tuple[ModuleType, tuple[str, ...]]:
    text, read = _record_source(structure)
    module = _module(text)
    _FUNCTIONS[structure, False] = module.run_automatic
    return module, read


@lru_cache(maxsize=512)
def _block_module(structure: Structure) -> ModuleType:
    module = _module(_block_source(structure))
    _FUNCTIONS[structure, True] = module.block
    return module


def _name(text: str) -> str:
    return f"scan_{hashlib.sha256(text.encode()).hexdigest()[:24]}"


def _module(text: str) -> ModuleType:
    """Return a module made from its text; what Numba compiles of it is kept, and nothing but that is ever read from a file."""
    name = _name(text)
    module = ModuleType(name)
    sys.modules[name] = module  # Numba looks it up by name when it loads what was kept
    exec(compile(text, f"<{name}>", "exec"), module.__dict__)  # our own text: nothing of the user's goes into it
    for function in ("run", "run_automatic", "block"):
        if hasattr(module, function):
            Store(f"{name}.{function}").attach(getattr(module, function))
    return module


def _over(program: Program, values: Floats, function: Callable[..., None]) -> Run:
    def run(state: list[Any], signals: Sequence[Floats], scans: int) -> Floats:
        count = len(program.states)
        states = np.array(state[:count], dtype=np.float64)
        lines = [np.array(line, dtype=np.float64) for line in state[count:]]
        records = np.empty((len(program.recorded), scans))
        function(values, states, *(np.ascontiguousarray(s, dtype=np.float64) for s in signals), *lines, *records)
        state[:count] = [kind(x) for kind, x in zip(map(type, state), states.tolist(), strict=False)]
        for held, line in zip(state[count:], lines, strict=True):
            oldest = scans % line.size
            held.clear()
            held.extend(chain(line[oldest:].tolist(), line[:oldest].tolist()))
        return records

    return run
