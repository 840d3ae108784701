"""STAC metadata: an item describes a folder of results in space and time, a collection several items."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pyproj
import rasterio

from fifesim.base.bands import COMMON_NAMES
from fifesim.grids import cf
from fifesim.grids.grid import crs_fields
from fifesim.grids.tags import read_tag
from fifesim.output.folders import versions
from fifesim.scenario.toml import write_scenario

VERSION = "1.1.0"

# odc-stac finds names of bands only in eo:bands, which version 2 of its extension forbids.
_EXTENSIONS = [
    f"https://stac-extensions.github.io/{name}/schema.json"
    for name in ("projection/v2.0.0", "eo/v1.1.0", "raster/v2.0.0", "view/v1.0.0", "processing/v1.2.0", "file/v2.1.0")
]
_COG = "image/tiff; application=geotiff; profile=cloud-optimized"

# Files of a folder in the order of the item: key, title, media type and roles.
_ASSETS = {
    "image.tif": ("image", "Digital numbers of the image", _COG, ["data"]),
    "image.qml": ("image-style", "Style of the image for QGIS", "application/xml", ["metadata"]),
    "truth.tif": ("truth", "True means of ground properties over the pixels", _COG, ["data"]),
    "truth.qml": ("truth-style", "Style of the true means for QGIS", "application/xml", ["metadata"]),
    "scene.tif": ("scene", "Ground cells", _COG, ["data"]),
    "scene.zarr": ("scene", "Ground cells", "application/vnd+zarr", ["data"]),
    "quicklook.png": ("thumbnail", "Scene and image", "image/png", ["thumbnail"]),
    "report.html": ("report", "Report of the run", "text/html", ["metadata"]),
    "scenario.toml": ("scenario", "All inputs for repeating the run", "application/toml", ["metadata"]),
}

# Fields of a band that are also part of the extension for electro-optical bands.
_EO_FIELDS = ("name", "description", "eo:common_name", "eo:center_wavelength", "eo:solar_illumination")

# Common aliases of bands that STAC does not define.
_ALIASES = {"rededge1", "rededge2", "rededge3", "swir1", "swir2"}

# Range for a scenario without a date, because STAC requires a date or a range.
_ANY_TIME = ("1900-01-01T00:00:00Z", "2100-01-01T00:00:00Z")

# Mean radius of the Earth. [m]
_EARTH = 6_371_000.0

# Points along an edge of a footprint, which is straight on the map and curved in degrees.
_POINTS = 5


def item(scenario, folder, title):
    """STAC 1.1.0 item of the folder of a simulated scenario, with paths relative to the folder."""
    # A scenario without a date has a null datetime, and an uninformative range.
    folder = Path(folder)
    found = {name: about for name, about in _ASSETS.items() if (folder / name).exists()}
    assets = {about[0]: _asset(folder / name, *about[1:]) for name, about in found.items()}
    with rasterio.open(folder / "image.tif") as image:
        ring, crs = _footprint(image), _crs(image)
    longitudes, latitudes = zip(*ring, strict=True)
    digest = hashlib.sha256(write_scenario(scenario).encode()).hexdigest()[:12]
    return {
        "type": "Feature",
        "stac_version": VERSION,
        "stac_extensions": list(_EXTENSIONS),
        "id": f"fifesim-{scenario.sensor.description.name.lower()}-{digest}",
        "geometry": {"type": "Polygon", "coordinates": [[list(point) for point in ring]]},
        "bbox": [min(longitudes), min(latitudes), max(longitudes), max(latitudes)],
        "properties": {"title": title} | _properties(scenario) | crs,
        "links": [],
        "assets": assets,
    }


def write_collection(folder, identifier, description, items):
    """Write a STAC collection, ``collection.json``, and its items by path, with links to each other."""
    boxes = np.array([each["bbox"] for each in items.values()])
    whole = [*boxes[:, :2].min(axis=0).tolist(), *boxes[:, 2:].max(axis=0).tolist()]
    starts, ends = zip(*(_times(each["properties"]) for each in items.values()), strict=True)
    links = [_link("root", "./collection.json")]
    found = {
        "type": "Collection",
        "stac_version": VERSION,
        "id": identifier,
        "description": description,
        "license": "other",
        "extent": {"spatial": {"bbox": [whole]}, "temporal": {"interval": [[min(starts), max(ends)]]}},
        "links": links + [_link("item", f"./{path}", "application/geo+json") for path in items],
    }
    write_stac(found, folder / "collection.json")
    for path, each in items.items():
        up = "../" * path.count("/") + "collection.json"
        links = [_link(relation, up) for relation in ("collection", "parent", "root")]
        write_stac(each | {"collection": identifier, "links": links}, folder / path)


def write_stac(thing, path):
    """Write a STAC item or collection as JSON."""
    path.write_text(json.dumps(thing, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _link(relation, href, kind="application/json"):
    return {"rel": relation, "href": href, "type": kind}


def _times(properties):
    """First and last time of an item, as text that sorts by time."""
    if properties["datetime"]:
        return properties["datetime"], properties["datetime"]
    return properties["start_datetime"], properties["end_datetime"]


def _properties(scenario):
    own, directions, time = scenario.sensor, scenario.sun_and_view(), scenario.geometry.time
    view = {"view:sun_azimuth": directions.saa, "view:sun_elevation": 90 - directions.sza}
    # fifesim's azimuth points from the ground to the sensor, STAC's from below the sensor to the scene.
    view |= {"view:incidence_angle": directions.vza, "view:azimuth": (directions.vaa + 180) % 360}
    # Angle at the sensor between nadir and the pixel, over a spherical Earth.
    ratio = _EARTH / (_EARTH + own.description.altitude)
    view["view:off_nadir"] = np.degrees(np.arcsin(ratio * np.sin(np.radians(directions.vza))))
    when = {"datetime": time}
    if time is None:
        when |= dict(zip(("start_datetime", "end_datetime"), _ANY_TIME, strict=True))
    return {
        **when,
        "instruments": [own.description.name.lower()],
        "gsd": own.size,
        **{name: round(float(value), 9) for name, value in view.items()},
        "processing:software": versions(),
        "processing:lineage": "Simulated by fifesim; the asset scenario has all parameters.",
    }


def _footprint(source):
    """Ring of longitudes and latitudes around a raster, counterclockwise from its lower left corner. [degree]"""
    steps = np.linspace(0, 1, _POINTS)[:-1]
    along, none, all_of = steps, np.zeros_like(steps), np.ones_like(steps)
    x = np.concatenate([along, all_of, 1 - along, none]) * source.width
    y = np.concatenate([all_of, 1 - along, none, along]) * source.height
    to_degrees = pyproj.Transformer.from_crs(source.crs, 4326, always_xy=True)
    places = np.round(np.transpose(to_degrees.transform(*(source.transform * (x, y)))), 7).tolist()
    return [*places, places[0]]


def _crs(source):
    """CRS of a file, with a null code if it has none."""
    return {"proj:code": None} | crs_fields(source.crs.to_wkt())


def _asset(path, title, kind, roles):
    asset = {"href": f"./{path.name}", "title": title, "type": kind, "roles": roles} | _stored(path)
    if kind != _COG:
        return asset
    with rasterio.open(path) as source:
        box, kept = source.bounds, read_tag(source, path.name)
        coords = {} if kept is None else kept["coords"]
        bands = [_band(source, number, coords) for number in source.indexes]
        return asset | {
            **_crs(source),
            "proj:shape": list(source.shape),
            "proj:transform": list(source.transform)[:6],
            "proj:bbox": [box.left, box.bottom, box.right, box.top],
            "data_type": source.dtypes[0],
            "raster:spatial_resolution": source.res[0],
            "raster:sampling": "area",
            "bands": bands,
            "eo:bands": [
                {key.removeprefix("eo:"): value for key, value in band.items() if key in _EO_FIELDS} for band in bands
            ],
        }


# Prefix of a multihash: SHA-256 of 32 bytes.
_SHA_256 = "1220"


def _stored(path):
    """Size [byte] and SHA-256 of a file, or of the names and contents of all files of a folder in their order."""
    files = [path] if path.is_file() else sorted(each for each in path.rglob("*") if each.is_file())
    digest = hashlib.sha256()
    for each in files:
        digest.update(b"" if each == path else each.relative_to(path).as_posix().encode())
        with each.open("rb") as file:
            hashlib.file_digest(file, lambda: digest)
    return {
        "file:size": sum(each.stat().st_size for each in files),
        "file:checksum": f"{_SHA_256}{digest.hexdigest()}",
    }


def changed_files(kept, folder, names):
    """Names of files that differ in size or checksum from an item, which is the last of them and may be invalid."""
    *names, own = names
    try:
        stored = {
            asset["href"]: {key: asset[key] for key in asset if "file:" in key} for asset in kept["assets"].values()
        }
    except (AttributeError, KeyError, TypeError):
        return [own]
    return [name for name in names if stored.get(f"./{name}") != _stored(folder / name)]


def _band(source, number, coords):
    """Band of a file, from its metadata."""
    name, nodata, unit = source.descriptions[number - 1], source.nodata, source.units[number - 1]
    band = {"name": name, "data_type": source.dtypes[number - 1]}
    if name in cf.QUANTITIES:
        band["description"] = cf.QUANTITIES[name].long_name
    if nodata is not None:
        band["nodata"] = "nan" if np.isnan(nodata) else nodata
    if unit:
        band["unit"] = unit
    scale, offset = source.scales[number - 1], source.offsets[number - 1]
    if (scale, offset) != (1, 0):
        band |= {"raster:scale": scale, "raster:offset": offset}
    return band | _spectral(coords, number)


def _spectral(coords, number):
    """Wavelength, common name and solar irradiance of a band."""
    fields = {}
    if "wavelength" in coords:
        wavelength = float(np.atleast_1d(coords["wavelength"])[number - 1])
        known = {name: window for name, window in COMMON_NAMES.items() if name not in _ALIASES}
        inside = {name: abs(wavelength - at.best) for name, at in known.items() if at.low <= wavelength <= at.high}
        if inside:
            fields["eo:common_name"] = min(inside, key=inside.get)
        fields["eo:center_wavelength"] = wavelength
    if "solar_irradiance" in coords:
        fields["eo:solar_illumination"] = float(np.atleast_1d(coords["solar_irradiance"])[number - 1])
    return fields
