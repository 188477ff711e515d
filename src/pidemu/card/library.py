"""Finding cards: the built-in ones, and folders of the user's own."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PureWindowsPath
from typing import TYPE_CHECKING

from pidemu.card import store
from pidemu.card.document import CARD, card_id_of, digest_of, wrong_id
from pidemu.errors import CardError, CardNotFoundError, Problem, suggest
from pidemu.excerpt import shortened, visible
from pidemu.files.reading import read_text
from pidemu.part import part

if TYPE_CHECKING:
    from pidemu.card.load import Card

ENVIRONMENT = "PIDEMU_VENDORS"
"""Folders of cards, separated like PATH, searched before the built-in ones."""

_ENDINGS = (".yaml", ".yml")

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
        if not os.path.isdir(folder):  # pathlib's raises where the folder cannot be looked at
            raise CardNotFoundError(f"no folder '{folder}'; a folder of cards holds <vendor>/<block>.yaml")
    return [*named, builtin_folder()]


def card_files(vendors: Sequence[str | Path] = ()) -> dict[str, Path]:
    """Return the file of every card, by id, sorted."""
    return {card_id: file for card_id, (file, reason) in _found(vendors).items() if reason is None}


def unusable_files(vendors: Sequence[str | Path] = ()) -> list[Problem]:
    """Return what stands where a card would and cannot be one, with the reason: pipes, folders, links that lead nowhere."""
    return [Problem(str(file), 1, 1, reason) for file, reason in _found(vendors).values() if reason is not None]


def unusable(file: Path) -> str | None:
    """Return why a file cannot be a card, before it is opened: a pipe would wait for ever."""
    try:
        mode = file.stat().st_mode
    except (OSError, ValueError) as error:
        return f"cannot be read: {getattr(error, 'strerror', None) or 'not a name of a file'}"
    if stat.S_ISREG(mode):
        return None
    return "a folder; a card is a file" if stat.S_ISDIR(mode) else "a pipe or a device; a card is a plain file"


def _found(vendors: Sequence[str | Path]) -> dict[str, tuple[Path, str | None]]:
    """Return the file of every card by id, sorted, and why it cannot be one."""
    found: dict[str, tuple[Path, str | None]] = {}
    for folder in folders(vendors):
        for place, reason in _inside(folder):
            inside = _inside(place) if reason is None and os.path.isdir(place) else []
            entries = [(place, reason)] if reason is not None else [(f, r) for f, r in inside if r or f.suffix == ".yaml"]
            for file, wrong in entries:
                card_id = f"{file.parent.name}/{file.stem}"
                found.setdefault(card_id, (file, wrong or wrong_id(card_id) or unusable(file)))
    return dict(sorted(found.items()))


def _inside(folder: Path) -> Iterator[tuple[Path, str | None]]:
    """Yield what is in a folder; the folder itself, with the reason, where it cannot be read."""
    try:
        yield from ((entry, None) for entry in folder.iterdir())
    except OSError as error:
        yield folder, f"cannot be read: {error.strerror}"


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
    file = Path(name) if name.endswith(_ENDINGS) else None
    card_id = name if file is None else None
    if file is None:
        named = [d / f"{name}.yaml" for d in folders(vendors)] if _is_id(name) else []
        file = next((f for f in named if os.path.lexists(f)), None)
    if file is None or not os.path.lexists(file):
        raise _not_found(name, vendors)
    reason = unusable(file)
    if reason is not None:
        raise CardError([Problem(str(file), 1, 1, reason)])
    key, changed = (file.absolute(), card_id), file.stat().st_mtime_ns
    kept = _loaded.get(key)
    if kept is None or kept[0] != changed:
        kept = _loaded[key] = (changed, _read(file, card_id))
    if isinstance(kept[1], CardError):
        raise kept[1].with_traceback(None)
    return kept[1]


def loaded_files() -> list[Path]:
    """Return the files of the cards that were read, be they right or wrong; none of them is to be written."""
    return [file for file, _ in _loaded]


def not_an_id(name: str) -> str | None:
    """Return what is wrong with a card that is named as a file, where files of others name cards; ``None`` for what may be an id.

    Who writes a list of loops or a loop file shall neither choose which files are opened nor learn which there are.
    """
    if not name.endswith(_ENDINGS):
        return None
    return f"'{shortened(visible(name), 200)}' is a file, not the id of a card; name its folder with --vendors"


def load_card_by_id(card_id: str, vendors: Sequence[str | Path] = ()) -> Card:
    """Return a card as `load_card` does, by its id alone.

    Raises
    ------
    CardNotFoundError
        There is no such card, or a file is named.
    CardError
        The card is wrong.
    """
    wrong = not_an_id(card_id)
    if wrong is not None:
        raise CardNotFoundError(wrong)
    return load_card(card_id, vendors)


def _not_found(name: str, vendors: Sequence[str | Path]) -> CardNotFoundError:
    shown = shortened(visible(name), 200)
    if name.endswith(_ENDINGS):
        return CardNotFoundError(f"no file '{shown}'")
    known = cards(vendors)
    hint = suggest(name, known) or _suggest_block(name, known)
    return CardNotFoundError(f"no card '{shown}'{hint}; 'pidemu cards' lists them")


def _read(file: Path, card_id: str | None) -> Card | CardError:
    """Return the card of a file, or what is wrong with it; the built-in ones are checked when they are built in."""
    from pidemu.card.load import keep, load_file

    try:
        card = load_file(file, card_id)
    except CardError as error:
        return error
    if is_builtin(file):
        keep(card)
        return card
    from pidemu.checks import remembered_check  # the rules run a card, and everything that runs one depends on cards

    problems = remembered_check(card)
    return CardError(problems) if problems else card


def _refuse_wrong(card: Card) -> None:
    from pidemu.checks import remembered_check

    problems = remembered_check(card)
    if problems:
        raise CardError(problems)


def is_known_good(file: Path, card_id: str | None = None, shown: str | None = None) -> bool:
    """Tell whether a check of this very card by this very pidemu had nothing to say.

    Raises
    ------
    CardError
        The file cannot be read, or is no text.
    """
    path = Path(os.path.realpath(file))
    return store.is_checked(digest_of(read_text(path, CardError, CARD, shown=shown or str(file))), card_id or card_id_of(path))


def is_builtin(file: Path) -> bool:
    """Tell whether a card came with pidemu."""
    return file.resolve().is_relative_to(builtin_folder().resolve())


@part(frozen=True, slots=True)
class CardEntry:
    """What a list of cards says of one.

    Attributes
    ----------
    id, title : str
        The card's.
    status : dict
        How many fields of its default variant have each status.
    verification : {"V1", "V2", "V3"}
        How its emulation was verified.
    """

    id: str
    title: str
    status: Mapping[str, int]
    verification: str


def card_entry(file: Path, card_id: str) -> CardEntry:
    """Return what a list of cards says of a card; a compiled one is not loaded for it.

    Raises
    ------
    CardError
        See `load_file`.
    """
    digest = digest_of(read_text(file, CardError, CARD))
    short = store.summary(digest)
    if short is None:
        from pidemu.card.load import keep, load_file, status_counts

        card = load_file(file, card_id)
        if is_builtin(file):
            keep(card)
        elif card.verification.class_ != "V3":  # a claim, which counts where it is shown
            _refuse_wrong(card)
        return CardEntry(card_id, card.title, status_counts(card), card.verification.class_)
    return CardEntry(card_id, short["title"], short["status"], short["verification"])


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
    return len(parts) == 2 and all(p != ".." and PureWindowsPath(p).name == p for p in parts)  # no drive
