"""A program that plays a record to a function block within the controller, and says whether all outputs are as they should be."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from pidemu.backends.structured_text_block import FunctionBlock, Variable
from pidemu.backends.structured_text_expressions import TYPES, Dialect, literal
from pidemu.backends.structured_text_names import given_flag
from pidemu.errors import EngineError
from pidemu.program.ir import Precision

_ABOUT: Final = """\
Test of {block}: one scan per call. When done is TRUE, ok says whether every output was the expected one;
otherwise wrong_scan is the first that was not (counted from 0), and wrong_output what the block gave there."""
_PREFIX: Final = "TEST_"


@dataclass(frozen=True)
class SelfTest:
    """A record whose outputs are known.

    Attributes
    ----------
    signals : mapping
        A sequence of numbers by input of the program; NaN where there is no signal.
    outputs : sequence of float
        The outputs.
    """

    signals: Mapping[str, Sequence[float]]
    outputs: Sequence[float]


@dataclass(frozen=True)
class TesterBlock:
    """The program: its name, what it is, its variables and statements."""

    name: str
    about: tuple[str, ...]
    variables: tuple[Variable, ...]
    statements: tuple[str, ...]


def self_test_block(block: FunctionBlock, test: SelfTest, dialect: Dialect) -> TesterBlock:
    """Return the program that tests a block.

    Parameters
    ----------
    block : FunctionBlock
        The block.
    test : SelfTest
        The record.
    dialect : {"iec", "scl", "rockwell"}
        For whom.

    Raises
    ------
    EngineError
        In the dialect tags cannot be given a record.
    """
    if dialect == "rockwell":
        raise EngineError("a routine of Rockwell cannot hold a record; use --self-test with --dialect iec or scl")
    hash_ = "#" if dialect == "scl" else ""
    columns = dict(_columns(block, test))
    arguments = ", ".join(f"{name} := {hash_}{_PREFIX}{name}[{hash_}n]" for name in columns)
    expected = f"{hash_}{_PREFIX}OP[{hash_}n]"
    last = len(test.outputs) - 1
    output = f"{hash_}block.{block.names[block.program.output]}"
    precision: Precision = "float64" if block.program.is_wide(block.program.output) else "float32"
    kind = TYPES[precision]
    state = (
        Variable("state", "block", f'"{block.name}"' if dialect == "scl" else block.name, "", "what is tested"),
        Variable("state", "n", "INT", "0", "the next scan"),
        Variable("state", "done", "BOOL", "FALSE", "all scans have been played"),
        Variable("state", "ok", "BOOL", "FALSE", "and every output was the expected one"),
        Variable("state", "wrong_scan", "INT", "-1", "the first scan whose output was not"),
        Variable("state", "wrong_output", kind, "0.0", "what it was"),
    )
    arrays = tuple(_array(name, kind_, values) for name, (kind_, values) in columns.items())
    outputs = _array(block.names[block.program.output], kind, [literal(x, precision) for x in test.outputs])
    statements = f"""\
IF NOT {hash_}done THEN
    {hash_}block({arguments});
    IF ({output} <> {expected}) AND ({hash_}wrong_scan < 0) THEN
        {hash_}wrong_scan := {hash_}n;
        {hash_}wrong_output := {output};
    END_IF;
    {hash_}done := ({hash_}n = {last});
    {hash_}ok := {hash_}done AND ({hash_}wrong_scan < 0);
    {hash_}n := {hash_}n + 1;
END_IF;"""
    told = tuple(_ABOUT.format(block=block.name).splitlines())
    return TesterBlock(f"{block.name}_TEST", told, (*state, *arrays, outputs), tuple(statements.splitlines()))


def _columns(block: FunctionBlock, test: SelfTest) -> Iterator[tuple[str, tuple[str, list[str]]]]:
    for q in block.program.inputs:
        values = test.signals[q.name]
        precision: Precision = "float64" if block.program.is_wide(q.name) else "float32"
        if q.name == "auto":
            yield block.names[q.name], ("BOOL", ["TRUE" if x > 0 else "FALSE" for x in values])
            continue
        yield block.names[q.name], (TYPES[precision], [literal(0.0 if math.isnan(x) else x, precision) for x in values])
        if block.flagged(q.name):
            yield block.names[given_flag(q.name)], ("BOOL", ["FALSE" if math.isnan(x) else "TRUE" for x in values])


def _array(name: str, kind: str, values: Sequence[str]) -> Variable:
    return Variable("state", f"{_PREFIX}{name}", kind, f"[{', '.join(values)}]", "", len(values))
