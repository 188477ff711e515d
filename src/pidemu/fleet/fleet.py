"""``Fleet``: many closed loops at once."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Iterable
from pathlib import Path
from typing import Any

from pidemu.backends.choice import checked
from pidemu.backends.engine_names import Engine
from pidemu.errors import FleetError
from pidemu.fleet.blocks import BlockOutcome
from pidemu.fleet.finished import keys
from pidemu.fleet.lists import PlacedLoops, unique
from pidemu.fleet.local import outcomes
from pidemu.fleet.loops import FleetPlan, Loop
from pidemu.fleet.prepare import Failed
from pidemu.fleet.progress import Progress
from pidemu.fleet.result import FleetResult
from pidemu.fleet.signals import SignalStore
from pidemu.simulation.trial import Step


class Fleet:
    """Closed loops of different cards, settings, scan intervals and processes.

    Parameters
    ----------
    loops : iterable of Loop
        The loops, each with its own tag.

    Raises
    ------
    FleetError
        There are none, or two have the same tag.

    Examples
    --------
    >>> import pidemu
    >>> card, process = pidemu.load_card("generic/standard"), pidemu.Process.from_lags(1.0, lags=[10], delay=2)
    >>> loops = [pidemu.Loop(f"TIC-{i}", card.settings(K=i, Ti=10, Td=0), process, scan=0.1) for i in (1, 2)]
    >>> result = pidemu.Fleet(loops).simulate(setpoint=0, load=(10, 5), time=200)
    >>> result.columns["iae"].round(1).tolist()  # 5 Ti/K where the error does not change its sign
    [50.0, 25.0]
    """

    def __init__(self, loops: Iterable[Loop]) -> None:
        self.loops = unique(loops)

    def __len__(self) -> int:
        return len(self.loops)

    def simulate(
        self,
        *,
        setpoint: float | Step = 10.0,
        load: float | Step = 10.0,
        time: float | None = None,
        keep: bool = False,
        folder: str | Path | None = None,
        parquet: str | Path | None = None,
        engine: Engine | None = None,
        margins: bool = True,
        cores: int | None = None,
        cluster: Any = None,
        progress: bool | None = None,
        resume: bool = False,
        worker_timeout: float = 60.0,
    ) -> FleetResult:
        """Run every loop from rest, as `pidemu.simulate` does, and with its numbers.

        A loop that cannot be run is reported in the result and does not stop the others. Where the run is interrupted (Ctrl-C),
        what is done by then is returned, and an older Parquet file is not replaced (``NAME.interrupted.EXT``).
        Where signals go to files, a run that did not end, whatever ended it, can be gone on with.

        Parameters
        ----------
        setpoint, load : float or tuple of float
            Steps for loops that have none of their own: sizes [%], or when [s] and size, as in `pidemu.simulate`.
        time : float, optional
            How long, for loops that do not say [s]; by default as long as each takes to settle.
        keep : bool
            Keep measurement and output of every scan, in memory where no folder is given.
        folder : str or Path, optional
            Keep them in files of this folder, not in memory (NumPy files, one per block of loops).
        parquet : str or Path, optional
            Write figures and signals to this Parquet file, a row per loop that ran (needs the extra ``parquet``); without `keep` or
            a folder they are nowhere else.
        engine : {"python", "numpy", "numba", "c"}, optional
            What runs the loops; all give the same bits. By default the quickest for each group of loops.
        margins : bool
            Compute margins and stability of every loop, which takes about as long as running it does; without them an unstable loop
            is ``"done"`` like any other.
        cores : int, optional
            Threads on this machine; by default one per core.
        cluster : str or distributed.Client or distributed cluster, optional
            Run on a Dask cluster: the scheduler's address, a client, or a cluster (needs the extra ``cluster``).
        progress : bool, optional
            Show a progress bar on standard error; by default where that is a terminal and the fleet is large.
        resume : bool
            Take what an earlier run of this fleet left complete in `folder` and `parquet`, and run the rest. Loops that are not
            what they were then, in settings, process, steps or version of pidemu, are run again.
        worker_timeout : float
            How long to wait where the cluster has no worker [s]; the loops that are left have failed then. 0 waits for ever.

        Returns
        -------
        FleetResult
            The table, and the signals where they are kept.

        Raises
        ------
        FleetError
            The fleet cannot be run so.
        EngineError
            The engine is not there.
        """
        if cores is not None and cores < 1:
            raise FleetError(f"{cores} cores cannot run anything; give at least 1")
        keeps = keep or folder is not None or parquet is not None
        plan = FleetPlan(setpoint, load, time, keeps, checked(engine), margins)
        result = FleetResult(self.loops, plan)
        try:
            with contextlib.ExitStack() as stack:
                store = stack.enter_context(SignalStore(keep, folder, parquet, resume)) if keeps or resume else None
                left = self._left(result, plan, store)
                bar = stack.enter_context(Progress(len(left), progress))
                run = self._outcomes(left, plan, cores, cluster, worker_timeout, store)
                for one in stack.enter_context(contextlib.closing(run)):
                    kept = one if store is None or isinstance(one, Failed) else store.stored(one)
                    bar.advance(result.add(kept))
        except KeyboardInterrupt:
            result.interrupted = True
        return result

    def _left(self, result: FleetResult, plan: FleetPlan, store: SignalStore | None) -> PlacedLoops:
        """Return the loops that are to be run, with their places; the result takes those that an earlier run had done."""
        done: set[int] = set()
        if store is not None:
            for place, one, signals in store.begin(list(self.loops.tags), keys(self.loops.quickly(), plan)):
                result.resume(place, one, signals)
                done.add(place)
        left = [place for place in range(len(self.loops)) if place not in done]
        return PlacedLoops(self.loops.chosen(left) if done else self.loops, left)

    def _outcomes(
        self,
        loops: PlacedLoops,
        plan: FleetPlan,
        cores: int | None,
        cluster: Any,
        patience: float,
        store: SignalStore | None,
    ) -> Generator[BlockOutcome | Failed]:
        if cluster is None:
            return outcomes(loops, plan, cores=cores, room=None if store is None else store.room)
        from pidemu.fleet.cluster import outcomes_on

        return outcomes_on(cluster, loops, plan, patience)
