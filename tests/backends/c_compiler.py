"""Printed C, compiled and called through nothing but its documented functions."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from pidemu.program.ir import Program
from tests.helpers import Floats

COMPILER = next((c for c in ("gcc", "cc", "clang") if shutil.which(c)), None)
CPP = shutil.which("g++") or shutil.which("clang++")
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
FLAGS = ("-std=c99", "-ffp-contract=off", *WARNINGS)
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler on the PATH")
needs_cpp = pytest.mark.skipif(CPP is None, reason="there is no C++ compiler on the PATH")


def compiled(folder: Path, text: str, *flags: str) -> ctypes.CDLL:
    """Compile C as a library and load it; a warning is an error."""
    source = folder / "printed.c"
    source.write_text(text, encoding="utf-8")
    library = folder / "printed.so"
    done = refused(*FLAGS, *(flags or ("-O2",)), "-fPIC", "-shared", str(source), "-o", str(library), "-lm")
    assert done == ""
    return ctypes.CDLL(str(library))


def refused(*arguments: str, compiler: str | None = COMPILER, folder: Path | None = None) -> str:
    """Return what a compiler says; nothing where all is well."""
    assert compiler is not None
    return subprocess.run([compiler, *arguments], capture_output=True, text=True, check=False, cwd=folder).stderr


class Loop:
    """One controller in a library, by its name."""

    def __init__(self, library: ctypes.CDLL, name: str, program: Program) -> None:
        self._library, self._name, self._program = library, name, program
        self._settings = ctypes.addressof(ctypes.c_char.in_dll(library, f"{name}_default"))
        self._state = ctypes.create_string_buffer(8192)
        library[f"{name}_init"](self._state)

    def _kind(self, name: str) -> type[np.floating]:
        return np.float64 if self._program.is_wide(name) else np.float32

    def run(self, signals: Sequence[Floats], function: str = "run", inputs: Sequence[str] = ()) -> Floats:
        """Call a function for many scans; `inputs`: those that it reads, by default all of the program's."""
        names = inputs or [q.name for q in self._program.inputs]
        (n,) = {len(s) for s in signals}
        with np.errstate(over="ignore"):
            samples = [np.ascontiguousarray(s, dtype=self._kind(q)) for q, s in zip(names, signals, strict=True)]
        outputs = [np.empty(n, dtype=self._kind(q)) for q in self._program.recorded]
        pointers = [ctypes.c_void_p(x.ctypes.data) for x in (*samples, *outputs)]
        self._library[f"{self._name}_{function}"](ctypes.c_void_p(self._settings), self._state, ctypes.c_size_t(n), *pointers)
        return np.array(outputs, dtype=np.float64)

    def step(self, *inputs: float) -> tuple[float, ...]:
        """Do one scan of a program that is float64 throughout; returns what is recorded."""
        function = self._library[f"{self._name}_step"]
        function.restype = ctypes.c_double
        also = [ctypes.c_double() for _ in self._program.also]
        arguments = [*map(ctypes.c_double, inputs), *map(ctypes.byref, also)]
        u = function(ctypes.c_void_p(self._settings), self._state, *arguments)
        return u, *(x.value for x in also)
