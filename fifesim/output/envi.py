"""Simulated images of imaging spectrometers as ENVI files, in the layout that ISOFIT reads."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
import pandas as pd
import rasterio
import xarray as xr
from rasterio.windows import Window

from fifesim.base.arguments import NUMBER, FilePath, Kind, is_a
from fifesim.base.geometry import angle_between
from fifesim.grids import cf, projection
from fifesim.grids import grid as grids
from fifesim.grids.opening import errors_of_gdal
from fifesim.ground.terrain import labels as terrain
from fifesim.ground.terrain.elevation_labels import fine_dem
from fifesim.output.simulated_product import (
    Truth,
    acquisition_of,
    images_of_scene,
    instrument_of,
    product_folder,
    simulation_statement,
    write_truth,
)
from fifesim.sensor.instrument_labels import is_radiance, matching_bands
from fifesim.sensor.labels import to_radiance
from fifesim.sensor.response.scan import EARTH_RADIUS


class _Spectrometer(NamedTuple):
    mission: str
    first: str  # date of the launch, recalled
    name: str  # of the product, from which ISOFIT reads the time


_SPECTROMETERS = {
    "EMIT": _Spectrometer("EMIT", "2022-07-14", "emit{:%Y%m%dt%H%M%S}_simulated"),
    "EnMAP": _Spectrometer("EnMAP", "2022-04-01", "ENMAP01-____L1B-SIMULATED_{:%Y%m%dT%H%M%S}Z"),
    "PRISMA": _Spectrometer("PRISMA", "2019-03-22", "PRS_{:%Y%m%d%H%M%S}_SIMULATED"),
}

_NO_DATA = -9999.0

# 1 W m-2 sr-1 um-1 in uW cm-2 sr-1 nm-1.
_TO_MICROWATT = 0.1

# Rows that are written together, as memory permits for hundreds of bands. [pixel]
_ROWS = 128

LOCATION = ("longitude", "latitude", "elevation")
"""Bands of the location file [degree, degree, m]."""

OBSERVATION = (
    "path length", "to-sensor azimuth", "to-sensor zenith", "to-sun azimuth", "to-sun zenith", "phase", "slope",
    "aspect", "cosine i", "UTC time", "earth-sun distance",
)  # fmt: skip
"""Bands of the observation file, in the order of ISOFIT [m, degree, 1, hour, astronomical unit]."""

HeightOfPixels: TypeAlias = Annotated[
    xr.DataArray | float,
    Kind(
        "an elevation model as an xarray.DataArray, or one elevation in metres, such as 340.0",
        lambda value: is_a(value, "DataArray") or NUMBER.fits(value),
        dimensions=2,
    ),
]


def to_envi(
    image: xr.DataArray,
    folder: FilePath,
    *,
    dem: HeightOfPixels,
    truth: Truth | None = None,
    overwrite: bool = False,
) -> Path:
    """
    Write an image of an imaging spectrometer as the ENVI files that ISOFIT and HyTools read, with its truth.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x)
        Radiance or digital numbers of EMIT, EnMAP or PRISMA from `sense`, or reflectance from `to_surface`, on a
        north-up grid, with a time. Any selection of bands. [W m-2 sr-1 um-1 or 1]
    folder : str or path
        The product becomes a folder in it, whose name states the time and that the scene is simulated.
    dem : xarray.DataArray or float
        Elevation of the pixels: a raster that covers them, such as the one of the scene, or one number for level
        ground. [m]
    truth : xarray.Dataset, optional
        True rasters, such as ``surface_reflectance`` and ``lai``, which become files of the folder ``truth``. ``slope``
        and ``illumination`` of the elevation model are added, for `fifesim.exam`.
    overwrite : bool, optional
        Replace an earlier simulated product of this name.

    Returns
    -------
    product : pathlib.Path
        Folder of the product. ``*_rdn.img`` has radiance [uW cm-2 sr-1 nm-1], or ``*_rfl.img`` reflectance [1];
        ``*_loc.img`` longitude, latitude [degree] and elevation [m]; ``*_obs.img`` path length [m], azimuth and zenith
        toward the sensor and the sun, phase angle, slope, aspect [degree], cosine of the incidence angle [1], UTC time
        [hour] and distance of the sun [astronomical unit]. All are in BIL order with -9999 for no data, the first in
        single and the others in double precision.

    Raises
    ------
    ValueError
        If the instrument is another, the image has no time, or one outside of the mission, its sun disagrees with the
        time, or the elevation model does not cover the image.
    FileExistsError
        If the product exists and ``overwrite`` is False.

    Notes
    -----
    The cosine of the incidence angle is not set to 0 in shadow, as in the files of the agencies. The path length is the
    distance to an orbit of the instrument's nominal altitude over a spherical earth.

    See Also
    --------
    fifesim.exam

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import fifesim
    >>> grid = fifesim.grid_at("EPSG:32614", 705000, 4330000, width=600, height=600, cell=20)
    >>> lai, time = fifesim.lai_scene(grid, seed=7), "2023-06-03T17:10Z"
    >>> air = fifesim.Atmosphere(visibility=30)
    >>> options = {"bands": ["EMIT29", "EMIT69"], "atmosphere": air, "time": time}
    >>> toa = lai.fifesim.surface_reflectance("EMIT", **options).fifesim.to_toa()
    >>> image = toa.fifesim.sense("EMIT", quantise=False)
    >>> product = image.fifesim.to_envi(mkdtemp(), dem=340.0)
    >>> product.name, len(list(product.glob("*.img")))
    ('emit20230603t171000_simulated', 3)
    """
    (image,) = images_of_scene(image)
    known = ", ".join(_SPECTROMETERS)
    description = instrument_of([image], _SPECTROMETERS, f"only {known} have files in this layout")
    kind = _SPECTROMETERS[description.name]
    taken = acquisition_of([image], kind.mission, kind.first, None)
    grid = grids.geobox(image)
    values, suffix, unit = _values(image)
    height, slope, aspect = _ground(dem, grid)
    truth = xr.Dataset() if truth is None else truth
    if isinstance(dem, xr.DataArray):
        light = terrain.illumination(height, taken.geometry)
        truth = truth.assign({"slope": slope, "illumination": light} | dict(truth.data_vars))
    bands = matching_bands(image, description)
    widths = [getattr(band.srf, "width", np.nan) for band in bands]
    spectral = {
        "wavelength": _listed(1000 * band.response.center for band in bands),
        "wavelength_units": "Nanometers",
        "data_units": unit,
    }
    if np.isfinite(widths).all():
        spectral["fwhm"] = _listed(1000 * width for width in widths)
    name = kind.name.format(pd.Timestamp(taken.time))
    with product_folder(folder, name, truth, overwrite=overwrite) as new:
        write_truth(new, [image], truth)
        path, shared = (
            str(new / name),
            {"sensor_type": description.name, "acquisition_time": f"{str(taken.time)[:19]}Z"},
        )
        _write(f"{path}_{suffix}.img", values, grid, [band.name for band in bands], spectral | shared, "float32")
        _write(f"{path}_loc.img", _location(grid, height), grid, LOCATION, shared)
        observed = _observation(taken, description.altitude, height, slope, aspect)
        _write(f"{path}_obs.img", observed, grid, OBSERVATION, shared)
    return Path(folder) / name


def _values(image):
    """Values of an image as they are written, the end of the name of their file, and their unit."""
    if cf.is_counts(image):
        image = to_radiance(image)
    if is_radiance(image):
        return image * _TO_MICROWATT, "rdn", "uW/cm^2/sr/nm"
    cf.check_quantity(image, "surface_reflectance")
    return image, "rfl", "reflectance"


def _ground(dem, grid):
    """Elevation [m], slope and aspect [degree] on a grid."""
    if isinstance(dem, xr.DataArray):
        height = fine_dem(dem, grid)
        return height, terrain.slope(height), terrain.aspect(height)
    level = grids.place(xr.DataArray(np.zeros(grid.shape), dims=("y", "x")), grid)
    return level + float(dem), level, level


def _location(grid, height):
    """Longitude, latitude and elevation of pixels, shape (3, y, x)."""
    x, y = np.meshgrid(*(grids.coordinates(grid)[axis].values for axis in ("x", "y")))
    longitude, latitude = projection.transformer(grid.crs.to_wkt(), 4326).transform(x, y)
    return np.stack([longitude, latitude, height.values])


def _observation(taken, altitude, height, slope, aspect):
    """Path length, directions, terrain and time of pixels, in the order of `OBSERVATION`, shape (11, y, x)."""
    sza, saa, vza, vaa = (np.asarray(getattr(taken.geometry, name)) for name in ("sza", "saa", "vza", "vaa"))
    orbit = EARTH_RADIUS + altitude
    ground = EARTH_RADIUS + height.values
    sine, cosine = (ground * function(np.radians(vza)) for function in (np.sin, np.cos))
    path = np.sqrt(orbit**2 - sine**2) - cosine
    incidence = np.cos(np.radians(angle_between(sza, saa, slope.values, aspect.values)))
    hours = (taken.time - taken.time.astype("datetime64[D]")) / np.timedelta64(1, "h")
    layers = [
        path, vaa % 360, vza, saa % 360, sza, angle_between(sza, saa, vza, vaa), slope.values, aspect.values, incidence,
        hours, taken.earth_sun_distance,
    ]  # fmt: skip
    return np.stack([np.broadcast_to(layer, height.shape) for layer in layers])


def _listed(numbers):
    return "{" + ", ".join(f"{number:.6g}" for number in numbers) + "}"


def _write(path, layers, grid, names, tags, dtype="float64"):
    """Write layers, dims (band, y, x), as an ENVI file in BIL order, with all metadata in its header."""
    rows, columns = grid.shape
    profile = {"driver": "ENVI", "dtype": dtype, "interleave": "bil", "nodata": _NO_DATA, "count": len(names)}
    crs = rasterio.crs.CRS.from_wkt(grid.crs.to_wkt())
    # Without PAM, GDAL writes no other file next to the header.
    with (
        rasterio.Env(GDAL_PAM_ENABLED=False),
        errors_of_gdal(f"cannot write {path}"),
        rasterio.open(path, "w", height=rows, width=columns, crs=crs, transform=grid.affine, **profile) as sink,
    ):
        for start in range(0, rows, _ROWS):
            block = np.asarray(layers[:, start : start + _ROWS], dtype)
            block = np.where(np.isnan(block), block.dtype.type(_NO_DATA), block)
            sink.write(block, window=Window(0, start, columns, block.shape[1]))
        sink.descriptions = names
        sink.update_tags(ns="ENVI", **tags)
    # GDAL describes a file by its path at that time.
    header, described = Path(path).with_suffix(".hdr"), f"description = {{{simulation_statement()}}}"
    text = re.sub(r"description = \{[^}]*\}", described, header.read_text(encoding="utf-8"))
    header.write_text(text, encoding="utf-8")
