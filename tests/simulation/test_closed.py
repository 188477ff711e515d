"""A closed loop as a program gives what an emulated controller and a process give that are scanned in turns."""

from __future__ import annotations

import itertools
import math
from collections import deque
from dataclasses import replace
from typing import Any

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pidemu
from pidemu.arrays import Floats
from pidemu.backends.python import compiled, starting
from pidemu.card.library import card_files
from pidemu.card.load import variants
from pidemu.checks.runs import plausible
from pidemu.errors import ProcessError, UndefinedError
from pidemu.process.hold import Plant
from pidemu.process.process import Process
from pidemu.program.ir import names_in
from pidemu.program.specialise import specialise
from pidemu.settings.settings import Settings
from pidemu.simulation.closed import closed_loop
from pidemu.simulation.experiment import FIGURES
from pidemu.simulation.measured import measured
from pidemu.simulation.simulate import simulate
from pidemu.simulation.trial import Trial, trial
from tests.helpers import scans_of, settings_of

CARDS = list(card_files())
H = 0.5
SMALLEST_NORMAL = float(np.finfo(float).tiny)
PROCESSES = {
    "first order": Process.from_lags(1.2, [8]),
    "first order, dead time of whole scans": Process.from_lags(1.2, [8], delay=3 * H),
    "first order, dead time within a scan": Process.from_lags(0.8, [6], delay=0.3 * H),
    "first order, dead time of scans and a part": Process.from_lags(0.8, [6], delay=2.6 * H),
    "two real poles": Process.from_lags(1.0, [5, 3], delay=H),
    "underdamped": Process(1.0, [-0.05 + 0.6j, -0.05 - 0.6j], delay=1.25 * H),
    "underdamped without dead time": Process(1.0, [-0.1 + 1.5j, -0.1 - 1.5j]),
    "three poles, two of them complex": Process(0.7, [-0.2, -0.1 + 0.4j, -0.1 - 0.4j], delay=0.5 * H),
    "integrator": Process.from_lags(0.1, integrators=1, delay=0.7 * H),
    "integrator and lag": Process.from_lags(0.05, [4], integrators=1),
    "inverse response": Process.from_lags(1.0, [5, 2], leads=[-1.5], delay=H),
    "as many zeros as poles": Process.from_lags(1.0, [5], leads=[2]),
    "as many zeros as poles, with dead time": Process.from_lags(1.0, [5, 3], leads=[2, 1], delay=1.4 * H),
    "a gain and dead time": Process(0.4, delay=1.5 * H),
    "a gain": Process(0.4),
    "washout": Process(3.0, [-0.2], [0.0], delay=2 * H),
    "unstable": Process(-1.0, [0.08], delay=0.6 * H),
}

UNDEFINED = {"emerson/deltav": 4}
"""How many choices of options make no controller: the series form with derivative, but without proportional action."""
FIXED_ACTION = ("iec/61131-3-pid",)
"""Cards whose error is always PV - SP; the sign of the gain is the action."""


def in_turns(made: Trial) -> tuple[Floats, Floats]:
    """Scan controller and process in turns; return output and measurement [%]."""
    controller, plant = made.controller(), Plant(made.process.sampled(made.scan))
    settings = made.settings
    own = settings.equation.signals == "engineering"
    (low, high), (bottom, top) = (r.ends if own and r is not None else (0.0, 100.0) for r in (settings.pv_range, settings.op_range))
    _, rest_pv, rest_output = made.initial
    out, pv = [], []
    for sp, load in zip(made.setpoint.tolist(), made.load.tolist(), strict=True):
        y = rest_pv + plant.measure()
        u = controller.scan(low + sp * ((high - low) / 100), low + y * ((high - low) / 100))
        pv.append(y)
        out.append((u - bottom) * (100 / (top - bottom)))
        plant.move(out[-1] - rest_output + load)
    return np.array(out), np.array(pv)


def as_program(made: Trial) -> tuple[Floats, Floats]:
    found = simulate(
        made.settings,
        made.process,
        made.scan,
        setpoint=made.setpoint_step or 0,
        load=made.load_step or 0,
        time=(made.scans - 0.5) * made.scan,
        action=made.action,
        output_limits=made.limits,
        initial=made.initial,
        engine="python",
    )
    assert found.engine.reason == "asked for"
    return found.output, found.measurement


def check(settings: Settings, process: Process, *, h: float = H, **chosen: Any) -> tuple[Floats, Floats]:
    """Compare; return output and measurement."""
    made = trial(settings, process, h, time=120 * h, **{"output_limits": (0, 100), **chosen})
    expected, found = in_turns(made), as_program(made)
    np.testing.assert_array_equal(found[1], expected[1])
    np.testing.assert_array_equal(found[0], expected[0])
    return found


def wanting(card_id: str) -> Settings:
    return plausible(pidemu.load_card(card_id).variant({}))


def action_for(card_id: str) -> dict[str, Any]:
    """The action is stated for a card that has no choice of it."""
    return {"action": "reverse"} if card_id in FIXED_ACTION else {}


@pytest.mark.parametrize("card_id", CARDS)
def test_the_program_of_a_closed_loop_gives_what_scans_in_turns_give(card_id: str) -> None:
    settings = wanting(card_id)
    moved = 0
    for process in PROCESSES.values():
        out, pv = check(settings, process, **action_for(card_id))
        moved += bool(np.ptp(out) > 1 and np.ptp(pv) > 1)
    assert moved > len(PROCESSES) / 2  # these are no loops at rest


@pytest.mark.parametrize("action", ["reverse", "direct"])
@pytest.mark.parametrize("card_id", CARDS)
def test_it_does_so_for_both_actions_at_the_limits_and_away_from_the_middle(card_id: str, action: Any) -> None:
    settings = wanting(card_id)
    narrow = check(
        settings,
        PROCESSES["underdamped"],
        action=action,
        output_limits=(38.5, 43.25),
        initial=(30, 30, 40),
        setpoint=(3, 8.0),
        load=(20.2, -12.5),
    )
    assert narrow[0].min() >= 38.5
    assert narrow[0].max() <= 43.25
    if card_id != "toshiba/pid3":  # whole counts only
        assert {narrow[0].min(), narrow[0].max()} & {38.5, 43.25}
    check(settings, PROCESSES["first order"], action=action, initial=(20, 70, 5), setpoint=0, load=(0, 90.0))


@pytest.mark.parametrize("process", list(PROCESSES.values()), ids=list(PROCESSES))
@pytest.mark.parametrize("card_id", FIXED_ACTION)
def test_a_card_without_a_choice_of_action_closes_no_loop_unless_it_is_stated(card_id: str, process: Process) -> None:
    with pytest.raises(ProcessError, match=f"{card_id} has no choice of control action"):
        trial(wanting(card_id), process, H, time=10, output_limits=(0, 100))


@pytest.mark.parametrize("card_id", CARDS)
def test_it_does_so_for_every_choice_of_options(card_id: str) -> None:
    process, undefined = PROCESSES["three poles, two of them complex"], 0
    for variant in variants(pidemu.load_card(card_id)):
        try:
            check(plausible(variant), process, action="reverse")
        except UndefinedError:
            undefined += 1
    assert undefined == UNDEFINED.get(card_id, 0)


@given(data=st.data(), card_id=st.sampled_from(CARDS), process=st.sampled_from(list(PROCESSES.values())))
def test_it_does_so_for_any_settings(data: st.DataObject, card_id: str, process: Process) -> None:
    settings = settings_of(data, pidemu.load_card(card_id))
    h = data.draw(scans_of(settings.algorithm()))
    made = trial(settings, process, h, time=100 * h, output_limits=(0, 100), action="reverse")
    expected, found = in_turns(made), as_program(made)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    "settings",
    [
        pidemu.load_card("mathworks/pid2").settings(Kp=0.5, Ki=0.04, pv_range=(0, 400), op_range=(-10, 10)),
        pidemu.load_card("mathworks/pid2").settings(Kp=0.5, Ki=0.04, pv_range=(-20, 37.3), op_range=(0.2, 1)),
        pidemu.load_card("arduino/pid").settings(Kp=2, Ki=0.2, Kd=1, pv_range=(0, 1023), op_range=(0, 255)),
        pidemu.load_card("simple-pid/simple-pid").settings(Kp=2, Ki=0.2, pv_range=(-50, 150), op_range=(4, 20)),
        pidemu.load_card("epics/epid").settings(KP=2, KI=0.2, KD=1, pv_range=(0, 300), op_range=(0, 10)),
    ],
    ids=lambda s: s.card.id,
)
@pytest.mark.parametrize(
    "process", ["first order, dead time within a scan", "underdamped", "as many zeros as poles, with dead time"]
)
def test_it_does_so_in_engineering_units(settings: Settings, process: str) -> None:
    out, _ = check(settings, PROCESSES[process], load=(30, 20.0))
    assert np.ptp(out) > 5


@pytest.mark.parametrize("card_id", [c for c in CARDS if wanting(c).algorithm().arithmetic.type == "float32"])
def test_the_process_of_a_float32_controller_is_computed_in_float64(card_id: str) -> None:
    out, pv = check(wanting(card_id), PROCESSES["underdamped"], **action_for(card_id))
    assert (pv != pv.astype(np.float32)).sum() > pv.size / 2
    if wanting(card_id).equation.signals == "percent":
        np.testing.assert_array_equal(out, out.astype(np.float32))


def test_an_integer_controller_moves_by_whole_counts() -> None:
    settings = wanting("toshiba/pid3")
    assert settings.algorithm().arithmetic.type == "integer"
    out, _ = check(settings, PROCESSES["first order"])
    steps = np.unique(np.diff(out))
    assert steps.size > 1
    np.testing.assert_allclose(steps * 100, np.round(steps * 100), atol=1e-9)  # counts of 0.01 %


WITHOUT_SETPOINT_OR_INTEGRAL: dict[str, tuple[str, dict[str, object]]] = {
    "integral only, proportional and derivative on the measurement": ("generic/standard", {"K": 2, "Ti": 10, "Td": 1, "b": 0}),
    "proportional only": ("generic/standard", {"K": 2, "Ti": math.inf, "Td": 0}),
    "proportional only, on the measurement": ("generic/parallel", {"kp": 2, "ki": 0, "kd": 0, "b": 0}),
    "proportional and derivative": ("generic/parallel", {"kp": 2, "ki": 0, "kd": 3, "Tf": 0.4}),
    "nothing at all": ("generic/parallel", {"kp": 0, "ki": 0, "kd": 0}),
    "derivative on the measurement only": ("generic/parallel", {"kp": 0, "ki": 0, "kd": 2, "c": 0}),
}


@pytest.mark.parametrize("name", list(WITHOUT_SETPOINT_OR_INTEGRAL))
@pytest.mark.parametrize("process", ["first order", "inverse response", "a gain and dead time"])
def test_it_does_so_for_controllers_that_read_no_setpoint_or_integrate_nothing(name: str, process: str) -> None:
    card_id, dials = WITHOUT_SETPOINT_OR_INTEGRAL[name]
    settings = pidemu.load_card(card_id).settings(dials)
    out, _ = check(settings, PROCESSES[process], initial=(35, 35, 45))
    np.testing.assert_allclose(out[:6], 45, atol=1e-12)  # the bias keeps it at rest before the first step


def test_a_program_that_does_not_read_the_setpoint_still_closes_the_loop() -> None:
    settings = pidemu.load_card("generic/parallel").settings(kp=2, ki=0, kd=0, b=0)
    made = trial(settings, PROCESSES["first order"], H, time=30)
    program = made.controller().program
    read = {n for a in specialise(program).body for n in names_in(a.value)}
    assert "sp" not in read
    out, pv = check(settings, PROCESSES["first order"], setpoint=(0, 20.0), load=(10, 5.0))
    before = round(10 / H)
    np.testing.assert_allclose(pv[:before], 50, atol=1e-12)
    assert out[-1] == pytest.approx(50 - 5 * 2.4 / 3.4, abs=1e-6)  # K G/(1 + K G) of the load, with K G = 2.4


def state_space(process: Process, h: float) -> control.StateSpace:
    held = control.sample_system(control.ss(control.tf(process.rational.num[::-1], process.rational.den[::-1])), h, "zoh")
    for _ in range(round(process.delay / h)):
        held = control.ss(held) * control.ss(control.tf([1], [1, 0], h))
    return control.ss(held)


@pytest.mark.parametrize("name", ["underdamped", "integrator and lag", "three poles, two of them complex", "inverse response"])
def test_a_linear_loop_is_that_of_python_control(name: str) -> None:
    """PI by backward Euler, ``u = K (e + h/Ti sum e)``, as a transfer function of its own."""
    process, K, Ti, n = replace(PROCESSES[name], delay=2 * H), 0.4, 12.0, 150
    settings = pidemu.load_card("generic/standard").settings(K=K, Ti=Ti, Td=0)
    controller = control.tf([K * (1 + H / Ti), -K], [1, -1], H)
    plant = state_space(process, H)
    times = np.arange(n) * H
    load = np.where(np.arange(n) >= 4, 3.0, 0.0)
    loop = control.feedback(plant, control.ss(controller))
    expected = control.forced_response(loop, times, load).outputs
    made = trial(settings, process, H, time=(n - 0.5) * H, setpoint=0, load=(4 * H, 3.0), output_limits=(-1e9, 1e9))
    out, pv = as_program(made)
    scale = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(pv - 50, expected, atol=1e-9 * scale)  # rounding, as the realisations differ
    held = -control.forced_response(controller, times, expected).outputs
    np.testing.assert_allclose(out - 50, held, atol=1e-8 * scale)


GENTLE: dict[str, dict[str, object]] = {
    "generic/parallel": {"kp": 0.2, "ki": 0, "kd": 0.3, "Tf": 0.4},
    "generic/standard": {"K": 0.2, "Ti": 12, "Td": 0.8, "Tf": 0.4},
    "generic/series": {"K": 0.2, "Ti": 12, "Td": 0.8, "alpha": 0.1},
    "fisher/provox": {"GAIN": 0.2, "RESET": 4, "RATE": 0.02},
    "emerson/deltav": {"GAIN": 0.2, "RESET": 12, "RATE": 0.8},
    "arduino/pid": {"Kp": 0.2, "Ki": 0.02, "Kd": 0.1},
    "king/velocity": {"Kc": 0.2, "Ti": "12 s", "Td": "0.8 s"},
    "mathworks/pid2": {"Kp": 0.2, "Ki": 0.02, "Kd": 0.1},
    "honeywell/tdc3000": {"K": 0.2, "T1": 0.2, "T2": 0.01},
}


@pytest.mark.parametrize("name", ["underdamped", "two real poles", "three poles, two of them complex", "inverse response"])
@pytest.mark.parametrize("card_id", list(GENTLE))
def test_a_loop_that_settles_for_100_000_scans_holds_no_denormal_numbers(card_id: str, name: str) -> None:
    settings, scans = pidemu.load_card(card_id).settings(GENTLE[card_id]), 100_000
    zero: dict[str, Any] = {"initial": (0.0, 0.0, 0.0), "output_limits": (-1000, 1000)}  # small numbers beside large ones get lost
    made = trial(settings, PROCESSES[name], H, time=scans * H, **zero)
    program = made.program(made.controller())
    state: list[Any] = [*starting(program), *(deque([0.0] * n) for n in program.lengths)]
    pulse = [*[10.0] * 20, *[0.0] * (scans - 20)]
    outputs = np.abs(compiled(program).run(state, pulse, [0.0] * scans))
    assert outputs[:, 30].min() > 1e-3
    assert outputs[:, -1].max() < 1e-9  # it settles
    assert [x for x in state[: len(program.states)] if 0 < abs(x) < 1e-300] == []
    assert [x for line in state[len(program.states) :] for x in line if 0 < abs(x) < SMALLEST_NORMAL] == []
    assert not ((outputs > 0) & (outputs < SMALLEST_NORMAL)).any()


@pytest.mark.parametrize("card_id", CARDS)
def test_what_is_added_around_a_controller_has_names_of_its_own(card_id: str) -> None:
    process, undefined = PROCESSES["as many zeros as poles, with dead time"], 0
    for variant in variants(pidemu.load_card(card_id)):
        made = trial(plausible(variant), process, H, time=10, output_limits=(0, 100), action="reverse")
        try:
            controller = made.controller().program
        except UndefinedError:
            undefined += 1
            continue
        alone = specialise(controller)
        whole = measured(made)
        for all_names, own in ((whole.coefficients, alone.coefficients), (whole.states, alone.states)):
            names = [q.name for q in all_names]
            assert len(names) == len(set(names))
            assert names[: len(own)] == [q.name for q in own]
        inner = list(map(id, alone.body))
        added = {a.name for a in whole.body if a not in alone.body} | {q.name for q in whole.states[len(alone.states) :]}
        added |= {q.name for q in whole.coefficients[len(alone.coefficients) :]} | {line.name for line in whole.lines}
        used = {a.name for a in alone.body} | {q.name for q in (*alone.coefficients, *alone.states)}
        assert inner
        assert added & used == set()
    assert undefined == UNDEFINED.get(card_id, 0)


def test_the_program_of_a_loop_reads_and_records_percent() -> None:
    settings = pidemu.load_card("mathworks/pid2").settings(Kp=0.5, Ki=0.04, pv_range=(0, 400), op_range=(-10, 10))
    made = trial(settings, PROCESSES["first order, dead time of scans and a part"], H, time=10, output_limits=(0, 100))
    program = made.program(made.controller())
    assert [(q.name, q.unit) for q in program.inputs] == [("setpoint", "%"), ("load", "%")]
    assert program.recorded == ("output", "measurement")
    assert program.lengths == (2,)
    plain = trial(wanting("generic/standard"), PROCESSES["first order"], H, time=10)
    bare = plain.program(plain.controller())
    assert ([q.name for q in bare.inputs], bare.recorded, bare.lines, bare.lengths) == (["sp", "load"], ("u", "pv"), (), ())


def test_an_experiment_reads_nothing_and_measures_itself() -> None:
    made = trial(wanting("generic/standard"), PROCESSES["underdamped"], H, time=60)
    program = measured(made)
    assert program.inputs == ()
    names = [q.name for q in program.states]
    assert set(FIGURES) <= set(names)
    units = {q.name: q.unit for q in program.states}
    assert {name: units[name] for name in FIGURES} == FIGURES


@pytest.mark.parametrize("process", list(PROCESSES))
def test_processes_that_differ_in_numbers_only_share_a_structure(process: str) -> None:
    settings = wanting("generic/standard")

    def structure(p: Process) -> Any:
        made = trial(settings, p, H, time=10, output_limits=(0, 100), action="reverse")
        return made.program(made.controller()).structure

    one = PROCESSES[process]
    other = replace(one, gain=one.gain * 1.5, delay=one.delay + (H if one.delay >= H else 0))
    assert structure(one) == structure(other)


@given(
    delay=st.just(0.0) | st.floats(1e-9, 3),
    gain=st.floats(0.2, 2),
    real=st.floats(-2, -0.02),
    imaginary=st.floats(0.05, 3),
    zero=st.none() | st.floats(0.1, 2).map(lambda z: -z) | st.floats(0.1, 2),
)
def test_it_does_so_for_any_process_of_second_order(
    delay: float, gain: float, real: float, imaginary: float, zero: float | None
) -> None:
    process = Process(gain, [complex(real, imaginary), complex(real, -imaginary)], [] if zero is None else [zero], delay=delay)
    check(wanting("emerson/deltav"), process)


def test_the_program_is_made_for_a_controller_at_rest_in_automatic() -> None:
    made = trial(wanting("generic/standard"), PROCESSES["first order"], H, time=10)
    controller = made.controller()
    at_rest = replace(controller.program, initial=tuple(controller.state.values()))
    loop = closed_loop(specialise(at_rest), made.process.sampled(H), (50.0, 50.0))
    assert loop == made.program(controller)
    assert not any({"auto", "manual"} & names_in(a.value) for a in loop.body)


def test_all_shapes_of_a_process_are_among_those_that_are_tried() -> None:
    shapes = {
        (bool(s.row.size), bool(s.through), bool(s.early.any()), bool(s.scans), bool((np.triu(s.growth, 1) != 0).any()))
        for s in (p.sampled(H) for p in PROCESSES.values())
    }
    for place, other in itertools.product(range(5), (True, False)):
        assert any(shape[place] is other for shape in shapes)
