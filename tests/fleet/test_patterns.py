"""Rows of a table read together are those read alone, word for word where they are wrong; and few are read alone."""

from __future__ import annotations

import pickle
import random
from pathlib import Path
from typing import Any

import pytest

import pidemu
from pidemu.card.library import builtin_folder
from pidemu.fleet.finished import keys
from pidemu.fleet.kinds import numbered
from pidemu.fleet.loops import FleetPlan
from pidemu.fleet.patterns import Patterns
from pidemu.fleet.rows import RowReader
from pidemu.fleet.table import LoopTable, read_loops
from tests.helpers import copied

HEAD = "tag,card,settings,process,scan,action,limits,setpoint,load,time"
ROWS = (
    'generic/standard,K={a}; Ti={b}; Td={c},"gain={a}, lag={b}, delay={c}",0.5,,"0,100",,,',
    "generic/standard,k = {a} ; TI={b} min,\"gain={a},lag={b} min,lag={c}\",{c},reverse,\"{a},9{a}\",\"{c},{b}\",{a},60{b}",
    'emerson/deltav,GAIN={a}; RESET={b}; STRUCTURE=3,"gain={a},lag={b}",1 s,,,,,5 min',
    'emerson/deltav,"GAIN={a}; RESET={b}; RATE={c} min; pv_range=0,400 degC","gain={a},integrators=1,lag={c}",0.5,direct,,,,',
    "honeywell/udc,PB={b}; RSET={c}; RATE=6 s,\"gain={a} %/%,lag={b},lead={c},delay=1\",0.5,,,,,",
    'bailey/fc19,K={a}; KP=1; KI={c}; KD=0,"gain=-{a},pole=-0.3,delay={c} s",0.5,,,,,',
    'honeywell/tdc3000,K={a}; T1={c}; T2=0.1; CTEQN=B,"gain={a},lag={b}",0.5,,,,,',
    'generic/standard,K={a},"gain={a},pole=-0.1+0.2j",0.5,,,,,',
    'no/card,K={a},"gain={a}",0.5,,,,,',
    'generic/standard,K={a}; Ti={b}; Tb=3,"gain={a}",0.5,,,,,',
    'generic/standard,K={a}; Ti={b},"gain={a},lag={b}",0.5,revers,,,,',
    'generic/standard,K={a}; Ti={b},"gain={a},lag={b}",0.5,,"100,{a}",,,',
    'generic/standard,K={a}; Ti={b},"gain={a},lag={b}",0.5,,,,',
    'generic/standard,K={a}; Ti={b},"gain={a},lag={b},0.5,,,,,',
    'generic/standard,K={a}\x07; Ti={b},"gain={a},lag={b}",0.5,,,,,',
)  # fmt: skip
NUMBERS = (
    "0",
    "0.0",
    "-1.5",
    "1e999",
    "1e-999",
    "1,5",
    "abc",
    "1.2.3",
    "inf",
    "nan",
    "-0",
    "+2",
    ".5",
    "3.",
    "1_0",
    "1e3",
    "0x1",
    "1e-20",
    "2s",
)


def table(path: Path, count: int, seed: int, *, wrong: float = 0.1, head: str = HEAD) -> Path:
    """Write a table of rows of few patterns, some with odd numbers or tags."""
    chance = random.Random(seed)

    def number(low: float, high: float) -> str:
        return chance.choice(NUMBERS) if chance.random() < wrong else f"{chance.uniform(low, high):.4g}"

    lines = []
    for i in range(count):
        odd = chance.choice([f"'=x{i}", f"Kühler {i}", f"L{i - 1}", "", f'"A,{i}"', f'"a ""b"" {i}"', f" L{i} "])
        tag = odd if chance.random() < wrong else chance.choice([f"L{i}", f'"L{i}"', f'"TIC {i}"'])
        row = chance.choice(ROWS).format(a=number(0.2, 3), b=number(4, 40), c=number(0.3, 3))
        cells = {"tag": tag, "rest": row}
        lines.append(f"{row},{tag}" if head.endswith("tag") else f"{cells['tag']},{row}")
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


def all_of(found: LoopTable) -> tuple[Any, ...]:
    loops = list(found.loops)
    return loops, [loop.settings.notes for loop in loops], found.lines, found.wrong, list(found.loops.tags), list(found.loops.cards)


@pytest.mark.parametrize("head", [HEAD, HEAD.removeprefix("tag,") + ",tag"])
@pytest.mark.parametrize("wrong", [0.01, 0.2])
def test_rows_read_together_are_those_read_alone(head: str, wrong: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = table(tmp_path / "loops.csv", 600, 14, wrong=wrong, head=head)
    together = read_loops(path)
    kinds, _ = together.loops.by_kind()
    monkeypatch.setattr(Patterns, "take", lambda *_: None)
    alone = read_loops(path)
    assert all_of(together) == all_of(alone)
    assert len(together.wrong) > 150
    monkeypatch.undo()
    for kind, lot in kinds:
        for which, numbers in zip(lot.which.tolist(), lot.columns.T.tolist(), strict=True):
            one = numbered(alone.loops[which])
            assert one is not None
            assert (one.kind, one.numbers) == (kind, numbers)


def counted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    count, real = [0], RowReader.loop

    def loop(self: RowReader, row: Any) -> Any:
        count[0] += 1
        return real(self, row)

    monkeypatch.setattr(RowReader, "loop", loop)
    return count


def test_one_row_of_a_pattern_is_read_however_many_there_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    count = counted(monkeypatch)
    row = 'generic/standard,K={}; Ti={}; Td=0,"gain=1.2, lag={}, delay=2",0.5'
    lines = [f"L{i},{row.format(1 + i / 7, 10 + i, 20 + i / 3)}" for i in range(1000)]
    path = tmp_path / "loops.csv"
    path.write_text("\n".join(["tag,card,settings,process,scan", *lines]), encoding="utf-8")
    loops = read_loops(path).loops
    assert count == [1]
    assert loops[700] == pidemu.Loop(
        "L700",
        pidemu.load_card("generic/standard").settings(K=str(1 + 700 / 7), Ti="710", Td="0"),
        pidemu.Process.from_lags(1.2, [20 + 700 / 3], delay=2),
        0.5,
    )


def test_a_table_is_run_and_written_without_its_loops_being_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    row = 'generic/standard,K={}; Ti={}; Td=0,"gain=1.2, lag={}, delay=2",0.5'
    lines = [f"L{i},{row.format(1 + i / 700, 10 + i / 7, 20 + i / 3)}" for i in range(500)]
    path = tmp_path / "loops.csv"
    path.write_text("\n".join(["tag,card,settings,process,scan", *lines]), encoding="utf-8")
    count = counted(monkeypatch)
    found = read_loops(path)
    result = pidemu.Fleet(found.loops).simulate(time=20.0, margins=False, engine="numpy")
    found.write(tmp_path / "out.csv", result)
    assert result.counts == {"done": 500}
    assert count == [2]  # one whose reading, and one whose preparing is recorded
    one = pidemu.Fleet(list(found.loops)[321:322]).simulate(time=20.0, margins=False, engine="python")
    assert {name: x[321] for name, x in result.columns.items() if x[321] == x[321]} == {
        name: x[0] for name, x in one.columns.items() if x[0] == x[0]
    }


def test_a_choice_that_looks_like_a_number_is_no_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    count = counted(monkeypatch)
    row = 'emerson/deltav,GAIN={}; RESET=9; RATE=1; STRUCTURE={},"gain=1, lag=9",0.5'
    lines = [f"L{i},{row.format(1 + i / 7, 1 + i % 3)}" for i in range(90)]
    path = tmp_path / "loops.csv"
    path.write_text("\n".join(["tag,card,settings,process,scan", *lines]), encoding="utf-8")
    loops = read_loops(path).loops
    assert count == [3]
    assert [loop.settings.options["STRUCTURE"] for loop in loops][:6] == ["1", "2", "3", "1", "2", "3"]


def test_keys_of_the_loops_of_a_table_are_those_of_the_loops_themselves(tmp_path: Path) -> None:
    loops = read_loops(table(tmp_path / "loops.csv", 200, 5)).loops
    assert keys(loops.quickly(), FleetPlan()) == keys(list(loops), FleetPlan())


def test_parts_of_a_table_are_its_loops(tmp_path: Path) -> None:
    loops = read_loops(table(tmp_path / "loops.csv", 200, 3)).loops
    part = loops[20:40]
    assert (list(part), list(part.tags), list(part.cards)) == (
        list(loops)[20:40],
        list(loops.tags)[20:40],
        list(loops.cards)[20:40],
    )
    assert list(part.chosen([3, 5])) == [loops[23], loops[25]]
    assert loops[-1] == list(loops)[-1]
    with pytest.raises(IndexError):
        loops[len(loops)]
    which = sorted(i for kind, lot in part.by_kind()[0] for i in lot.which.tolist())
    assert which == sorted(set(range(20)) - set(part.by_kind()[1]))


def test_rows_that_go_to_another_machine_take_their_cards_along(tmp_path: Path) -> None:
    own = tmp_path / "cards" / "acme" / "pid.yaml"
    own.parent.mkdir(parents=True)
    own.write_text(copied(builtin_folder() / "generic" / "standard.yaml"), encoding="utf-8")
    path = tmp_path / "loops.csv"
    rows = [f'L{i},acme/pid,K={i + 1}; Ti=9; Td=0,"gain=1,lag=9",0.5' for i in range(6)]
    path.write_text("\n".join(["tag,card,settings,process,scan", *rows]), encoding="utf-8")
    loops = read_loops(path, [tmp_path / "cards"]).loops
    sent, numbers = pickle.dumps(loops[2:6]), [loop.settings["K"].value for loop in loops]
    own.unlink()
    assert [loop.settings["K"].value for loop in pickle.loads(sent)] == numbers[2:6]
