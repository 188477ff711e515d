"""Names in Structured Text: case-blind, single underscores within only, none that a dialect keeps for itself."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

from pidemu.backends.names import names_of, respelt
from pidemu.errors import EngineError
from pidemu.program.ir import Program

_WORDS: Final = """
abs abstract acos action add and any any_bit any_date any_int any_num any_real array asin at atan atan2 begin block bool by byte
cal calc calcn case cd char class clk concat configuration constant continue cos ctd ctu ctud cu data_block date date_and_time db
delete dint div do dt dword else elsif en end_action end_block end_case end_class end_configuration end_data_block end_for
end_function end_function_block end_if end_interface end_method end_namespace end_program end_repeat end_resource end_step
end_struct end_transition end_type end_var end_while eno enum eq exit exp expt extends f_edge f_trig false final find for from
function function_block ge goto gt if implements in initial_step insert int interface internal interval jmp jmpc jmpcn label ld
ldn ldt le left len limit lint ln log lreal lt ltime ltod lword max method mid min mod move mul mux n namespace ne nil non_retain
not null of on or organization_block override overlap parameter persistent pointer priority private program property protected ps
public q q1 r r1 r_edge r_trig read_only read_write real ref ref_to reference region repeat replace resource ret retain retc retcn
return right rol ror rs rtc s s1 self sel sema shl shr sin single sint sqr sqrt sr st step stn string struct sub super tan task
then this time time_of_day to tod tof ton tp transition trn true trunc type udint uint ulint union until usint using ustring var
var_access var_config var_external var_global var_in_out var_input var_output var_stat var_temp version void volatile wchar while
with within word wstring xor
"""
RESERVED: Final = frozenset(_WORDS.split())
"""Words of IEC 61131-3 (keywords, types, operators of the instruction list, standard functions and blocks) and of SCL."""
_OWN: Final = ("whole_number", *(f"whole_{k}" for k in range(1, 10)))
OUTPUT: Final = "OP"


def check_name(name: str) -> None:
    """Check that a name can be a function block's.

    Raises
    ------
    EngineError
        It has other characters, underscores at an end or two in a row, or is a word of the language.
    """
    if not re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name):
        raise EngineError(f"'{name}' is not a name in Structured Text; give letters, digits and single underscores, a letter first")
    if name.casefold() in RESERVED:
        raise EngineError(f"'{name}' is a word of Structured Text; give another name, such as {name}_control")


def given_flag(name: str) -> str:
    """Return the name of what tells whether an input is there, in a program: no name of a program has two underscores."""
    return f"{name}__given"


def identifier(text: str) -> str:
    """Return any text as an identifier: other characters become one underscore."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")
    return name if name[:1].isalpha() else f"X_{name}".rstrip("_")


def identifiers(program: Program, block: str, dials: Iterable[str]) -> tuple[dict[str, str], dict[str, str]]:
    """Return the names of a program, with those that tell whether an input is there, and of a vendor's settings.

    A vendor's settings keep their names where the language allows; names of the program give way.

    Parameters
    ----------
    program : Program
        The program.
    block : str
        The function block's name.
    dials : iterable of str
        The vendor's names.
    """
    dials = list(dials)
    signals = {q.name: q.name.upper() for q in program.inputs}
    signals |= {given_flag(q.name): f"{q.name.upper()}_GIVEN" for q in program.inputs}
    signals[program.output] = OUTPUT
    taken = {*RESERVED, *_OWN, block.casefold(), *(w.casefold() for w in signals.values())}
    vendor = _spelt({d: identifier(d) for d in dials}, taken)
    taken |= {name.casefold() for name in vendor.values()}
    own = _spelt({n: n for n in names_of(program) if n not in signals}, taken)
    return {**signals, **own}, vendor


def _spelt(wished: dict[str, str], taken: set[str]) -> dict[str, str]:
    """Return names as near to what is wished as can be; what two of them wish alike, the first has."""
    found: dict[str, str] = {}
    taken = set(taken)
    for name, wish in wished.items():
        found[name] = respelt([wish], taken, case_blind=True)[wish]
        taken.add(found[name].casefold())
    return found
