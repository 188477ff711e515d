"""Small loop lists as text, for tests: one header, and rows that differ from a usual loop in what is named."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import pidemu
from pidemu.plant.job import RetrofitResult
from pidemu.plant.rows import RetrofitRow

HEADER: Final = {
    "Tag": "TIC-1", "Service": "Reactor", "System": "fisher/provox", "P": "2", "P unit": "gain", "I": "4", "I unit": "rep/min",
    "D": "", "D unit": "", "PV filter [s]": "", "Form": "", "Equation": "", "LRV": "0", "URV": "200", "EU": "degC", "New LRV": "",
    "New URV": "", "Re-ranged?": "", "OP lo": "0", "OP hi": "100", "Action": "reverse", "Mode": "AUTO", "Update [s]": "",
    "Scan [s]": "1",
    "Options": "", "Remarks": "",
}  # fmt: skip
TDC: Final = {"System": "honeywell/tdc3000", "I": "5", "I unit": "min/rep", "Form": "ideal", "Equation": "EQA"}
PLC: Final = {"System": "allen-bradley/plc5", "P unit": "", "I": "0.05", "I unit": "", "Equation": "independent"}
UDC: Final = {"System": "honeywell/udc", "P": "50 %", "P unit": "PB", "I": "0.7 min", "I unit": "MIN", "Equation": "PID A"}
FC19: Final = {"System": "bailey/fc19", "P unit": "eu/eu", "I": "1.5", "I unit": "1/min"}
YOKOGAWA: Final = {"System": "yokogawa/fieldbus-pid", "I": "216", "I unit": "s"}


def write_list(folder: Path, *rows: Mapping[str, str], name: str = "list.csv", above: str = "") -> Path:
    """Write a list of loops, each the usual one with what is named of it, and return its file."""
    lines = [list(HEADER), *([{**HEADER, **row}[column] for column in HEADER] for row in rows)]
    file = folder / name
    file.write_text(above + "".join(";".join(f'"{cell}"' for cell in line) + "\n" for line in lines), "utf-8")
    return file


def run(folder: Path, *rows: Mapping[str, str], **how: Any) -> RetrofitResult:
    """Convert a list of loops to DeltaV, or to what is named."""
    return pidemu.retrofit(write_list(folder, *rows), **{"target": "emerson/deltav", **how})


def run_one(folder: Path, row: Mapping[str, str], **how: Any) -> RetrofitRow:
    """Convert one loop."""
    return run(folder, row, **how).rows[0]
