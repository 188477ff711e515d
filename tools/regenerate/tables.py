"""The tables of ``docs/conversion.md`` whose figures are computed."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import pidemu
from pidemu.card.load import Card
from pidemu.certificate.linear import bands, deviation
from pidemu.conversion.explain import explained as explained_choices
from pidemu.settings.settings import Settings

TABLE = re.compile(r"^<!-- recomputed: (\w+) -->\n((?:\|.*\n)+)", re.MULTILINE)


def rules() -> list[list[str]]:
    """Rebuild the table of section 4: textbook rule against low-frequency match."""
    at = [0.1, 0.3, 1, 3, 10]
    source = pidemu.load_card("generic/series").settings(K=1, Ti=1, Td=0.25, alpha=0.1)
    rows = [["frequency x Ti", *(f"{w:g}" for w in at)]]
    for match in ("textbook", "low-frequency"):
        found = pidemu.convert(
            source, "emerson/deltav", options={"FORM": "Standard"}, given={"ALPHA": 0.125}, match=match, emulate=False
        ).settings
        ratios = [complex(found.law().response(w) / source.law().response(w)) for w in at]
        cells = [f"{abs(20 * math.log10(abs(r))):.2f} / {abs(math.degrees(math.atan2(r.imag, r.real))):.1f}" for r in ratios]
        rows.append([match, *cells])
    return rows


def _from_per_scan(card: Card, numbers: tuple[float, ...], h: float) -> Settings:
    """Return the settings that a recursion with these P, I and D per scan amounts to at an interval [s]."""
    P, per_scan, D = numbers
    return card.settings(kp=P, ki=per_scan / h, kd=D * h)


def scaled() -> list[list[str]]:
    """Rebuild the table of section 7: what becomes of settings at half the scan interval."""
    card = pidemu.load_card("generic/parallel")
    kp, ki, kd, h = 2.0, 0.1, 8.0, 1.0
    half, ratio = h / 2, 1 / 2
    source = card.settings(kp=kp, ki=ki, kd=kd)
    band = bands(source.law(), h)[0]
    compensated = pidemu.convert(source, card, scan=(h, half), compensate=True, emulate=False).settings
    per_scan = kp, ki * h, kd / h
    entered = {
        "the settings compensated for the interval": compensated,
        "the same settings, per second": source,
        "the gain halved on a standard form": card.settings(kp=kp * ratio, ki=ki * ratio, kd=kd * ratio),
        "numbers per scan, copied": _from_per_scan(card, per_scan, half),
        "numbers per scan, all halved": _from_per_scan(card, tuple(ratio * x for x in per_scan), half),
    }
    rows = [["what is entered at 0.5 s", "kp", "ki", "kd", "deviation"]]
    for name, s in entered.items():
        off = deviation(source.law(h), s.law(half), band, 1.0)
        rows.append([name, *(f"{s[dial].value:.6g}" for dial in ("kp", "ki", "kd")), f"{off:.1%}".replace("%", " %")])
    return rows


def explained() -> list[list[str]]:
    """Rebuild the table of section 10: what --explain prints of the choices that are not refused."""
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
    found = explained_choices(pidemu.convert(source, "emerson/deltav", emulate=False, digits=5))
    rows = [[e.options, e.verdict, e.loop_band, e.setpoint, e.why] for e in found if e.verdict != "refused"]
    return [["options", "verdict", "loop band", "setpoint", "why not"], *rows]


def worked() -> list[list[str]]:
    """Rebuild the table of section 13: the worked conversion."""
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
    dials = {"GAIN": ".4f", "RESET": ".3f", "RATE": ".4f", "ALPHA": ".4f", "BETA": ".4f"}
    rows = [["FORM", "STRUCTURE", "scans, s", *dials, "verdict", "feedback", "setpoint", "all", "at rest"]]
    for form, structure, scan, compensate in (
        ("Series", "1", (1, 1), False),
        ("Series", "1", (1, 0.5), False),
        ("Standard", "7", (1, 1), False),
        ("Standard", "1", (1, 1), False),
        ("Standard", "2", (1, 1), False),
        ("Standard", "1", (1, 0.5), False),
        ("Standard", "1", (1, 0.5), True),
    ):
        chosen = {"FORM": form, "STRUCTURE": structure}
        c = pidemu.convert(source, "emerson/deltav", options=chosen, scan=scan, compensate=compensate)
        cells = [f"{c.settings[n].value:{f}}" if c.settings[n].active else "-" for n, f in dials.items()]
        run, both = c.certificate.scan_by_scan, (c.certificate.feedback_at_scan, c.certificate.setpoint_at_scan)
        assert run is not None
        paths = [f"{p.loop_band.max_deviation:.1%}".replace("%", " %") for p in both if p is not None]
        scans = f"{scan[0]}, {scan[1]}" + (", compensated" if compensate else "")
        rows.append([form, structure, scans, *cells, c.verdict, *paths, f"{run.largest:.2f}", f"{run.on_measurement:.2f}"])
    return rows


REBUILT: dict[str, Callable[[], list[list[str]]]] = {"rules": rules, "scaled": scaled, "explained": explained, "worked": worked}
"""Every table by the name in the comment before it."""


def renewed(text: str) -> str:
    """Return the text of the page with its tables as they are today."""

    def table(match: re.Match[str]) -> str:
        rows = REBUILT[match[1]]()
        lines = [f"| {' | '.join(row)} |" for row in rows]
        return "\n".join([f"<!-- recomputed: {match[1]} -->", lines[0], "|" + "---|" * len(rows[0]), *lines[1:], ""])

    return TABLE.sub(table, text)
