"""The whole certificate of a conversion, issued: linear figures, emulations, nonlinear differences, the loop."""

from __future__ import annotations

from dataclasses import replace

from pidemu.certificate.models import EXACT, Certificate
from pidemu.certificate.nonlinear import nonlinear_differences
from pidemu.certificate.proof import prove
from pidemu.certificate.scanwise import common_interval, emulated
from pidemu.conversion.solver.yardstick import Yardstick
from pidemu.errors import ScanError
from pidemu.records.standard import scale_of
from pidemu.settings.settings import Settings


def full_certificate(
    judge: Yardstick,
    settings: Settings,
    unrounded: Settings,
    *,
    compensated: bool,
    limits: tuple[float, float] | None = None,
    emulate: bool,
) -> Certificate:
    """Return the certificate of a conversion's settings (specs/equations.md, section 9).

    Parameters
    ----------
    judge : Yardstick
        What the settings are held against.
    settings, unrounded : Settings
        The target's settings as they are printed, and before rounding.
    compensated : bool
        Whether the settings make up for the scans.
    limits : tuple of float, optional
        Output limits that the source is set to [% of the output span].
    emulate : bool
        Whether both controllers are emulated, for the points 3, 5 and 6.
    """
    certificate = replace(judge.certify(settings), scan_cost=judge.scan_cost(settings), compensated=compensated)
    if settings != unrounded:
        before = replace(judge.certify(unrounded), compensated=compensated)
        certificate = replace(
            certificate,
            feedback_before_rounding=before.headline,
            setpoint_before_rounding=before.setpoint_headline,
            setpoint_in_cascade=before.setpoint_in_cascade,
        )
    if certificate.feedback_is_exact and not compensated:
        certificate = replace(certificate, proof=prove(judge.source, unrounded, judge.factor, mode=judge.mode, within=EXACT))
    if not emulate:
        return certificate
    source = judge.source
    if judge.process is not None:
        from pidemu.simulation.simulate import compare_loops

        certificate = replace(certificate, loop=compare_loops(source, settings, judge.process, judge.scans, judge.factor))
    try:
        scans = judge.scans or (common_interval(source, settings),) * 2
        both = emulated(source, unrounded, scans, judge.factor, taken=judge.scans is None, in_cascade=judge.first_mode == "cascade")
    except ScanError as error:
        return replace(certificate, not_emulated=str(error))
    cascade = judge.mode == "cascade"
    size = scale_of(source, scans[0])
    differences = nonlinear_differences(source, settings, scans, size, limits=limits, in_cascade=cascade)
    return replace(certificate, scan_by_scan=both, nonlinear=differences)
