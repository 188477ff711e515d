"""The code that README and docs show, and what its comments say it gives."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

from tools.regenerate.pages import read

_PYTHON = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_PART = re.compile(r"^<!-- part of: (\S+) -->\n```\w+\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def python_blocks(page: Path) -> list[str]:
    """Return the blocks of code of a page."""
    return _PYTHON.findall(read(page))


def quotations(page: Path) -> list[tuple[str, str]]:
    """Return path and text of each block that is a part of a file."""
    return _PART.findall(read(page))


def statements(block: str) -> list[tuple[str, str, bool]]:
    """Return each statement of a block, what its comment says it gives, and whether it is an expression."""
    lines = block.splitlines()
    found = []
    for node in ast.parse(block).body:
        assert node.end_lineno is not None
        code = "\n".join(lines[node.lineno - 1 : node.end_lineno])
        comment = lines[node.end_lineno - 1].partition("  # ")[2]
        found.append((code, comment, isinstance(node, ast.Expr)))
    return found


def run(block: str, names: dict[str, Any]) -> int:
    """Run a block of code and hold the value of each expression against its comment; return how many there are.

    The comment behind any other statement is prose.
    """
    checked = 0
    for code, expected, is_expression in statements(block):
        if not (is_expression and expected):
            exec(code, names)
            continue
        assert eval(code.partition("  # ")[0], names) == ast.literal_eval(expected), code
        checked += 1
    return checked
