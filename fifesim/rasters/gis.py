"""What a GIS looks for in a raster file: colours of bands by wavelength, time of acquisition, sun and view."""

import numpy as np
from rasterio.enums import ColorInterp

from fifesim.base.bands import BLUE, GREEN, NEAR_INFRARED, RED, nearest

# By the names that rasterio has for GDAL's; the near infrared has one since GDAL 3.10.
_COLOURS = {
    ColorInterp.red: RED,
    ColorInterp.green: GREEN,
    ColorInterp.blue: BLUE,
    getattr(ColorInterp, "nir", ColorInterp.undefined): NEAR_INFRARED,
}

# Tags as the metadata of Landsat spells them. The sun's elevation is counted from the horizon.
_TAGS = {"saa": "SUN_AZIMUTH", "vza": "VIEW_ZENITH", "vaa": "VIEW_AZIMUTH", "earth_sun_distance": "EARTH_SUN_DISTANCE"}


def colours(array):
    """
    Colour interpretation of bands, by their wavelengths.

    Parameters
    ----------
    array : xarray.DataArray, dims (band, y, x)

    Returns
    -------
    colours : list of rasterio.enums.ColorInterp
        Red, green, blue and near infrared are each one band's, that which shows it best; others are undefined, and a
        single band without a colour is grey.
    """
    found = [ColorInterp.undefined] * array.sizes["band"]
    if "wavelength" in array.coords:
        wavelengths = np.atleast_1d(array["wavelength"].values)
        for colour, window in _COLOURS.items():
            number = nearest(wavelengths, window)
            if number is not None:
                found[number] = colour
    if found == [ColorInterp.undefined]:
        return [ColorInterp.gray]
    return found


def tags_of(array):
    """
    Tags of sun, view and time as those who read satellite images expect them.

    Parameters
    ----------
    array : xarray.DataArray

    Returns
    -------
    tags : dict of str to str
        Of the file; angles in degrees, ``TIFFTAG_DATETIME`` in UTC.
    imagery : dict of str to str
        Of GDAL's domain ``IMAGERY``.
    """
    scalars = {name: value.values[()] for name, value in array.coords.items() if not value.dims}
    tags = {tag: f"{float(scalars[name]):.9g}" for name, tag in _TAGS.items() if name in scalars}
    if "sza" in scalars:
        tags["SUN_ELEVATION"] = f"{90 - float(scalars['sza']):.9g}"
    imagery = {}
    time = scalars.get("time")
    if isinstance(time, np.datetime64) and not np.isnat(time):
        date, clock = np.datetime_as_string(time, unit="s").split("T")
        tags["TIFFTAG_DATETIME"] = f"{date.replace('-', ':')} {clock}"
        imagery["ACQUISITIONDATETIME"] = f"{date} {clock}"
    return tags, imagery
