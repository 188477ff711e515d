"""A function block in Structured Text as PLCopen XML (TC6, version 2.01), which development systems import."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Final
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from pidemu.backends.comments import comment_text
from pidemu.backends.structured_text import about
from pidemu.backends.structured_text_block import PrintedDial, Variable, block_of
from pidemu.backends.structured_text_names import check_name
from pidemu.backends.structured_text_self_test import SelfTest, self_test_block
from pidemu.program.ir import Program

NAMESPACE: Final = "http://www.plcopen.org/xml/tc6_0201"
XHTML: Final = "http://www.w3.org/1999/xhtml"
_CREATED: Final = "2000-01-01T00:00:00"
"""The format asks for a date; one that is always the same prints the same file."""
_GROUPS: Final = {"input": "inputVars", "output": "outputVars", "setting": "localVars", "coefficient": "localVars"}


def source(
    program: Program, name: str, dials: Sequence[PrintedDial] = (), notes: Sequence[str] = (), *, test: SelfTest | None = None
) -> str:
    """Return the project file of a function block.

    Parameters
    ----------
    program, name, dials, notes, test
        As in `pidemu.backends.structured_text.source`.

    Raises
    ------
    EngineError
        The name cannot be a block's.
    """
    check_name(name)
    block = block_of(program, name, dials, "iec")
    root = Element("project", {"xmlns": NAMESPACE, "xmlns:xhtml": XHTML})
    head = {"companyName": "pidemu", "productName": "pidemu", "productVersion": "1", "creationDateTime": _CREATED}
    SubElement(root, "fileHeader", head)
    coordinates = SubElement(SubElement(root, "contentHeader", {"name": name}), "coordinateInfo")
    for language in ("fbd", "ld", "sfc"):
        SubElement(SubElement(coordinates, language), "scaling", {"x": "1", "y": "1"})
    types = SubElement(root, "types")
    SubElement(types, "dataTypes")
    units = SubElement(types, "pous")
    _unit(units, name, "functionBlock", block.variables, block.statements, about(block, notes))
    if test is not None:
        other = self_test_block(block, test, "iec")
        _unit(units, other.name, "program", other.variables, other.statements, other.about)
    SubElement(SubElement(root, "instances"), "configurations")
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _unit(
    parent: Element, name: str, kind: str, variables: Sequence[Variable], statements: Iterable[str], told: Iterable[str]
) -> None:
    unit = SubElement(parent, "pou", {"name": name, "pouType": kind})
    interface = SubElement(unit, "interface")
    for group, members in groupby(variables, lambda v: v.group):
        constant = {"constant": "true"} if group in ("setting", "coefficient") else {}
        listed = SubElement(interface, _GROUPS.get(group, "localVars"), constant)
        for v in members:
            _variable(listed, v)
    _formatted(SubElement(SubElement(unit, "body"), "ST"), statements)
    _formatted(SubElement(unit, "documentation"), told)


def _variable(parent: Element, v: Variable) -> None:
    variable = SubElement(parent, "variable", {"name": v.name})
    kind = SubElement(variable, "type")
    if v.length:
        array = SubElement(kind, "array")
        SubElement(array, "dimension", {"lower": "0", "upper": str(v.length - 1)})
        kind = SubElement(array, "baseType")
    if v.type in ("BOOL", "INT", "LINT", "REAL", "LREAL"):
        SubElement(kind, v.type)
    else:
        SubElement(kind, "derived", {"name": v.type})
    if v.initial.startswith("["):
        values = SubElement(SubElement(variable, "initialValue"), "arrayValue")
        for text in v.initial[1:-1].split(", "):
            SubElement(SubElement(values, "value"), "simpleValue", {"value": text})
    elif v.initial and not v.length:
        SubElement(SubElement(variable, "initialValue"), "simpleValue", {"value": v.initial})
    if v.text:
        _formatted(SubElement(variable, "documentation"), [comment_text(v.text)])


def _formatted(parent: Element, lines: Iterable[str]) -> None:
    SubElement(parent, "xhtml:p").text = "\n".join(lines)
