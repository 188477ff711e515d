"""What a conversion states, in its order and words: alike on the terminal and on the page."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING, Final

from pidemu.card.model.verification import short_basis
from pidemu.certificate.figures import decibels, degrees, emulation_line, kick_line, other_units, percent, unit_of
from pidemu.certificate.models import EXACT
from pidemu.certificate.unverified import facts, unverified_law, unverified_program
from pidemu.conversion.conditions import Condition
from pidemu.conversion.target.computed import is_computed
from pidemu.formatting import number
from pidemu.settings.settings import Settings, Value

if TYPE_CHECKING:
    from pidemu.conversion.result import Conversion
    from pidemu.cutover.plan import TransferPlan

MATCHES: Final = {
    "exact": "the same law for measurement",
    "same-numbers": "the source's own numbers",
    "low-frequency": "the same law at low frequencies, where the integral works",
    "textbook": "by the rule in manuals",
    "frequency": "the same gain and phase at one frequency",
    "loop": "the load response of the loop changes least",
    "constrained": "the largest deviation in the loop band is least",
}
"""What the settings were made to agree in."""


@dataclass(frozen=True, slots=True)
class Row:
    """A dial in print.

    Attributes
    ----------
    name, value, unit, other : str
        Its name, its value and unit, and the value in the other usual unit.
    note : str
        Of the source where the number is from, of the target what the textbook rule gives.
    dial : Value
        The dial.
    """

    name: str
    value: str
    unit: str
    other: str
    note: str
    dial: Value

    @property
    def cells(self) -> list[str]:
        """The row as cells of a table."""
        return [self.name, self.value, self.unit, self.other, self.note]


def source_rows(s: Settings) -> list[Row]:
    """Return the source's dials in use."""
    return [_row(n, v, "" if v.given else "card's default", _typed_digits(v)) for n, v in s.items() if v.active]


def _typed_digits(v: Value) -> int:
    """Return the digits of a dial that was typed as a plain number, six at least."""
    return max(6, len(Decimal(repr(v.value)).as_tuple().digits)) if isinstance(v.typed, float | int) else 6


def target_rows(c: Conversion) -> list[Row]:
    """Return the target's dials in use, with what the textbook rule gives; those of `neutral_line` have their own place."""
    book = c.textbook.settings
    used = ((n, v) for n, v in c.settings.items() if v.active and not _is_neutral(c.settings, n, v))
    rows = ((n, v, book[n] if book is not None and n in book else None) for n, v in used)
    digits = max(c.request.digits or 0, 6)
    return [_row(n, v, "-" if rule is None or not rule.active else _value(rule), digits) for n, v, rule in rows]


def neutral_line(s: Settings) -> str:
    """Return the dials that a conversion does not compute and that have to be off; empty where there are none."""
    found = [f"{n} {_value(v)} {unit_of(v) if _value(v) != 'off' else ''}".rstrip() for n, v in s.items() if _is_neutral(s, n, v)]
    return f"neutral, to be set so: {', '.join(found)}" if found else ""


def _is_neutral(s: Settings, name: str, v: Value) -> bool:
    return v.active and v.off and not is_computed(s.equation, name, v.role)


def _row(name: str, v: Value, note: str, digits: int = 6) -> Row:
    value = _value(v, digits)
    return Row(name, value, unit_of(v), "" if value == "off" else other_units(v), note, v)


def _value(v: Value, digits: int = 6) -> str:
    """Return a dial's number; nobody can type the infinity at which a card delivers a dial that is off."""
    return "off" if v.off and math.isinf(v.value) and not v.given else number(v.value, digits)


def side_title(s: Settings) -> str:
    """Return vendor, product and algorithm with the options."""
    return s.card.title + (f"  [{s.variant.choice_text}]" if s.options else "")


def ranges_line(s: Settings) -> str:
    """Return the signal ranges; empty where none was given."""
    given = [f"{name} {ends}" for name, ends in (("PV", s.pv_range), ("OP", s.op_range)) if ends is not None]
    return f"ranges: {', '.join(given)}" if given else ""


def lag_line(s: Settings) -> str:
    """Return the lag that has to stand in front of a block; empty where there is none."""
    return f"in front of it, on PV: a first-order lag of {number(s.lag)} s" if s.lag else ""


def pace_line(s: Settings) -> str:
    """Return that a controller is not executed at the interval it computes with; empty where it is."""
    if s.pace == 1:
        return ""
    return f"executed at {number(s.pace)} times the interval it computes with: its times are {number(s.pace)} times these"


def chosen_line(c: Conversion) -> str:
    """Return the options that were chosen automatically; empty where none was."""
    return f"chosen automatically: {', '.join(f'{n}={x}' for n, x in c.chosen.items())}" if c.chosen else ""


def sections(c: Conversion) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield what stands below the verdict, headings with their items; without those that have none."""
    found = (
        ("Other settings", tuple(f"{b.text}" + (f"  ({b.how})" if b.how else "") for b in c.beside)),
        ("Conditions", tuple(condition_line(x) for x in c.conditions)),
        ("At the loop", c.at_the_loop),
        ("Watch for", c.warnings),
        ("Read as", (*c.source.notes, *c.settings.notes)),
    )
    yield from ((title, items) for title, items in found if items)


def condition_line(condition: Condition) -> str:
    """Return a condition with its reason and its spread, in one line."""
    why = f": {condition.why}" if condition.why else ""
    spread = f"; {condition.spread}" if condition.spread else ""
    return f"{condition.text} ({condition.status}{why}){spread}"


def figure_lines(c: Conversion) -> list[str]:
    """Return what stands below the table of figures."""
    lines = (emulation_line(c.certificate), basis_line(c), kick_line(c.certificate), _textbook_line(c))
    return [line for line in lines if line]


def basis_line(c: Conversion) -> str:
    """Return what running the two rests on: how the emulation of each was verified."""
    sides = {s.card.id: short_basis(s.card.data.verification) for s in (c.source, c.settings)}
    return f"what emulations rest on: {'; '.join(f'{card} {words}' for card, words in sides.items())}"


def proof_lines(c: Conversion) -> tuple[str, ...]:
    """Return the proof that both laws are the same, indented; empty where they are not, or where it was not decided."""
    proof = c.proof
    return proof.text if proof is not None and proof.decided and proof.feedback_equal else ()


def bump_line(plan: TransferPlan) -> str:
    """Return what a cut-over does to the output."""
    bump, without = (number(round(x, 9) + 0.0) for x in (plan.bump, plan.without_plan))
    return f"the output then moves by {bump} % of span; without this, by {without} %"


def unverified(c: Conversion) -> list[str]:
    """Return what else of the two cards is assumed or inferred and at work at these settings, beside the conditions."""
    named = {(x.card, x.path) for x in c.conditions}
    found: list[str] = []
    for s in (c.source, c.settings):
        keys = {x.key for x in s.variant.statements if (s.card.id, x.path) in named}
        program = unverified_program(s, scan=c.scan is not None, limits=c.request.limits is not None)
        statements = [*unverified_law(s, rules=True, action=True), *program]
        found += [f"{s.card.id}: {fact}" for fact in facts(x for x in statements if x.key not in keys)]
    return list(dict.fromkeys(found))


def _textbook_line(c: Conversion) -> str:
    """Return how near the textbook rule would come; nothing where it is what was used."""
    book = c.textbook
    if book.certificate is None:
        return f"the textbook rule has no answer: {book.reason}"
    if c.match == "textbook":
        return ""
    band = book.certificate.feedback.loop_band
    if band.max_deviation < EXACT:
        return "the textbook rule gives the same law for measurement"
    return f"the textbook rule would deviate by {percent(band.max_deviation)}, {decibels(band)}, {degrees(band)} in the loop band"
