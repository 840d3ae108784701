"""A run: a scenario simulated into a folder of files, block by block, which can be stopped and gone on with."""

import json
import os
from contextlib import contextmanager
from pathlib import Path

import dask
import dask.threaded
import numpy as np
import rasterio
import xarray as xr

from fifesim.analysis.rasters.pairs import matched
from fifesim.analysis.rasters.regression import regress
from fifesim.chain.images import ndvi
from fifesim.output import report
from fifesim.output.folders import UNFINISHED, check_folder, results
from fifesim.output.progress import CellProgress
from fifesim.output.provenance import versions
from fifesim.output.run.engine import run_engine
from fifesim.output.run.products import make_scene_store, products_of, wanted_blocks
from fifesim.output.run.saved import save_block, saved_array, saved_blocks
from fifesim.output.run.schedule import run_on_client, run_on_threads, tasks_of
from fifesim.output.run.workers import usable_cores
from fifesim.rasters import grid as grids
from fifesim.rasters.clients import found_client
from fifesim.rasters.files import to_geotiff
from fifesim.scenario.scenario import read_scenario
from fifesim.scenario.simulation import simulate
from fifesim.scenario.toml import write_scenario

FILES = ("image.tif", "truth.tif", "quicklook.png", "report.html", "scenario.toml")
SCENE = "scene.zarr"

# GDAL's own limit is a share of the machine's memory. [byte]
_GDAL_CACHE = 32 * 2**20

# Of pixels that are read back for statistics; dask's own choice is a whole image.
_CHUNK_SIZE = "4MiB"


def simulate_to_folder(
    scenario, folder, *, overwrite=False, resume=False, scene=False, threads=None, client=None, as_json=False
):
    """
    Simulate a scenario into a folder: image.tif, truth.tif, quicklook.png, report.html and scenario.toml.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    folder : str or path
        Made where it does not exist.
    overwrite : bool, optional
        Replace these files where the folder holds something; other files stay.
    resume : bool, optional
        Go on with a run of the same scenario that was stopped in this folder; begin where there is none.
    scene : bool, optional
        Write leaf area index, elevation and reflectance of the cells too, as sharded Zarr.
    threads : int, optional
        By default one for each core that this process may use.
    client : distributed.Client, optional
        Compute on the workers of a cluster, by default on those of the current client where there is one.
    as_json : bool, optional
        Print progress as lines of JSON.

    Returns
    -------
    files : list of pathlib.Path

    Raises
    ------
    ValueError
        If the scenario cannot be simulated, or the folder holds something; nothing is written then.
    OSError
        If a file cannot be read or written. No half-written file is left; blocks that are finished are kept.

    Notes
    -----
    Blocks are saved as they are finished, and the files made of them appear when all of them are whole. Memory does not
    grow with the scene.
    """
    folder = Path(folder)
    check_folder(folder, overwrite, resume)
    complete = scenario.complete()
    identity, names = _identity(complete, scene), FILES + (SCENE,) * scene
    begun = resume and _is_begun(folder / UNFINISHED, identity)
    kept = results(folder, names, resume=begun, worth_keeping=_has_blocks)
    with _errors_with_their_file(folder), kept as unfinished, rasterio.Env(GDAL_CACHEMAX=_GDAL_CACHE):
        if not begun:
            for name, text in identity.items():
                (unfinished / name).write_text(text, encoding="utf-8")
        run_engine(complete)
        tree = simulate(complete)
        found = products_of(tree, unfinished / SCENE if scene else None)
        if scene and not (unfinished / SCENE).exists():
            make_scene_store(unfinished / SCENE, found.scene)
        _compute(found, tree["scene"]["lai"], unfinished, client or found_client(), threads or usable_cores(), as_json)
        # The scheduler by itself: by its name, dask would look for a client, and import all that one needs.
        scheduler = {"scheduler": dask.threaded.get, "num_workers": threads or usable_cores()}
        with dask.config.set(scheduler | {"array.chunk-size": _CHUNK_SIZE}):
            _write_files(complete, tree, found, unfinished)
    return [folder / name for name in names]


def scenario_to_resume(folder):
    """
    Scenario of a run that was stopped.

    Parameters
    ----------
    folder : pathlib.Path
        Of its results.

    Returns
    -------
    scenario : fifesim.scenario.scenario.Scenario or None
        None where no run was stopped.
    """
    path = Path(folder) / UNFINISHED / "run.toml"
    return read_scenario(path) if path.is_file() else None


def _identity(scenario, scene):
    """What must be the same for blocks of two runs to fit together, as files."""
    inputs = {}
    for name in scenario.files.values():
        if Path(name).is_file():
            status = os.stat(name)
            inputs[name] = [status.st_size, status.st_mtime_ns]
    state = {"versions": versions(), "inputs": inputs, "scene": bool(scene)}
    return {"run.json": json.dumps(state), "run.toml": write_scenario(scenario)}


def _is_begun(path, identity):
    """Whether a run has been begun that this one goes on with; another run than this is a mistake."""
    if not (path / "run.toml").is_file():
        return False
    before = {name: (path / name).read_text(encoding="utf-8") for name in identity}
    if before["run.toml"] != identity["run.toml"]:
        old, new = ({line.strip() for line in each["run.toml"].splitlines()} for each in (before, identity))
        changed = sorted(line.partition("#")[0].strip() for line in old - new) or ["keys"]
        raise ValueError(
            f"the run to resume is of another scenario, with {', '.join(changed[:3])}: "
            "leave out SCENARIO to go on with that one, or begin again with --overwrite"
        )
    kept, state = (json.loads(each["run.json"]) for each in (before, identity))
    for key, what in (("versions", "other versions of its packages"), ("inputs", "an input file that has changed")):
        if kept[key] != state[key]:
            raise ValueError(f"the run to resume was begun with {what}: begin again with --overwrite")
    if kept["scene"] != state["scene"]:
        raise ValueError("the run to resume was begun with --scene or without it: give it as it was")
    return True


def _has_blocks(unfinished, error):
    """Whether a stopped run can go on: not with what can never end well, nor from nothing."""
    return not isinstance(error, ValueError | TypeError) and any((unfinished / "blocks").glob("*/*.npy"))


@contextmanager
def _errors_with_their_file(folder):
    """Errors of the system say which file they met, and what can be done."""
    try:
        yield
    except OSError as error:
        name = f" ({error.filename})" if error.filename and str(error.filename) not in str(error.strerror) else ""
        said = f"{error.strerror}{name}" if error.strerror else str(error)
        hint = f"; what is finished is kept, go on with --resume -o {folder}"
        raise OSError(f"{said}{hint if (folder / UNFINISHED).exists() else ''}") from error


def _compute(found, lai, folder, client, threads, as_json):
    """Compute and save the blocks that are not saved yet."""
    blocks = folder / "blocks"
    saved = {name: saved_blocks(blocks, name, array) for name, array in found.arrays.items()}
    cells, image = grids.geobox(lai), found.arrays["image"]
    wanted = [each for each in wanted_blocks(found, lai.chunks, cells) if each[1] not in saved[each[0]]]
    per_pixel = cells.shape.x * cells.shape.y / (image.shape[-1] * image.shape[-2])
    sizes = {index: round(per_pixel * _pixels(image, index)) for index in np.ndindex(image.numblocks)}
    done = sum(sizes[index] for index in saved["image"])
    with CellProgress(sum(sizes.values()), done, as_json) as progress:

        def deliver(name, index, block):
            save_block(blocks, name, index, block)
            if name == "image":
                progress.advance(sizes[index])

        tasks = tasks_of(found.arrays, wanted)
        if client is None:
            run_on_threads(*tasks, deliver, threads)
        else:
            run_on_client(*tasks, deliver, client)


def _pixels(array, index):
    return int(np.prod([sizes[at] for sizes, at in zip(array.chunks[-2:], index[-2:], strict=True)]))


def _write_files(scenario, tree, found, folder):
    """The files of a run from its saved blocks."""
    saved = {
        name: raster.copy(data=saved_array(folder / "blocks", name, found.arrays[name]))
        for name, raster in found.rasters.items()
    }
    image = xr.Dataset({"dn": saved["image"]})
    if "ndvi" in tree["image"]:
        image["ndvi"] = ndvi(saved["image"])
    truth = xr.Dataset({name: saved[name] for name in ("lai", "fpar")})
    to_geotiff(image["dn"], folder / "image.tif")
    to_geotiff(truth, folder / "truth.tif")
    terrain = level = None
    if "terrain" in tree.children:
        level = saved["level"].compute()
        terrain = xr.Dataset({name: saved[f"terrain-{name}"].compute() for name in tree["terrain"].data_vars})
        terrain.attrs = dict(tree["terrain"].attrs)
    detail = saved["detail"].compute()
    quicklook, page = report.run_page(scenario, image, truth, detail, terrain, level, _fits(image, truth))
    (folder / "quicklook.png").write_bytes(quicklook)
    (folder / "report.html").write_text(page, encoding="utf-8")
    (folder / "scenario.toml").write_text(write_scenario(scenario), encoding="utf-8")


def _fits(image, truth):
    """Regressions of the true means on NDVI; none where there is no NDVI or nothing to fit."""
    if "ndvi" not in image:
        return {}
    spread = float(image["ndvi"].std())
    fits = {}
    for name in truth.data_vars:
        # By row and column: with an interval of its own, the image lies on other places than its truth.
        known, found = matched(truth[name], image["ndvi"], "index")
        valid = int((known.variable.notnull() & found.variable.notnull()).sum())
        if valid > 2 and spread > 0:
            fits[name] = regress(known, found, pair="index")
    return fits
