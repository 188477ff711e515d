"""What the certificate of a conversion prints, piece by piece."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import pidemu
from pidemu.certificate.figures import (
    BAND_COLUMNS,
    band_rows,
    decibels,
    degrees,
    emulation_line,
    kick_line,
    loop_rows,
    number,
    other_units,
    percent,
    rounding_line,
    textbook_line,
    unit_of,
)
from pidemu.certificate.models import EXACT
from pidemu.conversion.result import Conversion
from pidemu.cutover.plan import TransferPlan
from pidemu.errors import PidemuError
from pidemu.plain import exactly
from pidemu.ranges import SignalRange
from pidemu.report.command import command_for
from pidemu.report.curves import Who, bode, closed_loops, responses
from pidemu.report.pictures import bode_picture, loops_picture, responses_picture

_VERDICTS: Final = {
    "exact": "Exact",
    "exact-feedback": "Exact against disturbances",
    "approximate": "Approximate",
    "refused": "Only the nearest settings",
}
_MATCHES: Final = {
    "exact": "the same law for measurement",
    "low-frequency": "the same law at low frequencies, where the integral works",
    "textbook": "by the rule in manuals",
    "frequency": "the same gain and phase at one frequency",
    "loop": "the load response of the loop changes least",
    "constrained": "the largest deviation in the loop band is least",
}


@dataclass(frozen=True, slots=True)
class Dial:
    """A dial in print.

    Attributes
    ----------
    name, text, unit, other, note : str
        Its name, its value and unit, the value in the other usual unit, and where it is from.
    exact : str
        The value with all its digits.
    textbook : str
        What the textbook rule gives.
    """

    name: str
    text: str
    unit: str
    other: str
    exact: str
    note: str = ""
    textbook: str = ""


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture with what it says in words; without the picture, why there is none."""

    title: str
    svg: str
    words: str


class Contents:
    """What the template prints.

    Parameters
    ----------
    conversion : Conversion
        The conversion.
    plan : TransferPlan or None
        How to change over.
    """

    version = pidemu.__version__
    band_columns = BAND_COLUMNS

    def __init__(self, conversion: Conversion, plan: TransferPlan | None) -> None:
        self.c = conversion
        self.plan = plan
        self.certificate = conversion.certificate
        self.bands = band_rows(self.certificate)
        self.loop = loop_rows(self.certificate.loop) if self.certificate.loop is not None else []

    @property
    def verdict(self) -> str:
        """The verdict's word, which also is the class of its band."""
        return "refused" if self.c.refusal else self.c.verdict

    @property
    def verdict_title(self) -> str:
        """The verdict in words."""
        return _VERDICTS[self.verdict]

    @property
    def source_dials(self) -> list[Dial]:
        """Dials of the source that are in use."""
        return [
            Dial(n, number(v.value), unit_of(v), other_units(v), exactly(v.value), "" if v.given else "card's default")
            for n, v in self.c.source.items()
            if v.active
        ]

    @property
    def target_dials(self) -> list[Dial]:
        """Dials of the target that are in use."""
        book = self.c.textbook.settings
        return [
            Dial(
                n, number(v.value), unit_of(v), other_units(v), exactly(v.value),
                textbook=number(book[n].value) if book is not None and n in book and book[n].active else "-",
            )
            for n, v in self.c.settings.items()
            if v.active
        ]  # fmt: skip

    @property
    def rounded(self) -> list[tuple[str, str, str]]:
        """Dials that were rounded: name, before, after."""
        return [(d.name, number(d.exact), number(d.rounded)) for d in self.certificate.dials]

    @property
    def lines(self) -> list[str]:
        """What stands below the figures."""
        c = self.certificate
        return [line for line in (emulation_line(c), kick_line(c), rounding_line(c), textbook_line(self.c)) if line]

    @property
    def choices(self) -> Iterator[tuple[str, str]]:
        """How the settings came about."""
        c = self.c
        yield "match", f"{c.match}: {_MATCHES[c.match]}"
        for who, s in (("before", c.source), ("after", c.settings)):
            if s.options:
                yield f"options {who}", s.variant.choice_text
        if c.chosen:
            yield "chosen", f"{', '.join(f'{n}={x}' for n, x in c.chosen.items())}, as nobody said otherwise"
        yield "scan interval", self._scans()
        for what, before, after in (
            ("measurement range", c.source.pv_range, c.settings.pv_range), ("output range", c.source.op_range, c.settings.op_range),
        ):  # fmt: skip
            if before or after:
                yield what, f"{_range(before)} before, {_range(after)} after"
        if c.factor != 1:
            yield "gain", f"multiplied by {number(c.factor)} for the new ranges or the new action"
        if c.process is not None:
            yield "process", c.process.text
        band = self.certificate.headline.loop_band
        yield "loop band", f"{band.low:.3g} to {band.high:.3g} rad/s: where the loop works"

    def _scans(self) -> str:
        scan, emulated = self.c.scan, self.certificate.scan_by_scan
        if scan is not None:
            return f"{number(scan[0])} s before, {number(scan[1])} s after"
        return f"not given; {number(emulated.scan[0])} s taken to run both" if emulated is not None else "not given"

    @property
    def notes(self) -> tuple[str, ...]:
        """How the numbers were read."""
        return (*self.c.source.notes, *self.c.settings.notes)

    @property
    def assumed(self) -> list[str]:
        """What the settings rest on without anybody having said so."""
        others = len(self.c.assumptions) - len(self.c.law_assumptions)
        what = "1 more assumption concerns" if others == 1 else f"{others} more assumptions concern"
        more = f"{what} scan rules, limits and transfers: 'pidemu show' and --json list them"
        return [*self.c.law_assumptions, *([more] if others else [])]

    @property
    def bump(self) -> str:
        """What the cut-over does to the output."""
        assert self.plan is not None
        return f"the output then moves by {number(self.plan.bump)} % of span; without this, by {number(self.plan.without_plan)} %"

    @property
    def not_covered(self) -> Iterator[str]:
        """What nobody should take this page for."""
        if self.c.process is None:
            yield "the process: none was given, so that margins and loop responses before and after are not known (--process)"
        else:
            yield "how well the process model describes the real process, and valve, transmitter and their nonlinearity"
        if self.c.scan is None:
            yield "the real scan intervals: none were given, and the figures are those of the continuous laws (--scan)"
        if self.certificate.scan_by_scan is None:
            yield f"running both against each other: {self.certificate.not_emulated or 'it was not asked for'}"
        yield (
            "what lies outside the two controller blocks: filters and scaling of inputs, characterisation of the output, split "
            "range, cascades, feedforward, interlocks, alarms"
        )
        yield "another firmware or other options; whether what was read off the old controller is what it ran with"

    @cached_property
    def command(self) -> str:
        """The command that makes the conversion again."""
        return command_for(self.c)

    @property
    def names(self) -> dict[Who, str]:
        """What to call the curves."""
        return {
            "source": f"before: {self.c.source.card.id}",
            "target": f"after: {self.c.settings.card.id}",
            "textbook": "after, textbook rule",
        }

    @property
    def pictures(self) -> Iterator[Picture]:
        """The pictures, in their order."""
        yield self._bode()
        found = responses(self.c)
        if found is not None:
            yield Picture("Outputs, the loop open", responses_picture(found, self.names), self._responses(found.notes, found.at))
        if self.c.process is not None:
            yield self._loops()

    def _bode(self) -> Picture:
        found, band = bode(self.c), self.certificate.headline.loop_band
        apart = f"differ by up to {percent(band.max_deviation)}, {decibels(band)}, {degrees(band)}"
        how = "at the scan intervals, held from scan to scan" if self.c.scan else "continuous"
        return Picture(
            f"Measurement to output ({how})",
            bode_picture(found, self.names),
            f"Gain and phase of both controllers over frequency, and target per source. In the loop band they "
            f"{apart if band.max_deviation >= EXACT else 'do not differ'}.",
        )

    def _responses(self, notes: tuple[str, ...], at: float) -> str:
        e = self.certificate.scan_by_scan
        assert e is not None
        words = f"Both controllers emulated every {_intervals(e.scan)} s, without output limits; the step is at {number(at)} s."
        return " ".join([words, *(f"{note[0].upper()}{note[1:]}." for note in notes)])

    def _loops(self) -> Picture:
        title = f"Closed loop with the process {self.c.process}"
        try:
            found = closed_loops(self.c)
        except PidemuError as error:
            return Picture(title, "", f"Not simulated: {error}.")
        assert found is not None
        return Picture(
            title,
            loops_picture(found, self.names),
            f"A setpoint step and a load step at the process input, of {number(found.size)} % each, both controllers emulated "
            f"every {_intervals(found.scan)} s, without output limits.",
        )


def _range(given: SignalRange | None) -> str:
    return str(given) if given else "not given"


def _intervals(scans: tuple[float, float]) -> str:
    return " and ".join(number(h) for h in dict.fromkeys(scans))
