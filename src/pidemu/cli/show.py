"""``pidemu show``."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import click

from pidemu.card.datasheet.at_limits import limit_rows
from pidemu.card.datasheet.behaviour import mode_rows, scan_rows
from pidemu.card.datasheet.text import equation_heading, equation_lines
from pidemu.card.library import load_card
from pidemu.card.load import Card, Variant
from pidemu.card.model.base import Evidence, as_written
from pidemu.card.model.card_file import Example, Setting
from pidemu.card.model.verification import basis
from pidemu.cli.common import (
    RangeArgument,
    TimeArgument,
    assignments,
    echo,
    heading,
    json_option,
    number,
    print_json,
    split_options,
    vendors_option,
    wrapped,
)
from pidemu.cli.common import given as given_ranges
from pidemu.errors import SettingError, suggest
from pidemu.excerpt import visible
from pidemu.formatting import json_safe
from pidemu.settings.ranges import RANGES, SignalRange
from pidemu.settings.settings import off_values

if TYPE_CHECKING:
    from pidemu.explanation.model import Explanation

_WIDTH: Final = 110
_LEAST: Final = 36
"""Narrowest last column."""
_COLOUR: Final = {"assumed": "yellow", "inferred": "cyan", "documented": "green", "measured": "green"}


@click.command("show", short_help="Show a card as a data sheet; or what its settings mean.")
@click.argument("card")
@click.argument("values", nargs=-1, metavar="[NAME=VALUE]...")
@click.option("--scan", type=TimeArgument(), help="Scan interval [s]: kicks and noise gain at it, too.")
@click.option("--pv-range", type=RangeArgument(), help='Range of the measurement, such as "0,400 degC".')
@click.option("--op-range", type=RangeArgument(), help='Range of the output, such as "0,100 %".')
@vendors_option
@json_option
def command(
    card: str,
    values: tuple[str, ...],
    scan: float | None,
    pv_range: SignalRange | None,
    op_range: SignalRange | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Show CARD, an id such as fisher/provox or a file: what its settings NAME=VALUE mean, or its data sheet.

    With settings: gain, integral and derivative time in parallel, standard and series form and in the usual units, filters, which
    terms see the setpoint, kicks and noise gain, the action by the error formula, what was not stated, what the figures rest on.

    Without settings, or with options alone (FORM=Series): the data sheet with equation, settings, evidence and what is assumed.
    """
    found = load_card(card, vendors)
    given = {**assignments(values), **given_ranges(pv_range=pv_range, op_range=op_range)}
    options, dials = split_options(found, given)
    _refuse_unknown(found, dials)
    if dials or scan is not None:
        from pidemu.explanation.explain import explain  # with NumPy, which a data sheet does without

        explained = explain(found.settings(given), scan)
        if as_json:
            print_json(explained.to_dict())
        else:
            _explained(explained)
        return
    variant = found.variant(options)
    if as_json:
        print_json(_plain(variant))
        return
    heading(f"{found.id}   {found.title}")
    if found.data.about:
        wrapped(found.data.about)
    _options(found, variant)
    heading(f"\n{equation_heading(variant)}")
    for line in equation_lines(variant):
        wrapped(line, "  ")
    for title, rows in (("Scan by scan", scan_rows), ("At the limits", limit_rows), ("Modes and signals", mode_rows)):
        heading(f"\n{title}")
        _sheet(rows(variant.equation))
    _settings(variant)
    heading("\nVerification of the scan program")
    wrapped(basis(found.data.verification), "  ")
    _evidence(variant)
    _rest(found)


def _refuse_unknown(card: Card, dials: Mapping[str, object]) -> None:
    """Refuse names that are neither settings nor options, since what is shown depends on which they are."""
    known = [*card.all_settings(), *card.options]
    folded = {name.casefold() for name in (*known, *RANGES)}
    wrong = [name for name in dials if name.casefold() not in folded]
    if wrong:
        which = ", ".join(f"'{name}'{suggest(name, known)}" for name in wrong)
        settings, options = (", ".join(names) or "none" for names in (card.all_settings(), card.options))
        raise SettingError(f"{card.id}: unknown setting or option {which}; settings: {settings}; options: {options}")


def _explained(e: Explanation) -> None:
    """Print an explanation, its headings in bold on a terminal."""
    from pidemu.explanation.text import sections, table_lines

    title, *_ = e.text.split("\n\n", 1)
    heading(title)
    for name, rows in sections(e):
        heading(f"\n{name}")
        for line in table_lines(rows):
            echo(line)


def _sheet(rows: Sequence[Sequence[str]], columns: Sequence[str] = ()) -> None:
    """Print aligned columns, the last of which is wrapped."""
    lines = [[visible(cell) for cell in line] for line in (*([columns] if columns else []), *rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]) - 1)]
    indent = 2 + sum(w + 2 for w in widths)
    total = min(_WIDTH, shutil.get_terminal_size().columns) if sys.stdout.isatty() else _WIDTH
    for line in lines:
        first = "".join(_coloured(cell) + " " * (w - len(cell) + 2) for cell, w in zip(line, widths, strict=False))
        text = textwrap.wrap(line[-1], max(total - indent, _LEAST), break_long_words=False) or [""]
        click.echo(f"  {first}{text[0]}".rstrip())
        for more in text[1:]:
            click.echo(" " * indent + more)


def _coloured(cell: str) -> str:
    return click.style(cell, fg=_COLOUR[cell]) if cell in _COLOUR else cell


def _options(card: Card, variant: Variant) -> None:
    if not card.options:
        return
    heading("\nOptions")
    rows = []
    for name, choices in card.options.items():
        about = card.data.options[name].about
        rows.append([name, variant.chosen[name], ", ".join(choices) + (f": {about}" if about else "")])
    _sheet(rows, ["option", "shown", "choices, the default first"])


def _settings(variant: Variant) -> None:
    heading("\nSettings")
    rows = []
    for name, s in variant.equation.settings.items():
        about = s.about or ""
        if name not in variant.active:
            about = "not used with these options" + (f": {about}" if about else "")
        step = f"in steps of {number(s.resolution)}" if s.resolution is not None else ""
        shared = "one for many loops" if s.scope == "module" else ""
        about = ", ".join(filter(None, (about, step, shared)))
        rows.append([name, s.sets, s.unit, _default(s), _range(s), ", ".join(number(x) for x in off_values(s)), about])
    _sheet(rows, ["name", "sets", "unit", "default", "range", "off", ""])


def _default(s: Setting) -> str:
    return "required" if s.default is None else number(s.default)


def _range(s: Setting) -> str:
    return f"{number(s.range[0])} to {number(s.range[1])}" if s.range else ""


def _evidence(variant: Variant) -> None:
    heading("\nEvidence")
    stated = {s.key: s.evidence for s in variant.statements if s.evidence is not None}
    rows = [[key, e.status.value, _grounds(e)] for key, e in stated.items()]
    _sheet(rows, ["field", "status", "where it is stated, or why it is taken so"])
    assumed = variant.assumptions()
    if assumed:
        heading("\nAssumed: no source states it, and results rest on it")
        for a in assumed:
            wrapped(str(a), "  - ")


def _grounds(e: Evidence) -> str:
    place = f"[{e.source}] {e.at or ''}".strip() if e.source else ""
    between = "; " if e.at and e.note else " " if place and e.note else ""
    return f"{place}{between}{e.note or ''}"


def _rest(card: Card) -> None:
    heading("\nSources")
    for key, s in card.data.sources.items():
        wrapped(
            f"[{key}] {s.title}" + (f", {s.address}" if s.address else "") + f" (read {s.read})" + (f". {s.note}" if s.note else "")
        )
    if card.data.quirks:
        heading("\nQuirks")
        for quirk in card.data.quirks:
            wrapped(quirk.text + (f" [{quirk.source}]" if quirk.source else ""), "  - ")
    heading("\nExamples")
    for example in card.data.examples:
        wrapped(_example(example), "  - ")


def _example(example: Example) -> str:
    given = ", ".join(f"{k}={v if isinstance(v, str) else number(v)}" for k, v in example.given.items()) or "as it comes"
    amounts = []
    if example.canonical is not None:
        c = example.canonical
        gains = f"kp {number(c.kp)}, ki {number(c.ki)} 1/s, kd {number(c.kd)} s"
        amounts.append(gains + (f", Tf {number(c.Tf)} s" if c.Tf else ""))
    if example.outputs:
        moves = ", ".join(number(x) for x in example.outputs)
        amounts.append(f"after a setpoint step of 1 the output has moved by {moves}, scan by scan")
    note = f" ({example.note})" if example.note else ""
    return f"{given}: {'; '.join(amounts)}{note}" + (f" [{example.source}]" if example.source else "")


def _plain(variant: Variant) -> dict[str, object]:
    card = variant.card
    q = variant.equation
    return {
        "card": card.id,
        "title": card.title,
        "verification": card.verification.class_,
        "options": dict(variant.chosen),
        "equation": equation_lines(variant),
        "behaviour": dict([*scan_rows(q), *limit_rows(q), *mode_rows(q)]),
        "content": json_safe(as_written(card.data)),
        "assumed": [a.path for a in variant.assumptions()],
    }
