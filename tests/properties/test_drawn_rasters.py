"""
Any file opens as a raster or is rejected with a message of one line.

To draw a thousand files: ``FIFESIM_DRAWS=1000 pytest -m slow tests/properties/test_drawn_rasters.py``
"""

import json
import os
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st
from rasterio.control import GroundControlPoint

import fifesim
from fifesim.grids.opening import errors_of_gdal

COUNT = int(os.environ.get("FIFESIM_DRAWS", "80"))
WEST, NORTH = 708000.0, 4332000.0
GRID = fifesim.grid_at("EPSG:26914", WEST, NORTH, 240.0, 200.0, 10.0)

DTYPES = [
    "uint8",
    "int8",
    "uint16",
    "int16",
    "uint32",
    "int32",
    "float32",
    "float64",
    "complex64",
    "complex128",
    "complex_int16",
]
SYSTEMS = [
    "EPSG:26914", "EPSG:26914", "EPSG:32614", "EPSG:26714", "EPSG:4326", "EPSG:26914+5703", "EPSG:4979", "EPSG:4978",
    "EPSG:3857", "EPSG:3031", "EPSG:2225", "EPSG:5703", None,
    'LOCAL_CS["bench",UNIT["metre",1]]', "+proj=utm +zone=14 +ellps=clrk66 +units=m",
    "+proj=ob_tran +o_proj=longlat +o_lat_p=30 +lon_0=0", "+proj=geos +h=35785831 +units=m",
]  # fmt: skip
NUMBERS = st.sampled_from([0.0, 1.0, -1.0, 0.5, 1e-300, 1e300, float("nan"), float("inf"), -9999.0, 1e-9, 300.0])
TAGS = st.one_of(
    st.sampled_from(["1", "[1]", "null", "{}", "", "[" * 100_000, '{"a":' * 5000, "NaN", "x" * 1_100_000, '"\x1b[2J"']),
    st.fixed_dictionaries(
        {
            "name": st.sampled_from(["lai", None, 3, [1], {"a": 1}]),
            "dims": st.sampled_from([["y", "x"], ["band", "y", "x"], ["x"], [], "yx", ["z", "y", "x"], None]),
            "attrs": st.sampled_from([{}, {"units": "m"}, {"a": {"b": []}}, [], None, {"_FillValue": "x"}]),
            "coords": st.dictionaries(
                st.sampled_from(["band", "gain", "offset", "y", "time", "spatial_ref", "sza", "wavelength"]),
                st.fixed_dictionaries(
                    {
                        "dims": st.sampled_from([[], ["band"], ["y"], ["band", "x"], 3]),
                        "values": st.sampled_from([1, "a", [1], ["a", "b"], [[1]], None, {}, "2000-01-01", [1e400]]),
                        "dtype": st.sampled_from(["<f8", "<U500000000", "<U3", "|O", "<M8[ns]", "f8,f8", "?", "zz", 7]),
                        "attrs": st.sampled_from([{}, {"units": 1}, None]),
                    }
                ),
                max_size=3,
            ),
        }
    ).map(json.dumps),
)


PLACED = Affine(10, 0, WEST - 50, 0, -10, NORTH + 50)
TURNED = [
    Affine.translation(WEST, NORTH) @ Affine.rotation(angle) @ Affine.scale(30, -30) for angle in (90, 180, 30, 1e-4)
]
TRANSFORMS = st.one_of(
    st.sampled_from([5.0, 0.5, 3.3, 1e-4, 1e-12]).map(lambda cell: PLACED @ Affine.scale(cell / 10)),
    st.sampled_from([*TURNED, Affine(1e-4, 0, -96.6, 0, -1e-4, 39.12), Affine.identity(), Affine.scale(1, -1)]),
    st.lists(NUMBERS | st.sampled_from([30.0, -30.0, WEST, NORTH]), min_size=6, max_size=6).map(
        lambda six: Affine(*six)
    ),
)

# ORDINARY is the normal raster, and DRAWN the values that replace up to four of its keys.
ORDINARY = {
    "driver": "GTiff", "dtype": "float32", "shape": (40, 40), "count": 1, "crs": "EPSG:26914", "transform": PLACED,
    "nodata": None, "scaling": (1.0, 0.0), "gcps": False, "tag": None, "unit": None, "wavelength": None,
}  # fmt: skip
DRAWN = {
    "driver": st.sampled_from(["COG", "COG", "PNG", "HFA", "ENVI", "AAIGrid", "VRT", "JPEG"]),
    "dtype": st.sampled_from(DTYPES),
    "shape": st.tuples(st.integers(1, 40), st.integers(1, 40)),
    "count": st.sampled_from([2, 3, 7]),
    "crs": st.sampled_from(SYSTEMS),
    "transform": TRANSFORMS,
    "nodata": NUMBERS,
    "scaling": st.tuples(NUMBERS, NUMBERS),
    "gcps": st.just(True),
    "tag": TAGS,
    "unit": st.sampled_from(["m", "ft", "\x1b[2J", "W m-2 sr-1 um-1", "u" * 3000]),
    "wavelength": st.sampled_from(["0.8", "red"]),
}


@st.composite
def rasters(draw):
    """Keywords of `write`: an ordinary raster with up to four keys drawn."""
    return ORDINARY | {key: draw(DRAWN[key]) for key in draw(st.sets(st.sampled_from(sorted(DRAWN)), max_size=4))}


def write(path, *, driver, dtype, shape, count, crs, transform, nodata, scaling, gcps, tag, unit, wavelength):
    """Write the file and return its path."""
    profile = {"driver": "GTiff", "dtype": dtype, "height": shape[0], "width": shape[1], "count": count}
    with rasterio.open(path, "w", **profile, nodata=nodata) as sink:
        sink.crs = crs
        if gcps:
            points = [GroundControlPoint(row, row, WEST + 30 * row, NORTH - 30 * row) for row in range(4)]
            sink.gcps = points, rasterio.crs.CRS.from_epsg(26914)
        else:
            sink.transform = transform
        cells = np.random.default_rng(0).integers(0, 9, (count, *shape))
        sink.write(cells.astype("complex64" if dtype.startswith("complex") else dtype))
        sink.scales, sink.offsets = [scaling[0]] * count, [scaling[1]] * count
        sink.units = [unit] * count
        if tag is not None:
            sink.update_tags(FIFESIM=tag)
        if wavelength:
            sink.update_tags(1, ns="IMAGERY", CENTRAL_WAVELENGTH_UM=wavelength)
    if driver != "GTiff":
        rasterio.shutil.copy(path, f"{path}.other", driver=driver)
        return Path(f"{path}.other")
    return Path(path)


def damage(path, flips, share):
    """Flip bytes of a file and truncate it to a share of its length."""
    data = bytearray(path.read_bytes())
    for place, value in flips:
        data[int(place * (len(data) - 1))] ^= value
    path.write_bytes(data[: int(share * len(data))])


DAMAGE = st.one_of(
    st.just(([], 1.0)),
    st.just(([], 1.0)),
    st.just(([], 1.0)),
    st.tuples(
        st.lists(st.tuples(st.floats(0, 1) | st.floats(0, 0.1), st.integers(1, 255)), min_size=1, max_size=5),
        st.sampled_from([1.0, 1.0, 0.99, 0.9, 0.5, 0.05, 0.0]),
    ),
)

DOORS = {
    "image": lambda path: fifesim.open_image(path),
    "lazy image": lambda path: fifesim.open_image(path, chunks={"y": 7}),
    "lai": lambda path: fifesim.open_lai(path, GRID),
    "lazy lai": lambda path: fifesim.open_lai(path, GRID, chunks=9),
    "dem": lambda path: fifesim.fine_dem(path, GRID, fill=60),
}


def outcome(door, path):
    """Checked result of an opening function: "raster" or the name of the error class."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", PendingDeprecationWarning)
        try:
            found = DOORS[door](path).compute()
        except (ValueError, OSError) as error:
            assert type(error) in (ValueError, OSError), f"{type(error)}: {error}"
            assert 0 < len(str(error)) <= 500 and str(error).isprintable(), str(error)
            return type(error).__name__
        finally:
            # Several blocks can give the same warning; by default, Python shows it once.
            assert len({str(each.message) for each in caught}) <= 2, [str(each.message) for each in caught]
    assert {"y", "x"} <= set(found.dims) and found.size and found.dtype.kind in "iuf"
    if "image" not in door:
        assert found.dtype == float and found.shape == tuple(GRID.shape) and not np.isinf(found).any()
    return "raster"


SEEN = {}


@pytest.mark.slow
def test_drawn_rasters_open_or_are_rejected_in_one_line():
    try_a_drawn_raster()
    assert {"raster", "ValueError"} <= set(SEEN)


@settings(max_examples=COUNT)
@given(rasters(), DAMAGE, st.sampled_from(sorted(DOORS)))
def try_a_drawn_raster(raster, broken, door):
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            with errors_of_gdal("cannot draw"):
                path = write(f"{folder}/drawn.tif", **raster)
        except (OSError, ValueError, OverflowError, TypeError, SystemError):
            # Some drawn files cannot be written; test the partial file.
            path = Path(f"{folder}/drawn.tif")
            path.touch()
        damage(path, *broken) if path.stat().st_size else None
        found = outcome(door, path)
    SEEN[found] = SEEN.get(found, 0) + 1
