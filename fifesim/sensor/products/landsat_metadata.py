"""Landsat Collection-2 scenes as their metadata describe them."""

import re
from dataclasses import dataclass

import numpy as np

from fifesim.base.foreign import in_a_line, shown
from fifesim.base.metadata import naming, utc_time
from fifesim.sensor.products.landsat_files import metadata_file, read_groups
from fifesim.sensor.products.landsat_view import ROWS, view_of_roll
from fifesim.sensor.products.metadata_checks import CURE, check_distance, check_radiance, check_scale, check_sun
from fifesim.sensor.products.scaling import ProductBand, direction_angles, mean_direction

# Instrument, first letters of its bands' names, and numbers of its thermal bands, by spacecraft and sensor. SENSOR_ID
# is OLI_TIRS, or OLI where the thermal instrument was off.
_INSTRUMENTS = {
    ("LANDSAT_1", "MSS"): ("MSS", "MSS", ()),
    ("LANDSAT_2", "MSS"): ("MSS2", "MSS", ()),
    ("LANDSAT_3", "MSS"): ("MSS3", "MSS", ("8",)),
    ("LANDSAT_4", "MSS"): ("MSS4", "MSS", ()),
    ("LANDSAT_5", "MSS"): ("MSS5", "MSS", ()),
    ("LANDSAT_4", "TM"): ("L4TM", "TM", ("6",)),
    ("LANDSAT_5", "TM"): ("TM", "TM", ("6",)),
    ("LANDSAT_7", "ETM"): ("ETM+", "ETM", ("6", "6_VCID_1", "6_VCID_2")),
    ("LANDSAT_8", "OLI"): ("OLI", "OLI", ("10", "11")),
    ("LANDSAT_9", "OLI"): ("OLI2", "OLI", ("10", "11")),
}

# Dates of launch. USGS, Landsat satellite missions.
_LAUNCHED = {
    "LANDSAT_1": "1972-07-23",
    "LANDSAT_2": "1975-01-22",
    "LANDSAT_3": "1978-03-05",
    "LANDSAT_4": "1982-07-16",
    "LANDSAT_5": "1984-03-01",
    "LANDSAT_7": "1999-04-15",
    "LANDSAT_8": "2013-02-11",
    "LANDSAT_9": "2021-09-27",
}

# The panchromatic band, and OLI's cirrus band: neither shows the ground on the 30 m grid.
_ASIDE = ("8", "9")
_LAST_BAND = 11  # Landsat 8 and 9

# Group with the scale, and group with the range of digital numbers and of reflectance, by level.
_SCALES = {1: "LEVEL1_RADIOMETRIC_RESCALING", 2: "LEVEL2_SURFACE_REFLECTANCE_PARAMETERS"}
_COUNTS = {1: "LEVEL1_MIN_MAX_PIXEL_VALUE", 2: "LEVEL2_SURFACE_REFLECTANCE_PARAMETERS"}
_RANGES = {1: "LEVEL1_MIN_MAX_REFLECTANCE", 2: "LEVEL2_SURFACE_REFLECTANCE_PARAMETERS"}

_ANGLE_FILES = {
    "sza": "FILE_NAME_ANGLE_SOLAR_ZENITH_BAND_4",
    "saa": "FILE_NAME_ANGLE_SOLAR_AZIMUTH_BAND_4",
    "vza": "FILE_NAME_ANGLE_SENSOR_ZENITH_BAND_4",
    "vaa": "FILE_NAME_ANGLE_SENSOR_AZIMUTH_BAND_4",
}


@dataclass(frozen=True)
class LandsatScene:
    """
    A Landsat scene: its files, their scale, sun and time.

    Parameters
    ----------
    product, reference : str
        Identifier and citation of the product.
    level : int
        1 or 2.
    instrument : str
    bands : tuple of ProductBand
        All bands of reflected light.
    aside : tuple of str
        Names of bands that are opened only on request.
    thermal : tuple of str
        Names of thermal bands, which are not among `bands`.
    time : numpy.datetime64
        Time of the scene centre, UTC.
    sza, saa : float
        Solar zenith and azimuth angles at the scene centre. [degree]
    earth_sun_distance : float
        [astronomical unit]
    view : (float, float) or None
        View zenith and azimuth angles at the scene centre; None where the spacecraft rolled and the metadata do not
        state by how much. [degree]
    quality, saturation : str
        File names of the quality of pixels, and of the saturation of bands.
    angles : dict of str
        File names of the angles by pixel.
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
    view: tuple[float, float] | None
    quality: str
    saturation: str
    angles: dict[str, str]


def read_scene(path):
    """
    Read a product's metadata.

    Parameters
    ----------
    path : str or path
        Metadata file, or its folder.

    Returns
    -------
    scene : LandsatScene
    folder : pathlib.Path
        Folder of its files.

    Raises
    ------
    ValueError
        As in `metadata_file`, `read_groups` and `landsat_scene`; the message begins with the name of the file.
    """
    file = metadata_file(path)
    groups = read_groups(file)
    with naming(file):
        return landsat_scene(groups), file.parent


def landsat_scene(groups):
    """
    Describe a scene by its metadata.

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
        If the instrument is not MSS, TM, ETM+ or OLI of Landsat 1 to 9, a key is missing, a value is impossible, or
        values contradict each other: scale and stated range, sun and time, distance and date.
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
    time = _time(image, _LAUNCHED[spacecraft])
    check_distance("EARTH_SUN_DISTANCE", distance, time)
    sza, saa = _sun(groups, image, time)
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
        time=time,
        sza=sza,
        saa=saa,
        earth_sun_distance=distance,
        view=_view(image),
        quality=_file(files, "FILE_NAME_QUALITY_L1_PIXEL"),
        saturation=_file(files, "FILE_NAME_QUALITY_L1_RADIOMETRIC_SATURATION"),
        angles={name: _file(files, key) for name, key in _ANGLE_FILES.items() if key in files},
    )


def _sun(groups, image, time):
    """Solar zenith and azimuth angles at the scene centre, which must agree with its time and corners [degree]."""
    elevation, azimuth = _number(image, "SUN_ELEVATION"), _number(image, "SUN_AZIMUTH")
    if not -90 <= elevation <= 90 or not -360 <= azimuth <= 360:
        raise ValueError(
            f"SUN_ELEVATION must be in [-90, 90] and SUN_AZIMUTH in [-360, 360] degrees, got {elevation:g} and "
            f"{azimuth:g}: {CURE}"
        )
    centre = _centre(groups)
    if centre is not None:
        keys = f"SUN_ELEVATION = {elevation:g} and SUN_AZIMUTH = {azimuth:g}"
        check_sun(keys, 90.0 - elevation, azimuth, time, centre)
    elif 0 < elevation <= np.pi / 2:
        raise ValueError(
            f"SUN_ELEVATION = {elevation:g} must be in degrees: it looks like radians, and the metadata have no "
            f"corners of the scene (CORNER_UL_LAT_PRODUCT and so on) that prove a sun so low; {CURE}"
        )
    if elevation <= 0:
        raise ValueError(
            f"SUN_ELEVATION must be in (0, 90] degrees, got {elevation:g}: the sun is below the horizon, so the scene "
            "was taken at night and holds no reflectance; take one of the day"
        )
    return 90.0 - elevation, azimuth % 360.0


def _centre(groups):
    """Latitude and longitude of the middle of the corners, None without corners [degree]."""
    group = groups.get("PROJECTION_ATTRIBUTES", {})
    keys = [[f"CORNER_{each}_{axis}_PRODUCT" for each in ("UL", "UR", "LL", "LR")] for axis in ("LAT", "LON")]
    if not all(key in group for key in keys[0] + keys[1]):
        return None
    latitude, longitude = ([_number(group, key) for key in each] for each in keys)
    # A vector on the globe has the longitude as azimuth: the mean holds on both sides of the antimeridian.
    colatitude, longitude = direction_angles(mean_direction(90.0 - np.array(latitude), longitude))
    return 90.0 - float(colatitude), (float(longitude) + 180.0) % 360.0 - 180.0


def _view(image):
    """View zenith and azimuth angles at the scene centre, None where a rolled view is not stated [degree]."""
    if image.get("NADIR_OFFNADIR", "NADIR") == "NADIR":
        return 0.0, 0.0
    row = image.get("WRS_ROW", "")
    if "ROLL_ANGLE" not in image or not row.isdecimal() or not 1 <= int(row) <= ROWS:
        return None
    return view_of_roll(_number(image, "ROLL_ANGLE"), int(row))


def _band(groups, level, letters, number, distance):
    """One band with its scale, which must agree with the range that the same metadata state."""
    scales, counts = _group(groups, _SCALES[level]), _group(groups, _COUNTS[level])
    limits = _limits(counts, "QUANTIZE_CAL", number)
    for kind, check, ranges in (
        ("REFLECTANCE", check_scale, groups.get(_RANGES[level], {})),
        ("RADIANCE", check_radiance, groups.get("LEVEL1_MIN_MAX_RADIANCE", {}) if level == 1 else {}),
    ):
        keys = [f"{kind}_{part}_BAND_{number}" for part in ("MULT", "ADD")]
        stated = _limits(ranges, kind, number) if f"{kind}_MAXIMUM_BAND_{number}" in ranges else None
        if kind == "REFLECTANCE" or (stated is not None and keys[0] in scales):
            words = " and ".join(f"{key} = {_value(scales, key)}" for key in keys)
            words += f" with QUANTIZE_CAL_MAX_BAND_{number} = {limits[1]:g}"
            check(words, *(_number(scales, key) for key in keys), limits, stated)
    return ProductBand(
        name=f"{letters}{number}",
        file=_file(_group(groups, "PRODUCT_CONTENTS"), f"FILE_NAME_BAND_{number}"),
        gain=_number(scales, f"REFLECTANCE_MULT_BAND_{number}"),
        offset=_number(scales, f"REFLECTANCE_ADD_BAND_{number}"),
        largest=int(limits[1]),
        solar_irradiance=_irradiance(groups, number, distance),
        flag=_flag(letters, number),
    )


def _limits(group, name, number):
    """Smallest and largest value of a band."""
    short = name == "QUANTIZE_CAL"
    keys = ("MIN", "MAX") if short else ("MINIMUM", "MAXIMUM")
    found = tuple(_number(group, f"{name}_{key}_BAND_{number}") for key in keys)
    if short and found != tuple(map(int, found)):
        raise ValueError(
            f"{name}_MIN and _MAX of band {number} must be whole numbers, got {found[0]:g} and {found[1]:g}"
        )
    return found


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


def _time(image, launch):
    text = f"{_value(image, 'DATE_ACQUIRED')}T{_value(image, 'SCENE_CENTER_TIME')}"
    return utc_time(text, "DATE_ACQUIRED and SCENE_CENTER_TIME", launch)


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
    """Name of a file in the folder of the metadata: USGS writes no paths."""
    name = _value(group, key)
    if not re.fullmatch(r"\w[\w.\-]*", name):
        raise ValueError(f"{key} must be the name of a file beside the metadata, got {shown(name)}")
    return name
