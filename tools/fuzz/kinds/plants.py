"""Loop lists of plants and Rockwell exports, with mapping, rules and decisions, as ``pidemu retrofit`` reads them."""

from __future__ import annotations

import json
from random import Random
from typing import Final

from tools.fuzz.case import Case, Kind, Said
from tools.fuzz.checks import rows_match
from tools.fuzz.mutate import mutated_bytes, mutated_yaml
from tools.fuzz.vocabulary import anything, number, text

_HEADER: Final = (
    "Tag;System;P;unit;I;unit;D;unit;PV filter [s];Form;Equation;LRV;URV;EU;New LRV;New URV;Re-ranged?;OP lo;OP hi;Act.;Mode;"
    "Update [s];Scan [s];Options;Remarks"
)
_LOOPS: Final = (
    "TIC-1;fisher/provox;3,8;gain;0,4;R/MIN;0,68;MIN;;;;-20;80;degC;;;;0;100;R;AUTO;;1;;",
    "FIC-2;foxboro/ia-pid;167;PB;0,22 min;;;;2;PI;;0;45;m3/h;0;36;Y;0;100;REV;AUTO;;1;;",
    "TIC-3;honeywell/tdc3000;3;gain;5,5;min/rep;0,51;min;;ideal;EQC;0;250;degC;;;;0;100;D;AUTO;;1;;",
    "PIC-4;honeywell/udc;38,5 %;PB;0,7;MIN;0,1;min;;;PID A;0;250;kPa;;;;10;90;R;MAN;;1;;",
    "LIC-5;bailey/fc19;1,04;eu/eu;2,13;1/min;0;;;K=1;;0;45;m;;;;0;100;R;AUTO;;1;;",
    "PIC-6;allen-bradley/plc5;1,3;;0,012;;;;;independent;PV;0;4095;degC;-20;80;N;0;100;R;AUTO;1;1;;",
)
_MAP: Final = (
    "systems: {fisher/provox: [X]}\nwords: {reverse: [R], form: {ideal: [NI]}}\nblank-units: card\ncolumns: {'*': {Tag: tag}}\n"
)
_RULES: Final = (
    "target: emerson/deltav\noptions: {FORM: Standard, STRUCTURE: match-source}\nby-type: {TIC: {digits: 3}}\n"
    "levels: {F-manual: decision}\n"
)
_DECISIONS: Final = "tag,rule,answer,name\nTIC-1,D-unit,repeat/min,A\nLIC-5,D-range,0..45 m,B\nPIC-4,D-refused,nearest,C\n"
_PID: Final = "[0,5e+001,6e-001,3e-002," + ",".join(["0.0"] * 25) + ",[" + ",".join(["0.0"] * 17) + "]]"
_MEMBERS: Final = "".join(
    f'<DataValueMember Name="{name}" DataType="REAL" Radix="Float" Value="{value}"/>\n'
    for name, value in {
        "CTL": "0",
        "PE": "0",
        "KP": "2.0",
        "KI": "0.05",
        "KD": "1.0",
        "MAXS": "100.0",
        "MINS": "0.0",
        "UPD": "0.5",
    }.items()
)
_EXPORT: Final = f"""<?xml version="1.0" encoding="UTF-8"?>
<RSLogix5000Content TargetType="Controller" ExportDate="Mon Mar 02 08:15:00 2026">
<Controller Name="C">
<Tags>
<Tag Name="A" TagType="Base" DataType="PID"><Data Format="Decorated"><Structure DataType="PID">
{_MEMBERS}</Structure></Data></Tag>
<Tag Name="B" TagType="Base" DataType="PID" Dimensions="1"><Data Format="L5K"><![CDATA[[{_PID}]]]></Data></Tag>
<Tag Name="Z" TagType="Alias" AliasFor="A"/>
</Tags>
<Programs><Program Name="P" MainRoutineName="M"><Routines><Routine Name="M" Type="RLL"><RLLContent>
<Rung Number="0" Type="N"><Text>[XIC(T.DN) PID(Z,0,0,0,0,0,0) ,PID(B[0],0,0,0,A,0,0) ];</Text></Rung>
</RLLContent></Routine></Routines></Program></Programs>
<Tasks><Task Name="T" Type="PERIODIC" Rate="500"><ScheduledPrograms><ScheduledProgram Name="P"/></ScheduledPrograms></Task></Tasks>
</Controller>
</RSLogix5000Content>
"""


def make(rng: Random) -> Case:
    """Return a list or an export with some changes, and perhaps files of the plant with some."""
    export = rng.random() < 0.4
    name = "plant.L5X" if export else "plant.csv"
    content = mutated_yaml(rng, _EXPORT, (_EXPORT,)) if export else _list(rng)
    if rng.random() < 0.3:
        content = mutated_bytes(rng, content)
    words, files = ["retrofit", name], {name: content}
    for option, other, source, often in (
        ("--map", "map.yaml", _MAP, 0.3), ("--rules", "rules.yaml", _RULES, 0.3), ("--decisions", "decisions.csv", _DECISIONS, 0.2),
    ):  # fmt: skip
        if rng.random() < often:
            words += [option, other]
            files[other] = mutated_yaml(rng, source, (source,))
    if rng.random() < 0.1:
        words += ["--draft-map", "draft.out"]
    elif rng.random() < 0.3:
        words += ["--out", "job"]
    words += [] if "--rules" in words else ["--to", rng.choice(("emerson/deltav", "allen-bradley/pide"))]
    words += ["--json"] if rng.random() < 0.4 else []
    return Case(tuple(words), files, terminal=rng.random() < 0.1, limit=20.0)


def _list(rng: Random) -> bytes:
    lines = [_HEADER]
    for loop in rng.sample(_LOOPS, rng.randint(1, 3)):
        cells = loop.split(";")
        for _ in range(rng.randint(0, 3)):
            cells[rng.randrange(len(cells))] = rng.choice((number(rng, 0.3), text(rng), anything(rng), ""))
        lines.append(";".join(cells))
    if rng.random() < 0.3:
        lines.insert(rng.randrange(len(lines)), rng.choice(("AREA 7", "", "END OF LIST", "Title;;", "; ;", _HEADER)))
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def check(case: Case, said: Said) -> None:
    """Every line is accounted for."""
    if "--json" in case.words and said.out.startswith("{"):
        summary = json.loads(said.out)["summary"]
        rows_match("pidemu retrofit", sum(summary["counts"].values()), {summary["lines"]})


KIND: Final = Kind("plants", make, check=check)
