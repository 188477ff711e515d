"""The verdict in one sentence or two, for whoever stands at the loop."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from pidemu.analysis.loop_figures import LoopComparison
from pidemu.certificate.models import COARSE, Certificate, Kick, ScanCost


def sentence(c: Certificate, conditions: Sequence[str] = (), assumed: Sequence[str] = (), lag: str = "") -> str:
    """Return what the certificate amounts to, in words a technician understands.

    Parameters
    ----------
    c : Certificate
        The certificate.
    conditions : sequence of str
        Facts that the verdict rests on, to stand behind "if".
    assumed : sequence of str
        What was taken though it should have been asked.
    lag : str
        The lag that the verdict supposes on the measurement in front of the new block; empty where there is none.
    """
    conditions = [*([f"a lag of {lag} is put on PV in front of it"] if lag else []), *conditions]
    parts = [_assuming(assumed), _of_the_controllers(c, conditions), *_of_the_scans(c), *_of_the_loop(c.loop)]
    return " ".join(filter(None, parts))


def _assuming(assumed: Sequence[str]) -> str:
    if not assumed:
        return ""
    return f"Assuming {' and '.join(assumed)}, which {'was' if len(assumed) == 1 else 'were'} not stated."


def _if(conditions: Sequence[str]) -> str:
    """Return the conditions: two in full, the others by their number."""
    if not conditions:
        return ""
    more = len(conditions) - 2
    rest = f" (and {more} more, below)" if more > 0 else ""
    return f", if {' and '.join(conditions[:2])}{rest}"


def _of_the_controllers(c: Certificate, conditions: Sequence[str]) -> str:
    limits = ", inside its limits" if any(d.aspect == "windup" for d in c.nonlinear) else ""
    if c.verdict == "exact":
        return f"The new controller does what the old one did, for disturbances and for setpoint changes{limits}{_if(conditions)}."
    if c.verdict == "exact-feedback":
        return (
            f"For disturbances and in stability, the new controller does what the old one did{limits}{_if(conditions)}; "
            f"{_setpoint(c)}."
        )
    if c.feedback_is_exact:
        same = c.setpoint_is_exact_in("auto")
        other = f" Setpoint changes differ too: {_LIMITED if same else _kick(c.setpoint_kick)}."
        other = "" if same and not c.setpoint_is_limited else other
        return f"The two equations are the same{_if(conditions)}; {_what_differs(c)}.{other}"
    return f"Where the crossover of the loop {_lies(c)}, {_differ(c)}{_if(conditions)}.{_also(c)}"


def _what_differs(c: Certificate) -> str:
    """Return why a verdict is approximate though the laws are the same."""
    if c.is_bent:
        parts = dict.fromkeys(_PARTS[d.aspect] for d in c.nonlinear if d.aspect in _PARTS)
        return f"what differs is {' and '.join(parts)}"
    if c.rounding is not None and c.rounding > COARSE:
        return f"but the dials round so coarsely that {_differ(c)}"
    if c.shifts_for_good:
        return "but without integral action the new controller does not hold the output as the old one did, once it was at a limit"
    if c.scan_cost is not None and c.scan_cost.matters:
        return "what differs is how they are computed, scan by scan"
    assert c.scan_by_scan is not None
    return f"but emulated scan by scan, the outputs differ by up to {_number(c.scan_by_scan.on_measurement)} % of span"


_PARTS: Final = {
    "error": "what is done to the error",
    "integral": "how fast the integral comes back",
    "output": "what is done to the output",
    "arithmetic": "the arithmetic they are computed with",
}
"""What is beyond the law and shows inside the limits, by aspect."""


def _lies(c: Certificate) -> str:
    return "usually lies" if c.loop is None else "lies"


def _differ(c: Certificate) -> str:
    band = c.headline.loop_band
    if not (math.isfinite(band.gain_db) and math.isfinite(band.phase_deg)):
        return "the two cannot be compared, since one of them does not respond"
    gain, phase = _number(band.gain_db), _number(band.phase_deg)
    return f"the controller's gain differs by up to {gain} dB and its phase by up to {phase} degrees"


def _also(c: Certificate) -> str:
    off, setpoint = (x.loop_band.max_deviation for x in (c.headline, c.setpoint_headline))
    if c.moves_alike_at_once and not (setpoint > _WORSE and setpoint > 2 * off):
        return ""
    return f" Setpoint changes: {_kick(c.setpoint_kick)}."


_LIMITED: Final = "the two do not limit the rate of the setpoint alike"
_WORSE: Final = 0.1
"""Deviation of the setpoint path from which it is worth a word beside the other path's."""


def _setpoint(c: Certificate) -> str:
    """Return how setpoint changes differ, by mode where that matters."""
    cascade = c.kick_in_cascade
    if c.setpoint_is_limited and all(c.setpoint_is_exact_in(mode) for mode in ("auto", "cascade")):
        return f"setpoint changes differ: {_LIMITED}"
    if c.setpoint_in_cascade is None or cascade is None:
        return f"setpoint changes differ: {_kick(c.setpoint_kick)}"
    if c.setpoint_is_exact_in("auto"):
        return f"setpoint changes are the same in automatic and differ in cascade: {_kick(cascade)}"
    if c.setpoint_is_exact_in("cascade"):
        return f"setpoint changes are the same in cascade and differ in automatic: {_kick(c.setpoint_kick)}"
    return f"setpoint changes differ: in automatic, {_kick(c.setpoint_kick)}; in cascade, {_kick(cascade)}"


def _kick(kick: Kick) -> str:
    if kick.source == kick.target or math.isclose(kick.source, kick.target, rel_tol=1e-6):
        return "the first move of the output is the same, what follows is not"
    return f"a step of 1 % {_moves(kick.target)}; with the old controller it {_moved(kick.source)}"


def _moves(kick: float) -> str:
    if math.isinf(kick):
        return "spikes the output for one scan"
    return f"moves the output at once by {kick:.3g} %" if kick else "does not move the output at once"


def _moved(kick: float) -> str:
    if math.isinf(kick):
        return "spiked it"
    return f"moved it by {kick:.3g} %" if kick else "did not"


def _of_the_scans(c: Certificate) -> Iterator[str]:
    cost = c.scan_cost
    if cost is None:
        return
    if cost.too_slow:
        yield f"{_SLOW[cost.too_slow]}: the crossover lies above half the scan rate. {_REMEDY[cost.too_slow]}"
    elif abs(cost.phase_deg) >= _LEAST:
        yield _phase(c, cost)


_LEAST = 0.05
"""Phase that is worth a word [deg]."""
_SLOW: Final = {
    "source": "The old scan was too slow for this loop",
    "target": "The new scan is too slow for this loop",
    "both": "Both scans are too slow for this loop",
}
_REMEDY: Final = {
    "source": "What the new scan changes cannot be said: watch the loop after the cut-over.",
    "target": "Scan faster, or tune the loop slower.",
    "both": "Scan faster, or tune the loop slower.",
}


def _phase(c: Certificate, cost: ScanCost) -> str:
    scans = None if c.scan_by_scan is None else c.scan_by_scan.scan
    gained = cost.phase_deg < 0
    what = f"the loop {'gains' if gained else 'loses'} {_number(abs(cost.phase_deg))} degrees of phase at {cost.at:.3g} rad/s"
    if scans is not None and scans[0] != scans[1]:
        return f"The new controller scans {'faster' if scans[1] < scans[0] else 'more slowly'}: {what}."
    return f"As the two integrate or differentiate by different rules, {what}."


def _of_the_loop(loop: LoopComparison | None) -> Iterator[str]:
    if loop is None:
        return
    old, new = loop.source, loop.target
    if not new.stable:
        yield (
            "WITH THIS PROCESS THE LOOP WOULD BE UNSTABLE: do not use these settings."
            if old.stable
            else "With this process the loop is unstable, before and after: check the process, or the action."
        )
        return
    if not old.stable:
        yield "With this process the loop is unstable before and stable after: check the process."
        return
    figures = [
        f"{name} from {_number(x)} to {_number(y)}{unit}"
        for name, x, y, unit in (
            ("gain margin", old.gain_margin, new.gain_margin, ""),
            ("phase margin", old.phase_margin, new.phase_margin, " degrees"),
            ("Ms", old.Ms, new.Ms, ""),
        )
        if math.isfinite(x) and math.isfinite(y)
    ]
    if figures:
        yield f"With this process: {', '.join(figures)}."


def _number(x: float) -> str:
    return f"{float(f'{x:.3g}'):g}"
