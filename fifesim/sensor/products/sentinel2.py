"""Sentinel-2 products and tiles as their metadata files describe them."""

import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
import pyproj

from fifesim.base.files import in_a_line, shown
from fifesim.base.geometry import angle_between
from fifesim.sensor.products import metadata
from fifesim.sensor.products.metadata import (
    REFETCH,
    check_product_scale,
    check_sun,
    naming,
    stated_number,
    unique,
    utc_time,
)
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


_INSTRUMENTS = {"Sentinel-2A": "MSI", "Sentinel-2B": "MSI-B"}

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
    """
    A Sentinel-2 product of one tile: its files, their scale and its spacecraft.

    Parameters
    ----------
    product, spacecraft, baseline : str
    level : int
        1 for Level-1C, 2 for Level-2A.
    instrument : str or None
        None for a spacecraft that fifesim has no instrument of.
    bands : dict of int to tuple of ProductBand
        By the size of their pixels, 10, 20 and 60. [m]
    numbers : dict of str to str
        Numbers of bands in the metadata, by name.
    classes : dict of int to str
        Files of the scene classification, by the size of their pixels. [m]
    clouds : str or None
        File of Level-1C's masks of clouds and snow, of 60 m, where it is a raster.
    tile : str
        File of the metadata of the tile.
    earth_sun_distance : float
        [astronomical unit]
    """

    product: str
    spacecraft: str
    baseline: str
    level: int
    instrument: str | None
    bands: dict[int, tuple[ProductBand, ...]]
    numbers: dict[str, str]
    classes: dict[int, str]
    clouds: str | None
    tile: str
    earth_sun_distance: float


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
        instrument=_INSTRUMENTS.get(spacecraft),
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
        check_product_scale(keys, 1 / counts, offset / counts, (1, largest - 1), brightest=_BRIGHTEST)
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
    if not inverse_square > 0:
        raise ValueError(f"U must be above 0, got {inverse_square:g}")
    if not _INVERSE_SQUARES[0] <= inverse_square <= _INVERSE_SQUARES[1]:
        raise ValueError(
            f"U is the inverse square of the Earth-Sun distance and must be in [{_INVERSE_SQUARES[0]:g}, "
            f"{_INVERSE_SQUARES[1]:g}], got {inverse_square:g}: {REFETCH}"
        )
    return inverse_square**-0.5


# Dates of launch. ESA, Sentinel-2 mission. No Sentinel-2 image is older than the first.
_LAUNCHED = {"Sentinel-2A": "2015-06-23", "Sentinel-2B": "2017-03-07"}

# Edge of a tile [m].
_TILE = 109_800.0

# Largest angle between the mean sun of a tile and the mean of its grid. Products agree within 0.05. [degree]
_SUN = 1.0


@dataclass(frozen=True)
class Sentinel2Tile:
    """
    Time and directions of a tile.

    Parameters
    ----------
    time : numpy.datetime64
        UTC.
    sza, saa : float
        Means over the tile. [degree]
    views : dict of str to (float, float)
        Mean zenith and azimuth of the view, by number of band. [degree]
    corner : (float, float)
        Easting and northing of the first node of the grids of angles. [m]
    step : float
        Between their nodes. [m]
    sun : array, shape (2, n, m)
        Zenith and azimuth. [degree]
    view_grids : dict of str to array, shape (detector, 2, n, m)
        The same by number of band, NaN where a detector does not see. [degree]
    """

    time: np.datetime64
    sza: float
    saa: float
    views: dict[str, tuple[float, float]]
    corner: tuple[float, float]
    step: float
    sun: np.ndarray
    view_grids: dict[str, np.ndarray]


def sentinel2_tile(path, spacecraft="Sentinel-2A"):
    """Tile from its metadata."""
    root = metadata.read_xml(path)
    with naming(path):
        return _tile(root, _LAUNCHED.get(spacecraft, min(_LAUNCHED.values())))


def _tile(root, launch):
    views = {
        each.get("bandId"): (number_of(each, "ZENITH_ANGLE"), number_of(each, "AZIMUTH_ANGLE") % 360.0)
        for each in root.findall(".//Mean_Viewing_Incidence_Angle_List/Mean_Viewing_Incidence_Angle")
        if text_of(each, "ZENITH_ANGLE") != "NaN"
    }
    grids = {}
    for each in root.findall(".//Viewing_Incidence_Angles_Grids"):
        grids.setdefault(each.get("bandId"), []).append(_grid(each))
    time = utc_time(text_of(root, ".//SENSING_TIME"), "SENSING_TIME", launch)
    corner = number_of(root, ".//Geoposition/ULX"), number_of(root, ".//Geoposition/ULY")
    sun = _grid(part_of(root, ".//Sun_Angles_Grid"))
    sza, saa = _mean_sun(root, sun)
    check_sun(f"Mean_Sun_Angle of zenith {sza:g} and azimuth {saa:g}", sza, saa, time, _centre(root, corner))
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
