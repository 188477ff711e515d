"""The fuzz harness finds faults that are planted, makes them small and prints a command that shows them."""

from __future__ import annotations

import time
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import pidemu.records.files
from tests.tools import planted
from tools.fuzz.case import Case, Kind, Ticket, case_of
from tools.fuzz.cli import command
from tools.fuzz.failures import Failure
from tools.fuzz.kinds import KINDS
from tools.fuzz.run import Result, fuzz
from tools.fuzz.shrink import reduce, shrink
from tools.fuzz.workers import run_one

COUNT = 30
BAD = [i for i in range(COUNT) if planted.is_bad(planted.make(Random(f"planted:0:{i}")))]
GOOD = "sp,pv\n50,50\n60,50\n"


def run(name: str, jobs: int = 1) -> Result:
    return fuzz([planted.kind(name)], 0, count=COUNT, jobs=jobs, patience=8, effort=5)


def outcome(
    words: tuple[str, ...], folder: Path, text: str = GOOD, *, kind: str = "records", direct: bool = False
) -> Failure | None:
    case = Case(words, {"record.csv": text.encode()}, direct=direct)
    return run_one(KINDS[kind], Ticket(kind, "0", "0"), folder, case)[0]


RUN = ("run", "generic/standard", "K=1", "Ti=10", "--scan", "1", "--record", "record.csv")


@pytest.mark.parametrize("name", planted.RUNS)
def test_every_planted_fault_is_found_wherever_it_is(name: str) -> None:
    found = run(name)
    what, place = planted.EXPECTED[name]
    assert [what] == [group.failure.what for group in found.groups]
    assert found.groups[0].failure.place.split(":")[0] in (place, place.split(":")[0])
    assert len(BAD) == found.groups[0].count
    assert str(BAD[0]) == found.groups[0].ticket.number
    assert COUNT == found.tallies["planted"].count


def test_a_row_that_is_lost_is_found() -> None:
    found = fuzz([Kind("planted", planted.make, run=planted.well, check=planted.lose_a_row)], 0, count=COUNT, effort=5)
    assert [("row lost", "planted")] == [group.failure.group for group in found.groups]


@pytest.mark.parametrize("name", ["crash", "paint", "destroy"])
def test_a_failure_is_made_as_small_as_it_can_be(name: str) -> None:
    smallest = run(name).groups[0].smallest
    assert (("planted",), {"numbers.txt": b"bad"}) == (smallest.words, smallest.files)


def test_the_number_of_processes_changes_neither_inputs_nor_failures() -> None:
    one, two = run("crash", jobs=1), run("crash", jobs=2)
    assert one.tallies["planted"].count == two.tallies["planted"].count
    assert [(str(g.ticket), g.count, g.smallest) for g in one.groups] == [(str(g.ticket), g.count, g.smallest) for g in two.groups]


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_an_input_depends_on_kind_seed_and_number_alone(kind: Kind) -> None:
    tickets = [Ticket(kind.name, "5", str(i)) for i in range(20)]
    first = [case_of(kind, t) for t in tickets]
    assert list(reversed(first)) == [case_of(kind, t) for t in reversed(tickets)]
    assert len({(c.words, *c.files.values()) for c in first}) > 15


def test_what_fails_is_printed_as_a_command_that_shows_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(KINDS, "planted", planted.kind("crash"))
    words = ["--kinds", "planted", "--count", str(COUNT), "--jobs", "1", "--keep", str(tmp_path)]
    found = CliRunner().invoke(command, words)
    assert found.exit_code == 1
    folder = f"planted-0-{BAD[0]}"
    [headline] = [line for line in found.stdout.splitlines() if line.startswith("planted: ")]
    assert headline.startswith("planted: ZeroDivisionError at tests/tools/planted.py:")
    assert headline.endswith(f", {len(BAD)} times")
    assert f"  cd {tmp_path / folder} && pidemu planted\n" in found.stdout
    assert b"bad" == (tmp_path / folder / "numbers.txt").read_bytes()
    assert f"{COUNT} inputs, {len(BAD)} failures in 1 groups" in found.stdout
    [again] = [line.split()[-1] for line in found.stdout.splitlines() if "--again" in line]
    shown = CliRunner().invoke(command, ["--again", again, "--keep", str(tmp_path)])
    assert shown.exit_code == 1
    assert "ZeroDivisionError: planted" in shown.stdout
    assert "cd " in shown.stdout


def test_a_run_without_failures_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(KINDS, "planted", Kind("planted", planted.make, run=planted.well))
    found = CliRunner().invoke(command, ["--kinds", "planted", "--count", "7", "--jobs", "1", "--keep", str(tmp_path)])
    assert found.exit_code == 0
    assert "7 inputs, 0 failures in 0 groups" in found.stdout


def test_a_run_by_time_ends_in_time() -> None:
    began = time.monotonic()
    found = fuzz([Kind("planted", planted.make, run=planted.well)], 0, minutes=0.02)
    assert found.tallies["planted"].count > 0
    assert time.monotonic() - began < 60


@pytest.mark.parametrize("text", ["records", "records:1", "nokind:0:1", "records:corpus:none"])
def test_an_input_that_is_not_there_is_wrong_usage(text: str) -> None:
    assert CliRunner().invoke(command, ["--again", text]).exit_code == 2


def test_an_error_of_pidemu_is_an_answer(tmp_path: Path) -> None:
    assert outcome(RUN, tmp_path) is None
    assert outcome(RUN, tmp_path, "sp\n1\n2\n") is None
    assert outcome(RUN, tmp_path, "sp\n1\n2\n", direct=True) is None


def test_a_crash_in_pidemu_is_found_at_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pidemu.records.files.plain_numbers", lambda _cells: 1 / 0)
    found = outcome(RUN, tmp_path, "time,sp,pv\n0,1,2\n1,1,2\n")
    assert found is not None
    assert "ZeroDivisionError" == found.what
    assert found.place.startswith("src/pidemu/records/files.py:")
    assert "ZeroDivisionError" in found.trace


def test_a_lost_row_in_pidemu_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def forgetful(path: str) -> Any:
        from dataclasses import replace

        found = kept(path)
        return replace(found, sp=found.sp[1:], pv=found.pv[1:], rows=found.rows[1:])

    kept = pidemu.records.files.read_record
    monkeypatch.setattr("pidemu.records.files.read_record", forgetful)
    monkeypatch.setattr("pidemu.cli.run.read_record", forgetful)
    text = "sp,pv\n50,50\n60,50\n60,51\n"
    for direct in (True, False):
        found = outcome(RUN, tmp_path, text, direct=direct)
        assert found is not None
        assert "row lost" == found.what


def test_a_warning_in_pidemu_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def warn(*_words: object) -> None:
        np.float64(1) / np.float64(0)

    monkeypatch.setattr("pidemu.cli.run.timing", warn)
    found = outcome(RUN, tmp_path)
    assert found is not None
    assert "RuntimeWarning" == found.what


def test_engines_that_disagree_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = (*RUN, "--action", "reverse", "--engine", "numpy")
    assert outcome(words, tmp_path, kind="signals", direct=True) is None
    from tools.fuzz.kinds import signals

    kept = signals._played

    def other(*arguments: Any) -> Any:
        outputs, *rest = kept(*arguments)
        return (np.nextafter(outputs, 1e9) if arguments[-1] == "numpy" else outputs, *rest)

    monkeypatch.setattr(signals, "_played", other)
    found = outcome(words, tmp_path, kind="signals", direct=True)
    assert found is not None
    assert "engines disagree" == found.what


def test_delta_debugging_leaves_what_is_needed() -> None:
    assert [3, 17, 41] == list(reduce(range(50), lambda left: {3, 17, 41} <= set(left)))
    assert [] == list(reduce(range(50), lambda _left: True))
    assert [7] == list(reduce([7], lambda left: 7 in left))


def test_making_small_stops_when_its_attempts_are_used_up() -> None:
    tried: list[Case] = []

    def fails(case: Case) -> bool:
        tried.append(case)
        return True

    shrink(planted.make(Random(0)), fails, attempts=25)
    assert len(tried) <= 25
