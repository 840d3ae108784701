"""Run of a scenario into a folder of files, block by block, which can be resumed; and its estimated cost."""

import json
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import dask
import dask.threaded
import numpy as np
import rasterio
import xarray as xr
from dask.utils import format_bytes, format_time

from fifesim.analysis.regression_labels import matched, regress
from fifesim.base.messages import LOG, warn
from fifesim.chain.steps import ndvi
from fifesim.grids import grid as grids
from fifesim.grids.chunks import found_client
from fifesim.grids.files import to_geotiff
from fifesim.grids.reductions import computed
from fifesim.output import blocks, identity, products, report, stac, workers
from fifesim.output.folders import check_folder, errors_with_their_file, results
from fifesim.output.maps import write_style
from fifesim.output.progress import Progress, memory, spinner
from fifesim.scenario.ground import warn_of_canopy
from fifesim.scenario.scenario import read_scenario
from fifesim.scenario.simulation import simulate
from fifesim.scenario.sweeps import VARIABLES
from fifesim.scenario.toml import write_scenario

FILES = (
    "image.tif", "image.qml", "truth.tif", "truth.qml", "quicklook.png", "report.html", identity.SCENARIO, "item.json",
)  # fmt: skip
SCENE = "scene.zarr"

# GDAL's own limit is a share of the machine's memory. [byte]
_GDAL_CACHE = 32 * 2**20

# Chunks of pixels that are read back for statistics; dask would choose the whole image.
_CHUNK_SIZE = "4MiB"

# Size of pixels and truth up to which they are read back once. [byte]
_IN_MEMORY = 64 * 2**20


def simulate_to_folder(
    scenario,
    folder,
    *,
    overwrite=False,
    resume=False,
    scene=False,
    threads=None,
    client=None,
    as_json=False,
    home=None,
):
    """Simulate a scenario into a folder; return its files, and whether they were there already."""
    # Blocks are saved as they are finished, and files appear when all are complete. Memory does not grow with the
    # scene.
    folder, names = Path(folder), names_of(scene)
    finished = check_folder(folder, overwrite, resume, names)
    warn_of_canopy(scenario)
    complete = scenario.complete()
    if finished:
        if not (changed := _changed_files(complete, folder, names)):
            return [folder / name for name in names], True
        warn(f"{', '.join(changed)} of the finished run changed since they were written: the run is made again")
        overwrite, resume = True, False
    workers.check_size(complete, folder)
    state = identity.state_of(identity.inputs_of(complete), write_scenario(complete), scene=bool(scene))
    stale = () if scene else (SCENE,)
    kept = results(folder, names, overwrite=overwrite, resume=resume, worth_keeping=blocks.has_blocks, stale=stale)
    with errors_with_their_file(folder), kept as unfinished, rasterio.Env(GDAL_CACHEMAX=_GDAL_CACHE):
        identity.begin(unfinished, state)
        tree = simulate(complete)
        rasters = products.products_of(tree, scene)
        threads = threads or workers.usable_cores()
        LOG.info("simulating %s into %s", grids.in_words(complete.geobox()), folder)
        store = blocks.block_store(unfinished / "blocks", {name: raster.data for name, raster in rasters.items()})
        _compute(rasters, tree["scene"]["lai"], store, client or found_client(), threads, as_json)
        # The function instead of its name, with which dask would import distributed.
        scheduler = {"scheduler": dask.threaded.get, "num_workers": threads}
        with dask.config.set(scheduler | {"array.chunk-size": _CHUNK_SIZE}), spinner("writing files and report"):
            saved = {name: raster.copy(data=blocks.saved_array(store[name])) for name, raster in rasters.items()}
            _write_files(complete, tree, saved, unfinished, folder if home is None else home)
        identity.check_inputs(json.loads(state[identity.STATE])["inputs"], identity.inputs_of(complete))
    LOG.info("wrote %s into %s", ", ".join(names), folder)
    return [folder / name for name in names], False


def names_of(scene):
    """Names of the files of a run, the last of which marks it as complete."""
    return (*FILES[:-1], *(SCENE,) * scene, FILES[-1])


def _changed_files(scenario, folder, names):
    """Names of the files of a finished run that are not as they were written; ValueError if it is another run."""
    item, path = identity.kept_json(folder / names[-1]), folder / identity.SCENARIO
    changed = stac.changed_files(item, folder, names)
    if path.name in changed:
        raise ValueError(
            f"{path} changed since it was written, so the run is unknown: name another folder with -o, or make it "
            "again with its scenario and --overwrite"
        )
    old = write_scenario(read_scenario(path).complete())
    identity.check_finished(path, old, write_scenario(scenario), identity.inputs_of(scenario), item)
    if not changed and item != json.loads(json.dumps(stac.item(scenario, folder, report.headline(scenario)))):
        return names[-1:]
    return changed


def _compute(rasters, lai, store, client, threads, as_json):
    """Compute and save the missing blocks."""
    ordered, image = products.wanted_blocks(rasters, lai), rasters["image"]
    wanted = [(name, index) for name, index in ordered if not blocks.is_saved(store[name], index)]
    per_pixel = lai.size / (image.shape[-1] * image.shape[-2])
    rows, columns = image.chunks[-2:]
    sizes = {
        index: round(per_pixel * (rows[index[-2]] * columns[index[-1]])) for index in np.ndindex(image.data.numblocks)
    }
    left = sum(sizes[index] for name, index in wanted if name == "image")
    LOG.info("%d blocks to make, %d are saved", len(wanted), len(ordered) - len(wanted))
    total = sum(sizes.values())
    with Progress("simulating", "cells", total, total - left, as_json) as progress:

        def deliver(name, index, block):
            blocks.save_block(store[name], index, block)
            LOG.debug("saved block %s of %s", index, name)
            if name == "image":
                progress.advance(sizes[index])

        tasks = workers.tasks_of({name: raster.data for name, raster in rasters.items()}, wanted)
        if client is None:
            workers.run_on_threads(*tasks, deliver, threads)
        else:
            workers.run_on_client(*tasks, deliver, client)


def _write_files(scenario, tree, saved, folder, home):
    """Write the files of a run from its saved blocks."""
    cells = {name: saved.pop(f"{products.SCENE_PREFIX}{name}", None) for name in tree["scene"].data_vars}
    if cells["lai"] is not None:
        products.write_scene(folder / SCENE, xr.Dataset(cells))
    if sum(raster.nbytes for raster in saved.values()) <= _IN_MEMORY:
        saved = dict(zip(saved, computed(*saved.values()), strict=True))
    _check_some_data(scenario, saved["image"])
    image = xr.Dataset({"dn": saved["image"]})
    if "ndvi" in tree["image"]:
        image["ndvi"] = ndvi(saved["image"])
    truth = xr.Dataset({name: saved[name] for name in tree["truth"].data_vars})
    # Seven digits exceed the accuracy of a mean leaf area.
    for name, raster in (("image", image["dn"]), ("truth", truth.astype(np.float32))):
        tags = identity.origin_tags(scenario, f"{name}.tif", home)
        write_style(to_geotiff(raster, folder / f"{name}.tif", overwrite=True, tags=tags), overwrite=True)
    terrain = level = None
    if "terrain" in tree.children:
        level = saved["level"].compute()
        terrain = xr.Dataset({name: saved[f"terrain-{name}"].compute() for name in tree["terrain"].data_vars})
        terrain.attrs = dict(tree["terrain"].attrs)
    detail = saved["detail"].compute()
    quicklook, page = report.run_page(scenario, image, truth, detail, terrain, level, *_fits(image, truth), FILES)
    (folder / "quicklook.png").write_bytes(quicklook)
    (folder / "report.html").write_text(page, encoding="utf-8")
    (folder / identity.SCENARIO).write_text(write_scenario(scenario), encoding="utf-8")
    stac.write_stac(stac.item(scenario, folder, report.headline(scenario)), folder / "item.json")


def _check_some_data(scenario, image):
    if not bool((image != 0).any()):
        offset, share = scenario.sensor.offset, scenario.sensor.min_valid
        raise ValueError(
            f"no pixel of the image has {share:g} of its footprint on cells with leaf area and elevation: "
            f"see sensor.offset = {offset} and sensor.min_valid, and whether the files have data here"
        )


def _fits(image, truth):
    """Regressions of the true means on NDVI, and reasons for missing ones."""
    fits, reasons = {}, {}
    for name in VARIABLES if "ndvi" in image else ():
        try:
            # By row and column, because pixel centres of image and truth differ at the native interval.
            fits[name] = regress(*matched(truth[name], image["ndvi"], "index"), pair="index")
        except ValueError as error:
            reasons[name] = str(error)
    return fits, reasons


# Side of the window simulated to estimate the speed: a few chunks of the field. [cell]
_PIECE = 2016

# Beyond imports and task graph, memory holds chunks at work and chunks that wait for their neighbours. The piece has
# two chunks in a row; in a scene more of them wait. Peaks of scenes of n x n chunks relative to the piece, two threads:
# level ground 1.55 for n = 5 and 1.71 for n = 12, hills 1.28 to 1.63 for n = 5 and 1.57 to 1.99 for n = 9, three
# classes of cover on hills 1.47 for n = 5. So chunks wait up to the fifth column, and their rims beyond it. Chunks of a
# learned landscape do not wait for others on level ground, 0.6 for n = 5 and 0.9 for n = 17. On hills the elevation
# within 1 km of two rows of chunks waits: 1.05 for n = 5 and 3.3 for n = 18. [1]
_COLUMNS, _WAITING_COLUMNS = 2, 5
_WAITING, _RIM, _ELEVATION = 0.25, 0.03, 0.18

# Twice the variation between equal processes: 424 to 431 MiB in a run of 90 x 90 cells. [byte]
_SPREAD = 16 * 2**20

# Time of a run relative to computing alone, with waiting for a free thread and writing files. [1]
_SLACK = 1.1


def estimate(scenario, folder=".", *, threads=None, scene=False, start=0.0):
    """Cells, pixels, tasks, threads, memory and disk [byte] and time [s] of a run, from two runs of a piece."""
    # A piece of up to 2016 x 2016 cells of the same ground is run once with its report, and computed a second time.
    complete = scenario.complete()
    workers.check_size(complete, folder)
    threads = threads or workers.usable_cores()
    lai, image, (graph, _) = _run_tasks(complete)
    before = memory()
    once, cells, rate, peak = _calibrate(complete, threads)
    return {
        "cells": lai.size,
        "pixels": image.shape[-2] * image.shape[-1],
        "tasks": len(graph),
        "threads": threads,
        "memory": round(_SPREAD + before + (peak - before) * _growth(len(lai.chunks[-1]), complete)),
        "disk": round(workers.disk_space(complete, scene)[1]),
        "seconds": start + once + _SLACK * (lai.size - cells) / rate,
    }


def _run_tasks(scenario):
    """LAI and image of a run, and its tasks with their outputs."""
    tree = simulate(scenario)
    lai, rasters = tree["scene"]["lai"], products.products_of(tree)
    arrays = {name: raster.data for name, raster in rasters.items()}
    return lai, rasters["image"], workers.tasks_of(arrays, products.wanted_blocks(rasters, lai))


def estimate_in_words(found, as_json=False):
    """Text of an estimate."""
    if as_json:
        return json.dumps({"event": "estimate"} | found)
    return (
        f"cells    {found['cells'] / 1e6:.1f} million, seen by {found['pixels'] / 1e6:.2f} million pixels\n"
        f"tasks    {found['tasks']}\n"
        f"memory   about {format_bytes(found['memory'])} with {found['threads']} threads or workers\n"
        f"disk     at most {format_bytes(found['disk'])} while it runs\n"
        f"time     about {format_time(found['seconds'])} on this machine at its current load"
    )


def _growth(columns, scenario):
    """Memory of active and waiting chunks of a scene, relative to the piece."""
    waiting = _RIM if scenario.learned else _WAITING
    rim = _ELEVATION if scenario.learned and scenario.terrain.dem != "flat" else _RIM
    few = max(min(columns, _WAITING_COLUMNS) - _COLUMNS, 0)
    return 1 + waiting * few + rim * max(columns - _WAITING_COLUMNS, 0)


def _calibrate(scenario, threads):
    """Seconds of a run of a piece in the middle of the scene, its cells, cells per second, and peak memory."""
    piece = _piece(scenario)
    start = time.monotonic()
    # A window without data writes no files, although the scene may.
    with tempfile.TemporaryDirectory(prefix="fifesim-") as folder, suppress(ValueError):
        simulate_to_folder(piece, Path(folder) / "piece", threads=threads)
    once, used = time.monotonic() - start, [memory()]
    start = time.monotonic()
    lai, _, tasks = _run_tasks(piece)
    workers.run_on_threads(*tasks, lambda name, index, block: used.append(memory()), threads)
    return once, lai.size, lai.size / (time.monotonic() - start), max(used)


def _piece(scenario):
    """Scenario on a smaller grid of whole pixels in its middle."""
    grid, pixel = scenario.grid, scenario.sensor.pixel
    longest = max(float(np.floor(_PIECE * grid.cell / pixel)), 2.0) * pixel
    width, height = min(grid.width, longest), min(grid.height, longest)
    west = grid.west + float(np.floor((grid.width - width) / 2 / pixel)) * pixel
    north = grid.north - float(np.floor((grid.height - height) / 2 / pixel)) * pixel
    update = {"width": width, "height": height, "west": west, "north": north}
    return scenario.model_copy(update={"grid": grid.model_copy(update=update)})
