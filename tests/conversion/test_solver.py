"""A conversion under way holds no state: what a match decided is in its result, whatever was asked before."""

from __future__ import annotations

import ast
import dataclasses
import functools
import math
from collections.abc import Iterator, Mapping
from dataclasses import FrozenInstanceError, dataclass, field
from pathlib import Path

import pytest

import pidemu
from pidemu.conversion import solver as package
from pidemu.conversion.match.no_match import REFUSALS
from pidemu.conversion.match_method import MATCHES, Aim
from pidemu.conversion.solver.found import Found
from pidemu.conversion.solver.solver import Solver, make_solver
from pidemu.conversion.target.filter import TargetFilter
from pidemu.conversion.target.prepare import prepare_target
from pidemu.conversion.target.target import Target
from pidemu.settings.ranges import SignalRange
from tests.conversion.support import HUNDRED

PERCENT = SignalRange(0.0, 100.0)


@dataclass(frozen=True)
class Case:
    source: str
    values: Mapping[str, object]
    target: str
    options: Mapping[str, object] = field(default_factory=dict)
    scans: tuple[float, float] | None = None
    compensate: bool = False
    process: str | None = None

    @property
    def prepared(self) -> Target:
        return prepare_target(pidemu.load_card(self.target), self.options, {}, (PERCENT, PERCENT))

    @property
    def solver(self) -> Solver:
        source = pidemu.load_card(self.source).settings({**self.values, **HUNDRED})
        process = None if self.process is None else pidemu.Process.from_lags(gain=1.0, lags=[40.0], delay=5.0)
        return make_solver(source, self.prepared, 1.0, self.scans, process, compensate=self.compensate)


CASES = {
    "the filter stays as delivered": Case("generic/series", {"K": 0.85, "Ti": 77.5, "Td": 43.0, "alpha": 0.5}, "foxboro/ia-pid"),
    "the source's filter is imitated": Case(
        "ardupilot/ac-pid",
        {"P": 1.74, "I": 0.0043, "D": 26.9, "FLTT": 0.12, "FLTE": 0.025, "FLTD": 0.021, "IMAX": 1},
        "foxboro/ia-pid",
    ),
    "the same law": Case("generic/series", {"K": 2, "Ti": 15, "Td": 2, "alpha": 0.1}, "generic/standard"),
    "made up for the scans": Case(
        "generic/series", {"K": 0.42, "Ti": 7.5, "Td": 1.65, "alpha": 0.64}, "foxboro/ia-pid", scans=(0.35, 0.35), compensate=True
    ),
    "the exact match is refused at the scans": Case(
        "toshiba/pid3", {"KP": 16.8, "TI": 0.054, "TD": 0.021}, "advanced-pid/advanced-pid", scans=(0.06, 0.06), compensate=True
    ),
    "in the loop": Case("generic/standard", {"K": 2, "Ti": 30, "Td": 6, "Tf": 0.6}, "emerson/deltav", process="lag"),
    "no derivative": Case("fisher/provox", {"GAIN": 2, "RESET": 4}, "generic/parallel"),
}


def aims(case: Case) -> list[Aim]:
    found = [Aim(m, 0.02 if m == "frequency" else None) for m in MATCHES if m != "loop" or case.process]
    return [Aim(), *found]


def outcome(solver: Solver, aim: Aim) -> Found | tuple[str, Found | None]:
    """What a match finds; where it refuses, the reason and the nearest settings."""
    try:
        return solver.settings(aim)
    except REFUSALS as refusal:
        nearest, reason = solver.refused(refusal)
        return reason, nearest


@functools.cache
def alone(name: str) -> dict[Aim, Found | tuple[str, Found | None]]:
    """What each match finds as the only one that is asked for."""
    case = CASES[name]
    return {aim: outcome(case.solver, aim) for aim in aims(case)}


@pytest.mark.parametrize("name", CASES)
def test_a_match_finds_the_same_whatever_was_asked_before_it(name: str) -> None:
    wanted, solver = aims(CASES[name]), CASES[name].solver
    for order in (wanted, wanted[::-1], wanted[::2] + wanted[1::2]):
        assert alone(name) == {aim: outcome(solver, aim) for aim in order}


def test_the_cases_find_every_match_and_refuse_some() -> None:
    found = [x for name in CASES for x in alone(name).values()]
    assert {f.match for f in found if isinstance(f, Found)} == set(MATCHES)
    assert any(f.compensated for f in found if isinstance(f, Found))
    assert any(isinstance(f, tuple) for f in found)


def test_what_stands_beside_an_answer_does_not_change_it() -> None:
    source = pidemu.load_card("generic/series").settings({"K": 2, "Ti": 15, "Td": 2, "alpha": 0.1, **HUNDRED})
    conv = pidemu.convert(source, "emerson/deltav", emulate=False)
    before = conv.certificate.to_dict()
    assert [str(b) for b in conv.beside] == [str(b) for b in pidemu.convert(source, "emerson/deltav", emulate=False).beside]
    again = pidemu.convert(source, "emerson/deltav", emulate=False)
    assert (before, conv.settings) == (again.certificate.to_dict(), again.settings)


@pytest.mark.parametrize("name", [f.name for f in dataclasses.fields(Target)])
def test_a_target_cannot_be_changed(name: str) -> None:
    target = CASES["the same law"].prepared
    with pytest.raises(FrozenInstanceError):
        setattr(target, name, getattr(target, name))


def test_a_match_leaves_the_targets_filter_free() -> None:
    case = CASES["the source's filter is imitated"]
    solver = case.solver
    found = solver.settings(Aim("low-frequency"))
    assert found.filter.value == pytest.approx(1.2325, rel=1e-4)
    assert not found.filter.free
    assert (solver.pair.target.filter.free, solver.pair.target.filter.value) == (True, 10.0)


def test_the_result_tells_the_filter_that_its_settings_have() -> None:
    found = CASES["the same law"].solver.settings(Aim())
    assert found.match == "exact"
    assert found.why == ""
    assert found.filter == TargetFilter("time", "Tf", False, found.settings["Tf"].canonical)
    assert found.numbers.Tf == pytest.approx(0.2)


def test_the_result_tells_why_it_is_not_the_exact_match() -> None:
    found = CASES["the filter stays as delivered"].solver.settings(Aim())
    assert (found.match, found.why) == ("constrained", "the two filters are of different order")


def assignments(tree: ast.AST) -> Iterator[ast.Attribute]:
    """Yield the attributes that are assigned to outside constructors."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and node.name != "__init__":
            yield from (x for x in ast.walk(node) if isinstance(x, ast.Attribute) and isinstance(x.ctx, ast.Store | ast.Del))


def test_nothing_in_a_conversion_is_assigned_to_after_it_was_made() -> None:
    assert package.__file__ is not None
    files = sorted(Path(package.__file__).parents[1].rglob("*.py"))
    assert len(files) > 40
    assert [(file.name, t.lineno) for file in files for t in assignments(ast.parse(file.read_text("utf-8")))] == []


def test_settings_as_far_off_as_no_controller_at_all_are_not_offered() -> None:
    source = pidemu.load_card("emerson/deltav").settings(STRUCTURE=1, GAIN=1, RESET=math.inf, RATE=3, PV_FTIME=2)
    with pytest.raises(pidemu.ConversionRefusedError) as refused:
        pidemu.convert(source, "oscat/ft-pid", mode="auto", emulate=False, assume=True)
    assert refused.value.nearest is None
    assert str(refused.value).endswith("; no settings of it come near")


@pytest.mark.parametrize("process", [None, pidemu.Process.from_lags(gain=0.3, lags=[60.0], delay=5.0)])
def test_the_nearest_settings_are_sought_with_the_filter_that_they_are_given(process: pidemu.Process | None) -> None:
    # they were sought with the filter that a match before had left, and were farther off than no controller at all
    source = pidemu.load_card("modelica/limpid").settings(
        controllerType="PD", METHOD="continuous", k=20, Td=160, wp=0.5, wd=0, Nd=3
    )
    with pytest.raises(pidemu.ConversionRefusedError) as refused:
        pidemu.convert(
            source,
            "advanced-pid/advanced-pid",
            match="exact",
            scan=(0.07, 0.1),
            process=process,
            compensate=True,
            emulate=False,
            assume=True,
        )
    nearest = refused.value.nearest
    assert nearest is not None
    assert nearest.certificate.feedback.loop_band.max_deviation < 0.6
