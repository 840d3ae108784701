"""Scans and varying angles on labelled rasters: view angles, light, swath images, sweeps, and images of a swath."""

from dataclasses import replace
from functools import cache

import dask.array as da
import numpy as np
import products
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, check_place, check_raster_function, in_chunks, no_compute

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.grids import cf, directions, projection
from fifesim.grids import grid as grids
from fifesim.sensor.description.instrument_file import Scan
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response.noise import NoiseModel
from fifesim.sensor.response.scan import growth, place_beside, view_from_ground, view_from_scan
from fifesim.sensor.scan_labels import latitude_longitude, seen_alike

# ------------------------------------------------------------------------------------------ view angles


TM, PAPER = instrument("TM"), instrument("TM", "paper")
SCANS = TM.sources | {"scan": "Friedl1995"}
WIDE = replace(TM, name="wide", altitude=833e3, scan=Scan("whiskbroom", max_angle=55.4), sources=SCANS)
NARROW = replace(PAPER, scan=Scan("whiskbroom", max_angle=7.7), sources=SCANS)
SITE = fifesim.fife_site(30.0)


def test_track_may_cross_the_scene():
    """The track lies 3 km left of the centre, i.e. in the east when flying south: vaa changes across the track."""
    view = fifesim.sensor.scan_geometry(TM, SITE, nadir_offset=3e3)
    middle = view.isel(y=250)
    assert middle["vza"].min() < 0.002
    nadir = float(middle["x"][int(middle["vza"].values.argmin())])
    assert nadir - float(middle["x"].mean()) == pytest.approx(3e3, abs=60)
    west, east = middle.isel(x=5), middle.isel(x=-5)
    assert float(west["vaa"]) == pytest.approx(90, abs=1.5) and float(east["vaa"]) == pytest.approx(270, abs=1.5)
    assert float(west["vza"]) == pytest.approx(np.degrees(np.arctan(10.4 / 705)), abs=0.1)
    for name in ("vza", "vaa"):
        check_place(view[name], SITE.crs)
        assert cf.attributes(name).items() <= view[name].attrs.items()
    with no_compute():
        lazy = fifesim.sensor.scan_geometry(TM, SITE, nadir_offset=3e3, chunks={"y": 130, "x": 77})
    xr.testing.assert_identical(lazy.compute(), view)


def test_cells_outside_a_wide_swath_are_missing():
    grid = fifesim.grid_at("EPSG:5070", -1.6e6, 2.2e6, 3.2e6, 4e5, 10e3)
    view = fifesim.sensor.scan_geometry(WIDE, grid, fifesim.sensor.Track(39.5, -96.0, 190.0))
    seen = np.isfinite(view["vza"].values)
    assert 0.5 < seen.mean() < 0.95
    np.testing.assert_array_equal(seen, np.isfinite(view["vaa"].values))
    assert float(view["vza"].max()) == pytest.approx(68.55, abs=0.3)
    with pytest.raises(ValueError, match=r"the grid: it begins \d+ km from .*7\.7 degrees"):
        fifesim.sensor.scan_geometry(NARROW, SITE, nadir_offset=2e5)


# ------------------------------------------------------------------------------------------ view direction of the light


AWAY = {"nadir_offset": -60e3, "heading": 193.6}


def light(site, geometry):
    ground = grids.place(xr.DataArray(np.full((1, *site.shape), 0.1), dims=("band", "y", "x")), site)
    ground = ground.assign_coords(band=["TM3"])
    return fifesim.to_toa(ground, fifesim.Atmosphere(), geometry=geometry, instrument="TM")


def test_nadir_light_in_an_off_nadir_scan_raises_with_a_remedy(site):
    """The code in the message, with a sun added, gives light that the scan accepts."""
    toa = light(site, Geometry(30.0, 120.0))
    with pytest.raises(ValueError, match=r"vza 0.0, than the scan, vza 5.4: up to 5.4 degrees") as refused:
        toa.fifesim.sense_swath("TM", **AWAY)
    said = str(refused.value)
    assert len(said) <= 500 and "\n" not in said
    typed = said[said.index("fifesim.sensor.scan_geometry(") : said.index(".assign(")]
    view = eval(typed, {"fifesim": fifesim, "grid": site})
    image = light(site, view.assign(sza=30.0, saa=120.0)).fifesim.sense_swath("TM", **AWAY, view_tolerance=0.01)
    seen = toa.fifesim.sense_swath("TM", **AWAY, view_tolerance=180)
    assert float(image["vza"].mean()) == pytest.approx(float(view["vza"].mean()), abs=1e-3)
    assert float(seen["vza"].min()) > 5.3
    assert float(toa.fifesim.sense_swath("TM")["vza"].max()) < 0.02


def test_lazy_angles_are_checked_on_compute(site):
    view = fifesim.sensor.scan_geometry("TM", site, **AWAY, chunks=20).assign(sza=30.0, saa=120.0)
    with no_compute():
        right = light(site, view).fifesim.sense_swath("TM", **AWAY)
        wrong = light(site, view).fifesim.sense_swath("TM", nadir_offset=60e3, heading=193.6)
    eager = light(site, view.compute()).fifesim.sense_swath("TM", **AWAY)
    xr.testing.assert_identical(right.compute(), eager)
    with pytest.raises(ValueError, match="another view"):
        wrong.compute()


def test_missing_light_needs_no_matching_view():
    """Cells outside the swath have no view angles."""
    means = xr.DataArray([[[np.nan, 1.0]]], dims=("band", "line", "sample"))
    vza = xr.DataArray(da.from_array([[np.nan, 3.0]]), dims=("line", "sample"))
    geometry = xr.Dataset({"sza": 30.0, "saa": 120.0, "vza": vza, "vaa": 0.0})
    view = np.array([[50.0, 3.5]]), np.zeros((1, 2))
    assert seen_alike(means, geometry, view, 1.0, "").equals(means)


# ------------------------------------------------------------------------------------------ images


ASIDE = {"nadir_offset": -36e3, "heading": 193.6, "view_tolerance": 180}


def scene(shape=(180, 198), plane=None):
    grid = fifesim.fife_site(30 / 9, window=((90, 90 + shape[0]), (180, 180 + shape[1])))
    x, y = np.meshgrid(*(grids.coordinates(grid)[axis].values for axis in ("x", "y")))
    values = np.random.default_rng(2).uniform(10, 90, shape) if plane is None else plane(x, y)
    return products.radiance(np.stack([values, values + 1]), grid, ["TM3", "TM4"])


@cache
def aside(quantise):
    return fifesim.sense_swath(scene(), PAPER, quantise=quantise, **ASIDE)


def test_swath_has_the_native_interval_and_the_track_heading():
    image = aside(quantise=False)
    assert image.dims == ("band", "line", "sample")
    along = np.hypot(image["x"].diff("line"), image["y"].diff("line"))
    across = np.hypot(image["x"].diff("sample"), image["y"].diff("sample"))
    wider = growth(float(image["vza"].mean()) * 0.9, 705e3)
    # Spherical Earth and map scale: 0.4 %.
    swept = (image["sweep"].diff("line") == 0).values
    np.testing.assert_allclose(along[swept], 30.315 * float(wider[0]), rtol=4e-3)
    # 16 lines together are 0.15 % longer than the advance per sweep.
    assert (~swept).sum() == 1 and float(along[~swept].max()) < 30.315 - 16 * 30.315 * (float(wider[0]) - 1) + 0.1
    np.testing.assert_allclose(across, 30.315 * float(wider[1]), rtol=5e-3)
    heading = np.degrees(np.arctan2(image["x"].diff("line"), image["y"].diff("line"))) % 360
    convergence = projection.convergence(grids.geobox(scene()))
    np.testing.assert_allclose(heading, 193.6 - convergence, rtol=0, atol=0.4)
    # When flying south, right is west.
    assert (image["x"].diff("sample") < 0).all()
    assert (abs(image["vaa"] - 283.6) < 0.5).all()


def test_swath_is_labelled_and_its_numbers_convert_to_radiance():
    image, radiance = aside(quantise=True), aside(quantise=False)
    assert image.dtype == np.uint8 and image.attrs["_FillValue"] == 0
    assert float(abs(fifesim.sensor.to_radiance(image) - radiance).max()) <= float(image["gain"].max()) / 2 * (1 + 1e-9)
    assert radiance["latitude"].attrs["units"] == "degrees_north" and radiance.attrs["units"] == "W m-2 sr-1 um-1"
    assert image["vza"].dims == ("line", "sample") and cf.attributes("vza").items() <= image["vza"].attrs.items()
    assert image.rio.crs == scene().rio.crs


def test_fixed_pattern_noise_follows_scan_lines():
    model = {"noise": "fixed-pattern", "noise_models": NoiseModel(0.0, 0.0, detectors=16, gain_spread=0.02)}
    flat = scene(plane=lambda x, y: 0 * x + 40.0)
    image = fifesim.sense_swath(flat, PAPER, **model, seed=1, quantise=False, **ASIDE).sel(band="TM3")
    spread = image.max("sample") - image.min("sample")
    assert float(spread.max()) < 1e-10
    assert float(image.mean("sample").std()) > 0.2


def test_swath_contains_all_pixels_centred_in_the_scene():
    """The corners of the scene limit the lines and samples."""
    track = fifesim.sensor.Track(39.1, -96.9, 193.6)
    plane = scene()
    image = fifesim.sense_swath(plane, PAPER, track, quantise=False, view_tolerance=180)
    rows, columns = np.meshgrid([0, plane.sizes["y"]], [0, plane.sizes["x"]])
    distance, aside = place_beside(track, *latitude_longitude(grids.geobox(plane), rows, columns))
    theta = np.radians(view_from_ground(aside, 705e3)[1])
    for name, place, step in (("line", distance, 30.315), ("sample", theta, 43e-6)):
        centres = (np.arange(-10_000, 10_000) + 0.5) * step
        within = np.flatnonzero((centres >= place.min()) & (centres <= place.max())) - 10_000
        np.testing.assert_array_equal(image[name], within)


@cache
def lit():
    """Uniform ground with the view angles of the scan, and its image."""
    grid = grids.geobox(scene((60, 66)))
    ground = products.labelled(np.full((2, 60, 66), [[[0.05]], [[0.4]]]), grid, ["TM3", "TM4"], {}).rename("rho")
    view = fifesim.sensor.scan_geometry("TM", grid, **AWAY).assign(sza=30.0, saa=120.0)
    toa = fifesim.to_toa(ground, fifesim.Atmosphere(), geometry=view, instrument="TM")
    return toa, fifesim.sense_swath(toa, "TM", **AWAY)


def test_swath_is_corrected_to_the_original_surface():
    """Round trip through radiance, planetary reflectance and atmosphere with the view angles of the scan."""
    toa, _ = lit()
    image = fifesim.sense_swath(toa, "TM", quantise=False, **AWAY)
    surface = image.fifesim.to_surface()
    assert surface.dims == ("band", "line", "sample") and surface.name == "surface_reflectance"
    assert "latitude" in surface.coords and surface.encoding["grid_mapping"] == "spatial_ref"
    valid = surface.isel(band=0).notnull().values
    assert valid.sum() > 10
    # The atmospheric terms are interpolated over the angles to 1e-5, at slightly different angles each way.
    np.testing.assert_allclose(surface.values[:, valid].T, np.tile([0.05, 0.4], (valid.sum(), 1)), rtol=0, atol=2e-5)
    ndvi = image.fifesim.ndvi()
    planetary = image.fifesim.to_reflectance()
    by_hand = (planetary[1] - planetary[0]) / (planetary[1] + planetary[0])
    assert ndvi.dims == ("line", "sample")
    np.testing.assert_array_equal(ndvi, by_hand)


def test_operations_on_a_lazy_scan_are_lazy_and_equal():
    _, image = lit()
    for verb in (fifesim.sensor.to_radiance, fifesim.to_surface, fifesim.ndvi):
        with no_compute():
            lazy = verb(in_chunks(image, {"line": 2, "sample": 3}))
        assert lazy.chunks is not None and lazy.dims[-2:] == ("line", "sample")
        xr.testing.assert_identical(lazy.compute(), verb(image))


def test_varying_sun_is_sampled_at_each_pixel():
    toa, _ = lit()
    angles = np.linspace(20.0, 40.0, 66)
    varied = toa.assign_coords(sza=(("y", "x"), np.broadcast_to(angles, (60, 66)), cf.attributes("sza")))
    image = fifesim.sense_swath(varied, "TM", quantise=False, **AWAY)
    column = ((image["x"] - toa["x"][0]) / (10 / 3)).round().astype(int).clip(0, 65)
    np.testing.assert_allclose(image["sza"], angles[column], rtol=0, atol=0.32)
    np.testing.assert_allclose(image.fifesim.to_reflectance().mean(), toa.mean(), rtol=1e-4, atol=0)


# ------------------------------------------------------------------------------------------ sweeps


# Near the central meridian, where map rows are perpendicular to a southward track.
CELL = 100.0
GRID = fifesim.grid_at("EPSG:32614", 484000.0, 4346000.0, 32000.0, 26000.0, CELL)
# Nadir offsets by scan angle, 0, 30 and 55 degrees. [m]
OFFSETS = {"MODIS": {0: 0.0, 30: 415e3, 55: 1140e3}, "VIIRS": {0: 0.0, 30: 486e3, 55: 1404e3}}
BANDS = {"MODIS": "MODIS1", "VIIRS": "I1"}


def plane(x, y):
    return 100 + 1e-3 * (x - 500000) + 2e-3 * (y - 4333000)


def wide_scene(name, values=plane):
    x, y = np.meshgrid(*(grids.coordinates(GRID)[axis].values for axis in ("x", "y")))
    return products.radiance(values(x, y)[None], GRID, [BANDS[name]])


def seen(values, name, nadir_offset, **options):
    view = {"nadir_offset": nadir_offset, "heading": 180.0, "view_tolerance": 180, "min_valid": 0.0}
    return fifesim.sense_swath(wide_scene(name, values), name, **view, **options)


@cache
def swept(name, angle):
    return seen(plane, name, OFFSETS[name][angle], quantise=False)


def scan_angle_of(image, name):
    altitude = instrument(name).altitude
    return np.degrees(np.arcsin(np.sin(np.radians(image["vza"])) * 6371e3 / (6371e3 + altitude)))


@pytest.mark.parametrize(("name", "height"), [("MODIS", 10_000.0), ("VIIRS", 11_871.0)])
def test_sweeps_are_contiguous_at_nadir_and_overlap_at_the_edge(name, height):
    for angle in (0, 55):
        image = swept(name, angle)
        # Centre of each complete sweep, along the southward track.
        middle = (-image["y"].isel(sample=0)).groupby("sweep").mean()
        whole = image["line"].groupby("sweep").count() == instrument(name).scan.lines
        aside = OFFSETS[name][angle] / 6371e3
        np.testing.assert_allclose(middle[whole].diff("sweep"), height * np.cos(aside), rtol=5e-3)
        jump = -image["y"].diff("line").isel(sample=0)[image["sweep"].diff("line").values > 0]
        assert np.all(jump < 0) if angle else np.all(jump > 200)


def test_deleted_pixels_are_missing_and_flagged():
    image = swept("VIIRS", 55)
    deleted = image["deleted"].values
    assert np.isnan(image.values[0][deleted]).all()
    detector = image["line"].values % 32
    assert (deleted.all(axis=1) == (np.minimum(detector, 31 - detector) < 4)).all()
    inside = (abs(image["x"] - 500000) < 15000) & (abs(image["y"] - 4333000) < 12000)
    assert np.isfinite(image.values[0][inside.values & ~deleted]).all() and (inside.values & deleted).any()
    assert not swept("VIIRS", 0)["deleted"].any()
    assert "deleted" not in swept("MODIS", 55).coords
    numbers = seen(plane, "VIIRS", OFFSETS["VIIRS"][55]).values[0]
    assert (numbers[deleted] == 0).all() and (numbers[inside.values & ~deleted] > 0).all()


@pytest.mark.parametrize("name", ["MODIS", "VIIRS"])
@pytest.mark.parametrize("angle", [0, 55])
def test_pixels_of_all_sweeps_lie_at_their_coordinates(name, angle):
    image = swept(name, angle)
    inside = (abs(image["x"] - 500000) < 13000) & (abs(image["y"] - 4333000) < 11000)
    difference = (image[0] - plane(image["x"], image["y"])).where(inside)
    assert float(difference.notnull().mean()) > 0.3
    # 0.01 pixels of about 1 km.
    assert float(abs(difference).max()) < 0.02


def test_footprint_width_is_the_aggregated_sample_width():
    """For a strip one cell wide, the largest mean is the ratio of cell width to footprint width."""

    def strips(x, y):
        return np.where(np.abs((x - 484050) % 4000) < 1, 1000.0, 0.0)

    widths = {}
    for angle in (31.2, 32.3):
        gamma = view_from_scan(angle, 824e3)[1]
        image = seen(strips, "VIIRS", 6371e3 * np.radians(gamma), quantise=False)
        steps = np.hypot(image["x"].diff("sample"), image["y"].diff("sample"))
        zone = abs(scan_angle_of(image, "VIIRS") - angle).isel(sample=slice(1, None)) < 0.4
        middle = (abs(image["y"] - 4333000) < 8000).isel(sample=slice(1, None)) & zone
        largest = float(image[0].isel(sample=slice(1, None)).where(middle).max())
        widths[angle] = 1000 * CELL / largest
        assert widths[angle] == pytest.approx(float(steps.where(middle).median()), rel=0.03)
    assert widths[31.2] / widths[32.3] == pytest.approx(1.5 * 0.97, rel=0.03)


@pytest.mark.parametrize("chunks", [CHUNKS, ODD_CHUNKS | {"band": 1}])
def test_bands_zones_and_sweeps_do_not_depend_on_chunks(chunks, monkeypatch):
    monkeypatch.setattr("fifesim.sensor.scan_labels._SWATH_BLOCK", 11)
    view = {"nadir_offset": 525e3, "view_tolerance": 180, "min_valid": 0.0}
    rough = wide_scene("VIIRS", lambda x, y: np.random.default_rng(3).uniform(10, 90, x.shape))
    for toa, name, options in ((scene(), PAPER, ASIDE), (rough, "VIIRS", view)):
        whole = fifesim.sense_swath(toa, name, **options)
        with no_compute():
            lazy = fifesim.sense_swath(in_chunks(toa, chunks), name, **options)
        xr.testing.assert_identical(lazy.compute(), whole)
    assert len(set(np.unique(whole["deleted"].sum("line")))) == 2


# ------------------------------------------------------------------------------------------ images of a swath


def ramp(lai, low, high):
    """Raster on the grid of `lai` that increases to the east."""
    values = np.broadcast_to(np.linspace(low, high, lai.sizes["x"]), lai.shape)
    return lai.copy(data=values).drop_attrs(deep=False)


def by_cell(sza, saa, vza, vaa):
    """Geometry with some angles as rasters."""
    return xr.Dataset({"sza": sza, "saa": saa, "vza": vza, "vaa": vaa})


@pytest.fixture
def swath(lai):
    return by_cell(ramp(lai, 25.0, 31.0), 117.0, ramp(lai, 0.0, 50.0), ramp(lai, 350.0, 370.0))


def reflected(lai, geometry, **options):
    return fifesim.surface_reflectance(lai, "TM", bands=["TM3", "TM4"], geometry=geometry, **options)


def test_reflectance_uses_the_angles_of_each_cell(lai, swath):
    """Compared with single geometries; the skylight fraction is interpolated over sza to 1e-6."""
    rho = check_raster_function(lambda array: reflected(array, swath), lai, quantity="surface_reflectance")
    assert directions.varying(directions.geometry_of(rho)) == ("sza", "vza", "vaa")
    for column in (0, 20, lai.sizes["x"] - 1):
        angles = (float(getattr(swath, name)[0, column]) if name != "saa" else 117.0 for name in swath)
        alone = reflected(lai, fifesim.Geometry(*angles), exact=True)
        np.testing.assert_allclose(rho[..., column], alone[..., column], rtol=0, atol=1e-6)
    litter = (lai * 0 + 0.2).drop_attrs(deep=False)
    mapped, uniform = (reflected(lai, swath, canopy=fifesim.Canopy(background=each)) for each in (litter, 0.2))
    np.testing.assert_allclose(mapped, uniform, rtol=1e-14)


def test_image_of_a_swath_has_pixel_angles(lai, swath):
    toa = reflected(lai, swath).fifesim.to_toa()
    image = check_raster_function(lambda array: array.fifesim.sense("TM"), toa, quantity="dn")
    there = directions.geometry_of(image)
    assert directions.varying(there) == ("sza", "vza", "vaa")
    middle = toa["sza"].values.reshape(5, 9, 6, 9).mean((1, 3))
    np.testing.assert_allclose(there.sza, middle, rtol=1e-12)
    # The mean of azimuths between 350 and 10 degrees is north; an arithmetic mean would be south.
    assert np.all((there.vaa < 10.1) | (there.vaa > 349.9))
    # Planetary reflectance round trips within half a count: both conversions use the solar angle of the pixel.
    image = toa.fifesim.sense(PAPER)
    one_sun = toa.drop_vars(["sza", "vza", "vaa"]).fifesim.sense(PAPER, quantise=False).fifesim.to_reflectance()
    count = (image["gain"] / image["solar_irradiance"]).values[:, None, None] * np.pi * 1.04 / np.cos(np.radians(31))
    assert np.all(np.abs(image.fifesim.to_reflectance() - one_sun).values <= 0.5 * count + 1e-9)
