"""A card file to a `Card`, and a card with its options chosen to a `Variant`."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pidemu.card import store
from pidemu.card.document import CARD, Document, Path_, card_id_of, digest_of, wrong_id
from pidemu.card.model.base import Evidence, Status, hyphenated
from pidemu.card.model.card_file import CardFile, Equation, Setting
from pidemu.card.model.verification import UNSTATED, CardVerification
from pidemu.card.references import is_active, makes_the_law, named_settings
from pidemu.errors import CardError, Problem, SettingError, capped, suggest
from pidemu.excerpt import visible
from pidemu.files.reading import read_text

if TYPE_CHECKING:
    from pidemu.settings.settings import Settings

_REPLACED_WHOLE = ("filter", "windup")
MOST_COMBINATIONS: Final = 200
"""Combinations of options, all of which are checked."""
DIAL_ORDER = ("multiplier", "gain", "integral", "derivative")
EQUATION_KEYS = tuple(hyphenated(f.name) for f in fields(Equation))


def overlay(base: Mapping[str, Any], top: Mapping[str, Any]) -> dict[str, Any]:
    """Return `base` overlaid with `top`: mappings key by key, ``filter`` and ``windup`` whole, null removes."""
    merged = dict(base)
    for key, value in top.items():
        old = merged.get(key)
        if value is None:
            merged.pop(key, None)
        elif isinstance(value, dict) and isinstance(old, dict) and key not in _REPLACED_WHOLE:
            merged[key] = overlay(old, value)
        else:
            merged[key] = value
    return merged


def _holds(value: Any, path: Path_) -> bool:
    for step in path:
        if not (isinstance(value, dict) and step in value) and not (isinstance(value, list) and isinstance(step, int)):
            return False
        value = value[step]  # type: ignore[index]
    return True


def leaves(value: Any, path: Path_ = ()) -> Iterator[Path_]:
    """Yield the path of every scalar or list in nested mappings."""
    if isinstance(value, dict) and value:
        for key, item in value.items():
            yield from leaves(item, (*path, key))
    else:
        yield path


def dotted(path: Path_) -> str:
    """Return a path as evidence writes it: ``derivative.filter.ratio``."""
    return ".".join(map(str, path))


def variants(card: Card) -> Iterator[Variant]:
    """Yield a card with every combination of its options."""
    names = list(card.options)
    for choice in itertools.product(*(card.options[n] for n in names)):
        yield card.variant(dict(zip(names, choice, strict=True)))


@dataclass(frozen=True, slots=True, eq=False)
class Statement:
    """One field of a variant's equation and how sure it is.

    Attributes
    ----------
    path : str
        The field, such as ``derivative.filter.ratio``.
    value : object
        What the card says.
    evidence : Evidence or None
        The nearest evidence above it.
    key : str
        The evidence's own path in the card.
    sets : str
        Of a statement on a dial, what that dial sets.
    """

    path: str
    value: Any
    evidence: Evidence | None
    key: str
    sets: str = ""

    @property
    def is_assumed(self) -> bool:
        """Whether no source says so."""
        return self.evidence is not None and self.evidence.status is Status.ASSUMED

    @property
    def is_inferred(self) -> bool:
        """Whether it follows from something documented, without being stated itself."""
        return self.evidence is not None and self.evidence.status is Status.INFERRED

    @property
    def makes_the_law(self) -> bool:
        """Whether the linear law depends on it; the rest matters scan by scan, at limits and at transfers only."""
        return makes_the_law(self.path.split("."), self.sets)

    def __str__(self) -> str:
        note = f" ({self.evidence.note})" if self.evidence is not None and self.evidence.note else ""
        return f"{self.path} = {self.value}{note}"


@dataclass(frozen=True)
class Variant:
    """A card with its options chosen.

    Attributes
    ----------
    card : Card
        The card.
    chosen : dict
        Choice by option, all options.
    equation : Equation
        The overlaid fields.
    """

    card: Card
    chosen: Mapping[str, str]
    equation: Equation = field(compare=False)
    raw: Mapping[str, Any] = field(repr=False, compare=False)

    def __hash__(self) -> int:
        return hash((self.card.id, *self.chosen.values()))

    @property
    def choice_text(self) -> str:
        """The options chosen, in words."""
        return ", ".join(f"{option}={choice}" for option, choice in self.chosen.items())

    def home(self, path: Path_) -> Path_:
        """Return where a field of the equation stands in the file: in a chosen overlay, or in the card itself."""
        for option, choice in reversed(list(self.chosen.items())):
            where = ("options", option, "choices", choice)
            if _holds(self.card.document.value, (*where, *path)):
                return (*where, *path)
        return path

    @cached_property
    def active(self) -> frozenset[str]:
        """The dials that the equation uses."""
        return frozenset(name for name, setting in self.equation.settings.items() if is_active(self.equation, name, setting))

    @cached_property
    def dials(self) -> dict[str, tuple[str, Setting]]:
        """By what a dial sets, the first one at work and what the card says of it."""
        found: dict[str, tuple[str, Setting]] = {}
        for name, setting in self.equation.settings.items():
            if name in self.active:
                found.setdefault(setting.sets, (name, setting))
        return found

    @property
    def has_proportional(self) -> bool:
        """Whether there is a proportional term on the measurement."""
        return self.equation.proportional.on != "none"

    @property
    def has_integral(self) -> bool:
        """Whether there is an integral term."""
        return self.equation.integral.on != "none" and "integral" in self.dials

    @property
    def has_derivative(self) -> bool:
        """Whether there is a derivative term."""
        return self.equation.derivative.on != "none" and "derivative" in self.dials

    @cached_property
    def statements(self) -> tuple[Statement, ...]:
        """Every field of the equation with its evidence, in the order of the card."""
        found = []
        for path in leaves(self.raw):
            home = self.home(path)
            key = self.card.evidence_key(home)
            value: Any = self.raw
            for step in path:
                value = value[step]
            sets = self.equation.settings[str(path[1])].sets if path[0] == "settings" else ""
            found.append(Statement(dotted(path), value, self.card.data.evidence.get(key or ""), key or dotted(home), sets))
        return tuple(found)

    def assumptions(self, defaulted: Iterable[str] | None = None) -> list[Statement]:
        """Return what this variant only assumes: one statement per evidence entry.

        Parameters
        ----------
        defaulted : iterable of str, optional
            Options that were not stated, so that their assumed defaults count as well; by default all.
        """
        seen: dict[str, Statement] = {}
        for name in self.chosen if defaulted is None else defaulted:
            key = self.card.evidence_key(("options", name, "default")) or ""
            option = Statement(name, self.chosen[name], self.card.data.evidence.get(key), f"{key}:{name}")
            if option.is_assumed:
                seen[option.key] = option
        for statement in self.statements:
            if statement.is_assumed:
                seen.setdefault(statement.key, statement)
        return list(seen.values())


@dataclass(frozen=True)
class Card:
    """One PID algorithm of one product, as a card describes it.

    Attributes
    ----------
    id : str
        ``vendor/block``, from the file's place.
    data : CardFile
        What the card says.
    document : Document
        The file, with places.
    compiled : CompiledCard or None
        Its plain data, where it was not read from its file.
    """

    id: str
    data: CardFile
    document: Document = field(repr=False)
    compiled: store.CompiledCard | None = field(default=None, repr=False, compare=False)
    _variants: dict[tuple[str, ...], Variant] = field(default_factory=dict, repr=False, compare=False)

    def __hash__(self) -> int:
        return hash(self.id)

    def __repr__(self) -> str:
        return f"<Card {self.id}>"

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:  # noqa: ARG002  # IPython's and Hypothesis's way to print
        printer.text(repr(self))

    def __getstate__(self) -> dict[str, Any]:
        """Return what another process is sent: all but the variants, which it builds when it needs them."""
        return {**self.__dict__, "_variants": {}}

    @property
    def digest(self) -> str:
        """The card's version: SHA-256 of its file, in hexadecimal."""
        return self.document.digest

    @property
    def title(self) -> str:
        """Vendor, product and algorithm in one line."""
        return f"{self.data.vendor} {self.data.product}: {self.data.algorithm}"

    @property
    def verification(self) -> CardVerification:
        """How its emulation was verified."""
        return self.data.verification or UNSTATED

    @property
    def options(self) -> dict[str, tuple[str, ...]]:
        """Choices by option; the default comes first."""
        return {name: (o.default, *(c for c in o.choices if c != o.default)) for name, o in self.data.options.items()}

    def evidence_key(self, path: Path_) -> str | None:
        """Return the longest evidence path at or above `path`."""
        for end in range(len(path), 0, -1):
            key = dotted(path[:end])
            if key in self.data.evidence:
                return key
        return None

    def all_settings(self) -> dict[str, Setting]:
        """Return every dial that any choice of options offers, by name."""
        found = dict(self.data.settings)
        for name, option in self.data.options.items():
            for choice in option.choices:
                for dial, setting in self.variant({name: choice}).equation.settings.items():
                    found.setdefault(dial, setting)
        return found

    def variant(self, options: Mapping[str, object] | None = None) -> Variant:
        """Return the card with options chosen; those not named take their defaults.

        Parameters
        ----------
        options : mapping, optional
            Choice by option. Upper and lower case are the same where that is unambiguous.

        Raises
        ------
        SettingError
            An option or a choice is unknown.
        CardError
            The choices do not go together.
        """
        chosen = {name: o.default for name, o in self.data.options.items()}
        for given, choice in (options or {}).items():
            name = match_name(given, chosen)
            if name is None:
                known = ", ".join(chosen) or "none"
                raise SettingError(f"{self.id}: unknown option '{given}'{suggest(given, chosen)}; options: {known}")
            choices = self.data.options[name].choices
            word = match_name(str(choice), choices)
            if word is None:
                raise SettingError(
                    f"{self.id}: option {name} has no choice '{choice}'{suggest(str(choice), choices)}; "
                    f"choices: {', '.join(choices)}"
                )
            chosen[name] = word
        key = tuple(chosen.values())
        if key not in self._variants:
            self._variants[key] = self._build(chosen)
        return self._variants[key]

    def _build(self, chosen: dict[str, str]) -> Variant:
        raw: dict[str, Any] = {k: self.document.value[k] for k in EQUATION_KEYS if k in self.document.value}
        for option, choice in chosen.items():
            raw = overlay(raw, self.data.options[option].choices[choice])
        raw = {k: raw[k] for k in EQUATION_KEYS if k in raw}
        if isinstance(raw.get("settings"), dict):  # dials that choices add stand in their usual place, not at the end
            raw["settings"] = dict(sorted(raw["settings"].items(), key=_usual_place))
        if self.compiled is not None:
            return Variant(self, chosen, self.compiled.equation(tuple(chosen.values())), raw)
        variant = Variant(self, chosen, _equation(raw, self.document, chosen), raw)
        _refuse_wrong_references(variant)
        return variant

    def settings(self, given: Mapping[str, object] | None = None, /, **values: object) -> Settings:
        """Return settings of this card.

        Parameters
        ----------
        given : mapping, optional
            Settings and options by name, where a keyword will not do.
        **values
            Settings and options by name: a number in the card's unit, a string with a unit (``"20 s/repeat"``), or the name of a
            choice. ``pv_range`` and ``op_range``, pairs of engineering units, state the signal ranges.

        Returns
        -------
        Settings
            The settings, with defaults filled in and every conversion noted.

        Raises
        ------
        SettingError
            A setting is unknown, missing or out of range.
        UnitError
            A value cannot be read or has the wrong dimension.

        Examples
        --------
        >>> import pidemu
        >>> s = pidemu.load_card("fisher/provox").settings(GAIN=2.0, RESET=4, RATE="30 s")
        >>> s["RESET"].to("s/repeat")
        15.0
        """
        from pidemu.settings.parse import make_settings  # settings depend on cards, not cards on settings

        return make_settings(self, {**(given or {}), **values})


def _usual_place(dial: tuple[str, Any]) -> int:
    role = dial[1].get("sets") if isinstance(dial[1], dict) else None
    return DIAL_ORDER.index(role) if role in DIAL_ORDER else len(DIAL_ORDER)


def match_name(word: str, known: Mapping[str, Any]) -> str | None:
    """Return the known name that `word` spells, in upper or lower case where that is unambiguous."""
    if word in known:
        return word
    folded = [k for k in known if k.casefold() == word.casefold()]
    return folded[0] if len(folded) == 1 else None


def _equation(raw: dict[str, Any], document: Document, chosen: Mapping[str, str]) -> Equation:
    def locate(path: Path_) -> Path_:
        homes = [(), *(("options", option, "choices", choice) for option, choice in chosen.items())]
        held = [next(n for n in range(len(path), -1, -1) if _holds(document.value, (*home, *path[:n]))) for home in homes]
        if not _holds(raw, path):  # a choice took it away
            held[0] = min(held[0], len(path) - 1)
        best = max(range(len(homes)), key=lambda i: (held[i], i if held[i] else -i))
        return (*homes[best], *path)

    from pidemu.card.validation import validated

    return validated(Equation, raw, document, locate)


def _refuse_wrong_references(variant: Variant) -> None:
    """Refuse an equation that names a setting which is not there, or sets something else: nothing could be computed with it."""
    settings, document = variant.equation.settings, variant.card.document
    found = []
    for path, name, role in named_settings(variant.equation):
        setting = settings.get(name)
        if setting is None:
            found.append(document.problem(variant.home(path), f"no setting '{name}'{suggest(name, settings)}"))
        elif setting.sets != role:
            message = f"'{name}' sets the {setting.sets}; here one that sets the {role} is needed"
            found.append(document.problem(variant.home(path), message))
    if found:
        raise CardError(capped(found))


def card_from(document: Document, card_id: str) -> Card:
    """Return the card that a document describes.

    Parameters
    ----------
    document : Document
        The file, read.
    card_id : str
        ``vendor/block``.

    Raises
    ------
    CardError
        The document is no valid card: every problem, located, in the card itself and in each choice of its options.
    """
    if "card" not in document.value:  # what another file holds is not told
        raise CardError([document.problem((), "missing key 'card'")])
    from pidemu.card.validation import validated

    data = validated(CardFile, document.value, document)
    card = Card(card_id, data, document)
    found: list[Problem] = []
    for name, option in data.options.items():
        if option.default not in option.choices:
            message = f"default '{option.default}' is not one of the choices: {', '.join(option.choices)}"
            raise CardError([document.problem(("options", name, "default"), message)])
    combinations = math.prod(len(option.choices) for option in data.options.values())
    if combinations > MOST_COMBINATIONS:
        message = (
            f"the options can be chosen in {combinations} ways, at most {MOST_COMBINATIONS} are checked; make it several cards"
        )
        raise CardError([document.problem(("options",), message, at_key=True)])
    for name, option in data.options.items():
        for choice, changed in option.choices.items():
            where = ("options", name, "choices", choice)
            unknown = [key for key in changed if key not in EQUATION_KEYS]
            found += [
                document.problem((*where, key), f"unknown key '{key}'{suggest(key, EQUATION_KEYS)}", at_key=True) for key in unknown
            ]
            if not unknown:
                try:
                    card.variant({name: choice})
                except CardError as error:
                    found += error.problems
    if found:
        raise CardError(capped(found))
    return card


def load_file(file: Path, card_id: str | None = None, shown: str | None = None) -> Card:
    """Read a card from a file.

    Parameters
    ----------
    file : Path
        ``<vendor>/<block>.yaml``.
    card_id : str, optional
        Its id; by default from the last two parts of the path.
    shown : str, optional
        The file's name in messages.

    Raises
    ------
    CardError
        See `card_from` and `pidemu.card.reading.parse`; or its name cannot be an id.
    """
    path = Path(os.path.realpath(file))  # which also says something of links that go round
    card_id = card_id or card_id_of(path)
    wrong = wrong_id(card_id)
    if wrong is not None:
        raise CardError([Problem(shown or str(file), 1, 1, wrong)])
    name = visible(shown or str(file))
    text = read_text(path, CardError, CARD, shown=name)
    compiled = store.find(digest_of(text))
    if compiled is not None:
        document = Document(name, (), compiled.value, digest=digest_of(text), unread=path)
        return Card(card_id, compiled.data, document, compiled)
    from pidemu.card.reading import parse

    return card_from(parse(text, name), card_id)


def status_counts(card: Card) -> dict[str, int]:
    """Return how many fields of the default variant have each status."""
    found = Counter(s.evidence.status for s in card.variant().statements if s.evidence)
    return {s.value: found[s] for s in Status}


def compiled(card: Card) -> tuple[store.CompiledCard, dict[str, Any]]:
    """Return a card as plain data, and what it says of itself in short.

    Raises
    ------
    CardError
        Two choices, each fine by itself, do not go together.
    """
    equations = {tuple(variant.chosen.values()): variant.equation for variant in variants(card)}
    short = {"title": card.title, "status": status_counts(card), "verification": card.verification.class_}
    return store.CompiledCard.of(card.document.value, card.data, equations), short


def keep(card: Card) -> None:
    """Keep a card compiled, for the next time that it is loaded; it must be known to be right."""
    if card.compiled is None:
        with contextlib.suppress(CardError):
            store.keep(card.digest, *compiled(card))
