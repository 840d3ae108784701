"""The tag of a GeoTIFF that keeps names, types and attributes beyond GDAL's model of a raster."""

import json
from typing import Any, Literal

import numpy as np
import xarray as xr
from pydantic import BaseModel, Field, ValidationError

from fifesim.base.foreign import in_a_line
from fifesim.rasters import cf
from fifesim.rasters.fingerprint import Fingerprint, located
from fifesim.rasters.stored_bands import CURE, DAYS, Storage

TAG = "FIFESIM"

# A longer tag was not written here. [character]
_LONGEST = 1_000_000

# Longest text among coordinates. [character]
_LONGEST_TEXT = 500

# GDAL writes scales with 15 digits or more. [1]
_SCALE_TOLERANCE = 1e-9


class _Coordinate(BaseModel, extra="forbid"):
    dims: list[Literal["band"]] = Field(max_length=1)
    values: Any
    dtype: str
    attrs: dict[str, Any]


class _Layer(BaseModel, extra="forbid"):
    """A coordinate over the cells, which the file holds as a band."""

    dtype: str
    attrs: dict[str, Any]


class _Description(BaseModel, extra="forbid"):
    name: str | int | float | None
    dims: list[Literal["band", "y", "x"]]
    dtype: str | None = None
    attrs: dict[str, Any]
    coords: dict[str, _Coordinate]
    layers: dict[str, _Layer] = {}
    cells: Fingerprint | None = None


def tag_of(array, dims, layers=()):
    """
    Content of the tag for a raster.

    Parameters
    ----------
    array : xarray.DataArray
    dims : sequence of str
        Dimensions of the raster when it is read again.
    layers : sequence of str, optional
        Coordinates over the cells that the file holds as further bands.

    Returns
    -------
    description : dict
        JSON holds it.
    """
    return {
        "name": array.name,
        "dims": [str(dim) for dim in dims],
        "dtype": array.dtype.str,
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
        "layers": {name: {"dtype": array[name].dtype.str, "attrs": dict(array[name].attrs)} for name in layers},
    }


def band_names(array):
    """
    Descriptions of the bands of a file.

    Parameters
    ----------
    array : xarray.DataArray, dims (band, y, x)

    Returns
    -------
    names : list of str
        "" where a band has no name.
    """
    if "band" in array.coords:
        return [str(name) for name in array["band"].values]
    return ["" if array.name is None or array.sizes["band"] > 1 else str(array.name)] * array.sizes["band"]


def band_units(names, coords, attrs):
    """
    Units of the bands of a file.

    Parameters
    ----------
    names : sequence of str
    coords : mapping
        Coordinates of the raster.
    attrs : mapping

    Returns
    -------
    units : list of str
        "" where a band has none.
    """
    # A GIS has no square-root scale, so that compressed digital numbers have no units of radiance.
    if "gain" in coords and "compression" not in coords:
        return [cf.QUANTITIES["toa_radiance"].units] * len(names)
    own = str(attrs.get("units", ""))
    return [cf.QUANTITIES[name].units if name in cf.QUANTITIES else own for name in names]


def read_tag(source, name):
    """
    Description of a raster in the tag of its file, for the bands that the file has, in their order.

    Parameters
    ----------
    source : rasterio.io.DatasetReader
    name : str
        Name of the file, for messages.

    Returns
    -------
    description : dict or None
        ``name``, ``dims``, ``attrs`` and ``dtype`` of the raster; ``coords`` as `xarray.DataArray`; ``bands``, the
        numbers from 0 of the file's bands that hold values; ``layers``, the number, type and attributes of each
        coordinate that is a band; and ``storage``, a `Storage`. None without a tag.

    Raises
    ------
    ValueError
        If the tag is not one that `tag_of` makes, it is not certain which band is which, or types, scales or units of
        the bands contradict the tag.
    """
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
    cells = None if kept.cells is None else located(kept.cells, order, source)
    units = band_units(names, coords, kept.attrs) + [DAYS] * len(kept.layers)
    _check_scales(source, name, coords, bands)
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
    """The tag, the names of its bands of values, its coordinates, and the types of its layers and of its values."""
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
    """Names of the bands of values in the tag, "" where they have none."""
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
    """Number, in the tag, of each band of the file, and whether descriptions tell it."""
    given = [text or "" for text in descriptions]
    if len(set(given)) == len(given) and "" not in given and set(given) <= set(names):
        return [names.index(text) for text in given], True
    told = any(given) and any(names)
    if len(given) == len(names) and (len(names) == 1 or not told):
        return list(range(len(names))), False
    found = in_a_line(", ".join(text or "none" for text in given), 150)
    wanted = in_a_line(", ".join(names), 150) if any(names) else f"{len(names)} bands without names"
    raise ValueError(
        f"the descriptions of the bands of {file} are {found}, and its tag {TAG} has {wanted}: give each band its own "
        "description of the tag, once (rasterio: set_band_description), or open the file with rioxarray.open_rasterio"
    )


def _check_scales(source, name, coords, bands):
    """Raise ValueError if the scales of the file are not the calibration of the tag."""
    expected = np.ones(source.count), np.zeros(source.count)
    if "gain" in coords and "offset" in coords and "compression" not in coords:
        for values, key in zip(expected, ("gain", "offset"), strict=True):
            values[bands] = coords[key].values
    for found, wanted, what in zip((source.scales, source.offsets), expected, ("scales", "offsets"), strict=True):
        if not np.allclose(found, wanted, rtol=_SCALE_TOLERANCE, atol=_SCALE_TOLERANCE):
            raise ValueError(
                f"{name} has the {what} {_listed(found)}, and its tag {TAG} has {_listed(wanted)}: another program "
                f"changed the values or their scale. {CURE}"
            )


def _listed(values):
    return in_a_line(", ".join(f"{value:g}" for value in values), 80)


def _check_type(source, name, native):
    """Raise ValueError if the type of the file does not hold all values of the type that was written."""
    stored = np.dtype(source.dtypes[0])
    if not (np.can_cast(native, stored) or (native.kind == "f" and stored.kind == "f")):
        raise ValueError(
            f"{name} holds values of type {stored}, and fifesim wrote {native}: another program rounded or clipped "
            f"them. {CURE}"
        )


def _check_certain(source, name, cells, named, units):
    """Raise ValueError if nothing proves that the bands and values of a file are those of its tag."""
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
    """A type of numbers, times or short texts, looked at before anything of that type is made."""
    dtype = np.dtype(text)
    short_text = dtype.kind == "U" and dtype.itemsize <= 4 * _LONGEST_TEXT
    if not (short_text or (dtype.kind in "biufM" and dtype.itemsize <= 8) or dtype.kind == "O"):
        raise ValueError(f"{name} of type {text}")
    return dtype


def _variable(name, item, count):
    """A coordinate of the tag."""
    shape = (count,) if item.dims else ()
    dtype = _checked_dtype(name, item.dtype)
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
