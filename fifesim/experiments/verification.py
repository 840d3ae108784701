"""
Comparison of an installation with stored results of other codes, published tables and closed forms.

Each row of ``data/verification.csv`` names one of the `COMPARED`, with its inputs, and the expected value.
"""

from __future__ import annotations

import tomllib
from typing import NamedTuple

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from fifesim.analysis import corrections
from fifesim.analysis.regression_labels import regress
from fifesim.analysis.scaling import ndvi_hessian
from fifesim.atmosphere.adjacency import environment_function, mixed_environment_function
from fifesim.atmosphere.clouds.field import cloud_displacement
from fifesim.atmosphere.clouds.labels import cloud_field
from fifesim.atmosphere.clouds.layer import drops_at, layer_light, two_stream_reflectance
from fifesim.atmosphere.coupling import TargetTerms, inhomogeneous_reflectance
from fifesim.atmosphere.engines import band_terms
from fifesim.atmosphere.models import Atmosphere
from fifesim.atmosphere.successive_orders import stokes_reflectance
from fifesim.base import files
from fifesim.base.geometry import Geometry, fife_geometry
from fifesim.base.surface_kernels import ross_li
from fifesim.chain.steps import index, to_toa
from fifesim.grids import grid as grids
from fifesim.grids.sites import sun_position
from fifesim.ground.canopy.crowns import clumped, crown_shares
from fifesim.ground.canopy.layers import extinction_coefficient, light_budget, two_layers
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.leaf_transfer import discrete_ordinates
from fifesim.ground.canopy.prospect import Leaf, leaf_spectrum
from fifesim.ground.canopy.reflectance_table import canopy_reflectance
from fifesim.ground.canopy.sail_model import sail, with_background
from fifesim.ground.canopy.soil import moistened, water_films
from fifesim.ground.landscape.autoregression import autocorrelation, philox, streaming_field
from fifesim.ground.landscape.distribution import lai_distribution
from fifesim.ground.terrain import labels as terrain
from fifesim.ground.terrain.elevation_labels import fine_dem
from fifesim.ground.terrain.sky_labels import horizon
from fifesim.models.evaporation import penman_monteith, pt_jpl, reference_evapotranspiration
from fifesim.models.production import canopy_photosynthesis, light_use_gpp
from fifesim.models.radiation import two_stream
from fifesim.output.progress import steps
from fifesim.retrieval.networks import sl2p
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.labels import sense, to_radiance, to_reflectance
from fifesim.sensor.response import scan
from fifesim.sensor.response.noise import NoiseModel, add_noise

_CORNER = 499_980.0, 4_330_020.0  # of all rasters, at the central meridian of UTM zone 14 [m]

_REFLECTANCE = "surface_bidirectional_reflectance", "1"
_RADIANCE = "toa_outgoing_radiance_per_unit_wavelength", "W m-2 sr-1 um-1"


class Deviation(NamedTuple):
    """Deviation of a result of this installation from the stored one, and its bound."""

    area: str  # of the package
    what: str  # was compared
    deviation: float
    bound: float
    unit: str  # of both; "1" for fractions
    source: str  # of the stored result

    @property
    def within(self) -> bool:
        """Whether the bound holds; NaN does not."""
        return bool(self.deviation <= self.bound)


def verify() -> list[Deviation]:
    """
    Compare this installation with stored results of other codes, published tables and closed forms.

    Returns
    -------
    deviations : list of Deviation
        For each comparison, the ``area``, ``what`` was compared, the ``deviation`` with its ``bound`` and ``unit``,
        the ``source`` of the stored result, and whether the deviation is ``within`` the bound.

    Notes
    -----
    The results are in ``data/verification.csv``. None of them is computed by fifesim. BLAS uses one thread, since
    threads for small matrices mostly wait for each other. ``fifesim verify`` prints the list.

    References
    ----------
    [Friedl1995]_, line spread and radiances of TM; [Vermote1997]_, the atmosphere

    Examples
    --------
    >>> import fifesim
    >>> [each.what for each in fifesim.experiments.verify() if not each.within]  # doctest: +SKIP
    []
    """
    rows = list(files.table("verification.csv").itertuples(index=False))
    with threadpool_limits(1, user_api="blas"):
        return [_compared(row) for row in steps(rows, "comparisons")]


def _compared(row):
    """Deviation of one row of the table."""
    inputs = tomllib.loads(row.inputs.replace("; ", "\n"))
    deviation = abs(float(COMPARED[row.quantity](**inputs)) - row.expected)
    return Deviation(row.area, row.compared, deviation, row.tolerance, row.unit, row.source)


def listing(deviations):
    """Lines of text on deviations, and a summary that names those beyond their bounds."""
    lines = [f"{'':13}{'compared':<58}{'deviation':>10}{'bound':>10} {'unit':<12}with"]
    for each in deviations:
        numbers = f"{each.deviation:>10.3g}{each.bound:>10.3g} {each.unit:<12}"
        mark = "" if each.within else "  EXCEEDED"
        lines.append(f"{each.area:<13}{each.what:<58}{numbers}{each.source}{mark}")
    exceeded = [f"{each.area}: {each.what}" for each in deviations if not each.within]
    beyond = f"{len(exceeded)} beyond their bounds: {'; '.join(exceeded)}" if exceeded else "all within their bounds"
    return [*lines, f"{len(deviations)} comparisons, {beyond}"]


def _raster(cells, cell=30.0, dims=("y", "x"), **labels):
    """Labelled raster in the middle of UTM zone 14, where grid north is true north."""
    height, width = cell * np.array(cells.shape[-2:])
    grid = grids.grid_at("EPSG:26914", *_CORNER, width, height, cell)
    return grids.place(xr.DataArray(cells, dims=dims, **labels), grid)


def _image(standard_name, units, cell=30.0, **bands):
    """Labelled bands of TM."""
    wavelengths = {band.name: band.wavelength for band in instrument("TM").bands}
    coords = {"band": list(bands), "wavelength": ("band", [wavelengths[name] for name in bands])}
    attrs = {"standard_name": standard_name, "units": units}
    cells = np.array([np.broadcast_to(values, np.shape(values) or (2, 2)) for values in bands.values()], float)
    return _raster(cells, cell, ("band", "y", "x"), coords=coords, attrs=attrs)


# ---------------------------------------------------------------------------------------------------------- Ground


def _random_word(counter, key, word):
    return philox(*np.array([*counter, *key], np.uint64))[word]


def _field_correlation(arp, size, seed):
    """Product moment of neighbours in a random field with a variance of 1."""
    field = streaming_field(seed, arp, 0, 0, (size, size))
    return np.mean(field[:-1] * field[1:] + field[:, :-1].T * field[:, 1:].T) / 2


def _leaf(wavelength, quantity, **contents):
    at, *spectra = leaf_spectrum(Leaf(**contents))
    return np.interp(wavelength, at, spectra[("reflectance", "transmittance").index(quantity)])


def _surface(canopy, background, term):
    """A reflectance of a canopy over its background, or a term of the canopy itself."""
    return getattr(with_background(canopy, background) if term in ("rso", "rdo", "rsd", "rdd") else canopy, term)


def _sail(term, background, verhoef=None, model="SAIL", **canopy):
    leaves = {} if verhoef is None else {"leaf_angles": leaf_angle_classes(("verhoef", *verhoef), classes=18)}
    return _surface({"SAIL": sail, "ordinates": discrete_ordinates}[model](**canopy, **leaves), background, term)


def _interpolated(verhoef, leaf, background, lai, **light):
    """Reflectance of one cell among others by the table over leaf area, as in a scene."""
    leaves = leaf_angle_classes(("verhoef", *verhoef), classes=18)
    cells = np.append(np.linspace(0, 8, 2000), lai)
    optics = [np.array([each]) for each in (*leaf, background)]
    return canopy_reflectance(cells, *optics, leaf_angles=leaves, **light)[0, -1]


def _two_layers(term, soil, leaf_angles, **canopy):
    return _surface(two_layers(leaf_angles=leaf_angle_classes(leaf_angles, classes=18), **canopy), soil, term)


def _crowns(cover, lai, leaf, soil, sza, vza, raa, hotspot):
    canopy = sail(lai / cover, *leaf, sza=sza, vza=vza, raa=raa, hotspot=hotspot)
    return with_background(clumped(canopy, crown_shares(cover, 1.0, sza, vza, raa)), soil).rso


def _moist_soil(dry, moisture, band):
    response = instrument("TM").select([band])[0].response
    return moistened(np.array([dry]), np.array([moisture]), water_films((response,)))[..., 0].item()


def _light_budget(part, **canopy):
    budget = light_budget(**canopy)
    return sum(budget) if part == "all" else getattr(budget, part)


def _elevation(cells, cell=30.0):
    return _raster(cells, cell, attrs={"units": "m"})


def _tilted(quantity, slope, aspect, **sun):
    """Slope, aspect, or cosine of the sun's incidence [degree or 1] in the middle of a plane of 9 x 9 cells."""
    down, across = np.indices((9, 9)) * 30.0
    toward = np.radians(aspect)
    plane = 400 - np.tan(np.radians(slope)) * (across * np.sin(toward) - down * np.cos(toward))
    given = (Geometry(**sun),) if sun else ()
    return getattr(terrain, quantity)(_elevation(plane), *given)[4, 4]


def _valley_sky(wall, place):
    """Sky view in a valley of straight walls below a level upland; a place of 0 is the floor, and 1 the rim."""
    across = np.minimum(np.abs(np.arange(181) - 90), 30) * 10.0
    dem = _elevation(np.tile(across * np.tan(np.radians(wall)), (201, 1)), 10.0)
    return terrain.sky_view(dem, horizon(dem, reach=900.0, resolution=10.0))[100, 90 + round(30 * place)]


def _wave_between_cells(wavelength, x):
    """Elevation at a distance from the west [m] of a wave on cells of 30 m, refined to cells of 10 m."""
    coarse = np.tile(np.sin(2 * np.pi * (np.arange(80) + 0.5) * 30 / wavelength), (80, 1))
    west, north = _CORNER
    fine = fine_dem(_elevation(10 * coarse), grids.grid_at("EPSG:26914", west + x - 5, north - 1205, 10, 10, 10))
    return fine[0, 0]


# ------------------------------------------------------------------------------------------------------ Atmosphere


def _air(quantity, wavelength=None, **air):
    found = getattr(Atmosphere(**air), quantity)
    return found if wavelength is None else found(wavelength)


def _terms(term, band, sza, vza=0.0, raa=0.0, **air):
    """Term of the coupling equation; the path reflectance includes the gases."""
    response = instrument("TM").select([band])[0].response
    terms = band_terms(Atmosphere(**air), [response], sza, vza, raa)
    return getattr(terms, term)[0] * (terms.gas_transmittance[0] if term == "path_reflectance" else 1)


def _toa(band, reflectance, sza, vza=0.0, raa=0.0, **air):
    ground = _image(*_REFLECTANCE, **{band: reflectance})
    return to_toa(ground, Atmosphere(**air), geometry=Geometry(sza, raa, vza, 0.0), instrument="TM")[0, 0, 0]


def _molecules(stokes, level, tau, ground, mu_s, mu_v, raa):
    sza, vza = np.degrees(np.arccos([mu_s, mu_v]))
    none = np.zeros((1, 1))
    options = {"at_ground": level == "ground", "ground": ground, "depolarization": 0.0}
    return stokes_reflectance(tau, 0.0, 0.0, [1.0], none, none, sza, [vza], [raa], **options)["IQU".index(stokes), 0, 0]


def _environment(particles, radius):
    return environment_function(radius)[("molecules", "aerosol").index(particles)]


def _round_target(target, environment, radius, vza, diffuse_up_molecules, diffuse_up_aerosol, **terms):
    share = mixed_environment_function(radius, vza, diffuse_up_molecules, diffuse_up_aerosol)
    return inhomogeneous_reflectance(target, share * target + (1 - share) * environment, TargetTerms(**terms))


def _cloud_cover(cover, seed):
    """Share of cells of 500 m in clouds, over 100 km."""
    field = cloud_field(grids.grid_at("EPSG:26914", 600e3, 4.3e6, 100e3, 100e3, 500.0), cover, seed=seed)
    return (field["optical_thickness"] > 0).mean()


def _cloud_shift(of, **place):
    return cloud_displacement(**place)[("shadow east", "shadow north", "image east", "image north").index(of)]


def _cloud_layer(part, thickness, wavelength, **angles):
    return getattr(layer_light(np.array([thickness]), drops_at(wavelength), **angles), part).item()


# ---------------------------------------------------------------------------------------------------------- Sensor


def _band(name, band):
    return instrument(name).select([band])[0]


def _transfer(name, band, cycles, response=None):
    """Modulation transfer along the track, at cycles per metre."""
    item = instrument(name) if response is None else instrument(name, response)
    return item.line_spreads(item.select([band])[0])[0].mtf(cycles)


def _bright_cell(row, column):
    """Weight of a cell of 30/9 m, counted from the middle of a pixel, in the pixel of TM by Table 1 of the paper."""
    cells = np.zeros((189, 189))
    cells[94 + row, 94 + column] = 1.0
    scene, tm = _image(*_RADIANCE, cell=30 / 9, TM3=cells), instrument("TM", "paper")
    return sense(scene, tm, quantise=False, geometry=fife_geometry())[0, 10, 10]


def _recorded(quantity, radiance):
    """Count of TM3 for a uniform radiance, and radiance and reflectance of this count, with the sun at 30 degrees."""
    scene = _image(*_RADIANCE, TM3=np.full((8, 8), radiance))
    sun = Geometry(30.0, 117.0, earth_sun_distance=1.0148)
    image = sense(scene, instrument("TM", "paper"), min_valid=0.5, geometry=sun)
    found = {"count": xr.DataArray.copy, "radiance": to_radiance, "reflectance": to_reflectance}[quantity](image)
    return found[0, 4, 4]


def _noise_variance(at, snr, radiance, seed):
    """Variance of shot and thermal noise on 120 000 pixels, for a model of published signal-to-noise ratios."""
    model = NoiseModel.from_snr(at, snr)
    scene = np.full((300, 400), radiance)
    return np.var(add_noise(scene, model, ("shot", "thermal"), seed=seed, band=0) - radiance)


def _line_of_sight(quantity, scan_angle, altitude):
    vza, away = scan.view_from_scan(scan_angle, altitude)
    along, across = scan.growth(scan_angle, altitude)
    return {"vza": vza, "away": away, "along": along, "across": across}[quantity]


def _sun(quantity, **place):
    return getattr(sun_position(**place), quantity)


# ------------------------------------------------------------------------------------------- Analysis and models


def _index(name, **bands):
    return index(_image(*_REFLECTANCE, **bands), name)[0, 0]


def _line(quantity, x, y):
    y, x = (_raster(np.array([values]), name=name) for name, values in (("y", y), ("x", x)))
    return getattr(regress(y, x), quantity)


def _slope_corrected(method, reflectance, cos_i, sza, factor):
    return getattr(corrections, f"{method}_correction")(reflectance, cos_i, sza, factor)


def _networks(quantity, bands, **cosines):
    return sl2p(np.array([bands]), **{name: np.array([value]) for name, value in cosines.items()}, quantity=quantity)[
        0
    ][0]


# Functions of the inputs of a row, by the names of quantities in the table.
COMPARED = {
    "random word": _random_word,
    "field autocorrelation": autocorrelation,
    "field correlation": _field_correlation,
    "LAI quantile": lambda treatment, probability: lai_distribution(treatment).ppf(probability),
    "leaf": _leaf,
    "SAIL": _sail,
    "interpolated canopy": _interpolated,
    "two layers": _two_layers,
    "crowns": _crowns,
    "extinction": extinction_coefficient,
    "light budget": _light_budget,
    "moist soil": _moist_soil,
    "plane": _tilted,
    "valley": _valley_sky,
    "wave": _wave_between_cells,
    "air": _air,
    "optical depth of molecules": lambda wavelength, **air: Atmosphere(**air).rayleigh_optical_depth(wavelength),
    "coupling term": _terms,
    "apparent reflectance": _toa,
    "light of molecules": _molecules,
    "environment function": _environment,
    "round target": _round_target,
    "cloud displacement": _cloud_shift,
    "cloud albedo": two_stream_reflectance,
    "cloud layer": _cloud_layer,
    "cloud cover": _cloud_cover,
    "wavelength": lambda name, band: _band(name, band).wavelength,
    "signal-to-noise": lambda name, band, radiance: instrument(name).noise_model(_band(name, band)).snr(radiance),
    "transfer": _transfer,
    "bright cell": _bright_cell,
    "recorded": _recorded,
    "noise variance": _noise_variance,
    "line of sight": _line_of_sight,
    "swath": scan.swath_width,
    "track": lambda **orbit: scan.Track.from_inclination(**orbit).heading,
    "sun": _sun,
    "index": _index,
    "line": _line,
    "Ross-Li": ross_li,
    "slope correction": _slope_corrected,
    "NDVI curvature": lambda of, red, nir: ndvi_hessian(red, nir)[*of],
    "SL2P": _networks,
    "light-use production": light_use_gpp,
    "production of leaves": canopy_photosynthesis,
    "PT-JPL": lambda **given: pt_jpl(**given).le,
    "Penman-Monteith": lambda **given: penman_monteith(**given).le,
    "reference evapotranspiration": reference_evapotranspiration,
    "two-stream": lambda part, **canopy: getattr(two_stream(**canopy), part),
}
