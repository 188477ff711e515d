"""The verdict in one sentence, for whoever stands at the loop."""

from __future__ import annotations

from pidemu.certificate.models import EXACT, Certificate


def sentence(c: Certificate) -> str:
    """Return what the certificate amounts to, in words a technician understands.

    Parameters
    ----------
    c : Certificate
        The certificate.
    """
    match c.verdict:
        case "exact":
            return "The new controller does what the old one did, to load disturbances and to setpoint changes alike."
        case "exact-feedback":
            return (
                "Against disturbances, and in stability, the new controller does exactly what the old one did; "
                f"setpoint changes will look different{_kick(c)}."
            )
    band = c.headline.loop_band
    if band.max_deviation <= EXACT:
        return f"The two equations are the same, but {_emulated(c)}."
    return (
        f"The new controller comes within {_percent(band.max_deviation)} of the old one where the loop works: "
        f"up to {band.gain_db:.2f} dB of gain margin and {band.phase_deg:.1f} degrees of phase margin may be lost or won. "
        f"{_advice(band.gain_db, band.phase_deg)}"
    )


def _advice(gain_db: float, phase_deg: float) -> str:
    if gain_db <= 0.5 and phase_deg <= 3:
        return "That is less than a well tuned loop notices."
    if gain_db <= 2 and phase_deg <= 10:
        return "A loop with usual margins stays stable, but will look a little different: watch it after the cut-over."
    return "That is much: expect to tune the loop again."


def _kick(c: Certificate) -> str:
    kick = c.setpoint_kick_at_scan or c.setpoint_kick
    if kick.source == kick.target:
        return ""
    return f": a step moves the output at once by {kick.target:.3g} % per %, before it was {kick.source:.3g}"


def _emulated(c: Certificate) -> str:
    e = c.scan_by_scan
    if e is None:
        return "they could not be run to prove it"
    return (
        f"run scan by scan they differ by up to {_percent(e.largest / 100)} of span on test signals that move the output by "
        f"{e.size:.3g} %, because of scan rule, arithmetic or a nonlinear option"
    )


def _percent(x: float) -> str:
    return "more than 1000 %" if x > 10 else f"{float(f'{100 * x:.2g}'):g} %"
