"""Settings that can be read in several ways, in print: every reading with its result, and none chosen."""

from __future__ import annotations

import shlex
from typing import Any

import pytest

import pidemu
from pidemu.cli.readings import refuse_to_choose
from tests.cli.helpers import strict_json, told


def refused(
    capsys: pytest.CaptureFixture[str], found: tuple[pidemu.Reading, ...], to: str = "emerson/deltav", **more: Any
) -> tuple[int, str, str]:
    """Exit status and both streams."""
    as_json = more.pop("as_json", False)
    with pytest.raises(SystemExit) as end:
        refuse_to_choose(found, pidemu.load_card(to), more, to=to, as_json=as_json)
    streams = capsys.readouterr()
    return int(str(end.value.code)), streams.out, streams.err


PROVOX = pidemu.readings("fisher/provox", GAIN=2, RESET=0.75)
FORMS = pidemu.readings("emerson/deltav", GAIN=2, RESET="60 s", RATE=5)


def test_both_readings_are_printed_with_both_results_and_neither_is_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = refused(capsys, PROVOX)
    lines = err.splitlines()
    assert (status, out) == (1, "")
    assert lines[0] == (
        "question: these settings can be read in 2 ways. Their integral gains are apart by a factor of up to 1.78. Which is meant?"
    )
    first, second = (lines.index(f"{k}. {r.text}") for k, r in enumerate(PROVOX, start=1))
    assert lines[first + 1].startswith("   -> emerson/deltav: GAIN = 2 %/%, RESET = 80 s/repeat, RATE = 0 s, ALPHA = ")
    assert lines[second + 1].startswith("   -> emerson/deltav: GAIN = 2 %/%, RESET = 45 s/repeat, RATE = 0 s, ALPHA = ")
    for reading, at in zip(PROVOX, (first, second), strict=True):
        assert lines[at + 2].strip() == pidemu.convert(reading.settings, "emerson/deltav").verdict
    assert [lines[at + 3].strip() for at in (first, second)] == [
        'pidemu convert fisher/provox GAIN=2 "RESET=0.75 repeat/min" --to emerson/deltav',
        'pidemu convert fisher/provox GAIN=2 "RESET=0.75 min/repeat" --to emerson/deltav',
    ]
    assert "--assume" not in err  # it takes a card's default, and a card that is not known has none


def test_each_command_gives_the_result_of_its_reading(capsys: pytest.CaptureFixture[str]) -> None:
    asked: dict[str, Any] = {"options": {"FORM": "Series"}, "given": {"ALPHA": 0.1}, "scan": (1.0, 0.5), "digits": 4}
    status, out, err = refused(capsys, PROVOX, as_json=True, match="low-frequency", **asked)
    found = strict_json(out)
    [question] = found["questions"]
    assert (status, found["verdict"], question["kind"], len(question["readings"])) == (1, "question", "unit", 2)
    assert err == f"question: {question['text']}\n"
    for reading in question["readings"]:
        pidemu_, *words = shlex.split(reading["command"])
        assert pidemu_ == "pidemu"
        again = strict_json(told(*words, "--json"))
        assert (again["match"], again["scan"]) == ("low-frequency", [1.0, 0.5])
        assert (again["to"]["settings"], again["to"]["options"]) == (
            {n: {**v, "unrounded": again["to"]["settings"][n]["unrounded"]} for n, v in reading["settings"].items()},
            reading["options"],
        )


def test_the_results_as_json_are_those_of_the_function(capsys: pytest.CaptureFixture[str]) -> None:
    [question] = strict_json(refused(capsys, PROVOX, as_json=True, digits=5)[1])["questions"]
    for reading, plain in zip(PROVOX, question["readings"], strict=True):
        assert (plain["value"], plain["alike"], plain["outcome"]) == (reading.text, [], "")
        wanted = pidemu.convert(reading.settings, "emerson/deltav", digits=5).settings
        assert {n: v["value"] for n, v in plain["settings"].items() if n in ("GAIN", "RESET", "RATE")} == {
            n: wanted[n].value for n in ("GAIN", "RESET", "RATE")
        }


def test_a_reading_that_the_target_refuses_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    found = pidemu.readings("emerson/deltav", GAIN=2, RESET=60)  # 60 repeats per second are beyond the range of the UDC's dial
    _, _, err = refused(capsys, found, "honeywell/udc")
    lines = err.splitlines()
    first, second = (lines.index(f"{k}. {r.text}") for k, r in enumerate(found, start=1))
    assert lines[first + 1].startswith("   -> honeywell/udc: GAIN = 2 %/%, RSET = ")
    assert lines[second + 1].startswith("   refused: honeywell/udc cannot do what emerson/deltav does")
    [question] = strict_json(refused(capsys, found, "honeywell/udc", as_json=True)[1])["questions"]
    plain = question["readings"]
    assert [p["settings"] is None for p in plain] == [False, True]
    assert plain[1]["outcome"] == lines[second + 1].strip()


def test_what_is_allowed_stays_allowed(capsys: pytest.CaptureFixture[str]) -> None:
    found = pidemu.readings("honeywell/tdc3000", K=1, T1=1, T2="30 min", FORM="interactive")
    lines = refused(capsys, found, allow_approximate=True, given={"ALPHA": 1})[2].splitlines()
    assert not any("refused: emerson" in line for line in lines)
    assert lines[-1].endswith("--to emerson/deltav --set ALPHA=1 --allow-approximate")


def test_readings_with_the_same_integral_gain_are_apart_by_their_laws(capsys: pytest.CaptureFixture[str]) -> None:
    err = refused(capsys, FORMS, "generic/parallel")[2]
    assert "Their integral gains are the same; their laws for measurement differ by up to 8.2 % in the loop band." in err


def test_descriptions_that_amount_to_the_same_stand_together(capsys: pytest.CaptureFixture[str]) -> None:
    found = pidemu.readings("allen-bradley/plc5", KP=1, KI=0.75)
    lines = refused(capsys, found)[2].splitlines()
    at = lines.index(f"1. {found[0].text}")
    assert lines[at + 1] == f"   or {found[0].alike[0]}"


def test_what_else_was_asked_for_is_passed_on(capsys: pytest.CaptureFixture[str]) -> None:
    found = pidemu.readings("fisher/provox", GAIN=2, RESET=0.75, pv_range=(0, 200), op_range=(0, 100))
    err = refused(capsys, found, to_pv_range=(-50.0, 150.0), process=pidemu.Process.from_lags(2, [10]), scan=1.0, compensate=True)[
        2
    ]
    assert err.splitlines()[-1] == (
        '   pidemu convert fisher/provox GAIN=2 "RESET=0.75 min/repeat" --pv-range=0,200 --op-range=0,100 '
        "--to emerson/deltav --scan 1 --to-pv-range=-50,150 --process gain=2,lag=10 --compensate"
    )
