"""What a conversion of today has otherwise than a certificate: every value of it is compared, or named as not compared."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any, Final

import pidemu
from pidemu.conversion.comparison import DIAL, Change, ValueComparison, same, text
from pidemu.conversion.document import card_versions
from pidemu.conversion.result import Conversion
from pidemu.conversion.schema import Dial, TargetDial
from pidemu.conversion.signed import Signed
from pidemu.errors import PidemuError

_WORDS: Final = ("sentence", "at_the_loop", "warnings", "match", "chosen", "command")
_BESIDE: Final[Mapping[str, str]] = {
    "notes": "notes",
    "assumptions": "assumptions",
    "runner_up": "runner-up",
    "beside": "other settings",
    "ranking": "ranking",
    "textbook": "textbook rule",
}
"""What stands beside the answer, and what it is called; other versions have other options to choose from."""
_OTHERS: Final[Mapping[str, str]] = {
    "scan": "scan interval",
    "gain_factor": "gain factor",
    "process": "process",
    "setpoint_filter": "setpoint filter",
}


def changes(signed: Signed, c: Conversion) -> Iterator[Change]:
    """Yield what is not as the certificate says, the settings first."""
    now, said = c.to_dict(), signed.plain
    program, words = signed.pidemu == pidemu.__version__, _is_same(signed, c)
    compare = ValueComparison(words=words, complete=program)
    yield from _dials("dial", signed.to.settings, now["to"]["settings"])
    yield from _dials("dial before", signed.source.settings, now["from"]["settings"])
    yield from _options("option", signed.to.options, now["to"]["options"])
    yield from _options("option before", signed.source.options, now["from"]["options"])
    yield from _sides(said, now)
    yield from _verdicts(signed, c, words)
    yield from _conditions(signed, c, compare)
    yield from ValueComparison(words=True, complete=program).of("action", "", said["action"], now["action"])
    yield from compare.of("bench check", "", said["bench_check"], now["bench_check"])
    yield from _plan(signed, c, compare)
    if words:  # all of it follows from these
        yield from _wording(signed, now)
        for name, kind in _BESIDE.items():
            yield from compare.of(kind, "", said[name], now[name])
    for name, kind in _OTHERS.items():
        yield from compare.of(kind, "", said[name], now[name])
    yield from compare.of("verification", "", said["verification"], now["verification"])
    yield from compare.of("figure", "", signed.certificate, now["certificate"])


def not_compared(signed: Signed, cards: Mapping[str, str]) -> tuple[str, ...]:
    """Return what of a certificate is not held against anything.

    Parameters
    ----------
    signed : Signed
        The certificate.
    cards : mapping of str to str
        Versions of the cards today.
    """
    always = "its date, and where in a band a largest value lies (worst_at, largest_at)"
    if signed.pidemu == pidemu.__version__ and signed.cards == cards:
        return (always,)
    return (
        always,
        "wording, assumptions, and what stands beside the answer (textbook rule, ranking, other settings): other versions",
    )


def _is_same(signed: Signed, c: Conversion) -> bool:
    """Tell whether the same pidemu made the certificate from the same cards."""
    return signed.pidemu == pidemu.__version__ and signed.cards == card_versions(c)


def _sides(said: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[Change]:
    """Yield what else is other on either side: the card, ranges, a lag in front."""
    compare = ValueComparison(words=True, complete=True)
    for side, before in (("to", ""), ("from", " before")):
        old, new = ({k: x for k, x in d[side].items() if k not in ("settings", "options")} for d in (said, now))
        for name in dict.fromkeys([*old, *new]):
            kind = {"card": "card", "lag_on_pv": "lag on PV"}.get(name, "range")
            label = name.removesuffix("_range") if kind == "range" else ""
            yield from compare.of(f"{kind}{before}", label, old.get(name), new.get(name))


def _verdicts(signed: Signed, c: Conversion, words: bool) -> Iterator[Change]:
    pairs = (signed.verdict, signed.refusal), (c.verdict, c.refusal)
    old, new = (f"{verdict}{', refused' if refusal else ''}" for verdict, refusal in pairs)
    if old != new:
        yield Change("verdict", "", old, new)
    elif words and signed.refusal != c.refusal:
        yield Change("refusal", "", signed.refusal, c.refusal)
    modes: tuple[dict[Any, str], dict[Any, str]] = {**signed.verdicts}, {**c.verdicts}
    for mode in dict.fromkeys([*modes[0], *modes[1]]):
        one, other = (verdicts.get(mode, "none") for verdicts in modes)
        if one != other and (one, other) != (signed.verdict, c.verdict):
            yield Change("verdict", mode, one, other)


def _options(kind: str, before: Mapping[str, str], now: Mapping[str, str]) -> Iterator[Change]:
    for name in dict.fromkeys([*before, *now]):
        old, new = before.get(name, "not there"), now.get(name, "not there")
        if old != new:
            yield Change(kind, name, old, new)


def _wording(signed: Signed, now: Mapping[str, Any]) -> Iterator[Change]:
    """Yield what the same pidemu words otherwise: what to do at the loop, the sentence, what to watch for."""
    for name in _WORDS:
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
        equal = old is not None and new is not None and old[1] == new[1] and same(float(old[0]), float(new[0]), DIAL, 0.0)
        if not equal:
            yield Change(kind, name, _dial(old), _dial(new))
        dial = before.get(name)
        if equal and isinstance(dial, TargetDial) and not same(float(dial.unrounded), float(now[name]["unrounded"]), DIAL, 0.0):
            yield Change(kind, f"{name} before rounding", text(dial.unrounded), text(now[name]["unrounded"]))


def _dial(value: tuple[Any, str] | None) -> str:
    return "not there" if value is None else f"{text(value[0])} {value[1]}".removesuffix(" 1")


def _conditions(signed: Signed, c: Conversion, compare: ValueComparison) -> Iterator[Change]:
    old = {(x.card, x.path): f"{x.text} ({x.status})" for x in signed.conditions}
    new = {(x.card, x.path): str(x) for x in c.conditions}
    found = [(old.get(key, "none"), new.get(key, "none")) for key in dict.fromkeys([*old, *new])]
    other = [Change("condition", "", before, after) for before, after in found if before != after]
    yield from other
    if compare.words and not other:
        yield from compare.of("condition", "", signed.plain["conditions"], [x.to_dict() for x in c.conditions])


def _plan(signed: Signed, c: Conversion, compare: ValueComparison) -> Iterator[Change]:
    """Yield what is other in the cut-over plan, where there is one."""
    plan = signed.plain.get("transfer_plan")
    if plan is None:
        return
    try:
        now = c.transfer_plan(*plan["at"]).to_dict()
    except PidemuError as error:
        yield Change("cut-over plan", "", "one", f"none: {error}")
        return
    yield from compare.of("cut-over plan", "", plan, {"at": plan["at"], **now})
