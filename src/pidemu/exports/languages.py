"""The languages that a scan program is printed in, and the files that hold it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

from pidemu.backends.structured_text_expressions import Dialect
from pidemu.program.ir import Program
from pidemu.settings.settings import Settings

if TYPE_CHECKING:
    from pidemu.backends.structured_text_self_test import SelfTest

Language = Literal["python", "c", "js", "st", "plcopen"]


@dataclass(frozen=True)
class Printing:
    """What is printed.

    Attributes
    ----------
    program : Program
        The program.
    settings : Settings
        Its settings.
    name : str
        The name of files, types, functions and blocks.
    notes : sequence of str
        What the head says of the card's evidence.
    dialect : {"iec", "scl", "rockwell"}
        Of Structured Text.
    test : SelfTest or None
        A record for the program that tests a block of Structured Text.
    """

    program: Program
    settings: Settings
    name: str
    notes: Sequence[str]
    dialect: Dialect = "iec"
    test: SelfTest | None = None


def _python(p: Printing) -> str:
    from pidemu.backends.python import source

    return source(p.program, p.notes)


def _c(p: Printing) -> str:
    from pidemu.backends.c import single

    return single(p.program, p.name, p.notes)


def _javascript(p: Printing) -> str:
    from pidemu.backends.javascript import source

    return source(p.program, p.name, p.notes)


def _structured_text(p: Printing) -> str:
    from pidemu.backends.structured_text import source
    from pidemu.backends.structured_text_block import dials

    return source(p.program, p.name, dials(p.settings), p.notes, dialect=p.dialect, test=p.test)


def _plcopen(p: Printing) -> str:
    from pidemu.backends.structured_text_block import dials
    from pidemu.backends.structured_text_plcopen import source

    return source(p.program, p.name, dials(p.settings), p.notes, test=p.test)


_PRINTERS: Final[dict[Language, Callable[[Printing], str]]] = {
    "python": _python,
    "c": _c,
    "js": _javascript,
    "st": _structured_text,
    "plcopen": _plcopen,
}
LANGUAGES: Final = tuple(_PRINTERS)
_ENDINGS: Final[dict[Language, str]] = {"python": "py", "c": "c", "js": "js", "st": "st", "plcopen": "xml"}


def printed(p: Printing, lang: Language) -> str:
    """Return a program as one text of a language."""
    return _PRINTERS[lang](p)


def files(p: Printing, lang: Language) -> dict[str, str]:
    """Return the files of a program in a language, text by name."""
    if lang == "c":
        from pidemu.backends.c import header, source

        return {f"{p.name}.h": header(p.program, p.name, p.notes), f"{p.name}.c": source(p.program, p.name, p.notes)}
    ending = "scl" if lang == "st" and p.dialect == "scl" else _ENDINGS[lang]
    return {f"{p.name}.{ending}": printed(p, lang)}


def check_name(name: str, lang: Language) -> None:
    """Refuse a name that is none in the language; the file of a Python module is named as one of C.

    Raises
    ------
    EngineError
        It is not a name.
    """
    if lang == "js":
        from pidemu.backends.javascript import check_name as check
    elif lang in ("st", "plcopen"):
        from pidemu.backends.structured_text_names import check_name as check
    else:
        from pidemu.backends.c import check_name as check
    check(name)
