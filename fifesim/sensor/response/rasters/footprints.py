"""Where the footprints of pixels lie, and whether a scene holds them."""

import numpy as np

from fifesim.base.kinds import described
from fifesim.rasters import grid as grids


def shifts_of(offset, pixels):
    """
    Where pixels lie beside where they should.

    Parameters
    ----------
    offset : (float or array, float or array)
        As in `fifesim.sensor.raster.sense`. [pixel]
    pixels : odc.geo.geobox.GeoBox

    Returns
    -------
    south, east : array, one number, or one for each row and each column
        [m]

    Raises
    ------
    ValueError
        If there are not two, one has another length than its axis, or all pixels lie beside the scene.
    """
    if not hasattr(offset, "__len__") or len(offset) != 2:
        raise ValueError(
            f"offset must be two, of rows and of columns in pixels, such as (0.5, 0.0), got {described(offset)}"
        )
    down, across = grids.cell_size(pixels)
    return _shift(offset[0], pixels.shape.y, down, "rows"), _shift(offset[1], pixels.shape.x, across, "columns")


def check_scene(spreads, scene, min_valid, name):
    """
    Refuse a point spread of which no pixel can hold enough.

    Parameters
    ----------
    spreads : (line spread function, line spread function)
        Down and across.
    scene : odc.geo.geobox.GeoBox
        Of the cells.
    min_valid : float
        As in `fifesim.sensor.raster.sense`. [1]
    name : str
        Of instrument and bands.

    Raises
    ------
    ValueError
        If the scene holds less of it than that.
    """
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
    """Metres of an offset in pixels, a number or one for each of an axis."""
    offset = np.asarray(offset, float)
    if offset.ndim > 1 or (offset.ndim and offset.size != size) or not np.all(np.isfinite(offset)):
        raise ValueError(
            f"the offset of {axis} must be a finite number of pixels, or {size} of them, one for each of the image's "
            f"{axis}, got shape {offset.shape}"
        )
    if np.abs(offset).min() >= size:
        raise ValueError(
            f"the offset of {axis} must be less than the {size} pixels of the image, got {offset.flat[0]:g}: every "
            "pixel would lie beside the scene; give it in pixels, not metres"
        )
    return offset * pixel


def _within(spread, size):
    """Share of a response that a scene of this size holds around its middle."""
    return float(spread.cumulative(size / 2) - spread.cumulative(-size / 2))
