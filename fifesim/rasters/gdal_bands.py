"""Bands of files of other programs, by what GDAL knows of them."""

import numpy as np
import xarray as xr

from fifesim.base.foreign import in_a_line
from fifesim.rasters import cf


def physical(array, storage):
    """
    Values of a file of another program in their unit.

    Parameters
    ----------
    array : xarray.DataArray, dims (band, y, x)
        Values of the file.
    storage : dict
        From `gdal_description`.

    Returns
    -------
    array : xarray.DataArray, dims (band, y, x)
        NaN where there are no data; digital numbers of radiance stay as they are, with 0 for no data.
    """
    scales, offsets, nodata = storage["scales"], storage["offsets"], storage["nodata"]
    missing = xr.zeros_like(array, dtype=bool) if nodata is None else array == nodata
    if scales is None:
        return array.where(~missing, array.dtype.type(0))
    if nodata is None and all(scale == 1 for scale in scales) and not any(offsets):
        return array
    gain, offset = (xr.DataArray(list(values), dims="band") for values in (scales, offsets))
    return array.where(~missing) * gain + offset


def gdal_description(source, file_name):
    """
    Names, calibration and wavelengths of a file that fifesim did not write.

    Parameters
    ----------
    source : rasterio.io.DatasetReader
    file_name : str
        For messages.

    Returns
    -------
    description : dict
        As from `fifesim.rasters.tags.read_tag`.
    storage : dict
        ``scales`` (None for digital numbers), ``offsets`` and ``nodata`` of the file.

    Raises
    ------
    ValueError
        If wavelengths are no numbers, or whole numbers with units of radiance have no scale.
    """
    names = [name or f"band{number}" for number, name in enumerate(source.descriptions, 1)]
    values = {"wavelength": _wavelengths(source, file_name)}
    counts = np.dtype(source.dtypes[0]).kind == "u" and set(source.units) == {cf.QUANTITIES["toa_radiance"].units}
    if counts and set(zip(source.scales, source.offsets, strict=True)) == {(1.0, 0.0)}:
        raise ValueError(
            f"the bands of {file_name} have units of radiance and no scale, so that their digital numbers have no "
            "calibration: give them one (rasterio: scales, offsets), or convert radiance to fractions with "
            "gdal_translate -ot Float32"
        )
    if counts:
        values |= {"gain": list(source.scales), "offset": list(source.offsets)}
    coords = {"band": xr.DataArray(names, dims="band")}
    coords |= {
        name: xr.DataArray(value, dims="band", attrs=cf.attributes(name)) for name, value in values.items() if value
    }
    shared = source.units[0] if len(set(source.units)) == 1 else None
    units = {} if counts or not shared else {"units": shared}
    storage = {"scales": None if counts else source.scales, "offsets": source.offsets, "nodata": source.nodata}
    return {"name": "image", "dims": ["band", "y", "x"], "attrs": units, "coords": coords}, storage


def _wavelengths(source, file_name):
    """Wavelengths of all bands [um], or None."""
    said = [source.tags(number, ns="IMAGERY").get("CENTRAL_WAVELENGTH_UM") for number in source.indexes]
    try:
        return [float(value) for value in said] if all(said) else None
    except ValueError:
        raise ValueError(
            f"{file_name} has wavelengths such as {in_a_line(said[0], 40)!r}, not all numbers: open it with "
            "rioxarray.open_rasterio"
        ) from None
