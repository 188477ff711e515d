"""The command line, called in this process."""

from __future__ import annotations

import contextlib
import io
import json
from typing import Any, NamedTuple

from click.testing import CliRunner

from pidemu.cli import cli, main


class Said(NamedTuple):
    """What a command left behind."""

    status: int
    out: str
    err: str


def told(*words: str) -> str:
    """Return what a command prints; it must succeed."""
    result = CliRunner().invoke(cli, list(words), prog_name="pidemu", catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def said(*words: str) -> Said:
    """Run a command as the shell does, with its exit status and both streams."""
    out, err = io.StringIO(), io.StringIO()
    status: Any = None
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(list(words))
        except SystemExit as end:
            status = end.code
    return Said(0 if status is None else int(status), out.getvalue(), err.getvalue())


def strict_json(text: str) -> Any:
    """Return what JSON text holds; NaN and Infinity are no JSON."""

    def refuse(word: str) -> None:
        raise ValueError(word)

    return json.loads(text, parse_constant=refuse)


def with_another_filter(card: str) -> str:
    """Return PROVOX's card with a filter of a tenth of the derivative time, without the example that rests on an eighth."""
    assert "ratio: 0.125" in card
    return card.replace("ratio: 0.125", "ratio: 0.1").partition("  - given: {GAIN: 2, RESET: 4, RATE: 0.5}")[0]
