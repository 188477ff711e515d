"""tune, robustness and bode on the command line: the forms of their JSON, pictures, what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from click.testing import CliRunner

import pidemu
from pidemu.analysis.frequency import loop_response
from pidemu.cli import cli
from tools.regenerate import RENEW, loop_schemas
from tools.regenerate.pages import ROOT

PROCESS = "gain=1,lag=20,lag=5,delay=3"
LOOP = ["fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--process", PROCESS]


def run(*words: str) -> str:
    result = CliRunner().invoke(cli, list(words), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def printed(form: str, *words: str) -> dict[str, Any]:
    """Return the JSON that a command prints, which has its form."""
    plain: dict[str, Any] = json.loads(run(*words, "--json"))
    schema = json.loads((ROOT / "specs" / f"{form}.schema.json").read_text("utf-8"))
    jsonschema.Draft202012Validator(schema).validate(plain)
    return plain


@pytest.mark.parametrize("form", ["tuning", "robustness", "bode"])
def test_the_schemas_are_those_that_the_models_make(form: str) -> None:
    assert (ROOT / "specs" / f"{form}.schema.json").read_text("utf-8") == loop_schemas.text(form), RENEW


@pytest.mark.parametrize("more", [[], ["--scan", "1"]])
def test_robustness_prints_what_python_gives(more: list[str]) -> None:
    found = printed("robustness", "robustness", *LOOP, *more)
    settings = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
    process = pidemu.Process.from_lags(1.0, lags=[20, 5], delay=3)
    assert found == pidemu.robustness(settings, process, 1.0 if more else None).to_dict()


def test_infinite_ratios_are_words() -> None:
    found = printed("robustness", "robustness", "generic/standard", "K=1", "Ti=10", "--process", "gain=1,lag=10")
    assert set(found["delay_ratio"]) == {"inf"}
    assert (found["gain_margin"], found["lower_gain_limit"]) == ("inf", 0.0)


def test_tune_prints_dials_options_gains_and_figures() -> None:
    found = printed("tuning", "tune", "emerson/deltav", "--process", "gain=2,lag=60,delay=6", "--rule", "simc")
    assert found["card"] == "emerson/deltav"
    assert found["settings"]["GAIN"] == {"value": 2.5, "unit": "%/%"}
    assert found["options"]["STRUCTURE"] == "1"
    assert pytest.approx({"kp": 2.5, "ki": 2.5 / 48, "kd": 0.0}) == {k: found["gains"][k] for k in ("kp", "ki", "kd")}
    assert found["figures"]["stable"]


def test_all_rules_are_printed_sorted() -> None:
    found = printed("tuning", "tune", "fisher/provox", "--process", PROCESS, "--all-rules", "--sort", "Ms", "--controller", "PI")
    Ms = [t["figures"]["Ms"] for t in found["rules"]]
    assert Ms == sorted(Ms)
    text = run("tune", "fisher/provox", "--process", PROCESS, "--all-rules", "--controller", "PI")
    assert all(t["rule"] in text for t in found["rules"])


def test_options_dials_and_parameters_are_kept() -> None:
    words = ("--set", "FORM=Standard", "--set", "ALPHA=0.1", "--rule", "simc", "--parameter", "Tcl=30", "--digits", "3")
    found = printed("tuning", "tune", "emerson/deltav", "--process", "gain=2,lag=60,delay=6", *words)
    assert (found["options"]["FORM"], found["settings"]["ALPHA"]["value"]) == ("Standard", 0.1)
    assert found["settings"]["GAIN"]["value"] == 0.833


@pytest.mark.parametrize(
    ("words", "message", "status"),
    [
        (
            ["tune", "generic/series", "--process", "gain=2,lag=6,delay=9", "--rule", "iae-pi"],
            "the nearest that does is 'simc'",
            2,
        ),
        (
            ["tune", "generic/series", "--process", "gain=2,lag=6,delay=9", "--parameter", "lam=3"],
            "no rule has a parameter 'lam'",
            2,
        ),
        (["tune", "fisher/provox", "--process", "gain=2,lag=60,delay=6", "--rule", "ise-pid"], "is refused", 1),
        (["tune", "fisher/provox", "--process", "gain=0,lag=60"], "the gain is 0", 2),
        (["bode", *LOOP, "--low", "10", "--high", "1"], "are not a range", 2),
        (["robustness", *LOOP, "--plot", "limit.pdf"], "pictures are written as .png or .svg", 2),
        (["robustness", "simple-pid/simple-pid", "Kp=1", "Ki=1", "Kd=0", "--process", "gain=-1,lag=5"], "the other sign", 2),
    ],
)
def test_wrong_input_says_cause_and_remedy(words: list[str], message: str, status: int, capsys: pytest.CaptureFixture[str]) -> None:
    from pidemu.cli import main

    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == status
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("name", ["loop.png", "loop.svg"])
@pytest.mark.parametrize("command", ["robustness", "bode"])
def test_pictures_are_drawn(command: str, name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    run(command, *LOOP, "--scan", "1", "--plot", str(path))
    content = path.read_bytes()
    assert content.startswith(b"\x89PNG" if name.endswith("png") else b"<?xml")
    words = {"robustness": b"delay ratio", "bode": b"frequency [rad/s]"}[command]
    assert name.endswith("png") or words in content


def test_bode_prints_the_loop_and_the_gang_of_four_within_the_zoom() -> None:
    found = printed("bode", "bode", *LOOP, "--low", "0.01", "--high", "1")
    w, loop = np.array(found["w"]), np.array(found["loop"]["gain"]) * np.exp(1j * np.radians(found["loop"]["phase"]))
    assert pytest.approx((0.01, 1.0)) == (w[0], w[-1])
    settings = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
    process = pidemu.Process.from_lags(1.0, lags=[20, 5], delay=3)
    assert pytest.approx(settings.law().response(w) * process.response(w)) == loop
    assert pytest.approx(np.abs(1 / (1 + loop))) == np.array(found["gang_of_four"]["S"])


def test_the_circles_of_ms_and_mt_are_touched() -> None:
    settings = pidemu.load_card("generic/standard").settings(K=3, Ti=8)
    found = loop_response(settings, pidemu.Process.from_lags(1.0, lags=[20], delay=3))
    Ms, Mt = found.figures.Ms, found.figures.Mt
    centre, radius = -(Mt**2) / (Mt**2 - 1), Mt / (Mt**2 - 1)
    assert pytest.approx(1 / Ms, rel=1e-3) == np.abs(found.loop + 1).min()
    assert pytest.approx(radius, rel=1e-3) == np.abs(found.loop - centre).min()
