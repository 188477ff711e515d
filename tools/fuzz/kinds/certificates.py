"""Certificates, as ``pidemu verify`` reads them."""

from __future__ import annotations

import functools
import json
from random import Random
from typing import Any, Final

import pidemu
from tools.fuzz.case import Case, Kind
from tools.fuzz.corpus.certificates import corpus
from tools.fuzz.mutate import mutated_bytes, mutated_yaml
from tools.fuzz.vocabulary import HOSTILE_TEXTS, text

_VALUES: Final[tuple[Any, ...]] = (
    None, True, False,
    0, -1, 1e308, -1e308, 5e-324, 10**400, 2**63, [], {}, "", "nan", "inf", [[]], {"": None}, "1", 1.5, *HOSTILE_TEXTS,
)  # fmt: skip
_NESTING: Final = 3000


@functools.cache
def _certificates() -> tuple[str, ...]:
    """Return certificates of conversions, as JSON."""
    pairs = (
        (pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1), "emerson/deltav"),
        (pidemu.load_card("generic/standard").settings(K=2, Ti=10, Td=0), "generic/parallel"),
    )
    return tuple(json.dumps(pidemu.convert(source, target).to_dict(), indent=1) for source, target in pairs)


def make(rng: Random) -> Case:
    """Return a certificate with one thing changed, or damaged as a text."""
    source = rng.choice(_certificates())
    dice = rng.random()
    if dice < 0.7:
        content = _changed(rng, json.loads(source))
    elif dice < 0.9:
        content = mutated_yaml(rng, source, _certificates())
    else:
        content = mutated_bytes(rng, source.encode())
    words = ["verify", "certificate.json", *(["--json"] if rng.random() < 0.2 else [])]
    return Case(tuple(words), {"certificate.json": content}, terminal=rng.random() < 0.1)


def _changed(rng: Random, document: Any) -> bytes:
    """Return JSON in which one value or key is another one; the request, from which all is computed again, twice as often."""
    node, steps = document, rng.randint(1, 5)
    if rng.random() < 0.5:
        node = document["request"]
    while steps:
        steps -= 1
        key = rng.choice(list(node) if isinstance(node, dict) else list(range(len(node))))
        child = node[key]
        if steps and isinstance(child, dict | list) and child:
            node = child
            continue
        _change(rng, node, key)
        break
    return json.dumps(document).encode("utf-8", "surrogatepass")


def _change(rng: Random, node: Any, key: Any) -> None:
    way = rng.random()
    if way < 0.15:
        del node[key]
    elif way < 0.25 and isinstance(node, dict):
        node[text(rng)] = node.pop(key)
    elif way < 0.3:
        deep: Any = node[key]
        for _ in range(rng.choice((1, 3, _NESTING // 10))):
            deep = [deep]
        node[key] = deep
    elif way < 0.45 and isinstance(node[key], float | int):
        node[key] = rng.choice((-1, 0, 1e-300, 1e9, 1.0001)) * node[key]
    else:
        node[key] = rng.choice(_VALUES)


KIND: Final = Kind("certificates", make, corpus)
