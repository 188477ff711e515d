"""The command that makes a conversion again. It is tried before it is printed."""

from __future__ import annotations

import itertools
import math
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.certificate.linear import differences
from pidemu.conversion.convert import Conversion, convert
from pidemu.errors import PidemuError
from pidemu.loop.process import Process
from pidemu.settings import Settings
from pidemu.units import Role

_COMPUTED: Final = (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE)
_SAME: Final = 1e-9
_REFINED: Final = 60


@dataclass(frozen=True, slots=True)
class _Asked:
    """What may have been asked for beside the settings."""

    options: dict[str, str]
    dials: dict[str, float]
    match: str | None
    compensate: bool


def command_for(c: Conversion) -> str | None:
    """Return the ``pidemu convert`` command that gives the same settings.

    A conversion holds what it found, not which options, dials and match were asked for: the shortest command is composed that
    gives the same settings when run, which is tried.

    Parameters
    ----------
    c : Conversion
        The conversion.

    Returns
    -------
    str or None
        For a shell; ``None`` where no command was found that gives the same settings.
    """
    for asked in _candidates(c):
        try:
            again = convert(c.source, c.settings.card, **_arguments(c, asked))
        except PidemuError:
            continue
        if _same(again.settings, c.settings):
            return shlex.join(_words(c, asked))
    return None


def _candidates(c: Conversion) -> Iterator[_Asked]:
    """Yield what may have been asked for, the shortest first."""
    options = c.settings.options
    defaults = dict(c.settings.card.variant({}).chosen)
    changed = {n: x for n, x in options.items() if x != defaults[n] and n not in c.chosen}
    pinned = {n: v.value for n, v in c.settings.items() if v.active and v.role not in _COMPUTED}
    changed_dials = {n: x for n, x in pinned.items() if x != c.settings[n].setting.default}
    dials = [{}, *([changed_dials] if changed_dials else []), *([pinned] if pinned != changed_dials else [])]
    matches: list[str | None] = [None] if c.match in ("exact", "low-frequency") or c.refusal else []
    explicit: str = c.match
    if c.match == "frequency" and c.process is None:
        explicit = f"frequency:{_matched_at(c)!r}rad/s"
    ways = itertools.product((True, False) if c.scan else (True,), [*matches, explicit], dials)
    for compensate, match, given in ways:
        yield _Asked(changed, given, match, compensate)
        if changed != options:
            yield _Asked(options, given, match, compensate)


def _arguments(c: Conversion, asked: _Asked) -> dict[str, Any]:
    return {
        "options": asked.options, "given": asked.dials, "scan": c.scan, "match": asked.match, "compensate": asked.compensate,
        "allow_approximate": bool(c.refusal), "round_dials": bool(c.certificate.dials), "process": c.process,
        "pv_range": c.settings.pv_range, "op_range": c.settings.op_range, "emulate": False,
    }  # fmt: skip


def _same(a: Settings, b: Settings) -> bool:
    return a.options == b.options and all(math.isclose(v.value, b[n].value, rel_tol=_SAME) for n, v in a.items())


def _words(c: Conversion, asked: _Asked) -> Iterator[str]:
    source, settings = c.source, c.settings
    yield from ("pidemu", "convert", name_of(source.card))
    yield from (f"{n}={exactly(v.value)}" for n, v in source.items() if v.given)
    yield from (f"{n}={x}" for n, x in source.options.items() if n not in source.defaulted)
    yield from ("--to", name_of(settings.card))
    for n, x in (*asked.options.items(), *((n, exactly(x)) for n, x in asked.dials.items())):
        yield from ("--set", f"{n}={x}")
    if c.scan is not None:
        yield from ("--scan", ",".join(exactly(h) for h in dict.fromkeys(c.scan)))
    for name, own, other in (("pv", source.pv_range, settings.pv_range), ("op", source.op_range, settings.op_range)):
        if own is not None:
            yield f"--{name}-range={exactly(own[0])},{exactly(own[1])}"
        if other is not None and other != own:
            yield f"--to-{name}-range={exactly(other[0])},{exactly(other[1])}"
    if asked.match is not None:
        yield from ("--match", asked.match)
    if c.process is not None:
        yield from ("--process", process_words(c.process))
    flags = (
        ("--no-compensation", not asked.compensate), ("--round", c.certificate.dials), ("--allow-approximate", c.refusal)
    )  # fmt: skip
    yield from (flag for flag, wanted in flags if wanted)


def name_of(card: Card) -> str:
    """Return what a command calls a card: its id, or its file where another card, or none, has this id."""
    try:
        found = load_card(card.id)
    except PidemuError:
        return card.document.path
    return card.id if found.document.value == card.document.value else card.document.path


def exactly(x: float) -> str:
    """Return a number that reads back as the same one."""
    short = f"{x:.12g}"
    return short if float(short) == x else repr(x)


def process_words(p: Process) -> str:
    """Return a process as ``--process`` takes it.

    Parameters
    ----------
    p : Process
        The process.

    Examples
    --------
    >>> process_words(Process.from_lags(1.5, lags=[10, 2], integrators=1, delay=3))
    'gain=1.5,lag=10,lag=2,integrators=1,delay=3'
    """
    words = [f"gain={exactly(p.gain)}"]
    words += [_root(r, "lag", "pole") for r in p.poles if r and r.imag >= 0]
    words += [_root(r, "lead", "zero") for r in p.zeros if r.imag >= 0]
    if p.integrators:
        words.append(f"integrators={p.integrators}")
    if p.delay:
        words.append(f"delay={exactly(p.delay)}")
    return ",".join(words)


def _root(r: complex, time: str, root: str) -> str:
    """Return a root as a time constant where that is the same number, else in the s plane; a complex one brings its conjugate."""
    if r.imag:
        return f"{root}={r.real!r}{r.imag:+}j"
    constant = exactly(-1 / r.real) if r.real else ""
    if constant and -1 / float(constant) == r.real and (root == "zero" or r.real < 0):
        return f"{time}={constant}"
    return f"{root}={r.real!r}"


def _matched_at(c: Conversion) -> float:
    """Return the frequency at which both laws are alike, where a match at a frequency put it [rad/s]."""
    laws = (c.source.law(c.scan[0]), c.settings.law(c.scan[1])) if c.scan else (c.source.law(), c.settings.law())
    band = c.certificate.headline.full_band
    if c.certificate.headline.is_exact:
        return float(f"{math.sqrt(band.low * band.high):.2g}")  # any will do
    w = np.geomspace(band.low, band.high, 2000)
    for _ in range(_REFINED):
        k = int(np.argmin(differences(c.factor * laws[0].held(w), laws[1].held(w))[0]))
        w = np.geomspace(w[max(k - 1, 0)], w[min(k + 1, w.size - 1)], 13)
        if w[-1] - w[0] <= 1e-14 * w[0]:
            break
    found = float(w[6])
    short = float(f"{found:.4g}")
    return short if math.isclose(short, found, rel_tol=1e-7) else found
