"""README and docs: the commands that they show, with what these print.

A comment in a page, in the line before a block, says more about it:

- ``<!-- shown: To until RATE; Verdict -->``: parts of what the command prints are shown, ``[...]`` for what was left out.
  A part goes from the first line that begins with its first word or words until before the next one that begins with the second,
  or until an empty line;
- ``<!-- file: loops.csv -->``: the commands and the code of the page find the block in a file of that name;
- ``<!-- part of: vendors/fisher/provox.yaml -->``: the block stands in that file, word for word.
"""

from __future__ import annotations

import contextlib
import re
import shlex
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from click.testing import CliRunner

from pidemu.cli import cli

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
PAGES = (README, *sorted((ROOT / "docs").glob("*.md")))
CUT = "[...]"
CONSOLE = re.compile(
    r"^(?P<head>(?:<!-- shown: (?P<parts>.*) -->\n)?```console\n\$ pidemu (?P<command>.*)\n)(?P<printed>(?:.*\n)*?)```$",
    re.MULTILINE,
)
_FILE = re.compile(r"^<!-- file: (\S+) -->\n```\w+\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def signed_certificate(folder: Path) -> None:
    """Put the signed certificate of docs/certificate.md and its corrected card into a folder."""
    found = re.search(r"^    pidemu (.*) --html .*$", read(ROOT / "docs" / "certificate.md"), re.MULTILINE)
    assert found is not None
    (folder / "TIC-101.json").write_text(printed_by(f"{found[1]} --date 2026-07-01 --json"), encoding="utf-8")
    (folder / "cards" / "fisher").mkdir(parents=True)
    card = (ROOT / "vendors" / "fisher" / "provox.yaml").read_text(encoding="utf-8")
    for old, new in (
        ("ratio: 0.125", "ratio: 0.1"),
        ("{kp: 5.5, ki: 0.133333, kd: 39.375, Tf: 3.75}", "{kp: 5.6, ki: 0.133333, kd: 43.2, Tf: 3}"),
    ):
        assert old in card
        card = card.replace(old, new)
    (folder / "cards" / "fisher" / "provox.yaml").write_text(card, encoding="utf-8")


PREPARE: dict[str, Callable[[Path], None]] = {"certificate.md": signed_certificate}
"""By page: what else has to be put into the folder in which its commands run."""


@dataclass(frozen=True)
class Shown:
    """A command of a page, what the page says that it prints, and which parts of it the page shows (None: all)."""

    page: Path
    command: str
    printed: str
    parts: str | None

    def today(self) -> str:
        """Run the command in the current folder and return what the page has to show."""
        printed = printed_by(self.command)
        return printed if self.parts is None else shortened(printed, self.parts)


def read(page: Path) -> str:
    """Return the text of a page."""
    return page.read_text(encoding="utf-8")


def commands(page: Path) -> list[Shown]:
    """Return the commands of a page."""
    found = [Shown(page, m["command"], m["printed"], m["parts"]) for m in CONSOLE.finditer(read(page))]
    assert len(found) == read(page).count("```console"), f"{page}: a console block holds one command, '$ pidemu ...'"
    return found


def prepare(page: Path, folder: Path) -> None:
    """Put the files that a page's commands and code read into a folder: the examples, and those that the page shows."""
    shutil.copytree(ROOT / "examples", folder / "examples")
    for name, text in _FILE.findall(read(page)):
        (folder / name).write_text(text, encoding="utf-8")
    if page.name in PREPARE:
        PREPARE[page.name](folder)


def printed_by(command: str) -> str:
    """Run a command without its ``pidemu`` in the current folder and return what it prints on screen."""
    return CliRunner().invoke(cli, shlex.split(command), prog_name="pidemu", catch_exceptions=False).output


def shortened(printed: str, parts: str) -> str:
    """Return the parts of a printed text, with a mark for what is left out."""
    lines, shown, done = printed.splitlines(), list[str](), 0
    for part in parts.split("; "):
        first, _, beyond = part.partition(" until ")
        start = _line(lines, first, done)
        end = _line(lines, beyond, start + 1)
        shown = [*(_cut(shown) if start > done else shown), *lines[start:end]]
        done = end
    return "".join(f"{line}\n" for line in (_cut(shown) if done < len(lines) else shown))


def _cut(shown: list[str]) -> list[str]:
    """Return the lines, without empty ones at the end, and the mark."""
    while shown and not shown[-1].strip():
        shown = shown[:-1]
    return [*shown, CUT]


def _line(lines: list[str], begin: str, start: int) -> int:
    """Return the number of the next line that begins so; of the next empty one, or the end, if `begin` is empty."""
    for number, line in enumerate(lines[start:], start):
        if line.strip().startswith(begin) if begin else not line.strip():
            return number
    assert not begin, f"no line begins with {begin!r} after line {start}"
    return len(lines)


def renewed(page: Path, text: str) -> str:
    """Return the text of a page with what its commands print today."""

    def replaced(match: re.Match[str]) -> str:
        return f"{match['head']}{Shown(page, match['command'], match['printed'], match['parts']).today()}```"

    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        prepare(page, Path(folder))
        return CONSOLE.sub(replaced, text)
