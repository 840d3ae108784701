"""What the metadata of a Landsat Collection-2 product say (its file ``*_MTL``, as text, JSON or XML)."""

import json
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fifesim.base.foreign import in_a_line, shown
from fifesim.base.metadata import read_metadata, read_xml, utc_time
from fifesim.sensor.products.scaling import ProductBand

_ROOT = "LANDSAT_METADATA_FILE"

# Instrument, first letters of its bands' names, and numbers of the bands that send no reflected light, by spacecraft
# and sensor. SENSOR_ID is OLI_TIRS, or OLI where the thermal instrument was off.
_INSTRUMENTS = {
    ("LANDSAT_4", "TM"): ("L4TM", "TM", ("6",)),
    ("LANDSAT_5", "TM"): ("TM", "TM", ("6",)),
    ("LANDSAT_7", "ETM"): ("ETM+", "ETM", ("6", "6_VCID_1", "6_VCID_2")),
    ("LANDSAT_8", "OLI"): ("OLI", "OLI", ("10", "11")),
    ("LANDSAT_9", "OLI"): ("OLI2", "OLI", ("10", "11")),
}

# Neither shows the ground on the 30 m grid: panchromatic, and the cirrus band of OLI.
_ASIDE = ("8", "9")
_LAST_BAND = 11  # of Landsat 8 and 9

# Groups of the metadata with the scale of each level.
_SCALES = {1: "LEVEL1_RADIOMETRIC_RESCALING", 2: "LEVEL2_SURFACE_REFLECTANCE_PARAMETERS"}
_COUNTS = {1: "LEVEL1_MIN_MAX_PIXEL_VALUE", 2: "LEVEL2_SURFACE_REFLECTANCE_PARAMETERS"}

_ANGLE_FILES = {
    "sza": "FILE_NAME_ANGLE_SOLAR_ZENITH_BAND_4",
    "saa": "FILE_NAME_ANGLE_SOLAR_AZIMUTH_BAND_4",
    "vza": "FILE_NAME_ANGLE_SENSOR_ZENITH_BAND_4",
    "vaa": "FILE_NAME_ANGLE_SENSOR_AZIMUTH_BAND_4",
}


@dataclass(frozen=True)
class LandsatScene:
    """
    A Landsat product: its files, their scale, sun and time.

    Parameters
    ----------
    product, reference : str
        Identifier, and how to cite it.
    level : int
        1 or 2.
    instrument : str
    bands : tuple of ProductBand
        Of reflected light, all of them.
    aside : tuple of str
        Names of those that are opened only when they are named.
    thermal : tuple of str
        Names of bands that are not among them.
    time : numpy.datetime64
        Of the scene's centre, UTC.
    sza, saa : float
        Of the sun over the scene's centre. [degree]
    earth_sun_distance : float
        [astronomical unit]
    off_nadir : bool
        Whether the spacecraft was turned aside.
    quality, saturation : str
        Files of the quality of pixels, and of the bands that are saturated in each.
    angles : dict of str
        Files of the angles by pixel.
    """

    product: str
    reference: str
    level: int
    instrument: str
    bands: tuple[ProductBand, ...]
    aside: tuple[str, ...]
    thermal: tuple[str, ...]
    time: np.datetime64
    sza: float
    saa: float
    earth_sun_distance: float
    off_nadir: bool
    quality: str
    saturation: str
    angles: dict[str, str]


def metadata_file(path):
    """
    File of a product's metadata.

    Parameters
    ----------
    path : str or path
        Of the file, or of the folder that it lies in.

    Returns
    -------
    file : pathlib.Path

    Raises
    ------
    ValueError
        If there is none, or there are those of several products.
    """
    path = Path(path)
    if not path.is_dir():
        if not path.exists():
            raise ValueError(f"there is no file or folder {in_a_line(path, 200)}")
        if not re.fullmatch(r".*_MTL\.(txt|json|xml)", path.name, re.IGNORECASE):
            raise ValueError(
                f"{in_a_line(path.name, 100)} is no metadata of a Landsat product: give its *_MTL.txt (.json, .xml), "
                "or the folder of the unpacked product"
            )
        return path
    found = {}
    for ending in ("xml", "json", "txt"):
        found |= {each.stem: each for each in sorted(path.iterdir()) if each.name.endswith(f"_MTL.{ending}")}
    if not found:
        raise ValueError(
            f"{in_a_line(path, 200)} has no *_MTL.txt, .json or .xml: give the folder of one Landsat Collection-2 "
            "product, unpacked"
        )
    if len(found) > 1:
        names = in_a_line(", ".join(each.name for each in found.values()), 200)
        raise ValueError(f"{in_a_line(path.name, 100)} holds {len(found)} products: give the file of one, {names}")
    return next(iter(found.values()))


def read_groups(path):
    """
    Values of a metadata file by group; some keys stand in several groups, with different values.

    Parameters
    ----------
    path : str or path
        Ends in ``.txt``, ``.json`` or ``.xml``.

    Returns
    -------
    groups : dict of str to dict of str
        All values as text.

    Raises
    ------
    ValueError
        If it is not of Collection 2, or cannot be read.
    """
    path = Path(path)
    readers = {".json": _json_groups, ".xml": _xml_groups}
    root, groups = readers.get(path.suffix.lower(), _text_groups)(path)
    name = in_a_line(path.name, 100)
    if root == "L1_METADATA_FILE":
        raise ValueError(f"{name} is of Collection 1 or older: take the scene's Collection-2 product, which USGS has")
    if root != _ROOT:
        raise ValueError(f"{name} is no metadata of a Landsat product: it begins with {shown(root)}, not {_ROOT}")
    collection = groups.get("PRODUCT_CONTENTS", {}).get("COLLECTION_NUMBER")
    if collection is None or collection.lstrip("0") != "2":
        raise ValueError(f"{name} is of collection {shown(collection)}: Collection 2 is read")
    return groups


def landsat_scene(groups):
    """
    A product from its metadata.

    Parameters
    ----------
    groups : dict of str to dict of str
        From `read_groups`.

    Returns
    -------
    scene : LandsatScene

    Raises
    ------
    ValueError
        If the spacecraft is none of Landsat 4 to 9 with TM, ETM+ or OLI, or a key is missing or has a wrong value.
    """
    contents, image = _group(groups, "PRODUCT_CONTENTS"), _group(groups, "IMAGE_ATTRIBUTES")
    spacecraft, sensor = _value(image, "SPACECRAFT_ID"), _value(image, "SENSOR_ID")
    known = _INSTRUMENTS.get((spacecraft, sensor.removesuffix("_TIRS")))
    if known is None:
        raise ValueError(
            f"the product is of {in_a_line(spacecraft, 40)} {in_a_line(sensor, 40)}: those of "
            f"{', '.join(f'{name} {instrument}' for name, instrument in _INSTRUMENTS)} are read"
        )
    instrument, letters, thermal = known
    processing = _value(contents, "PROCESSING_LEVEL")
    if processing[:2] not in ("L1", "L2"):
        raise ValueError(f"PROCESSING_LEVEL is {shown(processing)}: L1TP, L1GT, L1GS, L2SP and L2SR are read")
    level, distance = int(processing[1]), _number(image, "EARTH_SUN_DISTANCE")
    numbers = [key.removeprefix("FILE_NAME_BAND_") for key in contents if re.fullmatch(r"FILE_NAME_BAND_\d+", key)]
    numbers = [number for number in numbers if number not in thermal]
    files = groups.get("LEVEL1_PROCESSING_RECORD", {}) | contents
    return LandsatScene(
        product=_value(contents, "LANDSAT_PRODUCT_ID"),
        reference=f"USGS, {_value(contents, 'LANDSAT_PRODUCT_ID')}, {contents.get('DIGITAL_OBJECT_IDENTIFIER', '')}",
        level=level,
        instrument=instrument,
        bands=tuple(_band(groups, level, letters, number, distance) for number in numbers),
        aside=tuple(f"{letters}{number}" for number in _ASIDE),
        thermal=tuple(f"{letters}{number}" for number in thermal),
        time=_time(image),
        sza=90.0 - _number(image, "SUN_ELEVATION"),
        saa=_number(image, "SUN_AZIMUTH") % 360.0,
        earth_sun_distance=distance,
        off_nadir=image.get("NADIR_OFFNADIR", "NADIR") != "NADIR",
        quality=_file(files, "FILE_NAME_QUALITY_L1_PIXEL"),
        saturation=_file(files, "FILE_NAME_QUALITY_L1_RADIOMETRIC_SATURATION"),
        angles={name: _file(files, key) for name, key in _ANGLE_FILES.items() if key in files},
    )


def _band(groups, level, letters, number, distance):
    scales, counts = _group(groups, _SCALES[level]), _group(groups, _COUNTS[level])
    return ProductBand(
        name=f"{letters}{number}",
        file=_file(_group(groups, "PRODUCT_CONTENTS"), f"FILE_NAME_BAND_{number}"),
        gain=_number(scales, f"REFLECTANCE_MULT_BAND_{number}"),
        offset=_number(scales, f"REFLECTANCE_ADD_BAND_{number}"),
        largest=int(_number(counts, f"QUANTIZE_CAL_MAX_BAND_{number}")),
        solar_irradiance=_irradiance(groups, number, distance),
        flag=_flag(letters, number),
    )


def _flag(letters, number):
    """Bits of QA_RADSAT: 0 for band 1 up to 6 for band 7, 8 for OLI's band 9; 9 where TM and ETM+ have no value."""
    if number == "8" or int(number) not in range(1, _LAST_BAND + 1):
        return 0
    return 1 << (int(number) - 1) | (0 if letters == "OLI" else 1 << 9)


def _irradiance(groups, number, distance):
    """Solar irradiance behind both scales of Level 1: E = pi d^2 (Lmax - Lmin) / (rhomax - rhomin)."""
    radiance, reflectance = groups.get("LEVEL1_MIN_MAX_RADIANCE"), groups.get("LEVEL1_MIN_MAX_REFLECTANCE")
    if radiance is None or reflectance is None:
        return None
    spans = [
        _number(group, f"{name}_MAXIMUM_BAND_{number}") - _number(group, f"{name}_MINIMUM_BAND_{number}")
        for name, group in (("RADIANCE", radiance), ("REFLECTANCE", reflectance))
    ]
    if min(spans) <= 0:
        raise ValueError(f"band {number}: the smallest radiance and reflectance must lie below the largest")
    return np.pi * distance**2 * spans[0] / spans[1]


def _time(image):
    text = f"{_value(image, 'DATE_ACQUIRED')}T{_value(image, 'SCENE_CENTER_TIME')}"
    return utc_time(text, "DATE_ACQUIRED and SCENE_CENTER_TIME")


def _group(groups, name):
    if name not in groups:
        raise ValueError(f"the metadata have no group {name}: is the file whole?")
    return groups[name]


def _value(group, key):
    if key not in group:
        raise ValueError(f"the metadata have no {key}: is the file whole?")
    return group[key]


def _number(group, key):
    text = _value(group, key)
    try:
        number = float(text)
    except ValueError:
        number = np.nan
    if not np.isfinite(number):
        raise ValueError(f"{key} must be a number, got {shown(text)}")
    return number


def _file(group, key):
    """A file beside the metadata: names that lead elsewhere are none that USGS writes."""
    name = _value(group, key)
    if not re.fullmatch(r"\w[\w.\-]*", name):
        raise ValueError(f"{key} must be the name of a file beside the metadata, got {shown(name)}")
    return name


def _text_groups(path):
    root, groups, around = None, {}, []
    for line in read_metadata(path).splitlines():
        key, separator, value = (part.strip() for part in line.partition("="))
        if key == "GROUP":
            around.append(value)
            root = root or value
        elif key == "END_GROUP":
            around = around[:-1]
        elif separator and around:
            groups.setdefault(around[-1], {})[key] = value.strip('"')
    return root, groups


def _json_groups(path):
    try:
        content = json.loads(read_metadata(path))
    except (ValueError, RecursionError) as error:
        raise ValueError(in_a_line(f"{path.name} is not valid JSON: {error}")) from None
    root = next(iter(content), None) if isinstance(content, dict) else None
    groups = content[root] if root is not None else {}
    groups = (
        {name: group for name, group in groups.items() if isinstance(group, dict)} if isinstance(groups, dict) else {}
    )
    return root, {name: {key: str(value) for key, value in group.items()} for name, group in groups.items()}


def _xml_groups(path):
    root = read_xml(path)
    return root.tag, {group.tag: {each.tag: (each.text or "").strip() for each in group} for group in root}
