"""What the certificate of a conversion prints, piece by piece."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import pidemu
from pidemu.certificate.figures import BAND_COLUMNS, band_rows, decibels, degrees, loop_rows, percent, rounding_line
from pidemu.certificate.models import EXACT
from pidemu.conversion.document import card_versions
from pidemu.conversion.result import Conversion
from pidemu.conversion.statement import (
    MATCHES,
    Row,
    bump_line,
    chosen_line,
    figure_lines,
    lag_line,
    neutral_line,
    pace_line,
    proof_lines,
    ranges_line,
    sections,
    source_rows,
    target_rows,
    unverified,
)
from pidemu.conversion.verify import SHORT
from pidemu.cutover.plan import TransferPlan
from pidemu.errors import PidemuError
from pidemu.formatting import exactly, number
from pidemu.report.curves import Who, bode, closed_loops, responses
from pidemu.report.pictures import bode_picture, loops_picture, responses_picture
from pidemu.settings.action import action_line
from pidemu.settings.settings import Settings

if TYPE_CHECKING:
    from markupsafe import Markup

_VERDICTS: Final = {
    "exact": "Exact",
    "exact-feedback": "Exact against disturbances",
    "approximate": "Approximate",
    "refused": "Only the nearest settings",
}
_MODES: Final = {
    "auto": "automatic: the operator sets the setpoint",
    "cascade": "cascade: another controller sets the setpoint",
    "both": "automatic and cascade",
}


_OPTION: Final = re.compile(r"(^|[\s(])(--[a-z][a-z-]*)")


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture with what it says in words; without the picture, why there is none."""

    title: str
    svg: str
    words: str


@dataclass(frozen=True, slots=True)
class ControllerSheet:
    """One controller: its heading, its dials, and what else is set on it."""

    id: str
    title: str
    rows: list[Row]
    facts: list[tuple[str, str]]


class Contents:
    """What the template prints.

    Parameters
    ----------
    conversion : Conversion
        The conversion.
    plan : TransferPlan or None
        How to change over.
    date : datetime.date
        Date of the certificate.
    """

    version = pidemu.__version__
    band_columns = BAND_COLUMNS
    exactly = staticmethod(exactly)

    def __init__(self, conversion: Conversion, plan: TransferPlan | None, date: datetime.date) -> None:
        self.c = conversion
        self.plan = plan
        self.date = date.isoformat()
        self.tag = conversion.request.tag
        self.certificate = conversion.certificate
        self.cards = {card: digest[:SHORT] for card, digest in card_versions(conversion).items()}
        self.sections = list(sections(conversion))
        self.bands = band_rows(self.certificate)
        self.lines = figure_lines(conversion)
        self.loop = loop_rows(self.certificate.loop) if self.certificate.loop is not None else []
        self.proof = proof_lines(conversion)
        self.unverified = unverified(conversion)

    @staticmethod
    def whole(text: str) -> Markup:
        """Return a text in which no option of the command line is broken at its hyphens."""
        from markupsafe import Markup, escape

        return Markup(_OPTION.sub(r'\1<span class="nb">\2</span>', str(escape(text))))

    @property
    def verdict(self) -> str:
        """The verdict's word, which also is the class of its band."""
        return "refused" if self.c.refusal else self.c.verdict

    @property
    def verdict_title(self) -> str:
        """The verdict in words."""
        return _VERDICTS[self.verdict]

    @property
    def source(self) -> ControllerSheet:
        """The old controller as it was found, which is also the way back."""
        s = self.c.source
        return ControllerSheet("source", s.card.title, source_rows(s), list(self._facts(s, 0, action_line(s, self.c.action))))

    @property
    def target(self) -> ControllerSheet:
        """The new controller."""
        s = self.c.settings
        facts = list(self._facts(s, 1, self.c.action_text))
        rounding = rounding_line(self.certificate, self.c.request.digits)
        neutral = neutral_line(s).removeprefix("neutral, to be set so: ")
        extra = [(title, text) for title, text in (("neutral, to be set so", neutral), ("rounding", rounding)) if text]
        return ControllerSheet("target", s.card.title, target_rows(self.c), [*facts, *extra])

    def _facts(self, s: Settings, side: int, action: str) -> Iterator[tuple[str, str]]:
        scans, real = self.c.request.declared, self.c.request.runs_every
        if s.options:
            yield "options", ", ".join(f"{n}={x}{self._how(side, n)}" for n, x in s.options.items())
        if lag_line(s):
            yield "filter", lag_line(s)
        yield "action", action
        yield "ranges", ranges_line(s).removeprefix("ranges: ") or "not given"
        scan = "not given" if scans is None else f"{number(scans[side])} s"
        executed = f", executed every {number(real[side])} s" if real is not None and scans is not None else ""
        yield "scan", scan + executed + (f"; {pace_line(s)}" if pace_line(s) else "")

    def _how(self, side: int, option: str) -> str:
        """Return how an option came about, where it was not stated."""
        if side == 0:
            return " (not stated)" if option in self.c.source.defaulted else ""
        return " (chosen automatically)" if option in self.c.chosen else ""

    def as_found(self, row: Row) -> str:
        """Return how a dial of the source was written, where that is not its value in the card's unit."""
        typed = row.dial.typed
        if not isinstance(typed, str) or typed.split()[0] in (row.value, exactly(row.dial.value)):
            return ""
        try:
            return "" if float(typed) == row.dial.value else f"found as {typed}"
        except ValueError:
            return f"found as {typed}"

    @property
    def rounded(self) -> list[tuple[str, str, str]]:
        """Dials that were rounded: name, before, after."""
        return [(d.name, f"{d.exact:.8g}", number(d.rounded)) for d in self.certificate.dials]

    @property
    def given(self) -> Iterator[tuple[str, str]]:
        """What was given, and what was chosen."""
        c, request = self.c, self.c.request
        yield "given, before", self._given_of_the_source()
        asked = {**request.options, **request.given}
        yield "given, after", ", ".join(f"{n}={x}" for n, x in asked.items()) or "nothing but the card"
        if c.chosen:
            yield "chosen", chosen_line(c)
        yield "match", f"{c.match}: {MATCHES[c.match]}" + ("" if request.match is None else ", as asked for")
        yield "mode", _MODES[request.mode] + (", as nothing was stated" if request.mode == "both" else "")
        by = "as stated" if request.action else "by the sign of the gain"
        yield "action", "not stated" if c.action is None else f"{c.action}, {by}"
        yield "scan interval", self._scans()
        if request.bias is not None:
            yield "bias", f"{number(request.bias)} % at SP = PV"
        if c.factor != 1:
            yield "gain", f"multiplied by {number(c.factor)} for the new ranges or the new action"
        yield "process", "not given" if c.process is None else c.process.text
        band = self.certificate.headline.loop_band
        yield "loop band", f"{band.low:.3g} to {band.high:.3g} rad/s: where the crossover of a loop usually lies"

    def _given_of_the_source(self) -> str:
        s = self.c.source
        dials = [f"{n}={v.typed if isinstance(v.typed, str) else number(v.value)}" for n, v in s.items() if v.given]
        options = [f"{n}={x}" for n, x in s.options.items() if n not in s.defaulted]
        taken = [f"{n}={x}" for n, x in s.options.items() if n in s.defaulted]
        defaults = [f"{n}={number(v.value)}" for n, v in s.items() if v.active and not v.given]
        rest = f"; not given, so as the card delivers them: {', '.join([*taken, *defaults])}" if taken or defaults else ""
        return f"{', '.join([*dials, *options])}{rest}"

    def _scans(self) -> str:
        scan, emulated = self.c.scan, self.certificate.scan_by_scan
        if scan is not None:
            how = "make up for" if self.certificate.compensated else "do not depend on"
            return f"{number(scan[0])} s before, {number(scan[1])} s after; the settings {how} them"
        return f"not given; {number(emulated.scan[0])} s taken to run both" if emulated is not None else "not given"

    @property
    def bump(self) -> str:
        """What the cut-over does to the output."""
        assert self.plan is not None
        return bump_line(self.plan)

    @property
    def not_covered(self) -> Iterator[str]:
        """What this page does not say."""
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
        found, c = bode(self.c), self.certificate
        band = (c.feedback_at_scan or c.feedback).loop_band
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


def _intervals(scans: tuple[float, float]) -> str:
    return " and ".join(number(h) for h in dict.fromkeys(scans))
