"""``pidemu vectors``: what it prints and writes, its JSON against the schema, and the readers of the examples."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import pidemu
from tests.backends.c_compiler import COMPILER, needs_compiler, refused
from tests.backends.node import NODE, needs_node
from tests.cli.helpers import said, strict_json, told
from tools.regenerate import RENEW, vectors_schema
from tools.regenerate.pages import ROOT

PROVOX = ("fisher/provox", "GAIN=2", "RESET=4", "--scan", "0.5")
SCHEMA = ROOT / "specs" / "vectors.schema.json"


def fault(plain: Any) -> str:
    """Return what the schema says against a document; empty where it has the form."""
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    error = jsonschema.exceptions.best_match(jsonschema.Draft202012Validator(schema).iter_errors(plain))
    return "" if error is None else f"{list(error.absolute_path)}: {error.message}"


def test_the_schema_is_that_of_the_models() -> None:
    assert SCHEMA.read_text(encoding="utf-8") == vectors_schema.text(), RENEW
    jsonschema.Draft202012Validator.check_schema(json.loads(SCHEMA.read_text(encoding="utf-8")))


@pytest.mark.parametrize("card_id", ["fisher/provox", "oscat/ft-pid", "mathworks/pid2", "generic/dahlin", "toshiba/pid3"])
def test_the_json_has_its_form_and_is_that_of_python(card_id: str) -> None:
    plain = strict_json(told("vectors", card_id, "--json"))
    assert fault(plain) == ""
    assert plain == strict_json(json.dumps(pidemu.vectors(card_id).to_dict()))


def test_ranges_are_in_the_json() -> None:
    settings = pidemu.load_card("mathworks/pid2").settings(Kp=2, Ti=10, Td=1, pv_range=(0, 400, "degC"), op_range=(0, 100, "%"))
    plain = pidemu.vectors(settings, 1.0).to_dict()
    assert fault(plain) == ""
    assert plain["cases"][0]["inputs"]["sp"][0] == 200.0


def test_the_table_names_hash_cases_and_what_is_left_out() -> None:
    found = said("vectors", *PROVOX)
    vectors = pidemu.vectors(pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4), 0.5)
    lines = found.out.splitlines()
    assert found.status == 0
    assert lines[0] == "fisher/provox: GAIN=2 %/%, RESET=4 repeat/min, RATE=0 min"
    assert lines[1:3] == ["scan 0.5 s, reverse acting, float64", f"pidemu vectors v1, sha256 {vectors.hash}"]
    assert [line.split()[0] for line in lines[5:]] == [case.name for case in vectors.cases]
    assert "note: no case 'feedforward': fisher/provox states no feedforward input\n" in found.err


def test_files_are_written_and_a_run_of_each_record_gives_its_outputs(folder: Path) -> None:
    words = ("vectors", *PROVOX, "--out", "vectors")
    names = [line for line in told(*words).splitlines() if line.startswith("vectors")]
    assert sorted(names) == sorted(str(path.relative_to(folder)) for path in (folder / "vectors").iterdir())
    assert fault(json.loads((folder / "vectors" / "vectors.json").read_text(encoding="utf-8"))) == ""
    for path in (folder / "vectors").glob("*.csv"):
        if path.stem != "changed-settings":  # a record cannot change dials
            run = said("run", *PROVOX, "--record", str(path), "-o", "emulated.csv")
            assert "largest difference from the recorded output: 0 in" in run.err


def test_two_runs_write_the_same_bytes(folder: Path) -> None:
    for out in ("one", "other"):
        told("vectors", *PROVOX, "--out", out)
    for path in (folder / "one").iterdir():
        assert path.read_bytes() == (folder / "other" / path.name).read_bytes()


def test_a_folder_that_is_a_file_is_told(folder: Path) -> None:
    (folder / "taken").write_text("", encoding="utf-8")
    found = said("vectors", *PROVOX, "--out", "taken/inside")
    assert (found.status, found.out) == (2, "")
    assert found.err == "error: taken/inside/vectors.json: cannot be written: Not a directory\n"


# --- readers --------------------------------------------------------------------------------------------------------------------

_CASES = ("linear", "saturation", "manual")


def prepared(folder: Path, lang: str) -> None:
    shutil.copytree(ROOT / "examples" / "vectors", folder, dirs_exist_ok=True)
    told("vectors", *PROVOX, "--out", ".")
    told("code", *PROVOX, "--lang", lang, "--out", ".", "--name", "my_controller")


def planted(folder: Path, name: str, old: str, new: str) -> None:
    """Plant a fault in the controller."""
    text = (folder / name).read_text(encoding="utf-8")
    assert old in text
    (folder / name).write_text(text.replace(old, new), encoding="utf-8")


def ran(*words: str) -> tuple[int, str]:
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60)
    return done.returncode, done.stdout + done.stderr


def test_the_reader_in_python_plays_them_and_finds_a_fault(folder: Path) -> None:
    prepared(folder, "python")
    play = [sys.executable, "-B", "play.py"]
    assert [ran(*play, f"{case}.csv") for case in _CASES] == [(0, f"{case}.csv: equal\n") for case in _CASES]
    planted(folder, "my_controller.py", "e = sp - pv", "e = pv - sp")
    status, text = ran(*play, "linear.csv")
    assert (status, text.partition(": ")[0]) == (1, "linear.csv")
    assert "linear.csv: scan 10: " in text


@needs_node
def test_the_reader_in_javascript_plays_them_and_finds_a_fault(folder: Path) -> None:
    prepared(folder, "js")
    play = [str(NODE), "play.js", "vectors.json"]
    assert [ran(*play, case) for case in _CASES] == [(0, f"{case}: equal\n") for case in _CASES]
    planted(folder, "my_controller.js", "e = sp - pv", "e = pv - sp")
    status, text = ran(*play, "linear")
    assert status == 1
    assert "Error: linear: scan 10: " in text


@needs_compiler
def test_the_reader_in_c_plays_them_and_finds_a_fault(folder: Path) -> None:
    prepared(folder, "c")
    build = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "play.c", "my_controller.c", "-o", "play", "-lm")
    assert COMPILER is not None
    assert refused(*build, folder=folder) == ""
    assert [ran("./play", f"{case}.csv") for case in _CASES] == [(0, f"{case}.csv: equal\n") for case in _CASES]
    planted(folder, "my_controller.c", "e = sp - pv", "e = pv - sp")
    assert refused(*build, folder=folder) == ""
    status, text = ran("./play", "linear.csv")
    assert status == 1
    assert text.startswith("linear.csv: scan 10: ")
