"""Cards: the built-in ones, changed in values, keys, references, texts, blocks and bytes."""

from __future__ import annotations

import ast
import re
from random import Random
from typing import Final

from tools.fuzz.case import Case, Kind, Said
from tools.fuzz.corpus.cards import corpus
from tools.fuzz.failures import Breach
from tools.fuzz.library import examples, texts
from tools.fuzz.mutate import mutated_yaml

_MARK: Final = "fuzz_escape"
"""A word in the texts of cards; as code it is an escape."""
_COMMENT: Final = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\])*"', re.DOTALL)
_RECORD: Final = b"sp,pv,auto\n50,50,1\n60,50,1\n60,52,1\n60,54,0\n60,56,1\n"


def make(rng: Random) -> Case:
    """Return a card with some changes, and a command that uses it."""
    all_texts = texts()
    base = rng.choice(list(all_texts))
    card = f"{base}.yaml"  # a card stands in the folder of its vendor
    files = {card: mutated_yaml(rng, all_texts[base], list(all_texts.values()))}
    settings = list(rng.choice(examples()[base])) if examples()[base] else []
    way = rng.randrange(10)
    if way < 4:
        words = ["check", card]
    elif way == 4:
        words = ["show", card, *(settings if rng.random() < 0.7 else [])]
    elif way == 5:
        words = ["code", card, *settings, "--lang", "python"]
    elif way == 6:
        words = ["code", card, *settings, "--lang", "c"]
    elif way == 7:
        files["record.csv"] = _RECORD
        words = ["run", card, *settings, "--record", "record.csv", "--scan", "1"]
    elif way == 8:
        pair = [card, *settings, "--to", "generic/standard"]
        words = ["convert", *(pair if rng.random() < 0.5 else ["generic/series", "K=2", "Ti=10", "Td=1", "--to", card])]
    else:
        words = ["simulate", card, *settings, "--process", "gain=1,lag=10,delay=1", "--time", "50", "--scan", "1"]
    if rng.random() < 0.15 and words[0] != "code":
        words.append("--json")
    return Case(tuple(words), files, terminal=rng.random() < 0.1)


def check(case: Case, said: Said) -> None:
    """What is printed as code holds no code of the card."""
    if case.words[0] != "code" or said.status:
        return
    if "python" in case.words:
        tree = ast.parse(said.out.encode())  # as bytes, so that a declared encoding counts
        escaped = any(isinstance(node, ast.Name) and node.id == _MARK for node in ast.walk(tree))
        if escaped or any(isinstance(node, ast.Import | ast.ImportFrom) and _imports(node) for node in tree.body):
            raise Breach("code of the card", "pidemu code --lang python")
    elif _MARK in _COMMENT.sub(" ", said.out):
        raise Breach("code of the card", "pidemu code --lang c")


def _imports(node: ast.Import | ast.ImportFrom) -> bool:
    """Whether an import brings something that a scan program has no use for."""
    names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [alias.name for alias in node.names]
    return not set(names) <= {"math", "numpy", "struct", "collections", "__future__", "typing"}


KIND: Final = Kind("cards", make, corpus, check=check)
