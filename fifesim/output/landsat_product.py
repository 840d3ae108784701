"""Landsat Collection-2 Level-1 products of simulated scenes."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyproj
from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.base.arguments import FilePath
from fifesim.base.geometry import ANGLES, Geometry
from fifesim.output import simulated_product
from fifesim.output.maps import rendered
from fifesim.output.simulated_product import Images, Truth, write_raster
from fifesim.sensor.labels import scale
from fifesim.sensor.products.landsat_labels import LANDSAT_INSTRUMENTS

# By instrument: beginning of the product's name, and last date of routine images; None for active missions. USGS,
# Landsat missions: TM of Landsat 4 and 5 stopped in December 1993 and November 2011 (days recalled), ETM+ on 19 January
# 2024.
_MISSIONS = {
    "L4TM": ("LT04", "1993-12-14"),
    "TM": ("LT05", "2011-11-18"),
    "ETM+": ("LE07", "2024-01-19"),
    "OLI": ("LC08", None),
    "OLI2": ("LC09", None),
}

# Bits of QA_PIXEL: fill, cloud, cloud shadow and clear, and the shifts of the confidences of cloud, shadow, snow and
# cirrus, in which 1 is low and 3 is high. USGS, Landsat Collection 2 Quality Assessment bands.
_FILL, _CLOUD, _SHADOW, _CLEAR = 1, 1 << 3, 1 << 4, 1 << 6
_CONFIDENCES = 8, 10, 12, 14

# The cirrus band shows no ground, and may be left out.
_CIRRUS = "OLI9"

# Largest mean view zenith angle of a scene from nadir. [degree]
_NADIR = 0.005

# Keys of the files of angles, by the ends of their names.
_ANGLE_FILES = {
    f"ANGLE_{part}_BAND_4": end
    for end, part in {
        "VAA": "SENSOR_AZIMUTH", "VZA": "SENSOR_ZENITH", "SAA": "SOLAR_AZIMUTH", "SZA": "SOLAR_ZENITH"
    }.items()
}  # fmt: skip


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
    >>> grid = fifesim.grid_at("EPSG:32614", 704970, 4334220, 1200, 900, cell=30)
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", time="1987-06-06T16:35Z")
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> product = image.fifesim.to_landsat_l1(mkdtemp(), truth=lai.to_dataset(name="lai"))
    >>> product.name
    'LT05_L1TP_000000_19870606_19870606_02_T2_SIMULATED'
    >>> again = fifesim.open_landsat(product)
    >>> bool(abs(again - image.fifesim.to_reflectance()).max() < 1e-6)
    True
    """
    images = simulated_product.images_of_scene(image)
    others = "write images of other instruments with .fifesim.to_geotiff(...)"
    description = simulated_product.instrument_of(images, _MISSIONS, others)
    layers = simulated_product.layers_of_scene(images, description, omitted=(_CIRRUS,))
    (spacecraft, sensor), (_, letters, _, launch) = next(
        item for item in LANDSAT_INSTRUMENTS.items() if item[1][0] == description.name
    )
    ground = {name: layer for name, layer in layers.items() if name != f"{letters}8"}
    if not ground:
        raise ValueError(f"the image has no bands of 30 m of {description.name}: give the whole result of sense")
    prefix, last = _MISSIONS[description.name]
    images = sorted(images, key=lambda each: each.sizes["x"])
    seen = simulated_product.acquisition_of(images, f"{spacecraft} {sensor}", launch, last)
    date = np.datetime_as_string(seen.time, "D").replace("-", "")
    product = f"{prefix}_L1TP_000000_{date}_{date}_02_T2"
    with simulated_product.product_folder(folder, f"{product}_SIMULATED", truth, overwrite=overwrite) as new:
        bands = _bands(layers, description, seen, letters)
        counts = {}
        for layer, band in zip(layers.values(), bands, strict=True):
            scale_of = float(band["REFLECTANCE_MULT"]), float(band["REFLECTANCE_ADD"]), band["QUANTIZE_CAL_MAX"]
            values = simulated_product.digital_numbers(layer, *scale_of, _mu_s(layer))
            write_raster(new / f"{product}_B{band['number']}.TIF", values, _as_usgs(layer.grid), nodata=0)
            band["saturated"] = (values == band["QUANTIZE_CAL_MAX"]).any()
            if layer.band.name in ground:
                counts[int(band["number"])] = values
        grid = next(iter(ground.values())).grid
        quality = _quality(counts, *(simulated_product.mask_of(truth, name, grid) for name in ("cloud", "shadow")))
        for end, values in (quality | _angles(seen.geometry, quality["QA_PIXEL"] == _FILL)).items():
            write_raster(new / f"{product}_{end}.TIF", values, _as_usgs(grid))
        attributes = {"product": product, "spacecraft": spacecraft, "sensor": sensor, "bands": bands}
        cloudy = (quality["QA_PIXEL"] & _CLOUD > 0).sum() / max((quality["QA_PIXEL"] != _FILL).sum(), 1)
        attributes["cloud_cover"] = f"{100 * cloudy:.2f}"
        _write_metadata(
            new / f"{product}_MTL", attributes | _files(bands) | _place(layers, letters) | _moment(seen, prefix)
        )
        simulated_product.write_truth(new, images, truth)
    return Path(folder) / f"{product}_SIMULATED"


def _mu_s(layer):
    """Cosine of the solar zenith angle of a layer; angles by pixel as the product keeps them."""
    sza = layer.reflectance.coords["sza"].values
    return np.cos(np.radians(np.round(sza, 2) if sza.ndim else sza))


def _as_usgs(grid):
    """Grid in the northern UTM zone, with negative northings south of the equator."""
    zone, north = simulated_product.utm_zone(grid)
    return grid if north else GeoBox(grid.shape, Affine.translation(0, -1e7) * grid.affine, f"EPSG:{32600 + zone}")


def _bands(layers, description, seen, letters):
    """Number and scales of each band by their keys."""
    bands = [layer.band for layer in layers.values()]
    above = None if description.product is None else Geometry(seen.sza, seen.saa, 0, 0, seen.earth_sun_distance)
    gain, offset, bits = scale(description, bands, above)
    found = [
        {"number": band.name.removeprefix(letters), "QUANTIZE_CAL_MAX": 2**bits - 1, "QUANTIZE_CAL_MIN": 1}
        for band in bands
    ]
    white = np.array([band.solar_irradiance for band in bands]) / (np.pi * seen.earth_sun_distance**2)
    for kind, unit in (("RADIANCE", 1.0), ("REFLECTANCE", white)):
        mult, add = gain / unit, offset / unit
        scales = {"MULT": mult, "ADD": add, "MAXIMUM": mult * (2**bits - 1) + add, "MINIMUM": mult + add}
        for part, numbers in scales.items():
            for band, number in zip(found, numbers, strict=True):
                band[f"{kind}_{part}"] = f"{number:.8E}"
    return found


def _quality(counts, cloud, shadow):
    """QA_PIXEL and QA_RADSAT of digital numbers by number of the band."""
    fill = np.all([values == 0 for values in counts.values()], axis=0)
    # Products of TM and ETM+ have no confidence of cirrus.
    shifts = _CONFIDENCES if counts[2].dtype == np.uint16 else _CONFIDENCES[:3]
    quality = np.where(cloud, _CLOUD | 2 << _CONFIDENCES[0], _CLEAR) | shadow * (_SHADOW | 2 << _CONFIDENCES[1])
    quality |= sum(1 << shift for shift in shifts)
    saturated = sum((values == np.iinfo(values.dtype).max) * (1 << number - 1) for number, values in counts.items())
    return {"QA_PIXEL": np.where(fill, _FILL, quality).astype(np.uint16), "QA_RADSAT": saturated.astype(np.uint16)}


def _angles(geometry, fill):
    """Angles by pixel in hundredths of a degree, azimuths in -180 to 180."""
    found = {}
    for name in ANGLES:
        angle = np.broadcast_to(np.asarray(getattr(geometry, name), float), fill.shape)
        angle = (angle + 180) % 360 - 180 if name.endswith("aa") else angle
        found[name.upper()] = np.where(fill | np.isnan(angle), 0, np.rint(100 * angle)).astype(np.int16)
    return found


def _files(bands):
    """Ends of the names of files, and types of their cells, by keys."""
    files = {f"BAND_{band['number']}": f"B{band['number']}" for band in bands}
    types = dict.fromkeys(files, "UINT8" if bands[0]["QUANTIZE_CAL_MAX"] == 255 else "UINT16")
    quality = {"QUALITY_L1_PIXEL": "QA_PIXEL", "QUALITY_L1_RADIOMETRIC_SATURATION": "QA_RADSAT"}
    types |= dict.fromkeys(quality, "UINT16") | dict.fromkeys(_ANGLE_FILES, "INT16")
    return {"files_of": files | quality | _ANGLE_FILES, "types": types}


def _place(layers, letters):
    """Fields of the grids, and centres of the pixels in the corners."""
    found = {}
    for name, layer in layers.items():
        found["PANCHROMATIC" if name == f"{letters}8" else "REFLECTIVE"] = _as_usgs(layer.grid)
    grid, corners = found["REFLECTIVE"], {}
    to_degrees = pyproj.Transformer.from_crs(grid.crs.proj, 4326)
    for corner in ("UL", "UR", "LL", "LR"):
        x, y = grid.affine * (
            grid.shape.x - 0.5 if corner[1] == "R" else 0.5,
            grid.shape.y - 0.5 if corner[0] == "L" else 0.5,
        )
        latitude, longitude = to_degrees.transform(x, y)
        corners |= {f"{corner}_LAT": f"{latitude:.5f}", f"{corner}_LON": f"{longitude:.5f}"}
        corners |= {f"{corner}_PROJECTION_X": f"{x:.3f}", f"{corner}_PROJECTION_Y": f"{y:.3f}"}
    return {"grids": found, "corners": corners, "zone": simulated_product.utm_zone(grid)[0]}


def _moment(seen, prefix):
    """Fields of time and directions."""
    day, clock = np.datetime_as_string(seen.time, "ns").split("T")
    day_of_year = (np.datetime64(day) - np.datetime64(day[:4])).astype(int) + 1
    return {
        "day": day,
        "clock": clock[:16],
        "scene": f"{prefix[:2]}{prefix[3]}000000{day[:4]}{day_of_year:03d}SIM00",
        "oli": prefix.startswith("LC"),
        "nadir": seen.vza <= _NADIR,
        "saa": f"{(seen.saa + 180) % 360 - 180:.8f}",
        "elevation": f"{90 - seen.sza:.8f}",
        "distance": f"{seen.earth_sun_distance:.7f}",
        "statement": simulated_product.simulation_statement(),
    }


def _write_metadata(start, values):
    """Write the metadata as text, and the same in XML."""
    lines = [line for line in rendered(Path(__file__).with_name("landsat_mtl.txt.j2"), **values).splitlines() if line]
    start.with_name(f"{start.name}.txt").write_text("\n".join([*lines, ""]), encoding="utf-8")
    tree = ElementTree.TreeBuilder()
    for line in lines[:-1]:
        key, value = line.strip().split(" = ")
        if key == "GROUP":
            tree.start(value, {})
        elif key == "END_GROUP":
            tree.end(value)
        else:
            tree.start(key, {})
            tree.data(value.strip('"'))
            tree.end(key)
    root = tree.close()
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(start.with_name(f"{start.name}.xml"), encoding="UTF-8", xml_declaration=True)
