"""Images of instruments that sweep several lines at once, and that sum samples and delete lines on board."""

import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, in_chunks, no_compute

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.grids import directions
from fifesim.grids import grid as grids
from fifesim.sensor.description.instruments import instrument

# Around the central meridian, where the rows of the map run across a track to the south.
CELL = 100.0
GRID = fifesim.grid_at("EPSG:32614", 484000.0, 4346000.0, 32000.0, 26000.0, CELL)
# Scan angles of 30 and 55 degrees.
OFFSETS = {"MODIS": {0: 0.0, 30: 415e3, 55: 1140e3}, "VIIRS": {0: 0.0, 30: 486e3, 55: 1404e3}}
BANDS = {"MODIS": "MODIS1", "VIIRS": "I1"}


def plane(x, y):
    return 100 + 1e-3 * (x - 500000) + 2e-3 * (y - 4333000)


def scene(name, values=plane):
    x, y = np.meshgrid(*(grids.coordinates(GRID)[axis].values for axis in ("x", "y")))
    array = xr.DataArray(values(x, y)[None], dims=("band", "y", "x"), coords={"band": [BANDS[name]]})
    array.attrs["units"] = "W m-2 sr-1 um-1"
    return directions.with_geometry(grids.place(array, GRID), Geometry(40.0, 120.0))


def swept(name, angle, values=plane, **options):
    view = {"nadir_offset": OFFSETS[name][angle], "heading": 180.0, "view_tolerance": 180, "min_valid": 0.0}
    return fifesim.sense_swath(scene(name, values), name, quantise=False, **view, **options)


def scan_angle_of(image, name):
    altitude = instrument(name).altitude
    return np.degrees(np.arcsin(np.sin(np.radians(image["vza"])) * 6371e3 / (6371e3 + altitude)))


@pytest.mark.parametrize(
    ("name", "angle", "along", "across"),
    [
        ("MODIS", 0, 250.0, 250.0),
        ("MODIS", 30, 294.2, 353.8),
        ("MODIS", 55, 501.5, 1207.5),
        ("VIIRS", 0, 371.0, 388.0),
        ("VIIRS", 30, 437.4, 555.0),
        ("VIIRS", 55, 769.0, 706.0),
    ],
)
def test_lines_and_samples_lie_as_far_apart_as_published(name, angle, along, across):
    """
    MODIS after Ichoku and Kaufman (2005); VIIRS at nadir after its ATBD.

    At 30 and 55 degrees the ATBD's sizes at nadir grow with the slant range: the sides of the triangle of Earth's
    centre, ground and satellite, and one instead of three samples in the sum.
    """
    image = swept(name, angle)
    near = (abs(scan_angle_of(image, name) - angle) < 0.3).values
    assert near.any()
    steps = {axis: np.hypot(image["x"].diff(axis), image["y"].diff(axis)).values for axis in ("line", "sample")}
    swept_together = (image["sweep"].diff("line") == 0).values
    down, right = steps["line"][swept_together], steps["sample"]
    assert np.median(down[near[1:][swept_together]]) == pytest.approx(along, rel=0.03)
    assert np.median(right[near[:, 1:]]) == pytest.approx(across, rel=0.03)


@pytest.mark.parametrize(("name", "height"), [("MODIS", 10_000.0), ("VIIRS", 11_871.0)])
def test_sweeps_follow_each_other_by_their_height_at_nadir_and_overlap_at_the_edge(name, height):
    for angle in (0, 55):
        image = swept(name, angle)
        # Flying south; the middle of each whole sweep.
        middle = (-image["y"].isel(sample=0)).groupby("sweep").mean()
        whole = image["line"].groupby("sweep").count() == instrument(name).scan.lines
        aside = OFFSETS[name][angle] / 6371e3
        np.testing.assert_allclose(middle[whole].diff("sweep"), height * np.cos(aside), rtol=5e-3)
        jump = -image["y"].diff("line").isel(sample=0)[image["sweep"].diff("line").values > 0]
        assert np.all(jump < 0) if angle else np.all(jump > 200)


def test_deleted_pixels_are_missing_and_say_so():
    image = swept("VIIRS", 55)
    deleted = image["deleted"].values
    assert np.isnan(image.values[0][deleted]).all()
    detector = image["line"].values % 32
    assert (deleted.all(axis=1) == (np.minimum(detector, 31 - detector) < 4)).all()
    inside = (abs(image["x"] - 500000) < 15000) & (abs(image["y"] - 4333000) < 12000)
    assert np.isfinite(image.values[0][inside.values & ~deleted]).all() and (inside.values & deleted).any()
    assert not swept("VIIRS", 0)["deleted"].any()
    assert "deleted" not in swept("MODIS", 55).coords
    view = {"nadir_offset": OFFSETS["VIIRS"][55], "view_tolerance": 180, "min_valid": 0.0}
    numbers = fifesim.sense_swath(scene("VIIRS"), "VIIRS", **view).values[0]
    assert (numbers[deleted] == 0).all() and (numbers[inside.values & ~deleted] > 0).all()


@pytest.mark.parametrize("name", ["MODIS", "VIIRS"])
@pytest.mark.parametrize("angle", [0, 55])
def test_pixels_of_all_sweeps_lie_where_they_say(name, angle):
    image = swept(name, angle)
    inside = (abs(image["x"] - 500000) < 13000) & (abs(image["y"] - 4333000) < 11000)
    difference = (image[0] - plane(image["x"], image["y"])).where(inside)
    assert float(difference.notnull().mean()) > 0.3
    # A hundredth of a pixel of about 1 km.
    assert float(abs(difference).max()) < 0.02


def test_footprints_are_as_wide_as_the_samples_that_are_summed():
    """A strip one cell wide along the track: the largest mean is the cell over the width of the footprint."""
    widths = {}
    for angle in (31.2, 32.3):
        gamma = np.radians(angle_at_ground(angle) - angle)
        view = {"nadir_offset": 6371e3 * gamma, "heading": 180.0, "view_tolerance": 180, "min_valid": 0.0}
        strips = scene("VIIRS", lambda x, y: np.where(np.abs((x - 484050) % 4000) < 1, 1000.0, 0.0))
        image = fifesim.sense_swath(strips, "VIIRS", quantise=False, **view)
        steps = np.hypot(image["x"].diff("sample"), image["y"].diff("sample"))
        zone = abs(scan_angle_of(image, "VIIRS") - angle).isel(sample=slice(1, None)) < 0.4
        middle = (abs(image["y"] - 4333000) < 8000).isel(sample=slice(1, None)) & zone
        largest = float(image[0].isel(sample=slice(1, None)).where(middle).max())
        widths[angle] = 1000 * CELL / largest
        assert widths[angle] == pytest.approx(float(steps.where(middle).median()), rel=0.03)
    assert widths[31.2] / widths[32.3] == pytest.approx(1.5 * 0.97, rel=0.03)


def angle_at_ground(scan_angle):
    return np.degrees(np.arcsin((6371 + 824) / 6371 * np.sin(np.radians(scan_angle))))


@pytest.mark.parametrize("name", ["MODIS", "VIIRS"])
@pytest.mark.parametrize("method", ["nearest", "mean"])
def test_a_map_of_overlapping_sweeps_has_no_gaps(name, method):
    """Deleted lines leave no holes, and pixels of neighbouring sweeps keep their places."""
    image = swept(name, 55)
    around = fifesim.grid_at("EPSG:32614", 490000.0, 4341000.0, 20000.0, 16000.0, 500.0)
    on_map = image.fifesim.grid_swath(around, method)
    x, y = np.meshgrid(on_map["x"], on_map["y"])
    assert np.isfinite(on_map).all()
    # The nearest centre is half a pixel away at most. Means with edges that sweeps share are up to 3.3 away (MODIS).
    limit = {"nearest": 2e-3 * 400 + 1e-3 * 650, "mean": 0.5}[method]
    assert float(abs(on_map[0] - plane(x, y)).max()) < limit


def test_deleted_pixels_are_nearest_to_no_cell():
    image = swept("VIIRS", 55)
    around = fifesim.grid_at("EPSG:32614", 490000.0, 4341000.0, 20000.0, 16000.0, 500.0)
    assert np.isnan(image.drop_vars("deleted").fifesim.grid_swath(around)).any()


@pytest.mark.parametrize("chunks", [CHUNKS, ODD_CHUNKS])
def test_zones_and_sweeps_are_the_same_in_any_chunks(chunks, monkeypatch):
    monkeypatch.setattr("fifesim.sensor.scan_labels._SWATH_BLOCK", 11)
    view = {"nadir_offset": 525e3, "view_tolerance": 180, "min_valid": 0.0}
    rough = scene("VIIRS", lambda x, y: np.random.default_rng(3).uniform(10, 90, x.shape))
    whole = fifesim.sense_swath(rough, "VIIRS", **view)
    assert len(set(np.unique(whole["deleted"].sum("line")))) == 2
    with no_compute():
        lazy = fifesim.sense_swath(in_chunks(rough, chunks), "VIIRS", **view)
    xr.testing.assert_identical(lazy.compute(), whole)


def test_indices_and_files_of_a_sweep_keep_what_a_map_needs(tmp_path):
    image = swept("VIIRS", 55)
    image.to_netcdf(tmp_path / "sweep.nc")
    with xr.open_dataarray(tmp_path / "sweep.nc", decode_coords="all") as back:
        xr.testing.assert_equal(back, image)
        assert back["deleted"].dtype == bool
    view = {"nadir_offset": OFFSETS["VIIRS"][55], "view_tolerance": 180, "min_valid": 0.0}
    pair = xr.concat([scene("VIIRS"), 2 * scene("VIIRS").assign_coords(band=["I2"])], "band", combine_attrs="override")
    ndvi = fifesim.sense_swath(pair.assign_attrs(units="W m-2 sr-1 um-1"), "VIIRS", **view).fifesim.ndvi()
    assert {"sweep", "deleted"} <= set(ndvi.coords)
