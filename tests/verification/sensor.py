"""Checks of the sensor: images by quadrature, line spreads, calibration, bands, noise and scans."""

from functools import partial

import numpy as np
import pyproj
import xarray as xr
from scipy.integrate import quad, trapezoid
from scipy.signal import butter, freqs
from scipy.stats import norm

from fifesim.base.bands import Band, solar_irradiance_steps, solar_spectrum
from fifesim.base.footprints import Boxcar, axis_operator, regularize
from fifesim.base.geometry import fife_geometry
from fifesim.grids import grid as grids
from fifesim.grids.reductions import areas, regularized
from fifesim.sensor.response import calibration, scan
from fifesim.sensor.response.noise import NoiseModel, add_noise, fixed_pattern, line_noise
from fifesim.sensor.response.scan import Footprints, apply_operator, footprint_operator
from fifesim.sensor.response.spatial import (
    AggregatedSpread,
    CosineSpread,
    Diffraction,
    GaussianSpread,
    LowPass,
    SystemSpread,
    TableSpread,
)
from fifesim.sensor.scan_labels import scan_geometry, sense_swath
from verification.tables import Deviation, integral, largest

_deviation = partial(Deviation, "sensor")

_TABLE = (-31.0, -12.5, 4.0, 38.0), (0.0, 0.4, 1.0, -0.1)
_EVEN = (-21.0, -9.0, 9.0, 21.0)


def _trapezoid(x):
    return np.minimum((21.0 - np.abs(x)) / 12.0, 1.0)


# Line spread, density by its definition, kinks of the density, and bound: a Gaussian is cut, and a product is a table
# that rounds its kinks.
_SHAPES = {
    "cosine": (CosineSpread(30.0), lambda x: np.cos(2 * np.pi * x / 90.0), (-15.0, 15.0), 1e-9),
    "boxcar": (Boxcar(30.0), lambda x: 1.0 + 0 * x, (-15.0, 15.0), 1e-9),
    "Gaussian": (GaussianSpread(33.0), lambda x: 2.0 ** -((2 * x / 33.0) ** 2), (-85.0, 0.0, 85.0), 1e-8),
    "uneven table": (TableSpread(*_TABLE), lambda x: np.interp(x, *_TABLE), _TABLE[0], 1e-9),
    "even table": (TableSpread(_EVEN, (0.0, 1.0, 1.0, 0.0)), _trapezoid, _EVEN, 1e-9),
    "two boxcars": (SystemSpread((Boxcar(30.0), Boxcar(12.0)), 1e-9), _trapezoid, _EVEN, 2e-5),
}


def _transform(density, kinks, frequency):
    """Fourier transform of a density."""
    turn = 2 * np.pi * frequency
    even = integral(lambda x: density(x) * np.cos(turn * x), kinks)
    return even - 1j * integral(lambda x: density(x) * np.sin(turn * x), kinks)


def _shapes():
    """Check shares and transfer functions of each shape, and that the support holds the whole response."""
    ends = 0.0
    for name, (spread, density, kinks, bound) in _SHAPES.items():
        whole = integral(density, kinks)
        shares = [integral(density, [*(k for k in kinks if k < x), x]) / whole for x in (-14.0, 3.0, 14.5)]
        transfers = np.array([_transform(density, kinks, f) for f in (1 / 200, 1 / 60, 1 / 23)]) / whole
        # The modulus, where the response is not even.
        transfers = np.abs(transfers) if name == "uneven table" else transfers.real
        found = [*spread.cumulative([-14.0, 3.0, 14.5]), *spread.mtf([1 / 200, 1 / 60, 1 / 23])]
        worst = largest(found, [*shares, *transfers])
        yield _deviation(f"line spread and transfer, {name}", worst, bound, "1", "its density, quadrature")
        reach = spread.half_width
        ends = np.maximum(ends, largest(spread.cumulative([-reach - 1, -reach, reach, reach + 1]), [0, 0, 1, 1]))
    yield _deviation("line spreads between their ends", ends, 1e-12, "1", "theory")


def _parts():
    """Check the transfer of an aperture by its self-overlap, of a filter by its poles, and of two Gaussians by one."""
    nu = np.array([0.0, 0.2, 0.55, 0.9, 1.3])
    overlap = [4 / np.pi * quad(lambda t: np.sqrt(1 - t * t), min(each, 1), 1)[0] for each in nu]
    worst = largest(Diffraction(0.4).mtf(-0.4 * nu), overlap)
    yield _deviation("transfer of an aperture", worst, 1e-9, "1", "overlap of two disks, quadrature")
    frequency = np.array([0.001, 0.01, 0.03])
    poles = [abs(freqs(*butter(n, 0.01, analog=True), frequency)[1]) for n in (1, 3)]
    worst = largest([LowPass(0.01, n).mtf(frequency) for n in (1, 3)], poles)
    yield _deviation("transfer of electronics", worst, 1e-12, "1", "poles, scipy.signal")
    system = SystemSpread((Diffraction(0.5), GaussianSpread(3.0)), 2e-3)
    tail = 4 / (np.pi**3 * 0.5 * system.half_width)
    worst = 100 * largest(system.truncated_share, tail, relative=True)
    yield _deviation("share of an aperture's response cut off", worst, 2.0, "%", "Struve's asymptote")
    both = SystemSpread((GaussianSpread(30.0), GaussianSpread(40.0)), 1e-6)
    x = np.linspace(-60.0, 60.0, 13)
    worst = largest(both.cumulative(x), norm.cdf(x, scale=50.0 / np.sqrt(8 * np.log(2))))
    yield _deviation("line spread of two Gaussians", worst, 1e-5, "1", "their variances add")


_WIDTH = 9 * 4.778e-6 * 705e3  # of TM's line spread [m]
_PIXEL = 30.0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(40)


def _weights(cells, cell, pixels, origin):
    """Weights of cells in pixels, shape (pixels, cells): integrals of the line spread function over the cells."""
    left = np.arange(cells) * cell - (origin + (np.arange(pixels) + 0.5) * _PIXEL)[:, None]
    low, high = np.clip([left, left + cell], -_WIDTH / 2, _WIDTH / 2)
    middle, half = (low + high) / 2, (high - low) / 2
    density = np.cos(2 * np.pi * (middle[..., None] + half[..., None] * _NODES) / (3 * _WIDTH))
    area = _WIDTH / 2 * np.sum(_WEIGHTS * np.cos(np.pi * _NODES / 3))
    return half * (density @ _WEIGHTS) / area


def _holes():
    """Check shifted pixels that reach beyond the cells on every side, over cells in chunks with holes."""
    cells = grids.grid_at("EPSG:26914", 705600.0, 4334000.0, 300.0, 250.0, 10 / 3)
    pixels = grids.grid_at("EPSG:26914", 705572.0, 4334019.0, 360.0, 300.0, _PIXEL)
    scene = np.random.default_rng(3).uniform(1, 2, tuple(cells.shape))
    scene[::7, ::5] = np.nan
    array = grids.place(xr.DataArray(scene, dims=("y", "x")), cells).chunk(y=20, x=31)
    image = regularized(array, (CosineSpread(_WIDTH),) * 2, pixels, shifts=(5.5, 7.25), min_valid=0.3).values
    rows, columns = _weights(75, 10 / 3, 10, -19 + 5.5), _weights(90, 10 / 3, 12, -28 + 7.25)
    share = rows @ np.isfinite(scene).astype(float) @ columns.T
    with np.errstate(invalid="ignore"):
        expected = np.where(share >= 0.3, rows @ np.nan_to_num(scene) @ columns.T / share, -1.0)
    found = largest(np.nan_to_num(image, nan=-1.0), expected)
    yield _deviation("image of a scene with holes, on another grid", found, 1e-12, "1", "sums over quadrature")


def _blocks():
    """Check block means where pixel edges equal cell edges except for rounding, as with thirds of 3.3 m."""
    cells = grids.grid_at("EPSG:26914", 705500.0, 4334000.0, 198.0, 148.5, 1.1)
    values = np.random.default_rng(1).uniform(1, 2, tuple(cells.shape))
    pixels = grids.aligned_grid(cells, 3.3)
    image = regularized(grids.place(xr.DataArray(values, dims=("y", "x")), cells), areas(pixels), pixels, min_valid=1.0)
    worst = largest(image, values.reshape(45, 3, 60, 3).mean(axis=(1, 3)))
    yield _deviation("means over blocks of cells", worst, 1e-12, "1", "numpy")


def _radiances():
    """Check that a Lambertian surface reflects as much as it radiates."""
    reflectance, irradiance, mu_s, distance = 0.3, 1536.0, 0.7, 1.0148
    radiance = calibration.reflectance_to_radiance(reflectance, irradiance, mu_s, distance)
    sent = quad(lambda theta: 2 * np.pi * float(radiance) * np.cos(theta) * np.sin(theta), 0, np.pi / 2)[0]
    received = irradiance * mu_s / distance**2
    back = calibration.radiance_to_reflectance(radiance, irradiance, mu_s, distance)
    worst = largest([sent / received, back], reflectance)
    yield _deviation("radiance of a Lambertian surface", worst, 1e-12, "1", "its exitance, quadrature")


def _bands():
    """Check band means: a broken line over a rectangle, a curve over a triangle on nodes of 1 nm, and solar steps."""
    coarse, values = np.linspace(0.4, 0.9, 6), np.array([3.0, 1.0, 4.0, 1.5, 9.0, 2.6])
    found = Band("box", (0.55, 0.73), (2.0, 2.0)).mean(values, coarse)
    expected = integral(lambda x: np.interp(x, coarse, values), (0.55, 0.6, 0.7, 0.73)) / 0.18
    yield _deviation("mean of a broken line over a band", largest(found, expected), 1e-9, "1", "quadrature")
    fine, triangle = np.linspace(0.5, 0.8, 301), Band("triangle", (0.55, 0.62, 0.75), (0.0, 1.0, 0.0))

    def weight(x):
        return x**2 * np.interp(x, triangle.wavelength, triangle.response)

    expected = integral(lambda x: weight(x) * np.exp(-3 * x), triangle.wavelength)
    found = triangle.mean(np.exp(-3 * fine), fine, weight=fine**2) * integral(weight, triangle.wavelength)
    yield _deviation("mean of a weighted spectrum", largest(found, expected, relative=True), 1e-5, "1", "quadrature")
    wavelength, irradiance = solar_spectrum()
    worst = 100 * largest(trapezoid(irradiance, wavelength) / 1361, 0.985)
    yield _deviation("energy of the sun", worst, 1.0, "%", "98.5 % of 1361 W m-2, Kopp and Lean (2011)")
    steps, inside = np.linspace(0.4, 2.5, 211), (wavelength >= 0.4) & (wavelength <= 2.5)
    widths = np.concatenate([[0.005], np.full(209, 0.01), [0.005]])
    total = trapezoid(irradiance[inside], wavelength[inside])
    worst = largest(solar_irradiance_steps(steps) @ widths, total, relative=True)
    yield _deviation("and of its steps", worst, 1e-9, "1", "ASTM G173, integrated")


def _grey(level, shape, model, kinds, **place):
    """Noisy image of a uniform scene."""
    return add_noise(np.full(shape, level), model, kinds, **({"seed": 5, "band": 2, "row": -7, "column": 3000} | place))


def _noise():
    """Check ratios of a model, and the independence of noise on 120 000 pixels within 4.5 standard errors."""
    model = NoiseModel.from_snr([50.0, 200.0], [100.0, 250.0])
    kinds, shape = ("shot", "thermal"), (300, 400)
    noise, one = _grey(80.0, shape, model, kinds) - 80.0, NoiseModel.from_snr(50.0, 100.0, 0.3)
    found = [*model.snr([50.0, 200.0]), *one.noise_equivalent_radiance([50.0, 12.5]) ** 2]
    worst = largest(found, [100.0, 250.0, 0.25, 0.25 * (0.7 + 0.3 / 4)])
    yield _deviation("noise by published ratios", worst, 1e-12, "1", "shot noise in proportion to light")
    others = [_grey(80.0, shape, model, kinds, **key) for key in ({"seed": 6}, {"band": 3})]
    rows = [each.ravel() for each in (noise, np.roll(noise, 1, 0), np.roll(noise, 1, 1), *others)]
    worst = np.abs(np.corrcoef(rows) - np.eye(5)).max()
    yield _deviation("noise of lines, pixels, bands and seeds", worst, 4.5 / np.sqrt(noise.size), "1", "independence")


def _detectors():
    """Check the detector equation by its draws, and 20 000 detectors within four standard errors."""
    kinds, window = ("shot", "thermal", "fixed-pattern"), 0.0
    for along in ("rows", "columns"):
        model = NoiseModel(0.3, 0.01, 16, 0.01, 0.2, along)
        whole, part = _grey(80.0, (70, 400), model, kinds), _grey(80.0, (40, 300), model, kinds, row=13, column=3020)
        window = np.maximum(window, largest(part, whole[20:60, 20:320]))
        gain, offset = fixed_pattern(model, 5, 2)
        number = np.arange(-7, 63)[:, None] % 16 if along == "rows" else np.arange(3000, 3400) % 16
        drawn = np.array([line_noise(5, 2, line, 3000, 400) for line in range(-7, 63)])
        worst = largest(whole, gain[number] * (80.0 + np.sqrt(0.09 + 0.8) * drawn) + offset[number])
        yield _deviation(f"detectors of {along}", worst, 1e-11, "1", "Schowengerdt (2007), section 3.2")
    yield _deviation("noise of a window", window, 0.0, "1", "that of the whole")
    gain, offset = fixed_pattern(NoiseModel(0.0, 0.0, 20_000, 0.01, 0.2, "columns"), 1, 0)
    worst = largest([gain.std() / 0.01, offset.std() / 0.2, gain.mean(), 1 + offset.mean()], 1)
    yield _deviation("spread of gains and offsets", worst, 4 / np.sqrt(2 * 20_000), "1", "what was asked for")


_SPHERE = pyproj.Geod(a=scan.EARTH_RADIUS, b=scan.EARTH_RADIUS)
_ALTITUDE = 833e3
_TRACK = scan.Track(39.0, -97.0, 193.0)


def _triangle(aside, altitude=_ALTITUDE):
    """Slant range [m], scan angle and view zenith [degree] by the triangle of ground, sensor and earth centre."""
    orbit = scan.EARTH_RADIUS + altitude
    slant = np.sqrt(scan.EARTH_RADIUS**2 + orbit**2 - 2 * scan.EARTH_RADIUS * orbit * np.cos(np.radians(aside)))
    scan_angle = np.degrees(np.arccos((slant**2 + orbit**2 - scan.EARTH_RADIUS**2) / (2 * slant * orbit)))
    vza = 180 - np.degrees(np.arccos((slant**2 + scan.EARTH_RADIUS**2 - orbit**2) / (2 * slant * scan.EARTH_RADIUS)))
    return slant, scan_angle, vza


def _places():
    """Check places on both sides and along the track against geodesics on the sphere."""
    distance, aside = np.array([-3e5, 4e5, 1e5, -2e5]), np.array([3.0, -8.0, 0.4, 12.0])
    lon, lat, back = _SPHERE.fwd([_TRACK.longitude] * 4, [_TRACK.latitude] * 4, [_TRACK.heading] * 4, distance)
    abeam = np.array(back) + 180 + 90 * np.sign(aside)
    lon, lat, back = _SPHERE.fwd(lon, lat, abeam, scan.EARTH_RADIUS * np.radians(np.abs(aside)))
    latitude, longitude = scan.place_of(_TRACK, distance, aside)
    yield _deviation("places beside a track", largest([latitude, longitude], [lat, lon]), 1e-9, "degree", "geodesics")
    there, angle = scan.place_beside(_TRACK, lat, lon)
    worst = largest([there / 1e5, angle], [distance / 1e5, aside])
    yield _deviation("and their way back", worst, 1e-9, "100 km", "geodesics")
    sine, azimuth = np.sin(np.radians(_triangle(np.abs(aside))[2])), np.radians(back)
    worst = largest(scan.view_components(_TRACK, lat, lon, _ALTITUDE), [sine * np.sin(azimuth), sine * np.cos(azimuth)])
    yield _deviation("direction to the sensor", worst, 1e-9, "1", "geodesics and a triangle")


def _detector(track_angle, scan_angle, altitude):
    """Angles at the earth's centre along and across the track by a right spherical triangle. [degree]"""
    beta, theta = np.radians(track_angle), np.radians(scan_angle)
    away = np.arccos(np.cos(beta) * np.cos(theta))
    arc = np.arcsin((1 + altitude / scan.EARTH_RADIUS) * np.sin(away)) - away
    right, forward = np.cos(beta) * np.sin(theta), np.sin(beta)
    along = np.arctan(np.tan(arc) * forward / np.sin(away))
    return np.degrees(along), np.degrees(np.arcsin(np.sin(arc) * right / np.sin(away)))


def _sweeps():
    """Check places of detectors out of the plane of the scan, and sums of samples."""
    track_angle, scan_angle = np.array([0.4, -0.4, 2.0, -0.1]), np.array([56.0, -44.0, 10.0, 31.0])
    distance, aside = scan.ground_of_detector(track_angle, scan_angle, _ALTITUDE)
    found = np.degrees(distance / scan.EARTH_RADIUS), aside
    worst = largest(found, _detector(track_angle, scan_angle, _ALTITUDE))
    yield _deviation("places of detectors in a sweep", worst, 1e-9, "degree", "right spherical triangles")
    x, frequency = np.linspace(-600, 600, 241), np.array([0.0, 1e-3, 2.5e-3])
    spread, one = AggregatedSpread(Boxcar(128.0), 3, 128.0), Boxcar(384.0)
    worst = largest([*spread.cumulative(x), *spread.mtf(frequency)], [*one.cumulative(x), *one.mtf(frequency)])
    yield _deviation("sum of three samples", worst, 1e-12, "1", "one detector of three times the width")


def _grid():
    """Check directions on cells of 10 km on both sides of a track, which are splines."""
    cells, track = grids.grid_at("EPSG:26914", 680e3, 4.35e6, 40e3, 30e3, 10e3), scan.Track(39.0, -96.7, 193.0)
    view = scan_geometry("TM", cells, track)
    lon, lat = pyproj.Transformer.from_crs(26914, 4269, always_xy=True).transform(*np.meshgrid(view["x"], view["y"]))
    abeam = scan.place_of(track, scan.place_beside(track, lat, lon)[0], 0.0)
    azimuth, _, distance = _SPHERE.inv(lon, lat, abeam[1], abeam[0])
    vza = _triangle(np.degrees(distance / scan.EARTH_RADIUS), 705e3)[2]
    worst = largest([view["vza"], (view["vaa"] - azimuth + 180) % 360 - 180], [vza, 0 * vza])
    yield _deviation("view angles of a grid", worst, 1e-6, "degree", "geodesics and a triangle")


def _footprint(frame, along, across, row=30.3, column=28.7):
    return Footprints(np.array([row]), np.array([column]), frame[None], along, across)


def _turned():
    """Check the moments of turned and grown Gaussians on cells of 3.33 m, which add a twelfth of their squared size."""
    place = np.arange(60) + 0.5
    down, right = np.meshgrid(place - 30.3, place - 28.7, indexing="ij")
    centre, shape = 0.0, 0.0
    for turn in np.radians([20.0, 77.0, -35.0]):
        frame = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) * 10 / 3 / [[1.25], [1.6]]
        footprint = _footprint(frame, GaussianSpread(12.0), GaussianSpread(18.0))
        rows, columns = footprint.window((60, 60))
        operator = footprint_operator(footprint, rows, columns).toarray()
        weights = np.zeros((60, 60))
        weights[rows, columns] = operator.reshape(weights[rows, columns].shape)
        back = np.linalg.inv(frame)
        expected = back @ np.diag(np.square([12.0, 18.0]) / (8 * np.log(2))) @ back.T + np.eye(2) / 12
        moments = np.array([[np.sum(weights * a * b) for b in (down, right)] for a in (down, right)])
        centre = np.maximum(centre, largest([np.sum(weights * down), np.sum(weights * right)], 0))
        shape = np.maximum(shape, largest(moments, expected) / expected.max())
    yield _deviation("centre of a turned footprint", centre, 1e-6, "cell", "symmetry")
    yield _deviation("second moments of a turned footprint", shape, 1e-5, "1", "those of the response, turned")


def _straight():
    """Check that a quarter turn exchanges rows and columns; response tables have steps of 1/4096."""
    along, across = CosineSpread(30.32), Boxcar(24.0)
    operators = [
        axis_operator(
            spread,
            cell_origin=0,
            cell_size=10 / 3,
            n_cells=60,
            pixel_origin=middle * 10 / 3 - 15,
            pixel_size=30,
            n_pixels=1,
        )
        for spread, middle in ((across, 30.3), (along, 28.7))
    ]
    scenes = np.random.default_rng(2).uniform(1, 2, (2, 60, 60))
    scenes[1, 31, 27] = np.nan
    expected = [regularize(scene, *operators, min_valid=0.5).item() for scene in scenes]
    footprint = _footprint(10 / 3 * np.array([[0.0, 1.0], [-1.0, 0.0]]), along, across)
    operator = footprint_operator(footprint, slice(0, 60), slice(0, 60))
    found, whole = (apply_operator(operator, scenes.reshape(2, -1), valid)[:, 0] for valid in (0.5, 1.0))
    worst = largest(found, expected)
    worst = worst if np.array_equal(whole, [found[0], np.nan], equal_nan=True) else np.inf
    yield _deviation("pixel of a scan along the grid", worst, 1e-5, "1", "sums by rows and columns")


def _plane():
    """Check a linear ramp of light over cells of 3.33 m, for samples at equal scan angles."""
    cells = grids.grid_at("EPSG:26914", 705600.0, 4334000.0, 600.0, 500.0, 10 / 3)
    place = grids.coordinates(cells)
    light = 40 + 0.02 * (place["x"] - 705900) - 0.03 * (place["y"] - 4333750)
    toa = grids.place(xr.DataArray(light.transpose("y", "x").data, dims=("y", "x")), cells).assign_coords(band="TM3")
    toa.attrs["units"] = "W m-2 sr-1 um-1"
    seen = {"nadir_offset": -36e3, "heading": 193.6, "quantise": False, "min_valid": 1.0, "geometry": fife_geometry()}
    image = sense_swath(toa, "TM", view_tolerance=180, **seen)
    expected = 40 + 0.02 * (image["x"] - 705900) - 0.03 * (image["y"] - 4333750)
    worst = np.abs(image - expected).max() / np.hypot(0.02, 0.03) / (10 / 3)
    yield _deviation("plane in a scan", float(worst), 0.01, "cell", "the plane at its pixels")
    # 16 detectors, half of them on either side of the plane of the scan.
    detector, theta = image["line"].values % 16 - 7.5, np.degrees((image["sample"].values + 0.5) * 43e-6)
    aside = _detector(np.degrees(detector * 43e-6)[:, None], theta, 705e3)[1]
    worst = largest(image["vza"].values, _triangle(np.abs(aside), 705e3)[2])
    yield _deviation("view of its samples", worst, 1e-9, "degree", "Friedl et al. (1995), Table 1")


CHECKS = (
    _shapes, _parts, _holes, _blocks, _radiances, _bands, _noise, _detectors,
    _places, _sweeps, _grid, _turned, _straight, _plane,
)  # fmt: skip
