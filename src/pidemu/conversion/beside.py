"""What stands beside an answer: other settings that an engineer may prefer, each in one line with what it costs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal

from pidemu.certificate.figures import percent
from pidemu.certificate.models import EXACT, LEAST_PHASE, RANK
from pidemu.conversion.command import set_words
from pidemu.conversion.match.no_match import NoMatchError
from pidemu.conversion.match_method import Aim
from pidemu.conversion.options import Attempt
from pidemu.conversion.request import DIGITS
from pidemu.errors import PidemuError
from pidemu.formatting import number
from pidemu.settings.settings import Settings
from pidemu.units import Role

if TYPE_CHECKING:
    from pidemu.conversion.result import Conversion

Kind = Literal["runner-up", "same-numbers", "matched", "absorbed", "compensated", "unstated"]
_DIALS: Final = (Role.MULTIPLIER, Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE)
_NEAR: Final = 0.01
"""Deviation in the loop band below which the source's own numbers stand beside an exact match."""
_FAR: Final = 0.05
"""Deviation in the loop band from which settings are not worth a line."""
_DIGITS: Final = 4


@dataclass(frozen=True)
class Beside:
    """Other settings of the target, beside the answer.

    Attributes
    ----------
    kind : {"runner-up", "same-numbers", "matched", "absorbed", "compensated", "unstated"}
        What they are.
    text : str
        The settings in one line, with what they cost.
    settings : Settings
        The settings.
    how : str
        How to get them: words of the command line.
    """

    kind: Kind
    text: str
    settings: Settings
    how: str = ""

    def __str__(self) -> str:
        return self.text

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON."""
        return {"kind": self.kind, "text": self.text, "to": self.settings.to_dict(), "how": self.how}


def runner_up(c: Conversion) -> Beside | None:
    """Return the best settings with other options that are worth a line: no worse a verdict, or the other evil."""
    best, *others = c.ranking
    if best.merit is None or best.settings is None:
        return None
    for other in others:
        if other.merit is None or other.settings is None or not _is_another(best.settings, other.settings):
            continue
        torn = best.merit.setpoint >= _TORN and other.merit.setpoint >= _TORN  # neither keeps the setpoint path
        if other.merit.by_number and not best.merit.by_number:
            continue
        same_class = RANK[other.verdict] <= RANK[best.verdict] and other.merit.setpoint == best.merit.setpoint
        if torn or (same_class and not other.merit.unused and other.merit.nonlinear == best.merit.nonlinear):
            return Beside("runner-up", _runner_up_text(best, other), other.settings, _set(best, other))
        return None
    return None


_TORN: Final = 4


def _runner_up_text(best: Attempt, other: Attempt) -> str:
    assert other.settings is not None
    assert other.certificate is not None
    also = "also " if other.verdict == best.verdict else ""
    off = other.certificate.headline.loop_band.max_deviation
    verdict = f"{also}{other.verdict}" if off <= EXACT else f"{percent(off)} in the loop band"
    options = ", ".join(
        f"{n}={x}" for n, x in other.settings.options.items() if best.settings and best.settings.options.get(n) != x
    )
    return f"{options}: {verdict}, {dials_text(other.settings)}"


def _set(best: Attempt, other: Attempt) -> str:
    assert other.settings is not None
    chosen = {n: x for n, x in other.settings.options.items() if n in other.changed or n in best.changed}
    return set_words(chosen)


def _is_another(a: Settings, b: Settings) -> bool:
    """Whether two settings are told apart at the dials, or by which terms see the setpoint."""
    dials = [{v.role: f"{v.canonical:.5g}" for v in s.values() if v.active and v.role in _DIALS} for s in (a, b)]
    x, y = a.algorithm(), b.algorithm()
    return dials[0] != dials[1] or (x.kp and x.b) != (y.kp and y.b) or (x.kd and x.c) != (y.kd and y.c)


def dials_text(s: Settings) -> str:
    """Return the dials that were set, in four digits and one line."""
    return ", ".join(f"{n} {number(v.value, _DIGITS)}" for n, v in s.items() if v.active and v.given)


def stands_beside(c: Conversion) -> Iterator[Beside]:
    """Yield the other settings worth a line: the runner-up, own numbers, the match, settings compensated for the scans."""
    if c.runner_up is not None:
        yield c.runner_up
    yield from _own_numbers(c)
    yield from _matched(c)
    yield from _absorbed(c)
    yield from _compensated(c)
    yield from _unstated(c)


def _own_numbers(c: Conversion) -> Iterator[Beside]:
    """Yield the source's own numbers beside an exact match that moved them, where they come near."""
    work = c.ranking[0].solver
    if c.match != "exact" or work is None or c.request.match is not None:
        return
    with suppress(NoMatchError, PidemuError):
        own = work.settings(Aim("same-numbers")).settings
        off = work.yardstick.continuous_deviation(own)
        if _is_another(c.unrounded, own) and EXACT < off < _NEAR:
            text = f"the source's own numbers: {dials_text(own)}, {percent(off)}"
            yield Beside("same-numbers", text, own, "--match same-numbers")


def _matched(c: Conversion) -> Iterator[Beside]:
    """Yield the match of the moments beside the source's own numbers."""
    work = c.ranking[0].solver
    if c.match != "same-numbers" or work is None or c.request.match is not None:
        return
    with suppress(NoMatchError, PidemuError):
        found = work.settings(Aim("low-frequency")).settings
        if _is_another(c.unrounded, found):
            off = percent(work.yardstick.continuous_deviation(found))
            yield Beside("matched", f"matched at low frequencies: {dials_text(found)}, {off}", found, "--match low-frequency")


def _absorbed(c: Conversion) -> Iterator[Beside]:
    """Yield settings that take a filter of the measurement into the dials, beside those that need a lag in front of the block."""
    if not c.settings.lag:
        return
    from pidemu.conversion.convert import again

    with suppress(PidemuError):
        found = again(c, options=dict(c.settings.options), match="low-frequency")
        off = found.certificate.feedback.loop_band.max_deviation
        turned = any(v.value < 0 for v in found.settings.values() if v.role is Role.DERIVATIVE)
        if off < _FAR and not turned:
            text = f"without the lag, absorbed into the dials: {dials_text(found.settings)}, {percent(off)}"
            yield Beside("absorbed", text, found.settings, "--match low-frequency")


def _compensated(c: Conversion) -> Iterator[Beside]:
    """Yield settings that make up for the scans, where more than a degree of phase is at stake."""
    cost, work = c.certificate.scan_cost, c.ranking[0].solver
    if cost is None or work is None or c.request.compensate or cost.too_slow or abs(cost.phase_deg) < LEAST_PHASE:
        return
    from pidemu.conversion.convert import again

    with suppress(PidemuError):
        bent = again(c, options=dict(c.settings.options), compensate=True)
        if _is_another(c.settings, bent.settings):
            before, after = (x.feedback_at_scan for x in (c.certificate, bent.certificate))
            assert before is not None
            assert after is not None
            off = [percent(x.loop_band.max_deviation) for x in (before, after)]
            text = f"compensated for the scans: {dials_text(bent.settings)}; at the scans {off[1]} off instead of {off[0]}"
            yield Beside("compensated", text, bent.settings, "--compensate")


def _unstated(c: Conversion) -> Iterator[Beside]:
    """Yield what other readings of the source would give, where they were not worth a question."""
    from pidemu.conversion.convert import again

    for o in c.opens:
        for other in o.others:
            with suppress(PidemuError):
                found = again(c, other.settings, digits=c.request.digits or DIGITS)
                same = not _is_another(c.settings, found.settings)
                if not same or found.verdict != c.verdict:
                    options = "".join(f", {n}={x}" for n, x in found.settings.options.items() if c.settings.options.get(n) != x)
                    stated = f"{o.about} is not stated and {o.taken.value} is taken"
                    dials = f"the same dials, {found.verdict}" if same else f"{dials_text(found.settings)}{options}"
                    text = f"{stated}; with {other.value}: {dials}"
                    yield Beside("unstated", text, found.settings, f"{o.about}={other.value}")
