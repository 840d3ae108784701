"""GeoTIFF tags for names, types, attributes and stored bands, with checks that a file is unchanged."""

import json
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import dask.array as da
import numpy as np
import xarray as xr
from pydantic import BaseModel, Field, ValidationError, model_validator
from rasterio.windows import Window

from fifesim.base.bands import counts
from fifesim.base.files import in_a_line
from fifesim.grids import cf
from fifesim.grids.inputs import no_data_of, scale_and_offset

# Largest number of rows, and of columns, whose cells are kept.
_LINES = 8

# Tolerance for the centre of a cell. [cell]
_POSITION = 1e-3

_Places = Annotated[list[float], Field(max_length=_LINES)]


class Fingerprint(BaseModel, extra="forbid"):
    """Values of cells on a regular subset of the rows and columns of a file."""

    size: tuple[float, float]  # of a cell, down and across [m]
    y: _Places  # centres of the rows [m]
    x: _Places
    values: list[list[list[float | None]]]  # shape (band, y, x), None where a cell is NaN

    @model_validator(mode="after")
    def _fits(self):
        if {(len(rows), *map(len, rows)) for rows in self.values} != {(len(self.y), *[len(self.x)] * len(self.y))}:
            raise ValueError("values of other rows and columns")
        return self


@dataclass(frozen=True)
class Located:
    """Cells of a fingerprint that a file still has: rows and columns, and values by the bands of the file."""

    rows: np.ndarray
    columns: np.ndarray
    values: np.ndarray  # shape (band, row, column), NaN where a cell has no data


def fingerprint_of(source):
    """Fingerprint of an open file, as JSON types for `Fingerprint`."""
    spread = (np.arange(_LINES) + 0.5) / _LINES
    rows, columns = (np.unique((spread * size).astype(int)).tolist() for size in source.shape)
    cells = np.array([[source.read(window=Window(column, row, 1, 1))[:, 0, 0] for column in columns] for row in rows])
    values = np.moveaxis(cells, -1, 0).astype(object)
    values[values != values] = None
    a = source.transform
    return {
        "size": [-a.e, a.a],
        "y": [a.f + (row + 0.5) * a.e for row in rows],
        "x": [a.c + (column + 0.5) * a.a for column in columns],
        "values": values.tolist(),
    }


def fingerprint_cells(fingerprint, order, source):
    """Cells of a fingerprint in an open file, None if it has other cells, as after resampling."""
    values = np.array(fingerprint.values, float)
    a = source.transform
    if not np.allclose(fingerprint.size, (-a.e, a.a), rtol=1e-6, atol=0):
        return None
    rows = (np.array(fingerprint.y) - a.f) / a.e - 0.5
    columns = (np.array(fingerprint.x) - a.c) / a.a - 0.5
    off = (np.max(np.abs(places - np.rint(places)), initial=0) for places in (rows, columns))
    if sum(off) > _POSITION:
        return None
    rows, columns = np.rint(rows).astype(int), np.rint(columns).astype(int)
    inside = [(at >= 0) & (at < size) for at, size in zip((rows, columns), source.shape, strict=True)]
    values = values[list(order)][:, inside[0]][:, :, inside[1]]
    return Located(rows[inside[0]], columns[inside[1]], values)


def changed_cell(cells, block, corner, marks):
    """Band, value found and value written of the first changed cell of a block, or None."""
    first, top, left = corner
    here = [
        (start <= at) & (at < start + size)
        for at, start, size in ((cells.rows, top, block.shape[1]), (cells.columns, left, block.shape[2]))
    ]
    if not (here[0].any() and here[1].any()):
        return None
    at = np.ix_(range(block.shape[0]), cells.rows[here[0]] - top, cells.columns[here[1]] - left)
    written = cells.values[first : first + block.shape[0]][:, here[0]][:, :, here[1]]
    found = block[at].astype(float)
    tolerance = 2 * np.finfo(block.dtype).eps * np.abs(written) if block.dtype.kind == "f" else 0.0
    # Comparisons with NaN (no data) are false.
    changed = ~(np.isnan(found) | np.isin(found, marks)) & ~(np.abs(found - written) <= tolerance)
    if not changed.any():
        return None
    band, row, column = np.argwhere(changed)[0]
    return first + int(band), float(found[band, row, column]), float(written[band, row, column])


CURE = "Open the file as fifesim wrote it, or open this one with rioxarray.open_rasterio"
"""Remedy for a file that another program changed, for messages."""

DAYS = "days since 1970-01-01"
"""Units of bands of dates."""

_EPOCH = np.datetime64("1970-01-01T00:00:00", "ns")


@dataclass(frozen=True)
class Storage:
    """Storage in a file of the bands that its tag describes."""

    file: str
    names: tuple[str, ...]
    dtype: np.dtype  # of the values as they are returned
    counted: bool  # whether they are digital numbers
    nodata: float | None  # of the file
    cells: Located | None

    def as_written(self, block, corner, mark):
        """Values of a block of the file as they were written."""
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
    """Values of a file with a tag as they were written, with coordinates stored as bands, dims (band, y, x)."""
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
    return storage.as_written(block, tuple(first for first, _ in block_info[0]["array-location"]), mark)


def with_layers(array, layers):
    """All bands of a file: values, and dates of cells in days since 1970, dims (band, y, x)."""
    # In double precision with layers, in which days keep their microseconds.
    if not layers:
        return array
    days = [((array[name] - _EPOCH) / np.timedelta64(1, "D")).variable for name in layers]
    bands = [array.variable.astype(float), *(each.expand_dims("band") for each in days)]
    return xr.DataArray(xr.Variable.concat(bands, "band"))


def _dates(days, dtype):
    """Dates from days since 1970, to the microsecond; NaT where missing."""
    microseconds = (days * 86_400e6).round()
    known = microseconds.notnull()
    return microseconds.where(known, 0).astype("int64").astype("datetime64[us]").astype(dtype).where(known)


TAG = "FIFESIM"

# Longer tags were not written by fifesim. [character]
_LONGEST = 1_000_000

# Longest text among coordinates. [character]
_LONGEST_TEXT = 500

# GDAL writes scales with 15 digits or more. [1]
_SCALE_TOLERANCE = 1e-9


class _Layer(BaseModel, extra="forbid"):
    """Coordinate of the cells that the file holds as a band."""

    dtype: str
    attrs: dict[str, Any]


class _Coordinate(_Layer):
    """Coordinate along band, or of the whole raster."""

    dims: list[Literal["band"]] = Field(max_length=1)
    values: Any


class _Description(BaseModel, extra="forbid"):
    name: str | int | float | None
    dims: list[Literal["band", "y", "x"]]
    dtype: str | None = None
    attrs: dict[str, Any]
    coords: dict[str, _Coordinate]
    layers: dict[str, _Layer] = {}
    cells: Fingerprint | None = None


def tag_of(array, dims, layers=()):
    """Content of the tag of a raster, as JSON types."""
    return {
        "name": array.name,
        "dims": [str(dim) for dim in dims],
        "dtype": array.dtype.str,
        "attrs": {key: _plain(value) for key, value in array.attrs.items() if not _is_implied(key, value, array)},
        "coords": {
            name: {"dims": list(value.dims), "values": _plain(value.values)} | _dtype_and_attrs(value)
            for name, value in array.coords.items()
            if not {"y", "x"} & set(value.dims) and name != "spatial_ref"
        },
        "layers": {name: _dtype_and_attrs(array[name]) for name in layers},
    }


def _dtype_and_attrs(coordinate):
    return {"dtype": coordinate.dtype.str, "attrs": dict(coordinate.attrs)}


def band_names(array):
    """Descriptions of the bands of a file, "" without a name."""
    if "band" in array.coords:
        return [str(name) for name in array["band"].values]
    return ["" if array.name is None or array.sizes["band"] > 1 else str(array.name)] * array.sizes["band"]


def band_units(names, coords, attrs):
    """Units of the bands of a file, "" without a unit."""
    # A GIS has no square-root scale, so that compressed digital numbers have no units of radiance.
    if "gain" in coords and "compression" not in coords:
        return [cf.QUANTITIES["toa_radiance"].units] * len(names)
    own = str(attrs.get("units", ""))
    return [cf.QUANTITIES[name].units if name in cf.QUANTITIES else own for name in names]


def read_tag(source, name):
    """Description of a raster from the tag of its file, for the bands of the file in their order, or None."""
    text = source.tags().get(TAG)
    if text is None:
        return None
    try:
        kept, names, coords, types, native = _parsed(text, source)
    except (ValueError, TypeError, OverflowError, RecursionError, MemoryError) as error:
        raise ValueError(
            f"{name} has a tag {TAG} that fifesim did not write ({_reason(error)}): open the file with "
            "rioxarray.open_rasterio"
        ) from None
    every = [*names, *kept.layers]
    order, named = _order(every, source.descriptions, name)
    bands = [number for number, at in enumerate(order) if at < len(names)]
    if not bands:
        raise ValueError(f"{name} holds {', '.join(kept.layers)} without the bands that it belongs to. {CURE}")
    selected = [order[number] for number in bands]
    coords = {key: value.isel(band=selected) if value.dims else value for key, value in coords.items()}
    cells = None if kept.cells is None else fingerprint_cells(kept.cells, order, source)
    units = band_units(names, coords, kept.attrs) + [DAYS] * len(kept.layers)
    _check_scales(source, name, xr.DataArray(np.zeros(len(bands), native), coords, "band", attrs=kept.attrs), bands)
    _check_type(source, name, native)
    _check_certain(source, name, cells, named, [units[at] for at in order])
    counted = "gain" in coords and native.kind == "u"
    stored = native if counted else np.dtype(source.dtypes[0])
    called = tuple(every[at] or f"band {number}" for number, at in enumerate(order, 1))
    layers = {every[at]: number for number, at in enumerate(order) if number not in bands}
    return {
        "name": kept.name,
        "dims": kept.dims,
        "attrs": kept.attrs,
        "dtype": native if kept.layers else stored,
        "coords": coords,
        "bands": bands,
        "layers": {key: (number, types[key], kept.layers[key].attrs) for key, number in layers.items()},
        "storage": Storage(name, called, stored, counted, source.nodata, cells),
    }


def _parsed(text, source):
    """Tag, names of its bands of values, its coordinates, and the types of its layers and of its values."""
    if len(text) > _LONGEST:
        raise ValueError(f"{len(text)} characters")
    kept = _Description.model_validate(json.loads(text))
    names = _names(kept, source.count)
    coords = {key: _variable(key, item, len(names)) for key, item in kept.coords.items()}
    types = {key: _checked_dtype(key, item.dtype) for key, item in kept.layers.items()}
    if any(dtype.kind != "M" for dtype in types.values()):
        raise ValueError("layers that are no dates")
    if any(coords[key].dtype.kind not in "iuf" for key in ("gain", "offset") if key in coords):
        raise ValueError("a calibration that is no numbers")
    if kept.cells is not None and len(kept.cells.values) != len(names) + len(types):
        raise ValueError(f"cells of {len(kept.cells.values)} bands")
    native = _checked_dtype("values", kept.dtype or source.dtypes[0])
    if native.kind not in "biuf":
        raise ValueError(f"values of type {native}")
    return kept, names, coords, types, native


def _reason(error):
    if isinstance(error, ValidationError):
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        return f"{ascii('.'.join(map(str, first['loc'])))[1:-1][:60] or 'it'}: {first['msg'][:80]}"
    return ascii(str(error))[1:-1][:80] or type(error).__name__


def _names(kept, count):
    """Names of the bands of values in the tag, "" without a name."""
    if len(set(kept.dims)) != len(kept.dims) or not {"y", "x"} <= set(kept.dims):
        raise ValueError("dims are not those of a raster")
    if {"y", "x", "spatial_ref"} & {*kept.coords, *kept.layers}:
        raise ValueError("a place of its own")
    if "band" in kept.coords and not kept.coords["band"].dims:
        raise ValueError("one name for all bands")
    lists = [item.values for item in kept.coords.values() if item.dims]
    if any(not isinstance(values, list) for values in lists):
        raise ValueError("no list of values along band")
    if "band" in kept.coords:
        names = [str(each) for each in kept.coords["band"].values]
    elif "band" in kept.dims:
        names = [""] * (len(lists[0]) if lists else count - len(kept.layers))
    else:
        names = ["" if kept.name is None else str(kept.name)]
    if not names or ("band" not in kept.dims and len(names) != 1):
        raise ValueError(f"no dimension for {len(names)} bands")
    return names


def _order(names, descriptions, file):
    """Number in the tag of each band of the file, and whether this follows from descriptions."""
    given = [text or "" for text in descriptions]
    if len(set(given)) == len(given) and "" not in given and set(given) <= set(names):
        return [names.index(text) for text in given], True
    named = any(given) and any(names)
    if len(given) == len(names) and (len(names) == 1 or not named):
        return list(range(len(names))), False
    found = in_a_line(", ".join(text or "none" for text in given), 150)
    wanted = in_a_line(", ".join(names), 150) if any(names) else f"{len(names)} bands without names"
    raise ValueError(
        f"the descriptions of the bands of {file} are {found}, and its tag {TAG} has {wanted}: give each band its own "
        "description of the tag, once (rasterio: set_band_description), or open the file with rioxarray.open_rasterio"
    )


def _check_scales(source, name, raster, bands):
    """Raise ValueError if the scales of the file are not the scales of the tag."""
    expected = np.ones(source.count), np.zeros(source.count)
    for values, scale in zip(expected, scale_and_offset(raster), strict=True):
        values[bands] = scale
    for found, wanted, what in zip((source.scales, source.offsets), expected, ("scales", "offsets"), strict=True):
        if not np.allclose(found, wanted, rtol=_SCALE_TOLERANCE, atol=_SCALE_TOLERANCE):
            texts = [in_a_line(", ".join(f"{value:g}" for value in values), 80) for values in (found, wanted)]
            raise ValueError(
                f"{name} has the {what} {texts[0]}, and its tag {TAG} has {texts[1]}: another program changed the "
                f"values or their scale. {CURE}"
            )


def _check_type(source, name, native):
    """Raise ValueError if the type of the file does not hold all values of the type that was written."""
    stored = np.dtype(source.dtypes[0])
    if not (np.can_cast(native, stored) or (native.kind == "f" and stored.kind == "f")):
        raise ValueError(
            f"{name} holds values of type {stored}, and fifesim wrote {native}: another program rounded or clipped "
            f"them. {CURE}"
        )


def _check_certain(source, name, cells, named, units):
    """Raise ValueError if nothing proves that the bands and values of a file belong to its tag."""
    if cells is not None and cells.values.size:
        # Each block of the file is compared with them.
        return
    if not named and source.count > 1:
        raise ValueError(
            f"the bands of {name} have no descriptions that tell them apart: give each band its description of the tag "
            f"{TAG} (rasterio: set_band_description), or open the file with rioxarray.open_rasterio"
        )
    # gdalwarp keeps the units; gdal_translate drops them where it changes values.
    if cells is None and [unit or "" for unit in source.units] != units:
        raise ValueError(
            f"{name} has other cells than fifesim wrote and lacks the units of its bands, so that its values may be "
            "changed too: resample with gdalwarp, which keeps the units, or open the original with fifesim.open_image "
            "and write it with .rio.reproject(...).fifesim.to_geotiff(...). To read it as it is, use "
            "rioxarray.open_rasterio"
        )


def _checked_dtype(name, text):
    """Type of numbers, times or short texts, checked before anything of this type is made."""
    dtype = np.dtype(text)
    short_text = dtype.kind == "U" and dtype.itemsize <= 4 * _LONGEST_TEXT
    if not (short_text or (dtype.kind in "biufM" and dtype.itemsize <= 8) or dtype.kind == "O"):
        raise ValueError(f"{name} of type {text}")
    return dtype


def _variable(name, item, count):
    """Coordinate of the tag."""
    shape = (count,) if item.dims else ()
    dtype = _checked_dtype(name, item.dtype)
    values = item.values if item.dims else [item.values]
    if not isinstance(values, list) or any(isinstance(each, list | dict) for each in values):
        raise ValueError(f"{name} is no list of values")
    if len(values) != (count if item.dims else 1):
        raise ValueError(f"{len(values)} values of {name} for {count} bands")
    return xr.DataArray(np.array(values, dtype).reshape(shape), dims=item.dims, attrs=item.attrs)


def _is_implied(key, value, array):
    """Whether an attribute is implied: no data are 0 in digital numbers, and NaN is not in JSON."""
    return key == "_FillValue" and ("gain" in array.coords or bool(np.any(value != value)))


def _plain(value):
    """Numbers and text as types of JSON."""
    if isinstance(value, np.generic | np.ndarray):
        return value.astype(str).tolist() if value.dtype.kind in "mM" else value.tolist()
    return value
