"""Bands of a file that fifesim wrote: values that are checked when they are read, and dates over the cells as bands."""

from dataclasses import dataclass

import dask.array as da
import numpy as np
import xarray as xr

from fifesim.base.digital_numbers import counts
from fifesim.rasters.fingerprint import Located, changed_cell
from fifesim.rasters.packed import no_data_of

CURE = "Open the file as fifesim wrote it, or open this one with rioxarray.open_rasterio"
"""Remedy for a file that another program changed, for messages."""

DAYS = "days since 1970-01-01"
"""Units of bands of dates."""

_EPOCH = np.datetime64("1970-01-01T00:00:00", "ns")


@dataclass(frozen=True)
class Storage:
    """How a file stores the bands that its tag describes."""

    file: str
    names: tuple[str, ...]
    dtype: np.dtype  # of the values as they are returned
    counted: bool  # whether they are digital numbers
    nodata: float | None  # of the file
    cells: Located | None

    def as_written(self, block, corner, mark):
        """
        Values of a block of the file as they were written.

        Parameters
        ----------
        block : array, shape (band, y, x)
        corner : (int, int, int)
            First band, row and column of the block.
        mark : float or None
            Value that stands for no data in the raster.

        Returns
        -------
        block : array, shape (band, y, x)

        Raises
        ------
        ValueError
            If a value is not the one that was written, or cannot be a digital number.
        """
        marks = [value for value in (self.nodata, mark) if value is not None]
        change = None if self.cells is None else changed_cell(self.cells, block, corner, marks)
        if change is not None:
            band, found, written = change
            raise ValueError(
                f"{self.file} has {found:g} in a cell of {self.names[band]} where fifesim wrote {written:g}: another "
                f"program changed the values or the order of the bands. {CURE}"
            )
        if self.counted and block.dtype != self.dtype:
            nodata = 0 if self.nodata is None else self.nodata
            return counts(block, nodata, int(np.iinfo(self.dtype).max), f"it is in {self.file}. {CURE}")
        if self.nodata is None or mark is None or self.nodata == mark or np.isnan(self.nodata):
            return block
        return np.where(block == self.nodata, block.dtype.type(mark), block)


def restored(array, description):
    """
    Values of a file with a tag as they were written, with the coordinates that are bands of the file.

    Parameters
    ----------
    array : xarray.DataArray, dims (band, y, x)
        Values of the file.
    description : dict
        From `fifesim.rasters.tags.read_tag`.

    Returns
    -------
    array : xarray.DataArray, dims (band, y, x)
        Lazy where the input is.

    Raises
    ------
    ValueError
        If a value is not the one that was written, or cannot be a digital number; for lazy data, when it is computed.
    """
    storage, attrs = description["storage"], {}
    mark = 0 if storage.counted else no_data_of(xr.DataArray(np.zeros((), storage.dtype), attrs=description["attrs"]))
    mark = mark if isinstance(mark, int | float) else None
    if mark is None and storage.nodata is not None:
        attrs = {"_FillValue": storage.dtype.type(storage.nodata)}
    if isinstance(array.data, da.Array):
        cells = array.data.map_blocks(_block_as_written, storage, mark, dtype=storage.dtype)
    else:
        cells = storage.as_written(array.values, (0, 0, 0), mark)
    array = array.copy(data=cells)
    layers = {}
    for name, (number, dtype, own) in description["layers"].items():
        layers[name] = _dates(array.isel(band=number), dtype)
        layers[name].attrs = own
    array = array.isel(band=description["bands"]).astype(description["dtype"]) if layers else array
    return array.assign_coords(layers).assign_attrs(attrs)


def _block_as_written(block, storage, mark, block_info=None):
    corner = tuple(first for first, _ in block_info[0]["array-location"])
    return storage.as_written(block, corner, mark)


def with_layers(array, layers):
    """
    All bands of a file: values, and dates over the cells in days since 1970.

    Parameters
    ----------
    array : xarray.DataArray of fractions, dims (band, y, x)
    layers : sequence of str
        Coordinates of dates, dims (y, x).

    Returns
    -------
    cells : xarray.DataArray, dims (band, y, x)
        The array itself without layers; else in double precision, in which days keep their microseconds.
    """
    if not layers:
        return array
    days = [((array[name] - _EPOCH) / np.timedelta64(1, "D")).variable for name in layers]
    bands = [array.variable.astype(float), *(each.expand_dims("band") for each in days)]
    return xr.DataArray(xr.Variable.concat(bands, "band"))


def _dates(days, dtype):
    """Dates of days since 1970, to the microsecond; NaT where there is none."""
    microseconds = (days * 86_400e6).round()
    known = microseconds.notnull()
    return microseconds.where(known, 0).astype("int64").astype("datetime64[us]").astype(dtype).where(known)
