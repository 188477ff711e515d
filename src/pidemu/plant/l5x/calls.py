"""Calls of instructions in ladder rungs, structured text and function block sheets."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from pidemu.plant.l5x.tree import L5xElement

_CONDITIONS: Final = frozenset(
    [
        "XIC",
        "XIO",
        "ONS",
        "OSR",
        "OSF",
        "AFI",
        "EQU",
        "NEQ",
        "LES",
        "LEQ",
        "GRT",
        "GEQ",
        "LIM",
        "MEQ",
        "CMP",
        "EQ",
        "NE",
        "LT",
        "LE",
        "GT",
        "GE",
        "LIMIT",
        "ISINF",
        "ISNAN",
    ]
)
"""Instructions that can keep what follows on the rung from being executed."""
_NAME: Final = re.compile(r"[A-Za-z_]\w*")
_COMMENT: Final = re.compile(r"//[^\n]*|\(\*.*?\*\)|/\*.*?\*/", re.DOTALL)
_WORD: Final = re.compile(r"\b(if|case|for|while|repeat|end_if|end_case|end_for|end_while|end_repeat)\b|([A-Za-z_]\w*)\s*\(", re.I)


@dataclass(frozen=True, slots=True)
class Call:
    """A call of an instruction.

    Attributes
    ----------
    name : str
        The instruction.
    operands : tuple of str
        What it is called with.
    place : str
        Where: ``rung 3``, ``line 1``; empty on a sheet.
    conditional : bool
        Whether something before it decides if it is executed.
    """

    name: str
    operands: tuple[str, ...]
    place: str = ""
    conditional: bool = False


def calls_of(routine: L5xElement) -> list[Call]:
    """Return the calls of a routine, whatever its language."""
    found: list[Call] = []
    for rung in routine.all("RLLContent", "Rung"):
        text = "".join(t.text for t in rung.all("Text"))
        if rung.get("Type", "N") not in ("D", "rD"):  # those that an edit takes away
            found += _in_rung(text, f"rung {rung.get('Number')}")
    found += _in_text(routine)
    found += _on_sheets(routine)
    return found


def _in_rung(text: str, place: str) -> Iterator[Call]:
    """Yield the calls of a rung; a branch begins with the condition before it."""
    conditional = False
    stack: list[tuple[bool, bool]] = []
    at = 0
    while at < len(text):
        c = text[at]
        if c == "[":
            stack.append((conditional, False))
        elif c == "," and stack:
            start, ends = stack[-1]
            stack[-1] = (start, ends or conditional)
            conditional = start
        elif c == "]" and stack:
            conditional = stack.pop()[1] or conditional
        match = _NAME.match(text, at)
        if match is None:
            at += 1
            continue
        at = match.end()
        if at < len(text) and text[at] == "(":
            operands, at = _operands(text, at)
            yield Call(match[0], operands, place, conditional)
            conditional = conditional or match[0].upper() in _CONDITIONS


def _operands(text: str, at: int) -> tuple[tuple[str, ...], int]:
    """Return what stands between the parentheses that open here, and where they end."""
    depth, start, found = 0, at + 1, []
    for i in range(at, len(text)):
        c = text[i]
        if c in "([":
            depth += 1
        elif c in ")]":
            depth -= 1
            if not depth:
                found.append(text[start:i].strip())
                return tuple(found), i + 1
        elif c == "," and depth == 1:
            found.append(text[start:i].strip())
            start = i + 1
    return tuple(found), len(text)


def _in_text(routine: L5xElement) -> Iterator[Call]:
    """Yield the calls of structured text; within IF, CASE or a loop they are conditional."""
    lines = [(line.get("Number"), line.text) for line in routine.all("STContent", "Line")]
    if not lines:
        return
    text = "\n".join(t.replace("\n", " ") for _, t in lines)
    text = _COMMENT.sub(lambda m: re.sub(r"[^\n]", " ", m[0]), text)
    depth = 0
    for match in _WORD.finditer(text):
        if match[1]:
            depth = max(0, depth + (-1 if match[1].lower().startswith("end_") else 1))
            continue
        operands, _ = _operands(text, match.end() - 1)
        number = lines[text.count("\n", 0, match.start())][0]
        yield Call(match[2], operands, f"line {number}", depth > 0)


def _on_sheets(routine: L5xElement) -> Iterator[Call]:
    for sheet in routine.all("FBDContent", "Sheet"):
        for block in sheet.children:
            if block.name == "Block":
                yield Call(block.get("Type"), (block.get("Operand"),))
            elif block.name == "AddOnInstruction":
                parameters = [p.get("Argument") for p in block.all("InOutParameter")]
                yield Call(block.get("Name"), (block.get("Operand"), *parameters), "sheet")
            elif block.name == "JSR":
                yield Call("JSR", (block.get("Routine"),))
