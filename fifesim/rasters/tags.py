"""The tag of a GeoTIFF that keeps names, types and attributes beyond what GDAL's model of a raster holds."""

import json
from typing import Any, Literal

import numpy as np
import xarray as xr
from pydantic import BaseModel, Field, ValidationError

TAG = "FIFESIM"

# A tag that is longer was not written here. [character]
_LONGEST = 1_000_000

# Of a text among coordinates. [character]
_LONGEST_TEXT = 500


class _Coordinate(BaseModel, extra="forbid"):
    dims: list[Literal["band"]] = Field(max_length=1)
    values: Any
    dtype: str
    attrs: dict[str, Any]


class _Description(BaseModel, extra="forbid"):
    name: str | int | float | None
    dims: list[Literal["band", "y", "x"]]
    attrs: dict[str, Any]
    coords: dict[str, _Coordinate]


def tag_of(array, dims):
    """
    What the tag keeps of a raster.

    Parameters
    ----------
    array : xarray.DataArray
    dims : sequence of str
        Of the raster as it is read again.

    Returns
    -------
    description : dict
        That JSON holds.
    """
    return {
        "name": array.name,
        "dims": [str(dim) for dim in dims],
        "attrs": {key: _plain(value) for key, value in array.attrs.items() if not _is_implied(key, value, array)},
        "coords": {
            name: {
                "dims": list(value.dims),
                "values": _plain(value.values),
                "dtype": value.dtype.str,
                "attrs": dict(value.attrs),
            }
            for name, value in array.coords.items()
            if not {"y", "x"} & set(value.dims) and name != "spatial_ref"
        },
    }


def read_tag(source, name):
    """
    Description of a raster in the tag of its file.

    Parameters
    ----------
    source : rasterio.io.DatasetReader
    name : str
        Of the file, for messages.

    Returns
    -------
    description : dict or None
        ``name``, ``dims``, ``attrs``, and ``coords`` as `xarray.DataArray`; None without a tag.

    Raises
    ------
    ValueError
        If the tag is not one that `tag_of` makes, or does not fit the file's bands.
    """
    text = source.tags().get(TAG)
    if text is None:
        return None
    try:
        if len(text) > _LONGEST:
            raise ValueError(f"{len(text)} characters")
        kept = _Description.model_validate(json.loads(text))
        _check_dims(kept, source.count)
        coords = {key: _variable(key, item, source.count) for key, item in kept.coords.items()}
    except (ValueError, TypeError, OverflowError, RecursionError, MemoryError) as error:
        raise ValueError(
            f"{name} has a tag {TAG} that fifesim did not write ({_reason(error)}): open the file with "
            "rioxarray.open_rasterio"
        ) from None
    return {"name": kept.name, "dims": kept.dims, "attrs": kept.attrs, "coords": coords}


def _reason(error):
    if isinstance(error, ValidationError):
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        return f"{ascii('.'.join(map(str, first['loc'])))[1:-1][:60] or 'it'}: {first['msg'][:80]}"
    return ascii(str(error))[1:-1][:80] or type(error).__name__


def _check_dims(kept, count):
    if len(set(kept.dims)) != len(kept.dims) or not {"y", "x"} <= set(kept.dims):
        raise ValueError("dims are not those of a raster")
    if "band" not in kept.dims and count != 1:
        raise ValueError(f"no dimension for {count} bands")
    if {"y", "x", "spatial_ref"} & set(kept.coords):
        raise ValueError("a place of its own")
    if "band" in kept.coords and not kept.coords["band"].dims:
        raise ValueError("one name for all bands")


def _variable(name, item, count):
    """A coordinate; its type is looked at before anything of that type is made."""
    shape = (count,) if item.dims else ()
    dtype = np.dtype(item.dtype)
    text = dtype.kind == "U" and dtype.itemsize <= 4 * _LONGEST_TEXT
    if not (text or (dtype.kind in "biufM" and dtype.itemsize <= 8) or dtype.kind == "O"):
        raise ValueError(f"{name} of type {item.dtype}")
    values = item.values if item.dims else [item.values]
    if not isinstance(values, list) or any(isinstance(each, list | dict) for each in values):
        raise ValueError(f"{name} is no list of values")
    if len(values) != (count if item.dims else 1):
        raise ValueError(f"{len(values)} values of {name} for {count} bands")
    return xr.DataArray(np.array(values, dtype).reshape(shape), dims=item.dims, attrs=item.attrs)


def _is_implied(key, value, array):
    """Whether an attribute follows from the rest: no data are 0 in digital numbers, and NaN, which JSON has not."""
    return key == "_FillValue" and ("gain" in array.coords or bool(np.any(value != value)))


def _plain(value):
    """Numbers and text as JSON has them."""
    if isinstance(value, np.generic | np.ndarray):
        return value.astype(str).tolist() if value.dtype.kind in "mM" else value.tolist()
    return value
