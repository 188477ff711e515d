"""A scan program as machine code: its C, compiled by the machine's C compiler once per structure and kept in a cache folder."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats, Integers
from pidemu.backends.c import block_library, library
from pidemu.backends.c_block import WIDTH
from pidemu.backends.python import in_precision
from pidemu.backends.runner import Block, Run, Runner
from pidemu.errors import EngineError
from pidemu.files.cache import folder, is_kept, keep, load
from pidemu.program.ir import Program, Structure
from pidemu.program.specialise import specialise

_FLAGS: Final = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared")
_BLOCK_FLAGS: Final = (*_FLAGS, "-O3", "-fno-trapping-math")
"""For blocks: several loops at once, both sides of a choice computed; neither changes a bit."""
_OWN_PROCESSOR: Final = "-march=native"
_NAME: Final = "loop"
__all__ = ["WIDTH", "available", "block", "compiler", "is_compiled", "runner"]
_Member = tuple[str, type[Any]]


def compiler() -> tuple[str, ...]:
    """Return the command that compiles C: that of the environment variable ``CC``, or cc, gcc or clang.

    Raises
    ------
    EngineError
        There is none.
    """
    chosen = shlex.split(os.environ.get("CC", ""))
    if chosen:
        if shutil.which(chosen[0]) is None:
            raise EngineError(
                f"the C compiler '{chosen[0]}', which the environment variable CC names, is not there; name one that is installed"
            )
        return tuple(chosen)
    found = next((c for c in ("cc", "gcc", "clang") if shutil.which(c)), None)
    if found is None:
        raise EngineError(
            "the engine 'c' needs a C compiler, and there is no cc, gcc or clang on the PATH; "
            "install one, or name one in the environment variable CC"
        )
    return (found,)


def available() -> bool:
    """Tell whether there is a C compiler."""
    try:
        compiler()
    except EngineError:
        return False
    return True


def runner(program: Program) -> Runner:
    """Return the program as machine code over records.

    Parameters
    ----------
    program : Program
        The program.

    Raises
    ------
    EngineError
        There is no C compiler, it does not compile what is printed, or there is no room for what it makes.
    """
    compiled = _compiled(program.structure)
    values = (float(in_precision(program, q.name, x)) for q, x in zip(program.coefficients, program.values, strict=True))
    settings = compiled.settings(*values)
    inputs, fewer = tuple(q.name for q in program.inputs), compiled.read_in_automatic
    run = _over(program, compiled, settings, "run", inputs)
    return Runner(run, run if fewer == inputs else _over(program, compiled, settings, "run_automatic", fewer), fewer)


def block(structure: Structure) -> Block:
    """Return what runs blocks of `WIDTH` loops of a structure.

    Parameters
    ----------
    structure : Structure
        What the loops have in common.

    Raises
    ------
    EngineError
        There is no C compiler, it does not compile what is printed, or there is no room for what it makes.
    """
    function = _block_function(structure)

    def run(values: Floats, states: Floats, signals: Floats, rings: Floats, lengths: Integers, at: int, records: Floats) -> None:
        scans = records.shape[1]
        if any(x.shape[-1] != WIDTH for x in (values, states, rings, lengths, records)) or signals.shape[1:] != (scans, WIDTH):
            raise ValueError(f"blocks of {WIDTH} loops, not arrays of shapes {[x.shape for x in (values, signals, records)]}")
        read = [np.ascontiguousarray(x) for x in (values, *signals, *lengths)]
        assert all(x.flags.c_contiguous for x in (states, *rings, *records))  # what is written to must not be a copy
        inputs, delays = read[1 : 1 + len(signals)], read[1 + len(signals) :]
        rows = [rings.shape[1]] * len(rings)
        arrays = [[x.ctypes.data for x in some] for some in (inputs, rings, delays, records)]
        function(at, scans, read[0].ctypes.data, states.ctypes.data, *arrays[0], *arrays[1], *rows, *arrays[2], *arrays[3])

    return run


def is_compiled(structure: Structure) -> bool:
    """Tell whether blocks of a structure have been compiled, in this process or an earlier one."""
    return is_kept(_stem(_block_source(structure), _block_flags()), ".so")


@functools.lru_cache(maxsize=512)
def _block_source(structure: Structure) -> str:
    return block_library(structure.bare(), _NAME)


@functools.lru_cache(maxsize=512)
def _block_function(structure: Structure) -> Any:
    function = _made(_block_source(structure), _block_flags())[f"{_NAME}_block"]
    lines = len(structure.lines)
    size: list[type[Any]] = [ctypes.c_size_t]
    pointer: list[type[Any]] = [ctypes.c_void_p]
    arrays = len(structure.inputs) + lines
    function.argtypes = size * 2 + pointer * (2 + arrays) + size * lines + pointer * (lines + len(structure.recorded))
    function.restype = None
    return function


def _block_flags() -> tuple[str, ...]:
    """Return the flags for blocks: for this very processor where it is known, so that no other one loads them."""
    return (*_BLOCK_FLAGS, _OWN_PROCESSOR) if _processor() else _BLOCK_FLAGS


@functools.cache
def _processor() -> str:
    """Return what an x86-64 under Linux says it can do; empty elsewhere."""
    if not (sys.platform == "linux" and platform.machine() == "x86_64"):
        return ""
    try:
        first = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").partition("\n\n")[0]
    except OSError:
        return ""
    told = [line for line in first.splitlines() if line.startswith(("cpu family", "model", "stepping", "flags"))]
    return "\n".join(told) if any(line.startswith("flags") for line in told) else ""


def _stem(text: str, flags: Sequence[str]) -> str:
    parts = [text, *compiler(), *flags, sys.platform, platform.machine()]
    parts += [_processor()] if _OWN_PROCESSOR in flags else []
    return f"scan_{hashlib.sha256(chr(0).join(parts).encode()).hexdigest()[:24]}"


def _made(text: str, flags: Sequence[str]) -> ctypes.CDLL:
    """Return a text as a library, from the cache folder where it was compiled before."""
    stem = _stem(text, flags)
    kept = load(stem, ".so")
    return _loaded(_compile((*compiler(), *flags), text, stem) if kept is None else kept[0])


@dataclass(frozen=True, slots=True)
class _Compiled:
    """A structure as machine code, with its two types."""

    library: ctypes.CDLL
    settings: type[ctypes.Structure]
    state: type[ctypes.Structure]
    read_in_automatic: tuple[str, ...]


@functools.lru_cache(maxsize=512)
def _compiled(structure: Structure) -> _Compiled:
    program = structure.bare()
    made = _made(library(program, _NAME), _FLAGS)
    lines: list[_Member] = []
    for line in program.lines:
        lines += [
            (f"{line.name}_line", ctypes.c_void_p),
            (f"{line.name}_length", ctypes.c_size_t),
            (f"{line.name}_at", ctypes.c_size_t),
        ]
    return _Compiled(
        made,
        _structure("Settings", [(q.name, _c_type(program, q.name)) for q in program.coefficients]),
        _structure("State", [(q.name, _c_type(program, q.name)) for q in program.states] + lines),
        tuple(q.name for q in specialise(program).inputs),
    )


def _compile(command: Sequence[str], text: str, stem: str) -> Path:
    """Compile, and return the file of the cache folder that holds the library."""
    try:
        with tempfile.TemporaryDirectory(dir=folder(), prefix="build-") as build:
            source, made = Path(build, "scan.c"), Path(build, "scan.so")
            source.write_text(text, encoding="utf-8")
            words = [*command, "-o", str(made), str(source), "-lm"]
            own = {**os.environ, **dict.fromkeys(("TMPDIR", "TMP", "TEMP"), build)}  # what it makes on the way is code, too
            done = subprocess.run(
                words, capture_output=True, text=True, errors="replace", stdin=subprocess.DEVNULL, check=False, env=own
            )
            if done.returncode:
                first = next(iter(done.stderr.strip().splitlines()), f"exit status {done.returncode}")
                raise EngineError(f"the C compiler '{command[0]}' does not compile a scan program: {first}; name another one in CC")
            return keep(stem, ".so", made.read_bytes())
    except OSError as error:
        why = error.strerror or error
        raise EngineError(f"the engine 'c' cannot write what it compiles: {why}; name another folder in PIDEMU_CACHE") from None


def _loaded(path: Path) -> ctypes.CDLL:
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:  # such as a file system from which nothing may be run
        raise EngineError(f"the engine 'c' cannot load what it compiled: {error}; name another folder in PIDEMU_CACHE") from None


def _structure(name: str, members: list[_Member]) -> type[ctypes.Structure]:
    return type(name, (ctypes.Structure,), {"_fields_": members or [("none", ctypes.c_double)]})


def _c_type(program: Program, name: str) -> type[Any]:
    return ctypes.c_double if program.is_wide(name) else ctypes.c_float


def _dtype(program: Program, name: str) -> type[np.floating[Any]]:
    return np.float64 if program.is_wide(name) else np.float32


def _over(program: Program, compiled: _Compiled, settings: ctypes.Structure, name: str, inputs: tuple[str, ...]) -> Run:
    """Return a function of the library as one of a state list, signals, and the number of scans."""
    function = compiled.library[f"{_NAME}_{name}"]
    kinds = [_dtype(program, name) for name in inputs]
    recorded = [_dtype(program, name) for name in program.recorded]
    entering = [_dtype(program, line.source) for line in program.lines]
    states = [(q.name, float if program.precision == "float64" else _dtype(program, q.name)) for q in program.states]
    held = len(states)
    function.argtypes = [ctypes.c_void_p] * 2 + [ctypes.c_size_t] + [ctypes.c_void_p] * (len(kinds) + len(recorded))
    function.restype = None

    def run(state: list[Any], signals: Sequence[Floats], scans: int) -> Floats:
        samples = [_as(kind, s) for kind, s in zip(kinds, signals, strict=True)]
        if any(s.shape != (scans,) for s in samples):  # the library would read beyond them
            raise ValueError(f"signals of shapes {[s.shape for s in samples]} for {scans} scans")
        rings = [_as(kind, list(line)) for kind, line in zip(entering, state[held:], strict=True)]
        now = compiled.state(*map(float, state[:held]), *(x for ring in rings for x in (ring.ctypes.data, ring.size, 0)))
        records = np.empty((len(recorded), scans))
        outputs = [row if kind is np.float64 else np.empty(scans, kind) for row, kind in zip(records, recorded, strict=True)]
        function(ctypes.byref(settings), ctypes.byref(now), scans, *(x.ctypes.data for x in (*samples, *outputs)))
        state[:held] = [kind(getattr(now, name)) for name, kind in states]
        for line, ring in zip(state[held:], rings, strict=True):
            oldest = scans % ring.size
            left = ring.tolist() if program.precision == "float64" else list(ring)
            line.clear()
            line.extend(left[oldest:] + left[:oldest])
        for row, output in zip(records, outputs, strict=True):
            if output is not row:
                row[:] = output
        return records

    return run


def _as(kind: type[np.floating[Any]], values: npt.ArrayLike) -> npt.NDArray[np.floating[Any]]:
    if kind is np.float64:
        return np.ascontiguousarray(values, dtype=np.float64)
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(values, dtype=kind)
