"""What the columns of loop lists are called, and what they hold."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from functools import cache
from typing import Final, Literal, get_args

Field = Literal[
    "tag", "service", "area", "system", "gain", "integral", "derivative", "gain_unit", "integral_unit", "derivative_unit",
    "derivative_filter", "pv_filter", "form", "equation", "structure", "derivative_of", "pv_low", "pv_high", "pv_range", "pv_unit",
    "new_low", "new_high", "new_range", "reranged", "out_low", "out_high", "out_limit_low", "out_limit_high", "action", "mode",
    "scan",
    "update", "setpoint", "remarks", "options", "number", "unit", "other",
]  # fmt: skip
"""What a column holds. ``unit`` is the unit of the column before it, ``other`` is known and not needed."""
FIELDS: Final[tuple[Field, ...]] = get_args(Field)

_ALIASES: Final[dict[Field, str]] = {
    "tag": "Tag, Tag No, Tag Nr, Tag Number, Tagname, Tag Name, Loop, Loop tag, Loop No, Loop Name, Instrument, Instrument "
    "tag, Point, "
    "Point name, Entity, Name, Position, PLT-Stelle, PLT Stelle, Messstelle, KKS",
    "service": "Service, Description, Descriptor, DESC, PTDESC, Application, Bezeichnung, Beschreibung, Loop description",
    "area": "Area, Unit area, Plant, Plant area, Section, Anlage, Bereich",
    "system": "System, Controller, Make, Vendor, Model, Type, Block, Block type, PLC, PLC / BLOCK, Datatype, Data type, "
    "Point type, "
    "Source system, Fabrikat, Typ",
    "gain": "P, Gain, K, KC, KP, PGain, Cfg_PGain, PB, PBAND, Prop band, Proportional band, Proportional, XP, S6",
    "integral": "I, Ti, TN, T1, INT, INTEGRAL, Integral time, Reset, RSET, IGain, Cfg_IGain, KI, Nachstellzeit, S7",
    "derivative": "D, Td, TV, T2, DERIV, Derivative, Derivative time, Rate, Preact, DGain, Cfg_DGain, KD, Vorhaltzeit, S8",
    "gain_unit": "PB or GAIN, PB/GAIN, Einh. P, P unit, Unit P, Gain unit, PB unit, Einheit P",
    "integral_unit": "MIN or RPM, MIN/RPM, Einh. I, I unit, Unit I, Reset unit, Ti unit, Integral unit, Einheit I",
    "derivative_unit": "Einh. D, D unit, Unit D, Rate unit, Td unit, Derivative unit, Einheit D",
    "derivative_filter": "ALPHA, TM_LAG, Derivative filter, D filter",
    "pv_filter": "PV_FTIME, TF, Filter, PV filter, Damping, PV-Filter, Input filter, Dämpfung",
    "form": "Form, DependIndepend, PE, PID form, Form/Gleichung",
    "equation": "Equation, EQN, CTLEQN, CTEQN, ALGO, CONT ALG, Algorithm, PID equation, EQUATION (IND/DEP), Gleichung",
    "structure": "Structure, Struktur, PID structure",
    "derivative_of": "DERIV. OF, Derivative of, DOE, D on, Derivative on",
    "pv_low": "LRV, LO, PVEULO, MINS, PVEUMin, EU0, SL, Range low, PV MIN, PV low, Low range, Range min, MB-Anfang, PV LRV",
    "pv_high": "URV, HI, PVEUHI, MAXS, PVEUMax, EU100, SH, Range high, PV MAX, PV high, High range, Range max, MB-Ende, PV URV",
    "pv_range": "Range, PV range, Messbereich, Measuring range, Transmitter range",
    "pv_unit": "EU, Eng unit, Eng units, Engineering unit, Engineering units, PV unit, EGU",
    "new_low": "New LRV, NEW MIN, New low, New range low, neu Anfang",
    "new_high": "New URV, NEW MAX, New high, New range high, neu Ende",
    "new_range": "New range, Neuer Messbereich",
    "reranged": "Re-ranged, Re-ranged?, RERANGED, Messbereich geändert, Range changed",
    "out_low": "CVEULO, MSL, CVEUMin",
    "out_high": "CVEUHI, MSH, CVEUMax",
    "out_limit_low": "OP lo, OP low, OUT_LO_LIM, OPLOLM, MINO, CVLLimit, Out low, OUT MIN, OUT MIN %, Output low, Y min, LO limit",
    "out_limit_high": "OP hi, OP high, OUT_HI_LIM, OPHILM, MAXO, CVHLimit, Out high, OUT MAX, OUT MAX %, Output high, Y "
    "max, HI limit",
    "action": "Action, Act, CTLACTN, ControlAction, Control action, CA, Direct/Reverse, Dir/Rev, INC-INC/INC-DEC, Wirksinn",
    "mode": "Mode, A/M, NMODE, Normal mode, Betriebsart",
    "scan": "Scan, Scan time, Scan rate, Period, PERIOD, Zyklus, Task, Task period, TASK / STI, Sampling, Sample time, "
    "Execution, Interval",
    "update": "UPD, Update, Update time, OversampleDT, Loop update time",
    "setpoint": "SP, LSP, Setpoint, Sollwert",
    "remarks": "Remarks, Remark, Comment, Comments, Note, Notes, Bemerkung, Bemerkungen",
    "options": "Options, Option, Optionen, Features",
    "number": "No, Nr, #, Item, Pos, Seq, Lfd Nr",
    "unit": "Unit, Units, Einheit, UoM, Dim",
    "other": "Old tag, Old name, Rev, Revision, Sheet, Loop sheet, P&ID, Drawing",
}  # fmt: skip
_UNIT_OF: Final[dict[Field, Field]] = {
    "gain": "gain_unit", "integral": "integral_unit", "derivative": "derivative_unit", "pv_low": "pv_unit", "pv_high": "pv_unit",
    "pv_range": "pv_unit", "new_low": "pv_unit", "new_high": "pv_unit",
}  # fmt: skip
_BRACKETS: Final = re.compile(r"\(([^()]*)\)|\[([^\[\]]*)\]")


@dataclass(frozen=True, slots=True)
class HeaderName:
    """One name in a header cell: ``KI [1/s]`` of ``KI [1/s] / TI [min]``.

    Attributes
    ----------
    word : str
        The name without the unit.
    unit : str
        The unit in brackets; empty where there is none.
    """

    word: str
    unit: str = ""


def folded(text: str) -> str:
    """Return a name so that case, accents, spaces and marks do not count.

    Examples
    --------
    >>> folded("Prop. Band_%"), folded("Messbereich geändert")
    ('propband%', 'messbereichgeandert')
    """
    plain = unicodedata.normalize("NFKD", text.casefold())
    return re.sub(r"[\s._\-:]", "", "".join(c for c in plain if not unicodedata.combining(c)))


@cache
def _known() -> dict[str, Field]:
    return {folded(name): field for field, names in _ALIASES.items() for name in names.split(", ")}


def header_names(text: str) -> tuple[HeaderName, ...]:
    """Return the names in a header cell, each with its unit.

    Examples
    --------
    >>> header_names("KI [1/s] / TI [min]")
    (HeaderName(word='KI', unit='1/s'), HeaderName(word='TI', unit='min'))
    >>> header_names("Reset (rep/min)")
    (HeaderName(word='Reset', unit='rep/min'),)
    """
    units: list[str] = []

    def keep(match: re.Match[str]) -> str:
        units.append(match[1] if match[1] is not None else match[2])
        return f"\x00{len(units) - 1}\x00"

    names = []
    for part in _BRACKETS.sub(keep, text).split("/"):
        found = re.search(r"\x00(\d+)\x00", part)
        word = " ".join(re.sub(r"\x00\d+\x00", " ", part).split())
        if word or found:
            names.append(HeaderName(word, units[int(found[1])].strip() if found else ""))
    return tuple(names)


@cache
def field_of(text: str) -> Field | None:
    """Return what a column of this header holds; ``None`` where that is not known.

    Of several names with a stroke between, such as ``Kp / Xp``, all that are known must mean the same.
    """
    whole = _BRACKETS.sub(" ", text)
    for name in (text, whole):
        found = _known().get(folded(name))
        if found is not None:
            return found
    fields = {_known().get(folded(name.word)) for name in header_names(text)} - {None}
    return fields.pop() if len(fields) == 1 else None


def unit_column_after(field: Field | None) -> Field | None:
    """Return what a column holds that is headed just "unit" and stands behind another one."""
    return _UNIT_OF.get(field) if field is not None else None
