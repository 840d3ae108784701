"""Results for all settings of an interactive page: digital numbers, truth, regressions and budgets."""

from dataclasses import dataclass, replace

import numpy as np

from fifesim.analysis import regression
from fifesim.analysis.scaling import shapley
from fifesim.base.bands import NEAR_INFRARED, RED, nearest_band
from fifesim.chain.landscapes import aggregate
from fifesim.chain.setup import image_of, reflectance_of
from fifesim.experiments.scatter.shares import unexplained
from fifesim.experiments.scatter.stages import STAGES, VARIABLES, displaced_pixels
from fifesim.scenario.ground import elevation, ground_scene, truth_of
from fifesim.scenario.simulation import setup_of
from fifesim.sensor.response import calibration

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
    land = ground_scene(scenario, grid, dem=dem)
    truth = aggregate(truth_of(scenario, setup, land)[list(VARIABLES)], scenario.sensor.size, min_valid=setup.min_valid)
    reflectance = reflectance_of(replace(setup, dem=dem, horizon=horizon), land).compute()
    seen = [image_of(replace(setup, offset=offset), reflectance) for offset in offsets]
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
