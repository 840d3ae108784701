"""Images of a scene with any set of stages ideal, from the ground to the sensor."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.analysis.index_labels import red_and_nir
from fifesim.analysis.scaling_labels import aggregate_blocks
from fifesim.atmosphere.clouds.labels import COLUMNS, cast_clouds, cloud_tables
from fifesim.atmosphere.clouds.layer import under_clouds
from fifesim.base.footprints import Boxcar, regularize
from fifesim.chain import coupled_ground
from fifesim.chain.driver import Driver, cell_block_means, shared_operators
from fifesim.chain.setup import Setup, reflectance_of
from fifesim.chain.steps import to_toa
from fifesim.grids import grid as grids
from fifesim.grids.grid import as_carried
from fifesim.grids.reductions import areas
from fifesim.ground.canopy.properties import DRAWN
from fifesim.ground.terrain.labels import light_on_slopes
from fifesim.ground.terrain.source_labels import beside_altitude
from fifesim.retrieval.description import Retrieval
from fifesim.scenario.ground import (
    absorbed_light,
    drawn_properties,
    elevation,
    ground_scene,
    in_memory,
    numbers_of_stands,
)
from fifesim.scenario.scenario import Scenario
from fifesim.scenario.simulation import setup_of
from fifesim.sensor.pixel_labels import pixel_grid


def spread_out(cells, blocks, min_valid):
    """Means of blocks spread over their cells; a cell outside of all blocks keeps its value."""
    (rows, columns), inside = _places(cells, blocks)
    spread = aggregate_blocks(cells, grids.cell_size(blocks)[0], min_valid=min_valid).values[rows][:, columns]
    return cells.copy(data=np.where(inside & np.isfinite(spread) & np.isfinite(cells.values), spread, cells.values))


def middle_cells(cells, blocks):
    """Code of the central cell of each block spread over its cells; a cell outside of all blocks keeps its code."""
    (rows, columns), inside = _places(cells, blocks)
    sizes = zip(grids.cell_size(blocks), grids.cell_size(grids.geobox(cells)), strict=True)
    down, across = (block / cell for block, cell in sizes)
    middle = cells.values[((rows + 0.5) * down).astype(int)][:, ((columns + 0.5) * across).astype(int)]
    return cells.copy(data=np.where(inside & (cells.values >= 0), middle, cells.values))


def _places(cells, blocks):
    """Row and column of the block of each cell, limited to the last block, and whether the cell is inside a block."""
    sizes = zip(grids.cell_size(grids.geobox(cells)), grids.cell_size(blocks), cells.shape, strict=True)
    places = [np.floor((np.arange(count) + 0.5) * cell / block + 1e-9).astype(int) for cell, block, count in sizes]
    inside = [place < count for place, count in zip(places, blocks.shape, strict=True)]
    last = [np.minimum(place, count - 1) for place, count in zip(places, blocks.shape, strict=True)]
    return last, inside[0][:, None] & inside[1]


# In the order of the axes of `stages.pixels`.
IDEAL_PROPERTIES = {
    "soil": "uniform brightness and moisture",
    "dead leaves": "uniform fraction of dead leaves",
    "cover": "leaves and background of the first class everywhere",
    "clumping": "evenly distributed leaves, without gaps between crowns",
}


def varying_ground(scenario):
    """Properties that vary over the ground of a scenario apart from leaf area, in the order of `IDEAL_PROPERTIES`."""
    classes = scenario.class_table() if scenario.landscape.cover != "none" else {}
    found = {DRAWN[name].effect for name in drawn_properties(scenario)}
    if len(classes) > 1 and any(each.canopy.given for each in classes.values()):
        found.add("cover")
    clumped = {name: known.default for name, known in DRAWN.items() if known.effect == "clumping"}
    if any(set(numbers_of_stands(scenario, name)) != {default} for name, default in clumped.items()):
        found.add("clumping")
    return tuple(name for name in IDEAL_PROPERTIES if name in found)


def ground_with(scenario, grid, at_work):
    """Ground of a scenario with some varying properties ideal, from the same random numbers."""
    land = ground_scene(scenario, grid)
    for name, known in DRAWN.items():
        # Without clumping there are no gaps between crowns; other ideal properties have their means.
        if known.effect == "clumping" and known.effect in varying_ground(scenario) and known.effect not in at_work:
            land = land.assign({name: known.default})
        elif known.effect not in at_work and name in land:
            land = land.assign({name: getattr(scenario.ground, name)})
    if "cover" not in at_work and "cover" in land:
        first = land["cover"].attrs["flag_values"][0]
        land["cover"] = land["cover"].where(land["cover"] < 0, first).astype(land["cover"].dtype)
    return land.compute()


def images_of(scene, cells, switches, hazy=True, linear=False):
    """NDVI, or leaf area by a retrieval, for active or ideal stages of the sensor, shape (5 axes of stages, y, x)."""
    scaling, spread, registration, quantisation, noise = switches
    found = np.empty((*map(len, switches), *scene.shape))
    for (i, blurred), (j, displaced) in product(enumerate(spread), enumerate(registration)):
        means = means_of(scene, cells, blurred, displaced)
        for (k, counts), (m, grains) in product(enumerate(quantisation), enumerate(noise)):
            if scene.retrieval is not None:
                found[:, i, j, k, m] = _estimated(scene, _recorded(scene, means, counts, grains), hazy)
                continue
            *reflectance, of_cells = means
            recorded = scene.driver.ndvi(_recorded(scene, np.array(reflectance), counts, grains), linear)
            for n, of_reflectance in enumerate(scaling):
                # Effects of the detector remain.
                direct = scene.driver.ndvi(means, linear)
                found[n, i, j, k, m] = recorded if of_reflectance else of_cells + (recorded - direct)
    return found


def means_of(scene, cells, blurred, displaced):
    """Means of layers over footprints, shape (layer, y, x): one layer for each band, and further ones as the first."""
    setup, grid = scene.setup, scene.grid
    box = scene.image if displaced else scene.blocks
    sizes = grids.cell_size(box)
    shifts = [offset * size for offset, size in zip(setup.offset, sizes, strict=True)] if displaced else (0.0, 0.0)
    rows, columns = scene.shape
    means = np.empty((len(cells), rows, columns))
    for layer, _ in enumerate(cells):
        band = scene.driver.bands[layer if layer < len(scene.driver.bands) else 0]
        spreads = setup.instrument.line_spreads(band) if blurred else areas(scene.blocks)
        along = shared_operators(spreads, grid, box[:rows, :columns], tuple(map(float, shifts)))
        means[layer] = regularize(cells[layer], *along, min_valid=setup.min_valid)
    return means


def _recorded(scene, means, counts, grains):
    """Reflectance of the recorded mean reflectances, shape (band, y, x)."""
    driver = scene.driver
    radiance = driver.radiance(means)
    if grains:
        radiance = driver.with_noise(radiance, scene.image, scene.setup)
    return driver.planetary(driver.recorded(radiance) if counts else radiance)


def _estimated(scene, reflectance, hazy):
    """Leaf area of pixels by a retrieval, shape (y, x). [m2 m-2]"""
    if hazy and scene.retrieval.level == "surface":
        reflectance = scene.driver.corrected(reflectance)
    geometry = scene.setup.geometry
    pixels = reflectance.reshape(len(reflectance), -1).T
    angles = np.broadcast_to([geometry.sza, geometry.vza, geometry.raa], (len(pixels), 3))
    median = scene.retrieval.estimate(pixels, angles).median
    return median[:, scene.retrieval.quantities.index("lai")].reshape(reflectance.shape[1:])


# In the order of the axes of `pixels`.
STAGES = {
    "non-linearity": "reflectance and FPAR are linear in LAI, along the tangent at the mean LAI of the pixel",
    "NDVI scaling": "mean of the NDVI of the cells instead of the NDVI of their mean reflectance",
    "point spread": "all cells of a pixel have equal weight",
    "registration": "pixels coincide with the blocks of the truth",
    "quantisation": "radiance instead of digital numbers",
    "noise": "none",
    "topography": "level ground",
    "atmosphere": "reflectance at the ground",
    "coupling": "light between ground and atmosphere by one reflectance factor",
    "clouds": "no clouds toward the sensor; in the budget, those thinner than the mask",
    "shadows": "no clouds toward the sun or overhead; in the budget, those thinner than the mask",
} | IDEAL_PROPERTIES
# Ground properties that affect leaf area or absorbed light, in order.
_TRUE = ("cover", "clumping")
_SENSED = ("NDVI scaling", "point spread", "registration", "quantisation", "noise")
VARIABLES = ("lai", "fpar")
# Half of the step of LAI over which tangents are taken: wide compared with the error of the reflectance table, 1e-6.
STEP = 0.05


@dataclass(frozen=True, eq=False)
class Pixels:
    """Pixels of a scene under every combination of its stages."""

    stages: tuple  # that are not ideal already, in the order of STAGES
    ndvi: np.ndarray  # shape (2,) * len(stages) + (n,), index 1 where the stage is active
    truth: dict  # LAI and FPAR, shape as ndvi or 1 along its axes
    homogeneous_ndvi: np.ndarray  # all stages active, over ground that is uniform within each pixel, shape (n,)
    homogeneous_truth: dict


def working_stages(scenario):
    """Stages of a scenario that are not ideal, in the order of `STAGES`."""
    own, size = scenario.sensor, scenario.sensor.size
    bands = own.description.select(own.bands)
    spreads = [spread for band in bands for spread in own.description.line_spreads(band)]
    ideal = {
        "point spread": all(isinstance(spread, Boxcar) and spread.width == size for spread in spreads),
        "registration": own.interval in ("product", size) and not any(own.offset),
        "noise": not own.noise,
        "topography": scenario.terrain.dem == "flat",
        "coupling": scenario.atmosphere.coupling == "lambert",
        "clouds": scenario.clouds.cloud_cover == 0,
        "shadows": scenario.clouds.cloud_cover == 0,
    }
    ideal |= {name: name not in varying_ground(scenario) for name in IDEAL_PROPERTIES}
    return tuple(stage for stage in STAGES if not ideal.get(stage, False))


def pixels(scenario):
    """Pixels of a scene for each set of active stages, from the same random numbers, paired by row and column."""
    return displaced_pixels(scenario, [scenario.sensor.offset])[0]


def displaced_pixels(scenario, offsets):
    """`pixels` for several registration errors, with the light at the top of the atmosphere computed once."""
    sensors = [scenario.sensor.model_copy(update={"offset": list(offset)}) for offset in offsets]
    stages = [working_stages(scenario.model_copy(update={"sensor": sensor})) for sensor in sensors]
    scene = scene_of(scenario)
    scenes = [replace(scene, setup=replace(scene.setup, offset=tuple(offset))) for offset in offsets]
    switches = [switches_of(each) for each in stages]
    images = images_of_all(scenes, switches)
    truths, even = _truths(scene, switches[0]), _even(scene)
    even_cells, even_truth = _cells(scene, even, set(stages[0])), _truth(scene, even, True)
    found = []
    for k, one in enumerate(scenes):
        of_even = images_of(one, even_cells, [switches[k][name][-1:] for name in _SENSED]).reshape(scene.shape)
        found.append(_with_data(stages[k], images[k], truths, of_even, even_truth))
    return found


def switches_of(stages):
    """States of all stages by name: False is ideal, True is active."""
    return {name: (False, True) if name in stages else (False,) for name in STAGES}


def images_of_all(scenes, switches):
    """Images of scenes that differ in the offset for all states of their stages, each (15 axes of stages, y, x)."""
    lit, images = [name for name in STAGES if name not in _SENSED], [[] for _ in scenes]
    for states in product(*(switches[0][name] for name in lit)):
        at_work = {name for name, state in zip(lit, states, strict=True) if state}
        cells = _cells(scenes[0], scenes[0].ground(at_work), at_work)
        for found, one, each in zip(images, scenes, switches, strict=True):
            sensed = [each[name] for name in _SENSED]
            found.append(images_of(one, cells, sensed, "atmosphere" in at_work, "non-linearity" not in at_work))
    return [_in_order(found, each, lit) for found, each in zip(images, switches, strict=True)]


def _in_order(images, switches, lit):
    """Images of all states, with the axes of `STAGES` first."""
    order = [*lit, *_SENSED]
    images = np.reshape(images, (*(len(switches[name]) for name in order), *np.shape(images)[-2:]))
    return np.moveaxis(images, [order.index(name) for name in STAGES], range(len(STAGES)))


@dataclass(frozen=True, eq=False)
class _Ground:
    """Properties of the cells, and the mean leaf area [m2 m-2] of the pixel that contains each cell."""

    land: xr.Dataset
    middle: np.ndarray
    known: dict = field(default_factory=dict)
    """Reflectance by active stages of the ground."""


@dataclass(frozen=True, eq=False)
class _Scene:
    """Scenario with its instrument, grid and blocks."""

    scenario: Scenario
    setup: Setup
    driver: Driver
    """Driver of the red and the near infrared band, or of the bands of the retrieval, on level ground."""
    grid: GeoBox
    blocks: GeoBox
    image: GeoBox
    retrieval: Retrieval | None = None
    grounds: dict = field(default_factory=dict)

    @property
    def shape(self):
        """Common rows and columns of the image and the blocks of the truth."""
        return tuple(min(pair) for pair in zip(self.blocks.shape, self.image.shape, strict=True))

    def ground(self, at_work):
        """Ground with some stages active, computed once."""
        kind = frozenset(at_work) & set(IDEAL_PROPERTIES)
        if kind not in self.grounds:
            land = ground_with(self.scenario, self.grid, kind)
            self.grounds[kind] = _Ground(land, self.spread_out(land["lai"]).values)
        return self.grounds[kind]

    @cached_property
    def slopes(self):
        """Light on the slopes of the scene, None on level ground."""
        if self.setup.dem is None:
            return None
        dem = beside_altitude(self.setup.dem, self.driver.air.altitude)
        return light_on_slopes(dem, as_carried(self.grid), self.setup.geometry, self.setup.horizon)

    @cached_property
    def columns(self):
        """Clouds toward the sensor, the sun and the zenith of each cell, and their tables without path reflectance."""
        own = self.driver
        cells = grids.place(xr.DataArray(np.zeros(self.grid.shape), dims=("y", "x")), self.grid)
        cast = cast_clouds(
            cells, self.setup.clouds, dem=self.setup.dem, altitude=own.air.altitude, geometry=own.setup.geometry
        )
        responses = [band.response for band in own.bands]
        return [cast[name].values for name in COLUMNS], cloud_tables(own.air, tuple(responses), own.setup.geometry)

    def is_stand(self, ground):
        """Whether only leaf area varies, so that plain arrays suffice."""
        return self.setup.slopes == "kt" and set(ground.land.data_vars) == {"lai"}

    def spread_out(self, cells):
        """Means over the pixels of the truth, spread over the cells."""
        return spread_out(cells, self.blocks, self.setup.min_valid)


def scene_of(scenario, retrieval=None):
    """Scene of a scenario with the bands of NDVI, or of a retrieval."""
    setup, grid = setup_of(scenario), scenario.geobox()
    chosen = setup.instrument.select(setup.bands if retrieval is None else retrieval.bands)
    bands = _red_and_nir(chosen) if retrieval is None else chosen
    blocks = grids.aligned_grid(grid, scenario.sensor.size)
    image = pixel_grid(grid, setup.instrument, bands, setup.onto, setup.interval)
    # In memory, because every set of stages with topography needs them.
    dem, horizon = in_memory(*elevation(scenario, grid)[:2])
    plain = {"clouds": None, "slopes": "kt", "coupling": "lambert", "adjacency": False}
    level = replace(setup, bands=tuple(band.name for band in bands), **plain)
    driver = Driver(level)
    return _Scene(scenario, replace(setup, dem=dem, horizon=horizon), driver, grid, blocks, image, retrieval)


def _even(scene):
    """Ground with all stages active but uniform within each pixel: means, and the class in the middle."""
    whole = scene.ground(IDEAL_PROPERTIES)
    land = {name: scene.spread_out(each) for name, each in whole.land.items() if name != "cover" and each.ndim == 2}
    if "cover" in whole.land:
        land["cover"] = middle_cells(whole.land["cover"], scene.blocks)
    return _Ground(whole.land.assign(land), whole.middle)


def _red_and_nir(bands):
    """Red and near infrared band."""
    coords = {"wavelength": ("band", [band.wavelength for band in bands])}
    numbers = xr.DataArray(np.arange(len(bands))[:, None, None], dims=("band", "y", "x"), coords=coords)
    return tuple(bands[number.item()] for number in red_and_nir(numbers))


def _truths(scene, switches):
    """LAI and FPAR of the blocks, with one axis for each stage, shape (..., variable, y, x)."""
    states = product(*(switches[name] for name in _TRUE))
    kinds = [[name for name, at_work in zip(_TRUE, state, strict=True) if at_work] for state in states]
    found = [[_truth(scene, scene.ground(kind), curve) for kind in kinds] for curve in (0, 1)]
    shape = [len(switches[name]) if name in ("non-linearity", *_TRUE) else 1 for name in STAGES]
    return np.reshape(found, (*shape, len(VARIABLES), *scene.shape))


def _truth(scene, ground, curve):
    """LAI and FPAR of the blocks."""
    own, lai = scene.scenario, ground.land["lai"].values

    def fpar(area):
        if scene.is_stand(ground):
            return scene.driver.fpar(area, own.ground.fpar_inf)
        return absorbed_light(own, setup_over(scene, ground), _with_lai(ground, area)).values

    absorbed = fpar(lai) if curve else along_tangent(fpar, lai, ground.middle)
    size, (rows, columns) = grids.cell_size(scene.blocks)[0], scene.shape
    means = [cell_block_means(each, scene.grid, size, scene.setup.min_valid) for each in (lai, absorbed)]
    return [each[:rows, :columns] for each in means]


def setup_over(scene, ground):
    """Setup without the canopy properties that vary by cell."""
    given = scene.setup.canopy.given & set(ground.land.data_vars)
    return replace(scene.setup, canopy=scene.setup.canopy.replace(**dict.fromkeys(given)))


def _with_lai(ground, area):
    """The land of a ground with another leaf area, an array [m2 m-2]."""
    return ground.land.assign(lai=ground.land["lai"].copy(data=area))


def _cells(scene, ground, at_work):
    """Bands of the cells at the ground or at the top of the atmosphere, and NDVI without a retrieval, (layer, y, x)."""
    driver, bands = scene.driver, list(scene.driver.setup.bands)
    setup = setup_over(scene, ground)
    setup = setup if "topography" in at_work else replace(setup, dem=None, horizon=None)
    coupling = setup.coupling if {"atmosphere", "coupling"} <= at_work else "lambert"

    def reflectance(area):
        if coupling != "lambert" or not scene.is_stand(ground):
            return reflectance_of(setup, _with_lai(ground, area), coupling).sel(band=bands).values
        level = driver.reflectance(area)
        return level if setup.dem is None else driver.on_slopes(level, scene.slopes)

    # The atmosphere affects only the steps above.
    key, lai = ("non-linearity" in at_work, setup.dem is None, coupling), ground.land["lai"].values
    if key not in ground.known:
        ground.known[key] = reflectance(lai) if key[0] else along_tangent(reflectance, lai, ground.middle)
    seen = ground.known[key]
    if "atmosphere" in at_work:
        seen = _seen(scene, seen, coupling) if setup.adjacency or coupling != "lambert" else driver.toa(seen)
    if at_work & {"clouds", "shadows"}:
        seen = _under_clouds(scene, seen, at_work)
    if scene.retrieval is not None:
        return seen
    return np.concatenate([seen, driver.ndvi(seen, "non-linearity" not in at_work)[None]])


def _under_clouds(scene, clear, at_work):
    """Reflectance with clouds or shadows thinner than the mask, NaN where they are thicker, shape (band, y, x)."""
    (seen, *lit), tables = scene.columns
    if "atmosphere" not in at_work:
        tables = tables._replace(path=np.zeros_like(tables.path))
    seen = seen if "clouds" in at_work else np.zeros_like(seen)
    lit = lit if "shadows" in at_work else [np.zeros_like(seen)] * 2
    found = under_clouds(np.moveaxis(clear, 0, -1), seen, *lit, sky=tables)
    return np.where(np.maximum(seen, lit[0]) < scene.scenario.clouds.mask, found, np.nan)


def _seen(scene, reflectance, coupling):
    """Apparent reflectance, shape (band, y, x), of a reflectance or its streams by a coupling, or with adjacency."""
    own, streams = scene.setup, coupled_ground.STREAMS_OF.get(coupling)
    coords = {"band": list(scene.driver.setup.bands)} | ({"stream": list(streams)} if streams else {})
    array = xr.DataArray(reflectance, dims=("stream", "band", "y", "x")[-reflectance.ndim :], coords=coords)
    given = {"geometry": own.geometry, "instrument": own.instrument, "adjacency": own.adjacency, "coupling": coupling}
    return to_toa(grids.place(array, scene.grid), scene.driver.air, **given).values


def along_tangent(function, lai, middle):
    """A function of leaf area along its tangent at the middle, arrays over (y, x)."""
    low, high = np.maximum(middle - STEP, 0.0), middle + STEP
    return function(middle) + (function(high) - function(low)) / (high - low) * (lai - middle)


def _with_data(stages, images, truth, even, even_truth):
    """Pixels with data in every image and truth, on one axis."""
    rasters = (images, truth, even, np.array(even_truth))
    found = np.logical_and.reduce([np.isfinite(each).reshape(-1, *even.shape).all(axis=0) for each in rasters])
    if found.sum() < 3:
        raise ValueError(
            f"{found.sum()} pixels have data in every image, a regression needs 3: simulate a larger scene"
        )
    # Stages that are ideal already have an axis of one.
    kept = [axis for axis, stage in enumerate(STAGES) if stage in stages]
    ndvi = images[..., found].reshape(*(images.shape[axis] for axis in kept), -1)
    by_name = dict(zip(VARIABLES, np.moveaxis(truth[..., found], -2, 0), strict=True))
    truths = {name: values.reshape(*(truth.shape[axis] for axis in kept), -1) for name, values in by_name.items()}
    even_truths = {name: values[found] for name, values in zip(VARIABLES, even_truth, strict=True)}
    return Pixels(stages, ndvi, truths, even[found], even_truths)
