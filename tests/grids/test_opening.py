"""Opening files: known local formats only, with real numbers and a location on the Earth, and the right band."""

import os
import re
import socket
import threading
import tomllib
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pyproj
import pytest
import rasterio
import rasterio.shutil
import rasterio.vrt
import rioxarray
from affine import Affine
from rasterio.control import GroundControlPoint
from rasterio.enums import ColorInterp

import fifesim
from fifesim.grids import opening
from fifesim.grids.opening import covering_grid

FOREIGN = tomllib.loads((Path(__file__).parents[1] / "data" / "foreign_rasters.toml").read_text(encoding="utf-8"))
GRID = fifesim.grid_at("EPSG:26914", 708000.0, 4332000.0, 240.0, 200.0, 10.0)
PLACED = Affine(10, 0, 707900, 0, -10, 4332100)
DOORS = [
    fifesim.open_image,
    lambda path, **options: fifesim.open_lai(path, GRID, **options),
    lambda path, **options: fifesim.fine_dem(path, GRID, **options),
]


def write(path, values=(3,), *, names=(), scales=1.0, offset=0.0, gcps=(), units=(), colours=None, **other):
    """Write a raster around the grid, of bands with one value each."""
    profile = {"driver": "GTiff", "width": 60, "height": 60, "dtype": "float32", "crs": "EPSG:26914"}
    profile |= {"transform": PLACED} | other
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(path, "w", count=len(values), **profile) as sink:
            if colours:
                sink.colorinterp = colours
            cells = np.broadcast_to(np.reshape(values, (-1, 1, 1)), (len(values), 60, 60))
            sink.write(cells.astype(profile["dtype"]))
            sink.scales, sink.offsets = np.broadcast_to(scales, len(values)).tolist(), [offset] * len(values)
            sink.descriptions, sink.units = names or [None] * len(values), units or [""] * len(values)
            if gcps:
                points = [GroundControlPoint(*each) for each in gcps]
                sink.gcps = points, rasterio.crs.CRS.from_epsg(26914)
    return path


def check_refused_everywhere(path, reason, error=ValueError):
    """Check that each function that opens a raster rejects it in one line."""
    for door in DOORS:
        with pytest.raises(error, match=reason) as said:
            door(path)
        assert len(str(said.value)) <= 500 and str(said.value).isprintable()


def write_mosaic(path, source, relative="0"):
    path.write_text(FOREIGN["templates"]["mosaic"].replace("SOURCE", source).replace("RELATIVE", relative))
    return str(path)


@pytest.fixture
def server():
    """An address and the list of requests received there."""
    asked = []
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def answer():
            while True:
                try:
                    caller, _ = listening.accept()
                except OSError:
                    return
                with caller:
                    asked.append(caller.recv(1000))
                    caller.send(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")

        threading.Thread(target=answer, daemon=True).start()
        yield f"http://127.0.0.1:{listening.getsockname()[1]}/x.tif", asked


def test_no_request_is_sent_unless_allowed(tmp_path, server):
    address, asked = server
    tms = FOREIGN["templates"]["server"].replace("ADDRESS", address)
    (tmp_path / "tms.tif").write_text(tms)
    beside = write(tmp_path / "beside.tif")
    (tmp_path / "beside.tif.msk").write_text(tms)
    mosaics = [
        write_mosaic(tmp_path / "curl.vrt", f"/vsicurl/{address}"),
        write_mosaic(tmp_path / "tms.vrt", "tms.tif", relative="1"),
        write_mosaic(tmp_path / "nested.vrt", "curl.vrt", relative="1"),
    ]
    virtual = [f"/vsicurl/{address}", f"/vsizip//vsicurl/{address}/a.tif", "/vsis3/bucket/a.tif"]
    for path in (address, tms, str(tmp_path / "tms.tif"), beside, *virtual, *mosaics):
        check_refused_everywhere(path, "allow_remote=True")
    assert not asked
    for number, door in enumerate(DOORS):
        with pytest.raises(ValueError, match="404"):
            door(address.replace("x.tif", f"{number}.tif"), allow_remote=True)
        assert len(asked) > number
    with opening.remote_allowed(), pytest.raises(ValueError, match="404"):
        opening.raster_file(address.replace("x.tif", "context.tif"))
    assert len(asked) > len(DOORS)
    with pytest.raises(ValueError, match="--allow-remote"):
        opening.raster_file(address)


def test_lazy_tasks_keep_the_permission(tmp_path):
    """Threads and workers do not see the context manager."""
    path = tmp_path / "warped.vrt"
    with rasterio.open(write(tmp_path / "a.tif")) as source, rasterio.vrt.WarpedVRT(source, crs="EPSG:26914") as warped:
        rasterio.shutil.copy(warped, path, driver="VRT")
    with pytest.raises(ValueError, match=r"warped\.vrt is a mosaic with 'VRTWarpedDataset', and is not opened"):
        fifesim.open_lai(path, GRID)
    with opening.remote_allowed():
        lazy = fifesim.open_lai(path, GRID, chunks=7), fifesim.open_image(path, chunks=7)
    assert all((each.compute(scheduler="threads") == 3).all() for each in lazy)


def test_local_mosaics_and_archives_are_opened(tmp_path):
    path = write(tmp_path / "a.tif")
    plain, packed = write_mosaic(tmp_path / "a.vrt", "a.tif", relative="1"), tmp_path / "a.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        archive.write(path, "a.tif")
    for each in (plain, write_mosaic(tmp_path / "b.vrt", plain), f"/vsizip/{packed}/a.tif"):
        assert (fifesim.open_lai(each, GRID) == 3).all() and (fifesim.open_image(each) == 3).all()


def test_mosaics_that_may_refer_elsewhere_are_rejected(tmp_path):
    (tmp_path / "a.tif").touch()
    for text in FOREIGN["mosaics"]["refused"]:
        (tmp_path / "a.vrt").write_text(text)
        assert opening.is_mosaic(tmp_path / "a.vrt")
        with pytest.raises(ValueError, match=r"^(with|of|whose) "):
            opening.mosaic_sources(tmp_path / "a.vrt")


def test_paths_that_are_no_regular_file_are_rejected_without_waiting(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    os.symlink(tmp_path / "loop", tmp_path / "loop")
    refused = {"pipe": "is a pipe: name a file", "loop": "symbolic links", "x" * 5000: "too long", "a\0.tif": "null"}
    refused |= {"": "is a folder", "/dev/zero": "is a device", "\x1b[2J.tif": r"\\x1b\[2J\.tif as a raster: no raster"}
    for path, reason in refused.items():
        check_refused_everywhere(tmp_path / path, reason)
    check_refused_everywhere(f"/vsizip/{tmp_path}/pipe/a.tif", "is a pipe")


def test_rasters_without_numbers_or_location_are_rejected(tmp_path):
    for number, given in enumerate(FOREIGN["odd"]):
        profile = {key: value or None if key == "crs" else value for key, value in given.items() if key != "said"}
        if "transform" in profile:
            profile["transform"] = Affine(*profile["transform"]) if profile["transform"] else None
        profile["scales"] = profile.pop("scale", 1.0)
        check_refused_everywhere(write(tmp_path / f"{number}.tif", **profile), rf"{number}\.tif.*{given['said']}")
    for angle in (90, 180, 20):
        turned = Affine.translation(708000, 4332000) @ Affine.rotation(angle) @ Affine.scale(10, -10)
        with pytest.raises(ValueError, match=r"turned\.tif is rotated or not north up.*gdalwarp"):
            fifesim.open_image(write(tmp_path / "turned.tif", transform=turned))


def test_vertical_crs_and_nodata_value_outside_the_dtype_are_ignored(tmp_path):
    """GDAL passes on the nodata value of a mosaic even if no cell can hold it."""
    image = fifesim.open_image(write(tmp_path / "compound.tif", crs="EPSG:26914+5703"))
    assert image.rio.crs == "EPSG:26914" and image.equals(fifesim.open_image(write(tmp_path / "plain.tif")))
    assert (fifesim.open_lai(tmp_path / "compound.tif", GRID) == 3).all()
    write(tmp_path / "cells.tif", dtype="uint8")
    rasterio.shutil.copy(tmp_path / "cells.tif", tmp_path / "marked.vrt", driver="VRT")
    text = (tmp_path / "marked.vrt").read_text()
    band = re.search("<VRTRasterBand[^>]*>", text)[0]
    (tmp_path / "marked.vrt").write_text(text.replace(band, f"{band}<NoDataValue>-9999</NoDataValue>"))
    assert (fifesim.open_image(tmp_path / "marked.vrt") == 3).all()


IN_DEGREES = Affine(0.0002, 0, -96.6, 0, -0.0002, 39.12)
IN_METRES = Affine(10, 0, 709003, 0, -10, 4332001)
MODIS, ON_SPHERE = "+proj=sinu +R=6371007.181 +units=m", Affine(10, 0, -8334000, 0, -10, 4343000)


@pytest.mark.parametrize(
    ("affine", "own", "asked", "epsg"),
    [
        (IN_DEGREES, 4326, None, 32614),
        (IN_METRES, 26914, None, 26914),
        (IN_METRES, 26914, "EPSG:5070", 5070),
        (IN_DEGREES, 4269, None, 26914),
        (ON_SPHERE, MODIS, None, 32614),
    ],
)
def test_covering_grid_covers_the_file_in_whole_pixels(tmp_path, affine, own, asked, epsg):
    path = write(tmp_path / "lai.tif", transform=affine, crs=own)
    grid = covering_grid(path, 10 / 3, 30.0, asked)
    a, box = grid.affine, grid.boundingbox
    assert grid.crs.epsg == epsg
    assert a.c % 30 == 0 and a.f % 30 == 0 and grid.shape.x % 9 == 0 and grid.shape.y % 9 == 0
    corners = np.array([affine * corner for corner in [(0, 0), (60, 0), (0, 60), (60, 60)]])
    x, y = pyproj.Transformer.from_crs(own, epsg, always_xy=True).transform(*corners.T)
    assert box.left <= x.min() < box.left + 31 and box.right - 31 < x.max() <= box.right
    assert box.bottom <= y.min() < box.bottom + 31 and box.top - 31 < y.max() <= box.top
    for crs, said in (("EPSG:4326", "must be projected"), ("EPSG:2193", "EPSG:2193"), ("EPSG:3857", "the scale of")):
        with pytest.raises(ValueError, match=said):
            covering_grid(path, 10.0, 30.0, crs)


# Numbers in a band, and the function that opens a file or an array of them.
CLASSES = {"a": fifesim.CoverClass(code=2, lai=2.0), "b": fifesim.CoverClass(code=3, lai=3.0)}
BY_BAND = {
    "lai": lambda given: fifesim.open_lai(given, GRID),
    "elevation": lambda given: fifesim.fine_dem(given, GRID),
    "cover": lambda given: fifesim.landscape(GRID, cover=given, classes=CLASSES).cover,
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", BY_BAND)
def test_band_is_the_only_one_that_names_the_quantity(tmp_path, name):
    found, values = BY_BAND[name], [3.0, 2.0]
    path = write(tmp_path / "two.tif", values, names=["quality", name])
    for given in (path, rioxarray.open_rasterio(path)):
        np.testing.assert_allclose(found(given), 2.0, rtol=1e-6)


def test_scale_and_unit_are_of_the_band_of_the_quantity(tmp_path):
    """A band of transparency is no band of data."""
    scaled, path = {"dtype": "int16", "scales": [1.0, 0.1]}, tmp_path / "map.tif"
    write(path, [7, 25], names=["Lai_QC", "Lai_500m"], units=["%", "m2/m2"], **scaled)
    np.testing.assert_allclose(fifesim.open_lai(path, GRID), 2.5, rtol=1e-6)
    write(path, [1, 4000], names=["NDVI", "elevation"], units=["1", "m"], **scaled)
    np.testing.assert_allclose(fifesim.fine_dem(path, GRID), 400.0, rtol=1e-6)
    write(path, [400, 255], colours=[ColorInterp.gray, ColorInterp.alpha], dtype="int16")
    np.testing.assert_allclose(fifesim.fine_dem(path, GRID), 400.0, rtol=1e-6)


@pytest.mark.parametrize("driver", ["AAIGrid", "PNG", "EHdr", "ENVI"])
@pytest.mark.parametrize("header", ["EHdr", "ENVI"])
def test_header_of_another_file_does_not_make_a_raster_raw_bytes(tmp_path, driver, header):
    twin = write(tmp_path / "lai.bil", driver=header)
    kept = tmp_path / ("lai.bil" if driver == header else {"AAIGrid": "lai.asc", "PNG": "lai.png"}.get(driver, "x.bil"))
    if kept != twin:
        source = write(tmp_path / "source.tif", dtype="uint8" if driver == "PNG" else "float32")
        rasterio.shutil.copy(source, kept, driver=driver, **({"WORLDFILE": "YES"} if driver == "PNG" else {}))
    assert (tmp_path / "lai.hdr").exists()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        np.testing.assert_array_equal(fifesim.open_lai(kept, GRID), 3.0)


@pytest.mark.parametrize("bring", [fifesim.open_lai, fifesim.fine_dem])
def test_changed_file_is_another_array_for_dask(tmp_path, bring):
    path = write(tmp_path / "map.tif", [1])
    one, same = (bring(path, GRID, chunks=20).data.name for _ in "ab")
    other = bring(write(path, [2]), GRID, chunks=20)
    assert one == same != other.data.name and float(other.mean()) == pytest.approx(2.0)
