"""The commands of the README and what they print; ``python -m tests.readme`` writes what they print today into it."""

from __future__ import annotations

import os
import re
import shlex
from pathlib import Path

from click.testing import CliRunner

from pidemu.cli import cli

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
_BLOCK = re.compile(r"^```console\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def blocks(text: str) -> list[tuple[str, str]]:
    """Return command and printed output of every console block."""
    found = []
    for body in _BLOCK.findall(text):
        command, _, printed = body.partition("\n")
        assert command.startswith("$ pidemu "), command
        found.append((command.removeprefix("$ pidemu "), printed))
    return found


def printed_by(command: str, folder: Path) -> str:
    """Run a command and return what it prints on screen; files it writes go to `folder`."""
    words = [w.replace("emulated.csv", str(folder / "emulated.csv")) for w in shlex.split(command)]
    words = [str(ROOT / w) if w.startswith("examples/") else w for w in words]
    result = CliRunner().invoke(cli, words)
    return result.output.replace(f"{ROOT}{os.sep}", "")  # as in a clone's own folder


def python_block(text: str) -> str:
    """Return the Python example."""
    (found,) = re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return str(found)


def main() -> None:
    """Write what the commands print today into the README."""
    import tempfile

    text = README.read_text(encoding="utf-8")

    def renewed(match: re.Match[str]) -> str:
        command = match[1].partition("\n")[0]
        with tempfile.TemporaryDirectory() as folder:
            printed = printed_by(command.removeprefix("$ pidemu "), Path(folder))
        return f"```console\n{command}\n{printed}```"

    README.write_text(_BLOCK.sub(renewed, text), encoding="utf-8")


if __name__ == "__main__":
    main()
