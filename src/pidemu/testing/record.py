"""What two controllers are given, scan by scan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pidemu.settings.settings import Settings


@dataclass(frozen=True, slots=True)
class ScanSignals:
    """The signals of one scan.

    Attributes
    ----------
    sp, pv : float
        Setpoint and measurement [the controller's units].
    auto : bool
        Automatic; otherwise manual.
    manual : float or None
        The operator's output in manual [units of the output]; ``None`` where he sets nothing, and the output is held.
    changes : Settings or None
        Settings that come into force before this scan; ``None`` where they stay.
    """

    sp: float
    pv: float
    auto: bool = True
    manual: float | None = None
    changes: Settings | None = None


@dataclass(frozen=True, slots=True)
class SignalRecord:
    """Scans one after the other; the first is the first that a new controller does.

    Attributes
    ----------
    scans : tuple of ScanSignals
        The scans.
    """

    scans: tuple[ScanSignals, ...]

    @property
    def sp(self) -> list[float]:
        """Setpoints."""
        return [s.sp for s in self.scans]

    @property
    def pv(self) -> list[float]:
        """Measurements."""
        return [s.pv for s in self.scans]

    @property
    def auto(self) -> list[bool]:
        """Whether each scan is in automatic."""
        return [s.auto for s in self.scans]

    @property
    def manual(self) -> list[float | None]:
        """The operator's outputs."""
        return [s.manual for s in self.scans]

    @property
    def changes(self) -> dict[int, Settings]:
        """New settings by the scan before which they come into force."""
        return {n: s.changes for n, s in enumerate(self.scans) if s.changes is not None}
