"""Printed JavaScript, run in Node through nothing but what it exports."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from pidemu.program.ir import Program
from tests.helpers import Floats

NODE = shutil.which("node") or shutil.which("nodejs")
needs_node = pytest.mark.skipif(NODE is None, reason="there is no Node on the PATH")

_PLAY = """
const fs = require("fs");
const control = require("./printed.js");
const { inputs, states, scans } = JSON.parse(fs.readFileSync("inputs.json", "utf8"));
const numbers = fs.readFileSync("signals.bin");
const all = new Float64Array(numbers.buffer, numbers.byteOffset, numbers.length / 8);
const signals = Object.fromEntries(inputs.map((name, k) => [name, all.subarray(k * scans, (k + 1) * scans)]));
const state = control.initial();
const outputs = control.run(state, signals, scans).flat();
fs.writeFileSync("outputs.bin", Buffer.from(Float64Array.from([...outputs, ...states.map((name) => state[name])]).buffer));
"""


def evaluated(text: str, folder: Path) -> str:
    """Run JavaScript and return what it prints."""
    assert NODE is not None
    done = subprocess.run([NODE, "-e", text], capture_output=True, text=True, check=False, cwd=folder, timeout=60)
    assert done.stderr == ""
    return done.stdout


def play(folder: Path, text: str, program: Program, signals: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Run a printed program whose names are JavaScript's, too; return outputs, a row per name recorded, and states."""
    (folder / "printed.js").write_text(text, encoding="utf-8")
    scans = len(signals[0])
    named = {"inputs": [q.name for q in program.inputs], "states": [q.name for q in program.states], "scans": scans}
    (folder / "inputs.json").write_text(json.dumps(named), encoding="utf-8")
    (folder / "signals.bin").write_bytes(np.array(signals, dtype=np.float64).tobytes())
    assert evaluated(_PLAY, folder) == ""
    found = np.frombuffer((folder / "outputs.bin").read_bytes(), dtype=np.float64)
    ends = len(program.recorded) * scans
    return found[:ends].reshape(scans, -1).T, found[ends:]
