"""What lists write for a card's options: EQA, ISA, noninteractive, PID B."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from pidemu.card.load import Card
from pidemu.card.model.base import Form
from pidemu.plant.fields import folded

_DEPENDENT: Final = ("dependent", "dep", "ISA", "ISA dependent", "dependent gains")
_INDEPENDENT: Final = ("independent", "ind", "indep", "independent gains", "parallel")
_OF_PV: Final = ("PV", "on PV", "measurement")
_OF_ERROR: Final = ("error", "E", "on error", "err")
_WORDS: Final[Mapping[str, Mapping[str, Mapping[str, Sequence[str]]]]] = {
    "honeywell/tdc3000": {
        "FORM": {
            "interactive": ("interactive", "interact", "interacting", "series", "real"),
            "ideal": ("ideal", "noninteractive", "noninter", "noninteract", "non interacting", "standard"),
        },
        "CTEQN": {x: (f"EQ{x}", f"equation {x}", f"CTEQN {x}", f"CTLEQN {x}", f"type {x}") for x in "ABCD"},
    },
    "honeywell/udc": {"ALGO": {x: (f"PID {x}", f"PID-{x}", f"CONT ALG PID {x}") for x in "AB"}},
    "allen-bradley/plc5": {
        "EQUATION": {"independent": _INDEPENDENT, "ISA": _DEPENDENT},
        "DERIVATIVE": {"PV": _OF_PV, "error": _OF_ERROR},
    },
    "allen-bradley/logix-pid": {
        "PE": {"independent": (*_INDEPENDENT, "PE 0"), "dependent": (*_DEPENDENT, "PE 1")},
        "DOE": {"PV": _OF_PV, "error": _OF_ERROR},
    },
    "allen-bradley/pide": {
        "DependIndepend": {"false": _INDEPENDENT, "true": _DEPENDENT},
        "PVEDerivative": {"true": _OF_PV, "false": _OF_ERROR},
    },
    "emerson/deltav": {"FORM": {"Standard": ("standard", "ISA", "ideal"), "Series": ("series", "interactive")}},
}
_FORMS: Final = {
    **dict.fromkeys(("series", "interactive", "interacting", "real", "classical", "interact"), Form.SERIES),
    **dict.fromkeys(("standard", "ideal", "noninteractive", "noninter", "isa", "dependent", "noninteracting"), Form.STANDARD),
    **dict.fromkeys(("parallel", "independent", "independentgains", "ind"), Form.PARALLEL),
}
OptionWords = Mapping[str, Mapping[str, Mapping[str, Sequence[str]]]]
"""Words by card, option and choice."""


class OptionVocabulary:
    """The words for the options of cards: those of the mapping file, the choices' own names, and the usual ones.

    Parameters
    ----------
    by_card : mapping
        Words of the mapping file by card, option and choice.
    choices : mapping
        Words of the mapping file for choices of whatever card: ``{"ideal": ["NONINTER"]}``, ``{"CTEQN A": ["EQA"]}``.
    """

    def __init__(self, by_card: OptionWords, choices: Mapping[str, Sequence[str]]) -> None:
        self._by_card = by_card
        self._choices = choices
        self._tables: dict[str, dict[str, list[tuple[str, str]]]] = {}

    def meaning(self, card: Card, text: str) -> tuple[str, str] | None:
        """Return the option and the choice that a word stands for on a card; ``None`` where none, or several."""
        table = self._tables.setdefault(card.id, {})
        if not table:
            for word, option, choice in self._words(card):
                found = table.setdefault(folded(word), [])
                if (option, choice) not in found:
                    found.append((option, choice))
        found = table.get(folded(text), [])
        return found[0] if len(found) == 1 else None

    def _words(self, card: Card) -> Iterator[tuple[str, str, str]]:
        for option, choices in card.options.items():
            for choice in choices:
                yield f"{option} {choice}", option, choice
                yield f"{option}={choice}", option, choice
                yield choice, option, choice
        for table in (_WORDS, self._by_card):
            for option, words in table.get(card.id, {}).items():
                for choice, spellings in words.items():
                    yield from ((word, option, choice) for word in spellings)
        usual = _WORDS.get(card.id, {})
        for meaning, spellings in self._choices.items():
            for option, choices in card.options.items():
                for choice in choices:
                    names = {folded(choice), folded(f"{option} {choice}"), *map(folded, usual.get(option, {}).get(choice, ()))}
                    if folded(meaning) in names and not choice.isdigit():
                        yield from ((word, option, choice) for word in spellings)


def form_named(text: str) -> Form | None:
    """Return the form that a word names; ``None`` where it names none."""
    return _FORMS.get(folded(text))
