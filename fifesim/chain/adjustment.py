"""Spectral adjustment: bands of one instrument estimated from bands of another, and the resulting image."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, TypeAlias

import numpy as np
import pandas as pd
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.atmosphere.models import Atmosphere
from fifesim.base import files
from fifesim.base.arguments import Names, NoiseKinds, Range, Time, WholeNumber
from fifesim.base.caches import cached
from fifesim.base.footprints import Boxcar
from fifesim.base.geometry import ANGLES
from fifesim.base.messages import warn
from fifesim.chain.steps import as_bands_of, to_toa
from fifesim.grids import cf, directions
from fifesim.grids import grid as grids
from fifesim.grids.dates import by_date
from fifesim.grids.directions import Directions
from fifesim.grids.inputs import Image, RasterOrDataset
from fifesim.grids.reductions import combined
from fifesim.ground.canopy.spectra import library_spectra
from fifesim.sensor import labels as sensor
from fifesim.sensor.band_labels import MIN_COVERAGE
from fifesim.sensor.description.fields import AlongAcross
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.description.spectral_response import half_peak
from fifesim.sensor.instrument_labels import attributes_of, carried_instrument, matching_bands
from fifesim.sensor.response.spatial import Difference, Mixture, SystemSpread
from fifesim.sensor.response.spectral import band_weights, best_linear, covered_steps, line_between

UNCERTAINTY = 0.0005
"""Default standard error of the reflectance in an adjustment [1]."""

Uncertainty: TypeAlias = Annotated[float, Range("1", 0, np.inf, note="it is in reflectance, such as 0.005", ends="()")]


@by_date
def adjust_bands(
    reflectance: RasterOrDataset,
    instrument: InstrumentLike,
    *,
    bands: Names | None = None,
    source: InstrumentLike | None = None,
    uncertainty: Uncertainty = UNCERTAINTY,
) -> xr.DataArray:
    """
    Estimate surface reflectance in the bands of another instrument.

    Each target band is a weighted sum of all bands of the raster. The weights are the best linear estimate over a
    library of 4800 spectra from PROSPECT, SAIL and measured soils, with a wide range of leaves (green, red, dry and
    dead), leaf area, backgrounds and sun.

    Parameters
    ----------
    reflectance : xarray.DataArray
        Surface reflectance with a dimension ``band``, which has band names of the source or a coordinate ``wavelength``
        [um]. [1]
    instrument : str or Instrument
        The other instrument.
    bands : str or sequence of str, optional
        Names of its bands; all by default.
    source : str or Instrument, optional
        Instrument of the raster; by default from its attributes.
    uncertainty : float, optional
        Standard error of the reflectance, independent from band to band. With a larger value, such as 0.01 after an
        atmospheric correction, the estimate depends less on differences between bands. [1]

    Returns
    -------
    reflectance : xarray.DataArray
        Has a coordinate ``adjustment_error`` along band: the standard error over library spectra that were not used,
        leaving out one leaf at a time, including `uncertainty`. NaN if any input band is NaN. Lazy if the input is. [1]

    Raises
    ------
    ValueError
        If the raster is not surface reflectance, its instrument is unknown, or a target band does not overlap any of
        its bands.

    Notes
    -----
    The error is valid for land in general. On spectra from another code over other soils, the realised error was 0.8
    to 1.3 times the stated one in each band of ten pairs of instruments; for bare soil or dead grass alone, up to 3.3
    times. The error is not valid for snow and water. Grey surfaces change by at most 2 %, 4 % in OLI1 from ETM+.
    Directions of sun and view do not change.

    See Also
    --------
    fifesim.sensor.spectral_adjustment, fifesim.sensor.as_seen_by

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> scene = lai.fifesim.surface_reflectance("MSI")
    >>> red_and_nir = scene.fifesim.adjust_bands("TM", bands=["TM3", "TM4"])
    >>> red_and_nir.mean(["y", "x"]).round(2).values
    array([0.09, 0.23])
    """
    if {"y", "x"} <= set(reflectance.dims):  # and not spectra of the field
        reflectance = as_bands_of(reflectance, source, "surface_reflectance")
    cf.check_quantity(reflectance, "surface_reflectance")
    description = find_instrument(instrument)
    from_bands = _source_bands(reflectance, source)
    to = description.select(bands)
    _check_neighbours(from_bands, to, description)
    estimate = _estimate(_responses(from_bands), _responses(to), float(uncertainty))
    out = combined(reflectance, "band", estimate.weights)
    along_band = {"wavelength": [band.wavelength for band in to], "adjustment_error": estimate.error}
    out = out.assign_coords(cf.band_coordinates(band=[band.name for band in to], **along_band))
    out.encoding = {"grid_mapping": "spatial_ref"} if "spatial_ref" in out.coords else {}
    names = " ".join(band.name for band in from_bands)
    history = f"adjust_bands: {description.name} from {names}, uncertainty {uncertainty:g}"
    return cf.label(out, "surface_reflectance", source=reflectance, history=history, **attributes_of(description))


@by_date
def as_seen_by(
    reflectance: RasterOrDataset,
    instrument: InstrumentLike,
    *,
    bands: Names | None = None,
    source: InstrumentLike | None = None,
    atmosphere: Atmosphere | None = None,
    time: Time | None = None,
    geometry: Directions | None = None,
    onto: GeoBox | None = None,
    noise: NoiseKinds = (),
    seed: WholeNumber = 0,
    uncertainty: Uncertainty = UNCERTAINTY,
    recorded: bool | None = None,
) -> Image:
    """
    Simulate the image of a scene by another instrument, from surface reflectance.

    The function applies `adjust_bands`, `to_toa` and `sense` in sequence. Call them separately for further options.

    A scene that an instrument recorded is blurred already: only the difference of both blurs is applied, by the ratio
    of the modulation transfers, with a floor. A warning names the bands with a ``contrast_left`` below 0.9.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        As in `adjust_bands`. Its pixels are the ground cells of the simulation and should be smaller than the pixels of
        the other instrument. [1]
    instrument : str or Instrument
        The other instrument.
    bands, source, uncertainty : optional
        As in `adjust_bands`.
    atmosphere : Atmosphere, optional
        As in `to_toa`.
    time : str or datetime, optional
        Overpass time of the other instrument, in UTC unless it has a time zone. The sun is computed for the scene
        centre; the view is taken from the raster. The new sun changes irradiance and atmosphere, but not the
        reflectance factor.
    geometry : Geometry, optional
        Directions of sun and sensor, instead of ``time``; by default from the raster.
    onto, noise, seed : optional
        As in `sense`.
    recorded : bool, optional
        Whether the source recorded the raster, so that its pixels have the source's blur; otherwise they are cells of
        the ground. By default images from `sense`, `open_landsat` and `open_sentinel2` are recorded.

    Returns
    -------
    image : xarray.DataArray of unsigned integers, dims (band, y, x), or xarray.DataTree
        As from `sense`, with coordinates along band: ``adjustment_error`` of the surface reflectance, and for a
        recorded scene ``contrast_left``, the contrast at the Nyquist frequency of the pixels relative to an image of
        the ground.

    Raises
    ------
    ValueError
        If both time and geometry are given; else as in `adjust_bands`, `to_toa` and `sense`.

    See Also
    --------
    fifesim.sensor.adjust_bands, fifesim.to_toa, fifesim.sense

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> scene = lai.fifesim.surface_reflectance("MSI")
    >>> tm = scene.fifesim.as_seen_by("TM", bands=["TM3", "TM4"])
    >>> tm.shape, tm.dtype
    ((2, 10, 10), dtype('uint8'))
    """
    description = find_instrument(instrument)
    by = reflectance.attrs.get("recorded_by")
    reflectance = as_bands_of(reflectance, source, "surface_reflectance")
    geometry = _geometry(reflectance, time, geometry)
    reflectance = directions.dated(reflectance, time)
    surface = adjust_bands(reflectance, description, bands=bands, source=source, uncertainty=uncertainty)
    # Under a new sun the reflectance factor stays.
    factor = surface if geometry is None else surface.drop_vars(ANGLES, errors="ignore")
    toa = to_toa(factor, atmosphere, geometry=geometry, instrument=description)
    along_band, line_spreads, recorder = [surface["adjustment_error"]], None, _source(reflectance, source)
    if _is_recorded(recorded, by, recorder):
        differences = _differences(reflectance, recorder, description, description.select(bands), uncertainty)
        along_band.append(_contrast_left(differences, description, recorder))
        line_spreads = {band: _spreads(axes) for band, axes in differences.items()}.__getitem__
        note = f"as_seen_by: blur of {description.name} less the blur of {recorder.name}, floor {_FLOOR:g}"
        toa = toa.assign_attrs(history=f"{toa.attrs['history']}\n{note}")
    image = sensor.sensed(
        toa, description, onto=onto, noise=noise, seed=seed, geometry=geometry, line_spreads=line_spreads
    )
    if isinstance(image, xr.DataTree):
        found = {node.path: _with_bands(node.to_dataset(), along_band) for node in image.leaves}
        return xr.DataTree.from_dict(found)
    return _with_bands(image, along_band)


def _with_bands(image, along_band):
    """Add coordinates along band to an image."""
    # Use variables: a DataArray would add its sun coordinates.
    found = {each.name: each.sel(band=image["band"].values).variable for each in along_band}
    return image.assign_coords(found)


# Transfer of the source below which the difference of two blurs falls to zero: contrasts grow 2.6 times at most.
_FLOOR = 0.2

# Share of the contrast at the Nyquist frequency below which an image is called too smooth.
_TOO_SMOOTH = 0.9


def _source(array, given):
    """Instrument of the bands of a raster, as given or from its attributes."""
    description = carried_instrument(array) if given is None else find_instrument(given)
    if description is None:
        raise ValueError("the instrument of the raster is unknown: give source=, such as source='MSI'")
    return description


def _is_recorded(given, by, source):
    """Whether the source recorded a raster: as given, else from its attributes."""
    if given is not None:
        return given
    if by not in (None, source.name):
        warn(
            f"{by} recorded the scene before its bands were converted to {source.name}: its blur stays; give the "
            f"image of {by} itself"
        )
    return by == source.name


def _differences(array, recorder, description, bands, uncertainty):
    """Differences between the blur of bands and of the raster that they are estimated from, by band and axis."""
    own = matching_bands(array, recorder)
    shares = _variance_shares(_responses(own), _responses(bands), float(uncertainty))
    cells = grids.cell_size(grids.geobox(array))
    out = {}
    for band, share in zip(bands, shares.tolist(), strict=True):
        parts = [_parts(recorder, each, cells) for each in own]
        mixed = [Mixture(tuple(share), each) for each in zip(*parts, strict=True)]
        pairs = zip(description.line_spreads(band), mixed, strict=True)
        out[band] = [Difference(target, recorded, _FLOOR) for target, recorded in pairs]
    return out


def _parts(recorder, band, cells):
    """Parts of the blur of a recorded raster in one band, along and across the track."""
    pixel, out = recorder.pixel(band), []
    for spread, cell in zip(recorder.line_spreads(band), cells, strict=True):
        # Cells are uniform in themselves. Larger ones than the pixel are means of pixels, smaller ones repeat them.
        means = (Boxcar(cell),) if cell > 1.01 * pixel else ()
        out.append((spread, *means, Boxcar(max(cell, pixel))))
    return out


def _spreads(axes):
    """Line spread functions of differences along and across the track."""
    return AlongAcross(*(SystemSpread((each,)) for each in axes))


def _contrast_left(differences, description, recorder):
    """Contrast at the Nyquist frequency of the pixels relative to an image of the ground, along band."""
    left = {
        band.name: min(float(each.left(0.5 / description.pixel(band))) for each in axes)
        for band, axes in differences.items()
    }
    if smooth := {name: value for name, value in left.items() if value < _TOO_SMOOTH}:
        low, high = min(smooth.values()), max(smooth.values())
        share = f"{low:.0%}" if high - low < 0.005 else f"{low:.0%} to {high:.0%}"
        warn(
            f"the image of {', '.join(smooth)} is too smooth: it has {share} of the contrast of {description.name} at "
            f"the Nyquist frequency of its pixels, because {recorder.name} recorded little there; take a scene of "
            "smaller pixels"
        )
    labels = {"name": "contrast_left", "attrs": cf.attributes("contrast_left")}
    return xr.DataArray(list(left.values()), dims="band", coords={"band": list(left)}, **labels)


@cached(64, "shares of bands in estimates")
def _variance_shares(sources, targets, uncertainty):
    """Shares of the source's bands in the variance of each estimated band over the library, which sum to 1."""
    _, spectra = library_spectra()
    weights = _estimate(sources, targets, uncertainty).weights
    means = (spectra @ _weights(sources).T).reshape(-1, len(sources))
    covariance = np.atleast_2d(np.cov(means, rowvar=False))
    shares = weights * (weights @ covariance)
    return shares / shares.sum(axis=1, keepdims=True)


def spectral_adjustment(source: InstrumentLike, target: InstrumentLike, *, bands: Names | None = None) -> xr.Dataset:
    """
    Linear relations between bands of two instruments: target = slope * source + offset.

    Parameters
    ----------
    source, target : str or Instrument
    bands : str or sequence of str, optional
        Names of target bands; by default all that overlap a source band.

    Returns
    -------
    lines : xarray.Dataset, dims (band)
        For each target band: ``source_band``, the source band with the nearest mean wavelength; ``slope`` and
        ``offset`` by least squares over the library of spectra; ``error``, the standard deviation about the line;
        ``difference``, the root mean square difference of the bands without adjustment; and ``published_slope``,
        ``published_offset`` and ``reference``, a published line and its source, NaN or empty if none is known. [1]

    Raises
    ------
    ValueError
        If a requested target band does not overlap any source band.

    Notes
    -----
    Published tables give one line for all land surfaces. `adjust_bands` uses all bands; its errors are several times
    smaller.

    See Also
    --------
    fifesim.sensor.adjust_bands

    Examples
    --------
    >>> import fifesim
    >>> lines = fifesim.sensor.spectral_adjustment("MSI", "OLI", bands=["OLI4"])
    >>> lines.source_band.item(), lines.slope.round(2).item()
    ('MSI4', 0.97)
    """
    source, target = find_instrument(source), find_instrument(target)
    to = target.select(bands) if bands is not None else [band for band in target.bands if _beside(source.bands, band)]
    _check_neighbours(source.bands, to or target.bands, target)
    nearest = [min(source.bands, key=lambda band: abs(band.wavelength - each.wavelength)) for each in to]
    _, spectra = library_spectra()
    own, other = (spectra @ _weights(_responses(each)).T for each in (nearest, to))
    lines = [line_between(own[..., number], other[..., number]) for number in range(len(to))]
    columns = {name: [getattr(line, name) for line in lines] for name in ("slope", "offset", "error", "difference")}
    pairs = zip(nearest, to, strict=True)
    columns |= _published([(source.name, band.name, target.name, each.name) for band, each in pairs])
    columns["source_band"] = [band.name for band in nearest]
    coords = cf.band_coordinates(band=[band.name for band in to], wavelength=[band.wavelength for band in to])
    attrs = {"source": source.name, "target": target.name, "comment": "target = slope * source + offset"}
    return xr.Dataset({name: ("band", values) for name, values in columns.items()}, coords=coords, attrs=attrs)


def _source_bands(array, source):
    """Bands of a raster, from the given instrument or its attributes."""
    description = _source(array, source)
    if "band" not in array.dims:
        raise ValueError(f"the raster needs a dimension band, got {array.dims}: keep all of its bands")
    return matching_bands(array, description)


def _geometry(array, time, geometry):
    """Directions of sun and sensor as given, or from the time, the scene centre and the view of the scene."""
    if time is None:
        return geometry
    if geometry is not None:
        raise ValueError("time and geometry both determine the sun: give one of them")
    sun = directions.sun_over(grids.geobox(array), time)
    own = directions.uniform_geometry(directions.geometry_of(array) or sun, "as_seen_by with a time")
    return replace(sun, vza=own.vza, vaa=own.vaa)


def _responses(bands):
    return tuple(band.response for band in bands)


def _beside(sources, band):
    """Whether any source band overlaps a band, both at half of their peak response."""
    low, high = half_peak(band.response)
    return any(limits[0] <= high and low <= limits[1] for limits in (half_peak(each.response) for each in sources))


def _check_neighbours(sources, bands, instrument):
    """Raise ValueError for bands that do not overlap a source band."""
    alone = [band.name for band in bands if not _beside(sources, band)]
    if alone:
        others = [band.name for band in bands if band.name not in alone]
        raise ValueError(
            f"no source band overlaps {', '.join(alone)} of {instrument.name}: select bands, bands={others or '[...]'}"
        )


@cached(64, "weights of library spectra in bands")
def _weights(responses):
    """Weights of the wavelengths of the library in each band."""
    wavelength, _ = library_spectra()
    found = [band_weights(band, wavelength, covered_steps(wavelength)) for band in responses]
    for band, each in zip(responses, found, strict=True):
        if each.coverage < MIN_COVERAGE:
            low, high = band.limits
            raise ValueError(
                f"band {band.name}, {low:g} to {high:g} um, exceeds the spectral library, "
                f"{wavelength[0]:g} to {wavelength[-1]:g} um: leave it out"
            )
    return np.stack([each.weights for each in found])


@cached(64, "regressions between bands")
def _estimate(sources, targets, uncertainty):
    """Best linear estimate of bands from other bands over the library."""
    _, spectra = library_spectra()
    return best_linear(spectra @ _weights(sources).T, spectra @ _weights(targets).T, uncertainty)


def _published(pairs):
    """Published lines by (source, band, target, band)."""
    keys = ["source", "source_band", "target", "target_band"]
    table = files.table("spectral_adjustment.csv").set_index(keys)
    rows = table.reindex(pd.MultiIndex.from_tuples(pairs, names=keys))
    return {
        "published_slope": rows["slope"].to_numpy(float),
        "published_offset": rows["offset"].to_numpy(float),
        "reference": rows["reference"].fillna("").to_numpy(str),
    }
