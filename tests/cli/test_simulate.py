"""The command that runs a card in a closed loop."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import pidemu
from tests.cli.helpers import said, strict_json, told

WORDS = ("simulate", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--process", "gain=1,lag=20,lag=5,delay=3", "--scan", "1")
SETTINGS = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
PROCESS = pidemu.Process.from_lags(1.0, lags=[20, 5], delay=3)
SHOWN = """\
Fisher PROVOX: PID, controller families CL6000, DC6000, SR90
  GAIN     2  %/%
  RESET    4  repeat/min  = 15 s/repeat
  RATE   0.1  min         = 6 s

The loop
  process        1 exp(-3 s)/((20 s + 1)(5 s + 1))
  scan           1 s, 361 scans
  action         reverse
  output limits  0 to 100 %
  setpoint step  10 % at 18 s
  load step      10 % at 180 s

Result, errors from the load step on
  IAE                                   75  % s
  largest error                      2.628  %
  travel of the output                53.8  %
  at the low limit                       0  s
  at the high limit                      0  s
  range of the error at the end   0.003675  %
  last error                     2.953e-06  %
  settled at the end                   yes

Responses, from each step on
                                 setpoint       load
  step                                 10         10  %
  IE                                122.5        -75  % s
  IAE                               134.5         75  % s
  ISE                               987.3      130.1  %^2 s
  ITAE                               1276       2081  % s^2
  largest error, or overshoot       0.189      2.628  %
  overshoot                        0.0189          -  -
  decay ratio                           0          0  -
  rise time, 10 to 90 %             13.91          -  s
  settling time, 5 %                22.79      67.37  s
  largest move of the output        25.83      10.72  %
  travel of the output              42.36      11.44  %
  last error                   -1.532e-05  2.953e-06  %

Margins, sampled and within the limits
  gain margin          2.974
  phase margin [deg]    59.6
  delay margin [s]     8.938
  crossover [rad/s]   0.1164
  Ms                    1.64
  Mt                    1.04
  stable                 yes
"""


def figure(out: str, name: str) -> float:
    line = next(line for line in out.splitlines() if line.strip().startswith(name))  # of the whole run, before each response
    return float(line.strip().removeprefix(name).split()[0])


def loop(out: str) -> dict[str, str]:
    """What stands under 'The loop'."""
    lines = out.partition("The loop\n")[2].partition("\n\n")[0].splitlines()
    return {line[2:15].strip(): line[17:] for line in lines}


def test_what_runs_and_what_it_did_is_printed() -> None:
    out = told(*WORDS)
    assert out.startswith(SHOWN)
    ran = pidemu.simulate(SETTINGS, PROCESS, 1.0)
    after = np.abs(ran.error[180:])
    expected = {
        "IAE": ran.iae,
        "largest error": after.max(),
        "travel of the output": np.abs(np.diff(ran.output, prepend=50.0)).sum(),
        "at the low limit": 0.0,
        "at the high limit": 0.0,
        "last error": ran.error[-1],
    }
    assert {name: figure(out, name) for name in expected} == {name: pytest.approx(x, rel=5e-4) for name, x in expected.items()}
    assert "engine" not in out


def test_the_margins_are_those_that_a_conversion_certifies() -> None:
    out = told(*WORDS)
    certified = pidemu.convert(SETTINGS, "fisher/provox", scan=(1.0, 1.0), process=PROCESS).certificate.loop
    assert certified is not None
    source = certified.source
    expected = {
        "gain margin": source.gain_margin,
        "phase margin [deg]": source.phase_margin,
        "delay margin [s]": source.delay_margin,
        "crossover [rad/s]": source.crossover,
        "Ms": source.Ms,
        "Mt": source.Mt,
    }
    assert {name: figure(out, name) for name in expected} == {name: pytest.approx(x, rel=5e-4) for name, x in expected.items()}
    assert out.endswith("yes\n")


def test_steps_time_scan_and_limits_are_those_given() -> None:
    words = ("--setpoint", "0", "--load", "1 min,-20", "--time", "5 min", "--limits", "40,60", "--scan", "500 ms")
    out = told(*WORDS[:-2], *words)
    assert loop(out) == {
        "process": "1 exp(-3 s)/((20 s + 1)(5 s + 1))",
        "scan": "0.5 s, 601 scans",
        "action": "reverse",
        "output limits": "40 to 60 %",
        "setpoint step": "none",
        "load step": "-20 % at 60 s",
    }
    ran = pidemu.simulate(SETTINGS, PROCESS, 0.5, setpoint=0, load=(60, -20), time=300, output_limits=(40, 60))
    assert figure(out, "at the high limit") == 0.5 * np.count_nonzero(ran.output >= 60) > 100
    assert figure(out, "IAE") == pytest.approx(ran.iae, rel=5e-4)


def test_without_a_load_step_errors_count_from_the_start() -> None:
    out = told(*WORDS, "--load", "0", "--setpoint", "0,5")
    assert "Result, errors from the start on" in out
    assert figure(out, "largest error") == 5


def test_the_written_file_holds_the_signals_with_all_their_digits(folder: Path) -> None:
    told(*WORDS, "--out", "out.csv")
    ran = pidemu.simulate(SETTINGS, PROCESS, 1.0)
    with (folder / "out.csv").open(encoding="utf-8", newline="") as file:
        columns = list(zip(*[[float(x) for x in row] for row in list(csv.reader(file))[1:]], strict=True))
    assert [list(c) for c in columns] == [x.tolist() for x in (ran.times, ran.setpoint, ran.measurement, ran.output)]


def test_the_written_file_is_a_record_that_can_be_run(folder: Path) -> None:
    told(*WORDS, "--out", "out.csv")
    record = pidemu.read_record(folder / "out.csv")
    ran = pidemu.simulate(SETTINGS, PROCESS, 1.0)
    assert record.output is not None
    assert (record.sp.tolist(), record.output.tolist()) == (ran.setpoint.tolist(), ran.output.tolist())
    err = said("run", *WORDS[1:5], "--record", "out.csv", "-o", "again.csv").err
    assert "361 scans of 1 s" in err
    assert (
        float(err.split("largest difference from the recorded output: ")[1].split()[0]) < 1e-9
    )  # the sum of the terms at rest rounds


@pytest.mark.parametrize("engine", ["python", "numpy"])
def test_an_engine_that_is_asked_for_is_named_and_gives_the_same_numbers(engine: str) -> None:
    out = told(*WORDS, "--engine", engine)
    assert loop(out)["engine"] == f"{engine} (asked for)"
    assert told(*WORDS) == out.replace(f"  engine         {engine} (asked for)\n", "")


def test_the_choice_of_the_engine_is_told_with_its_reason() -> None:
    assert loop(told(*WORDS, "--engine", "auto"))["engine"] == str(pidemu.simulate(SETTINGS, PROCESS, 1.0).engine)


def test_the_action_is_that_of_negative_feedback_and_another_one_has_no_margins() -> None:
    turned = (*WORDS[:6], "gain=-1,lag=20,lag=5,delay=3", *WORDS[7:])
    assert loop(told(*turned))["action"] == "direct"
    right, wrong = said(*turned, "--action", "direct"), said(*turned, "--action", "reverse")
    assert right.out == told(*turned)
    assert "Margins" not in wrong.out
    assert wrong.err == (
        "note: the feedback is positive, so that the loop has no margins; leave --action out, or give the gain the other sign\n"
    )


def test_a_card_without_choice_of_action_is_noted() -> None:
    words = ("simulate", "iec/61131-3-pid", "KP=2", "TR=60", "--process", "gain=1,lag=20", "--action", "direct")
    result = said(*words)
    assert "note: iec/61131-3-pid has no choice of action: the sign of the gain decides" in result.err.splitlines()
    (turned,) = [said(*words[:2], "KP=-2", *words[3:])]
    assert ("Margins" in result.out) != ("Margins" in turned.out)


def test_json_holds_settings_loop_figures_and_margins() -> None:
    found = strict_json(told(*WORDS, "--json"))
    ran = pidemu.simulate(SETTINGS, PROCESS, 1.0)
    assert found["settings"]["GAIN"] == {"value": 2.0, "unit": "%/%"}
    assert (found["scan"], found["scans"], found["action"], found["limits"]) == (1.0, 361, "reverse", [0.0, 100.0])
    assert (found["setpoint"], found["load"]) == ([18.0, 10.0], [180.0, 10.0])
    assert found["engine"] == {"name": ran.engine.engine, "reason": ran.engine.reason}
    assert found["figures"]["error"] == ran.error[-1]
    assert found["margins"]["stable"] is True


def test_a_loop_that_runs_away_is_told_in_json_that_is_json() -> None:
    words = ("simulate", "generic/standard", "K=0.1", "Ti=10", "--process", "gain=1,pole=2", "--scan", "0.5", "--time", "400")
    found = strict_json(told(*words, "--json"))
    assert found["figures"]["iae"] in ("inf", "nan")
    assert found["margins"]["stable"] is False
    assert told(*words).endswith("NO\n")


REFUSED = {
    ("--scan", "0"): "the scan interval 0 s is not a positive number; give the time between two scans",
    ("--setpoint", "900,1"): "a setpoint step of 1 % at 900 s is not within the 360 s simulated; start it earlier",
    ("--limits", "60,100"): (
        "the initial output 50 % is outside the output limits 60 to 100 %; give another, or other limits such as "
        "output_limits=(0, 100)"
    ),
    ("--out", "nowhere/out.csv"): "nowhere/out.csv: cannot be written: No such file or directory",
}


@pytest.mark.parametrize(("words", "message"), REFUSED.items())
def test_what_cannot_be_run_is_said_with_status_2(words: tuple[str, str], message: str) -> None:
    assert said(*WORDS, *words) == (2, "", f"error: {message}\n")


USAGE = {
    ("--setpoint", "up"): (
        "Invalid value for '--setpoint': 'up' is not a step; write its size in %, such as 5, or its time and size, such as 60,5"
    ),
    ("--time", "1 %"): "Invalid value for '--time': '1 %' is not a time; write seconds, such as 0.5, or a unit too, such as 10 min",
    ("--engine", "fortran"): "Invalid value for '--engine': 'fortran' is not one of 'auto', 'python', 'numpy', 'numba', 'c'.",
}


@pytest.mark.parametrize(("words", "message"), USAGE.items())
def test_a_word_that_cannot_be_read_is_wrong_usage(words: tuple[str, str], message: str) -> None:
    usage = "Usage: pidemu simulate [OPTIONS] CARD NAME=VALUE...\nTry 'pidemu simulate --help' for help.\n\n"
    assert said(*WORDS, *words) == (2, "", f"{usage}Error: {message}\n")


def test_a_run_that_ends_in_the_dead_time_says_nothing_about_settling() -> None:
    words = ("simulate", "generic/standard", "K=5", "Ti=10", "--process", "gain=1,lag=10,delay=30", "--scan", "1", "--time", "40")
    status, out, err = said(*words)
    assert status == 0
    assert ["settled", "at", "the", "end", "not", "known"] in [line.split() for line in out.splitlines()]
    assert (
        "note: the run ends before the dead time after the last step is over, and says nothing about settling; give a longer --time"
        in err
    )
    assert strict_json(said(*words, "--json").out)["settled"] is None


LOOP = ("simulate", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0", "--process", "gain=1,lag=20,delay=3", "--scan", "1")


def test_responses_are_told_step_by_step_and_beside_those_of_another_controller() -> None:
    found = strict_json(told(*LOOP, "--json", "--beside", "emerson/deltav GAIN=2 RESET='15 s'"))
    assert [response["step"] for response in found["responses"]] == ["setpoint", "load"]
    (other,) = found["beside"]
    assert other["card"] == "emerson/deltav"
    assert other["responses"] == found["responses"]  # the same law, scan by scan
    text = told(*LOOP, "--beside", "generic/standard K=1 Ti=20 Td=0")
    assert "Responses, from each step on" in text
    assert "Responses of generic/standard: K 1, Ti 20, Td 0" in text


def test_controllers_that_differ_in_an_option_or_not_at_all_are_told_each() -> None:
    others = ("--beside", "generic/standard K=1 Ti=20 Td=2 INTEGRAL_RULE=forward", "--beside", "generic/standard K=1 Ti=20 Td=2")
    found = strict_json(told(*LOOP, "--json", *others, *others))
    assert len(found["beside"]) == 4
    text = told(*LOOP, *others)
    assert "Responses of generic/standard: K 1, Ti 20, Td 2, INTEGRAL_RULE=forward" in text


def test_responses_are_drawn(tmp_path: Path) -> None:
    for name in ("loop.png", "loop.svg"):
        told(*LOOP, "--plot", str(tmp_path / name), "--beside", "generic/standard K=1 Ti=20 Td=0")
        assert (tmp_path / name).stat().st_size > 5_000
    assert "generic/standard: K 1, Ti 20, Td 0" in (tmp_path / "loop.svg").read_text("utf-8")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--beside", "emerson/deltav GAIN='2"), "is not a card with settings"),
        (("--beside", ""), "is not a card with settings"),
        (("--beside", "emerson/delta GAIN=2"), "did you mean 'emerson/deltav'?"),
        (("--plot", "loop.gif"), "pictures are written as .png or .svg"),
    ],
)
def test_another_controller_or_a_picture_that_is_wrong_is_told(words: tuple[str, str], message: str) -> None:
    result = said(*LOOP, *words)
    assert result.status != 0
    assert message in result.err


AROUND = (
    "--noise",
    "0.2",
    "--noise-lag",
    "3 s",
    "--seed",
    "4",
    "--valve",
    "deadband=0.5,rate=3",
    "--load-process",
    "gain=-0.5,lag=5",
)


def test_noise_valve_ramps_and_the_load_s_own_way_are_told_and_equal_those_from_python(tmp_path: Path) -> None:
    ramps = ("--setpoint-ramp", "20", "--load-ramp", "1 min")
    out = tmp_path / "out.csv"
    found = strict_json(told(*LOOP, *AROUND, *ramps, "--json", "--out", str(out)))
    assert found["ramps"] == {"setpoint": 20.0, "load": 60.0}
    assert found["load_process"] == "-0.5/(5 s + 1)"
    assert found["noise"] == {"deviation": 0.2, "lag": 3.0, "seed": 4}
    assert found["valve"] == {"deadband": 0.5, "stiction": 0.0, "resolution": 0.0, "rate": 3.0}
    run = pidemu.simulate(
        pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0),
        pidemu.Process.from_lags(1.0, [20], delay=3),
        1.0,
        noise=pidemu.Noise(0.2, 3.0, 4),
        valve=pidemu.Valve(deadband=0.5, rate=3),
        load_process=pidemu.Process.from_lags(-0.5, [5]),
        durations=(20.0, 60.0),
    )
    assert run.valve is not None
    header, *rows = out.read_text("utf-8").splitlines()
    assert header == "time,setpoint,measurement,output,valve"
    written = [[float(x) for x in row.split(",")] for row in rows]
    assert written == np.column_stack([run.times, run.setpoint, run.measurement, run.output, run.valve]).tolist()
    text = told(*LOOP, *AROUND, *ramps)
    for line in (
        "load to measurement -0.5/(5 s + 1)",
        "noise 0.2 %, lag 3 s, seed 4",
        "valve deadband=0.5,rate=3",
    ):
        assert line in " ".join(text.split())
    assert "along a ramp of 20 s" in text
    assert "along a ramp of 60 s" in text


def test_another_controller_beside_has_the_same_surroundings() -> None:
    found = strict_json(told(*LOOP, *AROUND, "--json", "--beside", "fisher/provox GAIN=2 RESET=4 RATE=0"))
    assert found["beside"][0]["responses"] == found["responses"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--noise", "-1"), "error: noise: deviation is -1 %; give 0 or more"),
        (("--noise-lag", "3"), "Error: --noise-lag without --noise: give the standard deviation of the noise, such as --noise 0.5"),
        (("--noise", "1", "--seed", "-3"), "error: noise: the seed -3 is not a whole number from 0 on"),
        (("--valve", "play=1"), "error: valve: 'play=1' is not one of deadband=..., stiction=..., resolution=..., rate=..."),
        (("--load-process", "lag=3"), "error: 'lag=3' has no gain; add gain=1.5, for example"),
        (("--setpoint-ramp", "-2"), "error: the duration of the setpoint ramp is -2 s; give 0 or more"),
    ],
)
def test_surroundings_that_no_loop_has_are_refused(words: tuple[str, ...], message: str) -> None:
    result = said(*LOOP, *words)
    assert result.status == 2
    assert message in result.err
