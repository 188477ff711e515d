"""Cards that were faults once."""

from __future__ import annotations

import functools

from pidemu.card.library import card_files
from tools.fuzz.case import Case

_SETTINGS = ("K=2", "Ti=10", "Td=1")


@functools.cache
def _text(card_id: str) -> str:
    return card_files()[card_id].read_text(encoding="utf-8")


def _with_option(name: str, choice: str) -> str:
    """Return a card with one more option, whose default choice is given; both as they stand between quotation marks."""
    option = f'options:\n  "{name}":\n    default: "{choice}"\n    choices:\n      "{choice}": {{}}\n      other: {{}}\n'
    evidence = f'evidence:\n  "options.{name}": {{status: assumed, note: made up}}\n'
    text = _text("generic/standard")
    assert "\noptions:\n" in text
    assert "\nevidence:\n" in text
    return text.replace("options:\n", option, 1).replace("evidence:\n", evidence, 1)


def _each(content: str | bytes, name: str = "generic/card.yaml") -> dict[str, Case]:
    """Return the commands that use a card, by name."""
    raw = content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content
    files = {name: raw, "record.csv": b"sp,pv\n50,50\n60,50\n60,52\n"}
    commands = {
        "check": ("check", name),
        "show": ("show", name),
        "python": ("code", name, *_SETTINGS, "--lang", "python"),
        "c": ("code", name, *_SETTINGS, "--lang", "c"),
        "run": ("run", name, *_SETTINGS, "--scan", "1", "--record", "record.csv"),
        "convert": ("convert", name, *_SETTINGS, "--to", "generic/parallel"),
    }
    return {command: Case(words, files) for command, words in commands.items()}


def corpus() -> dict[str, Case]:
    """Return the cards by name and command."""
    text = _text("generic/standard")
    texts = {
        "option-that-declares-an-encoding": _with_option("coding: unicode_escape", r"\\nfuzz_escape()\\n#"),
        "option-and-choice-that-declare-one": _with_option("coding", "unicode_escape"),
        "choice-of-two-lines": _with_option("a", r"x\nfuzz_escape()\n"),
        "choice-with-null": _with_option("a", r"x\0y"),
        "choice-that-writes-to-the-terminal": _with_option("a", r"\e[31mred\e[0m"),
        "choice-that-turns-the-line": _with_option("a", r"\u202eevil"),
        "choice-that-ends-a-comment": _with_option("a", "*/ fuzz_escape(); /*"),
        "choice-that-ends-a-docstring": _with_option("a", r"\"\"\"\nfuzz_escape()\n\"\"\""),
        "choice-that-is-mathematics": _with_option("$x", r"$\\frac{1}$"),
        "title-that-writes-to-the-terminal": text.replace("vendor: ", 'vendor: "\\e]0;title\\a" #', 1),
        "number-of-5000-digits": text.replace("default: ", "default: " + "9" * 5000 + " #", 1),
        "deep": "a: " + "[" * 5000,
        "laughs": "a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n",
        "no-card-at-all": "root:x:0:0:root:/root:/bin/bash\nsecret: [\n",
    }
    found = {f"{name}-{command}": case for name, content in texts.items() for command, case in _each(content).items()}
    large = {
        "key-of-a-megabyte": text + "x" * 1_000_000 + ": 1\n",
        "line-of-five-megabytes": text + "unknown: [" + "1, " * 1_700_000 + "1]\n",
        "unknown-keys-20000": text + "".join(f"unknown{i}: 1\n" for i in range(20_000)),
    }
    found |= {name: _each(content)["check"] for name, content in large.items()}
    for setting in ("K", "Ti", "Td", "Tf", "b", "c"):
        for command, case in _each(_without_setting(text, setting)).items():
            found[f"without-{setting}-{command}"] = case
    for name in ("generic/encoding.yaml", "generic/coding=utf-7.yaml"):
        for command, case in _each(text, name).items():
            found[f"called-{name.removeprefix('generic/')}-{command}"] = case
    found["link-to-itself"] = Case(("check", "card.yaml"), links={"card.yaml": "card.yaml"})
    found["folder-that-leads-to-itself"] = Case(("check", "."), links={"loop": "."})
    found["link-to-another-file"] = Case(
        ("check", "card.yaml"), {"secret.txt": b"root:x:0:0\nsecret\n"}, {"card.yaml": "secret.txt"}
    )
    return found


def _without_setting(text: str, name: str) -> str:
    lines = text.split("\n")
    return "\n".join(line for line in lines if not line.startswith(f"  {name}:"))
