"""Sentinel-2 products as labelled images: metadata of products and tiles, bands, quality and angles."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Literal

import numpy as np
import pyproj
import xarray as xr

from fifesim.base.arguments import Chunks, FilePath, Names
from fifesim.base.files import in_a_line, shown
from fifesim.base.geometry import Geometry, angle_between
from fifesim.grids import chunks as chunks_of
from fifesim.grids import directions, windows
from fifesim.grids import grid as grids
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.products import labels, metadata
from fifesim.sensor.products.labels import CHUNK, open_layer
from fifesim.sensor.products.metadata import REFETCH, naming, stated_number, unique
from fifesim.sensor.response import calibration
from fifesim.sensor.response.calibration import ProductBand, direction_angles, mean_direction

# File names of the other form, in which Sentinel-2 lies in buckets of AWS.
_AWS = re.compile(r"((tile|product)Info\.json|((granule|product)_)?metadata\.xml|B\d[\dA]\.(jp2|tif))", re.IGNORECASE)


def sentinel2_metadata_file(path):
    """Metadata file of a product, from its path or folder."""
    path = Path(path)
    if path.is_dir():
        found = sorted(each for each in path.iterdir() if re.fullmatch(r"MTD_MSIL(1C|2A)\.xml", each.name))
        if len(found) == 1:
            return found[0]
        if not found and any(_AWS.fullmatch(each.name) for each in (*path.glob("*"), *path.glob("*/*"))):
            raise ValueError(_of_aws(path))
        old = any(re.match(r"S2._OPER_MTD_", each.name) for each in path.iterdir())
        raise ValueError(
            f"{in_a_line(path, 200)} has {'both' if found else 'no'} MTD_MSIL1C.xml {'and' if found else 'nor'} "
            "MTD_MSIL2A.xml: give the .SAFE folder of one product, unpacked"
            + ("; this one has the form of before December 2016, so take the reprocessed product" if old else "")
        )
    if not path.exists():
        raise ValueError(f"there is no file or folder {in_a_line(path, 200)}")
    if _AWS.fullmatch(path.name):
        raise ValueError(_of_aws(path))
    if path.suffix.lower() != ".xml":
        raise ValueError(f"{in_a_line(path.name, 100)} is no .SAFE folder nor its MTD_MSIL1C.xml: unpack the product")
    return path


def _of_aws(path):
    return (
        f"{in_a_line(path.name, 100)} has the layout of the AWS buckets (Sinergise, Element 84: metadata.xml, "
        "tileInfo.json, B04.jp2), not that of the product: fetch the product, which productInfo.json names, as .SAFE "
        "folder from the Copernicus Data Space (dataspace.copernicus.eu), unpack it, and give that folder"
    )


def numbers_by_band(root, key, attribute):
    """Numbers of a key that occurs once for each band."""
    return unique([(each.get(attribute), number_of(each, ".")) for each in root.iter(key)], f"{key} of")


def part_of(element, path):
    """First element of a path; several elements must have the same text."""
    parts = [element] if path == "." else element.findall(path)
    key = path.rpartition("/")[2]
    if not parts:
        raise ValueError(f"the metadata have no {key}: is the file whole?")
    texts = sorted({(each.text or "").strip() for each in parts})
    if len(texts) > 1:
        values = in_a_line(", ".join(texts), 100)
        raise ValueError(f"{key} stands {len(parts)} times with different values, {values}: {REFETCH}")
    return parts[0]


def text_of(element, path):
    """Text of an element."""
    return (part_of(element, path).text or "").strip()


def number_of(element, path):
    """Number in an element."""
    found = part_of(element, path)
    return stated_number(found.text, found.tag)


SENTINEL2_INSTRUMENTS = {"Sentinel-2A": "MSI", "Sentinel-2B": "MSI-B"}

# By level: quantification value, list of offsets, and its key for the number of a band.
_SCALES = {1: ("QUANTIFICATION_VALUE", "RADIO_ADD_OFFSET"), 2: ("BOA_QUANTIFICATION_VALUE", "BOA_ADD_OFFSET")}

# The first processing baseline with offsets, and with masks that are rasters. Before, they were polygons.
_WITH_OFFSETS = 4.0

# The cirrus band shows no ground.
CIRRUS = "MSI10"

# Range of the inverse square of the Earth-Sun distance over the year, with a margin of 1 %.
_INVERSE_SQUARES = 0.956, 1.045

# Reflectance that digital numbers must reach: clouds and snow are brighter than 1.
_BRIGHTEST = 1.0


@dataclass(frozen=True)
class Sentinel2Product:
    """A Sentinel-2 product of one tile: its files, their scale and its spacecraft."""

    product: str
    spacecraft: str
    baseline: str
    level: int  # 1 for Level-1C, 2 for Level-2A
    instrument: str | None  # None for a spacecraft that fifesim has no instrument of
    bands: dict[int, tuple[ProductBand, ...]]  # by the size of their pixels, 10, 20 and 60 [m]
    numbers: dict[str, str]  # of bands in the metadata, by name
    classes: dict[int, str]  # files of the scene classification, by the size of their pixels [m]
    clouds: str | None  # file of the 60 m masks of clouds and snow of Level-1C, where it is a raster
    tile: str  # file of the metadata of the tile
    earth_sun_distance: float  # [astronomical unit]


def sentinel2_product(path):
    """Product from its metadata."""
    root = metadata.read_xml(path)
    with naming(path):
        return _product(root)


def _product(root):
    tag = root.tag.rpartition("}")[2]
    level = {"Level-1C_User_Product": 1, "Level-2A_User_Product": 2}.get(tag)
    if level is None:
        raise ValueError(
            f"it is {shown(tag)}: Level-1C and Level-2A products are read, so give their MTD_MSIL1C.xml or "
            "MTD_MSIL2A.xml, or the .SAFE folder"
        )
    granules = {each.get("granuleIdentifier"): each for each in root.findall(".//Granule_List/Granule")}
    if len(granules) != 1:
        raise ValueError(
            f"the product holds {len(granules)} granules: products of one tile are read, so give one tile's"
        )
    files = [_local(each.text) for granule in granules.values() for each in granule.findall("IMAGE_FILE")]
    if not files:
        raise ValueError(
            "the product names no IMAGE_FILE: Level-2A of before 2019 has another form, so take it as it was processed "
            "again (baseline 05.00)"
        )
    spacecraft = text_of(root, ".//SPACECRAFT_NAME")
    numbers, sizes = _spectral(root)
    classifications = [re.search(r"_SCL_(\d\d)m$", file) for file in files]
    granule = PurePosixPath(*PurePosixPath(files[0]).parts[:2])
    with_masks = level == 1 and number_of(root, ".//PROCESSING_BASELINE") >= _WITH_OFFSETS
    return Sentinel2Product(
        product=text_of(root, ".//PRODUCT_URI"),
        spacecraft=spacecraft,
        baseline=text_of(root, ".//PROCESSING_BASELINE"),
        level=level,
        instrument=SENTINEL2_INSTRUMENTS.get(spacecraft),
        bands=_bands(root, level, files, numbers, sizes),
        numbers=numbers,
        classes={int(match[1]): f"{match.string}.jp2" for match in classifications if match},
        clouds=str(granule / "QI_DATA" / "MSK_CLASSI_B00.jp2") if with_masks else None,
        tile=str(granule / "MTD_TL.xml"),
        earth_sun_distance=_distance(root),
    )


def band_name(name):
    """Name of a band of the instrument, from ``MSI4``, ``B4`` or ``B04``."""
    found = re.fullmatch(r"B0?(\d{1,2}A?)", str(name), re.IGNORECASE)
    return f"MSI{found[1].upper()}" if found else name


def _spectral(root):
    """Numbers of bands in the metadata, and their pixel sizes, by name."""
    numbers, sizes = {}, {}
    for each in root.findall(".//Spectral_Information_List/Spectral_Information"):
        name = band_name(each.get("physicalBand"))
        numbers[name], sizes[name] = each.get("bandId"), int(number_of(each, "RESOLUTION"))
    return numbers, sizes


def _bands(root, level, files, numbers, sizes):
    """Bands by pixel size."""
    quantification, key = _SCALES[level]
    offsets = numbers_by_band(root, key, "band_id")
    baseline, counts = number_of(root, ".//PROCESSING_BASELINE"), number_of(root, f".//{quantification}")
    if baseline >= _WITH_OFFSETS and not offsets:
        raise ValueError(f"processing baseline {baseline:05.2f} has offsets, and the metadata have no {key}")
    if not counts > 0:
        raise ValueError(f"{quantification} must be above 0, got {counts:g}")
    special = root.findall(".//Special_Values")
    pairs = [(text_of(each, "SPECIAL_VALUE_TEXT"), number_of(each, "SPECIAL_VALUE_INDEX")) for each in special]
    values = unique(pairs, "SPECIAL_VALUE_TEXT")
    if values.get("NODATA") != 0:
        raise ValueError(f"the digital number of no data is {values.get('NODATA')}: products that have 0 are read")
    irradiance = numbers_by_band(root, "SOLAR_IRRADIANCE", "bandId")
    largest = int(values.get("SATURATED", 65535))
    found = {}
    for file in files:
        match = re.search(r"_(B\w\w)(?:_(\d\d)m)?$", file)
        name = band_name(match[1]) if match else None
        if name not in numbers:
            continue
        number, size = numbers[name], int(match[2] or sizes[name])
        if offsets and number not in offsets:
            raise ValueError(f"the metadata have no {key} of {match[1]}")
        offset = offsets.get(number, 0.0)
        keys = f"{quantification} = {counts:g}, {key} = {offset:g} of {match[1]} and SATURATED = {largest}"
        metadata.check_product_scale(keys, 1 / counts, offset / counts, (1, largest - 1), brightest=_BRIGHTEST)
        band = ProductBand(name, f"{file}.jp2", 1 / counts, offset / counts, largest, irradiance.get(number))
        found.setdefault(size, {})[name] = band
    return {size: tuple(by_name[name] for name in numbers if name in by_name) for size, by_name in found.items()}


def _local(text):
    """Path below the folder of the product, which must be in GRANULE."""
    name = (text or "").strip()
    if not re.fullmatch(r"GRANULE(/\w[\w.\-]*){2,}", name):
        raise ValueError(f"IMAGE_FILE must lie in the product's GRANULE folder, got {shown(name)}")
    return name


def _distance(root):
    """Earth-Sun distance of the conversion from reflectance to radiance. [astronomical unit]"""
    inverse_square = number_of(root, ".//Reflectance_Conversion/U")
    if not _INVERSE_SQUARES[0] <= inverse_square <= _INVERSE_SQUARES[1]:
        raise ValueError(
            f"U is the inverse square of the Earth-Sun distance and must be in [{_INVERSE_SQUARES[0]:g}, "
            f"{_INVERSE_SQUARES[1]:g}], got {inverse_square:g}: {REFETCH}"
        )
    return inverse_square**-0.5


# Dates of launch. ESA, Sentinel-2 mission. No Sentinel-2 image is older than the first.
SENTINEL2_LAUNCHES = {"Sentinel-2A": "2015-06-23", "Sentinel-2B": "2017-03-07"}

# Edge of a tile [m].
_TILE = 109_800.0

# Largest angle between the mean sun of a tile and the mean of its grid. Products agree within 0.05. [degree]
_SUN = 1.0


@dataclass(frozen=True)
class Sentinel2Tile:
    """Time and directions of a tile. [degree]"""

    time: np.datetime64  # UTC
    sza: float  # mean over the tile
    saa: float
    views: dict[str, tuple[float, float]]  # mean zenith and azimuth of the view, by number of band
    corner: tuple[float, float]  # easting and northing of the first node of the grids of angles [m]
    step: float  # between their nodes [m]
    sun: np.ndarray  # zenith and azimuth, shape (2, n, m)
    view_grids: dict[str, np.ndarray]  # likewise by number of band, shape (detector, 2, n, m); NaN where unseen


def sentinel2_tile(path, spacecraft="Sentinel-2A"):
    """Tile from its metadata."""
    root = metadata.read_xml(path)
    with naming(path):
        return _tile(root, SENTINEL2_LAUNCHES.get(spacecraft, min(SENTINEL2_LAUNCHES.values())))


def _tile(root, launch):
    views = {
        each.get("bandId"): (number_of(each, "ZENITH_ANGLE"), number_of(each, "AZIMUTH_ANGLE") % 360.0)
        for each in root.findall(".//Mean_Viewing_Incidence_Angle_List/Mean_Viewing_Incidence_Angle")
        if text_of(each, "ZENITH_ANGLE") != "NaN"
    }
    grids = {}
    for each in root.findall(".//Viewing_Incidence_Angles_Grids"):
        grids.setdefault(each.get("bandId"), []).append(_grid(each))
    time = metadata.utc_time(text_of(root, ".//SENSING_TIME"), "SENSING_TIME", launch)
    corner = number_of(root, ".//Geoposition/ULX"), number_of(root, ".//Geoposition/ULY")
    sun = _grid(part_of(root, ".//Sun_Angles_Grid"))
    sza, saa = _mean_sun(root, sun)
    metadata.check_sun(f"Mean_Sun_Angle of zenith {sza:g} and azimuth {saa:g}", sza, saa, time, _centre(root, corner))
    return Sentinel2Tile(
        time=time,
        sza=sza,
        saa=saa,
        views=views,
        corner=corner,
        step=number_of(root, ".//Sun_Angles_Grid/Zenith/ROW_STEP"),
        sun=sun,
        view_grids={band: np.stack(detectors) for band, detectors in grids.items()},
    )


def _mean_sun(root, grid):
    """Mean solar zenith and azimuth angles of the tile: as stated, or the mean of the grid for NaN. [degree]"""
    of_grid = tuple(float(angle) for angle in direction_angles(mean_direction(*grid.reshape(2, -1))))
    keys = [f".//Mean_Sun_Angle/{name}_ANGLE" for name in ("ZENITH", "AZIMUTH")]
    # Tiles that reach across the antimeridian have NaN.
    if "NaN" in [text_of(root, key) for key in keys]:
        if not np.isfinite(of_grid).all():
            raise ValueError("Mean_Sun_Angle and Sun_Angles_Grid are NaN: nothing says where the sun stands")
        return of_grid
    stated = number_of(root, keys[0]), number_of(root, keys[1]) % 360.0
    if angle_between(*stated, *of_grid) > _SUN:
        raise ValueError(
            f"Mean_Sun_Angle of zenith {stated[0]:g} and azimuth {stated[1]:g} contradicts Sun_Angles_Grid, whose mean "
            f"is {of_grid[0]:.1f} and {of_grid[1]:.1f} degrees: {REFETCH}"
        )
    return stated


def _centre(root, corner):
    """Latitude and longitude of the middle of the tile. [degree]"""
    code = text_of(root, ".//HORIZONTAL_CS_CODE")
    if not re.fullmatch(r"EPSG:32[67](0[1-9]|[1-5]\d|60)", code):
        raise ValueError(f"HORIZONTAL_CS_CODE must be a UTM zone such as EPSG:32629, got {shown(code)}")
    to_degrees = pyproj.Transformer.from_crs(code, "EPSG:4326", always_xy=True)
    longitude, latitude = to_degrees.transform(corner[0] + _TILE / 2, corner[1] - _TILE / 2)
    return latitude, longitude


def _grid(element):
    """Zenith and azimuth at the nodes of a grid of angles."""
    angles = []
    for name in ("Zenith", "Azimuth"):
        rows = [(each.text or "").split() for each in element.findall(f"{name}/Values_List/VALUES")]
        try:
            angles.append(np.array(rows, float))
        except ValueError:
            raise ValueError(f"a grid of {name} is no table of numbers: are the metadata whole?") from None
    if angles[0].ndim != 2 or min(angles[0].shape) < 2 or angles[0].shape != angles[1].shape:
        raise ValueError("a grid of angles has not two rows and columns of zenith and azimuth: are the metadata whole?")
    return np.stack(angles)


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
    fifesim.open_landsat, fifesim.calibrate, fifesim.sensor.as_seen_by

    Examples
    --------
    >>> import fifesim
    >>> product = "S2A_MSIL2A_20220603T171901_N0510_R012_T14SPJ_20240622T102300.SAFE"
    >>> scene = fifesim.open_sentinel2(product, 10)  # doctest: +SKIP
    >>> scene.fifesim.as_seen_by("TM", time="1987-06-06T16:35Z")  # doctest: +SKIP
    """
    file = sentinel2_metadata_file(path)
    product, folder = sentinel2_product(file), file.parent
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
        metadata.check_irradiance(product.product, selected, description)
    if not (folder / product.tile).is_file():
        raise ValueError(f"{product.tile} is missing in the product: is it unpacked whole?")
    tile = sentinel2_tile(folder / product.tile, product.spacecraft)
    layers = [
        open_layer(folder, band.file, chunks, "is the product unpacked whole? Or leave it out by bands=")
        for band in selected
    ]
    geometry = _geometry(product, tile, selected, angles, layers[0], chunks)
    return labels.as_image(
        labels.reflectance(layers, selected),
        selected,
        description,
        level=product.level,
        time=tile.time,
        geometry=geometry,
        quality=_quality(product, folder, chunks, resolution, layers[0]) if quality else None,
        history=f"open_sentinel2: {product.product}, baseline {product.baseline}",
        reference=f"ESA, {product.product}",
    )


def _selected(product, description, resolution, names):
    """Requested bands, by default all of the pixel size except cirrus."""
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
        vza, vaa = map(float, direction_angles(mean_direction(*np.transpose(views))))
        return Geometry(tile.sza, tile.saa, vza, vaa, product.earth_sun_distance)
    grids_of_view = [tile.view_grids[number] for number in numbers if number in tile.view_grids]
    if not grids_of_view:
        raise ValueError("the metadata have no grids of the view of these bands: give angles='centre'")
    every = np.concatenate(grids_of_view)
    nodes = {
        "s": calibration.filled(calibration.direction_vectors(*tile.sun)),
        "v": calibration.filled(mean_direction(every[:, 0], every[:, 1])),
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
    # numpy calls dask's function on lazy data.
    data = np.repeat(np.repeat(layer.data, times, axis=0), times, axis=1)
    fine = grids.aligned_grid(grids.geobox(layer), resolution)
    return grids.place(xr.DataArray(data, dims=("y", "x"), name=layer.name), fine)
