"""What the metadata of a Sentinel-2 product say (``MTD_MSIL1C.xml`` or ``MTD_MSIL2A.xml``, and ``MTD_TL.xml``)."""

import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from fifesim.base.foreign import in_a_line, shown
from fifesim.base.metadata import read_xml, utc_time
from fifesim.sensor.products.scaling import ProductBand

_INSTRUMENTS = {"Sentinel-2A": "MSI", "Sentinel-2B": "MSI-B"}

# By level: quantification value, list of offsets, and its key for the number of a band.
_SCALES = {1: ("QUANTIFICATION_VALUE", "RADIO_ADD_OFFSET"), 2: ("BOA_QUANTIFICATION_VALUE", "BOA_ADD_OFFSET")}

# The first processing baseline with offsets, and with masks that are rasters. Before, they were polygons.
_WITH_OFFSETS = 4.0

# Shows no ground.
_CIRRUS = "MSI10"


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


def metadata_file(path):
    """
    File of a product's metadata.

    Parameters
    ----------
    path : str or path
        Of the file, or of the folder ``.SAFE`` that it lies in.

    Returns
    -------
    file : pathlib.Path

    Raises
    ------
    ValueError
        If there is none.
    """
    path = Path(path)
    if path.is_dir():
        found = sorted(each for each in path.iterdir() if re.fullmatch(r"MTD_MSIL(1C|2A)\.xml", each.name))
        if len(found) == 1:
            return found[0]
        raise ValueError(
            f"{in_a_line(path, 200)} has {'both' if found else 'no'} MTD_MSIL1C.xml {'and' if found else 'nor'} "
            "MTD_MSIL2A.xml: give the .SAFE folder of one product, unpacked; those before December 2016 are not read"
        )
    if not path.exists():
        raise ValueError(f"there is no file or folder {in_a_line(path, 200)}")
    if path.suffix.lower() != ".xml":
        raise ValueError(f"{in_a_line(path.name, 100)} is no .SAFE folder nor its MTD_MSIL1C.xml: unpack the product")
    return path


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
        If it is of another level, holds not one tile, or something is missing or has a wrong value.
    """
    root = read_xml(path)
    tag = root.tag.rpartition("}")[2]
    level = {"Level-1C_User_Product": 1, "Level-2A_User_Product": 2}.get(tag)
    if level is None:
        raise ValueError(f"{in_a_line(Path(path).name, 100)} is {shown(tag)}: Level-1C and Level-2A products are read")
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
    spacecraft = _text(root, ".//SPACECRAFT_NAME")
    numbers, sizes = _spectral(root)
    granule = PurePosixPath(*PurePosixPath(files[0]).parts[:2])
    with_masks = level == 1 and _number(root, ".//PROCESSING_BASELINE") >= _WITH_OFFSETS
    return Sentinel2Product(
        product=_text(root, ".//PRODUCT_URI"),
        spacecraft=spacecraft,
        baseline=_text(root, ".//PROCESSING_BASELINE"),
        level=level,
        instrument=_INSTRUMENTS.get(spacecraft),
        bands=_bands(root, level, files, numbers, sizes),
        numbers=numbers,
        aside=(_CIRRUS,),
        classes=_classes(files),
        clouds=str(granule / "QI_DATA" / "MSK_CLASSI_B00.jp2") if with_masks else None,
        tile=str(granule / "MTD_TL.xml"),
        earth_sun_distance=_positive(root, ".//Reflectance_Conversion/U") ** -0.5,
    )


def sentinel2_tile(path):
    """
    A tile from its metadata.

    Parameters
    ----------
    path : str or path
        Of ``MTD_TL.xml``.

    Returns
    -------
    tile : Sentinel2Tile

    Raises
    ------
    ValueError
        If something is missing or has a wrong value.
    """
    root = read_xml(path)
    views = {
        each.get("bandId"): (_number(each, "ZENITH_ANGLE"), _number(each, "AZIMUTH_ANGLE") % 360.0)
        for each in root.findall(".//Mean_Viewing_Incidence_Angle_List/Mean_Viewing_Incidence_Angle")
        if _text(each, "ZENITH_ANGLE") != "NaN"
    }
    grids = {}
    for each in root.findall(".//Viewing_Incidence_Angles_Grids"):
        grids.setdefault(each.get("bandId"), []).append(_grid(each))
    return Sentinel2Tile(
        time=utc_time(_text(root, ".//SENSING_TIME"), "SENSING_TIME"),
        sza=_number(root, ".//Mean_Sun_Angle/ZENITH_ANGLE"),
        saa=_number(root, ".//Mean_Sun_Angle/AZIMUTH_ANGLE") % 360.0,
        views=views,
        corner=(_number(root, ".//Geoposition/ULX"), _number(root, ".//Geoposition/ULY")),
        step=_number(root, ".//Sun_Angles_Grid/Zenith/ROW_STEP"),
        sun=_grid(_part(root, ".//Sun_Angles_Grid")),
        view_grids={number: np.stack(detectors) for number, detectors in grids.items()},
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
        numbers[name], sizes[name] = each.get("bandId"), int(_number(each, "RESOLUTION"))
    return numbers, sizes


def _bands(root, level, files, numbers, sizes):
    """Bands by the size of their pixels."""
    quantification, key = _SCALES[level]
    offsets = {each.get("band_id"): _number(each, ".") for each in root.iter(key)}
    baseline, counts = _number(root, ".//PROCESSING_BASELINE"), _number(root, f".//{quantification}")
    if baseline >= _WITH_OFFSETS and not offsets:
        raise ValueError(f"processing baseline {baseline:05.2f} has offsets, and the metadata have no {key}")
    if not counts > 0:
        raise ValueError(f"{quantification} must be above 0, got {counts:g}")
    special = root.findall(".//Special_Values")
    values = {_text(each, "SPECIAL_VALUE_TEXT"): _number(each, "SPECIAL_VALUE_INDEX") for each in special}
    if values.get("NODATA") != 0:
        raise ValueError(f"the digital number of no data is {values.get('NODATA')}: products that have 0 are read")
    irradiance = {each.get("bandId"): _number(each, ".") for each in root.iter("SOLAR_IRRADIANCE")}
    found = {}
    for file in files:
        match = re.search(r"_(B\w\w)(?:_(\d\d)m)?$", file)
        name = band_name(match[1]) if match else None
        if name not in numbers:
            continue
        number, size = numbers[name], int(match[2] or sizes[name])
        if offsets and number not in offsets:
            raise ValueError(f"the metadata have no {key} of {match[1]}")
        scale = {"gain": 1 / counts, "offset": offsets.get(number, 0.0) / counts}
        sun, largest = irradiance.get(number), int(values.get("SATURATED", 65535))
        band = ProductBand(name, f"{file}.jp2", **scale, largest=largest, solar_irradiance=sun)
        found.setdefault(size, {})[name] = band
    return {size: tuple(by_name[name] for name in numbers if name in by_name) for size, by_name in found.items()}


def _classes(files):
    """Files of the scene classification by the size of their pixels."""
    found = [(re.search(r"_SCL_(\d\d)m$", file), file) for file in files]
    return {int(match[1]): f"{file}.jp2" for match, file in found if match}


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


def _local(text):
    """A path below the product's folder."""
    name = (text or "").strip()
    if not re.fullmatch(r"GRANULE(/\w[\w.\-]*){2,}", name):
        raise ValueError(f"IMAGE_FILE must lie in the product's GRANULE folder, got {shown(name)}")
    return name


def _part(element, path):
    found = element if path == "." else element.find(path)
    if found is None:
        raise ValueError(f"the metadata have no {path.rpartition('/')[2]}: is the file whole?")
    return found


def _text(element, path):
    return (_part(element, path).text or "").strip()


def _positive(element, path):
    number = _number(element, path)
    if not number > 0:
        raise ValueError(f"{path.rpartition('/')[2]} must be above 0, got {number:g}")
    return number


def _number(element, path):
    found = _part(element, path)
    try:
        number = float(found.text)
    except (TypeError, ValueError):
        number = np.nan
    if not np.isfinite(number):
        raise ValueError(f"{found.tag} must be a number, got {shown((found.text or '').strip())}")
    return number
