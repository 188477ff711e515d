"""Structured Text compiled by MATIEC's `iec2c` and a C compiler, where both are on the PATH, and run."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.backends.c_compiler import COMPILER

IEC2C = shutil.which("iec2c")
_BESIDE = [Path(IEC2C).resolve().parent / "lib", Path(IEC2C).resolve().parents[1] / "share" / "matiec" / "lib"] if IEC2C else []
_PLACES = [Path(os.environ.get("MATIEC_LIBRARY", "none")), *_BESIDE]
LIBRARY = next((place for place in _PLACES if (place / "C" / "iec_std_lib.h").exists()), None)
needs_matiec = pytest.mark.skipif(LIBRARY is None or COMPILER is None, reason="there is no iec2c on the PATH")

_TASK = """
CONFIGURATION all
  RESOURCE one ON PLC
    TASK fast(INTERVAL := T#20ms, PRIORITY := 0);
    PROGRAM test WITH fast : control_TEST;
  END_RESOURCE
END_CONFIGURATION
"""
_MAIN = """
#include <stdio.h>
#include "iec_std_lib.h"
TIME __CURRENT_TIME;
BOOL __DEBUG;
#include "accessor.h"
#include "POUS.h"
#include "POUS.c"
int main(void)
{
    static CONTROL_TEST test;
    int calls = 0;
    CONTROL_TEST_init__(&test, 0);
    while (!__GET_VAR(test.DONE,) && calls++ < 100000)
        CONTROL_TEST_body__(&test);
    printf("%d %d\\n", __GET_VAR(test.OK,), (int)__GET_VAR(test.WRONG_SCAN,));
    return 0;
}
"""


def play_test(folder: Path, text: str) -> str:
    """Compile a block with its test and return ok and the first wrong scan, or what the compilers say."""
    assert LIBRARY is not None
    assert IEC2C is not None
    assert COMPILER is not None
    (folder / "printed.st").write_text(text + _TASK, encoding="utf-8")
    (folder / "main.c").write_text(_MAIN, encoding="utf-8")
    commands = (
        [IEC2C, "-I", str(LIBRARY), "-T", str(folder), "printed.st"],
        [COMPILER, "-w", "-O1", "-ffp-contract=off", f"-I{LIBRARY / 'C'}", "main.c", "-o", "main", "-lm"],
        ["./main"],
    )
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder, timeout=120)
        if done.returncode:
            return done.stdout + done.stderr
    return done.stdout.strip()
