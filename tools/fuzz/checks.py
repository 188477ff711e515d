"""What every command owes, whatever it was given."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, Final, NoReturn

from tools.fuzz.case import OLD, Case, Said, printable
from tools.fuzz.failures import Breach

_FLOOD: Final = 100_000
"""Characters on stderr that are too many, whatever was wrong."""
_STYLE: Final = re.compile(r"\x1b\[(0|1|32|33|36)m")
"""What a terminal is told by ourselves: bold, green, yellow, cyan, and the end of it."""
_UNWANTED: Final = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""What a terminal obeys, and what turns the order of its letters."""
_TURNING: Final = re.compile("[\u202a-\u202e\u2066-\u2069]")
"""Of these, what turns the order of letters: a record that goes into a pipe may hold it, since it is data there."""
_OUTPUTS: Final = ("-o", "--table", "--parquet", "--plot", "--html", "--csv", "--out")
"""Options with the name of a file that a command writes."""
_LINES: Final = re.compile("[\u2028\u2029]")
"""Ends of lines to some programs; within JSON they are letters."""
_NAN: Final = re.compile(r"(?<!')\bnan\b(?!')")
"""As a number is printed; in sentences it is NaN, and in quotation marks what was given."""
_NOT_FINITE: Final = re.compile(r"nan|inf|\d[eE][+-]?\d\d|\d{20}|\d_\d")
"""Marks of an input that may have an answer with NaN."""


def exits_as_it_says(case: Case, said: Said) -> None:
    """The exit status is 0, 1 or 2, and there is a word for why it is not 0."""
    if said.status not in (0, 1, 2):
        raise Breach(f"exit status {said.status}", _where(case), said.err[-300:])
    if not case.direct and said.status and not (said.err.strip() or said.out.strip()):
        raise Breach("fails without a word", _where(case))


def prints_no_traceback(case: Case, said: Said) -> None:
    """Nobody has to read Python."""
    if "Traceback (most recent call last)" in said.out + said.err:
        raise Breach("traceback printed", _where(case), said.err[-300:])


def prints_no_control_characters(case: Case, said: Said) -> None:
    """A terminal obeys pidemu, and no card, tag or file."""
    for stream, text in (("stdout", said.out), ("stderr", said.err)):
        plain = _STYLE.sub("", text) if case.terminal else text
        if stream == "stdout" and case.words[:1] in (("run",), ("compare",)) and not case.terminal:
            plain = _TURNING.sub("", plain)
        found = _UNWANTED.search(plain) or (None if "--json" in case.words else _LINES.search(plain))
        if found:
            line = plain[: found.start()].count("\n")
            excerpt = printable(plain.split("\n")[line])[:300]
            raise Breach("control character", f"{_where(case)}: {stream}", f"U+{ord(found[0]):04X} in: {excerpt}")


def prints_no_nan(case: Case, said: Said) -> None:
    """Finite numbers of a plausible size have finite answers; JSON says "nan" where there is none, and code may read it."""
    text = said.out + said.err
    found = _NAN.search(text)
    if found and "--json" not in case.words and "code" not in case.words and not _NOT_FINITE.search(case.text):
        excerpt = text[max(0, found.start() - 100) : found.end() + 20]
        raise Breach("NaN", _where(case), printable(excerpt).replace("\n", " | "))


def prints_no_flood(case: Case, said: Said) -> None:
    """What is wrong is said in a page, not in megabytes."""
    if len(said.err) > _FLOOD:
        raise Breach("floods stderr", _where(case), f"{len(said.err):,} characters")


def prints_json(case: Case, said: Said) -> None:
    """What ``--json`` prints is JSON."""
    if "--json" in case.words and said.out.lstrip()[:1] in ("{", "["):
        try:
            json.loads(said.out, parse_constant=_refuse)
        except ValueError as error:
            raise Breach("not JSON", _where(case), str(error)) from None


RULES: Final = (
    exits_as_it_says,
    prints_no_traceback,
    prints_no_control_characters,
    prints_no_nan,
    prints_no_flood,
    prints_json,
)


def _is_output(case: Case, name: str) -> bool:
    """Tell whether a command was told to write a file, and to read it nowhere."""
    places = [i for i, word in enumerate(case.words) if name in word]
    return len(places) == 1 and places[0] > 0 and case.words[places[0]] == name and case.words[places[0] - 1] in _OUTPUTS


def files_are_whole(case: Case, said: Said, folder: Path) -> None:
    """What was read is as it was; a result of an earlier run is as it was where the command was refused; nothing is left behind."""
    for name, content in case.files.items():
        path = folder / name
        now = path.read_bytes() if path.is_file() else None
        if now == content:
            continue
        if (name.startswith(OLD) or _is_output(case, name)) and said.status != 2 and now:
            continue
        state = "gone" if now is None else f"{len(now)} bytes instead of {len(content)}"
        raise Breach("file destroyed", _where(case), f"{name} is {state}, exit status {said.status}")
    words = " ".join(case.words)
    known = {name.split("/")[0] for name in (*case.files, *case.links)}
    for path in folder.iterdir():
        if path.name not in known and path.name not in words and path.stem not in words and "--out" not in words:
            raise Breach("file left behind", _where(case), path.name)


def _where(case: Case) -> str:
    return "pidemu " + (case.words[0] if case.words and re.fullmatch(r"[a-z]+", case.words[0]) else "")


def _refuse(word: str) -> NoReturn:
    raise ValueError(word)


def rows_match(what: str, found: int, expected: set[int], detail: Any = "") -> None:
    """No row is lost without a word."""
    if found not in expected:
        wanted = " or ".join(map(str, sorted(expected)))
        raise Breach("row lost", what, f"{found} rows of {wanted} {detail}")
