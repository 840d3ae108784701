"""A run: a scenario simulated into a folder of files, block by block, which can be stopped and gone on with."""

import json
import os
from pathlib import Path

import dask
import dask.threaded
import numpy as np
import rasterio
import xarray as xr

from fifesim.analysis.rasters.pairs import matched
from fifesim.analysis.rasters.regression import regress
from fifesim.base.logs import LOG
from fifesim.chain.images import ndvi
from fifesim.output import report, stac
from fifesim.output.folders import check_folder, errors_with_their_file, results
from fifesim.output.progress import CellProgress, doing
from fifesim.output.run.engine import run_engine
from fifesim.output.run.identity import (
    SCENARIO,
    STATE,
    begin,
    check_finished,
    check_inputs,
    identity_of,
    inputs_of,
)
from fifesim.output.run.origin import origin_tags
from fifesim.output.run.products import chunk_checksum, make_scene_store, products_of, wanted_blocks
from fifesim.output.run.saved import has_blocks, save_block, saved_array, saved_block, saved_blocks
from fifesim.output.run.schedule import run_on_client, run_on_threads, tasks_of
from fifesim.output.run.size import check_size
from fifesim.output.run.workers import usable_cores
from fifesim.output.styles import write_style
from fifesim.rasters import grid as grids
from fifesim.rasters.clients import found_client
from fifesim.rasters.files import to_geotiff
from fifesim.rasters.reductions import computed
from fifesim.scenario.ground import warn_of_canopy
from fifesim.scenario.scenario import read_scenario
from fifesim.scenario.simulation import simulate
from fifesim.scenario.sweeps import VARIABLES
from fifesim.scenario.toml import write_scenario

FILES = (
    "image.tif", "image.qml", "truth.tif", "truth.qml", "quicklook.png", "report.html", SCENARIO, "item.json",
)  # fmt: skip
SCENE = "scene.zarr"

# GDAL's own limit is a share of the machine's memory. [byte]
_GDAL_CACHE = 32 * 2**20

# Of pixels that are read back for statistics; dask's own choice is a whole image.
_CHUNK_SIZE = "4MiB"

# Pixels and their truth are read back once where they are no more than that. [byte]
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
    """
    Simulate a scenario into a folder: image and truth, their styles, pictures, scenario and a STAC item.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    folder : str or path
        Made where it does not exist.
    overwrite : bool, optional
        Replace the files of an earlier run, and remove its cells unless ``scene`` replaces them. Other files stay.
    resume : bool, optional
        Go on with an interrupted run of the same scenario in this folder, or begin if there is none. Nothing is
        computed if the run is finished.
    scene : bool, optional
        Write leaf area index, elevation and reflectance of the cells too, as Zarr.
    threads : int, optional
        By default one for each core that this process may use.
    client : distributed.Client, optional
        Compute on the workers of a cluster, by default on those of the current client where there is one.
    as_json : bool, optional
        Print progress as lines of JSON.
    home : str or path, optional
        Where the files are to lie in the end, from which their tags name files of the scenario; the folder by default.

    Returns
    -------
    files : list of pathlib.Path

    Raises
    ------
    ValueError
        If the scenario cannot be simulated, or the folder holds something else; nothing is written then.
    OSError
        If a file cannot be read or written. No half-written file is left; blocks that are finished are kept.

    Notes
    -----
    Blocks are saved as they are finished, and the files made of them appear when all of them are whole. Memory does not
    grow with the scene.
    """
    folder, names = Path(folder), names_of(scene)
    finished = check_folder(folder, overwrite, resume, names)
    warn_of_canopy(scenario)
    complete = scenario.complete()
    if finished:
        old = write_scenario(read_scenario(folder / SCENARIO).complete())
        check_finished(folder / SCENARIO, old, write_scenario(complete), inputs_of(complete))
        return [folder / name for name in names]
    check_size(complete, folder)
    identity = identity_of(complete, scene)
    stale = () if scene else (SCENE,)
    kept = results(folder, names, overwrite=overwrite, resume=resume, worth_keeping=has_blocks, stale=stale)
    with errors_with_their_file(folder), kept as unfinished, rasterio.Env(GDAL_CACHEMAX=_GDAL_CACHE):
        begin(unfinished, identity)
        run_engine(complete)
        tree = simulate(complete)
        found = products_of(tree, unfinished / SCENE if scene else None)
        if scene and not (unfinished / SCENE).exists():
            make_scene_store(unfinished / f"{SCENE}.partial", found.scene)
            os.replace(unfinished / f"{SCENE}.partial", unfinished / SCENE)
        LOG.info("simulating %s into %s", grids.in_words(complete.geobox()), folder)
        _compute(found, tree["scene"]["lai"], unfinished, client or found_client(), threads or usable_cores(), as_json)
        # The scheduler by itself: by its name, dask would look for a client, and import all that one needs.
        scheduler = {"scheduler": dask.threaded.get, "num_workers": threads or usable_cores()}
        with dask.config.set(scheduler | {"array.chunk-size": _CHUNK_SIZE}), doing("writing files and report"):
            _write_files(complete, tree, found, unfinished, folder if home is None else home)
        check_inputs(json.loads(identity[STATE])["inputs"], inputs_of(complete))
    LOG.info("wrote %s into %s", ", ".join(names), folder)
    return [folder / name for name in names]


def names_of(scene):
    """
    Names of the files of a run.

    Parameters
    ----------
    scene : bool
        With the products of the scene.

    Returns
    -------
    names : tuple of str
        The last one marks the run as complete.
    """
    return FILES + (SCENE,) * scene


def _compute(found, lai, folder, client, threads, as_json):
    """Compute and save the blocks that are not saved yet."""
    blocks = folder / "blocks"
    saved = {name: saved_blocks(blocks, name, array) for name, array in found.arrays.items()}
    for name in found.scene:
        saved[f"scene-{name}"] = {each for each in saved[f"scene-{name}"] if _is_in_store(folder, name, each)}
    cells, image = grids.geobox(lai), found.arrays["image"]
    wanted = [each for each in wanted_blocks(found, lai.chunks, cells) if each[1] not in saved[each[0]]]
    per_pixel = cells.shape.x * cells.shape.y / (image.shape[-1] * image.shape[-2])
    sizes = {index: round(per_pixel * _pixels(image, index)) for index in np.ndindex(image.numblocks)}
    done = sum(sizes[index] for index in saved["image"])
    LOG.info("%d blocks to make, %d are saved", len(wanted), sum(map(len, saved.values())))
    with CellProgress(sum(sizes.values()), done, as_json) as progress:

        def deliver(name, index, block):
            save_block(blocks, name, index, block)
            LOG.debug("saved block %s of %s", index, name)
            if name == "image":
                progress.advance(sizes[index])

        tasks = tasks_of(found.arrays, wanted)
        if client is None:
            run_on_threads(*tasks, deliver, threads)
        else:
            run_on_client(*tasks, deliver, client)


def _is_in_store(folder, name, index):
    """Whether the chunk of a block that is said to be saved holds what was written."""
    try:
        return chunk_checksum(folder / SCENE, name, index) == saved_block(folder / "blocks", f"scene-{name}", index)
    except (OSError, ValueError, RuntimeError):
        return False


def _pixels(array, index):
    return int(np.prod([sizes[at] for sizes, at in zip(array.chunks[-2:], index[-2:], strict=True)]))


def _write_files(scenario, tree, found, folder, home):
    """The files of a run from its saved blocks."""
    saved = {
        name: raster.copy(data=saved_array(folder / "blocks", name, found.arrays[name]))
        for name, raster in found.rasters.items()
    }
    if sum(raster.nbytes for raster in saved.values()) <= _IN_MEMORY:
        saved = dict(zip(saved, computed(*saved.values()), strict=True))
    _check_some_data(scenario, saved["image"])
    image = xr.Dataset({"dn": saved["image"]})
    if "ndvi" in tree["image"]:
        image["ndvi"] = ndvi(saved["image"])
    truth = xr.Dataset({name: saved[name] for name in tree["truth"].data_vars})
    # Seven digits are more than a mean of leaf area has.
    for name, raster in (("image", image["dn"]), ("truth", truth.astype(np.float32))):
        path = to_geotiff(
            raster, folder / f"{name}.tif", overwrite=True, tags=origin_tags(scenario, f"{name}.tif", home)
        )
        write_style(path, overwrite=True)
    terrain = level = None
    if "terrain" in tree.children:
        level = saved["level"].compute()
        terrain = xr.Dataset({name: saved[f"terrain-{name}"].compute() for name in tree["terrain"].data_vars})
        terrain.attrs = dict(tree["terrain"].attrs)
    detail = saved["detail"].compute()
    quicklook, page = report.run_page(scenario, image, truth, detail, terrain, level, *_fits(image, truth))
    (folder / "quicklook.png").write_bytes(quicklook)
    (folder / "report.html").write_text(page, encoding="utf-8")
    (folder / SCENARIO).write_text(write_scenario(scenario), encoding="utf-8")
    stac.write(stac.item(scenario, folder, report.title(scenario)), folder / "item.json")


def _check_some_data(scenario, image):
    if not bool((image != 0).any()):
        offset, share = scenario.sensor.offset, scenario.sensor.min_valid
        raise ValueError(
            f"no pixel of the image has {share:g} of its footprint on cells with leaf area and elevation: "
            f"see sensor.offset = {offset} and sensor.min_valid, and whether the files have data here"
        )


def _fits(image, truth):
    """Regressions of the true means on NDVI where there is one, and why a line fits to none of some."""
    fits, reasons = {}, {}
    for name in VARIABLES if "ndvi" in image else ():
        try:
            # By row and column: with an interval of its own, the image lies on other places than its truth.
            fits[name] = regress(*matched(truth[name], image["ndvi"], "index"), pair="index")
        except ValueError as error:
            reasons[name] = str(error)
    return fits, reasons
