"""What of a conversion is not as its signed certificate says."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import pidemu
from pidemu.certificate.figures import number
from pidemu.conversion.result import Conversion
from pidemu.conversion.schema import Dial
from pidemu.conversion.signed import Signed

DIAL: Final = 1e-6
"""Relative difference up to which a dial is the same: optimisers and other processors end that near, and no dial is set finer."""
FIGURE: Final = 1e-4
"""The same of a figure: the largest of a curve, the root of a margin and the area of a response are found that exactly, and are
printed to two to four digits."""
ZERO: Final = 1e-5
"""Difference of figures that is none, whatever their size: what rounding dials to five digits makes of zero [1, dB, deg, s]."""
_PLACES: Final = frozenset({"worst_at", "largest_at", "notes", "text"})
"""What is not compared: where a largest value is, which jumps between equal ones, and wording."""


@dataclass(frozen=True, slots=True)
class Change:
    """One thing that is not as the certificate says.

    Attributes
    ----------
    kind : str
        What it is: ``conversion``, ``dial``, ``dial before``, ``option``, ``verdict``, ``condition``, ``action``, ``bench check``,
        ``figure`` or, by the same pidemu with the same cards, what is worded: ``sentence``, ``at the loop``, ``warnings``,
        ``match``, ``chosen``, ``command``.
    name : str
        Which one; empty where there is but one.
    before, after : str
        What the certificate says, and what comes out now.
    """

    kind: str
    name: str
    before: str
    after: str

    def __str__(self) -> str:
        what = f"{self.kind} {self.name}".strip()
        return f"{what}: {self.before} on the certificate, {self.after} now"


def changes_from(signed: Signed, c: Conversion) -> Iterator[Change]:
    """Yield what is not as the certificate says, the settings first."""
    now = c.to_dict()
    yield from _dials("dial", signed.to.settings, now["to"]["settings"])
    yield from _dials("dial before", signed.source.settings, now["from"]["settings"])
    for name in dict.fromkeys([*signed.to.options, *now["to"]["options"]]):
        old, new = signed.to.options.get(name, "none"), now["to"]["options"].get(name, "none")
        if old != new:
            yield Change("option", name, old, new)
    old, new = (f"{verdict}{', refused' if refusal else ''}" for verdict, refusal in _verdicts(signed, c))
    if old != new:
        yield Change("verdict", "", old, new)
    yield from _conditions(signed, c)
    if signed.action.text != now["action"]["text"]:
        yield Change("action", "", signed.action.text, now["action"]["text"])
    yield from _bench_check(signed, now["bench_check"])
    same_program = signed.pidemu == pidemu.__version__
    if same_program and signed.cards == now["cards"]:  # words follow from these
        yield from _wording(signed, now)
    yield from (Change("figure", *x) for x in _figures("", signed.certificate, now["certificate"], complete=same_program))


def _verdicts(signed: Signed, c: Conversion) -> tuple[tuple[str, str], tuple[str, str]]:
    return (signed.verdict, signed.refusal), (c.verdict, c.refusal)


def _wording(signed: Signed, now: Mapping[str, Any]) -> Iterator[Change]:
    """Yield what the same pidemu words otherwise: what to do at the loop, the sentence, what to watch for."""
    for name in ("sentence", "at_the_loop", "warnings", "match", "chosen", "command"):
        old, new = getattr(signed, name), now[name]
        if old != new:
            yield Change(name.replace("_", " "), "", *_first_difference(old, new))


def _first_difference(old: Any, new: Any) -> tuple[str, str]:
    if not (isinstance(old, list) and isinstance(new, list)):
        return str(old), str(new)
    pairs = itertools.zip_longest(old, new, fillvalue="nothing")
    return next((str(x), str(y)) for x, y in pairs if x != y)


def _dials(kind: str, before: Mapping[str, Dial], now: Mapping[str, Mapping[str, Any]]) -> Iterator[Change]:
    for name in dict.fromkeys([*before, *now]):
        old = (before[name].value, before[name].unit) if name in before else None
        new = (now[name]["value"], now[name]["unit"]) if name in now else None
        same = old is not None and new is not None and old[1] == new[1] and _same(float(old[0]), float(new[0]), DIAL, 0.0)
        if not same:
            yield Change(kind, name, _dial(old), _dial(new))


def _dial(value: tuple[Any, str] | None) -> str:
    return "not there" if value is None else f"{_text(value[0])} {value[1]}".removesuffix(" 1")


def _conditions(signed: Signed, c: Conversion) -> Iterator[Change]:
    old = {(x.card, x.path): f"{x.text} ({x.status})" for x in signed.conditions}
    new = {(x.card, x.path): str(x) for x in c.conditions}
    for key in dict.fromkeys([*old, *new]):
        before, after = old.get(key, "none"), new.get(key, "none")
        if before != after:
            yield Change("condition", "", before, after)


def _bench_check(signed: Signed, now: Mapping[str, Any] | None) -> Iterator[Change]:
    old = None if signed.bench_check is None else signed.bench_check.model_dump()
    if (old is None) != (now is None):
        yield Change("bench check", "", *(("none" if x is None else "one") for x in (old, now)))
    elif old is not None and now is not None:
        yield from (Change("bench check", *x) for x in _figures("", old, now, complete=True))


def _figures(name: str, old: Any, new: Any, *, complete: bool) -> Iterator[tuple[str, str, str]]:
    """Yield name, old and new value of the figures that differ; those that the old program did not know only if `complete`."""
    a, b = _number(old), _number(new)
    if isinstance(new, dict) and isinstance(old, dict):
        for key in new:
            if key not in _PLACES and (complete or key in old):
                yield from _figures(f"{name}.{key}" if name else str(key), old.get(key), new[key], complete=complete)
    elif isinstance(new, list) and isinstance(old, list) and len(new) == len(old):
        for k, (x, y) in enumerate(zip(old, new, strict=True)):
            yield from _figures(f"{name}[{k}]", x, y, complete=complete)
    elif a is not None and b is not None:
        if not _same(a, b, FIGURE, ZERO):
            yield name, _text(old), _text(new)
    elif type(old) is not type(new) or (old != new and not isinstance(new, str)):  # words are not compared
        yield name, _text(old), _text(new)


def _number(x: Any) -> float | None:
    if isinstance(x, bool) or not isinstance(x, int | float | str) or (isinstance(x, str) and x not in ("inf", "-inf", "nan")):
        return None
    try:
        return float(x)
    except OverflowError:  # a whole number of JSON has no largest
        return math.inf


def _same(a: float, b: float, relative: float, absolute: float) -> bool:
    return math.isclose(a, b, rel_tol=relative, abs_tol=absolute) or (math.isnan(a) and math.isnan(b))


def _text(x: Any) -> str:
    """Return a figure in print."""
    if isinstance(x, list | dict):
        return f"{len(x)} entries" if isinstance(x, list) else "figures"
    value = _number(x)
    if value is not None:
        return number(value)
    return "none" if x is None else "yes" if x is True else "no" if x is False else str(x)[:80]
