"""A fleet on a Dask cluster has the numbers of one machine, also where workers are lost; where all is lost, it says so."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import pytest

import pidemu
from pidemu import Fleet, FleetError, FleetResult, Loop
from pidemu.files.cache import warn
from pidemu.fleet import cluster as on_cluster
from pidemu.fleet.cluster import run_chunk
from pidemu.fleet.lists import PlacedLoops
from pidemu.fleet.loops import FleetPlan
from pidemu.fleet.progress import Progress
from tests.fleet.support import alike, alone, check_signals, few

STEPS: dict[str, Any] = {"setpoint": (5.0, 6.0), "load": (31.0, -20.0), "time": 60.0}


def local_cluster(**asked: Any) -> Any:
    """A cluster on this machine; that a worker is killed, or the cluster closed, is no news here."""
    made: Any = distributed.LocalCluster
    return made(**{"threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": logging.CRITICAL, **asked})


def client_of(cluster: Any) -> Any:
    made: Any = distributed.Client
    return made(cluster, set_as_default=False)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with local_cluster(n_workers=2) as made:
        yield made


@pytest.fixture(scope="module")
def loops() -> list[Loop]:
    many = [replace(loop, tag=f"own time {loop.tag}", time=40.0 + i % 9) for i, loop in enumerate(alike(30))]
    return [*alike(150), *few(), replace(alike(1)[0], tag="fails", scan=0.0), *many]


@pytest.fixture(scope="module")
def here(loops: list[Loop]) -> FleetResult:
    return Fleet(loops).simulate(**STEPS, keep=True)


def check(found: FleetResult, here: FleetResult) -> None:
    assert found.status == here.status
    assert found.failures == here.failures
    for name, column in here.columns.items():
        assert np.array_equal(found.columns[name], column, equal_nan=True)
    assert np.array_equal(found.scans, here.scans)


@pytest.mark.parametrize("given", ["cluster", "address", "client"])
def test_a_fleet_has_the_numbers_of_one_machine(given: str, cluster: Any, loops: list[Loop], here: FleetResult) -> None:
    with client_of(cluster) as client:
        where = {"cluster": cluster, "address": cluster.scheduler_address, "client": client}[given]
        found = Fleet(loops).simulate(**STEPS, keep=True, cluster=where)
        assert client.status == "running"
    check(found, here)
    assert found.counts["failed"] == 1
    assert (found.status, found.settled, found.stable) == (here.status, here.settled, here.stable)
    for loop in loops:
        if loop.tag != "fails":
            one, other = found[loop.tag], here[loop.tag]
            assert np.array_equal(one.output, other.output)
            assert np.array_equal(one.measurement, other.measurement)


def test_it_has_them_loop_by_loop_in_plain_python_too(cluster: Any) -> None:
    found = Fleet(few()).simulate(**STEPS, keep=True, cluster=cluster, engine="python")
    assert set(found.engines) == {"python"}
    check_signals(found, few(), [alone(loop, **STEPS) for loop in few()])


def test_signals_from_workers_go_to_the_folder_and_the_parquet_file(
    cluster: Any, loops: list[Loop], here: FleetResult, tmp_path: Path
) -> None:
    import pyarrow.parquet as pq

    found = Fleet(loops).simulate(**STEPS, cluster=cluster, folder=tmp_path / "f", parquet=tmp_path / "fleet.parquet")
    for tag in ("L149", "own time L29", few()[0].tag):
        assert np.array_equal(found[tag].output, here[tag].output)
    assert len(pq.read_table(tmp_path / "fleet.parquet")) == len(loops) - 1
    assert len((tmp_path / "f" / "signals.csv").read_text(encoding="utf-8").splitlines()) == len(loops)


def test_a_worker_that_is_killed_changes_nothing(monkeypatch: pytest.MonkeyPatch, loops: list[Loop], here: FleetResult) -> None:
    monkeypatch.setattr(on_cluster, "_FIRST", 8)
    monkeypatch.setattr(on_cluster, "_next_size", lambda *_: 8)
    killed: list[int] = []
    advance = Progress.advance
    with local_cluster(n_workers=2) as own, client_of(own) as client:
        workers = client.run(os.getpid)

        def killing(self: Progress, count: int) -> None:
            advance(self, count)
            if not killed:
                killed.append(min(workers.values()))
                os.kill(killed[0], signal.SIGKILL)

        monkeypatch.setattr(Progress, "advance", killing)
        found = Fleet(loops).simulate(**STEPS, cluster=own)
        end = time.monotonic() + 20
        while killed[0] in (now := client.run(os.getpid)).values() and time.monotonic() < end:
            time.sleep(0.1)
        assert killed[0] not in now.values()  # it was a worker, and is gone
    check(found, here)


@pytest.mark.parametrize("how", ["is closed", "drops its chunks"])
def test_where_the_cluster_is_lost_what_is_done_is_kept_and_the_rest_has_failed(how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(on_cluster, "_FIRST", 8)
    monkeypatch.setattr(on_cluster, "_next_size", lambda *_: 8)
    closed: list[bool] = []
    advance = Progress.advance
    own = local_cluster(n_workers=1, processes=False)

    def closing(self: Progress, count: int) -> None:
        advance(self, count)
        if not closed:
            closed.append(True)
            own.close()

    def dropping(self: Progress, count: int) -> None:
        advance(self, count)
        if not closed:
            closed.append(True)
            client.cancel([distributed.Future(key, client) for key in list(client.futures)])

    with own, client_of(own) as client:
        monkeypatch.setattr(Progress, "advance", closing if how == "is closed" else dropping)
        result = Fleet(alike(100)).simulate(**STEPS, cluster=own if how == "is closed" else client)
    assert 0 < result.counts["done"] < 100
    assert result.counts["done"] + result.counts["failed"] == 100
    assert set(result.failures.values()) == {"the cluster was lost; run the loop again"}
    place = result.status.index("done")
    assert result.columns["error"][place] == alone(result.loops[place], **STEPS).error[-1]


def test_a_cluster_without_workers_is_said_and_given_up(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr(on_cluster, "_QUIET", 0.3)
    monkeypatch.setattr(on_cluster, "_LOOK", 0.1)
    warn.cache_clear()
    with local_cluster(n_workers=0) as own:
        address = own.scheduler_address
        result = Fleet(alike(3)).simulate(**STEPS, cluster=own, worker_timeout=0.8)
    assert set(result.failures.values()) == {
        "the cluster had no worker for 0.8 s; start some with 'dask worker', and run the loop again"
    }
    assert result.counts == {"failed": 3}
    said = f"note: {address} has no workers; waiting until there have been none for 0.8 s; 'dask worker ADDRESS' starts one"
    assert [message for message in caplog.messages if message.startswith("note:")] == [said]


@pytest.mark.parametrize("timeout", [0.0, 60.0])
def test_a_worker_that_comes_late_runs_the_loops(timeout: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(on_cluster, "_QUIET", 0.2)
    monkeypatch.setattr(on_cluster, "_LOOK", 0.05)
    said: list[str] = []
    with local_cluster(n_workers=0, processes=False) as own:

        def late(message: str) -> None:
            said.append(message)
            own.scale(1)

        monkeypatch.setattr(on_cluster, "warn", late)
        result = Fleet(alike(3)).simulate(**STEPS, cluster=own, worker_timeout=timeout)
    assert result.counts == {"done": 3}
    end = "waiting until there have been none for 60 s" if timeout else "waiting for one"
    assert len(said) == 1
    assert f"has no workers; {end}; 'dask worker ADDRESS' starts one" in said[0]


def test_where_all_workers_have_gone_what_is_done_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(on_cluster, "_FIRST", 8)
    monkeypatch.setattr(on_cluster, "_next_size", lambda *_: 8)
    monkeypatch.setattr(on_cluster, "_LOOK", 0.05)
    gone: list[bool] = []
    advance = Progress.advance
    with local_cluster(n_workers=1, processes=False) as own:

        def going(self: Progress, count: int) -> None:
            advance(self, count)
            if not gone:
                gone.append(True)
                own.scale(0)

        monkeypatch.setattr(Progress, "advance", going)
        result = Fleet(alike(400)).simulate(**STEPS, cluster=own, worker_timeout=0.5)
    assert 0 < result.counts["done"] < 400
    assert result.counts["done"] + result.counts["failed"] == 400
    assert set(result.failures.values()) == {
        "the cluster had no worker for 0.5 s; start some with 'dask worker', and run the loop again"
    }


def test_what_a_worker_cannot_run_is_reported(cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(on_cluster, "run_chunk", broken)
    result = Fleet(alike(2)).simulate(**STEPS, cluster=cluster)
    assert result.failures == {f"L{i}": "the cluster could not run it: 2 loops too many" for i in range(2)}


def test_a_loop_that_ends_whatever_runs_it_costs_itself_only(monkeypatch: pytest.MonkeyPatch) -> None:
    from dask import config

    monkeypatch.setattr(on_cluster, "run_chunk", deadly)
    with config.set({"distributed.scheduler.allowed-failures": 0}), local_cluster(n_workers=1) as own:
        result = Fleet(alike(6)).simulate(**STEPS, cluster=own)
    assert result.counts == {"done": 5, "failed": 1}
    assert list(result.failures) == ["L4"]
    assert result.failures["L4"].startswith("the cluster could not run it: ")


def deadly(chunk: PlacedLoops, plan: FleetPlan) -> Any:
    if any(loop.tag == "L4" for _, loop in chunk):
        os._exit(1)
    return run_chunk(chunk, plan)


def broken(chunk: PlacedLoops, plan: FleetPlan) -> None:
    raise ValueError(f"{len(chunk)} loops too many")


def test_an_interrupted_fleet_takes_its_chunks_back(cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(on_cluster, "_FIRST", 8)
    monkeypatch.setattr(on_cluster, "_next_size", lambda *_: 8)
    advance = Progress.advance

    def interrupted(self: Progress, count: int) -> None:
        advance(self, count)
        raise KeyboardInterrupt

    monkeypatch.setattr(Progress, "advance", interrupted)
    result = Fleet(alike(100, time=2000.0)).simulate(cluster=cluster)
    assert result.interrupted
    assert result.counts["done"] == 8
    assert result.counts["not run"] == 92
    with client_of(cluster) as client:
        end = time.monotonic() + 20
        while any(client.processing().values()) and time.monotonic() < end:
            time.sleep(0.1)
        assert not any(client.processing().values())


def test_all_threads_of_the_cluster_are_kept_busy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(on_cluster, "_FIRST", 1)
    monkeypatch.setattr(on_cluster, "_next_size", lambda *_: 1)
    sizes: list[int] = []
    submitted = on_cluster._Chunks._submitted

    def noted(self: Any) -> Any:
        new = submitted(self)
        sizes.append(len(self._under_way))
        return new

    monkeypatch.setattr(on_cluster._Chunks, "_submitted", noted)
    with local_cluster(n_workers=1, threads_per_worker=5, processes=False) as own:
        assert Fleet(alike(30)).simulate(**STEPS, cluster=own).counts == {"done": 30}
    assert sizes[0] == max(sizes) == 15  # three for each thread


def test_chunks_take_seconds_and_grow_by_steps() -> None:
    size = on_cluster._next_size
    assert [size(64, 64, 3.0), size(64, 64, 6.0), size(64, 64, 0.001), size(64, 64, 0.0)] == [64, 32, 256, 256]
    assert (size(4096, 4096, 0.1), size(1, 1, 60.0), size(256, 10, 1.5)) == (4096, 1, 20)


@pytest.mark.parametrize(
    ("address", "cause"),
    [
        ("tcp://127.0.0.1:1", "Connection refused"),
        ("nowhere", "missing port number in address 'nowhere'"),
        ("foo://bar:1", "."),
        (5, "Scheduler address must be a string or a Cluster instance, got <class 'int'>"),
    ],
)
def test_an_address_where_nobody_listens_is_an_error(
    address: Any, cause: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(on_cluster, "_PATIENCE", 0.3)
    threads = set(threading.enumerate())
    with pytest.raises(
        FleetError, match=f"no scheduler answers at {address}: .*{cause}.*; start one with 'dask scheduler', and give"
    ):
        Fleet(alike(2)).simulate(**STEPS, cluster=address, folder=tmp_path)
    assert set(threading.enumerate()) <= threads
    assert Fleet(alike(2)).simulate(**STEPS, folder=tmp_path).counts == {"done": 2}  # the folder is still free


def test_without_dask_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr("importlib.import_module", missing)
    with pytest.raises(
        FleetError, match=r"a cluster needs dask.distributed, which is not installed; pip install 'pidemu\[cluster\]'"
    ):
        Fleet(alike(2)).simulate(cluster="tcp://127.0.0.1:1")


def test_what_is_sent_to_a_worker_is_small() -> None:
    import pickle

    card = pidemu.load_card("emerson/deltav")
    card.all_settings()  # builds its variants, which stay where they are
    process = pidemu.Process.from_lags(1, [10], delay=1)
    loops = [(i, Loop(f"L{i}", card.settings(GAIN=1 + i / 100, RESET=10), process)) for i in range(1000)]
    assert len(pickle.dumps(loops)) < 1_000_000  # a card goes once, and a loop is a few hundred bytes
