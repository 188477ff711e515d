"""What docs/show.md says of the JSON; test_docs.py runs its commands and code."""

from __future__ import annotations

import re

import pidemu
from tools.regenerate.pages import ROOT, read

TEXT = read(ROOT / "docs" / "show.md")


def test_the_page_has_every_key_of_the_json() -> None:
    found = pidemu.explain(pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4)).to_dict()
    table = TEXT[TEXT.index("| key | what |") :]
    first_cells = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    documented = {name for cell in first_cells for name in re.findall(r"`(\w+)`", cell)}
    assert documented | {"why_not"} == set(found)
