"""Files of a product as layers on one grid, and what makes an image of them."""

import os

import numpy as np
import xarray as xr

from fifesim.base.foreign import in_a_line
from fifesim.rasters import cf, chunks, directions
from fifesim.rasters import grid as grids
from fifesim.rasters.opening import ErrorsOfGdal, raster_file, stored_cells
from fifesim.rasters.soundness import check_memory, check_raster, horizontal_crs
from fifesim.sensor.description.rasters.carried import attributes_of
from fifesim.sensor.products.scaling import product_reflectance

# Edge of a chunk by default: whole blocks of the agencies' files. [pixel]
CHUNK = 2048


def chunk_sizes(given):
    """
    Chunks of a layer.

    Parameters
    ----------
    given : mapping, int, "auto" or None

    Returns
    -------
    chunks : mapping or int or None
    """
    return {"y": CHUNK, "x": CHUNK} if given == "auto" else given


def open_layer(folder, name, chunks, cure, count=None):
    """
    A file of a product.

    Parameters
    ----------
    folder : pathlib.Path
    name : str
        Of the file, below the folder.
    chunks : mapping or int or None
        Makes it lazy.
    cure : str
        What to do where it is missing.
    count : int, optional
        Number of its bands, where it has several.

    Returns
    -------
    layer : xarray.DataArray of integers, dims (y, x), or (band, y, x) with a count

    Raises
    ------
    ValueError
        If it is missing, is no raster of whole numbers on a north-up grid in metres, or does not fit into memory.
    """
    path = folder / name
    if not path.exists():
        raise ValueError(f"{in_a_line(name, 150)} is missing in {in_a_line(folder, 120)}: {cure}")
    file = raster_file(path)
    with ErrorsOfGdal(f"cannot read {file.name}"):
        with file.opened() as source:
            check_raster(source, file.name, north_up=True)
            crs = horizontal_crs(source, file.name)
            if source.count != (count or 1) or np.dtype(source.dtypes[0]).kind not in "iu":
                raise ValueError(
                    f"{file.name} has {source.count} bands of {source.dtypes[0]}, where a product has {count or 1} of "
                    "whole numbers: is it another file?"
                )
            if chunks is None:
                size = source.count * source.height * source.width
                check_memory(size, 12, f"all of {file.name}", "leave chunks out, which reads it by parts")
        plain = stored_cells(file, crs, chunks)
    layer = xr.DataArray(plain.data, dims=("band", "y", "x"), name=path.name)
    layer = layer if count else layer.isel(band=0)
    return grids.place(layer, grids.geobox(plain))


def stacked(layers):
    """
    Layers on one grid as bands.

    Parameters
    ----------
    layers : sequence of xarray.DataArray, dims (y, x)
        With names for messages.

    Returns
    -------
    stack : xarray.DataArray, dims (band, y, x)

    Raises
    ------
    ValueError
        If they lie on different grids.
    """
    first = layers[0]
    for layer in layers[1:]:
        check_same_grid(layer, first)
    bare = [layer.drop_vars(["y", "x", "spatial_ref"]).rename(None) for layer in layers]
    return grids.place(xr.concat(bare, dim="band"), grids.geobox(first))


def check_same_grid(layer, other):
    """
    Refuse layers of one product that lie on different grids.

    Parameters
    ----------
    layer, other : xarray.DataArray, dims (y, x)

    Raises
    ------
    ValueError
        If they do.
    """
    one, two = grids.geobox(layer), grids.geobox(other)
    if not grids.same_grid(one, two):
        names = " and ".join(os.path.basename(each.name) for each in (layer, other))
        raise ValueError(
            f"{names} lie on different grids, {grids.in_words(one)} and {grids.in_words(two)}: "
            "open them one at a time with bands="
        )


def reflectance(stack, bands, flags=None, mu_s=1.0):
    """
    Reflectance of stacked digital numbers.

    Parameters
    ----------
    stack : xarray.DataArray of unsigned integers, dims (band, y, x)
    bands : sequence of fifesim.sensor.products.scaling.ProductBand
    flags : xarray.DataArray of unsigned integers, dims (y, x), optional
        Bands that are saturated, by pixel.
    mu_s : float or xarray.DataArray, dims (y, x), optional
        Cosine of the solar zenith angle, where the product has it still in its reflectance. [1]

    Returns
    -------
    reflectance : xarray.DataArray of float32, dims (band, y, x)
        [1]

    See Also
    --------
    fifesim.sensor.products.scaling.product_reflectance
    """
    scale = [
        xr.DataArray([getattr(band, name) for band in bands], dims="band") for name in ("gain", "offset", "largest")
    ]
    flag = xr.DataArray(np.array([band.flag for band in bands], np.uint16), dims="band")
    flags = xr.DataArray(np.uint16(0)) if flags is None else flags
    parts = (stack, *scale, flag, flags, xr.DataArray(mu_s))
    return chunks.pointwise(product_reflectance, *parts, dtype=np.float32)


def as_image(array, bands, description, *, level, time, geometry, quality, history, reference):
    """
    Reflectance of a product with the labels and coordinates that the package's own images have.

    Parameters
    ----------
    array : xarray.DataArray, dims (band, y, x)
        From `reflectance`.
    bands : sequence of fifesim.sensor.products.scaling.ProductBand
    description : fifesim.sensor.description.instruments.Instrument
    level : int
        1 for the top of the atmosphere, 2 for the surface.
    time : numpy.datetime64
        UTC.
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset
        As `directions.checked_geometry` gives it.
    quality : xarray.DataArray, dims (y, x), or None
    history, reference : str

    Returns
    -------
    image : xarray.DataArray, dims (band, y, x)
    """
    own = description.select([band.name for band in bands])
    along_band = {
        "band": [band.name for band in own],
        "wavelength": [band.wavelength for band in own],
        "solar_irradiance": [
            band.solar_irradiance if given.solar_irradiance is None else given.solar_irradiance
            for band, given in zip(own, bands, strict=True)
        ],
    }
    array = directions.with_geometry(array.assign_coords(cf.band_coordinates(**along_band)), geometry)
    array = array.assign_coords(time=((), time, cf.TIME))
    if quality is not None:
        array = array.assign_coords(quality=(("y", "x"), quality.data, quality.attrs))
    name = "toa_reflectance" if level == 1 else "surface_reflectance"
    return cf.label(array, name, history=history, references=reference, **attributes_of(description))
