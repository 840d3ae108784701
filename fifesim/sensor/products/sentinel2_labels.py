"""Sentinel-2 products as labelled images."""

from __future__ import annotations

from functools import partial
from typing import Literal

import dask.array as da
import numpy as np
import xarray as xr

from fifesim.base.arguments import Chunks, FilePath, Names
from fifesim.base.geometry import Geometry
from fifesim.grids import chunks as chunks_of
from fifesim.grids import directions, windows
from fifesim.grids import grid as grids
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.products import labels
from fifesim.sensor.products.labels import CHUNK, open_layer
from fifesim.sensor.products.metadata import check_irradiance
from fifesim.sensor.products.sentinel2 import CIRRUS, sentinel2_metadata_file, sentinel2_product, sentinel2_tile
from fifesim.sensor.response import calibration

_SIZES = (10, 20, 60)

_CLOUDS = {
    "long_name": "cloud and snow masks",
    "units": "1",
    "comment": "bits: 1 opaque cloud, 2 cirrus, 4 snow or ice",
}

_CLASSES = {
    "long_name": "scene classification",
    "units": "1",
    "comment": (
        "0 no data, 1 saturated or defective, 2 dark, 3 cloud shadow, 4 vegetation, 5 not vegetated, 6 water, "
        "7 unclassified, 8 cloud of medium and 9 of high probability, 10 thin cirrus, 11 snow or ice"
    ),
}


def open_sentinel2(
    path: FilePath,
    resolution: Literal[10, 20, 60] | None = None,
    *,
    bands: Names | None = None,
    angles: Literal["centre", "pixel"] = "centre",
    quality: bool = True,
    chunks: Chunks = "auto",
    instrument: InstrumentLike | None = None,
) -> xr.DataArray:
    """
    Open a Sentinel-2 product: Level-1C as reflectance at the top of the atmosphere, Level-2A of the surface.

    Supports single tiles of Sentinel-2A and -2B, with processing baselines before and since 04.00. Offsets are taken
    from the metadata.

    Parameters
    ----------
    path : str or path
        Unpacked ``.SAFE`` folder, or its metadata file ``MTD_MSIL1C.xml`` or ``MTD_MSIL2A.xml``.
    resolution : 10, 20 or 60, optional
        Pixel size. In Level-1C each band has one size, and the default is 10. The default of Level-2A is 20, which has
        all bands except the broad near infrared band. [m]
    bands : str or sequence of str, optional
        Band names, such as ``["MSI4", "MSI8"]``, ``["B04", "B08"]`` or ``["red", "nir"]``; by default all of this size
        except the cirrus band.
    angles : "centre" or "pixel", optional
        "centre" uses mean sun and view of the tile, which all steps support; the view is the mean of the bands. A mean
        sun of NaN, as in tiles at the antimeridian, is replaced by the mean of the grid. "pixel" interpolates the 5 km
        grids of the metadata; the view is the mean of bands and detectors.
    quality : bool, optional
        Read a coordinate ``quality`` over (y, x): the scene classification of Level-2A (at 20 m for 10 m bands), or the
        60 m masks of Level-1C since baseline 04.00, with values 1 for opaque clouds, 2 for cirrus and 4 for snow.
    chunks : mapping or int or "auto", optional
        Chunks of the lazy image; "auto" means 2048 x 2048 pixels of a band. None reads everything at once.
    instrument : str or Instrument, optional
        Instrument that defines the spectral responses, instead of the spacecraft. No responses were found for
        Sentinel-2C; "MSI-C" uses the responses of Sentinel-2A.

    Returns
    -------
    reflectance : xarray.DataArray of float32, dims (band, y, x)
        NaN for no data (digital number 0) and saturated pixels (65535). Coordinates as in `fifesim.open_landsat`; the
        Earth-Sun distance is the value used in the product. [1]

    Raises
    ------
    ValueError
        If the product has another level, spacecraft or layout (AWS buckets) or several tiles, a band is not available
        at the resolution, a file is missing or not a raster, or the metadata are inconsistent: keys repeated with
        different values; a scale that leaves -0.25 to 10 or does not reach a reflectance of 1; a sun that is 2 degrees
        away from its position at that time and place; a date before the launch or in the future.

    Notes
    -----
    To keep clear land in Level-2A, use ``scene.where(scene.quality.isin([4, 5]))``. To remove clouds in Level-1C, use
    ``scene.where(scene.quality & 0b11 == 0)``.

    References
    ----------
    ESA, Sentinel-2 products specification document, S2-PDGS-TAS-DI-PSD

    See Also
    --------
    fifesim.sensor.response.calibration.product_reflectance

    Examples
    --------
    >>> import fifesim
    >>> product = "S2A_MSIL2A_20220603T171901_N0510_R012_T14SPJ_20240622T102300.SAFE"
    >>> scene = fifesim.open_sentinel2(product, 10)  # doctest: +SKIP
    >>> scene.fifesim.as_seen_by("TM", time="1987-06-06T16:35Z")  # doctest: +SKIP
    """
    file = sentinel2_metadata_file(path)
    product, folder, sizes = sentinel2_product(file), file.parent, labels.layer_chunk_sizes(chunks)
    if angles not in ("centre", "pixel"):
        raise ValueError(f"angles must be 'centre' or 'pixel', got {angles!r}")
    if product.instrument is None and instrument is None:
        raise ValueError(
            f"the product is of {product.spacecraft}, whose responses fifesim does not have: give instrument='MSI-C', "
            "which uses the responses of Sentinel-2A, 'MSI', 'MSI-B' or an instrument file"
        )
    description = find_instrument(product.instrument if instrument is None else instrument)
    if resolution is None:
        resolution = 20 if product.level == 2 and 20 in product.bands else 10
    selected = _selected(product, description, resolution, bands)
    if instrument is None:
        check_irradiance(product.product, selected, description)
    if not (folder / product.tile).is_file():
        raise ValueError(f"{product.tile} is missing in the product: is it unpacked whole?")
    tile = sentinel2_tile(folder / product.tile, product.spacecraft)
    layers = [
        open_layer(folder, band.file, sizes, "is the product unpacked whole? Or leave it out by bands=")
        for band in selected
    ]
    geometry = _geometry(product, tile, selected, angles, layers[0], sizes)
    return labels.as_image(
        labels.reflectance(layers, selected),
        selected,
        description,
        level=product.level,
        time=tile.time,
        geometry=geometry,
        quality=_quality(product, folder, sizes, resolution, layers[0]) if quality else None,
        history=f"open_sentinel2: {product.product}, baseline {product.baseline}",
        reference=f"ESA, {product.product}",
    )


def _selected(product, description, resolution, names):
    """Requested bands, by default all of the pixel size except cirrus."""
    if resolution not in _SIZES:
        raise ValueError(f"resolution must be 10, 20 or 60 m, got {resolution!r}")
    known = {band.name: band for band in product.bands.get(resolution, ())}
    if names is None:
        found = [band for band in known.values() if band.name != CIRRUS]
        if not found:
            raise ValueError(f"{product.product} has no band of {resolution} m")
        return found
    names = [names] if isinstance(names, str) else [str(name) for name in names]
    requested = [band.name for band in description.select(names)]
    for name in requested:
        if name not in known:
            sizes = [f"{size} m" for size, bands in product.bands.items() if name in {band.name for band in bands}]
            raise ValueError(
                f"{product.product} has no {name} of {resolution} m"
                + (f": it has it at {' and '.join(sizes)}, give resolution=" if sizes else "")
            )
    return [known[name] for name in requested]


def _geometry(product, tile, bands, angles, beside, sizes):
    numbers = [product.numbers[band.name] for band in bands]
    if angles == "centre":
        views = [tile.views[number] for number in numbers if number in tile.views]
        if not views:
            raise ValueError("the metadata have no mean view of these bands: give angles='pixel'")
        vza, vaa = map(float, calibration.direction_angles(calibration.mean_direction(*np.transpose(views))))
        return Geometry(tile.sza, tile.saa, vza, vaa, product.earth_sun_distance)
    grids_of_view = [tile.view_grids[number] for number in numbers if number in tile.view_grids]
    if not grids_of_view:
        raise ValueError("the metadata have no grids of the view of these bands: give angles='centre'")
    every = np.concatenate(grids_of_view)
    nodes = {
        "s": calibration.filled(calibration.direction_vectors(*tile.sun)),
        "v": calibration.filled(calibration.mean_direction(every[:, 0], every[:, 1])),
    }
    Geometry(tile.sza, tile.saa, 0.0, 0.0, product.earth_sun_distance)
    by_pixel = {
        f"{which}{angle}a": _between(vectors, number, tile, beside, sizes)
        for which, vectors in nodes.items()
        for number, angle in enumerate("za")
    }
    return directions.checked_geometry(xr.Dataset(by_pixel | {"earth_sun_distance": product.earth_sun_distance}))


def _between(vectors, number, tile, beside, sizes):
    """An angle at the pixels, interpolated from the nodes of a grid."""
    grid = grids.geobox(beside)
    kernel = partial(_angle_of_cells, vectors, number, tile.corner, tile.step, tuple(grid.affine)[:6])
    parts = dict(zip(("y", "x"), beside.chunks or (CHUNK, CHUNK), strict=True))
    angles = windows.tiles(kernel, grid, parts, tile=CHUNK)
    # By parts even in memory: vectors of the whole tile would take three times its memory.
    return angles.compute() if sizes is None else angles


def _angle_of_cells(vectors, number, corner, step, affine, row, column, shape):
    across, _, west, _, down, north = affine
    rows = (corner[1] - (north + down * (row + np.arange(shape[0]) + 0.5))) / step
    columns = (west + across * (column + np.arange(shape[1]) + 0.5) - corner[0]) / step
    return calibration.between_nodes(vectors, rows, columns)[number]


def _quality(product, folder, sizes, resolution, beside):
    """Scene classification, or cloud masks, on the grid of the image, by the pixel that contains each pixel."""
    cure = "fetch it, or open the product without it, quality=False"
    if product.level == 1:
        if product.clouds is None:
            return None
        own, attrs = 60, _CLOUDS
        masks = open_layer(folder, product.clouds, sizes, cure, count=3)
        layer = grids.place(chunks_of.pointwise(calibration.mask_bits, *masks, dtype=np.uint8), grids.geobox(masks))
    else:
        own, attrs = resolution if resolution in product.classes else 20, _CLASSES
        if own not in product.classes:
            raise ValueError(f"{product.product} names no scene classification: open it without, quality=False")
        layer = open_layer(folder, product.classes[own], sizes, cure)
    layer = _repeated(layer, own // resolution, resolution)
    labels.check_same_grid(layer, beside)
    if beside.chunks is not None:
        layer = layer.chunk(dict(zip(("y", "x"), beside.chunks, strict=True)))
    return layer.drop_attrs().assign_attrs(attrs)


def _repeated(layer, times, resolution):
    if times == 1:
        return layer
    repeat = da.repeat if isinstance(layer.data, da.Array) else np.repeat
    data = repeat(repeat(layer.data, times, axis=0), times, axis=1)
    fine = grids.aligned_grid(grids.geobox(layer), resolution)
    return grids.place(xr.DataArray(data, dims=("y", "x"), name=layer.name), fine)
