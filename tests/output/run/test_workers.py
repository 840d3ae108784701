"""Workers of a cluster are other processes: what goes to them must pickle, and what they write must be whole."""

import socket
import subprocess
import sys
from types import SimpleNamespace

import dask
import dask.array as da
import distributed
import numpy as np
import psutil
import pytest
import rasterio
import xarray as xr
from distributed import Client, KilledWorker, LocalCluster

import fifesim
from fifesim.output import report
from fifesim.output.run.folder import simulate_to_folder
from fifesim.output.run.workers import cluster, run_on_client, tasks_of
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.simulation import simulate

CHUNKS = {"y": 100, "x": 80}


@pytest.fixture(scope="module")
def client():
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def lai_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("lai") / "lai.tif"
    profile = {"driver": "GTiff", "width": 30, "height": 20, "count": 1, "dtype": "uint8", "crs": "EPSG:32614"}
    values = np.random.default_rng(3).integers(0, 50, (20, 30)).astype("uint8")
    with rasterio.open(path, "w", **profile, transform=rasterio.transform.from_origin(704970, 4334220, 30, 30)) as sink:
        sink.write(values, 1)
        sink.scales = [0.1]
    return path


def scene(path, chunks):
    grid = fifesim.fife_site(30 / 9, window=((0, 180), (0, 270)))
    return fifesim.open_lai(path, grid, chunks=chunks)


def image_of(lai):
    known = {"atmosphere": fifesim.Atmosphere(), "geometry": fifesim.fife_geometry()}
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], **known)
    return rho.fifesim.to_toa().fifesim.sense("TM")


def test_a_scale_of_the_file_is_applied(lai_file):
    assert 4 < float(scene(lai_file, None).max()) <= 4.9


def test_workers_give_the_bits_of_one_process(client, lai_file):
    xr.testing.assert_identical(image_of(scene(lai_file, CHUNKS)).compute(), image_of(scene(lai_file, None)))


def test_workers_write_a_file_together(client, lai_file, tmp_path):
    fifesim.to_geotiff(image_of(scene(lai_file, CHUNKS)), tmp_path / "image.tif")
    xr.testing.assert_identical(fifesim.open_image(tmp_path / "image.tif"), image_of(scene(lai_file, None)))


def test_a_run_on_workers_gives_the_same_files(client, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "png", lambda figure, dpi: b"")
    scenario = parse_scenario({"grid": {"width": 900, "height": 600}, "ground": {"seed": 3}})
    simulate_to_folder(scenario, tmp_path / "workers")
    expected = simulate(scenario)["image"]["dn"].compute(scheduler="threads")
    np.testing.assert_array_equal(fifesim.open_image(tmp_path / "workers" / "image.tif").values, expected.values)


def test_processes_without_a_cluster_give_the_same_bits():
    grid = fifesim.fife_site(30 / 9, window=((0, 180), (0, 270)))
    lai = fifesim.lai_scene(grid, arp=0.15, seed=7, chunks=CHUNKS)
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], dem=fifesim.flint_hills(grid, 3, chunks=CHUNKS))
    image = rho.fifesim.to_toa().fifesim.sense("TM")
    with dask.config.set(scheduler="processes", num_workers=1):
        there = image.compute()
    np.testing.assert_array_equal(there, image.compute(scheduler="synchronous"))


def listening():
    """Addresses on which this process and those that it started take connections."""
    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    found = [connection for process in processes for connection in process.net_connections(kind="inet")]
    return {connection.laddr for connection in found if connection.status == psutil.CONN_LISTEN}


def answer(place):
    """What somebody without a certificate is told."""
    try:
        with socket.create_connection(place, timeout=5) as plain:
            plain.sendall(b"GET /info/main/workers.html HTTP/1.0\r\n\r\n")
            return plain.recv(4096)
    except ConnectionResetError:
        return b""


STRANGER = """
import asyncio, sys
from distributed.comm import connect
from distributed.security import Security
tls = sys.argv[1]
for address, security in ((tls, Security()), (tls.replace("tls", "tcp"), Security()), (tls, Security.temporary())):
    try:
        asyncio.run(connect(address, timeout=5, **security.get_connection_args("client")))
    except (OSError, TypeError):
        print("refused", flush=True)
"""


def test_workers_listen_to_nobody_without_their_certificate():
    before = listening()
    with cluster(workers=1) as guarded:
        assert guarded.submit(abs, -2).result() == 2
        address, places = guarded.scheduler.address, listening() - before
        assert address.startswith("tls://127.0.0.1:") and len(places) >= 3
        for place in places:
            assert place.ip == "127.0.0.1" and b"HTTP" not in answer(place)
        stranger = [sys.executable, "-c", STRANGER, address]
        told = subprocess.run(stranger, stdout=subprocess.PIPE, text=True, timeout=120, check=True)
        assert told.stdout.split() == ["refused"] * 3


class Future:
    def __init__(self, released):
        self.release = lambda: released.append(self)


class Stub:
    """A cluster that gives one result, and then ends with an error."""

    loop = None

    def __init__(self, monkeypatch, error):
        self.cancelled, self.released = [], []
        self.futures = [Future(self.released) for _ in range(3)]

        def as_completed(futures, **options):
            yield futures[0], "first"
            raise error

        monkeypatch.setattr(distributed, "as_completed", as_completed)

    def get(self, *arguments, **options):
        return self.futures

    def cancel(self, futures, force):
        self.cancelled += futures


def test_a_task_that_ends_its_workers_is_told_and_the_others_are_cancelled(monkeypatch):
    error = KilledWorker("task", SimpleNamespace(address="tcp://here"), 3)
    stub, found = Stub(monkeypatch, error), []
    tasks, outputs = tasks_of({"ones": da.ones(3, chunks=1)}, [("ones", (n,)) for n in range(3)])
    with pytest.raises(RuntimeError, match="a worker may lack memory"):
        run_on_client(tasks, outputs, lambda *output: found.append(output), stub)
    assert found == [("ones", (0,), "first")] and stub.released == stub.futures[:1]
    assert stub.cancelled == stub.futures[1:]


def test_a_failed_delivery_cancels_the_other_tasks_at_once(monkeypatch):
    stub = Stub(monkeypatch, AssertionError("the second is not asked for"))

    def deliver(*output):
        raise OSError("disk full")

    tasks, outputs = tasks_of({"ones": da.ones(3, chunks=1)}, [("ones", (n,)) for n in range(3)])
    with pytest.raises(OSError, match="disk full") as caught:
        run_on_client(tasks, outputs, deliver, stub)
    # The frames are alive, so that the collection of garbage has cancelled nothing.
    assert caught.traceback and stub.cancelled == stub.futures[1:]
