"""Rules on what a card states, and on what it rests: one function each, which says in one sentence why."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from pidemu.card.document import Path_
from pidemu.card.library import is_builtin
from pidemu.card.load import Card, dotted, leaves, variants
from pidemu.card.model.base import Status
from pidemu.card.model.card_file import Equation
from pidemu.card.model.verification import CardVerification
from pidemu.card.references import BY_ROLE, references
from pidemu.errors import Problem, suggest
from pidemu.settings.ranges import RANGES


def reject_wrong_folder(card: Card) -> Iterator[Problem]:
    """The id is the path, so the folder carries the vendor's name."""
    slug = re.sub(r"[^a-z0-9]+", "-", card.data.vendor.lower()).strip("-")
    folder = card.id.split("/")[0]
    if slug != folder:
        yield card.document.problem(
            ("vendor",), f"vendor '{card.data.vendor}' belongs in folder '{slug}', the card is in '{folder}'"
        )


def reject_dangling_sources(card: Card) -> Iterator[Problem]:
    """A claim names a source that is listed."""
    for path, key in _source_references(card):
        if key not in card.data.sources:
            yield card.document.problem(path, f"no source '{key}'{suggest(key, card.data.sources)}; list it under sources")


def reject_unused_sources(card: Card) -> Iterator[Problem]:
    """A source that proves nothing is noise."""
    used = {key for _, key in _source_references(card)}
    for key in card.data.sources:
        if key not in used:
            yield card.document.problem(
                ("sources", key), f"source '{key}' is not used by any evidence, quirk or example", at_key=True
            )


def _source_references(card: Card) -> Iterator[tuple[Path_, str]]:
    for key, evidence in card.data.evidence.items():
        if evidence.source is not None:
            yield ("evidence", key, "source"), evidence.source
    if card.data.verification is not None and card.data.verification.source is not None:
        yield ("verification", "source"), card.data.verification.source
    mentions = [("quirks", i, q.source) for i, q in enumerate(card.data.quirks)]
    mentions += [("examples", i, e.source) for i, e in enumerate(card.data.examples)]
    for part, i, source in mentions:
        if source is not None:
            yield (part, i, "source"), source


def reject_incomplete_evidence(card: Card) -> Iterator[Problem]:
    """Each status owes its reader something: a place in a source, or a reason."""
    for key, e in card.data.evidence.items():
        if e.status in (Status.DOCUMENTED, Status.MEASURED):
            wanted = [n for n in ("source", "at") if getattr(e, n) is None]
        elif e.status is Status.INFERRED:
            wanted = [n for n in ("source", "note") if getattr(e, n) is None]
        else:
            wanted = ["note"] if e.note is None else []
        for name in wanted:
            yield card.document.problem(("evidence", key), f"'{e.status.value}' needs '{name}'", at_key=True)


def reject_proof_from_another_product(card: Card) -> Iterator[Problem]:
    """What a source says of another product is no more than a reason to infer the same of this one."""
    for key, e in card.data.evidence.items():
        source = card.data.sources.get(e.source or "")
        if e.status in (Status.DOCUMENTED, Status.MEASURED) and source is not None and source.product is not None:
            message = f"'{e.source}' is about {source.product}, which does not make this {e.status.value}; write 'inferred' and why"
            yield card.document.problem(("evidence", key, "status"), message)


def reject_evidence_for_nothing(card: Card) -> Iterator[Problem]:
    """An evidence path leads to something in the card."""
    known = dict.fromkeys(dotted(path[:n]) for path in leaves(card.document.value) for n in range(1, len(path) + 1))
    for key in card.data.evidence:
        if key not in known:
            if key == "emulation":
                message = "how the scan program was verified stands under 'verification', not under evidence"
                yield card.document.problem(("evidence", key), message, at_key=True)
                continue
            yield card.document.problem(("evidence", key), f"nothing at '{key}' in this card{suggest(key, known)}", at_key=True)


def reject_fields_without_evidence(card: Card) -> Iterator[Problem]:
    """Every field of the algorithm says where it comes from, if only that it is assumed."""
    seen = set()
    for variant in variants(card):
        for path in leaves(variant.raw):
            home = variant.home(path)
            if home not in seen and card.evidence_key(home) is None:
                yield card.document.problem(
                    home, f"no evidence covers '{dotted(home)}'; add it under evidence, if only as assumed", at_key=True
                )
            seen.add(home)
    for name in card.data.options:
        if card.evidence_key(("options", name, "default")) is None:
            yield card.document.problem(("options", name, "default"), f"no evidence covers 'options.{name}.default'", at_key=True)


def reject_overlapping_options(card: Card) -> Iterator[Problem]:
    """Two options that change the same field would make their order matter."""
    owner: dict[Path_, str] = {}
    for name, option in card.data.options.items():
        mine = {path for fields in option.choices.values() for path in leaves(fields) if path}
        for path in sorted(mine, key=dotted):
            other = owner.setdefault(path, name)
            if other != name:
                message = f"'{dotted(path)}' is changed by option {other} as well; let one option do it"
                yield card.document.problem(("options", name), message, at_key=True)


def reject_unused_settings(card: Card) -> Iterator[Problem]:
    """A dial does something under some choice of options."""
    used = {name for variant in variants(card) for name in _used(variant.equation)}
    for variant in variants(card):
        for name in variant.equation.settings:
            if name not in used:
                yield card.document.problem(variant.home(("settings", name)), f"nothing uses '{name}'", at_key=True)


def _used(equation: Equation) -> Iterator[object]:
    """Yield the settings that an equation uses: by a field that names them, or by their role."""
    yield from (name for _, name, _ in references(equation))
    off = {"integral": equation.integral.on == "none", "derivative": equation.derivative.on == "none"}
    yield from (n for n, s in equation.settings.items() if s.sets in BY_ROLE and not off.get(s.sets, False))


def reject_unfounded_verification(card: Card) -> Iterator[Problem]:
    """A card says V1 or V2 of itself only with what shows it, and V3 with the reason why there is nothing better."""
    v = card.data.verification
    if v is None:
        return
    place = ("verification",)
    if v.class_ == "V3":
        if v.note is None:
            yield card.document.problem(place, "'V3' needs 'note': why there is nothing better", at_key=True)
        for name in ("records", "package", "test"):
            if getattr(v, name):
                yield card.document.problem((*place, name), f"'V3' is by the law alone; with '{name}' it is V1 or V2", at_key=True)
        return
    for name in ("source", "at"):
        if getattr(v, name) is None:
            yield card.document.problem(place, f"'{v.class_}' needs '{name}'", at_key=True)
    source = card.data.sources.get(v.source or "")
    if source is not None and source.product is not None:
        message = f"'{v.source}' is about {source.product}, which verifies nothing of this card; write V3 and why"
        yield card.document.problem((*place, "source"), message)
    if v.class_ == "V2" and v.package:
        yield card.document.problem((*place, "package"), "a package that runs is the real program: V1", at_key=True)
    yield from _unshown(card, v)


def _unshown(card: Card, v: CardVerification) -> Iterator[Problem]:
    """Yield what a claim lacks that can be run: by pidemu's tests for its own cards, by the check itself for all others."""
    place = ("verification",)
    if is_builtin(Path(card.document.path)):
        if v.test is None and not v.records:
            yield card.document.problem(place, f"'{v.class_}' needs 'test' or 'records': what compares", at_key=True)
        if v.class_ == "V1" and not (v.records or v.package):
            message = "'V1' needs 'records' or 'package': the real program's outputs, or the program itself"
            yield card.document.problem(place, message, at_key=True)
        return
    if not v.records:
        message = (
            f"'{v.class_}' needs 'records': recorded outputs beside the card, which the check runs it against; "
            "without them leave 'verification' out, which is V3"
        )
        yield card.document.problem(place, message, at_key=True)
        return
    for name in ("test", "package"):
        if getattr(v, name):
            yield card.document.problem((*place, name), f"'{name}' is for cards that come with pidemu; remove it", at_key=True)


def reject_ambiguous_names(card: Card) -> Iterator[Problem]:
    """Settings and options are told apart by name alone, in upper or lower case."""
    seen: dict[str, str] = {}
    for name in [*card.all_settings(), *card.data.options]:
        path = ("options", name) if name in card.data.options else ("settings", name)
        if name in RANGES:
            yield card.document.problem(path, f"'{name}' is reserved for the signal range", at_key=True)
        if name.casefold() in seen:
            yield card.document.problem(path, f"'{name}' and '{seen[name.casefold()]}' cannot be told apart", at_key=True)
        seen[name.casefold()] = name


RULES: Final[tuple[Callable[[Card], Iterator[Problem]], ...]] = (
    reject_wrong_folder,
    reject_dangling_sources,
    reject_unused_sources,
    reject_incomplete_evidence,
    reject_proof_from_another_product,
    reject_evidence_for_nothing,
    reject_fields_without_evidence,
    reject_overlapping_options,
    reject_unused_settings,
    reject_unfounded_verification,
    reject_ambiguous_names,
)
