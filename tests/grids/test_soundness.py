"""Rasters that hold no numbers, or lie nowhere, are refused by name."""

import math
import re
import warnings

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from affine import Affine
from rasterio.control import GroundControlPoint

import fifesim
from fifesim.grids import opening

GRID = fifesim.grid_at("EPSG:26914", 708000.0, 4332000.0, 240.0, 200.0, 10.0)
PLACED = Affine(10, 0, 707900, 0, -10, 4332100)
LOCAL = 'LOCAL_CS["bench",UNIT["metre",1]]'


def write(path, *, scale=1.0, offset=0.0, gcps=None, **other):
    profile = {"driver": "GTiff", "width": 60, "height": 60, "count": 1, "dtype": "float32", "crs": "EPSG:26914"}
    profile |= {"transform": PLACED} | other
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(path, "w", **profile) as sink:
            sink.write(np.full((1, 60, 60), 3, profile["dtype"]))
            sink.scales, sink.offsets = [scale], [offset]
            if gcps:
                sink.gcps = gcps, rasterio.crs.CRS.from_epsg(26914)
    return path


def refused_everywhere(path, reason):
    for door in (
        fifesim.open_image,
        lambda each: fifesim.open_lai(each, GRID),
        lambda each: fifesim.fine_dem(each, GRID),
    ):
        with pytest.raises(ValueError, match=reason) as said:
            door(path)
        assert path.name in str(said.value) and len(str(said.value)) <= 500


@pytest.mark.parametrize(
    ("profile", "reason"),
    [
        ({"dtype": "complex64"}, "complex numbers.*real part"),
        ({"scale": 0.0}, "scale of 0"),
        ({"scale": math.nan}, "scale of nan"),
        ({"offset": math.inf}, "offset of inf"),
        ({"transform": Affine(0, 0, 707900, 0, 0, 4332100)}, "no place on the Earth.*a_ullr"),
        ({"transform": Affine(10, 10, 707900, 10, 10, 4332100)}, "no place on the Earth"),
        ({"transform": Affine(1e300, 0, 707900, 0, -1e300, 4332100)}, "no place on the Earth"),
        ({"transform": Affine(10, 0, math.nan, 0, -10, 4332100)}, "no place on the Earth"),
        ({"transform": Affine(1e-9, 0, 707900, 0, -1e-9, 4332100)}, "no place on the Earth"),
        ({"transform": None}, "has no geotransform.*gdalwarp"),
        ({"crs": None}, "has no CRS.*a_srs"),
        ({"crs": LOCAL}, "no projected nor geographic one"),
        ({"crs": "EPSG:4978"}, "no projected nor geographic one"),
    ],
)
def test_what_is_no_raster_on_the_earth_is_refused(tmp_path, profile, reason):
    refused_everywhere(write(tmp_path / "odd.tif", **profile), reason)


def test_control_points_alone_are_refused(tmp_path):
    points = [GroundControlPoint(row, row**2, 708000 + row, 4332000 - row) for row in range(4)]
    path = write(tmp_path / "points.tif", transform=None, crs=None, gcps=points)
    refused_everywhere(path, "control points only.*gdalwarp")


@pytest.mark.parametrize("angle", [90, 180, 20])
def test_a_turned_image_is_refused(tmp_path, angle):
    turned = Affine.translation(708000, 4332000) @ Affine.rotation(angle) @ Affine.scale(10, -10)
    with pytest.raises(ValueError, match=r"turned\.tif is rotated or not north up.*gdalwarp"):
        fifesim.open_image(write(tmp_path / "turned.tif", transform=turned))


def test_heights_take_no_part_in_places(tmp_path):
    plain, compound = write(tmp_path / "plain.tif"), write(tmp_path / "compound.tif", crs="EPSG:26914+5703")
    image = fifesim.open_image(compound)
    assert image.rio.crs == "EPSG:26914" and image.equals(fifesim.open_image(plain))
    np.testing.assert_array_equal(fifesim.open_lai(compound, GRID), fifesim.open_lai(plain, GRID))


@pytest.mark.slow
def test_a_small_file_of_huge_size_is_read_by_parts_only(tmp_path):
    path = tmp_path / "huge.tif"
    profile = {"driver": "GTiff", "width": 1_000_000, "height": 1_000_000, "count": 1, "dtype": "uint8"}
    profile |= {"tiled": True, "blockxsize": 8192, "blockysize": 8192, "sparse_ok": True, "bigtiff": "yes"}
    with rasterio.open(path, "w", **profile, crs="EPSG:26914", transform=PLACED * Affine.scale(0.005)):
        pass
    assert path.stat().st_size < 1_000_000
    with pytest.raises(ValueError, match=r"huge\.tif takes 1e\+03 GB of memory.*chunks='auto'"):
        fifesim.open_image(path)
    lazy = fifesim.open_image(path, chunks=1000)
    assert float(lazy[0, :5, :5].sum()) == 0


def test_no_data_beyond_the_type_mark_nothing(tmp_path):
    """A mark that no cell can hold, which GDAL takes from a mosaic."""
    write(tmp_path / "cells.tif", dtype="uint8")
    rasterio.shutil.copy(tmp_path / "cells.tif", tmp_path / "marked.vrt", driver="VRT")
    text = (tmp_path / "marked.vrt").read_text()
    band = re.search("<VRTRasterBand[^>]*>", text)[0]
    (tmp_path / "marked.vrt").write_text(text.replace(band, f"{band}<NoDataValue>-9999</NoDataValue>"))
    assert (fifesim.open_image(tmp_path / "marked.vrt") == 3).all()


def test_memory_is_asked_for_first():
    opening.check_memory(10, 8, "it", "leave it")
    with pytest.raises(ValueError, match=r"it takes 8e\+09 GB of memory, .* GB are free: leave it"):
        opening.check_memory(1e18, 8, "it", "leave it")
