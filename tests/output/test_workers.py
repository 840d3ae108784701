"""Workers are separate processes: their tasks must be picklable and their files complete."""

import re
import weakref
from contextlib import nullcontext
from types import SimpleNamespace
from unittest.mock import Mock

import dask.array as da
import distributed
import numpy as np
import psutil
import pytest
import rasterio
import xarray as xr
from distributed import Client, KilledWorker, LocalCluster
from distributed.security import Security

import fifesim
from fifesim import fife_site
from fifesim.grids.chunks import neighbourhood
from fifesim.grids.windows import array_from_windows, tiles
from fifesim.output import workers
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.simulation import simulate


@pytest.fixture(scope="module")
def client():
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
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


def make_image(path, chunks):
    lai = fifesim.open_lai(path, fifesim.fife_site(30 / 9, window=((0, 180), (0, 270))), chunks=chunks)
    known = {"atmosphere": fifesim.Atmosphere(), "geometry": fifesim.fife_geometry()}
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], **known)
    return rho.fifesim.to_toa().fifesim.sense("TM")


@pytest.mark.slow
def test_workers_write_one_file_together_with_the_bits_of_one_process(client, lai_file, tmp_path):
    fifesim.to_geotiff(make_image(lai_file, {"y": 100, "x": 80}), tmp_path / "image.tif")
    xr.testing.assert_identical(fifesim.open_image(tmp_path / "image.tif"), make_image(lai_file, None))


@pytest.mark.slow
def test_run_on_workers_gives_the_same_files(client, tmp_path, run_without_pictures):
    scenario = parse_scenario({"grid": {"width": 900, "height": 600}, "ground": {"seed": 3}})
    run_without_pictures(scenario, tmp_path / "workers")
    expected = simulate(scenario)["image"]["dn"].compute(scheduler="threads")
    np.testing.assert_array_equal(fifesim.open_image(tmp_path / "workers" / "image.tif").values, expected.values)


def listening_addresses():
    """Addresses on which this process and its children accept connections."""
    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    found = [connection for process in processes for connection in process.net_connections(kind="inet")]
    return {connection.laddr for connection in found if connection.status == psutil.CONN_LISTEN}


def test_workers_are_encrypted_and_only_reachable_from_this_machine():
    before = listening_addresses()
    with workers.cluster(workers=1) as guarded:
        assert guarded.submit(abs, -2).result() == 2
        address, places = guarded.scheduler.address, listening_addresses() - before
        assert address.startswith("tls://127.0.0.1:") and len(places) >= 3
        assert {place.ip for place in places} == {"127.0.0.1"}
        with pytest.raises(OSError):
            Client(address, security=Security.temporary(), timeout=5)


def test_task_that_kills_workers_is_reported_and_other_tasks_cancelled(monkeypatch):
    client, futures, found = Mock(loop=None), [Mock() for _ in range(3)], []
    client.get.return_value = futures

    def as_completed(futures, **options):
        yield futures[0], "first"
        raise KilledWorker("task", SimpleNamespace(address="tcp://here"), 3)

    monkeypatch.setattr(distributed, "as_completed", as_completed)
    tasks, outputs = workers.tasks_of({"ones": da.ones(3, chunks=1)}, [("ones", (n,)) for n in range(3)])
    with pytest.raises(RuntimeError, match="a worker may lack memory"):
        workers.run_on_client(tasks, outputs, lambda *output: found.append(output), client)
    assert found == [("ones", (0,), "first")]
    assert [future.release.called for future in futures] == [True, False, False]
    assert client.cancel.call_args.args[0] == futures[1:]


def complete_flat_scenario(**sections):
    return parse_scenario({"terrain": {"dem": "flat"}} | sections).complete()


@pytest.mark.parametrize(
    "sections", [{"grid": {"cell": 0.01}}, {"grid": {"cell": 0.3}, "ground": {"method": "periodic"}}]
)
def test_scene_too_large_for_memory_is_rejected_with_a_size_that_fits(tmp_path, sections):
    """A scene with 0.9 of the edge in the message is accepted; one with 1.2 of the edge is not."""
    with pytest.raises(ValueError, match=r"memory.*grid\.width = grid\.height") as caught:
        workers.check_size(complete_flat_scenario(**sections), tmp_path / "a" / "b")
    edge = float(re.search(r"grid\.height = (\S+) fits", str(caught.value))[1])

    def square(edge):
        return complete_flat_scenario(**sections | {"grid": sections["grid"] | {"width": edge, "height": edge}})

    workers.check_size(square(0.9 * edge), tmp_path)
    with pytest.raises(ValueError, match="fits"):
        workers.check_size(square(1.2 * edge), tmp_path)


def test_disk_that_is_too_small_is_named(tmp_path, monkeypatch):
    """On a full disk no scene fits, so the message suggests another folder."""
    scenario = complete_flat_scenario()
    least, most = workers.disk_space(scenario)
    assert least == pytest.approx(500**2 * (2 + 16), rel=0.01) and most == 3.4 * least
    nothing = f"No space left on device in {tmp_path}: name another output folder with -o"
    for free, said in ((10**9, None), (10**6, r"space.*fits"), (0, nothing)):
        monkeypatch.setattr(workers.shutil, "disk_usage", lambda path, free=free: SimpleNamespace(free=free))
        with pytest.raises(OSError, match=said) if said else nullcontext():
            workers.check_size(scenario, tmp_path)


def test_memory_check_uses_the_number_of_cells_per_edge():
    workers.check_memory_of_cells(333)
    with pytest.raises(ValueError, match=r"cells = 1000000: .* cells = \S+ fits"):
        workers.check_memory_of_cells(1_000_000)


@pytest.mark.parametrize(("piece", "threads"), [(1, 1), (5, 3)])
def test_blocks_arrive_in_the_given_order_and_are_computed_once(monkeypatch, piece, threads):
    """Later pieces need blocks of earlier ones."""
    monkeypatch.setattr(workers, "_PIECE", piece)
    made, found = [], {}

    def source(row, column, shape):
        made.append((row, column))
        return np.arange(row, row + shape[0])[:, None] * 1000.0 + np.arange(column, column + shape[1])

    cells = tiles(source, fife_site(30 / 9, window=((0, 60), (0, 40))), 10, tile=10)
    around = neighbourhood(lambda block: block[1:-1, 1:-1] + block[:-2, 2:], cells * 2, 1)
    arrays = {"cells": cells.data, "around": around.data}
    wanted = [(name, index) for index in np.ndindex(6, 4) for name in arrays][::-1]
    workers.run_on_threads(
        *workers.tasks_of(arrays, wanted), lambda name, index, block: found.update({(name, index): block}), threads
    )
    assert len(made) == len(set(made)) == 24 and list(found) == wanted
    for (name, index), block in found.items():
        np.testing.assert_array_equal(block, arrays[name].blocks[index].compute(scheduler="sync"))


class Watch:
    """Compute chunks and count the largest number of them in memory at the same time."""

    def __init__(self):
        self.alive, self.most = set(), 0

    def __call__(self, block):
        made = block + 1
        self.alive.add(id(made))
        weakref.finalize(made, self.alive.discard, id(made))
        self.most = max(self.most, len(self.alive))
        return made


@pytest.mark.parametrize("piece", [7, 600])
def test_only_the_margins_of_chunks_are_kept_for_later_blocks(monkeypatch, piece):
    """Each block also reads the row and the column before it, so the previous row of blocks is kept as margins."""
    monkeypatch.setattr(workers, "_PIECE", piece)

    def ask(*place):
        return (), [tuple(slice(part.start - 1, part.stop) for part in place)]

    watched, sizes = Watch(), ((10,) * 4, (10,) * 20)
    cells = da.ones((40, 200), chunks=10).map_blocks(watched, dtype=float, meta=np.empty((0, 0)))
    blocks = array_from_windows(lambda window: window[1:, 1:] + window[:-1, :-1], [cells], sizes, ask, token="before")
    keys = [("blocks", index) for index in np.ndindex(blocks.numblocks)]
    workers.run_on_threads(*workers.tasks_of({"blocks": blocks}, keys), lambda *block: None, 1)
    assert watched.most <= 3
