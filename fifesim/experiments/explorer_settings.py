"""Settings of the sliders of an interactive page, and the results of each setting: images, truth, lines and budgets."""

import math
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.analysis import regression
from fifesim.analysis.scaling import shapley
from fifesim.base.bands import NEAR_INFRARED, RED, nearest_band
from fifesim.chain.landscapes import aggregate
from fifesim.chain.setup import image_of, reflectance_of
from fifesim.experiments.scatter.shares import unexplained
from fifesim.experiments.scatter.stages import STAGES, VARIABLES, displaced_pixels, working_stages
from fifesim.grids import grid as grids
from fifesim.scenario.ground import elevation, ground_scene, truth_of
from fifesim.scenario.scenario import Scenario, default_scenario, grid_keys, parse_scenario
from fifesim.scenario.simulation import setup_of
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response import calibration

# The value of the scenario replaces the nearest of these.
_VALUES = {
    "arp": (0.15, 0.24, 0.249),
    "visibility": (10.0, 23.0, 45.0),
    "aot": (0.05, 0.2, 0.5),
    "sza": (20.0, 40.0, 60.0),
}
_INSTRUMENTS = ("MSI", "HRV", "TM", "MSS")
# Eastward displacement of the footprints. [pixel]
_DISPLACEMENTS = (0.0, 0.25, 0.5, 1.0)

# Edge length of the ground on a page. [m]
_SIDE = 900.0
# Pixels along the edge: enough for a regression, and few enough for the size of the page.
_FEWEST, _WANTED, _MOST = 12, 30, 100
# The number of simulations doubles with each stage. Beyond this number of stages, sliders have fewer values.
_MANY = 8
# Cells along the edge, if this leaves enough pixels.
_MOST_CELLS = 400


@dataclass(frozen=True)
class Setting:
    """Values of all sliders except registration; arp is None for a map or a learned landscape, haze without aerosol."""

    arp: float | None
    haze: float | None
    sza: float
    instrument: str


@dataclass(frozen=True, eq=False)
class Sweep:
    """Scenarios of all settings of a page."""

    scenario: Scenario  # of the ground on the page
    haze: str  # key of the haze: visibility or aot
    arps: tuple
    hazes: tuple
    szas: tuple
    instruments: tuple
    offsets: tuple  # registration errors southward and eastward [pixel]

    @property
    def shape(self):
        """Number of values of arp, haze, sza, instrument and offset."""
        return tuple(map(len, (self.arps, self.hazes, self.szas, self.instruments, self.offsets)))

    @property
    def settings(self):
        """All settings; the last slider changes fastest."""
        return [Setting(*values) for values in product(self.arps, self.hazes, self.szas, self.instruments)]

    def at(self, setting, offset=(0.0, 0.0)):
        """Complete scenario of a setting."""
        return parse_scenario(self.values(setting, offset)).complete()

    def values(self, setting, offset=(0.0, 0.0)):
        """Keys of the scenario of a setting that differ from the defaults, as tables."""
        values = self.scenario.model_dump(exclude_unset=True)
        sun = self.scenario.sun_and_view()
        changed = {
            "ground": {} if setting.arp is None else {"arp": setting.arp},
            "atmosphere": {} if setting.haze is None else {self.haze: setting.haze},
            "geometry": {"sza": setting.sza, "saa": sun.saa},
        }
        values |= {name: values.get(name, {}) | keys for name, keys in changed.items() if keys}
        values["sensor"] = _sensor_keys(self.scenario, setting.instrument) | {"offset": list(offset)}
        return values


def sweep_of(scenario=None):
    """Sliders of a scenario, by default the default one, with its values and others around them."""
    # Where more than eight stages share the scatter, as in a landscape of classes, haze, sun and instrument have two
    # values.
    scenario = scenario or default_scenario()
    scenario.complete()
    scenario = scenario.model_copy(update={"grid": _window(scenario)})
    scenario = parse_scenario(scenario.model_dump(exclude_unset=True))
    land, air, own = scenario.ground, scenario.atmosphere, scenario.sensor
    haze = "visibility" if air.aot is None else "aot"
    fixed_air = air.aerosol == "none"
    sweep = Sweep(
        scenario=scenario,
        haze=haze,
        arps=(None,) if scenario.learned or land.lai_file else _with_own("arp", land.arp),
        hazes=(None,) if fixed_air else _with_own(haze, getattr(air, haze)),
        szas=_with_own("sza", scenario.sun_and_view().sza),
        instruments=(own.instrument,),
        offsets=_offsets(own.offset),
    )
    sweep = replace(sweep, instruments=_instruments(sweep))
    return _with_fewer_values(sweep) if len(_stages(sweep)) > _MANY else sweep


def _stages(sweep):
    """Stages that are active in any setting."""
    own = sweep.scenario
    displaced = own.sensor.model_copy(update={"offset": list(sweep.offsets[-1])})
    return working_stages(own.model_copy(update={"sensor": displaced}))


def _with_fewer_values(sweep):
    """Sliders of haze, sun and instrument with the value of the scenario and the value farthest from it."""
    own, first = sweep.scenario, sweep.settings[0]
    sizes = {name: math.log(sweep.at(replace(first, instrument=name)).sensor.size) for name in sweep.instruments}
    name = own.sensor.instrument
    far = max(sizes, key=lambda each: abs(sizes[each] - sizes[name]))
    hazes = _farthest(sweep.hazes, getattr(own.atmosphere, sweep.haze)) if None not in sweep.hazes else sweep.hazes
    szas = _farthest(sweep.szas, own.sun_and_view().sza)
    instruments = tuple(each for each in sizes if each in (name, far))
    return replace(sweep, hazes=hazes, szas=szas, instruments=instruments)


def _farthest(values, own):
    far = max(values, key=lambda value: abs(value - own))
    return tuple(value for value in values if value in (own, far))


def _with_own(name, own):
    """Values of a slider in order, with the value of the scenario in place of the nearest one."""
    values = _VALUES[name]
    nearest = min(values, key=lambda value: abs(value - own))
    return tuple(sorted(own if value == nearest else value for value in values))


def _offsets(own):
    """Registration errors of the slider, one of which is the offset of the scenario. [pixel]"""
    size = math.hypot(*own)
    nearest = min(_DISPLACEMENTS[1:], key=lambda value: abs(value - size)) if size else None
    found = [tuple(own) if value == nearest else (0.0, value) for value in _DISPLACEMENTS]
    return tuple(sorted(found, key=lambda offset: math.hypot(*offset)))


def _instruments(sweep):
    """Names of the instruments whose pixels fit the grid and its cells, from small to large pixels."""
    own, first = sweep.instruments[0], sweep.settings[0]
    edge = min(sweep.scenario.geobox().shape) * sweep.scenario.grid.cell
    others = [name for name in _INSTRUMENTS if instrument(name).name != instrument(own).name]
    found = {}
    for name in (own, *others):
        try:
            size = sweep.at(replace(first, instrument=name)).sensor.size
        except ValueError:
            # Leaf optics for the bands of another instrument, or pixels smaller than a cell.
            if name == own:
                raise
            continue
        if name == own or _FEWEST <= round(edge / size, 6) <= _MOST:
            found[name] = size
    return tuple(sorted(found, key=found.get))


def _sensor_keys(scenario, name):
    """Keys of the sensor section: all for the instrument of the scenario, else only those independent of bands."""
    own = scenario.sensor.model_dump(exclude_unset=True)
    if name == scenario.sensor.instrument:
        return own
    kept = {key: own[key] for key in ("seed", "min_valid") if key in own}
    if scenario.sensor.noise and all(band.noise for band in instrument(name).red_and_near_infrared()):
        kept["noise"] = ["all"]
    return {"instrument": name} | kept


def _window(scenario):
    """Keys of the grid that a page shows, in the middle of the grid of a scenario."""
    box, size, cell = scenario.geobox(), scenario.sensor.size, max(grids.cell_size(scenario.geobox()))
    side = max(_FEWEST * size, min(max(_SIDE, _WANTED * size), _MOST_CELLS * cell))
    if min(box.shape) * cell < _FEWEST * size * (1 - 1e-9):
        raise ValueError(
            f"grid: {grids.in_words(box)} holds fewer than {_FEWEST} x {_FEWEST} pixels of {size:g} m: "
            "type a larger width and height"
        )
    step = max(round(size / cell), 1)
    shape = tuple(min(int(side / cell + 1e-6), count) for count in box.shape)
    first = [(count - held) // 2 // step * step for count, held in zip(box.shape, shape, strict=True)]
    return grid_keys(GeoBox(shape, box[first[0] :, first[1] :].affine, box.crs))


# Statistics of each line, in this order.
LINE_NUMBERS = ("slope", "intercept", "r2", "n")


@dataclass(frozen=True, eq=False)
class Camera:
    """Instrument of a page: scenario, red and near infrared band, and reflectance of every digital number."""

    scenario: object
    bands: list
    reflectance: np.ndarray


@dataclass(frozen=True, eq=False)
class Outcomes:
    """
    Results that a page shows.

    Attributes
    ----------
    scenes : array, shape (arp, rows, columns)
        Leaf area of the cells. [m2 m-2]
    cameras : list of Camera
        By instrument.
    images : list of array, shape (arp, haze, sza, offset, 2, rows, columns)
        Digital numbers in red and near infrared, by instrument.
    truths : list of array, shape (arp, sza, 2, rows, columns)
        LAI and FPAR of the ground of the pixels, by instrument.
    lines : array, shape (arp, haze, sza, instrument, offset, 2, 4)
        Regression of LAI and FPAR on NDVI, in the order of `LINE_NUMBERS`. Slope and intercept are NaN if NDVI is
        constant.
    shares : array, shape (arp, haze, sza, instrument, offset, 2, stages)
        Shares of the stages in the unexplained variance. [1]
    curvature : array, shape (arp, haze, sza, instrument, offset, 2)
        Unexplained variance with all stages ideal. [1]
    """

    scenes: np.ndarray
    cameras: list
    images: list
    truths: list
    lines: np.ndarray
    shares: np.ndarray
    curvature: np.ndarray


def outcomes_of(sweep, each=iter):
    """Simulate every setting of a page."""
    found = [_one(sweep, setting) for setting in each(sweep.settings)]
    cameras, cells, truths, images, lines, shares, curvature = zip(*found, strict=True)
    shape = sweep.shape
    numbers = np.reshape(np.arange(len(found)), shape[:-1])

    def by_instrument(values):
        """Values of the settings as one array for each instrument, shape (arp, haze, sza, ...)."""
        of_each = [[values[number] for number in numbers[..., k].ravel()] for k in range(shape[3])]
        return [np.reshape(own, (*shape[:3], *np.shape(own[0]))) for own in of_each]

    return Outcomes(
        scenes=np.stack([cells[number] for number in numbers[:, 0, 0, 0]]),
        cameras=[cameras[number] for number in numbers[0, 0, 0]],
        images=by_instrument(images),
        truths=[truth[:, 0] for truth in by_instrument(truths)],
        lines=np.reshape(lines, (*shape, len(VARIABLES), len(LINE_NUMBERS))),
        shares=np.reshape(shares, (*shape, len(VARIABLES), len(STAGES))),
        curvature=np.reshape(curvature, (*shape, len(VARIABLES))),
    )


def _one(sweep, setting):
    """Camera, cells, truth, and by offset images, lines, shares and curvature of a setting."""
    scenario = sweep.at(setting)
    budgets = [_budget(seen) for seen in displaced_pixels(scenario, sweep.offsets)]
    return *_images(scenario, sweep.offsets), *zip(*budgets, strict=True)


def _images(scenario, offsets):
    """Camera, leaf area of the cells, LAI and FPAR of the pixels, and digital numbers of both bands at each offset."""
    grid, setup = scenario.geobox(), setup_of(scenario)
    dem, horizon, _ = elevation(scenario, grid)
    land = ground_scene(scenario, grid)
    truth = aggregate(
        xr.Dataset(truth_of(scenario, setup, land))[list(VARIABLES)], scenario.sensor.size, min_valid=setup.min_valid
    )
    setup = replace(setup, dem=dem, horizon=horizon)
    reflectance = reflectance_of(setup, land).compute()
    seen = [image_of(replace(setup, offset=offset), reflectance, land) for offset in offsets]
    pair = [nearest_band(seen[0]["wavelength"].values, window) for window in (RED, NEAR_INFRARED)]
    # The image and the blocks of the truth are paired by row and column.
    rows, columns = (min(seen[0].sizes[axis], truth.sizes[axis]) for axis in ("y", "x"))
    means = np.stack([truth[name].values[:rows, :columns] for name in VARIABLES])
    pairs = [image.isel(band=pair).values[:, :rows, :columns] for image in seen]
    return _camera(scenario, seen[0].isel(band=pair)), land["lai"].values, means, pairs


def _budget(seen):
    """Regression lines, shares of the stages and curvature, each by variable."""
    count = len(seen.stages)
    lines, shares, curvature = [], np.zeros((len(VARIABLES), len(STAGES))), []
    ndvi = seen.ndvi[(-1,) * count]
    for k, name in enumerate(VARIABLES):
        lines.append(_line(seen.truth[name][(-1,) * count], ndvi))
        scatter = unexplained(seen.truth[name], seen.ndvi)
        # A stage that is ideal already changes nothing.
        shares[k, [list(STAGES).index(stage) for stage in seen.stages]] = shapley(scatter, count)
        curvature.append(scatter[(0,) * count])
    return lines, shares, curvature


def _line(truth, ndvi):
    """Statistics of the least-squares line of a truth on NDVI; slope and intercept are NaN where NDVI is constant."""
    if np.ptp(ndvi) == 0:
        return [np.nan, np.nan, 0.0, ndvi.size]
    origins = truth.mean(), ndvi.mean()
    line = regression.fit(regression.row_sums(truth[None], ndvi[None], *origins), *origins)
    return [getattr(line, number) for number in LINE_NUMBERS]


def _camera(scenario, image):
    """Camera of a page from an image of its two bands."""
    scales = {name: image[name].values[:, None] for name in ("gain", "offset", "solar_irradiance")}
    compression = image["compression"].values[:, None] if "compression" in image.coords else 0
    counts = np.arange(2**scenario.sensor.description.bits)
    radiance = calibration.dn_to_radiance(counts, scales["gain"], scales["offset"], compression)
    distance = scenario.sun_and_view().earth_sun_distance
    overhead = calibration.radiance_to_reflectance(radiance, scales["solar_irradiance"], 1.0, distance)
    return Camera(scenario, image["band"].values.tolist(), overhead)
