"""The verdict in one sentence or two, for whoever stands at the loop."""

from __future__ import annotations

import math

from pidemu.certificate.models import Certificate, Kick, LoopComparison


def sentence(c: Certificate) -> str:
    """Return what the certificate amounts to, in words a technician understands.

    Parameters
    ----------
    c : Certificate
        The certificate.
    """
    return " ".join(filter(None, (_of_the_controllers(c), "" if c.loop is None else _of_the_loop(c.loop))))


def _of_the_controllers(c: Certificate) -> str:
    if c.verdict == "exact":
        return "The new controller does what the old one did, to load disturbances and to setpoint changes alike."
    setpoint = (c.setpoint_at_scan or c.setpoint).is_exact
    if c.verdict == "exact-feedback":
        return (
            "Against disturbances, and in stability, the new controller does exactly what the old one did; "
            f"setpoint changes will look different{_kick(c.setpoint_kick_at_scan or c.setpoint_kick)}."
        )
    if c.headline.is_exact:
        other = "" if setpoint else f" Setpoint changes will look different{_kick(c.setpoint_kick_at_scan or c.setpoint_kick)}."
        return f"Against disturbances the two equations are the same, but {_emulated(c)}.{other}"
    band = c.headline.loop_band
    if c.scan_cost is not None and c.scan_cost.cut:
        return (
            f"A scan interval is too long for this loop, whose integral time is {c.time_scale:.3g} s: half the scan rate lies "
            "within the loop band, and the figures cover what is left of it. Expect to tune the loop again, slower."
        )
    return (
        f"The new controller comes within {_percent(band.max_deviation)} of the old one where the loop works: up to "
        f"{band.gain_db:.2f} dB of gain margin and {band.phase_deg:.1f} degrees of phase margin may be lost or won. "
        f"{_advice(band.gain_db, band.phase_deg)}"
    )


def _advice(gain_db: float, phase_deg: float) -> str:
    """Judge by usual margins, 6 dB and 30 to 60 degrees: a tenth of them is little, a third is much."""
    if gain_db <= 0.6 and phase_deg <= 3:
        return "That is little beside usual margins."
    if gain_db <= 2 and phase_deg <= 10:
        return "A loop with usual margins stays stable, but will look a little different: watch it after the cut-over."
    return "That is much: expect to tune the loop again."


def _of_the_loop(loop: LoopComparison) -> str:
    old, new = loop.source.stable, loop.target.stable
    if new:
        return "" if old else "With this process the loop is unstable before and stable after: check the process."
    if old:
        return "WITH THIS PROCESS THE LOOP WOULD BE UNSTABLE: do not use these settings."
    return "With this process the loop is unstable, before and after: check the process, or the action."


def _kick(kick: Kick) -> str:
    if kick.source == kick.target:
        return ""
    return f": a step {_moves(kick.target)}, before it {_moved(kick.source)}"


def _moves(kick: float) -> str:
    if math.isinf(kick):
        return "spikes the output for one scan"
    return f"moves the output at once by {kick:.3g} % per %" if kick else "does not move the output at once"


def _moved(kick: float) -> str:
    if math.isinf(kick):
        return "spiked it"
    return f"was {kick:.3g}" if kick else "did not"


def _emulated(c: Certificate) -> str:
    e = c.scan_by_scan
    if e is None:
        return "they could not be run to prove it"
    if e.is_exact_on_measurement:
        return "one has a nonlinear option that the other has not: see what to watch for"
    return (
        f"run scan by scan, with the setpoint at rest, they differ by up to {_percent(e.on_measurement / 100)} of span on test "
        f"signals that move the output by {e.size:.3g} %, because of scan rule, arithmetic or a nonlinear option"
    )


def _percent(x: float) -> str:
    return "more than 1000 %" if x > 10 else f"{float(f'{100 * x:.2g}'):g} %"
