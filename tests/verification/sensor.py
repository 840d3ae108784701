"""Checks of the sensor: images by quadrature, line spreads, calibration, bands and noise."""

from functools import partial
from itertools import product

import numpy as np
import xarray as xr
from scipy.integrate import quad, trapezoid
from scipy.signal import butter, freqs
from scipy.stats import norm

from fifesim.base.bands import NEAR_INFRARED, RED, Band, nearest_band, solar_irradiance_steps, solar_spectrum
from fifesim.base.footprints import Boxcar, axis_operator, regularize
from fifesim.grids import grid as grids
from fifesim.grids.reductions import areas, regularized
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response import calibration
from fifesim.sensor.response.noise import NoiseModel, add_noise, fixed_pattern, line_noise
from fifesim.sensor.response.spatial import (
    CosineSpread,
    Diffraction,
    GaussianSpread,
    LowPass,
    SystemSpread,
    TableSpread,
)
from verification.deviations import Deviation, integral, largest

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


def _instruments():
    """Check angles on the ground, and a measured transfer: 40.8 m is half of the period with a transfer of one half."""
    tm, measured = instrument("TM", "paper"), instrument("L4TM").line_spread
    angles = tm.line_spread.width / (9 * 4.778e-6 * 705e3), tm.ground_interval / (43e-6 * 705e3)
    found = [*angles, measured.mtf(0.5 / 40.8) / 0.5]
    yield _deviation("TM's line spread on the ground", largest(found, 1), 1e-4, "1", "Schowengerdt et al. (1985)")
    at_nyquist = GaussianSpread.from_mtf(0.3, 30.0)
    worst = largest(at_nyquist.mtf(1 / 60), 0.3)
    yield _deviation("Gaussian of a given transfer", worst, 1e-12, "1", "its definition")


LINE_SPREAD_CHECKS = (_shapes, _parts, _instruments)


_WIDTH = 9 * 4.778e-6 * 705e3  # of TM's line spread [m]
_PIXEL = 30.0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(40)


def _integral(low, high, frequency=0.0):
    """Integral of the normalized line spread function times a cosine, from low to high around the centre [m]."""
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
    """Check the image of one bright cell of 30/9 m on pixels with an offset of 7 m."""
    cell, origin, bright = 30 / 9, 37.123, (31, 26)
    scene = np.zeros((70, 70))
    scene[bright] = 1.0
    axis = _axis(cell, 70, 4, origin)
    centres = origin + (np.arange(4) + 0.5) * _PIXEL
    rows, columns = (_integral(place * cell - centres, (place + 1) * cell - centres) for place in bright)
    found = largest(regularize(scene, axis, axis, min_valid=1.0), np.outer(rows, columns))
    yield _deviation("image of one bright cell", found, 1e-12, "1", "cosine line spread, quadrature")


def _wave():
    """Check the image of a wave on cells of 5 mm; the two cells at the ends of the support cost 3e-8."""
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


def _counts():
    """Check quantization with 8 and 12 bits, within half a count."""
    worst = 0.0
    for band, bits in product(instrument("TM").bands, (8, 12)):
        gain, offset = calibration.gain_offset(band.full_scale_radiance, band.min_radiance, bits)
        radiance = np.linspace(band.min_radiance + gain, band.full_scale_radiance, 1001)
        counts = calibration.radiance_to_dn(radiance, gain, offset, bits=bits).astype(float)
        step = (band.full_scale_radiance - band.min_radiance) / (2**bits - 1)
        worst = np.maximum(worst, largest(counts * step + band.min_radiance, radiance) / step)
    yield _deviation("counts of TM's radiances", worst, 0.5 + 1e-9, "count", "Friedl et al. (1995), Table 1")


def _radiances():
    """Check the radiance of counts by hand, and that a Lambertian surface reflects as much as it radiates."""
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


def _ndvi_bands():
    """Check that red and near infrared are the bands with these names at the agencies."""
    expected = {"TM": ("TM3", "TM4"), "OLI": ("OLI4", "OLI5"), "MSI": ("MSI4", "MSI8"), "MODIS": ("MODIS1", "MODIS2")}
    wrong = nearest_band([0.5, 0.72], RED) is not None
    for name, pair in expected.items():
        bands = instrument(name).bands
        found = [nearest_band([band.wavelength for band in bands], window) for window in (RED, NEAR_INFRARED)]
        wrong += tuple(bands[number].name for number in found) != pair
    yield _deviation("red and near infrared of four instruments", wrong, 0, "1", "their makers")


def _grey(level, shape, model, kinds, **place):
    """Noisy image of a uniform scene."""
    return add_noise(np.full(shape, level), model, kinds, **({"seed": 5, "band": 2, "row": -7, "column": 3000} | place))


def _noise():
    """Check noise on 120 000 pixels within four standard errors; its variance is linear between two ratios."""
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


CHECKS = (_impulse, _wave, _constant, _holes, _blocks, _counts, _radiances, _bands, _ndvi_bands, _noise, _detectors)
