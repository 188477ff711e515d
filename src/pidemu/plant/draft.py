"""A mapping that explains itself, drafted from lists: what was taken for what, why, and how often each word stands there."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

import yaml

from pidemu.card.library import cards
from pidemu.plant.fields import Field, folded
from pidemu.plant.layout import ListLayout, find_layout
from pidemu.plant.lines import LoopLine, split_sheet
from pidemu.plant.loop_cells import LoopCells
from pidemu.plant.mapping import PlantWords
from pidemu.plant.settings_units import UNIT_FIELDS
from pidemu.plant.source_options import OPTION_FIELDS
from pidemu.plant.sources import LoopSource
from pidemu.plant.unit_words import readings_of

_SAMPLES: Final = 3
_HEAD: Final = """\
# How the words of these lists are to be read. Drafted by pidemu retrofit --draft-map; edit it, and give it with --map.
# Lines that begin with # are remarks. A word that is not known stops its loops, it is never guessed.
"""


def draft_mapping(sources: Sequence[LoopSource], words: PlantWords) -> str:
    """Return a mapping file for lists.

    Parameters
    ----------
    sources : sequence of LoopSource
        The files.
    words : PlantWords
        What is known of the words already.
    """
    layouts = [
        layout
        for source in sources
        for sheet in source.sheets
        if words.is_read(sheet.name, sheet.hidden)
        and (layout := find_layout(sheet, words.columns_of(sheet.name), words.header_of(sheet.name))) is not None
    ]
    loops = [(layout, loop) for layout in layouts for loop in split_sheet(layout)[0]]
    cells = [LoopCells(loop, layout) for layout, loop in loops]
    lines = [
        _HEAD,
        *_about_sheets(sources, layouts, loops),
        *_systems(cells, words),
        *_action_words(cells, words),
        *_options(cells, words),
    ]
    return "\n".join([*lines, *_units(cells), "blank-units: card      # card: the card's own, flagged; ask: a decision", ""])


def _about_sheets(
    sources: Sequence[LoopSource], layouts: Sequence[ListLayout], loops: Sequence[tuple[ListLayout, LoopLine]]
) -> Iterator[str]:
    taken = {id(layout.sheet) for layout in layouts}
    for source in sources:
        for sheet in source.sheets:
            for note in sheet.notes:
                yield f"# {sheet.shown}: {note}"
            if id(sheet) not in taken:
                yield f"# {sheet.shown}: {'hidden, ' if sheet.hidden else ''}not read"
    yield ""
    yield "# Columns. What a header says by itself need not be written down; FIELD in place of a field is one of"
    yield "# tag, service, area, system, gain, integral, derivative, gain-unit, ..., other (not needed)."
    yield "columns:"
    known = False
    for layout in layouts:
        yield f"  # {layout.sheet.shown}: header in line {layout.header}, {sum(1 for at, _ in loops if at is layout)} loops"
        for column in layout.columns:
            unit = ", ".join(f"{n.word} in {n.unit}" for n in column.names if n.unit)
            if column.field is not None:
                told = "; ".join(x for x in (column.why, unit, "hidden" if column.hidden else "") if x)
                yield f"  #   {_comment(column.header)}: {column.field.replace('_', '-')} ({told})"
        unknown = [c for c in layout.columns if c.field is None]
        if unknown:
            known = True
            yield f"  {_text(layout.sheet.name or '*')}:"
            for column in unknown:
                samples = [line.cells[column.index].text for line in layout.sheet.lines if column.index in line.cells][
                    1 : 1 + _SAMPLES
                ]
                yield f"    {_text(column.header)}: other      # not known; such as {_comment(', '.join(samples)) or 'nothing'}"
    if not known:
        yield "  {}"


def _counted(cells: Iterable[LoopCells], field: Field) -> Counter[str]:
    return Counter(text for c in cells if (text := c.text(field)))


def _systems(cells: Sequence[LoopCells], words: PlantWords) -> Iterator[str]:
    yield ""
    yield "# Cells under System, with how many loops have them, and the card that each means. pidemu cards lists the cards."
    yield "systems:"
    found: dict[str, list[tuple[str, int]]] = defaultdict(list)
    for word, n in sorted(_counted(cells, "system").items()):
        card = words.card_of(word)
        found["" if card is None else card.id].append((word, n))
    for card_id, names in sorted(found.items()):
        if card_id:
            yield f"  {card_id}: [{', '.join(_text(word) for word, _ in names)}]      # {', '.join(f'{n} loops' for _, n in names)}"
    for word, n in found.get("", []):
        guess = guessed_card(word)
        told = "; a guess, take the # away if it is right" if guess else ""
        yield f"  # {guess or 'VENDOR/BLOCK'}: [{_text(word)}]      # {n} loops{told}"
    if set(found) <= {""}:
        yield "  {}"


def guessed_card(word: str) -> str:
    """Return the card that a system's name may mean: the block or product whose name stands in it; empty where there is none.

    Examples
    --------
    >>> guessed_card("TDC3000 RegPV/Ctl"), guessed_card("CLX PIDE"), guessed_card("Unknown")
    ('honeywell/tdc3000', 'allen-bradley/pide', '')
    """
    plain = folded(word).replace("/", "")
    found = []
    for card_id in cards():
        vendor, _, block = card_id.partition("/")
        name = folded(block) if vendor != "generic" else ""
        score = len(name) if len(name) > 2 and name in plain else 0
        score += len(folded(vendor)) if folded(vendor) in plain else 3 if score and folded(vendor)[:3] in plain else 0
        if score > 2:
            found.append((-score, card_id))
    return min(found)[1] if found else ""


def _action_words(cells: Sequence[LoopCells], words: PlantWords) -> Iterator[str]:
    yield ""
    yield "# Words for the action. Reverse: the output falls when the measurement rises. Vendors differ: look at the controller."
    yield "words:"
    by_action: dict[str, list[str]] = {"reverse": [], "direct": []}
    unknown = []
    for word, n in sorted(_counted(cells, "action").items()):
        meant = words.actions.meaning(word)
        if meant is None:
            unknown.append(f"{word} ({n} loops)")
        else:
            by_action[meant].append(word)
    for action, found in by_action.items():
        yield f"  {action}: [{', '.join(map(_text, found))}]"
    if unknown:
        yield f"  # not known, so that these loops stop: {_comment(', '.join(unknown))}"


def _options(cells: Sequence[LoopCells], words: PlantWords) -> Iterator[str]:
    yield ""
    yield "# Words for options of the cards: form, equation, structure, what the derivative acts on."
    yield "options:"
    table: dict[str, dict[str, dict[str, set[str]]]] = defaultdict(lambda: defaultdict(lambda: defaultdict(set)))
    unknown: Counter[tuple[str, str]] = Counter()
    for c in cells:
        card = words.card_of(c.text("system")) if c.text("system") else None
        for field in OPTION_FIELDS if card is not None else ():
            text = c.text(field)
            if card is None or not text:
                continue
            meaning = words.options.meaning(card, text)
            if meaning is None:
                unknown[card.id, text] += 1
            else:
                table[card.id][meaning[0]][meaning[1]].add(text)
    for card_id, options in sorted(table.items()):
        yield f"  {card_id}:"
        for option, choices in options.items():
            inner = ", ".join(
                f"{_text(choice)}: [{', '.join(map(_text, sorted(found)))}]" for choice, found in sorted(choices.items())
            )
            yield f"    {option}: {{{inner}}}"
    if not table:
        yield "  {}"
    for (card_id, text), n in sorted(unknown.items()):
        yield f"  # {card_id}: {_comment(text)} ({n} loops) is not a choice of an option"


def _units(cells: Sequence[LoopCells]) -> Iterator[str]:
    yield ""
    yield "# Units where list and header state none: for example"
    yield "#   honeywell/tdc3000: {integral: min/repeat, derivative: min}"
    for setting, field in UNIT_FIELDS.items():
        for word, n in sorted(_counted(cells, field).items()):
            several = readings_of(setting, word)
            what = (
                "not a unit that is known" if not several else several[0] if len(several) == 1 else f"open: {' or '.join(several)}"
            )
            yield f"#   {setting}: '{_comment(word)}' ({n} loops) is {what}"
    yield "units: {}"


def _text(text: str) -> str:
    """Return a word as YAML writes it in a list or as a key."""
    written: str = yaml.safe_dump(text, default_flow_style=True, allow_unicode=True, width=10_000)
    plain = written.removesuffix("\n").removesuffix("...").rstrip()
    return plain if plain[:1] in "'\"" or not set(plain) & set(":#,[]{}&*!|>'\"%@`?-") else f'"{plain.replace(chr(34), chr(39))}"'


def _comment(text: str) -> str:
    """Return text that stands in a remark: one line."""
    return " ".join(text.split())
