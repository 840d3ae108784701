"""Landsat products as labelled images."""

from __future__ import annotations

from typing import Literal

import numpy as np
import xarray as xr

from fifesim.base.arguments import Chunks, FilePath, Names
from fifesim.base.geometry import ANGLES, Geometry
from fifesim.grids import chunks as dask_chunks
from fifesim.grids import directions
from fifesim.grids import grid as grids
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.products import labels
from fifesim.sensor.products.labels import open_layer
from fifesim.sensor.products.landsat import read_scene
from fifesim.sensor.products.metadata import check_irradiance
from fifesim.sensor.response.calibration import hundredths

# Bit of QA_PIXEL for no data.
_FILL = 1

_QUALITY = {"long_name": "QA_PIXEL, quality of the pixel by bits", "units": "1"}


def open_landsat(
    path: FilePath,
    *,
    bands: Names | None = None,
    angles: Literal["centre", "pixel"] = "centre",
    quality: bool = True,
    chunks: Chunks = "auto",
    instrument: InstrumentLike | None = None,
) -> xr.DataArray:
    """
    Open a Landsat Collection-2 product: Level 1 as reflectance at the top of the atmosphere, Level 2 of the surface.

    MSS of Landsat 1 to 5 (Level 1), TM of Landsat 4 and 5, ETM+ of Landsat 7, OLI of Landsat 8 and OLI-2 of Landsat 9.
    Scale, sun and time come from the product's metadata.

    Parameters
    ----------
    path : str or path
        Folder of the unpacked product, or its metadata file ``*_MTL.txt``, ``.json`` or ``.xml``.
    bands : str or sequence of str, optional
        Names of the instrument's bands, such as ``["TM3", "TM4"]``, or other names: ``["B4", "B5"]``,
        ``["red", "nir"]``. By default all bands that show the ground at the common pixel size, 30 m (MSS: 60 m). The
        panchromatic band has its own grid, and OLI's cirrus band shows no ground. Thermal bands are not read.
    angles : "centre" or "pixel", optional
        "centre" uses sun and view of the scene centre, which all steps support. The view is from nadir; for a scene
        that was acquired off nadir, it follows from ROLL_ANGLE. With "pixel", angles by pixel from the files
        ``*_SZA.TIF``, ``*_SAA.TIF``, ``*_VZA.TIF`` and ``*_VAA.TIF`` of Level 1: over a scene the solar zenith angle
        differs by some two degrees, and the view zenith angle reaches 7.5 degrees at the sides.
    quality : bool, optional
        Read QA_PIXEL as coordinate ``quality`` over (y, x), and remove pixels that QA_RADSAT marks as saturated. With
        False, the two files are not needed.
    chunks : mapping or int or "auto", optional
        Chunks of the lazy image; "auto" means 2048 x 2048 pixels of a band. None reads everything at once.
    instrument : str or Instrument, optional
        Instrument that defines the spectral responses, instead of the spacecraft.

    Returns
    -------
    reflectance : xarray.DataArray of float32, dims (band, y, x)
        NaN for no data (digital number 0) and for saturated pixels, by QA_RADSAT or the largest digital number.
        Coordinates ``wavelength`` and ``solar_irradiance`` along band, ``time``, ``sza``, ``saa``, ``vza``, ``vaa``,
        ``earth_sun_distance`` and ``quality``. [1]

    Raises
    ------
    ValueError
        If the product is of another collection or spacecraft, was taken at night, a file is missing or not a raster, or
        the metadata are inconsistent: repeated keys; a scale that does not give REFLECTANCE_MINIMUM and _MAXIMUM of the
        same file within 0.05 %; a sun that is 2 degrees away from its position at that time and place; an Earth-Sun
        distance of another date; a date before the launch or in the future.

    Notes
    -----
    Level 1 is scaled by reflectance without the sun's cosine, which is divided out here, with ``angles="pixel"`` by
    the cosine of each pixel. Its solar irradiance follows from its scales of radiance and reflectance, and differs from
    the instrument's description by up to 5 % for TM. Mask clouds with ``scene.where(scene.quality & 0b11000 == 0)``:
    bit 3 is cloud, bit 4 its shadow. A GeoTIFF keeps neither quality nor angles by pixel.

    References
    ----------
    USGS, Landsat Collection 2 Level-1 and Level-2 data format control books

    See Also
    --------
    fifesim.sensor.response.calibration.product_reflectance

    Examples
    --------
    >>> import fifesim
    >>> product = "LT05_L1TP_028033_19870606_20201014_02_T1_MTL.txt"
    >>> image = fifesim.open_landsat(product)  # doctest: +SKIP
    >>> image.fifesim.to_surface().fifesim.ndvi()  # doctest: +SKIP
    """
    sizes = labels.layer_chunk_sizes(chunks)
    scene, folder = read_scene(path)
    if angles not in ("centre", "pixel"):
        raise ValueError(f"angles must be 'centre' or 'pixel', got {angles!r}")
    description = find_instrument(scene.instrument if instrument is None else instrument)
    if instrument is None:
        check_irradiance(scene.product, scene.bands, description)
    selected = _selected(scene, folder, description, bands)
    there = [band.name for band in scene.bands if (folder / band.file).exists()]
    cure = f"fetch it, or open those that are there with bands={there}" if there else "is the product unpacked there?"
    layers = [open_layer(folder, band.file, sizes, cure) for band in selected]
    # The pixels of the panchromatic band are not aligned with the other files.
    beside = quality and all(band.flag for band in selected)
    mask, flags = _quality(scene, folder, sizes, layers[0]) if beside else (None, None)
    geometry = _geometry(scene, folder, sizes, angles, layers[0])
    mu_s = directions.mu_s(geometry) if scene.level == 1 else 1.0
    return labels.as_image(
        labels.reflectance(layers, selected, flags, mu_s),
        selected,
        description,
        level=scene.level,
        time=scene.time,
        geometry=geometry,
        quality=mask,
        history=f"open_landsat: {scene.product}",
        reference=scene.reference,
    )


def _selected(scene, folder, description, names):
    """Requested bands, by default the bands of the 30 m grid that show the ground."""
    known = {band.name: band for band in scene.bands}
    if names is None:
        return [band for band in scene.bands if band.name not in scene.aside]
    names = [names] if isinstance(names, str) else names
    for name in names:
        if str(name).upper() in scene.thermal:
            raise ValueError(
                f"{name} is thermal, and reflectance is read: {scene.product} has {', '.join(known)} of reflected light"
            )
    found = [band.name for band in description.select([str(name) for name in names])]
    missing = [name for name in found if name not in known]
    if missing:
        raise ValueError(f"{scene.product} has no {' nor '.join(missing)}: it has {', '.join(known)}")
    return [known[name] for name in found]


def _quality(scene, folder, sizes, beside):
    """Quality of the pixels, and their saturated bands."""
    cure = "fetch it, or open the scene without it, quality=False"
    mask, flags = (open_layer(folder, name, sizes, cure) for name in (scene.quality, scene.saturation))
    for layer in (mask, flags):
        labels.check_same_grid(layer, beside)
    return mask.assign_attrs(_QUALITY), flags


def _geometry(scene, folder, sizes, angles, beside):
    if angles == "centre":
        if scene.view is None:
            raise ValueError(
                f"{scene.product} was acquired off nadir, and its metadata have no ROLL_ANGLE with a WRS_ROW from 1 to "
                "248, which give the view at the centre: use angles='pixel'"
            )
        return Geometry(scene.sza, scene.saa, *scene.view, earth_sun_distance=scene.earth_sun_distance)
    missing = [name for name in ANGLES if name not in scene.angles]
    if missing:
        raise ValueError(f"the metadata name no files of {', '.join(missing)} by pixel: give angles='centre'")
    cure = "fetch it from the Level-1 product, or give angles='centre'"
    fill = open_layer(folder, scene.quality, sizes, cure)
    layers = {name: open_layer(folder, scene.angles[name], sizes, cure) for name in ANGLES}
    for layer in (fill, *layers.values()):
        labels.check_same_grid(layer, beside)
    fill = xr.apply_ufunc(np.bitwise_and, fill, _FILL, dask="allowed") == _FILL
    by_pixel = {}
    for name, layer in layers.items():
        angle = dask_chunks.pointwise(hundredths, layer, fill, turns=name.endswith("aa"))
        by_pixel[name] = grids.place(angle.rename(None), grids.geobox(beside))
    return directions.checked_geometry(xr.Dataset(by_pixel | {"earth_sun_distance": scene.earth_sun_distance}))
