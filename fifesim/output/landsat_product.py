"""Landsat Collection-2 Level-1 products of simulated scenes."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyproj
from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.base.arguments import FilePath
from fifesim.base.geometry import ANGLES, Geometry
from fifesim.output import simulated_product
from fifesim.output.simulated_product import Images, Truth, write_raster
from fifesim.sensor.labels import scale
from fifesim.sensor.products.landsat_labels import LANDSAT_INSTRUMENTS

# By instrument: beginning of the product's name, and date of the last images (USGS, Landsat satellite missions: TM of
# Landsat 4 and 5 stopped in December 1993 and November 2011, ETM+ in January 2024); None for active missions.
_MISSIONS = {
    "L4TM": ("LT04", "1993-12-14"),
    "TM": ("LT05", "2011-11-18"),
    "ETM+": ("LE07", "2024-01-19"),
    "OLI": ("LC08", None),
    "OLI2": ("LC09", None),
}

# Bits of QA_PIXEL: fill, cloud, cloud shadow and clear, and the shifts of confidences of cloud, shadow, snow and cirrus,
# in which 1 is low and 3 is high. USGS, Landsat Collection 2 Quality Assessment bands.
_FILL, _CLOUD, _SHADOW, _CLEAR = 1, 1 << 3, 1 << 4, 1 << 6
_CONFIDENCES = 8, 10, 12, 14

# The cirrus band shows no ground, and may be left out.
_CIRRUS = "OLI9"

# Largest mean view zenith angle of a scene from nadir. [degree]
_NADIR = 0.005

_ANGLE_KEYS = {"vaa": "SENSOR_AZIMUTH", "vza": "SENSOR_ZENITH", "saa": "SOLAR_AZIMUTH", "sza": "SOLAR_ZENITH"}


def to_landsat_l1(image: Images, folder: FilePath, *, truth: Truth | None = None, overwrite: bool = False) -> Path:
    """
    Write a simulated scene as a Landsat Collection-2 Level-1 product, with its truth.

    Other programs read the product like a real one: TM of Landsat 4 and 5, ETM+ of Landsat 7, OLI of Landsat 8 and
    OLI-2 of Landsat 9. The product states that it is simulated: in its name, with path and row 000000 and
    ``SIMULATED``, in ORIGIN and STATION_ID of the metadata, in each raster, and in ``SIMULATED.txt``.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x), or xarray.DataTree
        Image from `fifesim.sense` of these instruments: digital numbers, radiance or reflectance at the top of the
        atmosphere, on pixels of 30 m in WGS 84 / UTM, with a coordinate ``time``. All bands of 30 m are needed, apart
        from the cirrus band. A DataTree has the panchromatic band too, on pixels of 15 m. [1 or W m-2 sr-1 um-1]
    folder : str or path
        Folder in which the folder of the product is made.
    truth : xarray.Dataset, optional
        True rasters of the scene on any grid, such as surface reflectance, LAI, FPAR and optical thickness of aerosol.
        Each is written as ``truth/NAME.tif``. Variables ``cloud`` and ``shadow``, as masks or as fractions on the grid
        of the image, set the bits of QA_PIXEL where they are at least 0.5.
    overwrite : bool, optional
        Replace the same product of an earlier call. Other folders are never replaced.

    Returns
    -------
    product : pathlib.Path
        Folder of the product. It appears when it is complete.

    Raises
    ------
    ValueError
        If the instrument is another; bands are missing; pixels have another size or CRS; the image has no time or sun,
        or its date is outside of the mission; the sun differs by more than 1 degree from the almanac; or a reflectance
        is outside of the range of digital numbers. Digital numbers of saturated pixels are kept.
    FileExistsError
        If the product exists and ``overwrite`` is False, or its folder was not written by fifesim.
    OSError
        If a file cannot be written.

    Notes
    -----
    Digital numbers keep the scale of the instrument's description: for TM and ETM+ the range of radiance in 8 bits, for
    OLI reflectance in 16 bits. Thermal bands, ground control points and angle coefficients are not written. South of
    the equator, northings are negative in the northern zone, as in products of USGS. Angles are also written by pixel,
    in hundredths of a degree; where the view is not from nadir, open the product with ``angles="pixel"``.

    References
    ----------
    USGS, Landsat 8-9 Collection 2 Level-1 data format control book (LSDS-1822), and Landsat 4-7 (LSDS-1337 and 1414)

    See Also
    --------
    fifesim.open_landsat, fifesim.output.to_sentinel2_l1c

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import fifesim
    >>> time, grid = "1987-06-06T16:35Z", fifesim.grid_at("EPSG:32614", 704970, 4334220, 1200, 900, cell=30)
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> geometry = fifesim.sun_position(time, latitude=39.1, longitude=-96.6)
    >>> rho = lai.fifesim.surface_reflectance("TM", geometry=geometry)
    >>> image = rho.fifesim.to_toa(geometry=geometry).fifesim.sense("TM", time=time)
    >>> product = image.fifesim.to_landsat_l1(mkdtemp(), truth=lai.to_dataset(name="lai"))
    >>> product.name
    'LT05_L1TP_000000_19870606_19870606_02_T2_SIMULATED'
    >>> again = fifesim.open_landsat(product)
    >>> bool(abs(again - image.fifesim.to_reflectance()).max() < 1e-6)
    True
    """
    images = simulated_product.images_of(image)
    others = "write images of other instruments with .fifesim.to_geotiff(...)"
    description = simulated_product.instrument_of(images, _MISSIONS, others)
    layers = simulated_product.layers_of(images, description, omitted=(_CIRRUS,))
    prefix, last = _MISSIONS[description.name]
    (spacecraft, sensor), (_, letters, _, launch) = next(
        item for item in LANDSAT_INSTRUMENTS.items() if item[1][0] == description.name
    )
    numbers = {name: name.removeprefix(letters) for name in layers}
    ground = {name: layer for name, layer in layers.items() if numbers[name] != "8"}
    if not ground:
        raise ValueError(f"the image has no bands of 30 m of {description.name}: give the whole result of sense")
    main = next(each for each in images if str(np.atleast_1d(each["band"].values)[0]) in ground)
    seen = simulated_product.acquisition_of([main], f"{spacecraft} {sensor}", launch, last)
    date = np.datetime_as_string(seen.time, "D").replace("-", "")
    product = f"{prefix}_L1TP_000000_{date}_{date}_02_T2"
    with simulated_product.product_folder(folder, f"{product}_SIMULATED", truth, overwrite=overwrite) as new:
        scales = _scales(layers, description, seen)
        stacks = {}
        for name, layer in layers.items():
            gain, offset = (float(scales[f"REFLECTANCE_{part}"][name]) for part in ("MULT", "ADD"))
            stacks[name] = simulated_product.digital_numbers(layer, gain, offset, scales["largest"], _mu_s(layer))
            write_raster(new / f"{product}_B{numbers[name]}.TIF", stacks[name], _as_usgs(layer.grid), nodata=0)
        saturated = {name: bool((stack == scales["largest"]).any()) for name, stack in stacks.items()}
        first = next(iter(ground.values()))
        fill = np.all([stacks[name] == 0 for name in ground], axis=0)
        cloud = _write_quality(new / product, ground, {name: stacks[name] for name in ground}, numbers, truth, fill)
        _write_angles(new / product, seen.geometry, first.grid, fill)
        groups = _contents(product, numbers, scales, description.name)
        groups |= _attributes(seen, spacecraft, sensor, product, numbers, saturated, cloud)
        groups["PROJECTION_ATTRIBUTES"] = _projection(layers, numbers)
        groups["LEVEL1_PROCESSING_RECORD"] = _record(groups["PRODUCT_CONTENTS"], product, seen)
        groups |= _radiometry(scales, numbers)
        kept = ("MAP_PROJECTION", "DATUM", "ELLIPSOID", "UTM_ZONE", "ORIENTATION")
        same = groups["PROJECTION_ATTRIBUTES"].items()
        groups["LEVEL1_PROJECTION_PARAMETERS"] = {
            key: value for key, value in same if key in kept or key.startswith("GRID_CELL_SIZE")
        } | {"RESAMPLING_OPTION": "NONE"}
        _write_metadata(new / f"{product}_MTL", groups)
        simulated_product.write_truth(new, [main], truth)
    return Path(folder) / f"{product}_SIMULATED"


def _mu_s(layer):
    """Cosine of the solar zenith angle of a layer; angles by pixel as the product keeps them."""
    sza = layer.reflectance.coords["sza"].values
    return np.cos(np.radians(np.round(sza, 2) if sza.ndim else sza))


def _as_usgs(grid):
    """Grid in the northern UTM zone, with negative northings south of the equator."""
    zone, north = simulated_product.utm_zone(grid)
    return grid if north else GeoBox(grid.shape, Affine.translation(0, -1e7) * grid.affine, f"EPSG:{32600 + zone}")


def _scales(layers, description, seen):
    """Scales of the bands by key and name of the band, as texts, and the largest digital number."""
    bands = [layer.band for layer in layers.values()]
    above = None if description.product is None else Geometry(seen.sza, seen.saa, 0, 0, seen.earth_sun_distance)
    gain, offset, bits = scale(description, bands, above)
    largest, found = 2**bits - 1, {"largest": 2**bits - 1}
    white = np.array([band.solar_irradiance for band in bands]) / (np.pi * seen.earth_sun_distance**2)
    for kind, unit in (("RADIANCE", 1.0), ("REFLECTANCE", white)):
        values = {"MULT": gain / unit, "ADD": offset / unit}
        values |= {"MAXIMUM": values["MULT"] * largest + values["ADD"], "MINIMUM": values["MULT"] + values["ADD"]}
        for part, numbers in values.items():
            found[f"{kind}_{part}"] = {name: f"{number:.8E}" for name, number in zip(layers, numbers, strict=True)}
    return found


def _write_quality(start, layers, stacks, numbers, truth, fill):
    """Write QA_PIXEL and QA_RADSAT; return the cloud cover. [%]"""
    grid = next(iter(layers.values())).grid
    cloud, shadow = (simulated_product.mask_of(truth, name, grid) for name in ("cloud", "shadow"))
    # Products of TM and ETM+ have no confidence of cirrus.
    shifts = _CONFIDENCES if "OLI2" in layers else _CONFIDENCES[:3]
    quality = np.full(fill.shape, sum(1 << shift for shift in shifts))
    quality |= np.where(cloud, _CLOUD | 2 << _CONFIDENCES[0], _CLEAR) | shadow * (_SHADOW | 2 << _CONFIDENCES[1])
    saturation = sum(
        (stack == np.iinfo(stack.dtype).max).astype(int) << int(numbers[name]) - 1 for name, stack in stacks.items()
    )
    for name, values in (("PIXEL", np.where(fill, _FILL, quality)), ("RADSAT", saturation)):
        path = start.with_name(f"{start.name}_QA_{name}.TIF")
        write_raster(path, values.astype(np.uint16), _as_usgs(grid))
    return 100 * float((cloud & ~fill).sum() / max((~fill).sum(), 1))


def _write_angles(start, geometry, grid, fill):
    """Write the angles by pixel in hundredths of a degree, azimuths in -180 to 180."""
    for name in ANGLES:
        angle = np.broadcast_to(np.asarray(getattr(geometry, name), float), grid.shape)
        angle = (angle + 180) % 360 - 180 if name.endswith("aa") else angle
        values = np.where(fill | np.isnan(angle), 0, np.rint(100 * angle)).astype(np.int16)
        write_raster(start.with_name(f"{start.name}_{name.upper()}.TIF"), values, _as_usgs(grid))


def _contents(product, numbers, scales, instrument):
    """Group of the files of the product."""
    files = {f"BAND_{number}": f"B{number}" for number in numbers.values()}
    files |= {"QUALITY_L1_PIXEL": "QA_PIXEL", "QUALITY_L1_RADIOMETRIC_SATURATION": "QA_RADSAT"}
    angles = {f"ANGLE_{_ANGLE_KEYS[name]}_BAND_4": name.upper() for name in _ANGLE_KEYS}
    types = {f"DATA_TYPE_{key}": "UINT16" if "QUALITY" in key or scales["largest"] > 255 else "UINT8" for key in files}
    group = {
        "ORIGIN": simulated_product.statement(),
        "DIGITAL_OBJECT_IDENTIFIER": "none, simulated",
        "LANDSAT_PRODUCT_ID": product,
        "PROCESSING_LEVEL": "L1TP",
        "COLLECTION_NUMBER": "02",
        "COLLECTION_CATEGORY": "T2",
        "OUTPUT_FORMAT": "GEOTIFF",
    }
    group |= {f"FILE_NAME_{key}": f"{product}_{name}.TIF" for key, name in (files | angles).items()}
    group |= {"FILE_NAME_METADATA_ODL": f"{product}_MTL.txt", "FILE_NAME_METADATA_XML": f"{product}_MTL.xml"}
    return {"PRODUCT_CONTENTS": group | types | {f"DATA_TYPE_{key}": "INT16" for key in angles}}


def _attributes(seen, spacecraft, sensor, product, numbers, saturated, cloud):
    """Group of the acquisition."""
    day, clock = np.datetime_as_string(seen.time, "ns").split("T")
    oli, nadir = sensor == "OLI", seen.vza <= _NADIR
    quality = "IMAGE_QUALITY_OLI" if oli else "IMAGE_QUALITY"
    group = {
        "SPACECRAFT_ID": spacecraft,
        "SENSOR_ID": "OLI_TIRS" if oli else sensor,
        "WRS_TYPE": "2",
        "WRS_PATH": "000",
        "WRS_ROW": "000",
        "NADIR_OFFNADIR": "NADIR" if nadir else "OFFNADIR",
        "DATE_ACQUIRED": day,
        "SCENE_CENTER_TIME": f"{clock[:16]}Z",
        "STATION_ID": "SIM",
        "CLOUD_COVER": f"{cloud:.2f}",
        "CLOUD_COVER_LAND": f"{cloud:.2f}",
        quality: "9",
    }
    group |= {f"SATURATION_BAND_{numbers[name]}": "Y" if found else "N" for name, found in saturated.items()}
    group |= {"ROLL_ANGLE": "0.000"} if nadir and oli else {}
    group |= {
        "SUN_AZIMUTH": f"{(seen.saa + 180) % 360 - 180:.8f}",
        "SUN_ELEVATION": f"{90 - seen.sza:.8f}",
        "EARTH_SUN_DISTANCE": f"{seen.earth_sun_distance:.7f}",
    }
    return {"IMAGE_ATTRIBUTES": group}


def _projection(layers, numbers):
    """Group of the grid; corners are the centres of corner pixels, and of whole pixels in degrees too."""
    grid = _as_usgs(next(layer.grid for name, layer in layers.items() if numbers[name] != "8"))
    group = {
        "MAP_PROJECTION": "UTM",
        "DATUM": "WGS84",
        "ELLIPSOID": "WGS84",
        "UTM_ZONE": str(simulated_product.utm_zone(grid)[0]),
    }
    kinds = {"PANCHROMATIC": [layer for name, layer in layers.items() if numbers[name] == "8"]}
    kinds["REFLECTIVE"] = [layer for name, layer in layers.items() if numbers[name] != "8"]
    sizes = {kind: each[0].grid for kind, each in kinds.items() if each}
    group |= {f"GRID_CELL_SIZE_{kind}": f"{each.affine.a:.2f}" for kind, each in sizes.items()}
    for kind, each in sizes.items():
        group |= {f"{kind}_LINES": str(each.shape.y), f"{kind}_SAMPLES": str(each.shape.x)}
    group["ORIENTATION"] = "NORTH_UP"
    to_degrees = pyproj.Transformer.from_crs(grid.crs.proj, 4326, always_xy=True)
    degrees, metres = {}, {}
    for corner in ("UL", "UR", "LL", "LR"):
        column, row = (0.5, grid.shape.x - 0.5)[corner[1] == "R"], (0.5, grid.shape.y - 0.5)[corner[0] == "L"]
        x, y = grid.affine * (column, row)
        longitude, latitude = to_degrees.transform(x, y)
        degrees |= {
            f"CORNER_{corner}_LAT_PRODUCT": f"{latitude:.5f}",
            f"CORNER_{corner}_LON_PRODUCT": f"{longitude:.5f}",
        }
        metres |= {f"CORNER_{corner}_PROJECTION_{axis}_PRODUCT": f"{at:.3f}" for axis, at in (("X", x), ("Y", y))}
    return group | degrees | metres


def _record(contents, product, seen):
    """Group of the processing."""
    day = np.datetime_as_string(seen.time, "s")
    year_day = (
        f"{day[:4]}{(seen.time - seen.time.astype('datetime64[Y]')).astype('timedelta64[D]').astype(int) + 1:03d}"
    )
    kept = {key: value for key, value in contents.items() if not key.startswith(("COLLECTION_NUMBER", "DATA_TYPE"))}
    return kept | {
        "REQUEST_ID": "SIMULATED",
        "LANDSAT_SCENE_ID": f"{product[:2]}{product[3]}000000{year_day}SIM00",
        "DATE_PRODUCT_GENERATED": f"{day}Z",
        "PROCESSING_SOFTWARE_VERSION": simulated_product.statement()
        .split(",")[0]
        .removeprefix("Simulated scene made by "),
        "DATA_SOURCE_ELEVATION": "SIMULATED",
    }


def _radiometry(scales, numbers):
    """Groups of the ranges and scales of the bands."""
    parts = ("MAXIMUM", "MINIMUM")
    groups = {
        f"LEVEL1_MIN_MAX_{kind}": {
            f"{kind}_{part}_BAND_{number}": scales[f"{kind}_{part}"][name]
            for name, number in numbers.items()
            for part in parts
        }
        for kind in ("RADIANCE", "REFLECTANCE")
    }
    groups["LEVEL1_MIN_MAX_PIXEL_VALUE"] = {
        f"QUANTIZE_CAL_{part}_BAND_{number}": str(count)
        for number in numbers.values()
        for part, count in (("MAX", scales["largest"]), ("MIN", 1))
    }
    groups["LEVEL1_RADIOMETRIC_RESCALING"] = {
        f"{key}_BAND_{number}": scales[key][name]
        for key in ("RADIANCE_MULT", "RADIANCE_ADD", "REFLECTANCE_MULT", "REFLECTANCE_ADD")
        for name, number in numbers.items()
    }
    return groups


# Numbers and dates, which the text form writes without quotes.
_BARE = re.compile(r"[-+.\dE]+|\d{4}-\d\d-\d\d(T[\d:.]+Z)?")


def _write_metadata(start, groups):
    """Write the metadata as text and as XML."""
    lines, root = ["GROUP = LANDSAT_METADATA_FILE"], ElementTree.Element("LANDSAT_METADATA_FILE")
    for group, values in groups.items():
        parent = ElementTree.SubElement(root, group)
        lines.append(f"  GROUP = {group}")
        for key, value in values.items():
            lines.append(f"    {key} = {value}" if _BARE.fullmatch(value) else f'    {key} = "{value}"')
            ElementTree.SubElement(parent, key).text = value
        lines.append(f"  END_GROUP = {group}")
    text = "\n".join([*lines, "END_GROUP = LANDSAT_METADATA_FILE", "END", ""])
    start.with_name(f"{start.name}.txt").write_text(text, encoding="utf-8")
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(start.with_name(f"{start.name}.xml"), encoding="UTF-8", xml_declaration=True)
