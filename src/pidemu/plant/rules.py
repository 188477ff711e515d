"""The plant's rules: the target, its options, and what stops a loop; for the job, by source, loop type, area or tag."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import Field

from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.card.model.base import Number, Text
from pidemu.card.validation import Model
from pidemu.conversion.match_method import read_aim
from pidemu.errors import ListError, PidemuError, SettingError, suggest
from pidemu.files.reading import Kind
from pidemu.parsing import seconds
from pidemu.plant.codes import Level, code_named
from pidemu.plant.mapping import read_yaml

_KIND: Final = Kind("a rule file", "a rule file is YAML text that states target: and options:", limit=2**20)
MATCH_SOURCE: Final = "match-source"
AS_NEEDED: Final = "free"
"""A dial that the conversion may set as it needs it."""
EXACT_ELSE: Final = "exact-else-low-frequency"
PvFilter = Literal["carry", "in front", "leave out"]
_LOOP_TYPE: Final = re.compile(r"[A-Za-z]+")


class SecondTarget(Model):
    """Another target of the same job."""

    card: Text = Field(description="Its card.")
    options: dict[Text, str | Number | bool] = Field(default={}, description="Its options.")


class RuleFile(Model):
    """How a plant wants its loops converted."""

    about: Text | None = Field(default=None, description="What the rules are for.")
    target: Text | None = Field(default=None, description="The card to convert to.")
    options: dict[Text, str | Number | bool] = Field(
        default={},
        description="Options and dials of the target: a choice, match-source (the choice that does as the source does), or free.",
    )
    by_source: dict[Text, dict[Text, Any]] = Field(default={}, description="Options, digits, match, pv-filter by source card.")
    by_type: dict[Text, dict[Text, Any]] = Field(default={}, description="The same by loop type: the letters of the tag.")
    by_area: dict[Text, dict[Text, Any]] = Field(default={}, description="The same by area.")
    by_tag: dict[Text, dict[Text, Any]] = Field(default={}, description="The same by pattern of the tag: FIC-70*.")
    scan_compensation: Literal["off", "on"] | bool = Field(default="off", description="Whether settings make up for other scans.")
    match: Text | None = Field(default=None, description="exact-else-low-frequency, or a match of pidemu convert.")
    digits: int | None = Field(default=None, ge=1, le=17, description="Significant digits.")
    scan_classes: dict[Text, Text | Number] = Field(default={}, description="The target's scan interval by loop type.")
    pv_filter: PvFilter = Field(default="carry", description="What becomes of a filter of the measurement.")
    second_target: SecondTarget | None = Field(default=None, description="Another target of the same lists.")
    stop: list[Text] | Text = Field(
        default=[],
        description="What needs a decision: codes, or words for them, as a list or with commas between. They stop loops anyway.",
    )
    levels: dict[Text, Literal["error", "decision", "flag"]] = Field(default={}, description="Codes with another level.")
    allowed_deviation: Number | None = Field(
        default=None, description="Largest deviation in the loop band that is converted [%]; beyond, the loop needs a decision."
    )


_SCOPED: Final = ("digits", "match", "pv-filter")
"""What beside options can be ruled by source, type, area or tag."""


@dataclass(frozen=True)
class LoopRules:
    """What the rules say of one loop.

    Attributes
    ----------
    options : dict
        Options and dials of the target, ``match-source`` and ``free`` among them.
    match : str or None
    digits : int or None
    pv_filter : str
    origins : dict
        Which line of the rules each option comes from.
    """

    options: Mapping[str, object]
    match: str | None
    digits: int | None
    pv_filter: str
    origins: Mapping[str, str]


@dataclass(frozen=True)
class PlantRules:
    """Rules, ready to be asked.

    Attributes
    ----------
    target : Card
        The card to convert to.
    written : RuleFile
        What the file says.
    second : bool
        Whether `target` is the second one.
    levels : dict
        Level by code, where it is another.
    digest, path : str
        SHA-256 and name of the file; empty without one.
    """

    target: Card
    written: RuleFile = field(default_factory=RuleFile)
    second: bool = False
    levels: Mapping[str, Level] = field(default_factory=dict)
    digest: str = ""
    path: str = ""

    def for_loop(self, source: str, tag: str, area: str) -> LoopRules:
        """Return what holds for a loop: the last rule that matches wins.

        Parameters
        ----------
        source : str
            The source's card.
        tag, area : str
            The loop's tag and area.
        """
        w = self.written
        main: Mapping[str, object] = w.second_target.options if self.second and w.second_target is not None else w.options
        options: dict[str, object] = dict(main)
        origins = dict.fromkeys(options, "second-target" if self.second else "options")
        more: dict[str, Any] = {"digits": w.digits, "match": w.match, "pv-filter": w.pv_filter}
        for scope, key, given in self._matching(source, tag, area):
            for name, value in given.items():
                if name in _SCOPED:
                    more[name] = value
                elif not self.second:
                    options[name], origins[name] = value, f"{scope}: {key}"
        return LoopRules(options, more["match"], more["digits"], str(more["pv-filter"]), origins)

    def _matching(self, source: str, tag: str, area: str) -> list[tuple[str, str, dict[str, Any]]]:
        w, kind = self.written, loop_type(tag)
        found = [("by-source", key, given) for key, given in w.by_source.items() if key == source]
        found += [("by-type", key, given) for key, given in w.by_type.items() if key.casefold() == kind.casefold()]
        found += [("by-area", key, given) for key, given in w.by_area.items() if key.casefold() == area.casefold()]
        return found + [("by-tag", k, given) for k, given in w.by_tag.items() if fnmatch.fnmatchcase(tag.upper(), k.upper())]

    def scan_of(self, tag: str) -> float | None:
        """Return the target's scan interval for a loop, by its type [s]; ``None`` where no class is stated."""
        kind = loop_type(tag).casefold()
        given = next((v for key, v in self.written.scan_classes.items() if key.casefold() == kind), None)
        return None if given is None else seconds(str(given))

    @property
    def compensates(self) -> bool:
        """Whether the settings make up for other scan intervals."""
        return self.written.scan_compensation in ("on", True)


def loop_type(tag: str) -> str:
    """Return the letters that a tag begins with, behind a number of the unit: ``FIC`` of ``10-FIC-7006``."""
    found = _LOOP_TYPE.search(tag)
    return found[0] if found is not None else ""


def read_rules(path: str | Path | None, target: str | Path | Card | None = None) -> PlantRules:
    """Read a rule file.

    Parameters
    ----------
    path : str, Path or None
        The file; without one there is the target alone.
    target : str, Path or Card, optional
        The target; by default that of the file. The second target of the file gets its own options.

    Raises
    ------
    ListError
        The file is missing or wrong, or no target is stated.
    """
    document, written = (None, RuleFile()) if path is None else read_yaml(path, _KIND, RuleFile)
    shown = "the rules" if path is None else str(path)
    wanted = target if target is not None else written.target
    if wanted is None:
        raise ListError("no target is stated; name the card to convert to with --to, or with target: in the rules")
    card = wanted if isinstance(wanted, Card) else load_card(wanted)
    second = written.second_target is not None and card.id == written.second_target.card and card.id != written.target
    for word in written.stop.split(",") if isinstance(written.stop, str) else written.stop:
        code_named(word.strip())
    levels = {code_named(word).name: level for word, level in written.levels.items()}
    _check_options(card, written, second, shown)
    return PlantRules(card, written, second, levels, "" if document is None else document.digest, "" if path is None else str(path))


def _check_options(card: Card, w: RuleFile, second: bool, shown: str) -> None:
    """Refuse options that the target has not, matches and intervals that are none."""
    given = [("second-target", w.second_target.options)] if second and w.second_target is not None else [("options", w.options)]
    scopes = (("by-source", w.by_source), ("by-type", w.by_type), ("by-area", w.by_area), ("by-tag", w.by_tag))
    given += [] if second else [(f"{name}: {key}", each) for name, table in scopes for key, each in table.items()]
    names = {n.casefold() for n in (*card.options, *card.all_settings())}
    for place, options in given:
        for name, value in options.items():
            if name in _SCOPED:
                continue
            if name.casefold() not in names:
                known = [*card.options, *card.all_settings()]
                raise ListError(f"{shown}: {place}: {card.id} has no option '{name}'{suggest(name, known)}")
            choices = next((c for o, c in card.options.items() if o.casefold() == name.casefold()), None)
            if choices is not None and _written(value) not in (*choices, MATCH_SOURCE, AS_NEEDED):
                raise ListError(f"{shown}: {place}: {name} is '{value}'; it is one of {', '.join((*choices, MATCH_SOURCE))}")
    try:
        if w.match not in (None, EXACT_ELSE):
            read_aim(w.match)
        for value in w.scan_classes.values():
            seconds(str(value))
    except (SettingError, PidemuError) as error:
        raise ListError(f"{shown}: {error}") from None


def _written(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else str(value)


def option_text(value: object) -> str:
    """Return an option's value as cards write it: ``false`` and ``1``, however YAML read it."""
    return _written(value)
