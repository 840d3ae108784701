"""Checks of the sensor: images by the quadrature of a line spread, calibration, bands and noise."""

from functools import partial
from itertools import product

import numpy as np
import xarray as xr
from scipy.integrate import quad, trapezoid

from fifesim.base.bands import NEAR_INFRARED, RED, Band, nearest, solar_irradiance_steps, solar_spectrum
from fifesim.base.footprints import axis_operator, regularize
from fifesim.experiments.verification.deviations import Deviation, integral, largest
from fifesim.rasters import grid as grids
from fifesim.rasters.regularization import areas, regularized
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response import calibration
from fifesim.sensor.response.noise import NoiseModel, add_noise, fixed_pattern, line_noise
from fifesim.sensor.response.spatial import CosineSpread

_deviation = partial(Deviation, "sensor")

_WIDTH = 9 * 4.778e-6 * 705e3  # of TM's line spread [m]
_PIXEL = 30.0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(40)


def _integral(low, high, frequency=0.0):
    """Integral of the normalized line spread times a cosine wave, from low to high [m] around the pixel's centre."""
    low, high = np.clip([low, high], -_WIDTH / 2, _WIDTH / 2)
    middle, half = (low + high) / 2, (high - low) / 2
    x = middle[..., None] + half[..., None] * _NODES
    density = np.cos(2 * np.pi * x / (3 * _WIDTH)) * np.cos(2 * np.pi * frequency * x)
    area = _WIDTH / 2 * np.sum(_WEIGHTS * np.cos(np.pi * _NODES / 3))
    return half * (density @ _WEIGHTS) / area


def _axis(cell, cells, pixels, origin):
    return axis_operator(
        CosineSpread(_WIDTH),
        cell_origin=0.0,
        cell_size=cell,
        n_cells=cells,
        pixel_origin=origin,
        pixel_size=_PIXEL,
        n_pixels=pixels,
    )


def _impulse():
    """One bright cell among those of 30/9 m, on pixels that are offset by 7 m."""
    cell, origin, bright = 30 / 9, 37.123, (31, 26)
    scene = np.zeros((70, 70))
    scene[bright] = 1.0
    axis = _axis(cell, 70, 4, origin)
    centres = origin + (np.arange(4) + 0.5) * _PIXEL
    rows, columns = (_integral(place * cell - centres, (place + 1) * cell - centres) for place in bright)
    found = largest(regularize(scene, axis, axis, min_valid=1.0), np.outer(rows, columns))
    yield _deviation("image of one bright cell", found, 1e-12, "1", "cosine line spread, quadrature")


def _wave():
    """Cells of 5 mm hold means; the two that the ends of the support cut lose 3e-8."""
    cell, cells = 5e-3, 30_000
    single = _axis(_WIDTH, 1, 1, (_WIDTH - _PIXEL) / 2)
    columns = _axis(cell, cells, 2, 37.3)
    centres = 37.3 + (np.arange(2) + 0.5) * _PIXEL
    image, transfer = 0.0, 0.0
    for wavelength in (400.0, 90.0, 45.4, 21.0):
        k = 2 * np.pi / wavelength
        scene = np.diff(np.sin(k * np.arange(cells + 1) * cell)) / (k * cell)
        expected = _integral(np.array(-_WIDTH), np.array(_WIDTH), 1 / wavelength)
        image = np.maximum(image, largest(regularize(scene[None], single, columns), expected * np.cos(k * centres)))
        transfer = np.maximum(transfer, largest(CosineSpread(_WIDTH).mtf(1 / wavelength), expected))
    yield _deviation("image of waves of 21 to 400 m", image, 1e-7, "1", "its Fourier transform, quadrature")
    yield _deviation("modulation transfer function", transfer, 1e-12, "1", "its Fourier transform, quadrature")


def _weights(cells, cell, pixels, origin):
    """Weights of cells in pixels, shape (pixels, cells)."""
    left = np.arange(cells) * cell - (origin + (np.arange(pixels) + 0.5) * _PIXEL)[:, None]
    return _integral(left, left + cell)


def _constant():
    scene = np.full((90, 120), 204.3)
    rows, columns = (_axis(30 / 9, size, 20, 1.1) for size in scene.shape)
    scene[::7, ::5] = np.nan
    image = regularize(scene, rows, columns, min_valid=0.3)
    seen = image[np.isfinite(image)]
    worst = largest(seen, 204.3, relative=True) if seen.size else np.nan
    yield _deviation("constant scene with holes stays constant", worst, 1e-13, "1", "theory")


def _holes():
    """Pixels that reach beyond the cells on every side, moved by shifts down and to the right, over cells in chunks."""
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
    """Edges of pixels are edges of cells, but for rounding: thirds of 3.3 m leave dust in the cells before them."""
    cells = grids.grid_at("EPSG:26914", 705500.0, 4334000.0, 198.0, 148.5, 1.1)
    values = np.random.default_rng(1).uniform(1, 2, tuple(cells.shape))
    pixels = grids.aligned(cells, 3.3)
    image = regularized(grids.place(xr.DataArray(values, dims=("y", "x")), cells), areas(pixels), pixels, min_valid=1.0)
    worst = largest(image, values.reshape(45, 3, 60, 3).mean(axis=(1, 3)))
    yield _deviation("means over blocks of cells", worst, 1e-12, "1", "numpy")


def _counts():
    """Rounding to the nearest count, of 8 bits as TM's and of 12."""
    worst = 0.0
    for band, bits in product(instrument("TM").bands, (8, 12)):
        gain, offset = calibration.gain_offset(band.full_scale_radiance, band.min_radiance, bits)
        radiance = np.linspace(band.min_radiance + gain, band.full_scale_radiance, 1001)
        counts = calibration.radiance_to_dn(radiance, gain, offset, bits=bits).astype(float)
        step = (band.full_scale_radiance - band.min_radiance) / (2**bits - 1)
        worst = np.maximum(worst, largest(counts * step + band.min_radiance, radiance) / step)
    yield _deviation("counts of TM's radiances", worst, 0.5 + 1e-9, "count", "Friedl et al. (1995), Table 1")


def _radiances():
    """Counts by hand; and what a Lambertian surface sends into all directions is what it reflects."""
    gain, offset = calibration.gain_offset(204.3, -1.2, 8)
    found = calibration.dn_to_radiance([1, 100, 255], gain, offset)
    worst = largest((found + 1.2) * 255 / 205.5, [1, 100, 255])
    yield _deviation("radiance of TM3's counts", worst, 1e-12, "count", "Friedl et al. (1995), Table 1")
    reflectance, irradiance, mu_s, distance = 0.3, 1536.0, 0.7, 1.0148
    radiance = calibration.reflectance_to_radiance(reflectance, irradiance, mu_s, distance)
    sent = quad(lambda theta: 2 * np.pi * float(radiance) * np.cos(theta) * np.sin(theta), 0, np.pi / 2)[0]
    received = irradiance * mu_s / distance**2
    back = calibration.radiance_to_reflectance(radiance, irradiance, mu_s, distance)
    worst = largest([sent / received, back], reflectance)
    yield _deviation("radiance of a Lambertian surface", worst, 1e-12, "1", "its exitance, quadrature")


def _bands():
    """A broken line over a rectangle, a curve over a triangle on nodes of 1 nm, and the sun in steps."""
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


def _ndvi_bands():
    """By the names that the agencies give."""
    expected = {"TM": ("TM3", "TM4"), "OLI": ("OLI4", "OLI5"), "MSI": ("MSI4", "MSI8"), "MODIS": ("MODIS1", "MODIS2")}
    wrong = nearest([0.5, 0.72], RED) is not None
    for name, pair in expected.items():
        bands = instrument(name).bands
        found = [nearest([band.wavelength for band in bands], window) for window in (RED, NEAR_INFRARED)]
        wrong += tuple(bands[number].name for number in found) != pair
    yield _deviation("red and near infrared of four instruments", wrong, 0, "1", "their makers")


def _grey(level, shape, model, kinds, **place):
    """Image of a grey scene."""
    return add_noise(np.full(shape, level), model, kinds, **({"seed": 5, "band": 2, "row": -7, "column": 3000} | place))


def _noise():
    """Four standard errors of 120 000 pixels, whose variance is linear in the light between two published ratios."""
    model = NoiseModel.from_snr([50.0, 200.0], [100.0, 250.0])
    kinds, shape = ("shot", "thermal"), (300, 400)
    noise, thermal = _grey(80.0, shape, model, kinds) - 80.0, _grey(80.0, shape, model, ("thermal",)) - 80.0
    slope = (0.64 - 0.25) / 150
    worst = largest([noise.var() / (0.25 + 30 * slope), thermal.var() / (0.25 - 50 * slope)], 1)
    yield _deviation("noise at a radiance between two", worst, 4 * np.sqrt(2 / noise.size), "1", "variances on a line")
    one = NoiseModel.from_snr(50.0, 100.0, 0.3)
    found = [*model.snr([50.0, 200.0]), *one.noise_equivalent_radiance([50.0, 12.5]) ** 2]
    worst = largest(found, [100.0, 250.0, 0.25, 0.25 * (0.7 + 0.3 / 4)])
    yield _deviation("noise by published ratios", worst, 1e-12, "1", "shot noise in proportion to light")
    others = [_grey(80.0, shape, model, kinds, **key) for key in ({"seed": 6}, {"band": 3})]
    rows = [each.ravel() for each in (noise, np.roll(noise, 1, 0), np.roll(noise, 1, 1), *others)]
    worst = np.abs(np.corrcoef(rows) - np.eye(5)).max()
    yield _deviation("noise of lines, pixels, bands and seeds", worst, 4.5 / np.sqrt(noise.size), "1", "independence")


def _detectors():
    """The equation of a detector by its draws; and twenty thousand of them, within four standard errors."""
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


CHECKS = (_impulse, _wave, _constant, _holes, _blocks, _counts, _radiances, _bands, _ndvi_bands, _noise, _detectors)
