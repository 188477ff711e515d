"""A controller as code in a language."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pidemu.backends.structured_text_expressions import Dialect
from pidemu.certificate.unverified import facts, unverified_program
from pidemu.controller.controller import Controller
from pidemu.errors import EngineError
from pidemu.exports.languages import LANGUAGES, Language, Printing, check_name, files, printed
from pidemu.settings.action import Action
from pidemu.settings.settings import Settings


@dataclass(frozen=True)
class Code:
    """A controller as code.

    Attributes
    ----------
    text : str
        One text that holds all of it.
    files : mapping
        The same as files, text by name; C has a header of its own.
    """

    text: str
    files: Mapping[str, str]


def code(
    settings: Settings,
    lang: Language = "python",
    *,
    name: str | None = None,
    scan: float | None = None,
    action: Action = "reverse",
    output_limits: tuple[float, float] | None = None,
    signals: Sequence[str] = (),
    dialect: Dialect = "iec",
    self_test: bool = False,
) -> Code:
    """Return the scan program of a controller as code that runs without pidemu and gives the same bits.

    Parameters
    ----------
    settings : Settings
        Card and settings.
    lang : {"python", "c", "js", "st", "plcopen"}
        Python, C99, JavaScript, Structured Text of IEC 61131-3, or the latter as PLCopen XML.
    name : str, optional
        The name of files, types, functions and blocks; by default the card's.
    scan : float, optional
        Scan interval [s]; by default the card's.
    action : {"reverse", "direct"}
        Control action.
    output_limits : tuple of float, optional
        Low and high output limit; by default the card's.
    signals : sequence of {"cascade", "track", "external_reset", "feedforward"}
        What the program reads besides setpoint, measurement, mode and operator's output.
    dialect : {"iec", "scl", "rockwell"}
        Of Structured Text.
    self_test : bool
        With Structured Text and PLCopen: a program too that plays standard vectors to the block in the controller.

    Raises
    ------
    EngineError
        The language or the name cannot be used, or the program cannot be said in the dialect.
    ScanError
        Scan interval, limits or signals cannot be used.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4)
    >>> printed = pidemu.code(s, "js", name="level")
    >>> list(printed.files), "function scan(state, sp, pv, auto" in printed.text
    (['level.js'], True)
    """
    if lang not in LANGUAGES:
        raise EngineError(f"no language '{lang}'; languages: {', '.join(LANGUAGES)}")
    if name is not None:
        check_name(name, lang)
    controller = Controller(settings, scan, action, output_limits)
    controller.listen(*signals)
    program, test = controller.lean_program, None
    if self_test:
        from pidemu.vector_sets.block_test import block_test
        from pidemu.vector_sets.vectors import vectors

        test = block_test(program, vectors(settings, scan, action=action, output_limits=output_limits))
    notes = _notes(settings, scan=scan is not None, limits=output_limits is not None)
    what = Printing(program, settings, name or _name(settings.card.id), notes, dialect, test)
    return Code(printed(what, lang), files(what, lang))


def _notes(settings: Settings, *, scan: bool, limits: bool) -> list[str]:
    """Return what the head says of the card's evidence."""
    found = facts(unverified_program(settings, scan=scan, limits=limits))
    if not found:
        return [f"Every field of the card {settings.card.id} that makes this program is documented or measured."]
    return [f"Assumed or inferred in the card {settings.card.id}, and at work here:", *(f"- {fact}" for fact in found)]


def _name(card_id: str) -> str:
    """Return a name in any language after a card: its letters and digits, one underscore for anything else."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", card_id).strip("_")
    return name if name[:1].isalpha() else f"pid_{name}".rstrip("_")
