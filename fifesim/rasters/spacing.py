"""Spacing of the coordinates of a raster, and the cell size that its transform states."""

import numpy as np
import odc.geo.xr  # noqa: F401  registers .odc

# A coordinate may be off by this share of a cell: a northing in single precision is, for cells of 30 m.
_TOLERANCE = 1 / 60
# Limit for smaller cells, where the coordinates are in single precision.
_TOLERANCE_SINGLE = 1 / 10


def regular_geobox(array):
    """
    Grid of a raster in any CRS and orientation, whose coordinates are evenly spaced.

    odc-geo reads the first and the last coordinates only.

    Parameters
    ----------
    array : xarray.DataArray

    Returns
    -------
    grid : odc.geo.geobox.GeoBox or None
        None if odc-geo finds no grid.

    Raises
    ------
    ValueError
        If the coordinates are not evenly spaced.
    """
    found = array.odc.geobox
    if found is not None:
        for name in array.odc.spatial_dims:
            along_axis(array, name, 0.0, 0.0)
    return found


def along_axis(array, name, edge, cell):
    """
    Outer edge and cell size along an axis, from all coordinates.

    Parameters
    ----------
    array : xarray.DataArray
    name : str
        Dimension, such as ``"x"``.
    edge, cell : float
        Values of odc-geo, which are returned if there are no coordinates. [unit of the CRS]

    Returns
    -------
    edge, cell : float
        [unit of the CRS]

    Raises
    ------
    ValueError
        If the coordinates are not evenly spaced.
    """
    if name not in array.coords:
        return edge, cell
    given = array.coords[name].values
    if array.sizes[name] == 1:
        # The GeoTransform of a part is that of the whole raster: its cell size holds, its corner does not.
        return float(given[0] - cell / 2), cell
    centres = given.astype(float)
    even, cell = np.linspace(centres[0], centres[-1], centres.size, retstep=True)
    tolerance = _TOLERANCE * abs(cell)
    if given.dtype == np.float32:
        tolerance = np.clip(np.spacing(np.abs(given).max()), tolerance, _TOLERANCE_SINGLE * abs(cell))
    if not (cell and np.allclose(centres, even, rtol=0, atol=tolerance)):
        steps = np.diff(centres)
        found = f"{np.nanmin(steps):.6g} to {np.nanmax(steps):.6g}"
        raise ValueError(
            f"the raster's {name} is not evenly spaced, its steps are {found}: "
            f"sort it with .sortby({name!r}), put tiles together on one grid with .reindex, or interpolate it onto a "
            "regular grid with .interp"
        )
    return float(centres[0] - cell / 2), float(cell)


def exact_cell(array, cell_x, cell_y):
    """
    Cell size from the GeoTransform, which keeps its digits, where the coordinates agree with it.

    Parameters
    ----------
    array : xarray.DataArray
    cell_x, cell_y : float
        As the coordinates have them. [m]

    Returns
    -------
    cell_x, cell_y : float
        [m]
    """
    transform = array.coords["spatial_ref"].attrs.get("GeoTransform") if "spatial_ref" in array.coords else None
    if transform:
        numbers = [float(number) for number in transform.split()]
        if np.allclose((numbers[1], numbers[5]), (cell_x, cell_y), rtol=1e-6):
            return numbers[1], numbers[5]
    return cell_x, cell_y
