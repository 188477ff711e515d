"""Pictures: that they are written, the same each time, and only when asked for."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

import pidemu
from pidemu.arrays import Floats
from pidemu.controller.controller import Controller
from pidemu.errors import PidemuError
from pidemu.records.files import Record
from pidemu.records.playback import play
from pidemu.report.plots import check_picture, plot_comparison, plot_run
from tests.cli.helpers import Said, said

ROOT = Path(__file__).parents[2]
PROVOX = ("fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1")
RUN = ("run", *PROVOX, "--scan", "1", "--record", str(ROOT / "examples" / "record.csv"), "-o", "out.csv")
COMPARE = ("compare", *PROVOX, "emerson/deltav", "GAIN=2.7", "RESET=20", "RATE=4")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def text_of(svg: Path) -> str:
    return svg.read_text(encoding="utf-8")


@pytest.mark.parametrize("words", [RUN, COMPARE], ids=["run", "compare"])
def test_a_png_shows_lines_on_white(folder: Path, words: tuple[str, ...]) -> None:
    assert said(*words, "--plot", "x.png").status == 0
    image = matplotlib.image.imread(folder / "x.png")
    height, width, _ = image.shape
    assert width == 1350
    assert height > 600
    white = (image[..., :3] > 0.99).all(axis=-1)
    assert 0.6 < white.mean() < 0.99
    colours = {tuple(c) for c in np.round(image[::3, ::3, :3].reshape(-1, 3) * 255).astype(int).tolist()}
    assert {(11, 107, 184), (209, 87, 28)} <= colours  # measurement and output


@pytest.mark.parametrize("words", [RUN, COMPARE], ids=["run", "compare"])
def test_an_svg_is_the_same_each_time(folder: Path, words: tuple[str, ...]) -> None:
    for name in ("a.svg", "b.SVG"):
        assert said(*words, "--plot", name).status == 0
    first = (folder / "a.svg").read_bytes()
    assert first.startswith(b"<?xml")
    assert first == (folder / "b.SVG").read_bytes()
    assert b"<dc:date>" not in first


def test_a_run_shows_what_it_names(folder: Path) -> None:
    assert said(*RUN, "--plot", "x.svg").status == 0
    words = text_of(folder / "x.svg")
    for label in (
        "fisher/provox: GAIN=2 %/%, RESET=4 repeat/min, RATE=0.1 min",
        "setpoint, PV [%]",
        "output [%]",
        "time [s]",
        "recorded",
        "emulated",
        "measurement (PV)",
        "manual",
    ):
        assert f"<!-- {label} -->" in words
    assert "cascade setpoint" not in words
    assert "output limit" not in words  # far away: the output stays between 40 and 60


def test_limits_modes_and_a_cascade_setpoint_are_shown_where_they_matter(folder: Path) -> None:
    n = 60
    nothing = np.full(n, np.nan)
    remote, follow, hold = nothing.copy(), nothing.copy(), np.zeros(n)
    remote[5:20], follow[30:35], hold[40:45] = 90.0, 20.0, 1.0
    record = Record(np.full(n, 60.0), np.full(n, 50.0), cascade=remote, track=follow, hold=hold)
    settings = pidemu.load_card("generic/standard").settings(K=2, Ti=5)
    plot_run(folder / "x.svg", settings, record, play(Controller(settings, 1.0), record, "r"), (0, 100))
    words = text_of(folder / "x.svg")
    for label in ("cascade setpoint", "tracking", "hold", "output limit"):
        assert f"<!-- {label} -->" in words
    assert "<!-- manual -->" not in words
    assert "<!-- recorded -->" not in words


def test_a_comparison_names_cards_segments_and_differences(folder: Path) -> None:
    assert said(*COMPARE, "--plot", "x.svg").status == 0
    words = text_of(folder / "x.svg")
    for label in ("fisher/provox", "emerson/deltav", "PV sine sweep", "large negative error", "manual", "output limit", "time [s]"):
        assert f"<!-- {label} -->" in words


def test_many_samples_are_drawn_as_an_image(folder: Path) -> None:
    record = Record(np.full(30_000, 50.0), 50 + np.sin(np.arange(30_000.0)))
    settings = pidemu.load_card("generic/standard").settings(K=2, Ti=50)
    plot_run(folder / "x.svg", settings, record, play(Controller(settings, 1.0), record, "r"), (0, 100))
    assert (folder / "x.svg").stat().st_size < 1_000_000


def test_a_single_sample_and_outputs_that_are_no_numbers_can_be_drawn(folder: Path) -> None:
    settings = pidemu.load_card("generic/standard").settings(K=2, Ti=50)
    record = Record(np.array([np.nan]), np.array([np.inf]), output=np.array([np.nan]))
    plot_run(folder / "x.png", settings, record, play(Controller(settings, 1.0), record, "r"), (-np.inf, np.inf))
    plot_comparison(folder / "y.png", pidemu.compare([settings, settings], record))
    assert (folder / "x.png").stat().st_size > 10_000 < (folder / "y.png").stat().st_size


HUGE = np.array([50.0, 1e308, -1e308, np.nan, 1.7e308, -1.7e308, 60.0])
"""The first sample is where a comparison starts from rest, and has to be a signal."""


@pytest.mark.parametrize(
    "values", [HUGE, np.array([50.0] + [1e308] * 6), np.array([50.0] * 6 + [-1.7e308])], ids=["mixed", "all", "one"]
)
def test_signals_near_the_largest_number_can_be_drawn(folder: Path, values: Floats) -> None:
    settings = pidemu.load_card("generic/standard").settings(K=2, Ti=50)
    for record in (Record(values, 100 - values), Record(np.full(7, 50.0), values, cascade=values)):
        played = play(Controller(settings, 1.0, initial_output=50.0), record, "r")
        plot_run(folder / "x.png", settings, record, played, (-1e308, 1e308))
        assert (folder / "x.png").stat().st_size > 10_000
    plot_comparison(folder / "y.png", pidemu.compare([settings, settings], Record(values, 100 - values), initial_output=50.0))
    assert (folder / "y.png").stat().st_size > 10_000


def test_a_dollar_sign_is_one_and_what_is_not_seen_is_written_out(folder: Path) -> None:
    settings = pidemu.load_card("generic/standard").settings(K=2, Ti=50)
    comparison = pidemu.compare([settings, settings])
    runs = tuple(replace(run, label=label) for run, label in zip(comparison.runs, ("$x^{$", "a$b$\x1b"), strict=True))
    plot_comparison(folder / "x.svg", replace(comparison, runs=runs))
    words = text_of(folder / "x.svg")
    assert "<!-- $x^{$: K=2 %/%" in words
    assert "a$b$\\x1b: K=2 %/%" in words
    assert "\x1b" not in words


def test_a_picture_that_is_refused_leaves_the_old_one(folder: Path) -> None:
    (folder / "x.svg").write_text("old", encoding="utf-8")
    assert said(*RUN, "--limits", "5,5", "--plot", "x.svg").status == 2
    assert text_of(folder / "x.svg") == "old"


@pytest.mark.parametrize("name", ["x.pdf", "x", "x.png.txt", "png"])
def test_another_ending_is_refused_before_anything_is_done(folder: Path, name: str) -> None:
    message = f"error: {name}: pictures are written as .png or .svg; give the file such an ending\n"
    assert said(*RUN, "--plot", name) == Said(2, "", message)
    assert list(folder.iterdir()) == []


def test_a_folder_that_is_not_there_is_named() -> None:
    status, _, err = said(*RUN, "--plot", "nowhere/x.png")
    assert status == 2
    assert err.splitlines()[-1] == "error: nowhere/x.png: cannot be written: No such file or directory"


def test_without_matplotlib_it_is_said_how_to_install_it(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(PidemuError, match=r"^pictures need matplotlib, .*; pip install 'pidemu\[plot\]'$"):
        check_picture("x.png")
    assert said(*COMPARE, "--plot", "x.png").status == 2
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("words", [RUN, COMPARE], ids=["run", "compare"])
def test_matplotlib_is_not_imported_without_a_picture(words: tuple[str, ...]) -> None:
    code = (
        "import sys, contextlib, pidemu.cli\n"
        f"with contextlib.suppress(SystemExit): pidemu.cli.main({list(words)!r})\n"
        "assert 'numpy' in sys.modules\nassert 'matplotlib' not in sys.modules"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
