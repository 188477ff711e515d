"""What came of a fleet: a table, and the signals where they were kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.errors import FleetError, suggest
from pidemu.files.tables import write_table
from pidemu.fleet.blocks import COLUMNS, BlockOutcome
from pidemu.fleet.finished import Finished
from pidemu.fleet.folder import Place
from pidemu.fleet.judgement import MARGINS, RAN, Judgement, Status, judgements
from pidemu.fleet.lists import LoopList
from pidemu.fleet.loops import FleetPlan
from pidemu.fleet.prepare import Failed

HEADER: Final = ("tag", "card", "status", "scan", "scans", *COLUMNS, "settled", "stable", *MARGINS, "engine", "reason")
"""Columns of the table. Times are in seconds, signals in percent."""


@dataclass(frozen=True)
class LoopSignals:
    """The signals of one loop.

    Attributes
    ----------
    times, setpoint, measurement, output : ndarray, shape (scans,)
        Times of the scans [s], and the signals there [%].
    """

    times: Floats
    setpoint: Floats
    measurement: Floats
    output: Floats


class FleetResult:
    """What came of a fleet, loop by loop, in the fleet's order.

    Parameters
    ----------
    loops : LoopList
        The fleet.
    plan : FleetPlan
        What is done to its loops.

    Attributes
    ----------
    loops : sequence of Loop
        The fleet.
    status : list of str
        ``"done"``; ``"unstable"``: it ran, and the loop is unstable; ``"ran away"``: it ran, and the measurement outgrew all
        numbers; ``"failed"``: it could not be run; ``"not run"``: the run was interrupted before.
    reasons : list of str
        Why a loop failed, or has a longer scan interval than it would take.
    columns : dict of str to ndarray, shape (loops,)
        ``iae`` [% s], ``peak`` [%], ``travel`` [%], ``at_low``, ``at_high`` [s], ``swing``, what the error moves over in the last
        fifth of the run [%], and the last ``error`` [%]; ``gain_margin``, ``phase_margin`` [deg] and ``Ms`` of the sampled loop
        within its limits; NaN where a loop did not run, or has none. The errors count from the load step on, or from the start
        where there is none.
    settled : list of bool or None
        Whether the measurement had settled at the end of the run: the swing is less than 5 % of the peak. ``None`` where the run
        ends before the dead time after the last step is over.
    stable : list of bool or None
        Whether the sampled loop is stable within its limits; ``None`` where that was not computed.
    scan, scans : ndarray, shape (loops,)
        Scan intervals [s] and numbers of scans.
    engines : list of str
        What ran each loop.
    interrupted : bool
        Whether the run was interrupted; what was done by then is here.
    resumed : int
        How many loops an earlier run had done, whose results are here.
    """

    def __init__(self, loops: LoopList, plan: FleetPlan) -> None:
        self.loops, self._plan = loops, plan
        count = len(self.loops)
        self.status: list[Status] = ["not run"] * count
        self.reasons, self.engines = [""] * count, [""] * count
        self.columns: dict[str, Floats] = {name: np.full(count, np.nan) for name in (*COLUMNS, *MARGINS)}
        self.settled: list[bool | None] = [None] * count
        self.stable: list[bool | None] = [None] * count
        self.scan, self.scans = np.full(count, np.nan), np.zeros(count, dtype=np.int64)
        self.interrupted = False
        self.resumed = 0
        self._places = {tag: i for i, tag in enumerate(loops.tags)}
        self._signals: dict[int, tuple[Floats | Path, int]] = {}

    def add(self, found: BlockOutcome | Failed) -> int:
        """Take what came of a block, or of a loop that failed; return how many loops that is."""
        if isinstance(found, Failed):
            self.status[found.place], self.reasons[found.place] = "failed", found.reason
            return 1
        places = found.members.places
        for name, column in found.columns.items():
            self.columns[name][places] = column
        self.scan[places], self.scans[places] = found.members.columns.scan, found.members.scans
        kept = found.records if found.file is None else found.file
        for i, (member, judged) in enumerate(judgements(found)):
            self._take(member.place, judged)
            self.engines[member.place] = found.engine.engine
            self.reasons[member.place] = found.members.notes[i] if found.members.notes is not None else ""
            if kept is not None:
                self._signals[member.place] = (kept, i)
        return len(places)

    def resume(self, place: int, one: Finished, signals: Place | None) -> None:
        """Take a loop that an earlier run had done.

        Parameters
        ----------
        place : int
            Its place in the fleet.
        one : Finished
            What came of it.
        signals : (Path, int) or None
            Where its signals are.
        """
        self._take(place, one.judged)
        for name, value in one.figures.items():
            self.columns[name][place] = value
        self.scan[place], self.scans[place], self.engines[place] = one.scan, one.scans, one.engine
        if signals is not None:
            self._signals[place] = signals
        self.resumed += 1

    def _take(self, place: int, judged: Judgement) -> None:
        self.status[place], self.settled[place], self.stable[place] = judged.status, judged.settled, judged.stable
        for name, value in judged.margins.items():
            self.columns[name][place] = value

    @property
    def failures(self) -> dict[str, str]:
        """Why loops failed, by tag."""
        return {tag: why for tag, why, is_ in zip(self.loops.tags, self.reasons, self.status, strict=True) if is_ == "failed"}

    @property
    def counts(self) -> Mapping[str, int]:
        """How many loops have each status."""
        return Counter(self.status)

    def __len__(self) -> int:
        return len(self.loops)

    def __getitem__(self, tag: str) -> LoopSignals:
        """Return the signals of a loop.

        Raises
        ------
        FleetError
            There is no such loop, it was not run, or the signals were not kept.
        """
        place = self._places.get(tag)
        if place is None:
            raise FleetError(f"there is no loop '{tag}'{suggest(tag, self._places)} in the fleet")
        if place not in self._signals:
            done = self.status[place] in RAN
            raise FleetError(
                f"the signals of loop '{tag}' were not kept; run the fleet with keep=True"
                if done
                else f"loop '{tag}' has no signals: {self.reasons[place] or self.status[place]}"
            )
        kept, lane = self._signals[place]
        trial = self._plan.trial(self.loops[place])
        records = np.load(kept, mmap_mode="r") if isinstance(kept, Path) else kept
        out, pv = np.array(records[:, : trial.scans, lane])
        return LoopSignals(trial.times, trial.setpoint, pv, out)

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield a row per loop, with the names of `HEADER`; what is not known is ``None``."""
        for i, (tag, card) in enumerate(zip(self.loops.tags, self.loops.cards, strict=True)):
            ran = self.status[i] in RAN
            figures = {name: float(self.columns[name][i]) if ran else None for name in COLUMNS}
            margins = {name: None if np.isnan(x := self.columns[name][i]) else float(x) for name in MARGINS}
            yield {
                "tag": tag,
                "card": card,
                "status": self.status[i],
                "scan": float(self.scan[i]) if ran else None,
                "scans": int(self.scans[i]) if ran else None,
                **figures,
                "settled": self.settled[i],
                "stable": self.stable[i],
                **margins,
                "engine": self.engines[i] or None,
                "reason": self.reasons[i] or None,
            }

    def write_table(self, path: str | Path) -> None:
        """Write the table as CSV; numbers are written so that they read back the same.

        Parameters
        ----------
        path : str or Path
            The file.

        Raises
        ------
        FleetError
            The file cannot be written.
        """
        write_table(path, HEADER, self.rows(), FleetError)
