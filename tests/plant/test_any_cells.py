"""Whatever the cells hold, every line is accounted for, no line costs another, and nothing but a finding comes of it."""

from __future__ import annotations

import random
from pathlib import Path

from pidemu.plant.decisions import Decisions
from pidemu.plant.job import convert_lists
from pidemu.plant.loop_list import read_lists
from pidemu.plant.mapping import PlantWords
from pidemu.plant.rules import read_rules
from pidemu.plant.sources import read_sources
from tests.plant.lists import FC19, HEADER, PLC, TDC, UDC, YOKOGAWA, write_list

NUMBERS = (
    "", "0", "1", "2.5", "2,5", "1e300", "-1e-300", "nan", "inf", "-inf", "∞", "off", "1.5?", "~2", "1/2", "06. Sep",
    "12:30", "1 000",
    "1.234.567,8", "1e999", "0x10", "۳", "٣,٥", "²", "1e", "+", "-", ".", ",", "= 2", "2 min", "2 %", "2 rep/min", "2 barg",
    "9" * 400,
)  # fmt: skip
UNITS = (
    "", "gain", "PB", "%", "%/%", "eu/eu", "%/eu", "rep/min", "min", "min/rep", "s", "ms", "h", "1/s", "1/min", "rep/s", "m",
    "r", "?", "x",
)  # fmt: skip
WORDS = (
    "", "?", "ideal", "EQA", "PID A", "dependent", "PV", "error", "K=2", "K=x", "FORM=ideal", "reverse", "D", "CAS", "MAN",
    "Y", "N",
    "\u202e", "=1+1", "a\nb",
)  # fmt: skip
SYSTEMS = (
    "fisher/provox", "foxboro/ia-pid", "honeywell/tdc3000", "honeywell/udc", "bailey/fc19", "bailey/fc18",
    "yokogawa/fieldbus-pid",
    "allen-bradley/plc5", "allen-bradley/logix-pid", "allen-bradley/pide", "automationdirect/directlogic", "toshiba/pid3",
    "emerson/deltav",
    "generic/dahlin", "generic/parallel", "epics/epid", "acme", "", "../../etc/passwd", "fisher",
)  # fmt: skip
NUMERIC = ("P", "I", "D", "PV filter [s]", "LRV", "URV", "New LRV", "New URV", "OP lo", "OP hi", "Update [s]", "Scan [s]")


def any_row(random_: random.Random, number: int) -> dict[str, str]:
    row = dict(random_.choice(({}, TDC, PLC, UDC, FC19, YOKOGAWA)))
    row["Tag"] = random_.choice((f"TIC-{number}", f"TIC-{number}", "", "TIC-1", "\u202eX"))
    for column in random_.sample(list(HEADER), random_.randint(1, 5)):
        pool = NUMBERS if column in NUMERIC else UNITS if "unit" in column else SYSTEMS if column == "System" else WORDS
        row[column] = random_.choice(pool).replace('"', '""')
    return row


def test_any_cells_are_findings_and_nothing_else(tmp_path: Path) -> None:
    random_ = random.Random(17)
    rows = [any_row(random_, n) for n in range(1500)]
    listed = read_lists(read_sources([write_list(tmp_path, *rows)]), PlantWords(), Decisions())
    lost = [f for reading, _ in listed.loops for f in reading.findings if f.code == "E-program"]
    assert lost == []
    listed.loops = listed.loops[::10]
    for target in ("emerson/deltav", "allen-bradley/pide"):
        found, summary = convert_lists(listed, read_rules(None, target), PlantWords(), Decisions())
        assert [f for row in found for f in row.reading.findings if f.code == "E-program"] == []
        assert len(found) == len(listed.loops)
        assert summary.lines == sum(summary.counts.values())
        assert all(bool(row.settings) == (row.row_class == "converted") for row in found)
