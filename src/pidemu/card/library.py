"""Finding cards: the built-in ones, and folders of the user's own."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from pidemu.card.load import Card, load_file
from pidemu.errors import CardError, CardNotFoundError, suggest

ENVIRONMENT = "PIDEMU_VENDORS"
"""Folders of cards, separated like PATH, searched before the built-in ones."""

_loaded: dict[tuple[Path, str | None], tuple[int, Card | CardError]] = {}
"""Cards read so far, or what is wrong with them, by file and id, with the time the file was changed."""


def builtin_folder() -> Path:
    """Return the folder of the built-in cards: in the wheel, or in the repository of an editable install.

    Raises
    ------
    CardNotFoundError
        Neither is there: the installation is damaged.
    """
    package = Path(__file__).resolve().parent.parent
    for folder in (package / "vendors", package.parent.parent / "vendors"):
        if folder.is_dir():
            return folder
    raise CardNotFoundError(f"no built-in cards beside {package}; install pidemu again")


def folders(extra: Sequence[str | Path] = ()) -> list[Path]:
    """Return the folders searched for cards, first hit wins: `extra`, those in PIDEMU_VENDORS, the built-in one.

    Raises
    ------
    CardNotFoundError
        A folder named by the user does not exist.
    """
    named = [Path(f) for f in extra] + [Path(f) for f in os.environ.get(ENVIRONMENT, "").split(os.pathsep) if f]
    for folder in named:
        if not folder.is_dir():
            raise CardNotFoundError(f"no folder '{folder}'; a folder of cards holds <vendor>/<block>.yaml")
    return [*named, builtin_folder()]


def card_files(vendors: Sequence[str | Path] = ()) -> dict[str, Path]:
    """Return the file of every card, by id, sorted."""
    found: dict[str, Path] = {}
    for folder in folders(vendors):
        for file in folder.glob("*/*.yaml"):
            found.setdefault(f"{file.parent.name}/{file.stem}", file)
    return dict(sorted(found.items()))


def cards(vendors: Sequence[str | Path] = ()) -> list[str]:
    """Return the ids of all cards.

    Parameters
    ----------
    vendors : sequence of path, optional
        Folders of the user's own cards, searched before the built-in ones.
    """
    return list(card_files(vendors))


def load_card(name: str | Path, vendors: Sequence[str | Path] = ()) -> Card:
    """Return a card.

    Parameters
    ----------
    name : str or path
        The card's id, such as ``"fisher/provox"``, or the path of a ``.yaml`` file.
    vendors : sequence of path, optional
        Folders of the user's own cards, searched before the built-in ones.

    Returns
    -------
    Card
        The card, read once and kept as long as its file does not change. A card that is not built in is checked as
        ``pidemu check`` does it.

    Raises
    ------
    CardNotFoundError
        There is no such card.
    CardError
        The card is wrong: every fault with its file, line and column.
    """
    name = name.as_posix() if isinstance(name, Path) else name
    file = Path(name) if name.endswith((".yaml", ".yml")) else None
    card_id = name if file is None else None
    if file is None:
        file = next((f for d in folders(vendors) if _is_file(f := d / f"{name}.yaml")), None) if _is_id(name) else None
        if file is None:
            known = cards(vendors)
            hint = suggest(name, known) or _suggest_block(name, known)
            raise CardNotFoundError(f"no card '{name}'{hint}; 'pidemu cards' lists them")
    elif not _is_file(file):
        raise CardNotFoundError(f"no file '{name}'")
    key, changed = (file.absolute(), card_id), file.stat().st_mtime_ns
    kept = _loaded.get(key)
    if kept is None or kept[0] != changed:
        kept = _loaded[key] = (changed, _read(file, card_id))
    if isinstance(kept[1], CardError):
        raise kept[1].with_traceback(None)
    return kept[1]


def _read(file: Path, card_id: str | None) -> Card | CardError:
    """Return the card of a file, or what is wrong with it; the built-in ones are checked when they are built in."""
    try:
        card = load_file(file, card_id)
    except CardError as error:
        return error
    if file.resolve().is_relative_to(builtin_folder().resolve()):
        return card
    from pidemu.checks import check  # the rules run a card, and everything that runs one depends on cards

    problems = check(card)
    return CardError(problems) if problems else card


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # such as a name that is longer than that of any file
        return False


def _suggest_block(name: str, known: list[str]) -> str:
    """Suggest the card whose second part is nearest to what was written."""
    hint = suggest(name.rsplit("/", 1)[-1], [k.split("/")[1] for k in known])
    return next((f" (did you mean '{k}'?)" for k in known if hint and f"'{k.split('/')[1]}'" in hint), "")


def _is_id(name: str) -> bool:
    parts = name.split("/")
    return len(parts) == 2 and all(p not in ("", ".", "..") and "\\" not in p for p in parts)
