"""What commands write: under a name, under one name each, and never over what is read."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pidemu.card.library import builtin_folder
from tests.cli.helpers import said

RECORD = "sp,pv\n50,49\n50,49.5\n"
LOOPS = 'tag,card,settings,process,scan,time\nFIC-1,fisher/provox,GAIN=2; RESET=4,"gain=1,lag=10",1,20\n'
PROVOX = ("fisher/provox", "GAIN=2", "RESET=4")
RUN = ("run", *PROVOX, "--record", "rr.csv")
COMPARE = ("compare", *PROVOX, *PROVOX)
SIMULATE = ("simulate", *PROVOX, "--process", "gain=1,lag=10", "--scan", "1", "--time", "20")
CONVERT = ("convert", *PROVOX, "--to", "emerson/deltav")
MATRIX = ("matrix", "fisher/provox", "generic/standard", "--jobs", "1", "--no-emulation")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    here = tmp_path / "here"
    (here / "v" / "fisher").mkdir(parents=True)
    card = (builtin_folder() / "fisher" / "provox.yaml").read_bytes()
    (here / "v" / "fisher" / "provox.yaml").write_bytes(card)
    (here / "rr.csv").write_text(RECORD, encoding="utf-8")
    (here / "f.csv").write_text(LOOPS, encoding="utf-8")
    monkeypatch.chdir(here)
    return here


def everything(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "words",
    [
        (*RUN, "--output", ""),
        (*RUN, "--plot", ""),
        (*COMPARE, "--output", ""),
        (*COMPARE, "--plot", " "),
        (*SIMULATE, "--out", ""),
        (*CONVERT, "--html", ""),
        (*MATRIX, "--csv", ""),
        (*MATRIX, "--html", ""),
        ("fleet", "f.csv", "--table", ""),
        ("fleet", "f.csv", "--parquet", ""),
        ("fleet", "f.csv", "--signals", ""),
        ("code", *PROVOX, "--out", ""),
    ],
)
def test_an_empty_name_is_refused_and_nothing_is_written(words: tuple[str, ...], folder: Path) -> None:
    before = everything(folder.parent)
    status, out, err = said(*words)
    kind = "folder" if words[-2] == "--signals" or words[0] == "code" else "file"
    option = {"--output": "-o' / '--output", "--out": "-o' / '--out"}.get(words[-2], words[-2])
    option = "--out" if words[0] == "code" else option
    assert (status, out, err.splitlines()[-1]) == (2, "", f"Error: Invalid value for '{option}': give a {kind} name")
    assert everything(folder.parent) == before


@pytest.mark.parametrize(
    "words",
    [
        (*RUN, "--output", "a\0"),
        (*RUN, "--plot", "a\0.png"),
        (*COMPARE, "--output", "a\0"),
        (*SIMULATE, "--out", "a\0"),
        (*CONVERT, "--html", "a\0"),
        (*MATRIX, "--csv", "a\0"),
        ("fleet", "f.csv", "--table", "a\0"),
        ("fleet", "f.csv", "--parquet", "a\0"),
        ("fleet", "f.csv", "--signals", "a\0"),
        ("code", *PROVOX, "--out", "a\0"),
    ],
)
def test_a_name_that_no_file_can_have_is_refused_before_anything_is_written(words: tuple[str, ...], folder: Path) -> None:
    before = everything(folder.parent)
    status, out, err = said(*words)
    name = "a\\x00" + {"--plot": ".png", "--out": "/fisher_provox.py" if "code" in words else ""}.get(words[-2], "")
    expected = f"error: {name}: cannot be written: no file can have this name\n"
    assert (status, out, err) == (2, "", expected)
    assert everything(folder.parent) == before


@pytest.mark.parametrize(
    "words",
    [
        ("run", *PROVOX, "--record", "a\0"),
        ("run", *PROVOX, "--record", "rr.csv", "--vendors", "a\0"),
        ("compare", *PROVOX, *PROVOX, "--record", "a\0"),
        ("convert", *PROVOX, "--to", "a\0"),
        ("convert", "--loop", "a\0", "--to", "emerson/deltav"),
        ("fleet", "a\0"),
        ("check", "a\0"),
        ("show", "a\0.yaml"),
        ("fit", "a\0"),
        ("certificate", "a\0"),
        ("verify", "a\0"),
    ],
)
def test_a_name_with_nul_of_what_is_read_is_refused_in_words(words: tuple[str, ...]) -> None:
    status, out, err = said(*words)
    assert (status, out) == (2, "")
    assert "Traceback" not in err
    assert "\0" not in err
    assert "rror" in err


V = ("--vendors", "v")
CARD = "v/fisher/provox.yaml"


@pytest.mark.parametrize(
    "words",
    [
        (*RUN, *V, "-o", CARD),
        ("run", CARD, "GAIN=2", "RESET=4", "--record", "rr.csv", "-o", "./v/../" + CARD),
        (*COMPARE, *V, "-o", CARD),
        (*SIMULATE, *V, "--out", CARD),
        (*CONVERT, *V, "--html", CARD),
        (*MATRIX, *V, "--csv", CARD),
        (*MATRIX, *V, "--html", CARD),
        ("fleet", "f.csv", *V, "--table", CARD),
        ("fleet", "f.csv", *V, "--parquet", CARD),
    ],
)
def test_the_card_that_is_read_is_not_written(words: tuple[str, ...], folder: Path) -> None:
    before = everything(folder)
    status, out, err = said(*words)
    place = next(folder.glob("v/fisher/*"))
    assert (status, out) == (2, "")
    assert "provox.yaml: is read, too, as " in err
    assert err.endswith("provox.yaml; give another file for the result\n")
    assert everything(folder) == before
    assert place.name == "provox.yaml"


@pytest.mark.skipif(os.name != "posix", reason="links as POSIX has them")
def test_a_program_is_not_written_through_a_link_to_the_card(folder: Path) -> None:
    (folder / "p.py").symlink_to(CARD)
    before = everything(folder)
    status, _, err = said("code", *PROVOX, *V, "--out", ".", "--name", "p")
    assert (status, err.partition(";")[0].partition(" as ")[0]) == (2, "error: p.py: is read, too,")
    assert everything(folder) == before


@pytest.mark.parametrize(
    ("words", "options"),
    [
        ((*RUN, "-o", "x.png", "--plot", "x.png"), "--output and --plot"),
        ((*RUN, "-o", "x.png", "--plot", "v/../x.png"), "--output and --plot"),
        ((*COMPARE, "-o", "x.png", "--plot", "./x.png"), "--output and --plot"),
        ((*MATRIX, "--csv", "x", "--html", "x"), "--csv and --html"),
    ],
)
@pytest.mark.parametrize("there", [False, True])
def test_two_results_do_not_go_to_one_file(words: tuple[str, ...], options: str, there: bool, folder: Path) -> None:
    if there:
        (folder / words[-3]).write_text("old", encoding="utf-8")
    before = everything(folder)
    one, other = options.split(" and ")
    message = f"error: {one} {words[-3]} and {other} {words[-1]} are the same; give each its own name\n"
    assert said(*words) == (2, "", message)
    assert everything(folder) == before
