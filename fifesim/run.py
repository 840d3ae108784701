"""A run: a scenario simulated into a folder of files."""

import importlib.metadata
import platform
from pathlib import Path

import numpy as np
import xarray as xr

from fifesim import grid as grids
from fifesim import report
from fifesim.analysis.pairs_raster import matched
from fifesim.analysis.raster import regress
from fifesim.export import to_geotiff
from fifesim.folders import check_folder, whole_files
from fifesim.progress import ProgressBar
from fifesim.scenario_file import write_scenario
from fifesim.simulation import simulate

FILES = ("image.tif", "truth.tif", "quicklook.png", "report.html", "scenario.toml")

# The report shows the cells below this many pixels across, in the middle: enough to see what a pixel averages. [pixel]
_DETAIL = 16

_VERSIONS = ("fifesim", "numpy", "scipy", "xarray", "dask", "numba", "rasterio", "odc-geo", "pvlib", "pyrsr")


def simulate_to_folder(scenario, folder, *, overwrite=False):
    """
    Simulate a scenario into a folder: image.tif, truth.tif, quicklook.png, report.html and scenario.toml.

    Parameters
    ----------
    scenario : fifesim.scenario.Scenario
    folder : str or path
        Made where it does not exist.
    overwrite : bool, optional
        Replace these files where the folder holds something; other files stay.

    Returns
    -------
    files : list of pathlib.Path

    Raises
    ------
    ValueError
        If the scenario cannot be simulated, or the folder holds something; nothing is written then.
    OSError
        If a file cannot be written; no half-written file is left.
    """
    folder = Path(folder)
    check_folder(folder, overwrite)
    complete = scenario.complete()
    tree = simulate(complete)
    wanted = {name: tree[name].to_dataset() for name in ("image", "truth", "terrain", "level") if name in tree.children}
    wanted["detail"] = _detail(tree)
    with ProgressBar("simulating"):
        # One pass for all: the cells are made once.
        done = xr.DataTree.from_dict(wanted).compute()
    image, truth, detail = done["image"].to_dataset(), done["truth"].to_dataset(), done["detail"]["lai"]
    terrain = done["terrain"].to_dataset() if "terrain" in done.children else None
    if terrain is not None:
        image["level"] = done["level"]["dn"]
    with whole_files(folder) as partial:
        to_geotiff(image["dn"], partial / "image.tif")
        to_geotiff(truth, partial / "truth.tif")
        report.quicklook(partial / "quicklook.png", image, truth, detail)
        fits = _fits(image, truth)
        page = report.page(complete, image, truth, detail, terrain, fits, _versions())
        (partial / "report.html").write_text(page, encoding="utf-8")
        (partial / "scenario.toml").write_text(write_scenario(complete), encoding="utf-8")
    return [folder / name for name in FILES]


def _detail(tree):
    """LAI of the cells below some pixels in the middle of the image."""
    lai, pixels = tree["scene"]["lai"], grids.geobox(tree["image"]["dn"])
    cells = grids.geobox(lai)
    (cell_down, cell_across), (pixel_down, pixel_across) = grids.cell_size(cells), grids.cell_size(pixels)
    cut = {}
    for axis, count, pixel, cell in (
        ("y", pixels.shape.y, pixel_down, cell_down),
        ("x", pixels.shape.x, pixel_across, cell_across),
    ):
        shown = min(count, _DETAIL)
        first = (count - shown) // 2
        cut[axis] = slice(round(first * pixel / cell), round((first + shown) * pixel / cell))
    return xr.Dataset({"lai": lai.isel(cut)})


def _fits(image, truth):
    """Regressions of the true means on NDVI; none where there is no NDVI or nothing to fit."""
    if "ndvi" not in image:
        return {}
    fits = {}
    for name in truth.data_vars:
        # By row and column: with an interval of its own, the image lies on other places than its truth.
        known, ndvi = matched(truth[name], image["ndvi"], "index")
        valid = int((np.isfinite(known.values) & np.isfinite(ndvi.values)).sum())
        if valid > 2 and float(ndvi.std()) > 0:
            fits[name] = regress(known, ndvi, pair="index")
    return fits


def _versions():
    versions = {name: importlib.metadata.version(name) for name in _VERSIONS}
    return {"python": platform.python_version()} | versions
