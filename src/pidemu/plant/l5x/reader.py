"""Where an export enters."""

from __future__ import annotations

from pidemu.plant.l5x.loops import L5xExport, loops_of
from pidemu.plant.l5x.tree import read_tree


def read_l5x(data: bytes, file: str) -> L5xExport:
    """Read a Rockwell export.

    Parameters
    ----------
    data : bytes
        The file.
    file : str
        Its name, for messages.

    Raises
    ------
    ListError
        It is no export, damaged, or declares a document type or entities; with its line.
    """
    return loops_of(read_tree(data, file), file)
