"""Shares of each stage and instrument in the scatter between NDVI and LAI or FPAR."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
import pandas as pd
import rioxarray
import xarray as xr
from odc.geo.geobox import GeoBox
from scipy import ndimage
from threadpoolctl import threadpool_limits

from fifesim.analysis.scaling import by_itself, shapley, taken_away
from fifesim.base.arguments import FilePath, Kind, WholeNumber
from fifesim.base.files import reading
from fifesim.base.geometry import sun_geometry
from fifesim.base.lattice import check_seed
from fifesim.base.messages import warn
from fifesim.chain.landscape_learning import learn_landscape
from fifesim.experiments.scatter.analytic import scatters
from fifesim.experiments.scatter.errors import (
    QuantityOrFunction,
    check_retrieval,
    error_shares,
    fixed_stages,
    target_of,
)
from fifesim.experiments.scatter.stages import STAGES, VARIABLES, pixels
from fifesim.grids import grid as grids
from fifesim.grids import projection
from fifesim.grids.inputs import FileOrRaster
from fifesim.grids.opening import raster_file
from fifesim.grids.source import open_source
from fifesim.grids.warp import onto_grid
from fifesim.models.weather import Weather
from fifesim.output.progress import steps
from fifesim.retrieval.description import Retrieval
from fifesim.scenario.ground import ground_scene
from fifesim.scenario.scenario import Scenario, default_scenario, grid_keys
from fifesim.scenario.simulation import warn_of_scenario_pixels
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.provenance import DASH, origin_text

LineOrRetrieval: TypeAlias = Annotated[
    str | Retrieval,
    Kind("'line', or a fifesim.Retrieval", lambda value: isinstance(value, str | Retrieval)),
]

# Further rows of the table: the remainder with all stages ideal, and the total.
CURVATURE, TOTAL = "curvature", "total"
# Contribution of the ground, which is part of the shares of several stages.
VARIATION = "sub-pixel variation"

# With fewer pixels along an edge, a regression is too uncertain.
_FEWEST = 10
# Minimum fraction of a window of a LAI map with data.
_FILLED = 0.5


def budget(
    scenario: Scenario | None = None,
    *,
    quantity: QuantityOrFunction | None = None,
    retrieval: LineOrRetrieval = "line",
    weather: Weather | None = None,
    realisations: int = 20,
    cells: int = 333,
    seed: WholeNumber | None = None,
    method: Literal["simulate", "analytic"] = "simulate",
    each: Callable[[Sequence[Any]], Iterable[Any]] | None = None,
) -> xr.Dataset:
    r"""
    Attribute the scatter of LAI and FPAR on NDVI, or the error of a quantity, to the stages of a scenario.

    Without ``quantity``, scatter is :math:`v = 1 - R^2`, the variance of the truth not explained by a line on NDVI. The
    share of a stage is its Shapley value: its contribution averaged over all orders of adding the stages to ideal ones.
    Shares and curvature sum to the scatter. A share is negative if the stage makes the relation more linear.

    With ``quantity``, the error is the quantity of the leaf area that is retrieved from the image, minus the mean of
    the quantity over the cells of the pixel. Its bias and variance over the pixels are attributed in the same way to
    these stages, "retrieval" (ideal: the leaf area of the footprint) and "scaling" (ideal: the model at the mean leaf
    area).

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario, optional
        By default the scenario of ``fifesim simulate``.
    quantity : str or callable, optional
        "gpp", "evapotranspiration", one of their models such as "photosynthesis" or "pt-jpl", "lai", "fpar", or a
        function of arrays of LAI, or of LAI and FPAR. FPAR is the light that green leaves absorb. Production and
        evapotranspiration are sums of the day; "farquhar" has C4 leaves on the FIFE site, C3 elsewhere.
    retrieval : "line" or Retrieval, optional
        The regression line of the true leaf area on NDVI, fitted for each set of stages; or a retrieval from
        `fifesim.train`, which estimates LAI from reflectance. Stages that it needs cannot be made ideal: their shares
        are NaN, and the coordinate ``reason`` states why.
    weather : Weather, optional
        Numbers for the models; by default `fife_weather`, which is assumed, with a warning outside the FIFE site.
    realisations : int, optional
        Number of realisations, with different seeds and, if possible, different windows of the grid. For a LAI map, the
        number of windows is the maximum.
    cells : int, optional
        Cells along the edge of a window; the whole grid if it is smaller.
    seed : int, optional
        Seed of the first random field; the others count up, as do the seeds of the noise. By default from the scenario.
    method : {"simulate", "analytic"}, optional
        "analytic" computes the mean over all realisations from the covariances of the pixels, in less than a second and
        without a standard error, on level ground without clouds, for one stand or the leaf area of a learned landscape.
        ``realisations`` and ``seed`` have no effect, and ``cells`` is the window whose mean the regression removes.
    each : callable, optional
        Wrapper of the sequence of realisations to show progress; by default a bar on a terminal or in a notebook.

    Returns
    -------
    budget : xarray.Dataset
        Over (realisation, variable, stage): ``share``, which sums to the total; ``alone``, the decrease of the scatter
        if only this stage is ideal; ``first``, the scatter with only this stage active, minus curvature. Over
        (realisation, variable): ``total``; ``curvature``, the scatter with all stages ideal, because the relation with
        NDVI is curved; ``variation``, the decrease of the total if the ground is uniform within each pixel. [1]
        Along stage: ``origin``, where blur, geolocation and noise of the instrument come from. A stage that is unknown
        has the origin "–" and shares of NaN, and the total leaves it out.

        With ``quantity``: over (realisation, stage) ``bias`` and ``variance``, in the unit of the quantity and its
        square, exactly 0 for a stage that is ideal; over realisation ``total_bias``, ``total_variance``, and mean
        ``truth`` and ``truth_variance`` of the pixels.

    Raises
    ------
    ValueError
        If a quantity is unknown or a function returns another shape, NaN or negative numbers, if the retrieval does not
        estimate LAI or is for another instrument, the analytic method does not hold, a number is out of range, the red
        or near infrared band is missing, or a window has fewer than 10 pixels along an edge.

    References
    ----------
    [Shapley1953]_; [Friedl1995]_, Discussion

    See Also
    --------
    fifesim.trade, fifesim.experiments.sensitivity

    Examples
    --------
    >>> import fifesim
    >>> scenario = fifesim.Scenario(
    ...     grid={"width": 300, "height": 300}, ground={"arp": 0.15}, terrain={"dem": "flat"}
    ... )
    >>> shares = fifesim.budget(scenario, realisations=1, cells=90)
    >>> round(float(shares["total"].sel(variable="lai").mean()), 2)
    0.24
    >>> errors = fifesim.budget(scenario, quantity="gpp", realisations=1, cells=90)
    >>> bool(errors["bias"].sel(stage="scaling") > 0.9 * errors["total_bias"])
    True
    """
    scenario = default_scenario() if scenario is None else scenario
    _check_map(scenario)
    warn_of_scenario_pixels(scenario)
    if quantity is not None:
        target = target_of(quantity, scenario, weather)
        check_retrieval(retrieval, scenario)
    elif retrieval != "line" or weather is not None:
        raise ValueError("retrieval and weather have an effect only with a quantity: give quantity='gpp' too")
    if method == "analytic" and quantity is not None:
        raise ValueError("method='analytic' has no errors of a quantity: give method='simulate'")
    realisations = 1 if method == "analytic" else realisations
    cases = budget_cases(scenario, realisations=realisations, cells=cells, seed=seed)
    if quantity is not None:
        shown = steps(cases, "stage by stage") if each is None else each(cases)
        return _labelled([error_shares(case, target, retrieval) for case in shown], target, retrieval)
    shown = steps(cases, "stage by stage") if each is None else each(cases)
    one = _one if method == "simulate" else _analytic
    made = xr.concat([one(case) for case in shown], "realisation").assign_attrs(method=method)
    for values in made.data_vars.values():
        values.attrs = {"units": "1", "long_name": "share of the variance"}
    origins = stage_origins(scenario)
    made = made.assign_coords(origin=("stage", [origins.get(stage, "") for stage in STAGES]))
    # A stage that could not be simulated has an unknown share, not a share of zero.
    by_stage = made[["share", "alone", "first"]]
    return made.assign(by_stage.where((made["origin"] != DASH) | (by_stage != 0).any(["realisation", "variable"])))


def _labelled(found, target, retrieval):
    """Bias and variance of the realisations with their units, and the reasons for stages that cannot be ideal."""
    made = xr.concat(found, "realisation")
    squared = f"({target.units})2" if target.units else ""
    for name, values in made.data_vars.items():
        what = f"{name.replace('_', ' ')} of {target.name}"
        values.attrs = {"units": squared if "variance" in name else target.units, "long_name": what}
    reasons = fixed_stages(retrieval)
    made.attrs["quantity"] = target.name
    return made.assign_coords(reason=("stage", [reasons.get(stage, "") for stage in made["stage"].values]))


def stage_origins(scenario):
    """Origin of the blur, geolocation and noise of the instrument by the stage that they affect; a dash if unknown."""
    own = scenario.complete().sensor
    # The ideal response, a displacement and a noise model are given by the scenario.
    by_stage = {
        "point spread": ("blur", own.response == "detector"),
        "registration": ("geolocation", any(own.offset)),
        "noise": ("noise", bool(own.noise_model)),
    }
    return {
        stage: "given" if is_given else origin_text(own.description, quantity, own.bands)
        for stage, (quantity, is_given) in by_stage.items()
    }


def total_range(scenario, **options):
    """Totals of LAI and FPAR at the ends of the uncertainty of the blur by variable, None if it is not stated."""
    totals: dict[str, list[float]] = {name: [] for name in VARIABLES}
    for end in ("sharpest", "softest"):
        if scenario.sensor.response not in (None, "system"):
            return None
        try:
            sensor = scenario.sensor.model_copy(update={"response": end})
            sensor.description  # noqa: B018
        except ValueError:
            return None
        found = budget(scenario.model_copy(update={"sensor": sensor}), **options)
        for name in VARIABLES:
            totals[name].append(float(found["total"].sel(variable=name).mean()))
    return {name: (min(values), max(values)) for name, values in totals.items()}


def _check_map(scenario):
    """Raise ValueError for a map of coarse pixels, which is smooth at the scale of the budget."""
    if not scenario.ground.lai_file:
        return
    cell = scenario.grid.cell
    with raster_file(scenario.ground.lai_file).opened() as source:
        size = float(np.sqrt(abs(source.transform.determinant)))
    if source.crs and source.crs.is_projected and size > 1.5 * cell:
        warn(
            f"{Path(scenario.ground.lai_file).name} has pixels of {size:.3g} m, and cells of {cell:.3g} m "
            "are interpolated between them: nothing varies within its pixels, so that non-linearity and NDVI scaling "
            "would be 0. Use fifesim.ground.downscale to make a map with variation"
        )


def budget_cases(scenario, *, realisations, cells, seed=None):
    """Complete scenarios of the realisations of a budget."""
    if realisations < 1:
        raise ValueError(f"realisations must be at least 1, got {realisations}")
    scenario = scenario.complete()
    windows = _windows(scenario, cells)
    land, own = scenario.ground, scenario.sensor
    first = land.seed if seed is None else seed
    check_seed(first)
    if land.lai_file:
        # A map has no seed; realisations differ in position.
        realisations = min(realisations, len(windows))
    places = np.linspace(0, len(windows) - 1, min(realisations, len(windows))).round().astype(int)
    found = []
    for number in range(realisations):
        ground = land.model_copy(update={"seed": first + number})
        sensor = own.model_copy(update={"seed": own.seed + number})
        clouds = scenario.clouds.model_copy(update={"seed": scenario.clouds.seed + number})
        window = grid_keys(windows[places[number % len(places)]])
        update = {"grid": window, "ground": ground, "clouds": clouds, "sensor": sensor}
        found.append(scenario.model_copy(update=update))
    return found


def budget_table(budget):
    """Means and standard errors of a budget over its realisations, as a table."""
    rows, origins = [], dict(zip(budget["stage"].values, budget["origin"].values, strict=True))
    for variable in VARIABLES:
        one = budget.sel(variable=variable)
        by_stage = one[["alone", "first", "share"]]
        cases = [(stage, by_stage.sel(stage=stage)) for stage in STAGES]
        cases += [(CURVATURE, {"share": one["curvature"]}), (TOTAL, {"share": one["total"]})]
        cases += [(VARIATION, {"alone": one["variation"]})]
        for stage, columns in cases:
            row = {"stage": stage, "variable": variable, "origin": str(origins.get(stage, ""))}
            for name, values in columns.items():
                row |= {name: float(values.mean("realisation")), f"{name}_error": float(standard_error(values))}
            rows.append(row)
    order = [f"{name}{suffix}" for name in ("alone", "first", "share") for suffix in ("", "_error")]
    return pd.DataFrame(rows, columns=["stage", "variable", "origin", *order])


def standard_error(values):
    """Standard error of the mean over realisations, NaN with one realisation."""
    count = values.sizes["realisation"]
    if count < 2:
        return values.mean("realisation") * np.nan
    return values.std("realisation", ddof=1) / np.sqrt(count)


def unexplained(truth, ndvi):
    """Share of the variance of a truth not explained by a line on NDVI, 1 - R2, shape (...). [1]"""
    truth = truth - truth.mean(axis=-1, keepdims=True)
    ndvi = ndvi - ndvi.mean(axis=-1, keepdims=True)
    of_truth, of_ndvi = (truth**2).sum(axis=-1), (ndvi**2).sum(axis=-1)
    if not np.all(of_truth > 0):
        raise ValueError("LAI or FPAR does not vary over the pixels: there is no scatter to share")
    # Constant NDVI, which is possible with 6 bits, explains no variance.
    explained = (truth * ndvi).sum(axis=-1) ** 2 / np.where(of_ndvi > 0, of_truth * of_ndvi, np.inf)
    return 1 - explained


def _one(scenario):
    """Results of one realisation, over (variable, stage) or variable."""
    seen = pixels(scenario)
    uniform = seen.homogeneous_ndvi
    return _rows(
        seen.stages,
        {name: unexplained(seen.truth[name], seen.ndvi) for name in VARIABLES},
        {name: unexplained(seen.homogeneous_truth[name], uniform) for name in VARIABLES},
    )


def _analytic(scenario):
    """Mean results of all realisations, over (variable, stage) or variable."""
    with threadpool_limits(1, user_api="blas"):
        return _rows(*scatters(scenario))


def _rows(stages, scatter, uniform):
    """Results from the scatter of each variable for all sets of stages, and over uniform pixels."""
    rows, count = [], len(stages)
    for variable, values in scatter.items():
        total, curvature = values[(1,) * count], values[(0,) * count]
        row = {"total": total, "curvature": curvature, "variation": total - uniform[variable]}
        for name, attribute in (("share", shapley), ("alone", taken_away), ("first", by_itself)):
            # A stage that is already ideal has no effect.
            effects = dict.fromkeys(STAGES, 0.0) | dict(zip(stages, attribute(values, count), strict=True))
            row[name] = ("stage", list(effects.values()))
        rows.append(xr.Dataset(row, {"stage": list(STAGES), "variable": variable}))
    return xr.concat(rows, "variable")


def _windows(scenario, cells):
    """Adjacent whole windows of the grid of a scenario."""
    box = scenario.geobox()
    size = tuple(min(cells, count) for count in box.shape)
    pixel = scenario.sensor.size
    held = tuple(int(count * cell / pixel + 1e-6) for count, cell in zip(size, grids.cell_size(box), strict=True))
    if min(held) < _FEWEST:
        raise ValueError(
            f"a scene of {size[0]} x {size[1]} cells holds {held[0]} x {held[1]} pixels of {pixel:g} m, but a budget "
            f"needs {_FEWEST} x {_FEWEST}: take more cells, a larger grid, or a larger grid.cell"
        )
    height, width = size
    found = [
        GeoBox(size, box[row * height :, column * width :].affine, box.crs)
        for row in range(box.shape.y // height)
        for column in range(box.shape.x // width)
    ]
    if not scenario.ground.lai_file:
        return found
    # A map may have no data in its corners.
    filled = [window for window in found if float(ground_scene(scenario, window)["lai"].notnull().mean()) > _FILLED]
    if not filled:
        raise ValueError(f"no scene of {size[0]} x {size[1]} cells of the LAI map holds enough data: take fewer cells")
    return filled


_PIXELS = 12  # minimum along a window, for coarse instruments
_CELLS = 333  # minimum along a window


def instrument_scenario(name, *, arp=0.15, response=None):
    """Scenario of the paper's ground, level, as seen by an instrument with a spatial response."""
    # Red and near infrared on the grid of its product, with its noise, displaced along both axes by the root mean
    # square error of its geolocation.
    description = instrument(name)
    bands = description.red_and_near_infrared()
    shift = (description.geolocation or 0.0) / description.pixel(bands[0])
    noise = ["all"] if all(band.noise for band in bands) else []
    sensor = {"instrument": name, "bands": [band.name for band in bands], "noise": noise, "offset": [shift, shift]}
    sensor |= {} if response is None else {"response": response}
    return Scenario(sensor=sensor, ground={"arp": arp}, terrain={"dem": "flat"})


# Largest ground cell of a scenario for an image. [m]
_CELL = 10 / 3


def scenario_like(
    image: FileOrRaster,
    dem: FilePath | None = None,
    *,
    file: FilePath,
    quantity: Literal["lai", "ndvi"] | None = None,
    instrument: str | None = None,
    time: str | None = None,
    noise: float = 0.0,
) -> Scenario:
    """
    Scenario whose ground is a landscape learned from an image, on the terrain of the image.

    Parameters
    ----------
    image : str, path or xarray.DataArray
        Map of leaf area or NDVI of the ground as in `fifesim.learn_landscape`, in a projected CRS.
    dem : str or path, optional
        Elevation file that covers the image; level ground by default.
    file : str or path
        JSON file to which the landscape is written; the scenario reads it.
    quantity : {"lai", "ndvi"}, optional
        Quantity of the image; by default from its name or the name of its file.
    instrument : str, optional
        Instrument of the image and of the scenario, with its blur, noise and geolocation error; required for NDVI. By
        default the scenario has TM, and cells of the image are means of the ground.
    time : str, optional
        Date and time of the image, UTC unless it has an offset; required for NDVI and outside of the FIFE site.
    noise : float, optional
        Standard deviation of the noise of the image, which is not learned, in its unit.

    Returns
    -------
    scenario : Scenario
        For `fifesim.budget` and `fifesim.simulate`. It covers the image, or the largest square in which the elevation
        is known.

    Raises
    ------
    ValueError
        As in `fifesim.learn_landscape`; if NDVI has no time, or the place needs one.

    See Also
    --------
    fifesim.learn_landscape, fifesim.budget

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> import fifesim
    >>> grid = fifesim.fife_site(10.0, window=((0, 90), (0, 90)))
    >>> lai = fifesim.landscape(grid, seed=1)["lai"]  # stands for your map
    >>> scenario = fifesim.experiments.scenario_like(lai, file=Path(mkdtemp()) / "mine.json")
    >>> scenario.geobox().shape, scenario.terrain.dem
    (Shape2d(x=270, y=270), 'flat')
    """
    cells = image if isinstance(image, xr.DataArray) else _map_of(image)
    grid, seen = grids.geobox(cells), instrument_scenario(instrument or "TM")
    if instrument is not None and time is None:
        raise ValueError("the image of an instrument needs its time: type for instance time='2022-06-03T17:15Z'")
    longitude, latitude = projection.middle(grid)
    geometry = None if time is None else sun_geometry(time, latitude, longitude)
    source = ", ".join(filter(None, [str(cells.name or "a map"), time]))
    learn_landscape(
        cells, dem, quantity=quantity, instrument=instrument, geometry=geometry, noise=noise, source=source
    ).save(file)
    heights = None if dem is None else onto_grid(open_source(dem, "dem"), grid)
    pixel, box = seen.sensor.size, _known_part(grid, heights).boundingbox
    west, north = math.ceil(box.left / pixel) * pixel, math.floor(box.top / pixel) * pixel
    width, height = (math.floor(length / pixel) * pixel for length in (box.right - west, north - box.bottom))
    altitude = {} if heights is None else {"altitude": round(max(float(heights.mean()) / 1000, 0.0), 3)}
    return Scenario(
        grid=grid_keys(grids.grid_at(grid.crs.to_wkt(), west, north, width, height, min(_CELL, pixel / 3))),
        landscape={"learned": str(file)},
        terrain={"dem": "flat" if dem is None else str(dem)},
        geometry={} if time is None else {"time": time},
        atmosphere=altitude,
        sensor=seen.sensor,
    )


# Cells of a map around a part with known elevation, so that its spline is known too.
_MARGIN = 4


def _known_part(grid, heights):
    """Largest square of a grid with known elevation; the whole grid if all of it is known."""
    if heights is None or bool(heights.notnull().all()):
        return grid
    known = np.pad(np.isfinite(heights.values), 1)
    far = ndimage.distance_transform_cdt(known, "chessboard")[1:-1, 1:-1]
    (row, column), half = np.unravel_index(far.argmax(), far.shape), max(int(far.max()) - 1 - _MARGIN, 0)
    return grid[row - half : row + half + 1, column - half : column + half + 1]


def _map_of(path):
    """Map of a raster file in a projected CRS, named after the file."""
    with reading("the image", path):
        cells = rioxarray.open_rasterio(path, masked=True, mask_and_scale=True)
    if cells.sizes["band"] > 1:
        raise ValueError(f"{Path(path).name} has {cells.sizes['band']} bands: give a file with LAI or NDVI alone")
    cells = cells.squeeze("band", drop=True).rename(Path(path).stem)
    if not cells.rio.crs or cells.rio.crs.is_projected:
        return cells
    # Nearest cells, because interpolation would blur the map once more.
    crs = cells.rio.estimate_utm_crs()
    size = np.sqrt(np.prod(np.abs(cells.rio.reproject(crs).rio.resolution())))
    return cells.rio.reproject(crs, resolution=float(f"{size:.2g}"), nodata=np.nan)


def window_cells(scenario):
    """Number of cells along the edge of a window that holds enough pixels of an instrument: 333, or 12 pixels."""
    return max(_CELLS, math.ceil(_PIXELS * scenario.sensor.size / scenario.grid.cell))
