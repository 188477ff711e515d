"""Signals for controllers: every engine gives the same bits, whatever comes, and settings may change in between."""

from __future__ import annotations

from collections.abc import Callable
from itertools import takewhile
from random import Random
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from tools.fuzz.case import Case, Kind
from tools.fuzz.corpus.signals import corpus
from tools.fuzz.failures import Breach
from tools.fuzz.library import a_card, changed_settings
from tools.fuzz.vocabulary import number, plausible

Floats = npt.NDArray[np.float64]
_COMPILED: Final = ("generic/standard", "epics/epid", "allen-bradley/plc5")
"""Cards that are also run as machine code: compiling every structure would take all the time."""


def make(rng: Random) -> Case:
    """Return a card with settings, a record, and perhaps changes of settings on the way."""
    card, settings = a_card(rng)
    if rng.random() < 0.3:
        settings = changed_settings(rng, settings, 0.03)
    length = rng.choice((5, 20, 60, 150))
    wild = rng.choice((0.0, 0.0, 0.03, 0.2))
    columns = _columns(rng, length, wild)
    lines = [",".join(columns), *(",".join(row) for row in zip(*columns.values(), strict=True))]
    files = {"record.csv": ("\n".join(lines) + "\n").encode()}
    if settings and rng.random() < 0.3:
        changes = sorted(rng.sample(range(1, length), min(2, length - 1)))
        files["changes.txt"] = "".join(f"{n} {w}\n" for n in changes for w in changed_settings(rng, settings, 0.0)[:1]).encode()
    words = ["run", card, *settings, "--record", "record.csv", "--scan", rng.choice(("1", "1", "0.1", "0.37", "60"))]
    words += ["--action", rng.choice(("reverse", "direct"))]
    words += ["--limits", rng.choice(("0,100", "-50,150", "40,60"))] if rng.random() < 0.3 else []
    words += ["--initial-output", rng.choice(("50", "0", "120"))] if rng.random() < 0.3 else []
    words += ["--engine", "c" if card in _COMPILED and rng.random() < 0.1 else "numpy"]
    return Case(tuple(words), files, direct=True, limit=6.0)


def _columns(rng: Random, length: int, wild: float) -> dict[str, list[str]]:
    """Return signals by name, in spells; a share of the samples is wild."""

    def spells(make_one: Callable[[], str], share: float, most: int = 12) -> list[str]:
        found: list[str] = []
        while len(found) < length:
            found += [make_one() if rng.random() < share else ""] * rng.randint(1, most)
        return found[:length]

    def sample() -> str:
        return number(rng, 1.0 if rng.random() < wild else 0.0)

    level, pv = 50.0, []
    for _ in range(length):
        level += rng.gauss(0, 3)
        pv.append(_float(rng, wild, f"{level:.6g}"))
    columns = {"sp": [_float(rng, wild / 3, s) for s in spells(lambda: str(rng.uniform(20, 80)), 1.0, 30)], "pv": pv}
    optional: dict[str, Callable[[], list[str]]] = {
        "auto": lambda: spells(lambda: rng.choice("1110"), 1.0),
        "manual": lambda: spells(lambda: plausible(rng), 0.5),
        "cascade": lambda: spells(lambda: plausible(rng), 0.4),
        "track": lambda: spells(lambda: plausible(rng), 0.2),
        "external_reset": lambda: spells(lambda: plausible(rng), 0.5),
        "feedforward": lambda: spells(lambda: rng.choice(("1", "-2.5", "0")), 0.5),
        "hold": lambda: spells(lambda: "1", 0.1),
    }
    for name, signal in optional.items():
        if rng.random() < (0.6 if name in ("auto", "manual") else 0.15):
            columns[name] = signal()
    return columns


def _float(rng: Random, wild: float, usual: str) -> str:
    """Return a number that a record may hold, in a share of cases an extreme one."""
    extreme = ("nan", "inf", "-inf", "1e300", "-1e300", "1e308", "5e-324", "1e-300", "-0.0", "1e30", "1e17", "-1e17")
    return rng.choice(extreme) if rng.random() < wild else usual


def run(case: Case) -> int:
    """Run the record in plain Python scan by scan, at once, and in another engine; compare every bit."""
    import pidemu
    from pidemu.errors import PidemuError
    from pidemu.parsing import assignments

    words = case.words
    options = {words[i]: words[i + 1] for i in range(len(words) - 1) if words[i].startswith("--")}
    settings = pidemu.load_card(words[1]).settings(assignments(takewhile(lambda word: not word.startswith("--"), words[2:])))
    signals = _signals()
    changes = [line.split(" ", 1) for line in case.files.get("changes.txt", b"").decode().splitlines()]
    found: dict[str, Any] = {}
    for engine in ("python", options["--engine"]):
        try:
            found[engine] = _played(settings, signals, changes, options, engine)
        except PidemuError as error:
            found[engine] = f"{type(error).__name__}: {error}"
    first, other = found.values() if len(found) > 1 else (*found.values(), *found.values())
    _compare(first, other, f"{words[1]} {' '.join(found)}")
    return 2 if isinstance(first, str) else 0


def _signals() -> dict[str, Floats]:
    from pidemu.records.files import SIGNALS, read_record

    record = read_record("record.csv")
    names = ("sp", "pv", "auto", "manual", *SIGNALS)
    return {name: getattr(record, name) for name in names if getattr(record, name) is not None}


def _played(settings: Any, signals: dict[str, Floats], changes: list[list[str]], options: dict[str, str], engine: Any) -> Any:
    """Return outputs, states and events of a controller that had the signals and changes of settings."""
    import pidemu
    from pidemu.parsing import assignments, pair

    controller = pidemu.Controller(
        settings, float(options["--scan"]), "direct" if options["--action"] == "direct" else "reverse",
        pair(options["--limits"]) if "--limits" in options else None,
        initial_output=float(options.get("--initial-output", 0)), engine=engine,
    )  # fmt: skip
    outputs, at, length = [], 0, signals["sp"].size
    for end, change in [*((int(n), word) for n, word in changes), (length, "")]:
        if end > at:
            outputs.append(controller.run(**{name: x[at:end] for name, x in signals.items()}))
            at = end
        if change:
            controller.change(assignments([change]))
    return np.concatenate(outputs), list(controller.state.values()), repr(controller.events)


def _compare(first: Any, other: Any, place: str) -> None:
    """Raise `Breach` where two runs differ; NaN is NaN, whatever its bits."""
    if isinstance(first, str) or isinstance(other, str):
        if not (isinstance(first, str) and isinstance(other, str) and first == other):
            raise Breach(
                "engines disagree",
                place,
                f"{first if isinstance(first, str) else 'ran'}; {other if isinstance(other, str) else 'ran'}",
            )
        return
    for what, one, two in zip(("output", "state"), first[:2], other[:2], strict=True):
        a, b = np.asarray(one, dtype=float), np.asarray(two, dtype=float)
        same = (a.view(np.int64) == b.view(np.int64)) | (np.isnan(a) & np.isnan(b))
        if not same.all():
            at = int(np.flatnonzero(~same)[0])
            raise Breach("engines disagree", place, f"{what} {at}: {a[at]!r} and {b[at]!r}")
    if first[2] != other[2]:
        raise Breach("engines disagree", place, "in events")


KIND: Final = Kind("signals", make, corpus, run)
