"""Checks of the sensor against the line spread of Friedl et al. (1995), integrated and transformed by quadrature."""

from functools import partial

import numpy as np

from fifesim.base.footprints import axis_operator, regularize
from fifesim.experiments.verification.deviations import Deviation, largest
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response import calibration
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
    found = largest(regularize(scene, axis, axis), np.outer(rows, columns))
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


def _constant():
    scene = np.full((90, 120), 204.3)
    rows, columns = (_axis(30 / 9, size, 20, 1.1) for size in scene.shape)
    scene[::7, ::5] = np.nan
    image = regularize(scene, rows, columns, min_valid=0.3)
    seen = image[np.isfinite(image)]
    worst = largest(seen, 204.3, relative=True) if seen.size else np.nan
    yield _deviation("constant scene with holes stays constant", worst, 1e-13, "1", "theory")


def _counts():
    """Rounding to the nearest count."""
    worst = 0.0
    for band in instrument("TM").bands:
        gain, offset = calibration.gain_offset(band.full_scale_radiance, band.min_radiance, 8)
        radiance = np.linspace(band.min_radiance + gain, band.full_scale_radiance, 1001)
        counts = calibration.radiance_to_dn(radiance, gain, offset, bits=8).astype(float)
        step = (band.full_scale_radiance - band.min_radiance) / 255
        worst = np.maximum(worst, largest(counts * step + band.min_radiance, radiance) / step)
    yield _deviation("counts of TM's radiances", worst, 0.5 + 1e-9, "count", "Friedl et al. (1995), Table 1")


CHECKS = (_impulse, _wave, _constant, _counts)
