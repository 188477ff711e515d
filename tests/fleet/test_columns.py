"""Loops prepared together are those prepared alone: coefficients, states at rest, dead times, scans, and why one fails."""

from __future__ import annotations

import pickle
import random
from collections.abc import Sequence
from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import Any

import pytest

import pidemu
from pidemu import Fleet, Loop, Process
from pidemu.controller import controller
from pidemu.fleet import prepare, recorded
from pidemu.fleet.group import Group
from pidemu.fleet.kinds import numbered, with_numbers
from pidemu.fleet.lists import LoopList, PlacedLoops
from pidemu.fleet.loops import FleetPlan
from pidemu.fleet.prepare import Failed, Preparation
from pidemu.program.builder import build
from pidemu.settings.settings import off_values
from tests.fleet.support import mixed

PLAN = FleetPlan(time=60.0, margins=False)


def placed(loops: Sequence[Loop]) -> PlacedLoops:
    return PlacedLoops(LoopList(loops), range(len(loops)))


def by_place(found: Sequence[Group | Failed]) -> dict[int, Any]:
    """Return all that is known of the loops, by place."""
    known: dict[int, Any] = {}
    for one in found:
        if isinstance(one, Failed):
            known[one.place] = one.reason
            continue
        c = one.columns
        for i, member in enumerate(one):
            numbers = [*c.values[i].tolist(), *c.initial[i].tolist(), *c.lengths[i].tolist()]
            known[member.place] = (member, one.structure, ["nan" if isnan(x) else x for x in numbers])
    return known


def together(loops: Sequence[Loop], plan: FleetPlan = PLAN) -> dict[int, Any]:
    return by_place(list(Preparation(plan).prepared(placed(loops))))


def alone(loops: Sequence[Loop], plan: FleetPlan = PLAN) -> dict[int, Any]:
    return by_place([one for i in range(len(loops)) for one in Preparation(plan).prepared(placed(loops)[i : i + 1])])


def varied(loop: Loop, count: int, seed: int) -> list[Loop]:
    """Return a loop, and others that have some of its numbers a little larger or smaller, or off, or zero."""
    one, chance = numbered(loop), random.Random(seed)
    if one is None:
        return [loop]
    dials = list(loop.settings.values())
    found = []
    for n in range(count):
        numbers = list(one.numbers)
        for i, x in enumerate(numbers):
            if n and chance.random() < 0.5:
                numbers[i] = x * chance.uniform(0.8, 1.25)
            if n and i < len(dials) and chance.random() < 0.05:
                numbers[i] = chance.choice([*off_values(dials[i].setting), 0.0, -x])
        found.append(replace(with_numbers(loop, numbers), tag=f"{loop.tag} {n}"))
    return found


def test_every_card_is_prepared_together_as_alone() -> None:
    loops = [one for n, loop in enumerate(mixed()) for one in varied(loop, 9, n)]
    random.Random(2).shuffle(loops)
    found = together(loops)
    assert found == alone(loops)
    assert sum(isinstance(one, str) for one in found.values()) >= 20  # what cannot be run fails in the same words


STANDARD: Any = [
    {"K": 2, "Ti": 10},
    {"K": 2, "Ti": 10, "Td": 3},
    {"K": 2, "Ti": "off", "Td": 1},
    {"K": 2, "Td": 3, "Tf": 0.3, "Ti": 9},
]
DELTAV: Any = [{"GAIN": 2, "RESET": 9, "RATE": 1}, {"GAIN": 2, "RESET": 9, "RATE": 0}, {"GAIN": 2, "RESET": 9, "STRUCTURE": "3"}]
PROVOX: Any = [{"GAIN": 2, "RESET": 9, "RATE": 0}, {"GAIN": 2, "RESET": 9, "RATE": 0.1}, {"GAIN": 2, "RESET": 4, "RATE": "6 s"}]
OSCAT: Any = [{"KP": 1.2, "TN": 8, "TV": 0.3}, {"KP": 1.2, "TN": 8, "TV": 0}]
BAILEY: Any = [{"K": 1, "KP": 1, "KI": 2, "KD": 0}, {"K": 1, "KP": 1, "KI": 2, "KD": 0.1, "pv_range": (0, 400)}]
LISTS = {
    "generic/standard": STANDARD,
    "emerson/deltav": DELTAV,
    "fisher/provox": PROVOX,
    "oscat/ft-pid": OSCAT,
    "bailey/fc19": BAILEY,
}


def some_process(chance: random.Random) -> Process:
    delay = chance.choice([0.0, 1.0, chance.uniform(0, 9)])
    return chance.choice(
        [
            Process.from_lags(chance.uniform(0.5, 2), [chance.uniform(4, 40)], delay=delay),
            Process.from_lags(-chance.uniform(0.5, 2), [chance.uniform(4, 40), 3.0], delay=delay),
            Process.from_lags(chance.uniform(0.01, 0.1), [2.0], integrators=1),
            Process(1.0, [-0.1 + 0.2j, -0.1 - 0.2j]),
        ]
    )


def some_statement(chance: random.Random) -> dict[str, Any]:
    size = chance.uniform(1, 9)
    own: dict[str, Any] = chance.choice(
        [{}, {}, {"load": (20.0, size)}, {"scan": -1.0}, {"initial": (40, 40, chance.choice([30, 130]))}]
    )
    return {"scan": chance.choice([0.5, 0.2])} | own


@pytest.mark.parametrize(("card", "some"), LISTS.items())
def test_lists_of_unlike_loops_are_prepared_together_as_alone(card: str, some: list[dict[str, Any]]) -> None:
    chance, made = random.Random(14), pidemu.load_card(card)
    loops = []
    for n in range(120):
        given = some[n % len(some)].items()
        dials = {name: x * chance.uniform(0.7, 1.4) if isinstance(x, float | int) else x for name, x in given}
        loops.append(Loop(f"L{n}", made.settings(dials), some_process(chance), **some_statement(chance)))
    assert together(loops) == alone(loops)


def counted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    built = [0]

    def counts(*args: Any, **named: Any) -> Any:
        built[0] += 1
        return build(*args, **named)

    monkeypatch.setattr(controller, "build", counts)
    return built


def alike(count: int, name: str = "L") -> list[Loop]:
    card = pidemu.load_card("generic/standard")
    settings = [card.settings(K=0.5 + i / 900, Ti=8.0 + i % 7, Td=0.4, Tf=0.2) for i in range(count)]
    return [Loop(f"{name}{i}", s, Process.from_lags(0.9, [5.0 + i % 11], delay=2.3 + i), 0.5) for i, s in enumerate(settings)]


def test_one_program_is_built_for_all_loops_of_a_structure_however_many_blocks_they_make(monkeypatch: pytest.MonkeyPatch) -> None:
    built = counted(monkeypatch)
    preparation = Preparation(PLAN)
    loops = placed(alike(300))
    groups = [one for start in range(0, 300, 100) for one in preparation.prepared(loops[start : start + 100])]
    assert [len(group) for group in groups if isinstance(group, Group)] == [100, 100, 100]
    assert built == [1]
    assert len({id(group.structure) for group in groups if isinstance(group, Group)}) == 1


def test_a_loop_of_another_structure_costs_programs_of_its_own_only(monkeypatch: pytest.MonkeyPatch) -> None:
    loops = alike(200)
    card = pidemu.load_card("generic/standard")
    loops[50] = replace(loops[50], settings=card.settings(K=1, Ti=10, Td=0, Tf=0))
    loops[120] = replace(loops[120], process=Process.from_lags(1, [5]))
    built = counted(monkeypatch)
    found = together(loops)
    assert built == [3]
    assert found == alone(loops)


def test_processes_with_pairs_of_poles_and_zeros_are_prepared_together(monkeypatch: pytest.MonkeyPatch) -> None:
    loops = []
    for i, loop in enumerate(alike(60)):
        pole, zero = complex(-0.2 - i / 300, 0.5 + i / 100), complex(-1, 0.1 + i / 50)
        loops.append(replace(loop, process=Process(0.5 + i, [-0.5, pole, pole.conjugate()], [zero, zero.conjugate()], 2.2)))
    built = counted(monkeypatch)
    found = together(loops)
    assert built == [1]
    assert found == alone(loops)


def test_margins_and_what_is_chosen_by_the_frequency_response_take_each_loop_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_args: Any) -> Any:
        raise AssertionError

    loops = alike(6)
    monkeypatch.setattr(prepare, "record", refuse)
    assert all(one[0].margins is not None for one in together(loops, replace(PLAN, margins=True)).values())
    monkeypatch.undo()
    left = [replace(loop, scan=None) for loop in loops]
    assert together(left) == alone(left)
    assert together(loops, FleetPlan(margins=False)) == alone(loops, FleetPlan(margins=False))


def test_positive_feedback_is_judged_for_each_loop_alone() -> None:
    loops = [replace(loop, action="direct") for loop in alike(8)]
    found = together(loops)
    assert found == alone(loops)
    assert {one[0].stable for one in found.values()} == {False}


def test_a_fleet_of_loops_prepared_together_runs_as_one_of_loops_prepared_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    loops = [*alike(40), *(loop for loop in mixed() if loop.tag.startswith(("emerson", "toshiba", "oscat")))]
    steps: dict[str, Any] = {"setpoint": 4.0, "load": (20.0, -3.0), "time": 60.0, "margins": False, "keep": True, "engine": "numpy"}
    first = Fleet(loops).simulate(**steps)

    def refuse(*_args: Any) -> Any:
        raise ValueError

    monkeypatch.setattr(recorded, "measured", refuse)
    second = Fleet(loops).simulate(**steps)
    assert list(first.rows()) == list(second.rows())
    ran = [tag for tag, status in zip(first.loops.tags, first.status, strict=True) if status != "failed"]
    assert all(first[tag].output.tolist() == second[tag].output.tolist() for tag in ran)


def test_a_measurement_that_outgrows_all_numbers_is_seen_to_in_columns_too() -> None:
    loops = [replace(loop, process=Process(-1, [5.0])) for loop in alike(5, "A")]
    result = Fleet([*loops, *alike(5)]).simulate(time=400.0, margins=False, engine="numpy")
    one = Fleet(loops[:1]).simulate(time=400.0, margins=False, engine="python")
    assert result.status[:5] == ["ran away"] * 5
    assert result.status[5:] == ["done"] * 5
    assert result.columns["iae"][0] == one.columns["iae"][0]


def test_the_loops_of_a_table_are_pickled_with_their_numbers(tmp_path: Path) -> None:
    text = "tag,card,settings,process,scan\n" + "".join(
        f'L{i},generic/standard,K={1 + i / 10}; Ti={9 + i},"gain=1,lag={5 + i},delay=1.5",0.5\n' for i in range(20)
    )
    (tmp_path / "loops.csv").write_text(text, encoding="utf-8")
    loops = pidemu.read_loops(tmp_path / "loops.csv").loops
    part = PlacedLoops(loops, range(20))[5:15]
    back = pickle.loads(pickle.dumps(part))
    assert [place for place, _ in back] == list(range(5, 15))
    assert list(back) == list(part)
    assert by_place(list(Preparation(PLAN).prepared(back))) == by_place(list(Preparation(PLAN).prepared(part)))
