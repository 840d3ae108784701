"""Sentinel-2 products as their metadata describe them (``MTD_MSIL1C.xml`` or ``MTD_MSIL2A.xml``)."""

import re
from dataclasses import dataclass
from pathlib import PurePosixPath

from fifesim.base.foreign import shown
from fifesim.base.metadata import naming, read_xml
from fifesim.sensor.products.metadata_checks import CURE, check_scale
from fifesim.sensor.products.scaling import ProductBand
from fifesim.sensor.products.sentinel2_files import by_band, number_of, text_of, unique

_INSTRUMENTS = {"Sentinel-2A": "MSI", "Sentinel-2B": "MSI-B"}

# By level: quantification value, list of offsets, and its key for the number of a band.
_SCALES = {1: ("QUANTIFICATION_VALUE", "RADIO_ADD_OFFSET"), 2: ("BOA_QUANTIFICATION_VALUE", "BOA_ADD_OFFSET")}

# The first processing baseline with offsets, and with masks that are rasters. Before, they were polygons.
_WITH_OFFSETS = 4.0

# The cirrus band shows no ground.
_CIRRUS = "MSI10"

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
    aside : tuple of str
        Names of those that are opened only when they are named.
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
    aside: tuple[str, ...]
    classes: dict[int, str]
    clouds: str | None
    tile: str
    earth_sun_distance: float


def sentinel2_product(path):
    """
    A product from its metadata.

    Parameters
    ----------
    path : str or path
        From `metadata_file`.

    Returns
    -------
    product : Sentinel2Product

    Raises
    ------
    ValueError
        If it is of another level, holds not one tile, or something is missing, repeated or has a wrong value; the
        message begins with the name of the file.
    """
    root = read_xml(path)
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
        aside=(_CIRRUS,),
        classes=_classes(files),
        clouds=str(granule / "QI_DATA" / "MSK_CLASSI_B00.jp2") if with_masks else None,
        tile=str(granule / "MTD_TL.xml"),
        earth_sun_distance=_distance(root),
    )


def band_name(name):
    """
    Name of a band among those of the instrument.

    Parameters
    ----------
    name : str
        Such as ``"MSI4"``, or ESA's ``"B4"`` or ``"B04"``.

    Returns
    -------
    name : str

    Examples
    --------
    >>> band_name("B04"), band_name("B8A"), band_name("MSI12")
    ('MSI4', 'MSI8A', 'MSI12')
    """
    found = re.fullmatch(r"B0?(\d{1,2}A?)", str(name), re.IGNORECASE)
    return f"MSI{found[1].upper()}" if found else name


def _spectral(root):
    """Numbers of bands in the metadata, and sizes of their pixels, by name."""
    numbers, sizes = {}, {}
    for each in root.findall(".//Spectral_Information_List/Spectral_Information"):
        name = band_name(each.get("physicalBand"))
        numbers[name], sizes[name] = each.get("bandId"), int(number_of(each, "RESOLUTION"))
    return numbers, sizes


def _bands(root, level, files, numbers, sizes):
    """Bands by the size of their pixels."""
    quantification, key = _SCALES[level]
    offsets = by_band(root, key, "band_id")
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
    irradiance = by_band(root, "SOLAR_IRRADIANCE", "bandId")
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
        check_scale(keys, 1 / counts, offset / counts, (1, largest - 1), brightest=_BRIGHTEST)
        band = ProductBand(name, f"{file}.jp2", 1 / counts, offset / counts, largest, irradiance.get(number))
        found.setdefault(size, {})[name] = band
    return {size: tuple(by_name[name] for name in numbers if name in by_name) for size, by_name in found.items()}


def _classes(files):
    """Files of the scene classification by the size of their pixels."""
    found = [(re.search(r"_SCL_(\d\d)m$", file), file) for file in files]
    return {int(match[1]): f"{file}.jp2" for match, file in found if match}


def _local(text):
    """A path below the product's folder."""
    name = (text or "").strip()
    if not re.fullmatch(r"GRANULE(/\w[\w.\-]*){2,}", name):
        raise ValueError(f"IMAGE_FILE must lie in the product's GRANULE folder, got {shown(name)}")
    return name


def _distance(root):
    """Earth-Sun distance of the product's conversion from reflectance to radiance [astronomical unit]."""
    inverse_square = number_of(root, ".//Reflectance_Conversion/U")
    if not inverse_square > 0:
        raise ValueError(f"U must be above 0, got {inverse_square:g}")
    if not _INVERSE_SQUARES[0] <= inverse_square <= _INVERSE_SQUARES[1]:
        raise ValueError(
            f"U is the inverse square of the Earth-Sun distance and must be in [{_INVERSE_SQUARES[0]:g}, "
            f"{_INVERSE_SQUARES[1]:g}], got {inverse_square:g}: {CURE}"
        )
    return inverse_square**-0.5
