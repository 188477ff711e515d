"""What docs/show.md shows is run; ``python -m tests.test_docs_show`` writes the output."""

from __future__ import annotations

import re
from typing import Any

import pytest

import pidemu
from tests.readme import ROOT
from tests.test_docs_fleet import CONSOLE, printed_by, run

PAGE = ROOT / "docs" / "show.md"
TEXT = PAGE.read_text(encoding="utf-8")
PYTHON = re.findall(r"^```python\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize(("command", "printed"), CONSOLE.findall(TEXT))
def test_a_command_prints_what_the_page_shows(command: str, printed: str) -> None:
    assert printed_by(command) == printed


def test_the_code_of_the_page_gives_what_its_comments_say() -> None:
    names: dict[str, Any] = {}
    assert sum(run(block, names) for block in PYTHON) == 4


def test_the_page_has_every_key_of_the_json() -> None:
    found = pidemu.explain(pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4)).to_dict()
    table = TEXT[TEXT.index("| key | what |") :]
    first_cells = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    documented = {name for cell in first_cells for name in re.findall(r"`(\w+)`", cell)}
    assert documented | {"why_not"} == set(found)


def main() -> None:
    """Write what the commands print today into the page."""

    def renewed(match: re.Match[str]) -> str:
        return f"```console\n$ pidemu {match[1]}\n{printed_by(match[1])}```"

    PAGE.write_text(CONSOLE.sub(renewed, TEXT), encoding="utf-8")


if __name__ == "__main__":
    main()
