"""Warping files onto grids: operations of known accuracy, compared with an independent interpolation."""

import numpy as np
import pyproj
import pytest
import rasterio
import rioxarray
import xarray as xr
from affine import Affine
from elevations import write
from lazy import check_place, no_compute
from odc.geo.geobox import GeoBox
from scipy.interpolate import RegularGridInterpolator

import fifesim
from fifesim.grids import grid as grids
from fifesim.grids import projection, warp
from fifesim.grids.source import open_source

FIFE = (-96.63, 38.98, -96.45, 39.13)
GRID = fifesim.fife_site(10.0, window=((300, 400), (500, 620)))


def hills(rows, columns):
    """Values that vary smoothly over several file cells and differ everywhere."""
    i, j = np.arange(rows)[:, None], np.arange(columns)
    return 2 + np.sin(i / 5) + 0.5 * np.cos(j / 7 + i / 11)


def on_grid(raster, grid, chunks=None):
    """Leaf area index on a grid."""
    return warp.onto_grid(open_source(raster, "lai"), grid, chunks)


def write_geographic(path, values=None, crs="EPSG:4326", cell=0.0002):
    """Write a file in degrees around the grid, with cells of about 20 m."""
    west, north = -96.6, 39.12
    values = hills(500, 500) if values is None else values
    return write(path, values, Affine(cell, 0, west, 0, -cell, north), crs), values


def interpolated(path, values, grid, transform):
    """Bilinear interpolation between file cell centres, at grid cell centres; NaN beyond the outermost centres."""
    with rasterio.open(path) as source:
        affine = source.transform
    rows, columns = np.arange(values.shape[0]) + 0.5, np.arange(values.shape[1]) + 0.5
    place = grids.coordinates(grid)
    x, y = np.meshgrid(place["x"].values, place["y"].values)
    x, y = transform(x, y)
    column, row = ~affine * (x, y)
    return RegularGridInterpolator((rows, columns), values, bounds_error=False)((row, column))


UNKNOWN = "+proj=utm +zone=14 +ellps=clrk66 +units=m +no_defs"


def test_unknown_datum_is_rejected(tmp_path):
    with pytest.raises(ValueError, match=r"no operation of known accuracy.*EPSG:26914.*ballpark.*projsync"):
        projection.operation(UNKNOWN, "EPSG:26914", FIFE)
    path = write(tmp_path / "lai.tif", hills(400, 400), Affine(10, 0, 709000, 0, -10, 4332000), UNKNOWN)
    with pytest.raises(ValueError, match="no operation of known accuracy"):
        fifesim.open_lai(path, GRID)


# Radius of the sphere of MODIS and VIIRS land products. [m]
RADIUS = 6371007.181

# Landsat ARD of collection 1 states an ellipsoid that is not the ellipsoid of its datum.
ARD = (
    'PROJCS["Albers",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378140,298.2569999999957,'
    'AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433],'
    'AUTHORITY["EPSG","4326"]],PROJECTION["Albers_Conic_Equal_Area"],PARAMETER["standard_parallel_1",29.5],'
    'PARAMETER["standard_parallel_2",45.5],PARAMETER["latitude_of_center",23],PARAMETER["longitude_of_center",-96],'
    'PARAMETER["false_easting",0],PARAMETER["false_northing",0],UNIT["metre",1,AUTHORITY["EPSG","9001"]]]'
)
# UTM zone 14 in the spelling of ESRI, with a name of the datum that PROJ does not know.
ESRI = (
    'PROJCS["UTM_14",GEOGCS["GCS",DATUM["North_American_1983",SPHEROID["GRS_1980",6378137.0,298.257222101]],'
    'PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],'
    'PARAMETER["False_Easting",500000.0],PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",-99.0],'
    'PARAMETER["Scale_Factor",0.9996],PARAMETER["Latitude_Of_Origin",0.0],UNIT["Meter",1.0]]'
)
LONDON = fifesim.grid_at("EPSG:32630", 699000, 5710000, 3000, 3000, 30)
BERN = fifesim.grid_at("EPSG:32632", 383000, 5201000, 3000, 3000, 30)
ALASKA = fifesim.grid_at("EPSG:32606", 466000, 7190000, 3000, 3000, 30)
KANSAS = fifesim.fife_site(30, window=((100, 200), (100, 200)))

# CRS of a file, an equivalent one for pyproj or the radius of a sphere, and a grid.
FOREIGN = {
    "MODIS": (f"+proj=sinu +R={RADIUS} +units=m +no_defs", RADIUS, KANSAS),
    "MODIS of GDAL 2": (f"+proj=sinu +a={RADIUS} +b={RADIUS} +units=m +nadgrids=@null +wktext", RADIUS, LONDON),
    "VIIRS": ("ESRI:53008", 6371000.0, ALASKA),
    "Landsat ARD": (ARD, "+proj=aea +lat_0=23 +lon_0=-96 +lat_1=29.5 +lat_2=45.5 +a=6378140 +rf=298.257", KANSAS),
    "CONUS Albers": ("EPSG:5070", "EPSG:5070", KANSAS),
    "EASE-Grid 2.0, global": ("EPSG:6933", "EPSG:6933", LONDON),
    "EASE-Grid 2.0, north": ("EPSG:6931", "EPSG:6931", ALASKA),
    "MGRS tile": ("EPSG:32614", "EPSG:32614", KANSAS),
    "UTM of ESRI": (ESRI, "EPSG:26914", KANSAS),
    "stated shift": ("+proj=utm +zone=14 +ellps=GRS80 +towgs84=0,0,0", "EPSG:26914", KANSAS),
    "British National Grid": ("EPSG:27700", "EPSG:27700", LONDON),
    "Swiss LV95": ("EPSG:2056", "EPSG:2056", BERN),
    "LAEA Europe": ("+proj=laea +lat_0=52 +lon_0=10 +x_0=4321000 +y_0=3210000 +datum=WGS84", "EPSG:3035", BERN),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_cells_of_foreign_maps_are_in_the_right_place(tmp_path, name):
    """
    The file holds its own column or row, so that each cell of the grid states where it was read.

    Geodetic latitude is used on spheres: y is the radius times the latitude. The tolerance is 0.5 m.
    """
    crs, equal, grid = FOREIGN[name]
    place = grids.coordinates(grid)
    x, y = np.meshgrid(place["x"].values, place["y"].values)
    if isinstance(equal, float):
        longitude, latitude = np.radians(pyproj.Transformer.from_crs(grid.crs, 4326, always_xy=True).transform(x, y))
        x, y = equal * longitude * np.cos(latitude), equal * latitude
    else:
        x, y = pyproj.Transformer.from_crs(grid.crs, equal, always_xy=True).transform(x, y)
    cell = 463.3127
    affine = Affine(cell, 0, x.min() // cell * cell - 2 * cell, 0, -cell, y.max() // cell * cell + 2 * cell)
    shape = [int(np.ptp(each) / cell) + 5 for each in (y, x)]
    rows, columns = np.indices(shape) + 0.5
    for values, expected in ((columns, (x - affine.c) / cell), (rows, (affine.f - y) / cell)):
        path = write(tmp_path / "map.tif", values, affine, crs)
        np.testing.assert_allclose(on_grid(path, grid), expected, rtol=0, atol=1e-3)
        opened = rioxarray.open_rasterio(path)[0]
        np.testing.assert_allclose(on_grid(opened, grid), expected, rtol=0, atol=1e-3)


@pytest.mark.parametrize(
    "crs, name",
    [
        ("+proj=utm +zone=14 +ellps=WGS84", "Unknown based on WGS 84 ellipsoid"),  # not EPSG:32614
        ("+proj=utm +zone=14 +ellps=clrk66 +nadgrids=@absent.gsb", "Clarke 1866"),
        ("+proj=eqc +R=1737400", "unknown"),  # the Moon
        ("+proj=lcc +lat_1=30 +lat_2=60 +R=6370000 +towgs84=0,0,0", "unknown"),  # PROJ is 20 km off
        (ARD.replace("WGS_1984", "Clarke").replace(',AUTHORITY["EPSG","6326"]', ""), "Clarke"),
    ],
)
def test_unknown_datum_is_rejected_by_its_own_name(crs, name):
    for ends in ((crs, "EPSG:26914"), ("EPSG:26914", crs)):
        with pytest.raises(ValueError, match=r"no operation of known accuracy.*gdal_edit.py -a_srs") as caught:
            projection.operation(*ends, FIFE)
        assert name in str(caught.value) and "EPSG:32614" not in str(caught.value)


def test_radius_that_proj_ignores_is_rejected():
    """SR-ORG:6974 states the sphere of MODIS by parameters of the projection, and WGS 84: 18 km off."""
    wkt = ARD.replace('PARAMETER["false_easting"', 'PARAMETER["semi_major",6371007.181],PARAMETER["false_easting"')
    with pytest.raises(ValueError, match=r"Albers.*semi_major.*gdal_edit.py -a_srs"):
        projection.operation(wkt, "EPSG:26914", FIFE)


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:4269"])
def test_degrees_onto_metres_is_bilinear_interpolation(tmp_path, crs):
    """
    The warper approximates rows by straight lines over 32 cells. Over 320 m these deviate by 2 mm, 1e-4 of a file cell.

    The values change by at most 0.3 per cell.
    """
    path, values = write_geographic(tmp_path / "lai.tif", crs=crs)
    found = on_grid(path, GRID)
    pipeline = projection.operation("EPSG:26914", crs, FIFE)

    def to_degrees(x, y):
        latitude, longitude = pyproj.Transformer.from_pipeline(pipeline).transform(x, y)
        return longitude, latitude

    expected = interpolated(path, values, GRID, to_degrees)
    assert np.isfinite(expected).all()
    np.testing.assert_allclose(found, expected, rtol=0, atol=3e-5)
    check_place(found, GRID.crs)


@pytest.mark.parametrize("cell, shift", [(30.0, 0.0), (30.0, 11.3), (10.0, 3.3)])
def test_metres_onto_metres_is_bilinear_interpolation(tmp_path, cell, shift):
    affine = Affine(cell, 0, 709000 + shift, 0, -cell, 4332000 - shift)
    values = hills(*(np.array([4000, 4000]) // cell).astype(int))
    path = write(tmp_path / "lai.tif", values, affine, "EPSG:26914")
    expected = interpolated(path, values, GRID, lambda x, y: (x, y))
    np.testing.assert_allclose(on_grid(path, GRID), expected, rtol=0, atol=1e-6)


def test_file_on_the_grid_is_read_unchanged(tmp_path):
    values = hills(100, 120)
    path = write(tmp_path / "lai.tif", values, GRID.affine, "EPSG:26914")
    np.testing.assert_array_equal(on_grid(path, GRID), values)


def test_larger_cells_hold_means(tmp_path):
    values = np.random.default_rng(0).random((500, 600))
    path = write(tmp_path / "lai.tif", values, GRID.affine * Affine.scale(0.2), "EPSG:26914")
    means = values.reshape(100, 5, 120, 5).mean(axis=(1, 3))
    np.testing.assert_allclose(on_grid(path, GRID), means, rtol=0, atol=1e-12)


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:26914"])
def test_chunks_and_windows_change_nothing(tmp_path, crs):
    grid = fifesim.fife_site(5.0, window=((600, 1300), (1000, 1700)))
    if crs == "EPSG:4326":
        path, _ = write_geographic(tmp_path / "lai.tif")
    else:
        path = write(tmp_path / "lai.tif", hills(300, 300), Affine(17, 0, 709003, 0, -17, 4332000), crs)
    whole = on_grid(path, grid)
    assert np.isfinite(whole).any()
    for chunks in ("auto", 333, {"y": 101, "x": 700}):
        with no_compute():
            lazy = on_grid(path, grid, chunks)
        assert lazy.chunks is not None
        xr.testing.assert_identical(lazy.compute(), whole)
    part = on_grid(path, grid[200:420, 10:600])
    xr.testing.assert_identical(part, whole[200:420, 10:600].assign_coords(spatial_ref=part["spatial_ref"]))


@pytest.mark.parametrize("dtype, nodata", [("float32", -999.0), ("float64", np.nan), ("int16", -1)])
def test_no_data_stays_no_data(tmp_path, dtype, nodata):
    """Missing cells do not leak into their neighbours as numbers."""
    values = np.full((400, 400), 3.0)
    values[150:170, 200:260] = np.nan
    affine = Affine(10, 0, GRID.affine.c - 1400, 0, -10, GRID.affine.f + 1200)
    path = write(tmp_path / "lai.tif", values, affine, "EPSG:26914", nodata=nodata, dtype=dtype)
    expected = values[120:220, 140:260]
    np.testing.assert_array_equal(on_grid(path, GRID), expected)
    finer = on_grid(path, fifesim.fife_site(4.0, window=((750, 1000), (1250, 1550))))
    np.testing.assert_allclose(finer.values[np.isfinite(finer)], 3.0, rtol=1e-14)
    assert np.isnan(finer[90, 200]) and np.isfinite(finer[10, 10])


def test_cells_beyond_the_file_are_missing(tmp_path):
    affine = Affine(10, 0, GRID.affine.c + 300, 0, -10, GRID.affine.f - 400)
    path = write(tmp_path / "lai.tif", hills(400, 400), affine, "EPSG:26914")
    found = on_grid(path, GRID)
    assert np.isnan(found[:40]).all() and np.isnan(found[:, :30]).all()
    assert np.isfinite(found[40:, 30:]).all()


def test_nad27_file_is_placed_correctly(tmp_path):
    """A bright square in NAD27 is found at its true location, not one TM pixel away."""
    values = np.zeros((400, 400))
    values[200:210, 200:210] = 1.0
    path = write(tmp_path / "lai.tif", values, Affine(10, 0, 709000, 0, -10, 4332000), "EPSG:26714")
    pipeline = projection.operation("EPSG:26714", "EPSG:26914", FIFE)
    east, north = pyproj.Transformer.from_pipeline(pipeline).transform(711050.0, 4329950.0)
    grid = fifesim.grid_at("EPSG:26914", 710700.0, 4330600.0, 800.0, 800.0, 2.0)
    found = on_grid(path, grid)
    assert float((found * found["x"]).sum() / found.sum()) == pytest.approx(east, abs=0.5)
    assert float((found * found["y"]).sum() / found.sum()) == pytest.approx(north, abs=0.5)


def test_grids_not_in_metres_are_rejected(tmp_path):
    path = write(tmp_path / "hills.tif", hills(40, 40), GRID.affine, "EPSG:26914")
    degrees = GeoBox((9, 9), Affine(0.001, 0, -97, 0, -0.001, 39), "EPSG:4326")
    for raster in (path, fifesim.open_lai(path, GRID)):
        with pytest.raises(ValueError, match="the grid is in a geographic CRS"):
            on_grid(raster, degrees)


@pytest.mark.parametrize("times", [8, 40])
def test_far_finer_files_are_averaged_block_by_block(tmp_path, times):
    """Means are exact and identical in every window and chunk; no whole tile is read at once."""
    grid = fifesim.grid_at("EPSG:26914", 708000.0, 4332000.0, 400.0, 360.0, 10.0)
    values = np.random.default_rng(0).random((36 * times, 40 * times)).astype("float32")
    path = write(tmp_path / "fine.tif", values, grid.affine * Affine.scale(1 / times), "EPSG:26914", dtype="float32")
    means = values.astype(float).reshape(36, times, 40, times).mean(axis=(1, 3))
    whole = on_grid(path, grid)
    np.testing.assert_allclose(whole, means, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(on_grid(path, grid[7:29, 11:30]), whole[7:29, 11:30])
    np.testing.assert_array_equal(on_grid(path, grid, chunks=13), whole)


def test_block_size_limits_the_number_of_cells_read():
    assert warp._block_size(warp._MUCH_FINER, 512) == 512
    assert [warp._block_size(cells, 512) for cells in (7, 64, 65, 2048, 1e6, np.nan)] == [32, 32, 16, 1, 1, 32]


def test_grid_cells_with_too_many_file_cells_are_rejected(tmp_path):
    path = tmp_path / "finest.tif"
    profile = {"driver": "GTiff", "width": 100_000, "height": 100_000, "count": 1, "dtype": "uint8", "sparse_ok": True}
    profile |= {"tiled": True, "blockxsize": 8192, "blockysize": 8192, "crs": "EPSG:26914"}
    with rasterio.open(path, "w", **profile, transform=Affine(0.01, 0, 708000, 0, -0.01, 4332000)):
        pass
    with pytest.raises(ValueError, match=r"finest\.tif is far finer than the cells.*gdalwarp -r average -tr"):
        fifesim.open_lai(path, fifesim.grid_at("EPSG:26914", 708000.0, 4332000.0, 900.0, 900.0, 300.0))


@pytest.mark.parametrize("south_up", [False, True])
@pytest.mark.parametrize("kind", ["same", "coarser", "degrees"])
def test_array_is_warped_like_its_file(tmp_path, kind, south_up):
    """Results are identical to the bit, in memory or lazy and under any chunks."""
    if kind == "degrees":
        path, _ = write_geographic(tmp_path / "lai.tif")
    else:
        cell = 10 if kind == "same" else 33
        path = write(tmp_path / "lai.tif", hills(120, 130), Affine(cell, 0, 709450, 0, -cell, 4331500), "EPSG:26914")
    raster = xr.DataArray(rioxarray.open_rasterio(path, masked=True))
    raster = raster.isel(y=slice(None, None, -1)) if south_up else raster
    whole = on_grid(path, GRID)
    assert np.isfinite(whole).mean() > 0.3
    tolerance = {"rtol": 0, "atol": 1e-9 if south_up else 0}
    found = on_grid(raster.squeeze("band"), GRID)
    np.testing.assert_allclose(found, whole, **tolerance)
    with no_compute():
        lazy = on_grid(raster.squeeze("band").chunk({"y": 50, "x": 70}), GRID, {"y": 33, "x": 41})
    np.testing.assert_array_equal(lazy.compute(scheduler="synchronous"), found)
    check_place(lazy, GRID.crs)


def test_source_without_overlap_is_rejected_with_its_location(tmp_path):
    path = write(tmp_path / "away.tif", hills(40, 40), Affine(10, 0, 600000, 0, -10, 4332000), "EPSG:26914")
    with pytest.raises(ValueError, match=r"away\.tif does not overlap the grid, which spans"):
        fifesim.open_lai(path, GRID)
    away = xr.DataArray(np.ones((4, 4)), dims=("y", "x"), name="mine")
    grid = fifesim.grid_at("EPSG:32735", 620000.0, 7220000.0, 40.0, 40.0, 10.0)
    with pytest.raises(ValueError, match=r"mine does not overlap .* it spans 620000 to 620040 E .*\(latitude -25.13, "):
        on_grid(grids.place(away, grid), GRID)
