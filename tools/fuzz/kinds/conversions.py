"""Conversions, from Python and from the command line: settings, processes and scan intervals, plausible and beyond."""

from __future__ import annotations

import json
from collections.abc import Callable
from random import Random
from typing import Any, Final

from tools.fuzz.case import Case, Kind, command
from tools.fuzz.corpus.conversions import corpus
from tools.fuzz.library import a_card, changed_settings
from tools.fuzz.phrases import limits, process, scan, span

_MATCHES: Final = ("exact", "same-numbers", "low-frequency", "textbook", "frequency:0.02rad/s", "frequency:1e9rad/s", "constrained")


def make(rng: Random) -> Case:
    """Return settings of one card and another card to go to, with perhaps a process, scan intervals and more."""
    hostile = rng.choice((0.0, 0.05, 0.2, 0.5))
    card, settings = a_card(rng)
    target, others = a_card(rng)
    words = ["convert", card, *changed_settings(rng, settings, hostile), "--to", target]
    choices: dict[str, tuple[float, Callable[[], str]]] = {
        "--scan": (0.35, lambda: scan(rng, hostile)),
        "--process": (0.35, lambda: process(rng, hostile)),
        "--match": (0.2, lambda: rng.choice(_MATCHES)),
        "--mode": (0.1, lambda: rng.choice(("auto", "cascade", "both"))),
        "--action": (0.15, lambda: rng.choice(("reverse", "direct"))),
        "--limits": (0.1, lambda: limits(rng, hostile)),
        "--runs-every": (0.05, lambda: scan(rng, hostile)),
        "--pv-range": (0.1, lambda: span(rng, hostile)),
        "--op-range": (0.05, lambda: span(rng, hostile)),
        "--to-pv-range": (0.05, lambda: span(rng, hostile)),
        "--digits": (0.1, lambda: rng.choice(("1", "3", "17"))),
        "--bias": (0.05, lambda: rng.choice(("0", "50", "1e308"))),
        "--set": (0.1, lambda: rng.choice(others or ["x=1"])),
    }
    for name, (share, value) in choices.items():
        if rng.random() < share:
            words += [name, value()]
    words += [
        flag for flag, share in (("--assume", 0.4), ("--allow-approximate", 0.4), ("--compensate", 0.1)) if rng.random() < share
    ]
    direct = rng.random() < 0.5
    if not direct and rng.random() < 0.2:
        words.append("--json")
    return Case(tuple(words), direct=direct)


def run(case: Case) -> int:
    """Convert as a Python program does, and print the document; or run the command."""
    if not case.direct:
        return command(case)
    import pidemu

    card, given, others = _split(case.words)
    numbers = {name: _python(value) for name, value in given.items()}
    for option, argument in (("--pv-range", "pv_range"), ("--op-range", "op_range")):
        if option in others:
            numbers[argument] = others.pop(option)
    source = pidemu.load_card(card).settings(numbers)
    arguments: dict[str, Any] = {}
    for option, value in others.items():
        if option in ("--set", "--json"):
            continue
        name = option.removeprefix("--").replace("-", "_")
        arguments[name] = _argument(name, value)
    target = arguments.pop("to")
    conversion = pidemu.convert(source, target, **arguments)
    json.dumps(conversion.to_dict(), default=str)
    print(conversion.sentence)
    return 0


def _split(words: tuple[str, ...]) -> tuple[str, dict[str, str], dict[str, Any]]:
    """Return card, settings, and options with their values."""
    rest, given = list(words[2:]), {}
    options: dict[str, Any] = {}
    while rest:
        word = rest.pop(0)
        if word in ("--assume", "--allow-approximate", "--compensate", "--json"):
            options[word] = True
        elif word.startswith("--") and rest:
            options[word] = rest.pop(0)
        else:
            name, _, value = word.partition("=")
            given[name] = value
    return words[1], given, options


def _python(word: str) -> Any:
    """Return a number where a word is one, as a program would have it."""
    try:
        return float(word)
    except ValueError:
        return word


def _argument(name: str, value: Any) -> Any:
    if name == "process":
        from pidemu.process.process import parse_process

        return parse_process(value)
    if name in ("scan", "runs_every", "limits"):
        parts = [_python(part) for part in value.split(",")]
        found = [p for p in parts if isinstance(p, float)]
        return found[0] if len(found) == 1 else tuple(found[:2]) or 1.0
    return int(value) if name == "digits" else _python(value) if name == "bias" else value


KIND: Final = Kind("conversions", make, corpus, run)
