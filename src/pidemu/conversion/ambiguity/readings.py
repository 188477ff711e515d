"""Numbers whose meaning is uncertain: every way to read them, for the user to choose from.

A loop sheet says ``RESET 0.75``. Repeats per minute, or minutes per repeat? Naming a card answers that: its documentation states
the units. Copied numbers have no such answer, so they are read in every way that makes sense, and nothing is chosen.
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from pidemu.card.library import cards, load_card
from pidemu.card.load import Card
from pidemu.card.model.base import Form
from pidemu.certificate.linear import bands, compare
from pidemu.conversion.ambiguity.candidates import candidates_of, law_numbers, response_of
from pidemu.errors import CardNotFoundError, PidemuError, SettingError, suggest
from pidemu.settings.settings import Settings

_PLAIN_WORD: Final = re.compile(r"[\w./:=,%+-]+")


@dataclass(frozen=True)
class Reading:
    """One way to read settings.

    Attributes
    ----------
    settings : Settings
        The settings, read so.
    text : str
        What the reading is, in short.
    command : str
        The words after ``pidemu convert`` that state this reading and no other.
    alike : tuple of str
        Other readings that amount to the same law for measurement.
    """

    settings: Settings
    text: str
    command: str
    alike: tuple[str, ...] = ()


@dataclass(frozen=True)
class Apart:
    """How far readings differ.

    Attributes
    ----------
    integral : float
        Largest integral gain per smallest; infinite where one reading has none, 1 where all are alike.
    deviation : float
        ``max |C/C1 - 1|`` of the laws for measurement against the first one, over its loop band (specs/equations.md, section 9).
    """

    integral: float
    deviation: float


def readings(
    word: str, values: Mapping[str, object] | None = None, /, *, vendors: Sequence[str | Path] = (), **named: object
) -> tuple[Reading, ...]:
    """Return every way to read settings whose meaning is uncertain.

    Open are, and combined with each other:

    - the card, where `word` names several;
    - options that are not given and that change the law for measurement. A reading in which a gain, integral or derivative setting
      that is given is not at work does not count, as long as there is another;
    - the unit of an integral setting without one: the card's, or its reciprocal (``repeat/min`` and ``min/repeat``). An
      independent integral gain is read per second and per minute, and each also as a reset rate, that is times the
      proportional gain, ``ki = kp rate`` (specs/equations.md, section 1).

    All other numbers are in the card's unit, derivative times as well: seconds and minutes are alternatives only where two of the
    cards, or two choices of an option, have them.

    Parameters
    ----------
    word : str
        A card's id or file; or part of the id, of the vendor's or of the product's name, which several cards may share.
    values : mapping, optional
        Settings and options by name, where a keyword will not do.
    vendors : sequence of path, optional
        Folders of the user's own cards.
    **named
        Settings and options by name, as for `Card.settings`. What is given with a unit is not open.

    Returns
    -------
    tuple of Reading
        Readings with different laws for measurement, those in the cards' own units first. A reading that a card's ranges
        exclude is none.

    Raises
    ------
    CardNotFoundError
        No card is named so.
    SettingError
        No card takes these settings; says why, card by card.

    Examples
    --------
    >>> import pidemu
    >>> for reading in pidemu.readings("fisher/provox", GAIN=2, RESET=0.75):
    ...     print(reading.text)
    RESET = 0.75 repeat/min (80 s per repeat), card fisher/provox
    RESET = 0.75 min/repeat (45 s per repeat), card fisher/provox
    """
    given = {**(values or {}), **named}
    named_cards = _cards_named(word, vendors)
    found = [r for card in named_cards for r in candidates_of(card, given)]
    if not found:
        raise SettingError(_why_none(word, named_cards, given))
    merged: dict[int, Reading] = {}
    numbered = zip(found, law_numbers(r.response for r in found), strict=True)
    for r, law in sorted(numbered, key=lambda pair: pair[0].way):
        words = [word if _is_file(word) else r.settings.card.id, *r.words, *(f"--vendors={folder}" for folder in vendors)]
        reading = merged.setdefault(law, Reading(r.settings, r.text, command_line(words)))
        if r.text not in (reading.text, *reading.alike):
            merged[law] = replace(reading, alike=(*reading.alike, r.text))
    return tuple(merged.values())


def apart(found: Sequence[Reading]) -> Apart:
    """Return how far readings are apart."""
    sizes = [abs(r.settings.algorithm().ki) for r in found]
    ratio = 1.0 if not max(sizes) else max(sizes) / min(sizes) if min(sizes) else math.inf
    first, *others = (r.settings.law() for r in found)
    loop, _ = bands(first, None)
    return Apart(ratio, max((compare(first.response, o.response, *loop).max_deviation for o in others), default=0.0))


def command_line(words: Iterable[str]) -> str:
    """Return words as one types them in a shell: those with a space in double quotes."""
    return " ".join(w if _PLAIN_WORD.fullmatch(w) else shlex.quote(w) if re.search(r'["$`!]', w) else f'"{w}"' for w in words)


def _is_file(word: str) -> bool:
    return word.endswith((".yaml", ".yml"))


def _cards_named(word: str, vendors: Sequence[str | Path]) -> list[Card]:
    """Return the card of this id or file, or all that have a word which begins so, or else all that hold it anywhere."""
    if _is_file(word):
        return [load_card(word, vendors)]

    def plain(text: str) -> str:
        return re.sub(r"[\s_-]+", " ", text.strip().casefold())

    known, asked = cards(vendors), plain(word)
    exact = [i for i in known if plain(i) == asked]
    loaded = [load_card(i, vendors) for i in exact or known]
    texts = [(card, plain(f"{card.id} {card.data.vendor} {card.data.product}")) for card in loaded]
    begin = [card for card, text in texts if asked and re.search(rf"\b{re.escape(asked)}", text)]
    found = begin or [card for card, text in texts if asked and asked in text]
    if not found:
        raise CardNotFoundError(f"no card, vendor or product '{word}'{suggest(word, known)}; 'pidemu cards' lists them")
    return found


def _why_none(word: str, named: Sequence[Card], given: Mapping[str, object]) -> str:
    """Return why none of the cards takes these settings, card by card."""
    faults = []
    for card in named:
        if card.data.form is Form.DAHLIN:
            faults.append(
                f"{card.id}: cancels the pole of a process model; it has no PID settings that could mean different things"
            )
            continue
        try:
            response_of(card.settings(given))
        except PidemuError as error:
            faults.append(str(error))
    reasons = "\n".join(faults)
    if len(named) == 1:
        return reasons
    return f"no card that '{word}' names takes these settings; correct them for one of these:\n{reasons}"
