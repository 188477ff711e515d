"""What the wheel has besides the built-in cards: these, compiled. The build calls it (``hatch_build.py``)."""

from __future__ import annotations

from pathlib import Path

from pidemu.card import store
from pidemu.card.document import card_id_of
from pidemu.card.library import builtin_folder
from pidemu.card.load import card_from, compiled
from pidemu.card.reading import parse_file


def compile_builtin_cards(folder: Path) -> None:
    """Write all built-in cards, compiled, into a folder.

    Parameters
    ----------
    folder : Path
        An empty folder.

    Raises
    ------
    CardError
        A card is wrong.
    """
    for file in sorted(builtin_folder().glob("*/*.yaml")):
        card = card_from(parse_file(file), card_id_of(file))
        store.file_in(folder, card.digest).write_bytes(store.written(*compiled(card)))
