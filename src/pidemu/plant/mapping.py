"""The mapping file: which words of a plant are which cards, choices and columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Literal, TypeVar

from pydantic import Field, ValidationError

from pidemu.card.document import Document
from pidemu.card.library import cards, load_card, not_an_id
from pidemu.card.load import Card
from pidemu.card.model.base import Text
from pidemu.card.reading import parse_file
from pidemu.card.validation import Model, problems
from pidemu.errors import CardError, ListError, PidemuError, suggest
from pidemu.files.reading import Kind
from pidemu.plant.fields import folded
from pidemu.plant.option_words import OptionVocabulary
from pidemu.plant.unit_words import unit_of
from pidemu.plant.words import ActionWords

_KIND: Final = Kind("a mapping", "a mapping is YAML text; pidemu retrofit LIST --draft-map FILE writes one", limit=2**20)
Spellings = list[Text] | Text
_Written = TypeVar("_Written", bound=Model)


class MappingFile(Model):
    """What the words of a plant's lists mean."""

    about: Text | None = Field(default=None, description="What the mapping is for.")
    systems: dict[Text, list[Text]] = Field(default={}, description="Card, and the cells under System that mean it.")
    words: dict[Text, list[Text] | dict[Text, Spellings] | Text] = Field(
        default={},
        description="reverse and direct: the words for the action; other names: choices of options and the words for them. "
        "A text is a remark.",
    )
    sheet_systems: dict[Text, Text] = Field(
        default={}, description="By sheet (* for all): the system of loops for which the list names none."
    )
    options: dict[Text, dict[Text, dict[Text, Spellings]]] = Field(
        default={}, description="By card, option and choice: the words for the choice."
    )
    columns: dict[Text, dict[Text, Text]] = Field(
        default={}, description="By sheet (* for all): the header of a column, and the field that it is."
    )
    header_lines: dict[Text, int] = Field(default={}, description="By sheet (* for all): the line of the header.")
    units: dict[Text, dict[Literal["gain", "integral", "derivative"], Text]] = Field(
        default={}, description="By card: the units where list and header state none."
    )
    blank_units: Literal["card", "ask"] = Field(
        default="card", description="What a blank unit is: the card's own, which is flagged, or a decision."
    )
    sheets: list[Text] | None = Field(
        default=None, description="The sheets to read, hidden ones as well; by default all that are visible."
    )
    superseded_sheets: list[Text] = Field(default=[], description="Sheets that are not read.")


@dataclass(frozen=True)
class PlantWords:
    """A mapping, ready to be asked.

    Attributes
    ----------
    written : MappingFile
        What the file says.
    digest : str
        SHA-256 of the file; empty without one.
    path : str
        The file.
    """

    written: MappingFile = field(default_factory=MappingFile)
    digest: str = ""
    path: str = ""
    _loaded: dict[str, Card | None] = field(default_factory=dict, init=False, repr=False, compare=False)

    @cached_property
    def _cards(self) -> dict[str, str]:
        own = {folded(word): card for card, words in self.written.systems.items() for word in (*words, card)}
        return {**_usual_systems(), **own}

    @cached_property
    def actions(self) -> ActionWords:
        """The words for the action."""
        words = self.written.words
        return ActionWords({a: w for a in ("reverse", "direct") if isinstance(w := words.get(a), list)})

    @cached_property
    def options(self) -> OptionVocabulary:
        """The words for options of cards."""
        by_card = {
            card: {o: {c: _listed(w) for c, w in choices.items()} for o, choices in options.items()}
            for card, options in self.written.options.items()
        }
        choices: dict[str, list[str]] = {}
        for given in self.written.words.values():
            for choice, words in given.items() if isinstance(given, dict) else ():
                choices.setdefault(choice, []).extend(_listed(words))
        return OptionVocabulary(by_card, choices)

    def card_of(self, system: str) -> Card | None:
        """Return the card that a cell under System means; ``None`` where it is not known."""
        if system not in self._loaded:
            found = self._cards.get(folded(system))
            self._loaded[system] = None if found is None else load_card(found)
        return self._loaded[system]

    def unit_for(self, card: Card, setting: Literal["gain", "integral", "derivative"]) -> str | None:
        """Return the unit that the mapping states for a card; ``None`` where it states none."""
        text = self.written.units.get(card.id, {}).get(setting)
        return None if text is None else unit_of(setting, text) or text

    def system_of(self, sheet: str) -> str:
        """Return the system of loops of a sheet that names none; empty where the mapping does not say it either."""
        return self.written.sheet_systems.get(sheet, self.written.sheet_systems.get("*", ""))

    def columns_of(self, sheet: str) -> Mapping[str, str]:
        """Return the fields of a sheet's columns that the mapping names."""
        return {**self.written.columns.get("*", {}), **self.written.columns.get(sheet, {})}

    def header_of(self, sheet: str) -> int | None:
        """Return the line of a sheet's header, where the mapping names it."""
        return self.written.header_lines.get(sheet, self.written.header_lines.get("*"))

    def is_read(self, sheet: str, hidden: bool) -> bool:
        """Whether a sheet is read: those that are named, else all that are visible and not superseded."""
        if self.written.sheets is not None:
            return sheet in self.written.sheets
        return not hidden and sheet not in self.written.superseded_sheets


def read_mapping(path: str | Path) -> PlantWords:
    """Read a mapping file.

    Parameters
    ----------
    path : str or Path
        The file.

    Raises
    ------
    ListError
        It is missing or wrong: every problem, located.
    """
    document, written = read_yaml(path, _KIND, MappingFile)
    faults = []
    for key, names in (("systems", written.systems), ("options", written.options), ("units", written.units)):
        for name in names:
            fault = _wrong_card(name)
            if fault:
                faults.append(document.problem((key, name), fault, at_key=True))
    if not faults:
        faults = list(_wrong_options(document, written))
    if faults:
        raise ListError("\n".join(p.headline() for p in faults))
    return PlantWords(written, document.digest, str(path))


def read_yaml(path: str | Path, kind: Kind, model: type[_Written]) -> tuple[Document, _Written]:
    """Read a file of the plant, such as the mapping, into its model.

    Raises
    ------
    ListError
        It is missing or wrong: every problem, located.
    """
    try:
        document = parse_file(Path(path), kind=kind)
        try:
            return document, model.model_validate(document.value if document.value is not None else {})
        except ValidationError as error:
            raise CardError(sorted(problems(error, document.value, model, document, lambda p: p))) from None
    except CardError as error:
        raise ListError(str(error)) from None


def _wrong_card(name: str) -> str:
    if not_an_id(name) is not None or name not in cards():
        return f"no card '{name}'{suggest(name, cards())}; pidemu cards lists them"
    return ""


def _wrong_options(document: Document, written: MappingFile) -> Any:
    for card_id, options in written.options.items():
        card = load_card(card_id)
        for option, choices in options.items():
            known = card.options.get(option)
            if known is None:
                text = f"{card_id} has no option '{option}'{suggest(option, card.options)}"
                yield document.problem(("options", card_id, option), text, at_key=True)
                continue
            for choice in choices:
                if choice not in known:
                    text = f"{card_id}: {option} is one of {', '.join(known)}{suggest(choice, known)}"
                    yield document.problem(("options", card_id, option, choice), text, at_key=True)


def _listed(words: Spellings) -> list[str]:
    return [words] if isinstance(words, str) else list(words)


def _usual_systems() -> dict[str, str]:
    """Return card by system name: each card's id, and product names that are those of one card alone."""
    found: dict[str, str] = {}
    twice: set[str] = set()
    for card_id in cards():
        try:
            data = load_card(card_id).data
        except PidemuError:  # a card of the user's own that is wrong is told where it is used
            continue
        for name in (card_id, data.product, f"{data.vendor} {data.product}"):
            key = folded(str(name))
            if found.get(key, card_id) != card_id:
                twice.add(key)
            found[key] = card_id
    return {key: card for key, card in found.items() if key not in twice}
