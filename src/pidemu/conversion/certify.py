"""The whole certificate of a conversion, issued: linear figures, emulations, nonlinear differences, the loop."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from pidemu.certificate.models import EXACT, Certificate, NonlinearDifference, ScanByScan
from pidemu.certificate.nonlinear import differences_inside_limits, nonlinear_differences
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
        Whether both controllers are emulated, for the points 3, 5 and 6; the first two only when somebody asks.
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
    if judge.process is not None:
        from pidemu.simulation.simulate import compare_loops

        certificate = replace(certificate, loop=compare_loops(judge.source, settings, judge.process, judge.scans, judge.factor))
    return replace(certificate, emulation=EmulationOnDemand(judge, settings, unrounded, limits))


@dataclass(frozen=True)
class EmulationOnDemand:
    """What running both controllers shows, run when somebody asks; see `pidemu.certificate.models.Emulation`.

    Attributes
    ----------
    judge : Yardstick
        What the settings are held against.
    settings, unrounded : Settings
        The target's settings as they are printed, and before rounding.
    limits : tuple of float or None
        Output limits that the source is set to [% of the output span].
    """

    judge: Yardstick
    settings: Settings
    unrounded: Settings
    limits: tuple[float, float] | None

    @property
    def scan_by_scan(self) -> ScanByScan | None:
        """Both run on the same signals; ``None`` where they cannot be."""
        return None if isinstance(self._run, str) else self._run

    @property
    def not_emulated(self) -> str:
        """Why they cannot be run."""
        return self._run if isinstance(self._run, str) else ""

    @cached_property
    def nonlinear(self) -> tuple[NonlinearDifference, ...]:
        """What differs beyond the linear law."""
        run, source = self.scan_by_scan, self.judge.source
        if run is None:
            return ()
        size, cascade = scale_of(source, run.scan[0]), self.judge.mode == "cascade"
        return nonlinear_differences(source, self.settings, run.scan, size, limits=self.limits, in_cascade=cascade)

    @cached_property
    def inside_limits(self) -> tuple[NonlinearDifference, ...]:
        """What of that shows inside the limits."""
        run = self.scan_by_scan
        if run is None:
            return ()
        cascade = self.judge.mode == "cascade"
        return differences_inside_limits(self.judge.source, self.settings, run.scan, limits=self.limits, in_cascade=cascade)

    @cached_property
    def _run(self) -> ScanByScan | str:
        """Return both run on the same signals, or why they cannot be."""
        judge = self.judge
        try:
            scans = judge.scans or (common_interval(judge.source, self.settings),) * 2
            return emulated(
                judge.source,
                self.unrounded,
                scans,
                judge.factor,
                taken=judge.scans is None,
                in_cascade=judge.first_mode == "cascade",
            )
        except ScanError as error:
            return str(error)
