"""View angles of a scan as rasters."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from lazy import check_place, no_compute

import fifesim
from fifesim.grids import cf
from fifesim.sensor.description.instrument_file import Scan
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response.scan import view_components
from fifesim.sensor.scan_labels import latitude_longitude

TM = instrument("TM")
WIDE = replace(
    TM,
    name="wide",
    altitude=833e3,
    scan=Scan("whiskbroom", max_angle=55.4),
    sources=TM.sources | {"scan": "Friedl1995"},
)
SITE = fifesim.fife_site(30.0)


def test_angles_are_those_of_each_cell():
    view = fifesim.scan_geometry(TM, SITE, nadir_offset=3e3, heading=193.0)
    rows, columns = np.meshgrid(*(np.arange(size) + 0.5 for size in SITE.shape), indexing="ij")
    track = fifesim.Track(view.attrs["track_latitude"], view.attrs["track_longitude"], view.attrs["track_heading"])
    east, north = view_components(track, *latitude_longitude(SITE, rows, columns), 705e3)
    vza, vaa = np.radians(view["vza"].values), np.radians(view["vaa"].values)
    np.testing.assert_allclose(np.sin(vza) * np.sin(vaa), east, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.sin(vza) * np.cos(vaa), north, rtol=0, atol=1e-9)
    for name in ("vza", "vaa"):
        check_place(view[name], SITE.crs)
        assert cf.attributes(name).items() <= view[name].attrs.items()


def test_the_track_may_cross_the_scene():
    """It lies 3 km to the left of the middle, which flying south is the east: the sensor changes sides."""
    view = fifesim.scan_geometry(TM, SITE, nadir_offset=3e3)
    middle = view.isel(y=250)
    assert middle["vza"].min() < 0.002
    nadir = float(middle["x"][int(middle["vza"].values.argmin())])
    assert nadir - float(middle["x"].mean()) == pytest.approx(3e3, abs=60)
    west, east = middle.isel(x=5), middle.isel(x=-5)
    assert float(west["vaa"]) == pytest.approx(90, abs=1.5) and float(east["vaa"]) == pytest.approx(270, abs=1.5)
    assert float(west["vza"]) == pytest.approx(np.degrees(np.arctan(10.4 / 705)), abs=0.1)


def test_lazy_angles_are_the_same_bits():
    whole = fifesim.scan_geometry(TM, SITE, nadir_offset=3e4)
    with no_compute():
        lazy = fifesim.scan_geometry(TM, SITE, nadir_offset=3e4, chunks={"y": 130, "x": 77})
    xr.testing.assert_identical(lazy.compute(), whole)


def test_a_wide_swath_ends():
    grid = fifesim.grid_at("EPSG:5070", -1.6e6, 2.2e6, 3.2e6, 4e5, 10e3)
    view = fifesim.scan_geometry(WIDE, grid, fifesim.Track(39.5, -96.0, 190.0))
    seen = np.isfinite(view["vza"].values)
    assert 0.5 < seen.mean() < 0.95
    np.testing.assert_array_equal(seen, np.isfinite(view["vaa"].values))
    assert float(view["vza"].max()) == pytest.approx(68.55, abs=0.3)
    rows, columns = np.meshgrid(*(np.arange(size) + 0.5 for size in grid.shape), indexing="ij")
    east, north = view_components(fifesim.Track(39.5, -96.0, 190.0), *latitude_longitude(grid, rows, columns), 833e3)
    sine = np.sin(np.radians(view["vza"].values))
    np.testing.assert_allclose(sine[seen], np.hypot(east, north)[seen], rtol=0, atol=1e-5)


def test_a_scene_that_is_not_seen_is_named():
    narrow = replace(WIDE, scan=Scan("whiskbroom", max_angle=7.5))
    with pytest.raises(ValueError, match=r"wide does not see the grid: it begins \d+ km from the track.*7\.5 degrees"):
        fifesim.scan_geometry(narrow, SITE, nadir_offset=2e5)
    with pytest.raises(ValueError, match="give one of them"):
        fifesim.scan_geometry(TM, SITE, fifesim.Track(39.0, -96.0, 190.0), nadir_offset=2e5)
    with pytest.raises(TypeError, match=r"fifesim\.Track"):
        fifesim.scan_geometry(TM, SITE, (39.0, -96.0))
