"""Trade studies: scatter of LAI, FPAR and production on NDVI over designs of an instrument, without simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Annotated, Any

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox
from threadpoolctl import threadpool_limits

from fifesim.analysis.scaling import shapley
from fifesim.base.arguments import PLAIN, Array
from fifesim.base.messages import nearest, warn
from fifesim.experiments.analytic import Pixel, coefficients, mean_of_cells, reach_of
from fifesim.experiments.scatter.analytic import (
    Covariances,
    IndexImage,
    Recording,
    footprints,
    obstacles,
)
from fifesim.experiments.scatter.errors import mean_canopy, of_pixels, target_of
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.grids.reductions import areas
from fifesim.models.weather import Weather
from fifesim.scenario.scenario import Scenario
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as description_of

_UNITS = {"bands": "", "pixel": "m", "mtf": "1", "registration": "m", "snr": "1"}
_VARIABLES = ("lai", "fpar", "gpp")
# Share of rounding in the variance of NDVI, up to which it is as good as independent: 1 - R2 is right within 0.001.
_LARGEST_ROUNDING = 0.03
# Noise in digital numbers, above which the correlation of rounding errors with the signal is below 1 %.
_SMALLEST_NOISE = 0.5
_STAGES = ("ground", "point spread", "registration", "noise")


def trade(
    instrument: InstrumentLike,
    designs: Annotated[Mapping[str, Sequence[Any] | Array], PLAIN],
    scenario: Scenario | None = None,
    *,
    weather: Weather | None = None,
) -> xr.Dataset:
    """
    Compare designs of an instrument by the scatter of LAI, FPAR and production on its NDVI.

    The covariances of pixels are computed from the covariances of cells, as in ``budget(method="analytic")``, so that a
    thousand designs take less than a second.

    Parameters
    ----------
    instrument : str, path-like or Instrument
    designs : mapping
        Values by name; designs are all combinations. "pixel" [m]: blur and interval change by the same factor, as in
        `Instrument.replace`. "mtf" [1]: modulation transfer at the Nyquist frequency of the sampling interval. "snr"
        [1]: ratio at the radiance that the instrument's file states. "registration" [m]: displacement of pixels along
        both axes. "bands": pairs of names for red and near infrared. The instrument gives the parts that are left out.
    scenario : Scenario, optional
        Ground, light and air: leaf area of one stand or a learned landscape on level ground, without clouds. By default
        the learned landscape of ``fifesim.Scenario()`` with uniform soil and dead leaves.
    weather : Weather, optional
        Numbers for the production; by default `fife_weather`, which is assumed, with a warning outside the FIFE site.

    Returns
    -------
    results : xarray.Dataset
        Dimensions are the designs and ``variable`` (lai, fpar, gpp), whose ``units`` are a coordinate. ``r2`` and
        ``slope`` of the regression of the variable on NDVI; ``rmse``, its residual standard deviation; ``share`` of
        each ``stage`` in 1 - R2: "ground" is 1 - R2 of an ideal instrument, to which point spread, registration and
        noise (with rounding) add their Shapley shares. ``r2_uncertainty`` is half of the difference of R2 between the
        sharpest and the softest blur, NaN where the instrument states no uncertainty or "mtf" is given.

    Raises
    ------
    ValueError
        If a design is unknown or out of range, pixels are smaller than the cells of the ground, the noise of the
        instrument is unknown, digital numbers are too coarse, or the scenario needs simulation.

    Warns
    -----
    UserWarning
        If registration is left out and the instrument has none: it is taken as 0.

    See Also
    --------
    fifesim.budget, fifesim.Instrument.replace, fifesim.output.plot_trade

    Examples
    --------
    >>> import fifesim
    >>> found = fifesim.trade("TM", {"pixel": [10, 20, 30, 60], "registration": [0.0, 5.0]})
    >>> found.r2.sel(variable="lai", registration=5.0).round(2).values
    array([0.72, 0.79, 0.81, 0.83])
    """
    own = description_of(instrument)
    if scenario is None:
        ground = {"soil": 0.0, "brown": 0.05, "moisture": 0.1}
        scenario = Scenario(ground=ground, terrain={"dem": "flat"})
    axes = _axes(own, designs)
    blurs = [own.replace(mtf=float(each)) for each in axes["mtf"]] if "mtf" in designs else [own, *_ends(own)]
    target = target_of("gpp", scenario, weather)
    # Threads of BLAS take 50 times as long for matrices of this size if a core is busy.
    with threadpool_limits(1, user_api="blas"):
        parts = [_scatter(own, pair, blurs, axes, scenario, target) for pair in axes["bands"]]
    slope, rmse, scatter = (np.stack(each) for each in zip(*parts, strict=True))
    # The last two instruments are the ends of an uncertain blur.
    count = len(axes["mtf"])
    total, dims = scatter[:, 1, 1, 1], ("bands", "variable", "pixel", "mtf", "registration", "snr")
    uncertainty = np.full((*total.shape[:3], count, *total.shape[4:]), np.nan)
    if len(blurs) > count:
        uncertainty = np.abs(total[:, :, :, 1:2] - total[:, :, :, 2:]) / 2
    added = np.moveaxis(shapley(np.moveaxis(scatter, 0, 3), 3), 0, 1)
    share = np.concatenate([scatter[:, 0, 0, 0][:, None], added], axis=1)
    found = {
        "r2": (dims, 1 - total[:, :, :, :count]),
        "slope": (dims, slope[:, :, :, :count]),
        "rmse": (dims, rmse[:, :, :, :count]),
        "r2_uncertainty": (dims, uncertainty),
        "share": (("bands", "stage", *dims[1:]), share[:, :, :, :, :count]),
    }
    axes["bands"] = [", ".join(pair) for pair in axes["bands"]]
    coordinates = {name: (name, axes[name], {"units": unit} if unit else {}) for name, unit in _UNITS.items()}
    coordinates["units"] = ("variable", [cf.QUANTITIES[name].units for name in _VARIABLES], {})
    made = xr.Dataset(found, coordinates, {"instrument": own.name})
    made = made.assign_coords(variable=list(_VARIABLES), stage=list(_STAGES))
    made = made.isel({name: 0 for name in _UNITS if name not in designs}, drop=True)
    return made.transpose("stage", "variable", *designs)


def _axes(own, designs):
    """Values of all parts of a design, from the instrument for the parts that are left out."""
    if unknown := [name for name in designs if name not in _UNITS]:
        hint = nearest(unknown[0], _UNITS)
        raise ValueError(f"unknown design {unknown[0]!r}: {hint}there are {', '.join(_UNITS)}")
    axes = {name: [values] if np.ndim(values) == 0 else list(values) for name, values in designs.items()}
    if empty := [name for name, values in axes.items() if not values]:
        raise ValueError(f"{empty[0]} needs at least one value")
    pairs = axes.get("bands") or [[band.name for band in own.red_and_near_infrared()]]
    axes["bands"] = [pairs] if isinstance(pairs[0], str) else pairs
    if wrong := [pair for pair in axes["bands"] if len(pair) != 2]:
        raise ValueError(f"bands: each must be a pair of names, of red and near infrared, got {wrong[0]}")
    axes.setdefault("pixel", [own.pixel(own.select(axes["bands"][0])[0])])
    axes.setdefault("mtf", [np.nan])
    axes.setdefault("snr", [np.nan])
    if "registration" not in axes:
        if own.geolocation is None:
            warn(f"the geolocation error of {own.name} is unknown and taken as 0: give registration [m]")
        axes["registration"] = [own.geolocation or 0.0]
    for snr in designs.get("snr", ()):
        own.replace(snr=float(snr))  # raises outside of the range
    if not all(0 <= error < np.inf for error in axes["registration"]):
        raise ValueError(f"registration must be at least 0 m, got {axes['registration']}")
    return axes


def _ends(own):
    """The instrument with its sharpest and its softest blur; none if it states no uncertainty."""
    try:
        return [description_of(own, "sharpest"), description_of(own, "softest")]
    except ValueError:
        return []


def _scatter(own, pair, blurs, axes, scenario, target):
    """Slope and rmse, shape (variable, pixel, blur, registration, snr), and scatter by blur, registration and noise."""
    bands = sorted(own.select(pair), key=lambda band: band.wavelength)
    if unknown := [band.name for band in bands if band.noise is None]:
        raise ValueError(
            f"the description of {own.name} has no noise for {', '.join(unknown)}: give noise = {{ snr = ..., "
            "radiance = ... } of its bands in an instrument file"
        )
    keys = {"instrument": own, "bands": [band.name for band in bands], "noise": ["all"], "offset": [0.0, 0.0]}
    keys |= {"pixel": None, "interval": "product", "response": None, "noise_model": {}}
    scenario = scenario.model_copy(update={"sensor": scenario.sensor.model_copy(update=keys)}).complete()
    if reasons := obstacles(scenario):
        raise ValueError(f"a trade study does not hold: {'; '.join(reasons)}. Or simulate with fifesim.scenario.sweep")
    seen = [_footprints(scenario, size, blurs, bands, axes["registration"]) for size in axes["pixel"]]
    covariances = Covariances(scenario, max(reach_of([each for pair in rows for each in pair]) for rows in seen))
    made = of_pixels(covariances.scene, target, mean_canopy(covariances.scene), covariances.areas)
    gpp = np.interp(covariances.lai, covariances.areas, made)
    covariances.prepared.properties["gpp"] = coefficients(gpp)
    shape = len(seen), len(blurs) + 1, len(axes["registration"]) + 1
    lines = [_lines(covariances, rows[0][0], each) for rows in seen for each in rows]
    found = [[(one.truth_variance, one.image_variance, one.covariance) for one in each] for each in lines]
    truth, clear, both = np.moveaxis(np.reshape(found, (*shape, len(_VARIABLES), 3)), (-1, -2), (0, 1))
    noise = np.moveaxis(np.array([each[0].noise for each in lines]).reshape(*shape, -1), -1, 0)
    clear = clear - noise.sum(axis=0)
    # Variance of the noise of each band and ratio.
    scale = np.array([[_relative_noise(band, snr) for snr in axes["snr"]] for band in bands])
    _check_rounding(covariances, (noise[0] / clear[0]).max(), scale.min(axis=1, keepdims=True))
    noise = noise[0][..., None] + np.tensordot(noise[1:], scale, (0, 0))
    # Footprints with and without blur and displacement.
    blur, shift = (np.stack([np.zeros(count - 1, int), np.arange(1, count)]) for count in shape[1:])
    states = np.index_exp[..., blur[:, None, :, None], shift[None, :, None, :]]
    image = np.stack([np.zeros_like(noise), noise]) + clear[0][..., None]
    image = np.moveaxis(image, -1, 0)[states]
    scatter = 1 - (both**2 / truth)[states] / image[:, :, None]
    # Axes (snr, noise, variable, pixel, blurred, displaced, blur, registration) to the order of the result.
    scatter = np.transpose(scatter, (4, 5, 1, 2, 3, 6, 7, 0))
    slope = np.moveaxis(both[..., 1:, 1:] / image[:, 1, None, :, 1, 1], 0, -1)
    return slope, np.sqrt(scatter[1, 1, 1] * truth[..., 1:, 1:, None]), scatter


def _footprints(scenario, size, blurs, bands, errors):
    """Footprints of both bands of a pixel, sharp and with each blur, in place and displaced by each error."""
    cells = scenario.geobox()
    cell = grids.cell_size(cells)[0]
    if not cell <= size < np.inf:
        raise ValueError(f"pixel = {size:g} m: cells have {cell:g} m: give pixels of at least one cell, or grid.cell")
    scale = size / scenario.sensor.size
    made = [each.replace(gsd=each.gsd * scale) for each in blurs]
    spreads = [[each.line_spreads(band) for band in each.select([band.name for band in bands])] for each in made]
    widest = max(line.half_width for pair in spreads for both in pair for line in both)
    count = int(np.ceil((2 * (widest + max(errors)) + 3 * size) / cell))
    around = GeoBox((count, count), cells.affine, cells.crs)
    blocks = grids.aligned_grid(around, size)
    shifts = [error / size for error in (0.0, *errors)]
    pairs = [[areas(blocks)] * 2, *spreads]
    return [footprints(pair, around, blocks, (shift, shift)) for pair, shift in product(pairs, shifts)]


def _lines(covariances, square, seen):
    """Regressions of the variables on NDVI with blur, rounding and noise."""
    bands = tuple(Pixel((f"{name}1",), (each,), mean_of_cells) for name, each in zip(("red", "nir"), seen, strict=True))
    image = IndexImage(covariances, 1, bands, Recording(rest=_rounding(covariances)), True)
    truths = [Pixel((name,), (square,), mean_of_cells) for name in _VARIABLES]
    return covariances.prepared.regressions(truths, Pixel(("red1", "nir1"), seen, image.ndvi, image.noise))


def _check_rounding(covariances, share, scale):
    """Raise ValueError if rounding errors depend on the signal: pixels and noise vary by less than digital numbers."""
    prepared = covariances.prepared
    seen = np.array([prepared.properties[f"{name}1"][:, :1].T @ prepared.strata for name in ("red", "nir")])
    spread = np.sqrt(covariances.grains(seen) * scale / (12 * _rounding(covariances))).min()
    if share > _LARGEST_ROUNDING and spread < _SMALLEST_NOISE:
        raise ValueError(
            f"a trade study does not hold: rounding has {share:.2g} of the variance of NDVI, at most "
            f"{_LARGEST_ROUNDING}, and noise has {spread:.2g} digital numbers, at least {_SMALLEST_NOISE} is needed: "
            "simulate with fifesim.scenario.sweep"
        )


def _rounding(covariances):
    """Variance of reflectance by rounding in both bands, shape (2, 1)."""
    return (covariances.driver.scale[0][:, None] / covariances.white) ** 2 / 12


def _relative_noise(band, snr):
    """Factor of the variance of the noise of a band for another ratio of signal to noise."""
    return 1.0 if np.isnan(snr) else (band.noise.equivalent_radiance * snr / band.noise.radiance) ** -2.0
