"""The command that prints a scan program: what it prints runs, and gives the emulator's bits."""

from __future__ import annotations

import json
import math
import random
import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import pidemu
from pidemu.card.library import card_files
from pidemu.errors import EngineError
from tests.backends.c_compiler import COMPILER, CPP, WARNINGS, needs_compiler, needs_cpp, refused
from tests.backends.node import evaluated, needs_node
from tests.backends.structured_text import read
from tests.checks.bench import VALID, written
from tests.cli.helpers import said, told

Scan = tuple[float, float, bool, float | None]

_EXAMPLES = [(i, e.given) for i in card_files() for e in pidemu.load_card(i).data.examples]


def signals(low: float, high: float, count: int = 60) -> list[Scan]:
    """A run with setpoint steps, noise, saturation and two spells in manual."""
    chance = random.Random(7)
    low, high = max(low, -1000), min(high, 1000)
    middle, width = (low + high) / 2, (high - low) / 2
    found: list[Scan] = []
    for i in range(count):
        sp = middle + width * (0.1 if i < 20 else 0.9 if i < 40 else -0.5)
        pv = middle + width * chance.uniform(-0.3, 0.3)
        manual = middle + width * chance.uniform(-0.5, 0.5) if i % 3 else None
        found.append((sp, pv, not (i < 4 or 25 <= i < 31), manual))
    return found


def printed(*words: str) -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(told("code", *words), names)
    return names


def run_scan_by_scan(module: dict[str, Any], scans: list[Scan]) -> list[float]:
    state = list(module["INITIAL"])
    return [module["scan"](state, sp, pv, float(auto), math.nan if man is None else man) for sp, pv, auto, man in scans]


@pytest.mark.parametrize(("card_id", "given"), _EXAMPLES, ids=str)
def test_the_printed_python_gives_the_same_outputs_as_the_controller(card_id: str, given: dict[str, str | float]) -> None:
    controller = pidemu.Controller(pidemu.load_card(card_id).settings(given))
    scans = signals(*controller.settings.equation.output.limits)
    words = [f"{name}={value}" for name, value in given.items()]
    assert run_scan_by_scan(printed(card_id, *words, "--lang", "python"), scans) == [controller.scan(*s) for s in scans]


@pytest.mark.parametrize("action", ["reverse", "direct"])
def test_scan_interval_action_and_limits_are_printed_in(action: Any) -> None:
    settings = pidemu.load_card("emerson/deltav").settings(GAIN=1.5, RESET=20, RATE=4, FORM="Series")
    controller = pidemu.Controller(settings, 0.25, action, (10, 90))
    module = printed(
        "emerson/deltav", "GAIN=1.5", "RESET=20", "RATE=4", "FORM=Series",
        "--scan", "0.25", "--action", action, "--limits", "10,90",
    )  # fmt: skip
    scans = signals(0, 100)
    assert run_scan_by_scan(module, scans) == [controller.scan(*s) for s in scans]
    words = ("GAIN=1.5", "RESET=20", "RATE=4", "FORM=Series", "--scan", "0.25", "--action", action, "--limits", "10,90")
    assert told("code", "emerson/deltav", *words).splitlines()[1].endswith(f"scan 0.25 s, {action} acting")


def test_the_printed_run_does_what_scan_after_scan_does() -> None:
    module = printed("generic/standard", "K=2", "Ti=10", "Td=1", "Tf=0.5")
    scans = signals(0, 100)
    sp, pv, auto, manual = ([float("nan") if x is None else float(x) for x in column] for column in zip(*scans, strict=True))
    assert module["run"](list(module["INITIAL"]), sp, pv, auto, manual) == run_scan_by_scan(module, scans)


def test_the_printed_module_imports_nothing() -> None:
    assert "import" not in told("code", "emerson/deltav", "GAIN=2", "RESET=60", "RATE=16")


def test_two_calls_print_the_same() -> None:
    words = ("code", "honeywell/udc", "PB=50", "RSET=20", "MINorRPM=RPM")
    assert told(*words) == told(*words)


# --- C, and files ---------------------------------------------------------------------------------------------------------------

_PROVOX = ("fisher/provox", "GAIN=2", "RESET=4", "RATE=0.5")
_MAIN = """
#include <math.h>
#include <stdio.h>
#include "level.h"

int main(void)
{
    level_state state;
    int i;
    level_init(&state);
    for (i = 0; i < 60; i++)
        printf("%.17g\\n", level_step(&level_default, &state, 50.0 + i % 7, 48.0 - 0.1 * i, i > 9, i > 4 ? 30.0 : NAN));
    return 0;
}
"""


def outputs_of(folder: Path, compiler: str | None, *flags: str) -> list[float]:
    """Compile the two files with the program above, which uses the header only, and run it."""
    (folder / "main.c").write_text(_MAIN, encoding="utf-8")
    for file in ("level.c", "main.c"):
        assert refused(*flags, "-O2", "-ffp-contract=off", *WARNINGS, "-c", file, compiler=compiler, folder=folder) == ""
    assert refused("level.o", "main.o", "-o", "main", "-lm", compiler=compiler, folder=folder) == ""
    printed = subprocess.run([folder / "main"], capture_output=True, text=True, check=True).stdout
    return [float(line) for line in printed.splitlines()]


def outputs_of_the_controller() -> list[float]:
    controller = pidemu.Controller(pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.5))
    return [controller.scan(50.0 + i % 7, 48.0 - 0.1 * i, i > 9, 30.0 if i > 4 else None) for i in range(60)]


@needs_compiler
def test_the_two_files_build_with_a_c_program_and_give_the_controllers_outputs(folder: Path) -> None:
    told("code", *_PROVOX, "--lang", "c", "--out", str(folder), "--name", "level")
    assert outputs_of(folder, COMPILER, "-std=c99") == outputs_of_the_controller()


@needs_cpp
def test_they_build_with_a_cpp_program_as_well(folder: Path) -> None:
    told("code", *_PROVOX, "--lang", "c", "--out", str(folder), "--name", "level")
    assert outputs_of(folder, CPP, "-std=c++11", "-x", "c++") == outputs_of_the_controller()


@needs_compiler
def test_c_on_stdout_compiles_on_its_own(folder: Path) -> None:
    (folder / "level.c").write_text(told("code", *_PROVOX, "--lang", "c"), encoding="utf-8")
    assert refused("-std=c99", *WARNINGS, "-c", "level.c", folder=folder) == ""


def test_files_are_called_after_the_card_and_their_paths_printed(folder: Path) -> None:
    where = folder / "new" / "folder"
    assert (
        told("code", *_PROVOX, "--lang", "c", "--out", str(where)) == f"{where / 'fisher_provox.h'}\n{where / 'fisher_provox.c'}\n"
    )
    assert "fisher_provox_step(" in (where / "fisher_provox.h").read_text()
    assert told("code", "iec/61131-3-pid", "KP=1", "TR=8", "--out", str(where)) == f"{where / 'iec_61131_3_pid.py'}\n"
    assert (where / "iec_61131_3_pid.py").read_text() == told("code", "iec/61131-3-pid", "KP=1", "TR=8")


def test_scan_interval_action_and_limits_are_in_the_c(folder: Path) -> None:
    text = told("code", *_PROVOX, "--lang", "c", "--scan", "0.25", "--action", "direct", "--limits", "10,90")
    assert text.splitlines()[1].endswith("; scan 0.25 s, direct acting")
    values = text[text.index("fisher_provox_default = {") :].splitlines()[1:4]
    assert [line.split()[0] for line in values] == ["10.0,", "90.0,", "-2.0,"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--lang c --name 2nd", "error: '2nd' is not a name in C; give letters, digits and single underscores, a letter first\n"),
        (
            "--lang js --name class",
            "error: 'class' is a word of JavaScript or of what is printed; give another name, such as class_control\n",
        ),
        ("--lang c --name double", "error: 'double' is a word of C or C++; give another name, such as double_control\n"),
        ("--lang st --name R", "error: 'R' is a word of Structured Text; give another name, such as R_control\n"),
        ("--lang js --dialect scl", "--dialect is one of Structured Text; give --lang st as well\n"),
        ("--lang c --self-test", "--self-test prints a program for a PLC; give --lang st or plcopen as well\n"),
        ("--lang st --dialect rockwell --self-test", "use --self-test with --dialect iec or scl\n"),
        ("--name level", "--name names the file of a Python module; give --out as well\n"),
        ("--lang c --out taken/inside", "error: taken/inside/fisher_provox.h: cannot be written: Not a directory\n"),
    ],
)
def test_what_cannot_be_printed_is_told(folder: Path, words: str, message: str) -> None:
    (folder / "taken").write_text("", encoding="utf-8")
    found = said("code", *_PROVOX, *words.split())
    assert (found.status, found.out) == (2, "")
    assert found.err.endswith(message)


# --- what the program rests on --------------------------------------------------------------------------------------------------

_RESTS_ON = [
    "Assumed or inferred in the card fisher/provox, and at work here:",
    "- assumed: implementation = positional (not found in anything readable)",
    "- assumed: integral.rule = backward (no scan equation was found)",
    "- assumed: integral.windup.scheme = external-reset "
    "(not found; positive feedback is how series controllers of that descent work)",
    "- assumed: transfer.start = bumpless (not found)",
    "- assumed: scan.default = 1 s (not found)",
    "- assumed: output.limits = 0 to 100 (not found)",
]
_HOSTILE = r'"*/ } int x; /* (* ??/ \\ \\N{DEL} \"\"\" # coding: nonsense *) \""'
"""As YAML writes it, between quotation marks."""


@pytest.mark.parametrize(("lang", "first", "mark"), [("python", 3, ""), ("c", 3, " * ")])
def test_the_head_names_what_the_card_assumes_of_the_program_a_line_each(lang: str, first: int, mark: str) -> None:
    lines = told("code", "fisher/provox", "GAIN=2", "RESET=4", "--lang", lang).splitlines()
    assert lines[first : first + len(_RESTS_ON) + 1] == [
        *(mark + line for line in _RESTS_ON),
        '"""' if lang == "python" else " *",
    ]


def test_both_c_files_name_it(folder: Path) -> None:
    told("code", "fisher/provox", "GAIN=2", "RESET=4", "--lang", "c", "--out", ".", "--name", "level")
    for file in ("level.h", "level.c"):
        assert f" * {_RESTS_ON[2]}\n" in (folder / file).read_text()


def test_what_is_given_is_not_the_cards_assumption() -> None:
    text = told("code", "fisher/provox", "GAIN=2", "RESET=4", "--scan", "1", "--limits", "0,100")
    assert "scan.default" not in text
    assert "output.limits" not in text


def test_a_card_of_which_everything_is_stated_says_so() -> None:
    assert "\nEvery field of the card arduino/pid that makes this program is documented or measured.\n" in told(
        "code", "arduino/pid", "Kp=2", "Ki=1", "Kd=0", "--scan", "0.1", "--limits", "0,255"
    )


def test_no_text_of_a_card_gets_out_of_a_comment(folder: Path) -> None:
    hostile = VALID.replace("note: not stated", f"note: {_HOSTILE}").replace("      PID: {}", f"      {_HOSTILE}: {{}}")
    hostile = hostile.replace("default: PID", f"default: {_HOSTILE}")
    card = str(written(folder, hostile))
    settings = pidemu.load_card(card).settings(GAIN=2, RESET=60)
    controller = pidemu.Controller(settings)
    words = (card, "GAIN=2", "RESET=60")
    scans = signals(0, 100)
    told("code", *words, "--out", ".", "--name", "level")
    assert "- assumed: transfer.start = bumpless ( * / } int x; / * ( * ? ?/ " in (folder / "level.py").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    exec(compile((folder / "level.py").read_bytes(), "level.py", "exec"), names)  # bytes: a declared encoding would count
    assert run_scan_by_scan(names, scans) == [controller.scan(*s) for s in scans]
    told("code", *words, "--lang", "c", "--out", ".", "--name", "level")
    if COMPILER is not None:
        assert refused("-std=c99", *WARNINGS, "-c", "level.c", folder=folder) == ""


# --- JavaScript -----------------------------------------------------------------------------------------------------------------


@needs_node
def test_the_javascript_file_gives_the_controllers_outputs_in_node(folder: Path) -> None:
    assert told("code", *_PROVOX, "--lang", "js", "--out", ".", "--name", "level") == "level.js\n"
    text = """
        const level = require("./level.js"), state = level.initial(), outputs = [];
        for (let i = 0; i < 60; i++) outputs.push(level.scan(state, 50 + i % 7, 48 - 0.1 * i, i > 9, i > 4 ? 30 : NaN));
        console.log(JSON.stringify(outputs));
    """
    assert json.loads(evaluated(text, folder)) == outputs_of_the_controller()


def test_javascript_on_stdout_is_what_the_file_holds_and_names_what_it_rests_on(folder: Path) -> None:
    told("code", *_PROVOX, "--lang", "js", "--out", ".")
    text = told("code", *_PROVOX, "--lang", "js")
    assert (folder / "fisher_provox.js").read_text() == text
    assert text.splitlines()[3:5] == [f"// {line}" for line in _RESTS_ON[:2]]


# --- Structured Text ------------------------------------------------------------------------------------------------------------


def says_ok(text: str, name: str) -> bool:
    """Run the self-test that a text holds, and return what it says."""
    block = read(text)[f"{name}_test"]
    while not block["done"]:
        block()
    return bool(block["ok"])


@pytest.mark.parametrize("dialect", ["iec", "scl"])
@pytest.mark.parametrize("signals", [(), ("cascade", "track", "external_reset")])
def test_the_printed_self_test_plays_the_vectors_and_says_ok(dialect: str, signals: tuple[str, ...]) -> None:
    asked = [word for signal in signals for word in ("--signal", signal)]
    text = told("code", *_PROVOX, "--lang", "st", "--dialect", dialect, "--self-test", "--name", "level", *asked)
    assert says_ok(text, "level")
    assert ("CASCADE_GIVEN" in text) is bool(signals)
    assert not says_ok(text.replace("out := high", "out := low").replace("#out := #high", "#out := #low"), "level")


def test_structured_text_names_what_it_rests_on_and_that_it_was_not_run_on_a_controller() -> None:
    for dialect in ("iec", "scl", "rockwell"):
        text = told("code", *_PROVOX, "--lang", "st", "--dialect", dialect)
        assert text.splitlines()[4:6] == [f"  {line}" for line in _RESTS_ON[:2]]
        assert "\n  Not run on a controller. " in text


def test_files_of_structured_text_are_named_after_their_dialect(folder: Path) -> None:
    assert told("code", *_PROVOX, "--lang", "st", "--out", ".") == "fisher_provox.st\n"
    assert told("code", *_PROVOX, "--lang", "st", "--dialect", "scl", "--out", ".") == "fisher_provox.scl\n"
    assert told("code", *_PROVOX, "--lang", "plcopen", "--out", ".") == "fisher_provox.xml\n"
    ElementTree.fromstring((folder / "fisher_provox.xml").read_text(encoding="utf-8"))


def test_the_same_from_python() -> None:
    settings = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.5)
    for lang in ("python", "c", "js", "st", "plcopen"):
        assert pidemu.code(settings, lang).text == told("code", *_PROVOX, "--lang", lang)
    assert [*pidemu.code(settings, "c", name="level").files] == ["level.h", "level.c"]
    with pytest.raises(EngineError, match="no language 'cobol'; languages: python, c, js, st, plcopen"):
        pidemu.code(settings, "cobol")  # type: ignore[arg-type]


@pytest.mark.parametrize("lang", ["python", "c", "js", "st", "plcopen"])
def test_signals_that_are_asked_for_are_read_and_others_refused(lang: str) -> None:
    assert "cascade" in told("code", *_PROVOX, "--lang", lang, "--signal", "cascade").casefold()
    found = said("code", *_PROVOX, "--lang", lang, "--signal", "feedforward")
    assert (found.status, found.err) == (2, "error: fisher/provox states no feedforward input; leave the signal out\n")
