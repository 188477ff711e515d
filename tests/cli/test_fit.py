"""``pidemu fit`` and ``pidemu relay``: what they print, their JSON against its schema, their pictures, and what they refuse."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import pidemu
from pidemu.process.process import parse_process
from tests.cli.helpers import said, strict_json, told
from tests.process.curves import DATA, FILES, curve
from tools.regenerate import RENEW, process_schemas
from tools.regenerate.pages import ROOT

CURVE = FILES["05-fopdt-noisy"]
RELAY = ("relay", "--process", "gain=1,lag=20,delay=5", "--amplitude", "5")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in FILES.values():
        shutil.copy(DATA / name, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def fault(name: str, plain: Any) -> str:
    """Return what a schema says against a document; empty where it has the form."""
    schema = json.loads((ROOT / "specs" / name).read_text(encoding="utf-8"))
    error = jsonschema.exceptions.best_match(jsonschema.Draft202012Validator(schema).iter_errors(plain))
    return "" if error is None else f"{list(error.absolute_path)}: {error.message}"


@pytest.mark.parametrize(
    ("name", "text"),
    [("fit.schema.json", process_schemas.fit_text()), ("relay.schema.json", process_schemas.relay_text())],
)
def test_the_schemas_are_those_that_the_models_make(name: str, text: str) -> None:
    assert (ROOT / "specs" / name).read_text(encoding="utf-8") == text, RENEW
    jsonschema.Draft202012Validator.check_schema(json.loads(text))


def test_a_fit_prints_numbers_with_intervals_goodness_and_the_process_for_the_next_command() -> None:
    assert told("fit", CURVE) == (
        "-0.795789 exp(-9 s)/(11.897 s + 1)  (fopdt, least-squares)\n"
        "                             95 % interval\n"
        "  gain       -0.795789  %/%  -0.8019 to -0.7897\n"
        "  lag           11.897  s    11.56 to 12.24\n"
        "  dead time          9  s    8.777 to 9.223\n"
        "  start        60.0171  %    59.99 to 60.05\n"
        "\n"
        "Goodness\n"
        "  record     240 samples, 1 move of the output\n"
        "  residuals  0.0974 % rms, correlation of neighbours -0.01\n"
        "  explained  99.709 % of the variance\n"
        "\n"
        "--process 'gain=-0.795789,lag=11.897,delay=9'\n"
    )


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--model", "sopdt"),
        ("--method", "tangent"),
        ("--method", "two-point", "--pv-range", "0,400 degC"),
        ("--drift", "--from", "5", "--to", "2 min"),
    ],
    ids=" ".join,
)
def test_the_json_of_a_fit_has_its_form(words: tuple[str, ...]) -> None:
    plain = strict_json(told("fit", CURVE, "--json", *words))
    assert fault("fit.schema.json", plain) == ""
    assert plain["process"]["gain"] == pytest.approx(-0.8, rel=0.02)
    again = parse_process(plain["process"]["text"], any_unit=True)
    assert (again.gain, again.delay, again.unit) == tuple(plain["process"][name] for name in ("gain", "delay", "unit"))
    assert ("percent" in plain) == ("--pv-range" in words)


def test_the_json_is_that_of_python() -> None:
    plain = strict_json(told("fit", CURVE, "--json"))
    assert plain == json.loads(json.dumps(pidemu.fit_process(*curve("05-fopdt-noisy")).to_dict()))


def test_ranges_give_the_gain_in_engineering_units_and_in_percent() -> None:
    shown = told("fit", FILES["01-fopdt"], "--pv-range", "0,400 degC")
    assert "  gain        2  degC/%  2 to 2\n" in shown
    assert "in percent of the ranges: 0.5 exp(-7 s)/(30 s + 1)\n" in shown
    assert shown.endswith("--process 'gain=0.5,lag=30,delay=7'\n")


def test_an_integrator_has_a_gain_per_second() -> None:
    assert "  gain       0.02  %/%/s  0.02 to 0.02\n" in told("fit", FILES["09-integ"], "--model", "ipdt")


def test_a_record_without_times_takes_the_interval_that_is_given(folder: Path) -> None:
    _, u, y = curve("05-fopdt-noisy")
    rows = [f"{a},{b}" for a, b in zip(u.tolist(), y.tolist(), strict=True)]
    (folder / "x.csv").write_text("\n".join(["op,pv", *rows]), encoding="utf-8")
    assert told("fit", "x.csv", "--scan", "500 ms") == told("fit", CURVE)
    rows = [f"{'' if i % 3 else 0.5},{row}" for i, row in enumerate(rows)]
    (folder / "y.csv").write_text("\n".join(["dt,op,pv", *rows]), encoding="utf-8")
    assert told("fit", "y.csv", "--scan", "500 ms") == told("fit", CURVE)
    assert said("fit", "x.csv").err == "error: x.csv: no column 'time'; add one, or give the time between samples with --scan\n"


def test_notes_go_to_stderr(folder: Path) -> None:
    text = (folder / FILES["01-fopdt"]).read_text(encoding="utf-8")
    (folder / "x.csv").write_text("# a test\n" + text, encoding="utf-8")
    result = said("fit", "x.csv", "--to", "60")
    first, second = result.err.splitlines()
    assert first == "note: x.csv: skipped: 1 comment line above the header"
    assert second.startswith("note: the record ends 40 s after the output first moved, before the measurement has settled")


def test_a_refusal_is_told_in_words_and_in_json_and_the_exit_status_is_1() -> None:
    result = said("fit", CURVE, "--to", "9", "--json")
    plain = strict_json(result.out)
    assert (result.status, plain["verdict"]) == (1, "refused")
    assert fault("fit.schema.json", plain) == ""
    assert result.err == f"error: {CURVE}: {plain['reason']}\n"
    assert plain["reason"].startswith("the output stays at 70: without a bump there is nothing to fit")


def test_a_closed_loop_is_known_by_its_mode_column(folder: Path) -> None:
    t, u, y = curve("01-fopdt")
    rows = [f"{a},{b},{c},auto" for a, b, c in zip(t.tolist(), u.tolist(), y.tolist(), strict=True)]
    (folder / "x.csv").write_text("\n".join(["time,op,pv,auto", *rows]), encoding="utf-8")
    result = said("fit", "x.csv")
    assert result.status == 1
    assert result.err.startswith("error: x.csv: the controller was in automatic: what moved the output is the measurement itself;")


WRONG = {
    "fit none.csv": "none.csv: cannot be read: No such file or directory",
    "fit back.csv": "back.csv: time: sample 3, 1 s, goes back from 2 s; give samples in the order of their times, one for each",
    "fit gaps.csv": "gaps.csv: the column interval has empty cells; give the usual time between samples with --scan",
    "fit no_output.csv": "no_output.csv:1: no column 'output' among time, pv",
    f"fit {CURVE} --from 500": f"{CURVE}: no sample between --from and --to; the record is from 0 s to 119.5 s",
    f"fit {CURVE} --plot x.gif": "x.gif: pictures are written as .png or .svg; give the file such an ending",
    f"fit {CURVE} --plot none/x.png": "none/x.png: cannot be written: No such file or directory",
    f"fit {CURVE} --model ipdt --method two-point": (
        "the method two-point reads no ipdt off a curve, but fopdt; use method='least-squares'"
    ),
    "relay --process gain=1,lag=5 --amplitude 1": (
        "the relay would switch without end: 1/(5 s + 1) answers at once; give it its dead time and small lags, or give a "
        "hysteresis"
    ),
    "relay --process gain=1,lag=5,delay=1 --amplitude -1": "amplitude is -1; give a number above zero",
}


@pytest.mark.parametrize("line", WRONG)
def test_wrong_usage_is_told_with_exit_status_2(folder: Path, line: str) -> None:
    rows = [f"{t},{40 + 5 * (t > 4)},{t}" for t in (0, 2, 1, *range(3, 20))]
    (folder / "back.csv").write_text("\n".join(["time,op,pv", *rows]), encoding="utf-8")
    (folder / "gaps.csv").write_text("\n".join(["dt,op,pv", "1,40,2", "1,40,2", ",45,2"]), encoding="utf-8")
    (folder / "no_output.csv").write_text("time,pv\n0,1\n1,2\n", encoding="utf-8")
    result = said(*line.split())
    assert (result.status, result.out, result.err) == (2, "", f"error: {WRONG[line]}\n")


def test_a_relay_experiment_prints_both_ultimate_points_and_the_process() -> None:
    assert told(*RELAY) == (
        "The oscillation\n"
        "  period     17.9933  s\n"
        "  amplitude  1.106    half of the measurement's swing\n"
        "  relay      +5 / -5  hysteresis 0\n"
        "\n"
        "Ultimate point\n"
        "                           gain  period [s]\n"
        "  by 4 d/(pi a)         5.75608     17.9933\n"
        "  of the process below  6.93451     18.3129\n"
        "\n"
        "Process of first order that oscillates so\n"
        "  1 exp(-5 s)/(20 s + 1)\n"
        "\n"
        "--process 'gain=1,lag=20,delay=5'\n"
    )


@pytest.mark.parametrize("words", [(), ("--noise", "0.1", "--scan", "0.5"), ("--output", "98", "--limits", "0,100")], ids=" ".join)
def test_the_json_of_a_relay_experiment_has_its_form(words: tuple[str, ...]) -> None:
    plain = strict_json(told(*RELAY, "--json", *words))
    assert fault("relay.schema.json", plain) == ""
    assert plain["process"]["lags"] == pytest.approx([20], rel=0.05)


def test_a_dead_time_alone_has_no_process_in_its_json() -> None:
    plain = strict_json(told("relay", "--process", "gain=1,delay=2", "--amplitude", "5", "--json"))
    assert fault("relay.schema.json", plain) == ""
    assert (plain["process"], plain["fitted_gain"]) == (None, "nan")


@pytest.mark.parametrize("words", [("fit", CURVE), ("fit", FILES["01-fopdt"], "--pv-range", "0,400 degC"), RELAY], ids=" ".join)
def test_pictures_show_lines_on_white_and_are_the_same_each_time(folder: Path, words: tuple[str, ...]) -> None:
    import matplotlib.image

    for name in ("a.png", "a.svg", "b.svg"):
        told(*words, "--plot", name)
    image = matplotlib.image.imread(folder / "a.png")
    white = (image[..., :3] > 0.99).all(axis=-1)
    assert 0.6 < white.mean() < 0.99
    colours = {tuple(c) for c in np.round(image[::2, ::2, :3].reshape(-1, 3) * 255).astype(int).tolist()}
    assert {(11, 107, 184), (209, 87, 28)} <= colours
    assert (folder / "a.svg").read_bytes() == (folder / "b.svg").read_bytes()


def test_neither_a_fit_nor_a_relay_imports_scipy_or_matplotlib() -> None:
    code = (
        "import sys\nfrom click.testing import CliRunner\nfrom pidemu.cli import cli\n"
        f"for words in {[['fit', CURVE], list(RELAY)]!r}:\n    assert CliRunner().invoke(cli, words).exit_code == 0\n"
        "assert not {'scipy', 'matplotlib'} & set(sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False).stderr == ""
