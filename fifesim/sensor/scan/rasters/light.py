"""The directions that light was computed for, at the pixels of a scan, and whether the scan sees it from there."""

from functools import partial
from typing import NamedTuple

import dask.array as da
import numpy as np
import xarray as xr

from fifesim.base.geometry import angle_between
from fifesim.rasters import chunks, directions

# Rows and columns of pixels that are made at once.
_BLOCK = 512


def at_pixels(geometry, row, column):
    """
    Directions of sun and sensor at pixels: those that vary, of the cells in which the centres lie.

    Parameters
    ----------
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset
        Of the scene.
    row, column : array, shape (line, sample)
        Centres, counted from the corner of the scene; beyond it those of its border. [cell]

    Returns
    -------
    geometry : fifesim.base.geometry.Geometry, or xarray.Dataset of numbers and rasters over (line, sample)
    """
    names = directions.varying(geometry)
    if not names:
        return geometry
    rasters = {name: geometry[name].transpose("y", "x") for name in names}
    return geometry.drop_dims(["y", "x"]).assign({name: _sampled(each, row, column) for name, each in rasters.items()})


class _Centres(NamedTuple):
    """Cells in which pixels lie, as `fifesim.rasters.chunks.windows` reads them."""

    array: object
    rows: np.ndarray
    columns: np.ndarray

    def window(self, lines, samples):
        """Rows and columns of the cells of a block of pixels."""
        return tuple(
            slice(int(each[lines, samples].min()), int(each[lines, samples].max()) + 1)
            for each in (self.rows, self.columns)
        )


def _sampled(raster, row, column):
    """A raster at pixels."""
    cells = [
        np.clip(np.floor(place), 0, size - 1).astype(int)
        for place, size in zip((row, column), raster.shape, strict=True)
    ]
    data = chunks.in_blocks(partial(_block, *cells), [_Centres(raster.data, *cells)], row.shape, _BLOCK)
    return xr.DataArray(data, dims=("line", "sample"), attrs=raster.attrs)


def _block(rows, columns, lines, samples, cells):
    rows, columns = rows[lines, samples], columns[lines, samples]
    return cells[rows - rows.min(), columns - columns.min()]


def seen_alike(means, geometry, view, tolerance, said):
    """
    Light that a scan sees from where it was computed for.

    Parameters
    ----------
    means : xarray.DataArray, dims (band, line, sample)
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset
        That the light was computed for, from `at_pixels`.
    view : (array, array), shape (line, sample)
        Zenith and azimuth angle at which the scan sees. [degree]
    tolerance : float
        How far apart the two may be. [degree]
    said : str
        What `fifesim.scan_geometry` takes for the angles of the scan.

    Returns
    -------
    means : xarray.DataArray, dims (band, line, sample)
        The same; where angles are lazy, checked when it computes.

    Raises
    ------
    ValueError
        If the tolerance is no angle, or the light was computed for another view.
    """
    if not 0 <= tolerance <= 180:
        raise ValueError(f"view_tolerance must be in [0, 180] degrees, got {tolerance}")
    scan = [xr.DataArray(each, dims=("line", "sample")) for each in view]
    light = [
        xr.DataArray(getattr(geometry, name)).drop_vars(("line", "sample"), errors="ignore") for name in ("vza", "vaa")
    ]
    check = partial(_checked, tolerance=tolerance, said=said)
    if any(isinstance(each.data, da.Array) for each in light):
        return chunks.pointwise(check, means, *light, *scan)
    check(0.0, *(each.values for each in (*light, *scan)))
    return means


def _checked(means, vza, vaa, scan_vza, scan_vaa, tolerance, said):
    apart = np.where(np.isnan(means), np.nan, angle_between(vza, vaa, scan_vza, scan_vaa))
    if np.any(apart > tolerance):
        raise ValueError(
            f"the light was computed for another view, vza {_span(vza)}, than that of the scan, vza {_span(scan_vza)}: "
            f"up to {np.nanmax(apart):.1f} degrees apart. Compute it with geometry=fifesim.scan_geometry({said})"
            ".assign(sza=..., saa=...), or give view_tolerance=180 if it does not depend on the view"
        )
    return means


def _span(values):
    low, high = np.nanmin(values), np.nanmax(values)
    return f"{low:.1f}" if high - low < 0.05 else f"{low:.1f} to {high:.1f}"
