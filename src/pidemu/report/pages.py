"""What the pages share: templates, and writing to a file."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from pidemu.errors import PidemuError
from pidemu.files.writing import beside

if TYPE_CHECKING:
    from jinja2 import Template


def template(name: str) -> Template:
    """Return a template of this package; jinja2 must be installed. Values are escaped, and a missing one is an error."""
    import jinja2

    text = resources.files("pidemu.report").joinpath(name).read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(text)


def write(path: str | Path, text: str) -> None:
    """Write a page, with the same bytes on every machine.

    Raises
    ------
    PidemuError
        The file cannot be written.
    """
    with beside(path, PidemuError) as stream:
        stream.write(text)
