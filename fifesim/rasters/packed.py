"""Rasters that are packed: whole numbers with a scale, an offset and a mark for no data, as attributes say."""

import numpy as np
import rioxarray  # noqa: F401  registers .rio

_MARKS = ("scale_factor", "add_offset", "_FillValue", "missing_value", "nodata")


def unpacked(raster):
    """
    Values of a raster in their unit, NaN where there are no data.

    Parameters
    ----------
    raster : xarray.DataArray
        With attributes ``scale_factor``, ``add_offset`` and ``_FillValue`` as files have them, or with none.

    Returns
    -------
    raster : xarray.DataArray
        The same where nothing is packed; else floats without these attributes, lazy where the input is.

    Examples
    --------
    >>> import xarray as xr
    >>> unpacked(xr.DataArray([35, 255], attrs={"scale_factor": 0.1, "_FillValue": 255})).round(6).values.tolist()
    [3.5, nan]
    """
    scale, offset = float(raster.attrs.get("scale_factor", 1)), float(raster.attrs.get("add_offset", 0))
    marks = [raster.attrs[name] for name in _MARKS[2:] if name in raster.attrs]
    marks = [float(mark) for mark in marks if np.ndim(mark) == 0 and not np.isnan(float(mark))]
    if (scale, offset) == (1.0, 0.0) and not marks:
        return raster
    cells = raster.astype(float)
    for mark in dict.fromkeys(marks):
        cells = cells.where(raster != mark)
    cells = cells * scale + offset
    kept = {name: value for name, value in raster.attrs.items() if name not in _MARKS}
    return cells.drop_attrs(deep=False).assign_attrs(kept).rename(raster.name)
