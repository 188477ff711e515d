"""Command lines of every command: options, settings, processes, ranges, scan intervals, limits, names of files."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from random import Random
from typing import Final

from tools.fuzz import phrases
from tools.fuzz.case import FORCED_NUMPY, OLD, Case, Kind
from tools.fuzz.corpus.commands import corpus
from tools.fuzz.library import a_card, changed_settings
from tools.fuzz.vocabulary import anything, misspelt, number, text

_RECORD: Final = b"time,sp,pv,auto,output\n0,50,50,1,40\n1,60,50,1,41\n2,60,52,1,42\n3,60,54,0,42\n4,60,56,1,42\n"
_LOOPS: Final = b'tag,card,settings,process,scan\nA,generic/standard,K=1;Ti=10;Td=0,"gain=1,lag=10,delay=1",1\nB,x/y,K=1,gain=1,1\n'
_FILES: Final[Mapping[str, bytes]] = {"record.csv": _RECORD, "loops.csv": _LOOPS, f"{OLD}.csv": b"kept,\n1,\n"}
_NAMES: Final = (
    "record.csv", "loops.csv", "old.csv", "none.csv", ".", "", "record.csv/x", "nofolder/x.csv", "a" * 300 + ".csv", "\udcff.csv",
    "x\x00.csv", "x\x1b[31m.csv", "-", "x\n.csv",
)  # fmt: skip
_LEADS_OUTSIDE: Final = re.compile(r"(^|=|-o)\s*(/|~|\.\.|[A-Za-z]:)|\.\.[/\\]")

Value = Callable[[Random, float], str]


def _file(rng: Random, hostile: float) -> str:
    return rng.choice(_NAMES) if rng.random() < hostile else rng.choice(("record.csv", "old.csv"))


def _output(rng: Random, hostile: float) -> str:
    return rng.choice(_NAMES) if rng.random() < hostile else rng.choice(("old.csv", "old.csv", "new.csv"))


def _choice(*usual: str) -> Value:
    return lambda rng, hostile: anything(rng) if rng.random() < hostile / 2 else rng.choice(usual)


def _number(rng: Random, hostile: float) -> str:
    return number(rng, hostile)


def _assignment(rng: Random, hostile: float) -> str:
    return rng.choice((f"I={number(rng, hostile)}", f"u={number(rng, hostile)}", f"output={number(rng, hostile)}", text(rng)))


_ACTION: Final = _choice("reverse", "direct")
_ENGINE: Final = _choice("python", "numpy", "auto")
_RUN: Final[Mapping[str, Value]] = {"--action": _ACTION, "--limits": phrases.limits, "--initial-output": _number}
_TRIAL: Final[Mapping[str, Value]] = {"--setpoint": phrases.step, "--load": phrases.step, "--engine": _ENGINE}
_OPTIONS: Final[Mapping[str, Mapping[str, Value]]] = {
    "show": {"--scan": phrases.time, "--pv-range": phrases.span, "--op-range": phrases.span},
    "code": {
        "--lang": _choice("python", "c", "js", "st", "plcopen"), "--name": _choice("pid", "int", "x y"), "--scan": phrases.time,
        "--action": _ACTION, "--limits": phrases.limits, "--dialect": _choice("iec", "scl", "rockwell"),
        "--signal": _choice("cascade", "track", "external_reset", "feedforward"),
    },
    "vectors": {"--scan": phrases.time, "--action": _ACTION, "--limits": phrases.limits, "--seed": _choice("1", "2")},
    "run": {
        **_RUN, "--record": _file, "--scan": phrases.time, "--bias": _number, "--initial": _assignment, "-o": _output,
        "--engine": _ENGINE,
    },
    "compare": {**_RUN, "--record": _file, "--scan": phrases.scan, "-o": _output},
    "simulate": {
        **_TRIAL, "--process": phrases.process, "--scan": phrases.time, "--time": phrases.time, "--action": _ACTION,
        "--limits": phrases.limits, "-o": _output,
    },
    "fleet": {**_TRIAL, "--time": phrases.time, "--cores": _choice("1", "2"), "--table": _output},
    "check": {},
    "verify": {},
    "cards": {},
    "convert": {
        "--scan": phrases.scan, "--process": phrases.process, "--match": _choice("exact", "textbook"), "--limits": phrases.limits,
        "--pv-range": phrases.span, "--digits": _choice("3", "17"), "--bias": _number, "--tag": _choice("TIC-1"),
        "--cut-over": _choice("50,48.5,40", "50,50", "nan,1,2"), "--action": _ACTION, "--mode": _choice("auto", "both"),
        "--date": _choice("2026-11-22", "yesterday"), "--set": _assignment,
    },
}  # fmt: skip
_SHARES: Final = {
    "show": 24,
    "code": 16,
    "vectors": 4,
    "run": 28,
    "compare": 10,
    "simulate": 12,
    "fleet": 5,
    "check": 1,
    "verify": 1,
    "convert": 2,
}
_MUST: Final = {"run": ("--record", "--scan"), "simulate": ("--process", "--time"), "compare": ("--record",), "fleet": ("--time",)}
"""Options without which a command asks for them, or takes long."""


def make(rng: Random) -> Case:
    """Return a command line: a usual one, or one with something that nobody expects."""
    command = rng.choices(list(_SHARES), list(_SHARES.values()))[0]
    hostile = rng.choice((0.02, 0.1, 0.3))
    words = [command, *_arguments(rng, command, hostile)]
    for name, value in _OPTIONS[command].items():
        if name in _MUST.get(command, ()) or rng.random() < 0.2:
            words += [name, value(rng, hostile)]
    if rng.random() < 0.15 and command != "code":
        words.append("--json")
    if rng.random() < hostile:
        words = _disturbed(rng, words)
    words = ["show" if _LEADS_OUTSIDE.search(word) else word for word in words]
    needed = {name: content for name, content in _FILES.items() if name in words}
    limit = (6.0 if command in ("fleet", "compare") else 2.0) + (FORCED_NUMPY if "numpy" in words else 0.0)
    return Case(tuple(words), needed, terminal=rng.random() < 0.05, limit=limit)


def _arguments(rng: Random, command: str, hostile: float) -> list[str]:
    """Return what stands before the options."""
    if command in ("check", "verify"):
        return [rng.choice(_NAMES)]
    if command == "fleet":
        return ["loops.csv" if rng.random() > hostile else rng.choice(_NAMES), "--no-progress"]
    card, settings = a_card(rng)
    found = [card if rng.random() > hostile / 2 else misspelt(rng, card), *changed_settings(rng, settings, hostile)]
    if command == "show" and rng.random() < 0.2:
        return found[:1]
    if command == "compare":
        card, settings = a_card(rng)
        found += [card, *changed_settings(rng, settings, hostile)]
    if command == "convert":
        found += ["--to", a_card(rng)[0]]
    return found


def _disturbed(rng: Random, words: list[str]) -> list[str]:
    """Return a command line with a word changed, lost, doubled, moved or added."""
    at, way = rng.randrange(len(words)), rng.randrange(6)
    if way == 0:
        return [*words[:at], *words[at + 1 :]]
    if way == 1:
        return [*words[:at], words[at], *words[at:]]
    if way == 2:
        return [*words[:at], text(rng), *words[at + 1 :]]
    if way == 3:
        return [*words[:at], misspelt(rng, words[at]), *words[at + 1 :]]
    if way == 4:
        return [*words[:at], rng.choice(("--help", "--json", "--", "-x", "--vendors", "--engine", "--verbose")), *words[at:]]
    rng.shuffle(words)
    return words


KIND: Final = Kind("commands", make, corpus)
