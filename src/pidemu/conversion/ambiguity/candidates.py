"""What settings may mean on one card: its open options, and its integral dial, combined."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from pidemu.arrays import Complexes
from pidemu.card.load import Card, Variant, match_name
from pidemu.certificate.models import EXACT
from pidemu.conversion.ambiguity.meanings import as_reset_rates, bare, in_words, possible_units, written
from pidemu.errors import CardError, SettingError
from pidemu.settings.ranges import RANGES, option_of
from pidemu.settings.settings import Settings, off_values
from pidemu.units import Role, parse_unit

_FREQUENCIES: Final = np.geomspace(1e-7, 1e4, 133)
"""Where laws are compared [rad/s]: from periods of years to less than a millisecond."""
_TERMS: Final = {Role.GAIN: "proportional", Role.INTEGRAL: "integral", Role.DERIVATIVE: "derivative"}


def response_of(settings: Settings) -> Complexes:
    """Return what tells the law of settings from others."""
    return settings.law().response(_FREQUENCIES)


def law_numbers(responses: Iterable[Complexes]) -> list[int]:
    """Return a number for each law: that of the first one that agrees with it over all frequencies."""
    known: list[Complexes] = []
    numbers = []
    for response in responses:
        number = next((k for k, x in enumerate(known) if np.allclose(response, x, rtol=EXACT, atol=0.0)), len(known))
        if number == len(known):
            known.append(response)
        numbers.append(number)
    return numbers


@dataclass(frozen=True)
class Candidate:
    """Settings of a card under one choice of its options, with one meaning of the integral dial.

    Attributes
    ----------
    settings : Settings
        The settings.
    values : dict
        The dials as given, by the card's names, with the unit of the integral dial.
    about : str
        What the integral dial is taken for, in words.
    way : int
        Which meaning it is; 0: the card's own unit.
    response : array of complex
        What tells its law from others.
    options : dict
        The options that it states: given, open, or not at their default.
    """

    settings: Settings
    values: Mapping[str, object]
    about: str
    way: int
    response: Complexes = field(repr=False, compare=False)
    options: Mapping[str, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """What it is, in short."""
        options = [f"{name}={choice}" for name, choice in self.options.items()]
        return ", ".join(part for part in (self.about, *options, f"card {self.settings.card.id}") if part)

    @property
    def words(self) -> list[str]:
        """Settings, options and ranges as words of the command line."""
        ranges = zip(RANGES, (self.settings.pv_range, self.settings.op_range), strict=True)
        return [
            *(f"{name}={written(value)}" for name, value in self.values.items()),
            *(f"{name}={choice}" for name, choice in self.options.items()),
            *(f"{option_of(name)}={given.argument}" for name, given in ranges if given is not None),
        ]


def candidates_of(card: Card, given: Mapping[str, object]) -> list[Candidate]:
    """Return what settings may mean on one card.

    Parameters
    ----------
    card : Card
        The card.
    given : mapping
        Settings, options and ranges by name, as for `Card.settings`.

    Returns
    -------
    list of Candidate
        One for every meaning of the integral dial, under every choice of those open options that matter; empty where the values
        do not fit the card.
    """
    ranges: dict[str, object] = {name: given[name] for name in RANGES if name in given}
    stated = {name: str(v) for k, v in given.items() if (name := match_name(k, card.options))}
    dials = {k: v for k, v in given.items() if k not in ranges and not match_name(k, card.options)}
    open_options = [name for name in card.options if name not in stated]
    found: dict[tuple[str, ...], list[Candidate]] = {}
    for choice in itertools.product(*(card.options[name] for name in open_options)):
        with contextlib.suppress(SettingError, CardError):  # choices that do not go together
            variant = card.variant({**stated, **dict(zip(open_options, choice, strict=True))})
            found[choice] = _meanings(variant, dials, ranges)
    if any(_at_work(c.settings) for several in found.values() for c in several):
        found = {choice: [c for c in several if _at_work(c.settings)] for choice, several in found.items()}
    found = {choice: several for choice, several in found.items() if several}
    matter = _that_matter(found)
    kept: dict[tuple[str, ...], tuple[str, ...]] = {}
    for choice in found:
        kept.setdefault(tuple(choice[i] for i in matter), choice)
    known = {*stated, *(open_options[i] for i in matter)}
    return [_stating(c, known) for choice in kept.values() for c in found[choice]]


def _that_matter(found: Mapping[tuple[str, ...], Sequence[Candidate]]) -> list[int]:
    """Return which options matter: changed alone, they lead to other laws."""
    numbers = iter(law_numbers(c.response for several in found.values() for c in several))
    reached = {choice: {next(numbers) for _ in several} for choice, several in found.items()}
    matter = set()
    for a, b in itertools.combinations(reached, 2):
        differ = [i for i, (x, y) in enumerate(zip(a, b, strict=True)) if x != y]
        if len(differ) == 1 and reached[a] != reached[b]:
            matter.add(differ[0])
    return sorted(matter)


def _at_work(settings: Settings) -> bool:
    """Whether every gain, integral and derivative setting that is given, and not off, makes a term of its own."""
    terms = [_TERMS[v.role] for v in settings.values() if v.given and not v.off and v.role in _TERMS]
    return all(getattr(settings.equation, term).on != "none" for term in terms)


def _stating(c: Candidate, known: Container[str]) -> Candidate:
    """Return a candidate that states the `known` options and those that are not the default; the rest nobody chose."""
    options = c.settings.options
    left = tuple(name for name, choice in options.items() if name not in known and choice == c.settings.card.options[name][0])
    stated = {name: choice for name, choice in options.items() if name not in left}
    return replace(c, settings=replace(c.settings, defaulted=left), options=stated)


def _meanings(variant: Variant, dials: Mapping[str, object], ranges: Mapping[str, object]) -> list[Candidate]:
    """Return the candidates of one variant: one for every meaning of its integral dial that the card takes."""
    known = variant.equation.settings
    dials = {match_name(k, known) or k: v for k, v in dials.items()}
    name = next((n for n, s in known.items() if Role(s.sets) is Role.INTEGRAL), "")

    def read(way: int, quantity: object, about: str = "") -> Iterator[Candidate]:
        values = {**dials, name: quantity} if name in dials else dials
        with contextlib.suppress(SettingError):  # out of range, unknown, or no controller
            settings = variant.card.settings({**ranges, **variant.chosen, **values})
            yield Candidate(settings, values, about or in_words(settings, quantity), way, response_of(settings))

    number = bare(dials.get(name))
    if number is None or number in off_values(known[name]):
        return list(read(0, dials.get(name)))
    units = possible_units(parse_unit(known[name].unit), variant.equation.form)
    found = [c for way, unit in enumerate(units) for c in read(way, f"{written(dials[name])} {unit}")]
    rates = as_reset_rates(name, number, units, found[0].settings) if found else []
    return [*found, *(c for way, rate in enumerate(rates, start=len(units)) for c in read(way, *rate))]
