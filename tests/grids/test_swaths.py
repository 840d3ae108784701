"""Gridding of swath images onto a map."""

import numpy as np
import pytest
import xarray as xr
from lazy import check_place, in_chunks, no_compute

import fifesim
from fifesim.grids import grid as grids
from fifesim.grids import projection
from fifesim.grids.swaths import grid_swath

GRID = fifesim.grid_at("EPSG:26914", 705000.0, 4334000.0, 1500.0, 1200.0, (30.0, 25.0))


def swath(dtype=float):
    """Thirty by forty pixels of about 33 m, rotated by about 0.1 rad, with a plane of values."""
    line, sample = np.mgrid[0:30, 0:40]
    x, y = 705180.7 + 31.3 * sample - 4.1 * line, 4333833.3 - 33.7 * line - 3.9 * sample
    values = np.stack([1 + line + 40 * sample, 5 + line % 200]).astype(dtype) % 250
    dims = ("line", "sample")
    coords = {"band": ["TM3", "TM4"], "line": np.arange(30) - 7, "x": (dims, x), "y": (dims, y), "sza": 31.0}
    coords |= {
        "vza": (dims, 30 + sample / 10, {"units": "degree"}),
        "spatial_ref": grids.coordinates(GRID)["spatial_ref"],
    }
    attrs = {"units": "1", "history": "sense_swath"}
    return xr.DataArray(values, dims=("band", *dims), coords=coords, name="dn", attrs=attrs)


def test_each_cell_takes_the_nearest_pixel():
    image = swath()
    out = grid_swath(image, GRID)
    check_place(out, GRID.crs)
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
    out = grid_swath(swath(np.uint8), GRID)
    assert out.dtype == np.uint8 and (out == 0).any() and int(out.max()) > 200
    with pytest.raises(ValueError, match=r"digital numbers have no mean.*\.to_radiance\(\)"):
        grid_swath(swath(np.uint8), GRID, "mean")


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
        whole = grid_swath(image, GRID, method)
        monkeypatch.setattr("fifesim.grids.swaths._BLOCK", 17)
        xr.testing.assert_identical(grid_swath(image, GRID, method), whole)
        for chunks in ({"line": 7, "sample": 11}, {"band": 1, "line": 30}):
            with no_compute():
                lazy = grid_swath(in_chunks(image, chunks), GRID, method)
            assert lazy.chunks is not None and lazy["vza"].chunks is not None
            xr.testing.assert_identical(lazy.compute(), whole)
    times = np.array(["2022-05-01T17:00", "2022-06-01T17:00"], "M8[ns]")
    passes = [swath().assign_coords(sza=sza) * share for sza, share in ((31.0, 1.0), (27.0, 2.0))]
    season = xr.concat(passes, dim=xr.IndexVariable("time", times), coords="different", compat="equals")
    out = season.fifesim.grid_swath(GRID)
    assert out.dims == ("time", "band", "y", "x") and out["sza"].values.tolist() == [31.0, 27.0]
    for number, one in enumerate(passes):
        np.testing.assert_array_equal(out[number], grid_swath(one, GRID))


def test_latitude_and_longitude_are_enough():
    """This works for any swath; here NAD83 and WGS 84 differ by a metre."""
    image = swath()
    longitude, latitude = projection.carry(
        projection.operation("EPSG:26914", "EPSG:4326"), "EPSG:26914", "EPSG:4326", image["x"], image["y"]
    )
    dims = ("line", "sample")
    other = image.drop_vars(["x", "y", "spatial_ref"])
    other = other.assign_coords(latitude=(dims, np.asarray(latitude)), longitude=(dims, np.asarray(longitude)))
    np.testing.assert_array_equal(grid_swath(other, GRID), grid_swath(image, GRID))
    with pytest.raises(ValueError, match="the pixel positions are unknown"):
        grid_swath(image.drop_vars("x"), GRID)


def test_map_in_another_crs_shows_the_same_ground():
    image = swath().isel(band=0)
    image = image.copy(data=image["y"].values)
    north = fifesim.grid_at("EPSG:32614", 705200.0, 4333700.0, 900.0, 600.0, 30.0)
    out = grid_swath(image, north)
    assert out.rio.crs.to_epsg() == 32614
    # Tolerance: half a pixel, plus the difference between NAD83 and WGS 84.
    assert float(abs(out - out["y"]).max()) < 27
    far = fifesim.grid_at("EPSG:26914", 725000.0, 4334000.0, 1500.0, 1200.0, 30.0)
    with pytest.raises(ValueError, match="no pixel of the scan lies on the grid, which spans 725000 to 726500 E"):
        grid_swath(image, far)
