"""Printed Structured Text, read by an evaluator of its own, gives the numbers of plain Python."""

from __future__ import annotations

import re
import subprocess
import sys
from collections import deque
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.backends import structured_text_plcopen as plcopen
from pidemu.backends.python import compiled, starting
from pidemu.backends.structured_text import source
from pidemu.backends.structured_text_block import PrintedDial, dials
from pidemu.backends.structured_text_expressions import DIALECTS, Dialect, lifted
from pidemu.backends.structured_text_names import RESERVED
from pidemu.backends.structured_text_self_test import SelfTest
from pidemu.card.library import card_files
from pidemu.errors import EngineError
from pidemu.program.ir import Assign, Line, Name, Number, Program, Quantity, Select
from tests.backends.matiec import needs_matiec, play_test
from tests.backends.records import CARDS, modes, programs_of, record, settings_of
from tests.backends.structured_text import Instance, is_there, read, read_rockwell, tokens_of
from tests.backends.texts import programs, retold
from tests.helpers import Floats
from tests.hostile import hostile_text

MIXED = "iec/61131-3-pid"
"""Computes partly in LREAL, partly in REAL."""


def outputs_of(block: Instance, program: Program, signals: list[Floats]) -> list[float]:
    """Call a block once per sample; a signal that is NaN is not given."""
    inputs = block.unit.sections
    found = []
    for sample in zip(*(s.tolist() for s in signals), strict=True):
        now: dict[str, Any] = {}
        for q, x in zip(program.inputs, sample, strict=True):
            name = q.name.upper()
            now[name] = x > 0 if name == "AUTO" else x
            if f"{name}_given".casefold() in inputs:
                now[f"{name}_GIVEN"], now[name] = is_there(x), x if is_there(x) else 0.0
        block(**now)
        found.append(float(block["OP"]))
    return found


def in_python(program: Program, signals: list[Floats]) -> list[float]:
    with np.errstate(all="ignore"):
        return [float(x) for x in compiled(program).run(list(starting(program)), *(s.tolist() for s in signals))]


def block_of(program: Program, dialect: Any) -> Instance:
    text = source(
        program, "control", [PrintedDial("Kp", 1.0, "-"), PrintedDial("INT", 2.0, "s"), PrintedDial("N", 3.0, "-")], dialect=dialect
    )
    return read_rockwell(text) if dialect == "rockwell" else read(text)["control"]


@pytest.mark.parametrize(("card_id", "dialect"), [(c, d) for c in card_files() for d in DIALECTS if (c, d) != (MIXED, "rockwell")])
def test_every_card_gives_the_numbers_of_python(card_id: str, dialect: str) -> None:
    chosen = settings_of(card_id)
    program = pidemu.Controller(chosen).program
    columns = {name: column[:300] for name, column in record(chosen, 1, bad=False).items()}
    signals = [np.asarray(columns[q.name], dtype=float) for q in program.inputs]
    expected = in_python(program, signals)
    assert len(set(expected)) > 10
    assert outputs_of(block_of(program, dialect), program, signals) == expected


@pytest.mark.parametrize("card_id", CARDS)
def test_every_choice_of_options_with_all_signals_gives_the_numbers_of_python(card_id: str) -> None:
    for seed, program in enumerate(programs_of(card_id)):
        signals = modes(program, seed)
        assert outputs_of(block_of(program, "iec"), program, signals) == in_python(program, signals), program.title


def test_a_delay_line_and_a_name_of_the_language_give_the_numbers_of_python() -> None:
    sp, y, u, kp = (Quantity(name, name, "%") for name in ("sp", "y", "u", "kp"))
    body = (
        Assign("limit", Select(Name("sp") > 3.0, Number(0.0), Name("late")), "delayed"),
        Assign("u", Name("kp") * (Name("sp") - Name("limit")), "controller"),
        Assign("y", Name("y") + (Name("u") - Name("y")) * 0.1, "process"),
    )
    late = Line("late", "delayed", "%", "y")
    program = Program("loop", (sp,), (kp,), (2.0,), (y, u), (0.0, 0.0), body, lines=(late,), lengths=(3,))
    signals = [np.linspace(0, 5, 50)]
    state: list[Any] = [*starting(program), deque([0.0] * 3)]
    expected = [float(x) for x in compiled(program).run(state, signals[0].tolist())]
    for dialect in DIALECTS:
        assert outputs_of(block_of(program, dialect), program, signals) == expected


@pytest.mark.parametrize("card_id", ["fisher/provox", "toshiba/pid3", "oscat/ft-pid"])
def test_no_choice_of_a_program_is_computed_with(card_id: str) -> None:
    program = pidemu.Controller(settings_of(card_id)).program
    for assign in program.body:
        x = lifted(assign.value)
        while isinstance(x, Select):
            assert not isinstance(x.condition, Select)
            x = x.no
        assert "Select" not in repr(x)


def test_what_rockwell_cannot_mix_is_refused() -> None:
    program = pidemu.Controller(settings_of(MIXED)).program
    with pytest.raises(EngineError) as refused:
        source(program, "control", dialect="rockwell")
    assert "computes partly in LREAL, partly in REAL" in str(refused.value)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("2nd", "'2nd' is not a name in Structured Text; give letters, digits and single underscores, a letter first"),
        ("a__b", "'a__b' is not a name in Structured Text; give letters, digits and single underscores, a letter first"),
        ("a_", "'a_' is not a name in Structured Text; give letters, digits and single underscores, a letter first"),
        ("Limit", "'Limit' is a word of Structured Text; give another name, such as Limit_control"),
    ],
)
def test_a_name_that_is_none_in_structured_text_is_refused(name: str, message: str) -> None:
    with pytest.raises(EngineError) as refused:
        source(programs()[0], name)
    assert str(refused.value) == message


def test_a_vendors_names_stay_where_the_language_has_them_and_the_head_says_where_not() -> None:
    dials = [PrintedDial(n, 1.0, "s") for n in ("KP", "INT", "N", "P/I", "_Td_", "T  2", "SP", "3rd", "kP_2")]
    text = source(programs()[0], "control", dials)
    told = re.findall(r"The setting (.*) is called (\w+): the language has no such name\.", text)
    expected = [("INT", "INT_2"), ("N", "N_2"), ("P/I", "P_I"), ("_Td_", "Td"), ("T 2", "T_2"), ("SP", "SP_2"), ("3rd", "X_3rd")]
    assert told == expected
    names = [*read(text)["control"].unit.variables]
    assert {"kp", "int_2", "n_2", "p_i", "td", "t_2", "sp_2", "x_3rd", "kp_2"} <= {*names}
    assert all(re.fullmatch(r"[a-z](_?[a-z0-9])*", name) and name not in RESERVED for name in names)


@settings(max_examples=40, deadline=None)
@given(which=st.integers(0, 2), text=hostile_text, notes=st.lists(hostile_text, max_size=2))
@example(which=0, text="*) x := 1; (*", notes=["]]> </xhtml:p> \x00 \ud800"])
def test_whatever_the_texts_the_code_is_the_same(which: int, text: str, notes: list[str]) -> None:
    program = programs()[which]
    for dialect in ("iec", "scl"):
        plain = source(program, "control", dialect=dialect)
        printed = source(retold(program, text), "control", [], notes, dialect=dialect)
        printed.encode()
        assert tokens_of(plain) == tokens_of(printed)
    variables, body = pou(plcopen.source(retold(program, text), "control", [], notes), "control")
    assert tokens_of(body) == tokens_of(pou(plcopen.source(program, "control"), "control")[1])
    assert [v[:3] for v in variables] == [v[:3] for v in pou(plcopen.source(program, "control"), "control")[0]]


# --- PLCopen XML ----------------------------------------------------------------------------------------------------------------

_TC6 = {"p": plcopen.NAMESPACE, "x": plcopen.XHTML}


def pou(text: str, name: str) -> tuple[list[tuple[str, str, str, str, int]], str]:
    """Return the variables of a unit (section, name, type, initial value, length), and its body."""
    root = ElementTree.fromstring(text)
    (unit,) = root.findall(f"p:types/p:pous/p:pou[@name='{name}']", _TC6)
    found = []
    for section in unit.find("p:interface", _TC6) or ():
        for v in section:
            kind = v.find("p:type/p:array/p:baseType/*", _TC6)
            kind = v.find("p:type/*", _TC6) if kind is None else kind
            assert kind is not None
            upper = v.find("p:type/p:array/p:dimension", _TC6)
            value = v.find("p:initialValue/p:simpleValue", _TC6)
            listed = v.findall("p:initialValue/p:arrayValue/p:value/p:simpleValue", _TC6)
            initial = (
                value.get("value", "")
                if value is not None
                else f"[{', '.join(x.get('value', '') for x in listed)}]"
                if listed
                else ""
            )
            length = 0 if upper is None else int(upper.get("upper", "")) + 1
            tag = kind.get("name") or kind.tag.partition("}")[2]
            found.append((section.tag.partition("}")[2] + section.get("constant", ""), v.get("name", ""), tag, initial, length))
    body = unit.find("p:body/p:ST/x:p", _TC6)
    assert body is not None
    return found, body.text or ""


def as_text(xml: str, name: str, kind: str) -> str:
    """Return a unit of a PLCopen file as Structured Text, for the evaluator."""
    variables, body = pou(xml, name)
    words = {"inputVars": "VAR_INPUT", "outputVars": "VAR_OUTPUT", "localVars": "VAR", "localVarstrue": "VAR CONSTANT"}
    declared = []
    for section, n, type_, initial, length in variables:
        array = f"ARRAY[0..{length - 1}] OF " if length else ""
        value = f" := {initial}" if initial else ""
        declared.append(f"{words[section]} {n} : {array}{type_}{value}; END_VAR")
    return "\n".join([f"{kind} {name}", *declared, body, f"END_{kind}", ""])


@pytest.mark.parametrize("card_id", ["fisher/provox", "toshiba/pid3", "iec/61131-3-pid"])
def test_the_plcopen_file_holds_the_block_and_its_test(card_id: str) -> None:
    chosen = settings_of(card_id)
    program = pidemu.Controller(chosen).program
    test = short_test(card_id)
    xml = plcopen.source(program, "control", dials(chosen), test=test)
    text = as_text(xml, "control", "FUNCTION_BLOCK") + as_text(xml, "control_TEST", "PROGRAM")
    assert played(read(text)["control_test"], len(test.outputs)) == (True, True, -1)


# --- the test within the controller ---------------------------------------------------------------------------------------------


def short_test(card_id: str, scans: int = 80) -> SelfTest:
    chosen = settings_of(card_id)
    program = pidemu.Controller(chosen).program
    columns = {name: column[:scans].tolist() for name, column in record(chosen, 1, bad=False).items()}
    outputs = in_python(program, [np.array(columns[q.name]) for q in program.inputs])
    return SelfTest({q.name: columns[q.name] for q in program.inputs}, outputs)


def played(block: Instance, scans: int) -> tuple[bool, bool, int]:
    """Call the test until it is done, and twice more."""
    for n in range(scans + 2):
        assert block["done"] is (n >= scans)
        block()
    return block["done"], block["ok"], block["wrong_scan"]


@pytest.mark.parametrize("dialect", ["iec", "scl"])
@pytest.mark.parametrize("card_id", CARDS)
def test_the_test_within_the_controller_says_that_all_is_well(card_id: str, dialect: Dialect) -> None:
    program, test = pidemu.Controller(settings_of(card_id)).program, short_test(card_id)
    text = source(program, "control", dialect=dialect, test=test)
    assert played(read(text)["control_test"], 80) == (True, True, -1)


def test_the_test_within_the_controller_finds_a_block_that_was_changed() -> None:
    program, test = pidemu.Controller(settings_of("fisher/provox")).program, short_test("fisher/provox")
    text = source(program, "control", test=test)
    changed = text.replace("out := low;", "out := low + 1.0;")
    assert changed != text
    block = read(changed)["control_test"]
    assert played(block, 80)[:2] == (True, False)
    first = block["wrong_scan"]
    assert block["wrong_output"] != test.outputs[first]
    one_off = source(program, "control", test=SelfTest(test.signals, [*test.outputs[:-1], test.outputs[-1] + 1e-9]))
    assert played(read(one_off)["control_test"], 80) == (True, False, 79)


def test_rockwell_has_no_test_of_its_own() -> None:
    with pytest.raises(EngineError, match="cannot hold a record"):
        source(programs()[0], "control", dialect="rockwell", test=SelfTest({}, []))


# --- readers that others wrote --------------------------------------------------------------------------------------------------

_BLARK = """
import sys, blark
print([blark.parse_source_code(open(file, encoding="utf-8").read()).exception is None for file in sys.argv[1:]])
"""


@pytest.mark.skipif(find_spec("blark") is None, reason="blark is not installed")
def test_blark_reads_blocks_and_their_test(tmp_path: Path) -> None:
    chosen = ["fisher/provox", "toshiba/pid3", "iec/61131-3-pid", "oscat/ft-pidwl", "yokogawa/fieldbus-pid"]
    files: list[Path] = []
    for card_id in chosen:
        test = short_test(card_id, 3) if card_id == chosen[0] else None
        files.append(tmp_path / f"{len(files)}.st")
        printed = pidemu.Controller(settings_of(card_id))
        files[-1].write_text(source(printed.program, "control", dials(printed.settings), ["a note"], test=test), encoding="utf-8")
    wrong = tmp_path / "wrong.st"
    wrong.write_text(files[0].read_text(encoding="utf-8").replace("END_IF;", "END_IF THEN;", 1), encoding="utf-8")
    words = [sys.executable, "-c", _BLARK, *map(str, [*files, wrong])]
    told = subprocess.run(words, capture_output=True, text=True, timeout=300, check=True).stdout
    assert told == f"{[*([True] * len(files)), False]}\n"


@needs_matiec
@pytest.mark.parametrize("card_id", CARDS)
def test_matiec_compiles_the_block_and_its_test_says_ok(card_id: str, tmp_path: Path) -> None:
    chosen = settings_of(card_id)
    program = pidemu.Controller(chosen).program
    text = source(program, "control", dials(chosen), ["a note"], test=short_test(card_id))
    assert play_test(tmp_path, text) == "1 -1"
