"""Landsat Collection-2 products as labelled images: their metadata, bands, quality and angles."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import xarray as xr

from fifesim.base.arguments import Chunks, FilePath, Names, Range, check_number
from fifesim.base.files import in_a_line, shown
from fifesim.base.geometry import ANGLES, Geometry
from fifesim.grids import chunks as dask_chunks
from fifesim.grids import directions
from fifesim.grids import grid as grids
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.products import labels, metadata
from fifesim.sensor.products.labels import open_layer
from fifesim.sensor.products.metadata import REFETCH
from fifesim.sensor.response.calibration import ProductBand, direction_angles, hundredths, mean_direction
from fifesim.sensor.response.scan import ROWS, view_of_roll

_ROOT = "LANDSAT_METADATA_FILE"

# The name of a metadata file in upper or lower case, as unpacking programs and other packages leave it.
_METADATA = re.compile(r".*_MTL\.(txt|json|xml)", re.IGNORECASE)


def landsat_metadata_file(path):
    """Metadata file of a product, from its path or folder."""
    path = Path(path)
    if not path.is_dir():
        if not path.exists():
            raise ValueError(f"there is no file or folder {in_a_line(path, 200)}")
        if not _METADATA.fullmatch(path.name):
            raise ValueError(
                f"{in_a_line(path.name, 100)} is no metadata of a Landsat product: give its *_MTL.txt (.json, .xml), "
                "or the folder of the unpacked product"
            )
        return path
    files = [file for file in sorted(path.iterdir()) if _METADATA.fullmatch(file.name)]
    found = {}
    for file in sorted(files, key=lambda file: list(_READERS).index(file.suffix.lower())):
        found.setdefault(file.stem.lower(), file)
    if not found:
        raise ValueError(
            f"{in_a_line(path, 200)} has no *_MTL.txt, .json or .xml: give the folder of one Landsat Collection-2 "
            "product, unpacked"
        )
    if len(found) > 1:
        names = in_a_line(", ".join(file.name for file in found.values()), 200)
        raise ValueError(f"{in_a_line(path.name, 100)} holds {len(found)} products: give the file of one, {names}")
    return next(iter(found.values()))


def read_groups(path):
    """Values of a metadata file by group, as text; some keys occur in several groups with different values."""
    name = in_a_line(path.name, 100)
    root, pairs = _READERS[path.suffix.lower()](path)
    if root == "L1_METADATA_FILE":
        raise ValueError(f"{name} is of Collection 1 or older: take the scene's Collection-2 product, which USGS has")
    if root != _ROOT:
        raise ValueError(f"{name} is no metadata of a Landsat product: it begins with {shown(root)}, not {_ROOT}")
    with metadata.naming(path):
        groups = metadata.unique(pairs, "the group")
        groups = {group: metadata.unique(values, f"the {group} key") for group, values in groups.items() if values}
    collection = groups.get("PRODUCT_CONTENTS", {}).get("COLLECTION_NUMBER")
    if collection is None or collection.lstrip("0") != "2":
        raise ValueError(f"{name} is of collection {shown(collection)}: Collection 2 is read")
    return groups


def _text_pairs(path):
    """Name of the first group, and the groups with their pairs of key and value, in the text form."""
    root, pairs, around = None, [], []
    for line in metadata.read_metadata(path).splitlines():
        key, separator, value = (part.strip() for part in line.partition("="))
        if key == "GROUP":
            root = root or value
            pairs.append((value, []))
            around.append(pairs[-1])
        elif key == "END_GROUP":
            around = around[:-1]
        elif separator and around:
            around[-1][1].append((key, value.strip('"')))
    return root, pairs


def _json_pairs(path):
    """Groups as in `_text_pairs` from JSON, with objects as tuples of pairs to detect repeated keys."""
    try:
        content = json.loads(metadata.read_metadata(path), object_pairs_hook=tuple)
    except (ValueError, RecursionError) as error:
        raise ValueError(in_a_line(f"{path.name} is not valid JSON: {error}")) from None
    if not isinstance(content, tuple) or not content:
        return None, []
    if len(content) > 1:
        raise ValueError(f"{in_a_line(path.name, 100)} holds {len(content)} objects: metadata are one, {_ROOT}")
    ((root, groups),) = content
    groups = groups if isinstance(groups, tuple) else ()
    return root, [
        (group, [(key, str(value)) for key, value in values]) for group, values in groups if isinstance(values, tuple)
    ]


def _xml_pairs(path):
    """Groups as in `_text_pairs` from XML."""
    root = metadata.read_xml(path)
    return root.tag, [(group.tag, [(item.tag, (item.text or "").strip()) for item in group]) for group in root]


# Where a product has its metadata in several forms, the first of these is read.
_READERS = {".txt": _text_pairs, ".json": _json_pairs, ".xml": _xml_pairs}


# By spacecraft and sensor: instrument, first letters of its bands' names, numbers of its thermal bands, and the launch
# (USGS, Landsat satellite missions). SENSOR_ID is OLI_TIRS, or OLI where the thermal instrument was off.
LANDSAT_INSTRUMENTS = {
    ("LANDSAT_1", "MSS"): ("MSS", "MSS", (), "1972-07-23"),
    ("LANDSAT_2", "MSS"): ("MSS2", "MSS", (), "1975-01-22"),
    ("LANDSAT_3", "MSS"): ("MSS3", "MSS", ("8",), "1978-03-05"),
    ("LANDSAT_4", "MSS"): ("MSS4", "MSS", (), "1982-07-16"),
    ("LANDSAT_5", "MSS"): ("MSS5", "MSS", (), "1984-03-01"),
    ("LANDSAT_4", "TM"): ("L4TM", "TM", ("6",), "1982-07-16"),
    ("LANDSAT_5", "TM"): ("TM", "TM", ("6",), "1984-03-01"),
    ("LANDSAT_7", "ETM"): ("ETM+", "ETM", ("6", "6_VCID_1", "6_VCID_2"), "1999-04-15"),
    ("LANDSAT_8", "OLI"): ("OLI", "OLI", ("10", "11"), "2013-02-11"),
    ("LANDSAT_9", "OLI"): ("OLI2", "OLI", ("10", "11"), "2021-09-27"),
}

# The panchromatic band, and OLI's cirrus band: neither shows the ground on the 30 m grid.
_ASIDE = ("8", "9")

# Group with the scale, and group with the range of digital numbers and of reflectance, by level.
_SCALES = {1: "LEVEL1_RADIOMETRIC_RESCALING", 2: "LEVEL2_SURFACE_REFLECTANCE_PARAMETERS"}
_COUNTS = {1: "LEVEL1_MIN_MAX_PIXEL_VALUE", 2: "LEVEL2_SURFACE_REFLECTANCE_PARAMETERS"}
_RANGES = {1: "LEVEL1_MIN_MAX_REFLECTANCE", 2: "LEVEL2_SURFACE_REFLECTANCE_PARAMETERS"}

# Largest roll that Landsat 8 and 9 fly is 15 degrees.
_LARGEST_ROLL = 20.0
_NIGHT = "the sun is below the horizon, so the scene was taken at night and holds no reflectance; take one of the day"

# Angles in the names of keys, such as FILE_NAME_ANGLE_SOLAR_ZENITH_BAND_4.
_ANGLES = {"sza": "SOLAR_ZENITH", "saa": "SOLAR_AZIMUTH", "vza": "SENSOR_ZENITH", "vaa": "SENSOR_AZIMUTH"}


@dataclass(frozen=True)
class LandsatScene:
    """Landsat scene: its files, their scale, sun and time."""

    product: str
    reference: str  # citation of the product
    level: int  # 1 or 2
    instrument: str
    bands: tuple[ProductBand, ...]  # of reflected light
    aside: tuple[str, ...]  # names of bands that are opened only on request
    thermal: tuple[str, ...]  # names of thermal bands, which are not among `bands`
    time: np.datetime64  # of the scene centre, UTC
    sza: float  # at the scene centre [degree]
    saa: float
    earth_sun_distance: float  # [astronomical unit]
    view: tuple[float, float] | None  # zenith and azimuth at the scene centre; None after an unknown roll [degree]
    quality: str  # file of the quality of pixels
    saturation: str  # file of the saturation of bands
    angles: dict[str, str]  # files of the angles by pixel


def read_scene(path):
    """Scene of a metadata file or its folder, and the folder."""
    file = landsat_metadata_file(path)
    groups = read_groups(file)
    with metadata.naming(file):
        return landsat_scene(groups), file.parent


def landsat_scene(groups):
    """Scene from groups of metadata."""
    contents, image = (_value(groups, name, "group ") for name in ("PRODUCT_CONTENTS", "IMAGE_ATTRIBUTES"))
    spacecraft, sensor = _value(image, "SPACECRAFT_ID"), _value(image, "SENSOR_ID")
    known = LANDSAT_INSTRUMENTS.get((spacecraft, sensor.removesuffix("_TIRS")))
    if known is None:
        raise ValueError(
            f"the product is of {in_a_line(spacecraft, 40)} {in_a_line(sensor, 40)}: those of "
            f"{', '.join(f'{name} {instrument}' for name, instrument in LANDSAT_INSTRUMENTS)} are read"
        )
    instrument, letters, thermal, launch = known
    processing = _value(contents, "PROCESSING_LEVEL")
    if processing[:2] not in ("L1", "L2"):
        raise ValueError(f"PROCESSING_LEVEL is {shown(processing)}: L1TP, L1GT, L1GS, L2SP and L2SR are read")
    level, distance = int(processing[1]), _number(image, "EARTH_SUN_DISTANCE")
    text = f"{_value(image, 'DATE_ACQUIRED')}T{_value(image, 'SCENE_CENTER_TIME')}"
    time = metadata.utc_time(text, "DATE_ACQUIRED and SCENE_CENTER_TIME", launch)
    metadata.check_distance("EARTH_SUN_DISTANCE", distance, time)
    sza, saa = _sun(groups, image, time)
    # Bands 1 to 11, as Landsat 8 and 9 have.
    matches = [re.fullmatch(r"FILE_NAME_BAND_([1-9]|1[01])", key) for key in contents]
    numbers = [match[1] for match in matches if match and match[1] not in thermal]
    files = groups.get("LEVEL1_PROCESSING_RECORD", {}) | contents
    angles = {name: f"FILE_NAME_ANGLE_{angle}_BAND_4" for name, angle in _ANGLES.items()}
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
        angles={name: _file(files, key) for name, key in angles.items() if key in files},
    )


def _sun(groups, image, time):
    """Solar zenith and azimuth angles at the scene centre, checked against its time and corners. [degree]"""
    elevation, azimuth = _number(image, "SUN_ELEVATION"), _number(image, "SUN_AZIMUTH")
    check_number("SUN_ELEVATION", elevation, Range("degree", -90, 90, note=REFETCH))
    check_number("SUN_AZIMUTH", azimuth, Range("degree", -360, 360, note=REFETCH))
    centre = _centre(groups)
    if centre is not None:
        keys = f"SUN_ELEVATION = {elevation:g} and SUN_AZIMUTH = {azimuth:g}"
        metadata.check_sun(keys, 90.0 - elevation, azimuth, time, centre)
    elif 0 < elevation <= np.pi / 2:
        raise ValueError(
            f"SUN_ELEVATION = {elevation:g} must be in degrees: it looks like radians, and the metadata have no "
            f"corners of the scene (CORNER_UL_LAT_PRODUCT and so on) that prove a sun so low; {REFETCH}"
        )
    check_number("SUN_ELEVATION", elevation, Range("degree", 0, 90, note=_NIGHT, ends="(]"))
    return 90.0 - elevation, azimuth % 360.0


def _centre(groups):
    """Latitude and longitude of the middle of the corners, None without corners. [degree]"""
    group = groups.get("PROJECTION_ATTRIBUTES", {})
    keys = [[f"CORNER_{each}_{axis}_PRODUCT" for each in ("UL", "UR", "LL", "LR")] for axis in ("LAT", "LON")]
    if not all(key in group for key in keys[0] + keys[1]):
        return None
    latitude, longitude = ([_number(group, key) for key in each] for each in keys)
    # A vector on the globe has the longitude as azimuth: the mean holds on both sides of the antimeridian.
    colatitude, longitude = direction_angles(mean_direction(90.0 - np.array(latitude), longitude))
    return 90.0 - float(colatitude), (float(longitude) + 180.0) % 360.0 - 180.0


def _view(image):
    """View zenith and azimuth angles at the scene centre, None for an unknown rolled view. [degree]"""
    if image.get("NADIR_OFFNADIR", "NADIR") == "NADIR":
        return 0.0, 0.0
    row = image.get("WRS_ROW", "")
    if "ROLL_ANGLE" not in image or not row.isdecimal() or not 1 <= int(row) <= ROWS:
        return None
    roll = _number(image, "ROLL_ANGLE")
    check_number("ROLL_ANGLE", roll, Range("degree", -_LARGEST_ROLL, _LARGEST_ROLL, note=REFETCH))
    return view_of_roll(roll, int(row))


def _band(groups, level, letters, number, distance):
    """Band with its scale, checked against the range in the same metadata."""
    scales, counts = (_value(groups, names[level], "group ") for names in (_SCALES, _COUNTS))
    limits = _limits(counts, "QUANTIZE_CAL", number)
    for kind, check, ranges in (
        ("REFLECTANCE", metadata.check_product_scale, groups.get(_RANGES[level], {})),
        ("RADIANCE", metadata.check_radiance, groups.get("LEVEL1_MIN_MAX_RADIANCE", {}) if level == 1 else {}),
    ):
        keys = [f"{kind}_{part}_BAND_{number}" for part in ("MULT", "ADD")]
        stated = _limits(ranges, kind, number) if f"{kind}_MAXIMUM_BAND_{number}" in ranges else None
        if kind == "REFLECTANCE" or (stated is not None and keys[0] in scales):
            words = " and ".join(f"{key} = {_value(scales, key)}" for key in keys)
            words += f" with QUANTIZE_CAL_MAX_BAND_{number} = {limits[1]:g}"
            check(words, *(_number(scales, key) for key in keys), limits, stated)
    return ProductBand(
        name=f"{letters}{number}",
        file=_file(groups["PRODUCT_CONTENTS"], f"FILE_NAME_BAND_{number}"),
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
    """Bits of QA_RADSAT: 0 for band 1 up to 6 for band 7, 8 for band 9 of OLI; 9 where TM and ETM+ have no value."""
    if number == "8":
        return 0
    return 1 << (int(number) - 1) | (0 if letters == "OLI" else 1 << 9)


def _irradiance(groups, number, distance):
    """Solar irradiance behind both scales of Level 1: E = pi d^2 (Lmax - Lmin) / (rhomax - rhomin)."""
    ranges = {name: groups.get(f"LEVEL1_MIN_MAX_{name}") for name in ("RADIANCE", "REFLECTANCE")}
    if None in ranges.values():
        return None
    spans = [np.diff(_limits(group, name, number)).item() for name, group in ranges.items()]
    if min(spans) <= 0:
        raise ValueError(f"band {number}: the smallest radiance and reflectance must lie below the largest")
    return np.pi * distance**2 * spans[0] / spans[1]


def _value(group, key, kind=""):
    if key not in group:
        raise ValueError(f"the metadata have no {kind}{key}: is the file whole?")
    return group[key]


def _number(group, key):
    return metadata.stated_number(_value(group, key), key)


def _file(group, key):
    """Name of a file in the folder of the metadata, without a path."""
    name = _value(group, key)
    if not re.fullmatch(r"\w[\w.\-]*", name):
        raise ValueError(f"{key} must be the name of a file beside the metadata, got {shown(name)}")
    return name


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
        Names of the instrument's bands, such as ``["TM3", "TM4"]``, or other names: ``["B4", "B5"]``, ``["red",
        "nir"]``. By default all bands that show the ground at the common pixel size, 30 m (MSS: 60 m). The panchromatic
        band has its own grid, and OLI's cirrus band shows no ground.
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
    fifesim.open_sentinel2, fifesim.calibrate, fifesim.sensor.as_seen_by

    Examples
    --------
    >>> import fifesim
    >>> product = "LT05_L1TP_028033_19870606_20201014_02_T1_MTL.txt"
    >>> image = fifesim.open_landsat(product)  # doctest: +SKIP
    >>> image.fifesim.to_surface().fifesim.ndvi()  # doctest: +SKIP
    """
    scene, folder = read_scene(path)
    description = find_instrument(scene.instrument if instrument is None else instrument)
    if instrument is None:
        metadata.check_irradiance(scene.product, scene.bands, description)
    selected = _selected(scene, folder, description, bands)
    there = [band.name for band in scene.bands if (folder / band.file).exists()]
    cure = f"fetch it, or open those that are there with bands={there}" if there else "is the product unpacked there?"
    layers = [open_layer(folder, band.file, chunks, cure) for band in selected]
    # The pixels of the panchromatic band are not aligned with the other files.
    beside = quality and all(band.flag for band in selected)
    mask, flags = _quality(scene, folder, chunks, layers[0]) if beside else (None, None)
    geometry = _geometry(scene, folder, chunks, angles, layers[0])
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
