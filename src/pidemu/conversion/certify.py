"""The whole certificate of a conversion, issued: linear figures, emulations, nonlinear differences, the loop."""

from __future__ import annotations

from dataclasses import replace

from pidemu.certificate.models import EXACT, Certificate
from pidemu.certificate.nonlinear import nonlinear_differences
from pidemu.certificate.proof import prove
from pidemu.certificate.scanwise import common_interval, emulated
from pidemu.conversion.solve import Solver
from pidemu.errors import ScanError
from pidemu.records.standard import scale_of
from pidemu.settings.settings import Settings


def full_certificate(
    work: Solver, settings: Settings, unrounded: Settings, *, limits: tuple[float, float] | None = None, emulate: bool
) -> Certificate:
    """Return the certificate of a conversion's settings (specs/equations.md, section 9).

    Parameters
    ----------
    work : Solver
        The conversion.
    settings, unrounded : Settings
        The target's settings as they are printed, and before rounding.
    limits : tuple of float, optional
        Output limits that the source is set to [% of the output span].
    emulate : bool
        Whether both controllers are emulated, for the points 3, 5 and 6.
    """
    certificate = replace(work.certify(settings), scan_cost=work.scan_cost(settings), compensated=work.is_bent)
    if settings != unrounded:
        before = replace(work.certify(unrounded), compensated=work.is_bent)
        certificate = replace(
            certificate,
            feedback_before_rounding=before.headline,
            setpoint_before_rounding=before.setpoint_headline,
            setpoint_in_cascade=before.setpoint_in_cascade,
        )
    if certificate.feedback_is_exact and not work.is_bent:
        certificate = replace(certificate, proof=prove(work.source, unrounded, work.factor, mode=work.mode, within=EXACT))
    if not emulate:
        return certificate
    source = work.source
    if work.process is not None:
        from pidemu.simulation.simulate import compare_loops

        certificate = replace(certificate, loop=compare_loops(source, settings, work.process, work.scans, work.factor))
    try:
        scans = work.scans or (common_interval(source, settings),) * 2
        both = emulated(source, unrounded, scans, work.factor, taken=work.scans is None, in_cascade=work.first_mode == "cascade")
    except ScanError as error:
        return replace(certificate, not_emulated=str(error))
    cascade = work.mode == "cascade"
    size = scale_of(source, scans[0])
    differences = nonlinear_differences(source, settings, scans, size, limits=limits, in_cascade=cascade)
    return replace(certificate, scan_by_scan=both, nonlinear=differences)
