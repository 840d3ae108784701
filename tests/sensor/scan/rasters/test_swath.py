"""The image of a scan on labelled rasters."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, in_chunks, no_compute

import fifesim
from fifesim.analysis.regression import Regression
from fifesim.base.geometry import Geometry
from fifesim.grids import cf, directions, projection
from fifesim.grids import grid as grids
from fifesim.sensor.description.instrument_file import Noise, Scan
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.spatial_response import BoxcarResponse
from fifesim.sensor.response.scan import growth, place_beside, view_from_ground
from fifesim.sensor.scan_labels import latitude_longitude

TM = instrument("TM", "paper")
VIEW = {"nadir_offset": -36e3, "heading": 193.6, "view_tolerance": 180}


def scene(shape=(180, 198), plane=None):
    grid = fifesim.fife_site(30 / 9, window=((90, 90 + shape[0]), (180, 180 + shape[1])))
    x, y = np.meshgrid(*(grids.coordinates(grid)[axis].values for axis in ("x", "y")))
    values = np.random.default_rng(2).uniform(10, 90, shape) if plane is None else plane(x, y)
    array = xr.DataArray(np.stack([values, values + 1]), dims=("band", "y", "x"), coords={"band": ["TM3", "TM4"]})
    array.attrs["units"] = "W m-2 sr-1 um-1"
    return directions.with_geometry(grids.place(array, grid), Geometry(40.0, 120.0))


def test_pixels_lie_where_they_say():
    """A plane is seen at the centre of a symmetric footprint; its steps by cells leave a hundredth of one."""
    plane = scene(plane=lambda x, y: 0.02 * (x - 705600) - 0.03 * (y - 4333900))
    image = fifesim.sense_swath(plane, TM, quantise=False, **VIEW)
    expected = 0.02 * (image["x"] - 705600) - 0.03 * (image["y"] - 4333900)
    difference = (image.sel(band="TM3") - expected).values
    x, y = projection.transform_points(~grids.geobox(plane).affine, image["x"], image["y"])
    inside = (x > 9) & (x < 189) & (y > 9) & (y < 171)
    assert inside.mean() > 0.5
    assert np.abs(difference[inside]).max() < np.hypot(0.02, 0.03) * 0.01 * 10 / 3


def test_pixels_stand_at_the_instruments_interval_and_turn_with_the_track():
    image = fifesim.sense_swath(scene(), TM, quantise=False, **VIEW)
    assert image.dims == ("band", "line", "sample")
    along = np.hypot(image["x"].diff("line"), image["y"].diff("line"))
    across = np.hypot(image["x"].diff("sample"), image["y"].diff("sample"))
    wider = growth(float(image["vza"].mean()) * 0.9, 705e3)
    # The sphere and the map's scale cost a few thousandths.
    swept = (image["sweep"].diff("line") == 0).values
    np.testing.assert_allclose(along[swept], 30.315 * float(wider[0]), rtol=4e-3)
    # 16 lines together are 0.15 % higher than a sweep advances.
    assert (~swept).sum() == 1 and float(along[~swept].max()) < 30.315 - 16 * 30.315 * (float(wider[0]) - 1) + 0.1
    np.testing.assert_allclose(across, 30.315 * float(wider[1]), rtol=5e-3)
    heading = np.degrees(np.arctan2(image["x"].diff("line"), image["y"].diff("line"))) % 360
    convergence = projection.convergence(grids.geobox(scene()))
    np.testing.assert_allclose(heading, 193.6 - convergence, rtol=0, atol=0.4)
    # Flying south, the right is the west.
    assert (image["x"].diff("sample") < 0).all()
    assert (abs(image["vaa"] - 283.6) < 0.5).all()


def test_constant_scene_stays_constant_and_its_labels_are_whole():
    image = fifesim.sense_swath(scene(plane=lambda x, y: 0 * x + 40.0), TM, quantise=False, **VIEW)
    found = image.sel(band="TM3").values
    np.testing.assert_allclose(found[np.isfinite(found)], 40.0, rtol=1e-14)
    assert image["latitude"].attrs["units"] == "degrees_north"
    assert image["vza"].dims == ("line", "sample") and cf.attributes("vza").items() <= image["vza"].attrs.items()
    assert image.rio.crs == scene().rio.crs
    assert image.attrs["units"] == "W m-2 sr-1 um-1"


@pytest.mark.parametrize("chunks", [CHUNKS, ODD_CHUNKS, ODD_CHUNKS | {"band": 1}])
def test_a_scan_is_the_same_in_any_chunks(chunks, monkeypatch):
    monkeypatch.setattr("fifesim.sensor.scan_labels._SWATH_BLOCK", 7)
    whole = fifesim.sense_swath(scene(), TM, **VIEW)
    with no_compute():
        lazy = fifesim.sense_swath(in_chunks(scene(), chunks), TM, **VIEW)
    xr.testing.assert_identical(lazy.compute(), whole)


def test_digital_numbers_come_back_as_radiance_and_reflectance():
    image = fifesim.sense_swath(scene(), TM, **VIEW)
    radiance = fifesim.sense_swath(scene(), TM, quantise=False, **VIEW)
    assert image.dtype == np.uint8 and image.attrs["_FillValue"] == 0
    back = fifesim.to_radiance(image)
    assert float(abs(back - radiance).max()) <= float(image["gain"].max()) / 2 * (1 + 1e-9)
    reflectance = fifesim.to_reflectance(image)
    assert reflectance.dims == ("band", "line", "sample") and "latitude" in reflectance.coords


def test_noise_goes_by_lines_of_the_scan():
    noisy = replace(
        TM,
        detectors=16,
        bands=tuple(replace(band, noise=Noise(radiance=50.0, snr=50.0, gain_spread=0.02)) for band in TM.bands),
        sources=TM.sources | {"noise": "Friedl1995", "detectors": "Friedl1995"},
    )
    flat = scene(plane=lambda x, y: 0 * x + 40.0)
    image = fifesim.sense_swath(flat, noisy, noise="fixed-pattern", seed=1, quantise=False, **VIEW).sel(band="TM3")
    spread = image.max("sample") - image.min("sample")
    assert float(spread.max()) < 1e-10
    assert float(image.mean("sample").std()) > 0.2


def test_wide_scans_see_wider():
    """At 40 degrees a footprint covers 1.37 x 2.0 times as much: the variance of white cells falls in proportion."""
    wide = replace(
        TM, altitude=833e3, scan=Scan("whiskbroom", max_angle=55.0), sources=TM.sources | {"scan": "Friedl1995"}
    )
    # 705 km and 833 km widen the footprint alike.
    variance = {}
    for offset in (0.0, 735e3):
        image = fifesim.sense_swath(scene((360, 360)), wide, quantise=False, nadir_offset=offset, view_tolerance=180)
        variance[offset] = float(image.sel(band="TM3").var())
        angle = float(image["vza"].mean())
    scan_angle = np.degrees(np.arcsin(np.sin(np.radians(angle)) * 6371 / (6371 + 833)))
    along, across = growth(scan_angle, 833e3)
    assert 38 < scan_angle < 42
    # 300 pixels in the wide image: a standard error of 8 %, and neighbours overlap a little.
    assert variance[0.0] / variance[735e3] == pytest.approx(float(along * across), rel=0.3)


def test_a_scene_that_is_not_scanned_is_named():
    narrow = replace(TM, scan=Scan("whiskbroom", max_angle=7.7), sources=TM.sources | {"scan": "Friedl1995"})
    with pytest.raises(ValueError, match="does not see the scene"):
        fifesim.sense_swath(scene(), narrow, nadir_offset=4e5)
    with pytest.raises(ValueError, match="simulate a larger one"):
        fifesim.sense_swath(scene((6, 6)), TM)


def test_lines_and_samples_are_all_those_whose_centres_lie_in_the_scene():
    """Neither more nor less, from the first to the last; corners of the scene are the farthest along and across."""
    track = fifesim.Track(39.1, -96.9, 193.6)
    plane = scene()
    image = fifesim.sense_swath(plane, TM, track, quantise=False, view_tolerance=180)
    rows, columns = np.meshgrid([0, plane.sizes["y"]], [0, plane.sizes["x"]])
    distance, aside = place_beside(track, *latitude_longitude(grids.geobox(plane), rows, columns))
    theta = np.radians(view_from_ground(aside, 705e3)[1])
    for name, place, step in (("line", distance, 30.315), ("sample", theta, 43e-6)):
        centres = (np.arange(-10_000, 10_000) + 0.5) * step
        within = np.flatnonzero((centres >= place.min()) & (centres <= place.max())) - 10_000
        np.testing.assert_array_equal(image[name], within)


def test_bands_with_other_line_spreads_are_seen_each_by_its_own():
    wide = replace(TM.bands[3], lsf=BoxcarResponse("boxcar", width=120 / 705e3))
    mixed, alone = replace(TM, bands=(*TM.bands[:3], wide, *TM.bands[4:])), replace(TM, lsf=wide.lsf)
    options = {"quantise": False, "min_valid": 0.5} | VIEW
    image = fifesim.sense_swath(scene().isel(band=[1, 0]), mixed, **options)
    assert image["band"].values.tolist() == ["TM4", "TM3"]
    both = fifesim.sense_swath(scene(), alone, **options)
    np.testing.assert_array_equal(image.sel(band="TM4"), both.sel(band="TM4"))
    np.testing.assert_array_equal(image.sel(band="TM3"), fifesim.sense_swath(scene(), TM, **options).sel(band="TM3"))


def lit(reflectance=(0.05, 0.4)):
    """A uniform ground seen as the scan sees it, in Track's own directions."""
    grid = grids.geobox(scene((60, 66)))
    ground = xr.DataArray(np.broadcast_to(np.reshape(reflectance, (2, 1, 1)), (2, 60, 66)), dims=("band", "y", "x"))
    ground = grids.place(ground.assign_coords(band=["TM3", "TM4"]), grid)
    away = {"nadir_offset": -60e3, "heading": 193.6}
    view = fifesim.scan_geometry("TM", grid, **away).assign(sza=30.0, saa=120.0)
    return fifesim.to_toa(ground, fifesim.Atmosphere(), geometry=view, instrument="TM"), away


def test_a_scan_goes_back_to_the_ground_that_it_was_made_of():
    """Through radiance, planetary reflectance and air, in the scan's own directions: what was put in comes out."""
    toa, away = lit()
    image = fifesim.sense_swath(toa, "TM", quantise=False, **away)
    surface = image.fifesim.to_surface()
    assert surface.dims == ("band", "line", "sample") and surface.name == "surface_reflectance"
    assert "latitude" in surface.coords and surface.encoding["grid_mapping"] == "spatial_ref"
    valid = surface.isel(band=0).notnull().values
    assert valid.sum() > 10
    # The air's terms are interpolated over the angles to 1e-5, there and back at slightly different nodes.
    np.testing.assert_allclose(surface.values[:, valid].T, np.tile([0.05, 0.4], (valid.sum(), 1)), rtol=0, atol=2e-5)
    ndvi = image.fifesim.ndvi()
    planetary = image.fifesim.to_reflectance()
    by_hand = (planetary[1] - planetary[0]) / (planetary[1] + planetary[0])
    assert ndvi.dims == ("line", "sample")
    np.testing.assert_array_equal(ndvi, by_hand)


def test_verbs_of_a_lazy_scan_are_lazy_and_the_same():
    toa, away = lit()
    image = fifesim.sense_swath(toa, "TM", **away)
    fit = Regression(3.0, -0.5, 0.9, 100, 0.1, 0.5, 10.0)
    for verb in (fifesim.to_radiance, fifesim.to_surface, lambda array: fifesim.index(array, "EVI2"),
                 lambda array: fifesim.invert(fifesim.ndvi(array), fit)["lai"]):  # fmt: skip
        with no_compute():
            lazy = verb(in_chunks(image, {"line": 2, "sample": 3}))
        assert lazy.chunks is not None and lazy.dims[-2:] == ("line", "sample")
        xr.testing.assert_identical(lazy.compute(), verb(image))


def test_what_takes_maps_names_the_way_to_one():
    toa, away = lit()
    ndvi = fifesim.sense_swath(toa, "TM", **away).fifesim.ndvi()
    with pytest.raises(ValueError, match=r"\.fifesim\.grid_swath\(grid\)"):
        fifesim.regress(ndvi, ndvi)


def test_sun_that_varies_over_the_scene_is_that_of_each_pixel():
    toa, away = lit()
    angles = np.linspace(20.0, 40.0, 66)
    varied = toa.assign_coords(sza=(("y", "x"), np.broadcast_to(angles, (60, 66)), cf.attributes("sza")))
    image = fifesim.sense_swath(varied, "TM", quantise=False, **away)
    column = ((image["x"] - toa["x"][0]) / (10 / 3)).round().astype(int).clip(0, 65)
    np.testing.assert_allclose(image["sza"], angles[column], rtol=0, atol=0.32)
    np.testing.assert_allclose(image.fifesim.to_reflectance().mean(), toa.mean(), rtol=1e-4, atol=0)


def test_a_scan_is_written_as_netcdf_and_read_again(tmp_path):
    toa, away = lit()
    image = fifesim.sense_swath(toa, "TM", **away)
    image.to_netcdf(tmp_path / "scan.nc")
    with xr.open_dataarray(tmp_path / "scan.nc", decode_coords="all", mask_and_scale=False) as back:
        xr.testing.assert_equal(back, image)
        xr.testing.assert_identical(back.fifesim.to_radiance().drop_attrs(), image.fifesim.to_radiance().drop_attrs())
        assert back.rio.crs == image.rio.crs
    with xr.open_dataset(tmp_path / "scan.nc") as plain:
        assert {"latitude", "longitude"} <= set(plain["dn"].encoding["coordinates"].split())
        assert plain["dn"].attrs["grid_mapping"] == "spatial_ref"


def test_a_map_is_what_a_geotiff_holds(tmp_path):
    toa, away = lit()
    image = fifesim.sense_swath(toa, "TM", **away)
    with pytest.raises(ValueError, match=r"map the scan with .grid_swath\(grid\)"):
        image.fifesim.to_geotiff(tmp_path / "scan.tif")
    with pytest.warns(UserWarning, match="lacks vza, vaa"):
        image.fifesim.grid_swath(grids.aligned_grid(grids.geobox(toa), 30.0)).fifesim.to_geotiff(tmp_path / "map.tif")
    assert fifesim.open_image(tmp_path / "map.tif").dtype == np.uint8


def test_what_lies_on_a_map_is_not_spread_over_a_scan():
    toa, away = lit()
    image = fifesim.sense_swath(toa, "TM", quantise=False, **away)
    height = toa.isel(band=0, drop=True).drop_vars(["vza", "vaa"]).drop_attrs() * 0 + 400
    for option in ({"elevation": height}, {"adjacency": True}):
        with pytest.raises(ValueError, match="does not fit the lines and samples"):
            image.fifesim.to_surface(**option)
