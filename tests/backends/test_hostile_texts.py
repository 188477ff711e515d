"""Whatever a card calls things: what is printed is the same program, and nothing but that."""

from __future__ import annotations

import ast
import importlib.util
import io
import json
import re
import sys
import tokenize
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.backends import c, numba_text, numpy_text, numpy_values
from pidemu.backends.python import source
from pidemu.program.ir import Program
from tests.backends.c_compiler import COMPILER, CPP, WARNINGS, needs_compiler, refused
from tests.backends.texts import programs, retold
from tests.checks.bench import VALID, loaded
from tests.hostile import CONTROLS, ENCODINGS, MARKS, hostile_names, hostile_text

_WORST = "".join((*ENCODINGS, *MARKS, *CONTROLS))


def plain_tree(text: str) -> str:
    """Return the syntax tree of a module without its docstring."""
    tree = ast.parse(text.encode())
    assert ast.get_docstring(tree) is not None
    tree.body = tree.body[1:]
    return ast.dump(tree)


def imported(folder: Path, text: str) -> ModuleType:
    """Write a module and import it from its file: an encoding counts there only."""
    file = folder / "encoding.py"
    file.write_bytes(text.encode())
    spec = importlib.util.spec_from_file_location("encoding", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    was, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        spec.loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = was
    return module


def outputs(module: ModuleType, program: Program) -> list[float]:
    """Run a module on a step and a spell in manual."""
    signals = [[50.0 + (i % 5) + k for i in range(30)] for k, _ in enumerate(program.inputs)]
    signals[2] = [float(i % 7 != 3) for i in range(30)]
    found: list[float] = module.run(list(module.INITIAL), *signals)
    return found


def without_comments(text: str) -> str:
    """Return C without its comments, which this finds as a compiler does: trigraphs, then spliced lines, then comments."""
    text = text.replace("??/", "\\").replace("\\\n", "")
    return re.sub(r"[ \t]+\n", "\n", re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL))


@settings(max_examples=60)
@given(st.integers(0, 2), hostile_text, st.lists(hostile_text, max_size=2))
@example(0, "an option coding: unicode_escape", [])
@example(1, _WORST, [_WORST])
@example(2, '"' * 5, ['"' * 4, "\\"])
def test_printed_python_is_the_same_module_whatever_the_texts(
    tmp_path_factory: pytest.TempPathFactory, which: int, text: str, notes: list[str]
) -> None:
    program = programs()[which]
    plain, printed = source(program), source(retold(program, text), notes)
    assert tokenize.detect_encoding(io.BytesIO(printed.encode()).readline)[0] == "utf-8"
    assert plain_tree(plain) == plain_tree(printed)
    folder = tmp_path_factory.mktemp("module")
    np.testing.assert_array_equal(outputs(imported(folder, plain), program), outputs(imported(folder, printed), program))


@settings(max_examples=60)
@given(st.integers(0, 2), hostile_text, st.lists(hostile_text, max_size=2))
@example(0, _WORST, [_WORST])
@example(1, "*\\\n/", ["??/", "*"])
def test_printed_c_is_the_same_code_whatever_the_texts(which: int, text: str, notes: list[str]) -> None:
    program = programs()[which]
    for printer in (c.single, c.header, c.source):
        printed = printer(retold(program, text), "level", notes)
        assert without_comments(printer(program, "level")).split() == without_comments(printed).split()
        assert "//" not in re.sub(r"/\*.*?\*/", "", printed, flags=re.DOTALL)
        printed.encode()


_CASES = st.tuples(st.integers(0, 2), hostile_text, hostile_text)


@needs_compiler
@settings(max_examples=6)
@given(_CASES)
@example((0, _WORST, _WORST))
@example((1, "\\", "a ??/"))
@example((2, "*/ int x; /*", "//"))
def test_printed_c_compiles_without_a_warning_whatever_the_texts(
    tmp_path_factory: pytest.TempPathFactory, case: tuple[int, str, str]
) -> None:
    which, text, note = case
    folder = tmp_path_factory.mktemp("c")
    (folder / "level.c").write_bytes(c.single(retold(programs()[which], text), "level", [note]).encode())
    for compiler, *standard in ((COMPILER, "-std=c99"), (CPP, "-std=c++11", "-x", "c++")):
        if compiler is not None:
            assert refused(*standard, *WARNINGS, "-fsyntax-only", "level.c", compiler=compiler, folder=folder) == ""


@given(st.integers(0, 1), hostile_text)
def test_programs_for_numba_and_numpy_hold_no_text_at_all(which: int, text: str) -> None:
    program = programs()[which]
    told = retold(program, text)
    assert numba_text.record_text(program, "record") == numba_text.record_text(told, "record")
    assert numba_text.block_text(program) == numba_text.block_text(told)
    planned = [numpy_text.planned(numpy_values.scan_of(p)).text for p in (program, told)]
    assert planned[0] == planned[1]


@settings(max_examples=15)
@given(hostile_names, hostile_names, hostile_names)
@example("coding: unicode_escape", "\\nimport os\\nos.abort()\\n#", '"""')
@example("encoding: nonsense", "*/ int x; /*", "\\")
def test_a_card_that_calls_things_by_bad_names_is_the_same_program(
    tmp_path_factory: pytest.TempPathFactory, product: str, choice: str, note: str
) -> None:
    text = VALID.replace("product: test bench", f"product: {json.dumps(product)}")
    text = text.replace("      PID: {}", f"      {json.dumps(choice)}: {{}}").replace(
        "default: PID", f"default: {json.dumps(choice)}"
    )
    text = text.replace("note: not stated", f"note: {json.dumps(note)}")
    printed = []
    for card in (VALID, text):
        folder = tmp_path_factory.mktemp("card")
        controller = pidemu.Controller(loaded(folder, card).settings(GAIN=2, RESET=60))
        printed.append(imported(folder, source(controller.program)))
    program = controller.program
    np.testing.assert_array_equal(outputs(printed[0], program), outputs(printed[1], program))
