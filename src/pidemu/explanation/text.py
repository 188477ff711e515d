"""An explanation in lines."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

from pidemu.explanation.forms import Times
from pidemu.explanation.words import four, terms_see
from pidemu.formatting import number

if TYPE_CHECKING:
    from pidemu.explanation.model import Explanation, Mode

_WIDTH: Final = 110
_PLACES: Final = {
    "derivative": "on the D term alone",
    "lead-lag": "in the lead-lag (1 + Td s)/(1 + Tf s)",
    "measurement": "on the measurement: P, I and D see what it lets through",
    "output": "on the output",
    "setpoint": "on the setpoint",
    "error": "on the error",
}

Section = tuple[str, list[list[str]]]
"""A title, and rows of cells; a row of one cell is a paragraph."""


def sections(e: Explanation) -> Iterator[Section]:
    """Yield the parts of an explanation, the sentences that say it all first."""
    yield "In short", [[line] for line in e.summary.splitlines()]
    yield "Dials", [_dial(d.name, d.value, d.unit, d.others, given=d.given, off=d.off) for d in e.dials]
    if e.forms is not None:
        yield f"In every form (gain in {e.gain_unit})", list(_forms(e))
    if e.filters:
        yield "Filters", [_filter(f.on, f.time, f.ratio, f.order) for f in e.filters]
    if e.kind != "none":
        yield "Setpoint, measurement and noise (output per signal)", list(_signals(e))
    for title, lines in (
        ("Beside these numbers", e.beyond),
        ("Not stated, so taken", e.not_stated),
        ("As it was read", e.notes),
        ("Rests on what the card's sources do not state", e.rests_on),
    ):
        if lines:
            yield title, [[f"- {line}"] for line in lines]


def as_text(e: Explanation) -> str:
    """Return an explanation in lines of at most 110 characters."""
    chosen = ", ".join(f"{option}={choice}" for option, choice in e.options.items())
    lines = textwrap.wrap(f"{e.card}   {e.title}" + (f"  [{chosen}]" if chosen else ""), _WIDTH)
    for title, rows in sections(e):
        lines += ["", title, *table_lines(rows)]
    return "\n".join(lines) + "\n"


def table_lines(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield rows as aligned lines, the last cell wrapped; a row of one cell as a paragraph."""
    several = [row for row in rows if len(row) > 1]
    widths = [max((len(row[i]) for row in several if len(row) > i + 1), default=0) for i in range(max(map(len, rows), default=0))]
    for row in rows:
        first = "  " + "".join(cell.ljust(widths[i] + 2) for i, cell in enumerate(row[:-1]))
        rest = " " * len(first) if len(row) > 1 else "    " if row[0].startswith("- ") else "  "
        wrapped = textwrap.fill(row[-1], _WIDTH, initial_indent=first, subsequent_indent=rest, break_long_words=False)
        yield from (line.rstrip() for line in wrapped.splitlines() or [first])


def _dial(name: str, value: float, unit: str, others: Mapping[str, float], *, given: bool, off: bool) -> list[str]:
    same = " ".join(f"= {'PB ' if u == '%' else ''}{number(x)} {u}" for u, x in others.items())
    said = "off" if off else same
    return [name, f"{number(value)}{'' if unit == '1' else f' {unit}'}", said + ("" if given else " (card's default)")]


def _forms(e: Explanation) -> Iterator[list[str]]:
    assert e.forms is not None
    p = e.forms.parallel
    gains = [f"kp {four(p.kp)}", f"ki {four(p.ki)} 1/s" + (f" = {four(60 * p.ki)} 1/min" if p.ki else ""), _both("kd", p.kd)]
    d = "s/(1 + Tf s)" if e.forms.term_filter else "s"
    lead = "(1 + Td s)/(1 + Tf s)" if e.forms.term_filter and e.forms.lead_lag else f"(1 + Td {d})"
    yield ["parallel", f"kp + ki/s + kd {d}", ", ".join(gains)]
    for name, formula, t in (
        ("standard", f"K (1 + 1/(Ti s) + Td {d})", e.forms.standard),
        ("series", f"K (1 + 1/(Ti s)) {lead}", e.forms.series),
    ):
        yield [name, formula, _times(e, t)] if t is not None else [name, "none", e.forms.why_not[name]]


def _times(e: Explanation, t: Times) -> str:
    band = f" (PB {four(100 / abs(t.K))} %)" if e.gain_unit == "%/%" else ""
    integral = f"{_both('Ti', t.Ti)} = {four(60 / t.Ti)} repeats/min" if math.isfinite(t.Ti) else "no integral"
    return f"K {four(t.K)}{band}, {integral}, {_both('Td', t.Td)}"


def _both(name: str, seconds: float) -> str:
    return f"{name} {four(seconds)} s" + (f" = {four(seconds / 60)} min" if seconds else "")


def _filter(on: str, time: float, ratio: float | None, order: int) -> list[str]:
    per = "" if ratio is None else f"{four(ratio)} of Td (N = {four(1 / ratio)}), "
    minutes = f" = {four(time / 60)} min" if time >= 60 else ""
    return [f"Tf {four(time)} s{minutes}", f"{per}{_PLACES[on]}{', second order' if order == 2 else ''}"]


def _signals(e: Explanation) -> Iterator[list[str]]:
    same = e.automatic == e.cascade
    yield ["", "continuous", *([f"at {number(e.scan)} s"] if e.scan is not None else []), ""]
    modes = (("", e.automatic),) if same else ((" in automatic", e.automatic), (" in cascade", e.cascade))
    for name, mode in modes:
        seen = "" if e.forms is None else terms_see(e, mode)
        yield _kick(f"SP kick{name}", mode, "setpoint_kick", seen + (", the same in cascade" if same and seen else ""))
    yield _kick("PV kick", e.automatic, "measurement_kick", "at once; at a scan interval, in the first scan")
    yield _kick("noise gain", e.automatic, "noise_gain", "for the fastest changes of PV; at a scan interval, at half the scan rate")


def _kick(name: str, mode: Mode, what: str, words: str) -> list[str]:
    found = ["-" if mode.responses is None else four(getattr(mode.responses, what))]
    if mode.at_scan is not None:
        found.append(four(getattr(mode.at_scan, what)))
    return [name, *found, words]
