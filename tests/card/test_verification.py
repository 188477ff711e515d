"""How the emulation of each card was verified: what it claims is what tests run, and a card from outside shows it."""

from __future__ import annotations

import ast
import importlib.metadata
import os
from pathlib import Path

import pytest

import pidemu
from pidemu.card.library import card_entry
from pidemu.card.model.verification import RecordedTrace
from pidemu.checks import check_file
from pidemu.checks.traces import compare_trace
from tests.checks.bench import VALID, edited, written
from tools.regenerate import RENEW, emulation

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "tests" / "data"
TRACES = [(name, trace) for name in pidemu.cards() for trace in pidemu.load_card(name).verification.records]


def test_the_page_is_what_the_cards_say_today() -> None:
    assert (ROOT / "docs" / "emulation.md").read_text(encoding="utf-8") == emulation.text(), RENEW


@pytest.mark.parametrize(("name", "trace"), TRACES, ids=[f"{name}-{trace.file}" for name, trace in TRACES])
def test_every_recorded_trace_is_reproduced_within_its_tolerance(name: str, trace: RecordedTrace) -> None:
    c = compare_trace(pidemu.load_card(name), trace, DATA)
    assert c.compared.sum() > 90
    assert c.difference <= trace.tolerance, (
        f"scan {c.worst}: {c.found[c.worst]!r}, recorded {c.recorded[c.worst]!r}, {c.difference:.3g}"
    )


@pytest.mark.parametrize(("name", "trace"), TRACES, ids=[f"{name}-{trace.file}" for name, trace in TRACES])
def test_every_recorded_trace_says_what_ran_and_a_gain_one_thousandth_off_is_seen(name: str, trace: RecordedTrace) -> None:
    assert (DATA / trace.file).read_text(encoding="utf-8").startswith("#"), "which program, version and settings"
    card = pidemu.load_card(name)
    gain = next(
        n for n, s in card.settings(trace.given).equation.settings.items() if s.sets in ("gain", "integral") and trace.given.get(n)
    )
    value = trace.given[gain]
    assert isinstance(value, float | int)
    other = {**trace.given, gain: value * 1.001}
    wrong = compare_trace(
        card, RecordedTrace(**{**{f: getattr(trace, f) for f in RecordedTrace.__dataclass_fields__}, "given": other}), DATA
    )
    assert wrong.difference > max(trace.tolerance, 1e-7)


@pytest.mark.parametrize("name", pidemu.cards())
def test_every_card_says_how_it_was_verified_and_the_test_it_names_runs_it(name: str) -> None:
    v = pidemu.load_card(name).data.verification
    assert v is not None
    if v.test is not None:
        place = ROOT / v.test
        files = [place] if place.is_file() else sorted(place.glob("test_*.py"))
        texts = [file.read_text(encoding="utf-8") for file in files]
        assert any(f"{name.split('/', maxsplit=1)[0]}/" in text or "pidemu.cards()" in text for text in texts), (
            f"{v.test} does not run {name}"
        )
        assert any(isinstance(x, ast.FunctionDef) and x.name.startswith("test_") for f in files for x in ast.walk(_tree(f)))
    if v.package is not None:
        package, version = v.package.split()
        assert importlib.metadata.version(package) == version
        assert v.test is not None
        module = package.replace("-", "_")
        tree = _tree(ROOT / v.test)
        imported = {x.module for x in ast.walk(tree) if isinstance(x, ast.ImportFrom)}
        imported |= {a.name for x in ast.walk(tree) if isinstance(x, ast.Import) for a in x.names}
        assert any(m is not None and m.split(".")[0].lower() == module.lower() for m in imported), (
            f"{v.test} does not import {module}"
        )


def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


HEAD = "# the bench itself, version 1\n"
GOOD = HEAD + "sp,pv,output\n" + "50,50,40\n50,49,42\n" * 20
RECORDED = """\
verification:
  class: V1
  source: manual
  at: trace 1
  records:
    - {file: bench.csv, given: {GAIN: 2, RESET: 60}, scan: 1 s, tolerance: 1e-12}
"""


def outside(folder: Path, csv: str | None, record: str = RECORDED) -> Path:
    """Write a card of one's own, with a trace beside it."""
    file = written(folder, edited(VALID, ("quirks:\n", f"{record}quirks:\n")))
    if csv is not None:
        (file.parent / "bench.csv").write_text(csv, encoding="utf-8")
    return file


def recorded(folder: Path, gain: float = 2.0) -> str:
    """Return what a controller of the same law and rules, written here, makes of a record."""
    pv, auto = [50.0, 50.0, 48.0, 47.0, 47.5, 60.0, *[49.0] * 20], [0, *[1] * 25]
    lines, last, integral = ["sp,pv,auto,manual,output"], 40.0, 0.0
    for y, a in zip(pv, auto, strict=True):
        e = 50.0 - y
        if not a:
            last, integral = 40.0, 40.0 - gain * e
        elif lines[-1].split(",")[2] == "0":
            integral = last - gain * e
            last = gain * e + integral
        else:
            integral += gain * e / 60
            last = gain * e + integral
        lines.append(f"50,{y},{a},40,{last!r}")
    return HEAD + "\n".join(lines) + "\n"


def test_a_card_of_ones_own_is_v1_by_a_trace_beside_it_which_the_check_runs(tmp_path: Path) -> None:
    file = outside(tmp_path, recorded(tmp_path))
    assert check_file(file) == []
    assert pidemu.load_card("nobody/bench", [tmp_path]).verification.class_ == "V1"


def test_a_trace_that_the_card_does_not_reproduce_is_told_with_its_scan(tmp_path: Path) -> None:
    (problem,) = check_file(outside(tmp_path, recorded(tmp_path, gain=2.02)))
    assert "nobody/bench.yaml:47:" in problem.headline()
    assert "the card does not reproduce bench.csv: in scan 5 it gives" in problem.message
    assert "stated is 1e-12" in problem.message


def test_a_trace_that_changes_after_the_check_is_run_again(tmp_path: Path) -> None:
    file = outside(tmp_path, recorded(tmp_path))
    assert check_file(file) == []
    (file.parent / "bench.csv").write_text(recorded(tmp_path, gain=3.0), encoding="utf-8")
    assert len(check_file(file)) == 1


@pytest.mark.parametrize(
    ("csv", "record", "message"),
    [
        (None, RECORDED, "bench.csv: cannot be read: No such file or directory"),
        (HEAD + "sp,pv,output\n50,50,40\n", RECORDED, "shows nothing: at least 20 scans are compared, in which the output moves"),
        (HEAD + "sp,pv,output\n" + "50,50,40\n" * 30, RECORDED, "shows nothing"),
        (
            GOOD,
            RECORDED.replace("scan: 1 s", "changes: [{at: 99, given: {GAIN: 4}}], scan: 1 s"),
            "do not ascend within its 40 scans",
        ),
        (HEAD + "sp,pv\n50,50\n", RECORDED, "bench.csv: no column 'output' among sp, pv"),
        (HEAD + "sp,pv,output\n50,50,none\n", RECORDED, "'none' is not a number"),
        (HEAD + "pv,output\n50,50\n", RECORDED, "no column 'sp' among pv, output"),
        (GOOD, RECORDED.replace("RESET: 60", "RESET: 60, GAIM: 1"), "unknown setting 'GAIM'"),
        (GOOD, RECORDED.replace("1 s,", "1 parsec,"), "parsec"),
        (
            HEAD + "sp,pv,output\n50,50,40\n",
            RECORDED.replace("file: bench.csv", "file: ../bench.csv"),
            "not the name of a CSV file",
        ),
        (GOOD + "50,50,nan\n", RECORDED, "the card does not reproduce bench.csv"),
    ],
)
def test_a_trace_that_cannot_be_run_is_told_where_the_card_names_it(
    csv: str | None, record: str, message: str, tmp_path: Path
) -> None:
    (problem,) = check_file(outside(tmp_path, csv, record))
    assert message in problem.message
    assert problem.line == 47


def test_settings_changed_in_a_trace_are_changed_in_the_card(tmp_path: Path) -> None:
    changed = RECORDED.replace("scan: 1 s", "changes: [{at: 3, given: {GAIN: 4}}], scan: 1 s")
    (problem,) = check_file(outside(tmp_path, recorded(tmp_path), changed))
    assert "in scan 5 it gives" in problem.message or "in scan 3 it gives" in problem.message


def test_a_link_and_a_pipe_are_not_read(tmp_path: Path) -> None:
    file = outside(tmp_path, None)
    (tmp_path / "secret").write_text("root:x:0:0", encoding="utf-8")
    (file.parent / "bench.csv").symlink_to(tmp_path / "secret")
    (problem,) = check_file(file)
    assert problem.message == "bench.csv is not a plain file; put the file itself beside the card"
    (file.parent / "bench.csv").unlink()
    os.mkfifo(file.parent / "bench.csv")
    (problem,) = check_file(file)
    assert problem.message == "bench.csv is not a plain file; put the file itself beside the card"


def test_the_list_of_cards_shows_no_claim_that_is_not_shown(tmp_path: Path) -> None:
    file = outside(tmp_path, recorded(tmp_path))
    assert card_entry(file, "nobody/bench").verification == "V1"
    (file.parent / "bench.csv").write_text(recorded(tmp_path, gain=3.0), encoding="utf-8")
    with pytest.raises(pidemu.CardError, match="does not reproduce bench"):
        card_entry(file, "nobody/bench")
