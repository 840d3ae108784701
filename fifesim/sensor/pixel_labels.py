"""Pixels of an instrument over a labelled scene: their positions, and means over their footprints."""

from contextvars import ContextVar

import numpy as np
import xarray as xr

from fifesim.base.arguments import described
from fifesim.base.messages import during, warn
from fifesim.grids import directions, projection
from fifesim.grids import grid as grids
from fifesim.grids.reductions import areas, regularized


def shifts_of(offset, pixels):
    """Registration errors southward and eastward, each a number or one for each row or column. [m]"""
    if not hasattr(offset, "__len__") or len(offset) != 2:
        raise ValueError(
            f"offset must be two, of rows and of columns in pixels, such as (0.5, 0.0), got {described(offset)}"
        )
    down, across = grids.cell_size(pixels)
    return _shift(offset[0], pixels.shape.y, down, "rows"), _shift(offset[1], pixels.shape.x, across, "columns")


def check_scene(spreads, scene, min_valid, name):
    """Raise ValueError if no pixel can have enough of its point spread on the scene."""
    along, across = spreads
    height, width = (count * size for count, size in zip(scene.shape, grids.cell_size(scene), strict=True))
    share = _within(along, height) * _within(across, width)
    if share < min(min_valid, 1.0) - 1e-9:
        raise ValueError(
            f"the point spread of {name}, {2 * along.half_width:.1f} x {2 * across.half_width:.1f} m, is wider than "
            f"the scene of {height:g} x {width:g} m, which holds {share:.0%} of it: simulate a larger scene, or accept "
            "it with min_valid="
        )


def _shift(offset, size, pixel, axis):
    """Offset in metres from pixels, one number or one for each pixel of an axis."""
    offset = np.asarray(offset, float)
    if offset.ndim > 1 or (offset.ndim and offset.size != size) or not np.all(np.isfinite(offset)):
        raise ValueError(
            f"the offset of {axis} must be a finite number of pixels, or {size} of them, one for each of the image's "
            f"{axis}, got shape {offset.shape}"
        )
    if np.abs(offset).min() >= size:
        raise ValueError(
            f"the offset of {axis} must be less than the {size} pixels of the image, got {offset.flat[0]:g}: every "
            "pixel would be outside the scene; give it in pixels, not metres"
        )
    return offset * pixel


def _within(spread, size):
    """Share of a response within a scene of some size around its middle. [1]"""
    return float(spread.cumulative(size / 2) - spread.cumulative(-size / 2))


def pixel_grid(scene, instrument, bands, onto=None, interval=None):
    """Grid of the pixels of an image."""
    if onto is not None:
        if interval is not None:
            raise ValueError("onto and interval both determine the pixel grid: give one of them")
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
        return grids.aligned_grid(scene, common_size(instrument, bands, lambda band: (instrument.pixel(band),) * 2))
    if isinstance(interval, str):
        if interval != "native":
            raise ValueError(f"interval must be 'native', or metres between pixels, got {interval!r}")
        return grids.aligned_grid(scene, common_size(instrument, bands, instrument.ground_intervals))
    if np.shape(interval) not in ((), (2,)) or not np.all(np.isfinite(interval)) or np.min(interval) <= 0:
        raise ValueError(
            f"interval must be 'native', or positive metres between pixels, down and across, got {interval}"
        )
    return grids.aligned_grid(scene, interval)


# Pixels of other sizes, relative to the instrument's own, have too much or too little blur for their size. [1]
_OWN = 0.8, 1.25

_WARNED = ContextVar("fifesim_warned_of_pixels", default=False)


def warned_of_pixels():
    """Context in which pixels of other sizes give no warning, because their user was warned."""
    return during(_WARNED)


def warn_of_pixels(instrument, bands, sizes):
    """Warn if pixels [m] have other sizes than the pixels and samples of an instrument, because its blur stays."""
    own = {size for band in bands for size in (instrument.pixel(band), *instrument.ground_intervals(band))}
    others = sorted({size for size in sizes if not any(_OWN[0] <= size / each <= _OWN[1] for each in own)})
    if others and not _WARNED.get():
        pixels = " and ".join(f"{size:g}" for size in sorted({instrument.pixel(band) for band in bands}))
        warn(
            f"pixels of {', '.join(f'{size:g}' for size in others)} m have the blur of {instrument.name}, made for "
            f"pixels of {pixels} m: smaller ones overlap and larger ones leave gaps, which changes R2. To compare "
            f"pixel sizes, give fifesim.instrument({instrument.name!r}).replace(gsd=...), in a scenario "
            "an instrument file with another gsd, or see fifesim.trade"
        )


def _check_overlap(pixels, scene):
    """Raise ValueError if no pixel is on the scene."""
    one, two = pixels.boundingbox, scene.boundingbox
    if one.left >= two.right or one.right <= two.left or one.bottom >= two.top or one.top <= two.bottom:
        spans = [f"{b.left:.0f} to {b.right:.0f} E and {b.bottom:.0f} to {b.top:.0f} N" for b in (one, two)]
        raise ValueError(f"onto must overlap the scene, which spans {spans[1]}: it spans {spans[0]}")


def _grouped(bands, key):
    """Numbers of the bands that share a key, by key."""
    groups = {}
    for number, band in enumerate(bands):
        groups.setdefault(key(band), []).append(number)
    return groups


def bands_by_grid(instrument, bands, onto=None, interval=None):
    """Numbers of the bands that share a grid of pixels, by pixel size as text, such as ``10m``, smallest first."""
    if onto is not None or interval not in (None, "native"):
        return {"": list(range(len(bands)))}
    size = instrument.ground_intervals if interval else (lambda band: (instrument.pixel(band),) * 2)
    groups = sorted(_grouped(bands, size).items())
    return {
        f"{along:g}m" if along == across else f"{along:g}x{across:g}m": numbers for (along, across), numbers in groups
    }


def common_size(instrument, bands, size):
    """Common size of bands, such as their pixel size, along and across. [m]"""
    groups = _grouped(bands, size)
    if len(groups) > 1:
        parts = [
            f"{along:g} x {across:g} m: {', '.join(bands[number].name for number in numbers)}"
            for (along, across), numbers in groups.items()
        ]
        raise ValueError(
            f"bands of {instrument.name} have different grids ({'; '.join(parts)}): sense each group separately, or "
            "bring all onto one grid with onto= or interval="
        )
    return next(iter(groups))


def means_by_band(array, instrument, bands, pixels, *, offset=(0.0, 0.0), min_valid, line_spreads=None):
    """Means over the footprints of pixels, with the given or own line spread functions by band, dims (band, y, x)."""
    shifts = shifts_of(offset, pixels)

    def means(part, spreads, names):
        check_scene(spreads, grids.geobox(array), min_valid, f"{instrument.name} {names}")
        return regularized(part, spreads, pixels, shifts=shifts, min_valid=min_valid)

    return by_line_spread(means, array, line_spreads or instrument.line_spreads, bands)


def by_line_spread(means, array, line_spreads, bands):
    """Raster computed for all bands with the same line spread functions at a time, in the order of the array."""
    groups = _grouped(bands, line_spreads)
    parts = []
    for spreads, numbers in groups.items():
        part = array if len(groups) == 1 else array.isel(band=numbers)
        parts.append(means(part, spreads, ", ".join(bands[number].name for number in numbers)))
    if len(parts) == 1:
        return parts[0]
    joined = xr.concat(parts, dim="band", combine_attrs="override", coords="minimal", compat="override", join="exact")
    return joined.isel(band=np.argsort(np.concatenate(list(groups.values()))))


def directions_on(pixels, geometry):
    """Directions of sun and sensor at the pixels: means of zenith angles, and azimuths of mean vectors."""

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
