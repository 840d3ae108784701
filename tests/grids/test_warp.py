"""Files and images of a scan onto grids, compared with an independent interpolation and with brute force."""

import tomllib
from pathlib import Path

import numpy as np
import pyproj
import pytest
import rioxarray
import xarray as xr
from affine import Affine
from elevations import write
from lazy import check_place, in_chunks, no_compute
from scipy.interpolate import RegularGridInterpolator

import fifesim
from fifesim.grids import grid as grids
from fifesim.grids import projection, warp
from fifesim.grids.source import open_source
from fifesim.grids.swaths import grid_swath

FOREIGN = tomllib.loads((Path(__file__).parents[1] / "data" / "foreign_rasters.toml").read_text(encoding="utf-8"))
DEGREES, METRES = Affine(0.0002, 0, -96.6, 0, -0.0002, 39.12), Affine(30, 0, 709000, 0, -30, 4332000)
FIFE = (-96.63, 38.98, -96.45, 39.13)
GRID = fifesim.fife_site(10.0, window=((300, 400), (500, 620)))


def hills(rows, columns):
    """Values that vary smoothly over several file cells and differ everywhere."""
    i, j = np.arange(rows)[:, None], np.arange(columns)
    return 2 + np.sin(i / 5) + 0.5 * np.cos(j / 7 + i / 11)


def on_grid(raster, grid, chunks=None):
    """Leaf area index on a grid."""
    return warp.onto_grid(open_source(raster, "lai"), grid, chunks)


@pytest.mark.parametrize("name", FOREIGN["maps"])
def test_cells_of_foreign_maps_are_in_the_right_place(tmp_path, name):
    """
    The file holds its own column or row, so that each cell of the grid states where it was read.

    Geodetic latitude is used on spheres: y is the radius times the latitude. The tolerance is 0.5 m.
    """
    crs, equal, site = FOREIGN["maps"][name].values()
    grid = fifesim.grid_at(*FOREIGN["sites"][site], 3000, 3000, 30)
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


def test_unknown_datum_is_rejected_by_its_own_name(tmp_path):
    for crs, name in FOREIGN["unknown"].items():
        for ends in ((crs, "EPSG:26914"), ("EPSG:26914", crs)):
            with pytest.raises(ValueError, match=r"gdal_edit.py -a_srs") as caught:
                projection.operation(*ends, FIFE)
            assert name in str(caught.value) and "EPSG:32614" not in str(caught.value)
    path = write(tmp_path / "lai.tif", hills(40, 40), METRES, next(iter(FOREIGN["unknown"])))
    with pytest.raises(ValueError, match="no operation of known accuracy"):
        fifesim.open_lai(path, GRID)


@pytest.mark.parametrize(
    ("crs", "affine"),
    [
        ("EPSG:4326", DEGREES),
        ("EPSG:4269", DEGREES),
        ("EPSG:26714", METRES),
        ("EPSG:26914", METRES),
        ("EPSG:26914", Affine(30, 0, 709011.3, 0, -30, 4331988.7)),
        ("EPSG:26914", Affine(10, 0, 709003.3, 0, -10, 4331996.7)),
    ],
)
def test_finer_grid_is_bilinear_interpolation(tmp_path, crs, affine):
    """
    The warper approximates rows by straight lines over 32 cells. Over 320 m these deviate by 2 mm, 1e-4 of a file cell.

    The values change by at most 0.3 per cell.
    """
    values = hills(500, 500)
    found = on_grid(write(tmp_path / "lai.tif", values, affine, crs), GRID)
    place, centres = grids.coordinates(GRID), np.arange(500) + 0.5
    x, y = np.meshgrid(place["x"].values, place["y"].values)
    x, y = projection.carry(projection.operation("EPSG:26914", crs, FIFE), "EPSG:26914", crs, x, y)
    column, row = ~affine * (x, y)
    expected = RegularGridInterpolator((centres, centres), values)((row, column))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 if crs == "EPSG:26914" else 3e-5)
    check_place(found, GRID.crs)


def test_chunks_and_windows_change_nothing(tmp_path):
    grid = fifesim.fife_site(5.0, window=((600, 1300), (1000, 1700)))
    path = write(tmp_path / "lai.tif", hills(500, 500), DEGREES, "EPSG:4326")
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


@pytest.mark.parametrize("times", [1, 5, 40])
def test_finer_files_are_averaged(tmp_path, times):
    """Means are exact and identical in every window and chunk; files on the grid are read unchanged."""
    grid = fifesim.grid_at("EPSG:26914", 708000.0, 4332000.0, 400.0, 360.0, 10.0)
    values = np.random.default_rng(0).random((36 * times, 40 * times)).astype("float32")
    path = write(tmp_path / "fine.tif", values, grid.affine * Affine.scale(1 / times), "EPSG:26914", dtype="float32")
    means = values.astype(float).reshape(36, times, 40, times).mean(axis=(1, 3))
    whole = on_grid(path, grid)
    np.testing.assert_allclose(whole, means, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(on_grid(path, grid[7:29, 11:30]), whole[7:29, 11:30])
    np.testing.assert_array_equal(on_grid(path, grid, chunks=13), whole)


@pytest.mark.parametrize("south_up", [False, True])
@pytest.mark.parametrize(("crs", "affine"), [("EPSG:26914", METRES), ("EPSG:4326", DEGREES)])
def test_array_is_warped_like_its_file(tmp_path, crs, affine, south_up):
    """Results are identical to the bit, in memory or lazy and under any chunks."""
    path = write(tmp_path / "lai.tif", hills(400, 400), affine, crs)
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


MAP = fifesim.grid_at("EPSG:26914", 705000.0, 4334000.0, 1500.0, 1200.0, (30.0, 25.0))


def swath(dtype=float):
    """Thirty by forty pixels of about 33 m, rotated by about 0.1 rad, with a plane of values."""
    line, sample = np.mgrid[0:30, 0:40]
    x, y = 705180.7 + 31.3 * sample - 4.1 * line, 4333833.3 - 33.7 * line - 3.9 * sample
    values = np.stack([1 + line + 40 * sample, 5 + line % 200]).astype(dtype) % 250
    dims = ("line", "sample")
    coords = {"band": ["TM3", "TM4"], "line": np.arange(30) - 7, "x": (dims, x), "y": (dims, y), "sza": 31.0}
    coords |= {
        "vza": (dims, 30 + sample / 10, {"units": "degree"}),
        "spatial_ref": grids.coordinates(MAP)["spatial_ref"],
    }
    attrs = {"units": "1", "history": "sense_swath"}
    return xr.DataArray(values, dims=("band", *dims), coords=coords, name="dn", attrs=attrs)


def test_each_cell_takes_the_nearest_pixel():
    image = swath()
    out = grid_swath(image, MAP)
    check_place(out, MAP.crs)
    x, y = np.meshgrid(out["x"], out["y"])
    away = np.hypot(x[..., None] - image["x"].values.ravel(), y[..., None] - image["y"].values.ravel())
    number, near = away.argmin(-1), away.min(-1) < 20
    for band in range(2):
        np.testing.assert_array_equal(out.values[band][near], image.values[band].ravel()[number][near])
    np.testing.assert_array_equal(out["vza"].values[near], image["vza"].values.ravel()[number][near])
    # The farthest corner of a pixel is 23 m from its centre (half a diagonal of 46 m).
    assert np.isnan(out.values[:, away.min(-1) > 26]).all() and np.isnan(out["vza"].values[away.min(-1) > 26]).all()
    assert near.mean() > 0.5 and np.isnan(out).any()
    assert out.attrs["history"] == "sense_swath\ngrid_swath: nearest" and float(out["sza"]) == 31
    assert not {"line", "sample", "latitude"} & set(out.coords)


def test_digital_numbers_stay_digital_numbers():
    out = grid_swath(swath(np.uint8), MAP)
    assert out.dtype == np.uint8 and (out == 0).any() and int(out.max()) > 200
    with pytest.raises(ValueError, match=r"digital numbers have no mean.*\.to_radiance\(\)"):
        grid_swath(swath(np.uint8), MAP, "mean")


def test_mean_of_a_plane_is_the_plane():
    """Pixels sample the plane at their centres; the covered part of a cell lies within one pixel of the plane."""
    image = swath()
    image = image.isel(band=0, drop=True).copy(data=0.02 * image["x"].values - 0.03 * image["y"].values)
    coarse = fifesim.grid_at("EPSG:26914", 705000.0, 4334000.0, 1500.0, 1200.0, 150.0)
    out = grid_swath(image, coarse, "mean", min_valid=1.0)
    plane = 0.02 * out["x"] - 0.03 * out["y"]
    inside = out.notnull().values
    assert inside.sum() > 20 and not inside.all()
    np.testing.assert_allclose(out.values[inside], plane.transpose("y", "x").values[inside], rtol=0, atol=0.15)
    assert float((out - plane).std()) < 0.05


def test_min_valid_selects_partly_covered_cells():
    image = swath()
    around = fifesim.grid_at("EPSG:26914", 704000.0, 4335000.0, 4000.0, 4000.0, 40.0)
    out = grid_swath(image, around, "mean", min_valid=0.0)
    full = grid_swath(image, around, "mean", min_valid=0.999)
    assert full.notnull().sum() < out.notnull().sum()
    area = 31.3 * 33.7 + 4.1 * 3.9
    covered = float(full.isel(band=0).notnull().sum()) * 1600
    assert covered < area * 1200 < float(out.isel(band=0).notnull().sum()) * 1600


def test_map_is_the_same_in_any_chunks_and_for_each_date(monkeypatch):
    for method, dtype in (("nearest", np.uint8), ("nearest", float), ("mean", float)):
        image = swath(dtype)
        monkeypatch.setattr("fifesim.grids.swaths._BLOCK", 512)
        whole = grid_swath(image, MAP, method)
        monkeypatch.setattr("fifesim.grids.swaths._BLOCK", 17)
        xr.testing.assert_identical(grid_swath(image, MAP, method), whole)
        for chunks in ({"line": 7, "sample": 11}, {"band": 1, "line": 30}):
            with no_compute():
                lazy = grid_swath(in_chunks(image, chunks), MAP, method)
            assert lazy.chunks is not None and lazy["vza"].chunks is not None
            xr.testing.assert_identical(lazy.compute(), whole)
    times = np.array(["2022-05-01T17:00", "2022-06-01T17:00"], "M8[ns]")
    passes = [swath().assign_coords(sza=sza) * share for sza, share in ((31.0, 1.0), (27.0, 2.0))]
    season = xr.concat(passes, dim=xr.IndexVariable("time", times), coords="different", compat="equals")
    out = season.fifesim.grid_swath(MAP)
    assert out.dims == ("time", "band", "y", "x") and out["sza"].values.tolist() == [31.0, 27.0]
    for number, one in enumerate(passes):
        np.testing.assert_array_equal(out[number], grid_swath(one, MAP))


def test_latitude_and_longitude_are_enough():
    """This works for any swath; here NAD83 and WGS 84 differ by a metre."""
    image = swath()
    longitude, latitude = projection.carry(
        projection.operation("EPSG:26914", "EPSG:4326"), "EPSG:26914", "EPSG:4326", image["x"], image["y"]
    )
    dims = ("line", "sample")
    other = image.drop_vars(["x", "y", "spatial_ref"])
    other = other.assign_coords(latitude=(dims, np.asarray(latitude)), longitude=(dims, np.asarray(longitude)))
    np.testing.assert_array_equal(grid_swath(other, MAP), grid_swath(image, MAP))
    with pytest.raises(ValueError, match="the pixel positions are unknown"):
        grid_swath(image.drop_vars("x"), MAP)


def test_map_in_another_crs_shows_the_same_ground():
    image = swath().isel(band=0)
    image = image.copy(data=image["y"].values)
    north = fifesim.grid_at("EPSG:32614", 705200.0, 4333700.0, 900.0, 600.0, 30.0)
    out = grid_swath(image, north)
    assert out.rio.crs.to_epsg() == 32614
    # Tolerance: half a pixel, plus the difference between NAD83 and WGS 84.
    assert float(abs(out - out["y"]).max()) < 27
    for west, north in ((725000.0, 4334000.0), (685000.0, 4334000.0), (705000.0, 4354000.0), (705000.0, 4314000.0)):
        far = fifesim.grid_at("EPSG:26914", west, north, 1500.0, 1200.0, 30.0)
        with pytest.raises(ValueError, match=f"no pixel of the scan lies on the grid, which spans {west:.0f} to "):
            grid_swath(image, far)
