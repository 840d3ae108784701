"""Cells of a raster by its coordinates, and by what its transform says of them."""

import numpy as np


def along_axis(array, name, edge, cell):
    """
    Outer edge and cell along an axis, from all coordinates; odc-geo looks at two.

    Parameters
    ----------
    array : xarray.DataArray
    name : {"x", "y"}
    edge, cell : float
        As odc-geo has them. [m]

    Returns
    -------
    edge, cell : float
        [m]

    Raises
    ------
    ValueError
        If the coordinates are not evenly spaced.
    """
    if name not in array.coords:
        return edge, cell
    if array.sizes[name] == 1:
        # Of a part, the GeoTransform is that of the whole: its cell holds, its corner does not.
        return float(array.coords[name].values[0] - cell / 2), cell
    centres = array.coords[name].values.astype(float)
    even, cell = np.linspace(centres[0], centres[-1], centres.size, retstep=True)
    # Single precision resolves half a metre of a northing, a sixtieth of a 30 m cell.
    if not np.allclose(centres, even, rtol=0, atol=abs(cell) / 60):
        raise ValueError(f"the raster's {name} is not evenly spaced: interpolate it onto a regular grid with .interp")
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
