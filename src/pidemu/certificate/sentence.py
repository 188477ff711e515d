"""The verdict in one sentence or two, for whoever stands at the loop."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from pidemu.certificate.models import COARSE, Certificate, Kick, LoopComparison, ScanCost


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
    return f"Assuming {' and '.join(assumed)}, which was not stated." if assumed else ""


def _if(conditions: Sequence[str]) -> str:
    """Return the conditions: two in full, the others by their number."""
    if not conditions:
        return ""
    more = len(conditions) - 2
    rest = f" (and {more} more, below)" if more > 0 else ""
    return f", if {' and '.join(conditions[:2])}{rest}"


def _of_the_controllers(c: Certificate, conditions: Sequence[str]) -> str:
    limits = ", inside its limits" if any(d.aspect == "windup" for d in c.nonlinear) else ""
    law = (c.feedback_before_rounding or c.headline).is_exact
    if c.verdict == "exact":
        return f"The new controller does what the old one did, for disturbances and for setpoint changes{limits}{_if(conditions)}."
    if c.verdict == "exact-feedback":
        return (
            f"For disturbances, and in stability, the new controller does what the old one did{limits}{_if(conditions)}; "
            f"{_setpoint(c)}."
        )
    if law and not c.is_bent and (c.rounding or 0) <= COARSE:
        other = "" if c.setpoint_headline.is_exact else f" Setpoint changes differ too: {_setpoint(c)}."
        return f"The two equations are the same{_if(conditions)}; what differs is when they are computed.{other}"
    if law and c.is_bent:
        return (
            f"The two equations are the same{_if(conditions)}, but one controller does something to its signals that the other does"
            " not: see what to watch for."
        )
    if law:
        return f"The two equations are the same{_if(conditions)}, but the dials round so coarsely that {_differ(c)}."
    return f"Where the crossover of the loop {_lies(c)}, {_differ(c)}{_if(conditions)}.{_also(c)}"


def _lies(c: Certificate) -> str:
    return "usually lies" if c.loop is None else "lies"


def _differ(c: Certificate) -> str:
    band = c.headline.loop_band
    gain, phase = _number(band.gain_db), _number(band.phase_deg)
    return f"the controller's gain differs by up to {gain} dB and its phase by up to {phase} degrees"


def _also(c: Certificate) -> str:
    kick = c.setpoint_kick
    same = kick.source == kick.target or math.isclose(kick.source, kick.target, rel_tol=0.02)
    return "" if same else f" Setpoint changes: {_kick(kick)}."


def _setpoint(c: Certificate) -> str:
    """Return how setpoint changes differ, by mode where that matters."""
    cascade = c.setpoint_in_cascade
    if cascade is None or c.kick_in_cascade is None:
        return f"setpoint changes differ: {_kick(c.setpoint_kick)}"
    auto = (c.setpoint_before_rounding or c.setpoint_headline).is_exact
    if auto:
        return f"in automatic also for setpoint changes, in cascade these differ: {_kick(c.kick_in_cascade)}"
    if cascade.is_exact:
        return f"in cascade also for setpoint changes, in automatic these differ: {_kick(c.setpoint_kick)}"
    return f"setpoint changes differ: in automatic {_kick(c.setpoint_kick)}, in cascade {_kick(c.kick_in_cascade)}"


def _kick(kick: Kick) -> str:
    if kick.source == kick.target or math.isclose(kick.source, kick.target, rel_tol=1e-6):
        return "the first move of the output is the same, what follows is not"
    return f"a step {_moves(kick.target)}, with the old controller it {_moved(kick.source)}"


def _moves(kick: float) -> str:
    if math.isinf(kick):
        return "spikes the output for one scan"
    return f"moves the output at once by {kick:.3g} % per %" if kick else "does not move the output at once"


def _moved(kick: float) -> str:
    if math.isinf(kick):
        return "spiked it"
    return f"moved by {kick:.3g} %" if kick else "did not"


def _of_the_scans(c: Certificate) -> Iterator[str]:
    cost = c.scan_cost
    if cost is None:
        return
    if cost.too_slow:
        yield f"{_SLOW[cost.too_slow]} for this loop: half its rate lies below the crossover. Scan faster, or tune again, slower."
    elif abs(cost.phase_deg) >= _LEAST:
        yield _phase(c, cost)


_LEAST = 0.05
"""Phase that is worth a word [deg]."""
_SLOW = {"source": "The old scan was too slow", "target": "The new scan is too slow", "both": "Both scans are too slow"}


def _phase(c: Certificate, cost: ScanCost) -> str:
    scans = None if c.scan_by_scan is None else c.scan_by_scan.scan
    gained = cost.phase_deg < 0
    what = f"the loop {'gains' if gained else 'loses'} {_number(abs(cost.phase_deg))} degrees of phase at {cost.at:.3g} rad/s"
    if scans is not None and scans[0] != scans[1]:
        return f"The new controller scans {'faster' if scans[1] < scans[0] else 'more slowly'}: {what}."
    return f"By the scan rules {what}."


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
