"""Loop files, as ``pidemu convert --loop`` reads them."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from random import Random
from typing import Final

from tools.fuzz.case import Case, Kind
from tools.fuzz.corpus.loop_files import corpus
from tools.fuzz.failures import ROOT
from tools.fuzz.library import a_card, changed_settings
from tools.fuzz.mutate import mutated_yaml
from tools.fuzz.phrases import limits, process, scan, span
from tools.fuzz.vocabulary import anything, number, text


@functools.cache
def _texts() -> tuple[str, ...]:
    return tuple(file.read_text(encoding="utf-8") for file in sorted((ROOT / "examples").glob("*.yaml")))


def make(rng: Random) -> Case:
    """Return a loop file, one of the examples or a random one, with some changes."""
    source = rng.choice(_texts()) if rng.random() < 0.4 else _random(rng)
    words = ["convert", "--loop", "loop.yaml", *(["--json"] if rng.random() < 0.2 else [])]
    if rng.random() < 0.1:
        words += ["--assume"]
    changed = mutated_yaml(rng, source, _texts()) if rng.random() < 0.85 else source.encode("utf-8", "surrogatepass")
    return Case(tuple(words), {"loop.yaml": changed}, terminal=rng.random() < 0.1)


def _random(rng: Random) -> str:
    """Return a loop file with settings of one card and another card to go to."""
    card, settings = a_card(rng)
    target, _ = a_card(rng)
    given = dict(word.partition("=")[::2] for word in changed_settings(rng, settings, 0.1))
    lines = [f"card: {card}", f"settings: {_mapping(given)}", f"to: {target}"]
    more: dict[str, Callable[[], str]] = {
        "process": lambda: json.dumps(process(rng, 0.15)),
        "scan": lambda: f"[{number(rng, 0.2)}, {number(rng, 0.1)}]" if rng.random() < 0.5 else number(rng, 0.2),
        "runs_every": lambda: json.dumps(scan(rng, 0.2)),
        "mode": lambda: rng.choice(("auto", "cascade", "both", anything(rng))),
        "action": lambda: rng.choice(("reverse", "direct", anything(rng))),
        "bias": lambda: number(rng, 0.2),
        "limits": lambda: f"[{limits(rng, 0.2)}]",
        "tag": lambda: json.dumps(text(rng)),
        "to_pv_range": lambda: json.dumps(span(rng, 0.2)),
        "to_op_range": lambda: json.dumps(span(rng, 0.2)),
        "about": lambda: json.dumps(text(rng)),
    }
    lines += [f"{name}: {value()}" for name, value in more.items() if rng.random() < 0.12]
    return "\n".join(lines) + "\n"


def _mapping(given: dict[str, str]) -> str:
    return "{" + ", ".join(f"{json.dumps(name)}: {json.dumps(value)}" for name, value in given.items()) + "}"


KIND: Final = Kind("loop-files", make, corpus)
