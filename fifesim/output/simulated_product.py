"""Products of simulated scenes in the layout of an agency: input checks, digital numbers, truth, and the folder."""

from __future__ import annotations

import importlib.metadata
import json
import os
import re
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TypeAlias

import numpy as np
import rasterio
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.arguments import Kind, is_a
from fifesim.base.files import flush, in_a_line, shown
from fifesim.base.geometry import ANGLES, Geometry, angle_between, earth_sun_distance, sun_positions
from fifesim.grids import cf, directions, projection
from fifesim.grids import grid as grids
from fifesim.grids.files import to_geotiff
from fifesim.grids.opening import errors_of_gdal
from fifesim.sensor.description.instrument_file import Instrument, InstrumentBand
from fifesim.sensor.instrument_labels import carried_instrument, is_radiance, matching_bands
from fifesim.sensor.labels import saturated_number, to_reflectance
from fifesim.sensor.response.calibration import direction_angles, mean_direction

MARK = "SIMULATED.txt"
"""File that states that a product is simulated, and allows a later call to replace its folder."""

# Images from `sense`: one grid, or a node for each pixel size.
Images: TypeAlias = Annotated[
    xr.DataArray | xr.DataTree,
    Kind(
        "an image from sense: an xarray.DataArray, or an xarray.DataTree with an image for each pixel size",
        lambda value: is_a(value, "DataArray", "DataTree"),
    ),
]

Truth: TypeAlias = Annotated[
    xr.Dataset, Kind("an xarray.Dataset of rasters", lambda value: is_a(value, "Dataset"), numbers=None)
]

# Largest difference between the sun of a scene and of the almanac, below the 2 degrees at which `open_landsat` and
# `open_sentinel2` refuse a product, because both measure from other places of the scene. [degree]
_SUN = 1.0

# Earth-Sun distances of one date agree within this. [astronomical unit]
_DISTANCE = 5e-4


def simulation_statement():
    """Sentence that a product is simulated."""
    return f"Simulated scene made by fifesim {importlib.metadata.version('fifesim')}, not an observation by a satellite"


@dataclass(frozen=True)
class Layer:
    """Band of a simulated scene."""

    band: InstrumentBand
    grid: GeoBox
    reflectance: xr.DataArray  # planetary, NaN for no data and for saturated pixels, dims (y, x) [1]
    saturated: xr.DataArray | None  # mask of an image of digital numbers, dims (y, x)


@dataclass(frozen=True)
class Acquisition:
    """Time and directions of a simulated scene."""

    time: np.datetime64  # UTC
    geometry: Geometry | xr.Dataset  # directions as numbers, or by pixel of the first image [degree]
    sza: float  # mean directions [degree]
    saa: float
    vza: float
    vaa: float
    earth_sun_distance: float  # [astronomical unit]


def images_of_scene(images):
    """Images of a scene as a list of arrays with dims (band, y, x)."""
    nodes = [images]
    if isinstance(images, xr.DataTree):
        nodes = [next(iter(node.data_vars.values())) for node in images.subtree if node.data_vars]
    if not nodes:
        raise ValueError("the DataTree holds no image: give the result of .fifesim.sense(...)")
    for image in nodes:
        if "time" in image.dims:
            raise ValueError(f"a product is of one date, got {image.sizes['time']}: select one with .isel(time=0)")
    return [(image if "band" in image.dims else image.expand_dims("band")) for image in nodes]


def instrument_of(images, known, others):
    """Instrument of the images, which must be among the known names."""
    found = carried_instrument(images[0])
    if found is None or found.name not in known:
        name = "unknown" if found is None else shown(found.name)
        raise ValueError(f"the instrument of the image is {name}, and must be one of {', '.join(known)}: {others}")
    return found


def layers_of_scene(images, description: Instrument, omitted=()):
    """Layers of images by band name, on the grids of the product; all bands of a pixel size must be given."""
    found, sizes = {}, set()
    for image in images:
        grid = grids.geobox(image)
        cells = grids.cell_size(grid)
        reflectance, saturated = _planetary(image)
        for number, band in enumerate(matching_bands(image, description)):
            size = description.pixel(band)
            if not np.allclose(cells, size, rtol=1e-6):
                raise ValueError(
                    f"{band.name} has pixels of {cells[0]:g} x {cells[1]:g} m, and the product of {description.name} "
                    f"has {size:g} m: make the image with .fifesim.sense({description.name!r}), or leave the band out"
                )
            mask = None if saturated is None else saturated.isel(band=number, drop=True)
            found[band.name] = Layer(band, grid, reflectance.isel(band=number, drop=True), mask)
            sizes.add(size)
    wanted = [band for band in description.bands if description.pixel(band) in sizes and band.name not in omitted]
    if missing := [band.name for band in wanted if band.name not in found]:
        raise ValueError(
            f"the image has no {', '.join(missing)}, and the product of {description.name} has all bands of a pixel "
            "size: simulate them, without bands= in surface_reflectance"
        )
    _check_extents(found)
    return {band.name: found[band.name] for band in description.bands if band.name in found}


def _planetary(image):
    """Planetary reflectance of an image, and the mask of saturated pixels of digital numbers."""
    if cf.is_counts(image):
        number = saturated_number(image)
        return to_reflectance(image), (image >= number if number else None)
    if is_radiance(image):
        return to_reflectance(image), None
    cf.check_quantity(image, "toa_reflectance")
    return image, None


def _check_extents(layers):
    """Raise ValueError for layers whose grids differ in CRS or bounds, or are not in WGS 84 / UTM."""
    first, *others = layers.values()
    for other in others:
        same = first.grid.crs == other.grid.crs
        if not same or not np.allclose(first.grid.boundingbox.bbox, other.grid.boundingbox.bbox, atol=1e-3):
            raise ValueError(
                f"{first.band.name} and {other.band.name} cover different areas, {grids.in_words(first.grid)} and "
                f"{grids.in_words(other.grid)}: simulate an area whose sides are multiples of all pixel sizes"
            )
    if utm_zone(first.grid) is None:
        raise ValueError(
            f"the CRS must be WGS 84 / UTM, EPSG:32601 to 32660 or 32701 to 32760, got "
            f"{projection.name_of(first.grid.crs.proj)}: make the scene there, with fifesim.grid_at('EPSG:32614', ...)"
        )


def utm_zone(grid):
    """Number of the UTM zone of a grid and whether it is the northern half, None for another CRS."""
    code = grid.crs.to_epsg() or 0
    half, zone = divmod(code - 32600, 100)
    return (zone, half == 0) if half in (0, 1) and 1 <= zone <= 60 else None


def acquisition_of(images, mission, first, last):
    """Acquisition of a scene within a mission, with the sun of the almanac."""
    image = images[0]
    time = image.coords.get("time")
    if time is None or time.ndim or np.isnat(time.values):
        raise ValueError(
            "the image has no time, which names the product: give it in UTC, to_toa(..., time='2021-07-01T17:05Z'), or "
            "with .assign_coords(time=numpy.datetime64('2021-07-01T17:05'))"
        )
    time = time.values.astype("datetime64[ns]")
    last = np.datetime64("today") if last is None else np.datetime64(last)
    if not np.datetime64(first) <= time.astype("datetime64[D]") <= last:
        raise ValueError(
            f"the image is of {str(time)[:16]}, and {mission} has images from {first} to {last}: give another time="
        )
    geometry = directions.geometry_of(image)
    if geometry is None or "saa" not in image.coords:
        raise ValueError("the image has no sza and saa: give time= or geometry= to to_toa")
    longitude, latitude = projection.middle(grids.geobox(image))
    means = [_mean_angles(*(np.asarray(getattr(geometry, f"{kind}{angle}a")) for angle in "za")) for kind in "sv"]
    distance = float(geometry.earth_sun_distance)
    _check_sun(time, latitude, longitude, *means[0], distance)
    return Acquisition(time, geometry, *means[0], *means[1], distance)


def _mean_angles(zenith, azimuth):
    """Mean zenith and azimuth of directions. [degree]"""
    if zenith.ndim == azimuth.ndim == 0:
        return float(zenith), float(azimuth) % 360
    return tuple(map(float, direction_angles(mean_direction(*map(np.ravel, np.broadcast_arrays(zenith, azimuth))))))


def _check_sun(time, latitude, longitude, sza, saa, distance):
    """Raise ValueError for a sun of another time or place, which readers of products refuse."""
    _, zenith, azimuth, _ = sun_positions([str(time)], latitude, longitude)
    if not angle_between(sza, saa, zenith[0], azimuth[0]) <= _SUN:
        raise ValueError(
            f"the image has a sun of sza {sza:.2f} and saa {saa:.2f} degrees, and at {str(time)[:16]} UTC over "
            f"{latitude:.2f} N, {longitude:.2f} E it had {zenith[0]:.2f} and {azimuth[0]:.2f} (at most {_SUN:g} degree "
            "apart): use time= and not geometry= when you make the scene"
        )
    expected = earth_sun_distance(str(time))
    if not abs(distance - expected) <= _DISTANCE:
        raise ValueError(
            f"earth_sun_distance must be within {_DISTANCE:g} of {expected:.5f} on {str(time)[:10]}, got "
            f"{distance:.5f}: use time= when you make the scene, or Geometry(..., earth_sun_distance={expected:.5f})"
        )


def digital_numbers(layer, gain, offset, largest, mu_s=1.0):
    """Digital numbers of a layer by reflectance times mu_s: 0 for no data, the largest where it is saturated."""
    mu_s = np.asarray(mu_s)
    reflectance = np.asarray(layer.reflectance.values, float) * mu_s
    counts = np.rint((reflectance - offset) / gain)
    known = np.isfinite(counts)
    wrong = known & ~((counts >= 1) & (counts < largest))
    if wrong.any():
        worst = layer.reflectance.values[wrong][0]
        low, high = ((gain * count + offset) / float(np.mean(mu_s)) for count in (1, largest - 1))
        raise ValueError(
            f"{layer.band.name} has a reflectance of {worst:.4g}, and digital numbers hold {low:.4g} to {high:.4g}: "
            "record the image with .fifesim.sense(...), whose numbers end at saturation"
        )
    counts = np.where(known, counts, 0)
    if layer.saturated is not None:
        counts = np.where(layer.saturated.values, largest, counts)
    return counts.astype(np.uint8 if largest < 256 else np.uint16)


def mask_of(truth, name, grid):
    """Cells of a grid with at least half of a true mask such as ``cloud``; False everywhere if there is none."""
    if truth is None or name not in truth:
        return np.zeros(grid.shape, bool)
    found = grids.geobox(truth[name])
    if not grids.same_grid(found, grid):
        raise ValueError(
            f"truth[{name!r}] sets the quality band and must be on the grid of the image, {grids.in_words(grid)}, got "
            f"{grids.in_words(found)}: use truth.fifesim.aggregate(...), or give it another name"
        )
    return truth[name].transpose("y", "x").values >= 0.5


def write_raster(path, values, grid, driver="GTiff", **options):
    """Write an array with dims ([band], y, x) as a raster."""
    layers = values.reshape(-1, *values.shape[-2:])
    options |= {"QUALITY": "100", "REVERSIBLE": "YES"} if driver == "JP2OpenJPEG" else {"compress": "deflate"}
    crs = rasterio.crs.CRS.from_wkt(grid.crs.to_wkt())
    profile = {"driver": driver, "crs": crs, "transform": grid.affine, "dtype": layers.dtype, "count": len(layers)}
    path.parent.mkdir(parents=True, exist_ok=True)
    with (
        errors_of_gdal(f"cannot write {path}"),
        rasterio.open(path, "w", height=grid.shape.y, width=grid.shape.x, **profile, **options) as sink,
    ):
        sink.write(layers)
        if driver == "GTiff":
            sink.update_tags(TIFFTAG_IMAGEDESCRIPTION=simulation_statement())


def write_truth(folder, images, truth=None):
    """Write the true rasters as GeoTIFFs, and the attributes of the scene as JSON, into the folder ``truth``."""
    (folder / "truth").mkdir()
    variables = {} if truth is None else truth.data_vars
    for name, raster in variables.items():
        raster = raster.astype(np.uint8) if raster.dtype == bool else raster
        # Shares of classes, as from `aggregate`, are bands of a file.
        raster = raster.rename({"class": "band"}) if "class" in raster.dims else raster
        kept = [each for each in raster.coords if each in ANGLES and raster.coords[each].ndim]
        to_geotiff(raster.drop_vars(kept), folder / "truth" / f"{name}.tif")
    image = images[0]
    described = {
        "statement": simulation_statement(),
        "image": {str(key): _plain(value) for key, value in image.attrs.items()},
        "coordinates": {str(key): _plain(each.values) for key, each in image.coords.items() if not each.ndim},
        "bands": [name for each in images for name in map(str, np.atleast_1d(each["band"].values))],
        "truth": {
            str(name): {str(key): _plain(value) for key, value in each.attrs.items()}
            for name, each in variables.items()
        },
    }
    (folder / "truth" / "scene.json").write_text(json.dumps(described, indent=2) + "\n", encoding="utf-8")


def _plain(value):
    """Value as JSON can hold it."""
    value = value.item() if np.ndim(value) == 0 and hasattr(value, "item") and value.dtype.kind in "iufb" else value
    return value if isinstance(value, str | bool | int | float) and value == value else str(value)


@contextmanager
def product_folder(folder, name, truth=None, *, overwrite=False):
    """Context with a hidden folder, which becomes the product ``folder/name`` if there is no error."""
    target = Path(folder) / name
    wrong = [each for each in (truth.data_vars if truth is not None else ()) if not re.fullmatch(r"\w[\w.\-]*", each)]
    if wrong:
        raise ValueError(f"truth has a variable {shown(wrong[0])}, which names no file: rename it, such as 'lai'")
    if os.path.lexists(target):
        _check_replaceable(target, overwrite)
    Path(folder).mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=f".{name}.") as hidden:
        new, old = Path(hidden) / name, Path(hidden) / "replaced"
        new.mkdir()
        yield new
        (new / MARK).write_text(f"{simulation_statement()}.\nThe truth is in the folder truth.\n", encoding="utf-8")
        flush(*(path for path in new.rglob("*") if path.is_file()))
        try:
            if os.path.lexists(target):
                os.replace(target, old)
            os.replace(new, target)
        finally:
            # After an error or an interruption, the earlier product is moved back.
            if old.exists() and not os.path.lexists(target):
                os.replace(old, target)
        flush(target.parent)


def _check_replaceable(target, overwrite):
    """Raise FileExistsError unless a folder is a simulated product that may be replaced."""
    where = in_a_line(target, 200)
    if target.is_symlink() or not (target / MARK).is_file():
        raise FileExistsError(f"{where} exists and is no product of fifesim (it has no {MARK}): give another folder")
    if not overwrite:
        raise FileExistsError(f"there is a product {where}: type overwrite=True to replace it, or another folder")
