"""Images of a scene with any of its stages at their ideal."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.analysis import indices
from fifesim.analysis.rasters.indices import red_and_nir
from fifesim.analysis.rasters.means import aggregate
from fifesim.base.line_spread import Boxcar
from fifesim.chain import steps as chain
from fifesim.chain.setup import Setup, reflectance_of
from fifesim.experiments.scatter.blocks import middle_cells, spread_out
from fifesim.experiments.scatter.cells import Stand, arrays_of, tangent
from fifesim.experiments.scatter.grounds import PROPERTIES, ground_with, varying
from fifesim.experiments.scatter.sensed import images_of
from fifesim.rasters import grid as grids
from fifesim.scenario.ground import absorbed_light
from fifesim.scenario.land import elevation, in_memory
from fifesim.scenario.scenario import Scenario
from fifesim.scenario.simulation import setup_of
from fifesim.sensor.response.rasters.pixels import pixel_grid

# In this order along the axes of what `pixels` gives.
STAGES = {
    "non-linearity": "reflectance and FPAR of a cell go with its LAI along the tangent at the mean LAI of its pixel",
    "NDVI scaling": "mean of the NDVI of the cells instead of the NDVI of their mean reflectance",
    "point spread": "all cells of a pixel count the same",
    "registration": "pixels lie on the blocks of the truth",
    "quantisation": "radiance instead of digital numbers",
    "noise": "none",
    "topography": "level ground",
    "atmosphere": "reflectance at the ground",
} | PROPERTIES
# What of the ground changes its leaf area, or the light that that absorbs, in their order.
_TRUE = ("cover", "clumping", "covariance")
_SENSED = ("NDVI scaling", "point spread", "registration", "quantisation", "noise")
VARIABLES = ("lai", "fpar")


@dataclass(frozen=True, eq=False)
class Pixels:
    """
    Pixels of a scene under every set of its stages.

    Parameters
    ----------
    stages : tuple of str
        Those that are not ideal already, in the order of `STAGES`.
    ndvi : array, shape (2,) * len(stages) + (n,)
        Index 1 where the stage is at work, 0 where it is ideal. [1]
    truth : dict of str to array, shape as ``ndvi`` or 1 along its axes
        True LAI and FPAR.
    homogeneous_ndvi : array, shape (n,)
        With all stages, over ground that is uniform within each pixel.
    homogeneous_truth : dict of str to array, shape (n,)
    """

    stages: tuple
    ndvi: np.ndarray
    truth: dict
    homogeneous_ndvi: np.ndarray
    homogeneous_truth: dict


def working_stages(scenario):
    """
    Stages of a scenario that are not ideal already.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    stages : tuple of str
        In the order of `STAGES`.
    """
    own, size = scenario.sensor, scenario.sensor.size
    bands = own.description.select(own.bands)
    spreads = [spread for band in bands for spread in own.description.line_spreads(band)]
    ideal = {
        "point spread": all(isinstance(spread, Boxcar) and spread.width == size for spread in spreads),
        "registration": own.interval in ("product", size) and not any(own.offset),
        "noise": not own.noise,
        "topography": scenario.terrain.dem == "flat",
    }
    ideal |= {name: name not in varying(scenario) for name in PROPERTIES}
    return tuple(stage for stage in STAGES if not ideal.get(stage, False))


def pixels(scenario):
    """
    Pixels of a scene with each set of its stages at work and the others ideal, from the same random numbers.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    pixels : Pixels
        Those with data in every image, paired by row and column.

    Raises
    ------
    ValueError
        If the bands have no red or no near infrared, or fewer than three pixels have data.
    """
    return displaced_pixels(scenario, [scenario.sensor.offset])[0]


def displaced_pixels(scenario, offsets):
    """
    `pixels` at several registration errors: the light that leaves the ground and the air is computed once.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
    offsets : sequence of (float, float)
        In the place of the scenario's, southward and eastward. [pixel]

    Returns
    -------
    pixels : list of Pixels
    """
    sensors = [scenario.sensor.model_copy(update={"offset": list(offset)}) for offset in offsets]
    stages = [working_stages(scenario.model_copy(update={"sensor": sensor})) for sensor in sensors]
    scene = _scene(scenario)
    scenes = [replace(scene, setup=replace(scene.setup, offset=tuple(offset))) for offset in offsets]
    # False is ideal, True at work.
    switches = [{name: (False, True) if name in each else (False,) for name in STAGES} for each in stages]
    lit, images = [name for name in STAGES if name not in _SENSED], [[] for _ in scenes]
    for states in _states(switches[0], lit):
        at_work = {name for name, state in zip(lit, states, strict=True) if state}
        cells = _cells(scene, scene.ground(at_work), at_work)
        for found, one, each in zip(images, scenes, switches, strict=True):
            found.append(images_of(one, cells, [each[name] for name in _SENSED]))
    truths, even = _truths(scene, switches[0]), _even(scene)
    even_cells, even_truth = _cells(scene, even, set(stages[0])), _truth(scene, even, True)
    found = []
    for k, one in enumerate(scenes):
        of_even = images_of(one, even_cells, [switches[k][name][-1:] for name in _SENSED]).reshape(scene.shape)
        found.append(_with_data(stages[k], _in_order(images[k], switches[k], lit), truths, of_even, even_truth))
    return found


def _in_order(images, switches, lit):
    """Images of all states with the axes of `STAGES` first."""
    order = [*lit, *_SENSED]
    images = np.reshape(images, (*(len(switches[name]) for name in order), *np.shape(images)[-2:]))
    return np.moveaxis(images, [order.index(name) for name in STAGES], range(len(STAGES)))


@dataclass(frozen=True, eq=False)
class _Ground:
    """What varies over the cells, and the mean leaf area of the pixel that each lies in."""

    land: xr.Dataset
    middle: xr.DataArray
    stand: Stand | None = None


@dataclass(frozen=True, eq=False)
class _Scene:
    """A scenario, and the instrument over it."""

    scenario: Scenario
    setup: Setup
    bands: tuple
    grid: GeoBox
    blocks: GeoBox
    image: GeoBox
    grounds: dict = field(default_factory=dict)

    @property
    def shape(self):
        """Rows and columns that the image and the blocks of the truth share."""
        return tuple(min(pair) for pair in zip(self.blocks.shape, self.image.shape, strict=True))

    def ground(self, at_work):
        """The ground with some stages at work, made once."""
        kind = frozenset(at_work) & set(PROPERTIES)
        if kind not in self.grounds:
            land = ground_with(self.scenario, self.grid, kind, self.setup.dem)
            self.grounds[kind] = self.made(land, self.spread_out(land["lai"]))
        return self.grounds[kind]

    @cached_property
    def arrays(self):
        """The chain and the slopes of one stand, where plain arrays do."""
        return arrays_of(self.setup, self.bands, self.grid)

    def made(self, land, middle):
        """A ground, as arrays too where they do."""
        chain, slopes = self.arrays
        if chain is None or set(land.data_vars) != {"lai"}:
            return _Ground(land, middle)
        fpar_inf = self.scenario.ground.fpar_inf
        return _Ground(land, middle, Stand(chain, slopes, land["lai"].values, middle.values, fpar_inf))

    def spread_out(self, cells):
        """Means over the pixels of the truth, on the cells."""
        return spread_out(cells, self.blocks, self.setup.min_valid)


def _scene(scenario):
    setup, grid = setup_of(scenario), scenario.geobox()
    bands = _red_and_nir(setup.instrument.select(setup.bands))
    blocks = grids.aligned(grid, scenario.sensor.size)
    image = pixel_grid(grid, setup.instrument, bands, setup.onto, setup.interval)
    # In memory: every set of stages with topography asks for them.
    dem, horizon = in_memory(*elevation(scenario, grid)[:2])
    return _Scene(scenario, replace(setup, dem=dem, horizon=horizon), bands, grid, blocks, image)


def _even(scene):
    """The ground with all stages at work, but uniform within each pixel: means, and the class in the middle."""
    whole = scene.ground(PROPERTIES)
    land = {name: scene.spread_out(each) for name, each in whole.land.items() if name != "cover" and each.ndim == 2}
    if "cover" in whole.land:
        land["cover"] = middle_cells(whole.land["cover"], scene.blocks)
    return scene.made(whole.land.assign(land), whole.middle)


def _red_and_nir(bands):
    """The two bands of NDVI."""
    coords = {"wavelength": ("band", [band.wavelength for band in bands])}
    numbers = xr.DataArray(np.arange(len(bands))[:, None, None], dims=("band", "y", "x"), coords=coords)
    return tuple(bands[number.item()] for number in red_and_nir(numbers))


def _truths(scene, switches):
    """LAI and FPAR by blocks, shape (one axis for each stage, variable, y, x)."""
    kinds = [
        [name for name, at_work in zip(_TRUE, states, strict=True) if at_work] for states in _states(switches, _TRUE)
    ]
    found = [[_truth(scene, scene.ground(kind), curve) for kind in kinds] for curve in (0, 1)]
    shape = [len(switches[name]) if name in ("non-linearity", *_TRUE) else 1 for name in STAGES]
    return np.reshape(found, (*shape, len(VARIABLES), *scene.shape))


def _states(switches, names):
    """All states of some stages."""
    return product(*(switches[name] for name in names))


def _truth(scene, ground, curve):
    """LAI and FPAR by blocks."""
    setup, stand = _setup_over(scene, ground), ground.stand
    if stand is not None:
        size, (rows, columns) = grids.cell_size(scene.blocks)[0], scene.shape
        return [stand.chain.means(each, size)[:rows, :columns] for each in (stand.lai, stand.fpar(bool(curve)))]

    def fpar(area):
        return absorbed_light(scene.scenario, setup, ground.land.assign(lai=area))

    lai, size, (rows, columns) = ground.land["lai"], grids.cell_size(scene.blocks)[0], scene.shape
    return [
        aggregate(array, size, min_valid=scene.setup.min_valid).values[:rows, :columns]
        for array in (lai, fpar(lai) if curve else tangent(fpar, lai, ground.middle))
    ]


def _setup_over(scene, ground):
    """The setup without the properties of the canopy that its cells have."""
    given = scene.setup.canopy.given & set(ground.land.data_vars)
    return replace(scene.setup, canopy=scene.setup.canopy.replace(**dict.fromkeys(given)))


def _cells(scene, ground, at_work):
    """Red, near infrared and NDVI of the cells, as light leaves the ground or the air, shape (3, y, x)."""
    if ground.stand is not None:
        light = [name in at_work for name in ("non-linearity", "topography", "atmosphere")]
        red, nir = ground.stand.light(*light)
        return np.stack([red, nir, indices.normalized_difference(nir, red)])
    setup = _setup_over(scene, ground)
    setup = setup if "topography" in at_work else replace(setup, dem=None, horizon=None)

    def reflectance(area):
        return reflectance_of(setup, ground.land.assign(lai=area))

    lai = ground.land["lai"]
    seen = reflectance(lai) if "non-linearity" in at_work else tangent(reflectance, lai, ground.middle)
    if "atmosphere" in at_work:
        seen = chain.to_toa(seen, adjacency=setup.adjacency)
    red, nir = red_and_nir(seen)
    return np.stack([red.values, nir.values, indices.normalized_difference(nir.values, red.values)])


def _with_data(stages, images, truth, even, even_truth):
    """The pixels that have data in every image and truth, on one axis."""
    rasters = (images, truth, even, np.array(even_truth))
    found = np.logical_and.reduce([np.isfinite(each).reshape(-1, *even.shape).all(axis=0) for each in rasters])
    if found.sum() < 3:
        raise ValueError(f"{found.sum()} pixels have data in every image, and a line needs 3: simulate a larger scene")
    # Stages that are ideal already have an axis of one.
    kept = [axis for axis, stage in enumerate(STAGES) if stage in stages]
    ndvi = images[..., found].reshape(*(images.shape[axis] for axis in kept), -1)
    by_name = dict(zip(VARIABLES, np.moveaxis(truth[..., found], -2, 0), strict=True))
    truths = {name: values.reshape(*(truth.shape[axis] for axis in kept), -1) for name, values in by_name.items()}
    even_truths = {name: values[found] for name, values in zip(VARIABLES, even_truth, strict=True)}
    return Pixels(stages, ndvi, truths, even[found], even_truths)
