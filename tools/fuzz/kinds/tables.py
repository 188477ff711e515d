"""Files of loops, as ``pidemu fleet`` reads them."""

from __future__ import annotations

import csv
import io
import json
import re
from random import Random
from typing import Final

from tools.fuzz.case import FORCED_NUMPY, OLD, Case, Kind, Said, command
from tools.fuzz.corpus.tables import corpus
from tools.fuzz.csv_text import damaged, rows_in
from tools.fuzz.failures import Breach
from tools.fuzz.library import a_card, changed_settings
from tools.fuzz.phrases import limits, process, step, time
from tools.fuzz.vocabulary import text

_MORE: Final = ("scan", "action", "limits", "setpoint", "load", "time")
_EMPTY: Final = " \t\r,;"
_FORMULA: Final = re.compile(r"[=@\t\r]|[+-](?![\d.]+(e[+-]?\d+)?$|inf$)", re.IGNORECASE)
"""What a spreadsheet computes; a number is what it says."""
_TEXTS: Final = ("tag", "card", "reason")


def make(rng: Random) -> Case:
    """Return a file of loops, more or less damaged, and a command that runs it."""
    header = ["tag", "card", "settings", "process", *(n for n in _MORE if rng.random() < 0.35)]
    rows = [_row(rng, i, header) for i in range(rng.choice((0, 1, 1, 2, 3, 5)))]
    files = {"loops.csv": damaged(rng, header, rows)}
    words = ["fleet", "loops.csv", "--time", "20", "--cores", "1", "--no-progress"]
    if rng.random() < 0.7:
        words.append("--no-margins")
    if rng.random() < 0.3:
        words += ["--engine", rng.choice(("python", "numpy"))]
    dice = rng.random()
    if dice < 0.4:
        files[f"{OLD}.csv"] = b"tag,card,status\nA,x/y,done\n"
        words += ["--table", "old.csv" if dice < 0.35 else "loops.csv"]
    elif dice < 0.8:
        words.append("--json")
    each = 2.0 + (FORCED_NUMPY if "numpy" in words else 0.0)
    return Case(tuple(words), files, direct=rng.random() < 0.95, limit=2.0 + each * len(rows))


def _row(rng: Random, at: int, header: list[str]) -> list[str]:
    card, settings = a_card(rng)
    tag = text(rng) if rng.random() < 0.05 else f"FIC-{100 + at}"
    settings = changed_settings(rng, settings, 0.1)
    cells = {
        "tag": tag,
        "card": card,
        "settings": "; ".join(settings),
        "process": process(rng, 0.1),
        "scan": rng.choice(("", "1", time(rng, 0.1))),
        "action": rng.choice(("", "", "reverse", "direct", "DIRECT", "up")),
        "limits": rng.choice(("", "0,100", limits(rng, 0.1))),
        "setpoint": step(rng, 0.1),
        "load": step(rng, 0.1),
        "time": rng.choice(("", "10", "20 s", time(rng, 0.1))),
    }
    return [cells[name] for name in header]


def run(case: Case) -> int:
    """Read the file, or run the whole command."""
    if not case.direct:
        return command(case)
    from pidemu.fleet.table import read_loops

    found = read_loops("loops.csv")
    _check_rows(case.files["loops.csv"], len(found))
    return 0


def check(case: Case, said: Said) -> None:
    """Every row of the file is in the result, done or failed, and in a table as text."""
    if case.direct or said.status == 2:
        return
    if "--json" in case.words:
        _check_rows(case.files["loops.csv"], len(json.loads(said.out)["loops"]))
    elif "--table" in case.words:
        with open("old.csv", newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(io.StringIO(file.read(), newline="")))
        _check_rows(case.files["loops.csv"], len(rows))
        for name in _TEXTS:
            for row in rows:
                if _FORMULA.match(row.get(name) or ""):
                    raise Breach("a formula for spreadsheets", "pidemu fleet --table", f"{name}: {row[name]}")


def _check_rows(content: bytes, found: int) -> None:
    expected = rows_in(content, _EMPTY)
    if found not in expected:
        raise Breach("row lost", "pidemu fleet", f"{found} rows of {' or '.join(map(str, sorted(expected)))}")


KIND: Final = Kind("tables", make, corpus, run, check)
