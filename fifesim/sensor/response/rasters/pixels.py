"""Pixels of an instrument over a labelled scene: where they lie, and the means over their footprints."""

import numpy as np
import xarray as xr

from fifesim.rasters import directions, projection
from fifesim.rasters import grid as grids
from fifesim.rasters.regularization import areas, regularized
from fifesim.sensor.response.rasters.footprints import check_scene, shifts_of


def pixel_grid(scene, instrument, bands, onto=None, interval=None):
    """
    Grid of pixels that an image lies on.

    Parameters
    ----------
    scene : odc.geo.geobox.GeoBox
    instrument : fifesim.sensor.description.instruments.Instrument
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
    onto, interval : optional
        As in `fifesim.sensor.raster.sense`.

    Returns
    -------
    pixels : odc.geo.geobox.GeoBox

    Raises
    ------
    ValueError
        If bands lie on different grids, both ``onto`` and ``interval`` are given, the CRS differs, or ``onto`` lies
        beside the scene.
    """
    if onto is not None:
        if interval is not None:
            raise ValueError("onto and interval both say where pixels lie: give one of them")
        pixels = grids.check_grid(onto)
        if pixels.crs != scene.crs:
            wanted, got = (projection.name_of(grid.crs.proj) for grid in (scene, pixels))
            raise ValueError(
                f"onto must be in the CRS of the scene, {wanted}, got {got}: make it there, such as "
                f"fifesim.grid_at({wanted!r}, west, north, width, height, cell)"
            )
        _check_overlap(pixels, scene)
        return pixels
    if interval is None:
        return grids.aligned(scene, common_size(instrument, bands, lambda band: (instrument.pixel(band),) * 2))
    if isinstance(interval, str):
        if interval != "native":
            raise ValueError(f"interval must be 'native', or metres between pixels, got {interval!r}")
        return grids.aligned(scene, common_size(instrument, bands, instrument.ground_intervals))
    if np.shape(interval) not in ((), (2,)) or not np.all(np.isfinite(interval)) or np.min(interval) <= 0:
        raise ValueError(
            f"interval must be 'native', or positive metres between pixels, down and across, got {interval}"
        )
    return grids.aligned(scene, interval)


def _check_overlap(pixels, scene):
    """Raise ValueError if no pixel lies on the scene."""
    one, two = pixels.boundingbox, scene.boundingbox
    if one.left >= two.right or one.right <= two.left or one.bottom >= two.top or one.top <= two.bottom:
        spans = [f"{b.left:.0f} to {b.right:.0f} E and {b.bottom:.0f} to {b.top:.0f} N" for b in (one, two)]
        raise ValueError(f"onto must overlap the scene, which spans {spans[1]}: it spans {spans[0]}")


def bands_by_grid(instrument, bands, onto=None, interval=None):
    """
    Bands that share a grid of pixels.

    Parameters
    ----------
    instrument, bands, onto, interval
        As in `pixel_grid`.

    Returns
    -------
    groups : dict of str to list of int
        Numbers of the bands by the size of their pixels in words, such as ``10m``, the smallest first.
    """
    if onto is not None or interval not in (None, "native"):
        return {"": list(range(len(bands)))}
    size = instrument.ground_intervals if interval else (lambda band: (instrument.pixel(band),) * 2)
    groups = {}
    for number, band in enumerate(bands):
        groups.setdefault(tuple(size(band)), []).append(number)
    words = {each: f"{each[0]:g}m" if each[0] == each[1] else f"{each[0]:g}x{each[1]:g}m" for each in groups}
    return {words[each]: groups[each] for each in sorted(groups)}


def common_size(instrument, bands, size):
    """
    Size that bands share, such as that of their pixels.

    Parameters
    ----------
    instrument : fifesim.sensor.description.instruments.Instrument
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
    size : callable
        ``size(band)`` gives metres along and across the track.

    Returns
    -------
    along, across : float
        [m]

    Raises
    ------
    ValueError
        If the bands differ.
    """
    names = {}
    for band in bands:
        names.setdefault(tuple(size(band)), []).append(band.name)
    if len(names) > 1:
        groups = "; ".join(f"{along:g} x {across:g} m: {', '.join(each)}" for (along, across), each in names.items())
        raise ValueError(
            f"bands of {instrument.name} lie on different grids ({groups}): sense each group by itself, or bring all "
            "onto one grid with onto= or interval="
        )
    return next(iter(names))


def means_by_band(array, instrument, bands, pixels, *, offset=(0.0, 0.0), min_valid):
    """
    Means over the footprints of pixels, each band with its own line spread functions.

    Parameters
    ----------
    array : xarray.DataArray, dims (band, y, x)
    instrument : fifesim.sensor.description.instruments.Instrument
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
        One for each of the array.
    pixels : odc.geo.geobox.GeoBox
    offset : (float or array, float or array), optional
        As in `fifesim.sensor.raster.sense`. [pixel]
    min_valid : float
        [1]

    Returns
    -------
    means : xarray.DataArray, dims (band, y, x)

    Raises
    ------
    ValueError
        If an offset has another length than its axis, or a line spread is wider than the scene.

    See Also
    --------
    fifesim.base.footprints.regularize
    """
    shifts = shifts_of(offset, pixels)

    def means(part, spreads, names):
        check_scene(spreads, grids.geobox(array), min_valid, f"{instrument.name} {names}")
        return regularized(part, spreads, pixels, shifts=shifts, min_valid=min_valid)

    return grids.place(by_line_spread(means, array, instrument, bands), pixels)


def by_line_spread(means, array, instrument, bands):
    """
    Raster made of bands that share their line spread functions at a time.

    Parameters
    ----------
    means : callable
        ``means(part, spreads, names)`` makes it of the bands that have these line spread functions.
    array : xarray.DataArray, dims (band, y, x)
    instrument : fifesim.sensor.description.instruments.Instrument
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
        One for each of the array.

    Returns
    -------
    raster : xarray.DataArray, dims (band, ...)
        Bands in the order of the array.
    """
    groups = {}
    for number, band in enumerate(bands):
        groups.setdefault(instrument.line_spreads(band), []).append(number)
    parts = [
        means(
            array if len(groups) == 1 else array.isel(band=numbers), spreads, ", ".join(bands[n].name for n in numbers)
        )
        for spreads, numbers in groups.items()
    ]
    if len(parts) == 1:
        return parts[0]
    joined = xr.concat(parts, dim="band", combine_attrs="override", coords="minimal", compat="override", join="exact")
    return joined.isel(band=np.argsort(np.concatenate(list(groups.values()))))


def directions_on(pixels, geometry):
    """
    Directions of sun and sensor at the pixels, where they vary over the cells.

    Parameters
    ----------
    pixels : odc.geo.geobox.GeoBox
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset

    Returns
    -------
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset
        Means of the zenith angles, and the azimuths of mean vectors, over each pixel.
    """

    def mean(array):
        return regularized(array, areas(pixels), pixels, min_valid=0.01)

    def azimuth(array):
        radians = np.radians(array)
        return np.degrees(np.arctan2(mean(np.sin(radians)), mean(np.cos(radians)))) % 360

    averaged = {"sza": mean, "vza": mean, "saa": azimuth, "vaa": azimuth}
    names = directions.varying(geometry)
    if not names:
        return geometry
    kept = {name: geometry[name].variable for name in geometry.data_vars if name not in names}
    return xr.Dataset(kept | {name: averaged[name](geometry[name]) for name in names})
