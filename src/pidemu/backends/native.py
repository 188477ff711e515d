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

from pidemu.arrays import Floats
from pidemu.backends.c import library
from pidemu.backends.python import in_precision
from pidemu.backends.runner import Run, Runner
from pidemu.errors import EngineError
from pidemu.files.cache import folder, keep, load
from pidemu.program.ir import Program, Structure
from pidemu.program.specialise import specialise

_FLAGS: Final = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared")
_NAME: Final = "loop"
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
    command = (*compiler(), *_FLAGS)
    text = library(program, _NAME)
    built = hashlib.sha256("\0".join([text, *command, sys.platform, platform.machine()]).encode()).hexdigest()[:24]
    stem = f"scan_{built}"
    kept = load(stem, ".so")
    path = _compile(command, text, stem) if kept is None else kept[0]
    lines: list[_Member] = []
    for line in program.lines:
        lines += [
            (f"{line.name}_line", ctypes.c_void_p),
            (f"{line.name}_length", ctypes.c_size_t),
            (f"{line.name}_at", ctypes.c_size_t),
        ]
    return _Compiled(
        _loaded(path),
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
