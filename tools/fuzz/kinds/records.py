"""Recorded signals, as ``pidemu run --record`` reads them."""

from __future__ import annotations

import io
import math
import re
from random import Random
from typing import Final

from tools.fuzz.case import OLD, Case, Kind, Said, command
from tools.fuzz.corpus.records import corpus
from tools.fuzz.csv_text import damaged, rows_in
from tools.fuzz.failures import Breach
from tools.fuzz.vocabulary import number, plausible

_OTHERS: Final = (
    "time",
    "auto",
    "manual",
    "output",
    "cascade",
    "track",
    "external_reset",
    "feedforward",
    "hold",
    "interval",
    "note",
)
_LINE_ENDS: Final = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x85-\x9f\u2028\u2029]")
"""Characters that no record holds."""
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(inf|infinity|nan)", re.ASCII | re.IGNORECASE)
_CARDS: Final = ("generic/standard", "K=2", "Ti=10", "Td=1"), ("fisher/provox", "GAIN=2", "RESET=4"), ("epics/epid", "KP=1", "KI=2")


def make(rng: Random) -> Case:
    """Return a record, more or less damaged, and a command that reads it."""
    names = ["sp", "pv", *(n for n in _OTHERS if rng.random() < 0.2)]
    if rng.random() < 0.3:
        rng.shuffle(names)
    rows = [[_sample(rng, name, i) for name in names] for i in range(rng.choice((0, 1, 2, 3, 5, 8)))]
    files = {"record.csv": damaged(rng, names, rows)}
    words = ["run", *rng.choice(_CARDS), "--record", "record.csv"]
    if rng.random() < 0.6:
        words += ["--scan", "1"]
    dice = rng.random()
    if dice < 0.3:
        files[f"{OLD}.csv"] = b"sp,pv,emulated\n1,2,3\n"
        words += ["-o", "old.csv" if dice < 0.25 else "record.csv"]
    elif dice < 0.5:
        words.append("--json")
    return Case(tuple(words), files, direct=rng.random() < 0.8, terminal=rng.random() < 0.1)


def _sample(rng: Random, name: str, at: int) -> str:
    if name == "time":
        return rng.choice((str(at), str(at), f"2026-11-22T08:00:{at:02d}"))
    if name in ("auto", "hold"):
        return rng.choice(("1", "0", "true", "man")) if rng.random() < 0.3 else "01"[name == "auto"]
    if name in ("sp", "pv"):
        return number(rng, 0.05)
    return plausible(rng) if rng.random() < 0.7 else ""


def run(case: Case) -> int:
    """Read the record and write it again, or run the whole command."""
    if not case.direct:
        return command(case)
    from pidemu.records.files import read_record, write_record

    found = read_record("record.csv")
    stream = io.StringIO()
    write_record(found, {"emulated": [0.0] * len(found.sp)}, stream)
    _check_rows(case.files["record.csv"], len(found.rows))
    if not len(found.rows) == found.sp.size == found.pv.size:
        raise Breach("row lost", "pidemu run", f"{len(found.rows)} rows, {found.sp.size} setpoints")
    _check_text(case.files["record.csv"])
    for name in ("sp", "pv"):
        at = found.header.index(found.names[name])
        for row in found.rows:
            if not _NUMBER.fullmatch(row[at].strip()):
                raise Breach("takes it for a number", "pidemu run", repr(row[at]))
    return 0


def _check_text(content: bytes) -> None:
    found = _LINE_ENDS.search(content.decode("utf-8-sig"))
    if found:
        raise Breach("takes a control character", "pidemu run", f"U+{ord(found[0]):04X}")
    if content.startswith(b"\xef\xbb\xbf" * 2):
        raise Breach("takes a control character", "pidemu run", "two byte order marks")


def check(case: Case, said: Said) -> None:
    """Every row of the record is in the result."""
    if case.direct or said.status:
        return
    if "-o" in case.words:
        return  # the file is looked at by those who read it: `run` counts rows the same way
    if "--json" in case.words:
        import json

        found = len(json.loads(said.out)["outputs"])
    else:
        lines = [line for line in said.out.split("\n") if line.strip()]
        found = len(lines) - 1 - lines[0].startswith("sep=")  # what a spreadsheet writes above the header is kept
        if '"' in said.out or "#" in said.out:  # cells that span lines, and comments that are kept
            return
    _check_rows(case.files["record.csv"], found)


def _check_rows(content: bytes, found: int) -> None:
    expected = rows_in(content, " \t")
    if found not in expected and not math.isnan(found):
        raise Breach("row lost", "pidemu run", f"{found} rows of {' or '.join(map(str, sorted(expected)))}")


KIND: Final = Kind("records", make, corpus, run, check)
