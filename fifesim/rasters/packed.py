"""Rasters that are packed: whole numbers with a scale, an offset and a mark for no data, as attributes say."""

import numpy as np
import rioxarray  # noqa: F401  registers .rio

NO_DATA = ("_FillValue", "missing_value", "nodata")
"""Attributes that say which value stands for no data."""

STORAGE = ("scale_factor", "add_offset", *NO_DATA)
"""Attributes that say how values are stored."""


def scale_and_offset(raster):
    """
    What turns stored values into those of their unit.

    Parameters
    ----------
    raster : xarray.DataArray

    Returns
    -------
    scale, offset : float
        1 and 0 where nothing is said.
    """
    said = _said(raster)
    return float(said.get("scale_factor", 1.0)), float(said.get("add_offset", 0.0))


def has_no_data(raster):
    """
    Whether a raster says which value stands for no data.

    Parameters
    ----------
    raster : xarray.DataArray

    Returns
    -------
    says : bool
    """
    return any(name in _said(raster) for name in NO_DATA)


def no_data_of(raster):
    """
    Number that stands for no data in a file of a raster.

    Parameters
    ----------
    raster : xarray.DataArray

    Returns
    -------
    number : float or None
        What the raster says and its type can hold; else 0 in digital numbers with a calibration, NaN in fractions, and
        none in other whole numbers.

    Examples
    --------
    >>> import xarray as xr
    >>> no_data_of(xr.DataArray([35, 255], attrs={"_FillValue": 255})), no_data_of(xr.DataArray([0, 1]))
    (255, None)
    """
    said, whole = _said(raster), raster.dtype.kind in "iu"
    marks = [np.ravel(said[name])[0].item() for name in NO_DATA if name in said]
    if whole:
        limits = np.iinfo(raster.dtype)
        marks = [mark for mark in marks if limits.min <= mark <= limits.max]
    return marks[0] if marks else 0 if "gain" in raster.coords else None if raster.dtype.kind != "f" else np.nan


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
        The same where nothing is packed; else without these attributes, lazy where the input is; in single precision
        where it was.

    Raises
    ------
    ValueError
        If it holds fractions and says a scale: arithmetic keeps attributes, and nobody knows whether it was applied.

    Examples
    --------
    >>> import xarray as xr
    >>> unpacked(xr.DataArray([35, 255], attrs={"scale_factor": 0.1, "_FillValue": 255})).round(6).values.tolist()
    [3.5, nan]
    """
    said, (scale, offset) = _said(raster), scale_and_offset(raster)
    marks = {float(mark) for name in NO_DATA if name in said for mark in np.ravel(said[name])}
    marks = {mark for mark in marks if not np.isnan(mark)}
    scaled = (scale, offset) != (1.0, 0.0)
    if scaled and raster.dtype.kind == "f":
        raise ValueError(
            f"{raster.name or 'the raster'} holds fractions and says scale_factor {scale:g}, add_offset {offset:g}: "
            "where they were applied, drop them from .attrs; where not, open the file with mask_and_scale=True"
        )
    if not scaled and not marks:
        return raster
    cells = raster if raster.dtype.kind == "f" else raster.astype(float)
    for mark in sorted(marks):
        cells = cells.where(raster != mark)
    cells = cells * scale + offset if scaled else cells
    kept = {name: value for name, value in raster.attrs.items() if name not in STORAGE}
    cells = cells.drop_attrs(deep=False).assign_attrs(kept).rename(raster.name)
    cells.encoding = {}
    return cells


def _said(raster):
    """Attributes, and for stored numbers what reading the file put aside."""
    return raster.attrs | {key: value for key, value in raster.encoding.items() if raster.dtype.kind in "iu"}
