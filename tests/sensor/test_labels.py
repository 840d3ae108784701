"""Images on labelled rasters: pixels, calibration, digital numbers of products, saturation, compression and noise."""

import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import products
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, check_raster_function, in_chunks, no_compute

import fifesim
from fifesim.base.footprints import Boxcar
from fifesim.base.geometry import Geometry
from fifesim.grids import cf, directions
from fifesim.grids import grid as grids
from fifesim.sensor.description import spatial_response as responses
from fifesim.sensor.description.instrument_file import Noise
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.labels import noisy
from fifesim.sensor.pixel_labels import check_scene, pixel_grid
from fifesim.sensor.response import calibration
from fifesim.sensor.response.noise import NoiseModel, add_noise

TM, PAPER, MSS = instrument("TM"), instrument("TM", "paper"), instrument("MSS")
RED_NIR = TM.select(["TM3", "TM4"])
SUN = Geometry(40.0, 120.0, earth_sun_distance=1.0148)
# Arbitrary noise, not of a real instrument.
FIGURES = Noise(radiance=50.0, snr=60.0, shot=0.5, gain_spread=0.02, offset_spread=0.3)
NOISY = replace(
    PAPER,
    detectors=16,
    sources=PAPER.sources | {"noise": "Friedl1995", "detectors": "Friedl1995"},
    bands=tuple(replace(band, noise=FIGURES) for band in PAPER.bands),
)
ALL = ("shot", "thermal", "fixed-pattern")


def scene(grid, bands=("TM3", "TM4"), sun=SUN, seed=2, **coords):
    """Random top-of-atmosphere reflectance in each cell."""
    values = np.random.default_rng(seed).uniform(0.02, 0.5, (len(bands), *grid.shape))
    return directions.with_geometry(products.labelled(values, grid, list(bands), coords), sun)


@pytest.fixture
def toa(site):
    return scene(site)


ONTO = {
    "aligned": None,
    "offset": fifesim.grid_at("EPSG:26914", 705581.3, 4333911.9, 110.0, 95.0, 30.0),
    "own-interval": fifesim.grid_at("EPSG:26914", 705571.0, 4333919.0, 150.0, 130.0, 30.315),
    "beyond-the-scene": fifesim.grid_at("EPSG:26914", 705520.0, 4333960.0, 300.0, 300.0, 30.0),
}


def plane(raster):
    return 0.2 + 1e-3 * ((raster.x.drop_attrs() - 705600) + 0.3 * (raster.y.drop_attrs() - 4333900))


@pytest.mark.parametrize("onto", ONTO.values(), ids=ONTO.keys())
def test_sense_follows_the_raster_rules_and_pixels_lie_at_their_coordinates(toa, site, onto):
    image = check_raster_function(lambda toa: fifesim.sense(toa, "TM", onto=onto), toa, quantity="dn")
    assert grids.same_grid(grids.geobox(image), grids.aligned_grid(site, 30.0) if onto is None else onto)
    assert image.dtype == np.uint8 and (image > 0).any()
    means = fifesim.sense(toa, "TM", onto=onto, quantise=False)
    # Half a count, plus rounding of a division.
    inside, gain = (image.values > 1) & (image.values < 255), image["gain"].values[:, None, None]
    assert (np.abs(fifesim.sensor.to_radiance(image) - means).values <= 0.5 * gain * (1 + 1e-9))[inside].all()
    np.testing.assert_array_equal(np.isnan(means), image == 0)
    # The mean of a plane over a symmetric footprint is its value at the centre; steps of cells leave 0.06 m.
    seen = fifesim.sense(toa * 0 + plane(toa), PAPER, onto=onto, quantise=False).fifesim.to_reflectance()
    box = site.boundingbox
    whole = (abs(seen.x - (box.left + box.right) / 2) < 74) & (abs(seen.y - (box.bottom + box.top) / 2) < 59)
    assert whole.sum() >= 6 and float(abs(seen - plane(seen)).where(whole).max()) < 0.06e-3


def test_digital_numbers_of_a_uniform_scene_by_hand(toa):
    """Reflectances of 0.1 and 0.3: E cos(40 degrees) / (pi 1.0148^2) times them, on the scale of Table 1."""
    uniform = toa * 0 + xr.DataArray([0.1, 0.3], dims="band", coords={"band": ["TM3", "TM4"]})
    radiance = np.array([0.1 * 1536.0, 0.3 * 1031.0]) * np.cos(np.radians(40.0)) / (np.pi * 1.0148**2)
    counts = np.rint((radiance - [-1.2, -1.5]) / [205.5 / 255, 207.7 / 255])
    image = fifesim.sense(uniform, PAPER)
    np.testing.assert_array_equal(image, np.broadcast_to(counts[:, None, None], image.shape))


def test_offset_and_gain_drift_may_differ_by_date(toa):
    dates = np.array(["1987-05-01T16:35", "1987-06-06T16:35"], "M8[ns]")
    both = xr.concat([toa.assign_coords(time=each) for each in dates], "time")
    south = xr.DataArray([0.3, -0.2], coords={"time": dates}, dims="time")
    response = xr.DataArray(
        [[0.9, 0.8], [1.0, 0.7]], coords={"time": dates, "band": ["TM4", "TM3"]}, dims=("time", "band")
    )
    found = both.fifesim.sense("TM", quantise=False, offset=(south, 0.0), gain_drift=response)
    for number, (offset, factors) in enumerate(((0.3, (0.8, 0.9)), (-0.2, (0.7, 1.0)))):
        plain = both.isel(time=number).fifesim.sense("TM", quantise=False, offset=(offset, 0.0))
        expected = plain.values * np.array(factors)[:, None, None]
        np.testing.assert_allclose(found.isel(time=number).values, expected, rtol=1e-12)
    lazy = in_chunks(toa, ODD_CHUNKS).fifesim.sense("TM", gain_drift=0.9)
    np.testing.assert_array_equal(lazy.values, toa.fifesim.sense("TM", gain_drift=0.9).values)


def test_pixels_over_missing_cells_are_no_data(toa):
    toa[0, 20:26, 20:26] = np.nan
    image = fifesim.sense(toa, PAPER)
    assert (image.sel(band="TM3") == 0).sum() == 1 and (image.sel(band="TM4") > 0).all()
    assert (fifesim.sense(toa, PAPER, min_valid=0.3) > 0).all()


def test_radiance_and_reflectance_follow_the_raster_rules(toa):
    image = fifesim.sense(toa.where(toa["x"] > 705640), "TM")
    for name in ("gain", "offset", "wavelength", "solar_irradiance"):
        assert image[name].dims == ("band",) and cf.attributes(name).items() <= image[name].attrs.items()
    assert image.attrs["instrument"] == "TM" and directions.geometry_of(image) == SUN
    assert image.attrs["_FillValue"] == 0 and image.attrs["_FillValue"].dtype == image.dtype
    radiance = check_raster_function(fifesim.sensor.to_radiance, image, quantity="toa_radiance")
    reflectance = check_raster_function(fifesim.to_reflectance, image, quantity="toa_reflectance")
    gain, offset, sun = (image[name].values[:, None, None] for name in ("gain", "offset", "solar_irradiance"))
    expected = calibration.dn_to_radiance(image.values, gain, offset)
    np.testing.assert_array_equal(radiance, expected)
    known = calibration.radiance_to_reflectance(expected, sun, SUN.mu_s, SUN.earth_sun_distance)
    np.testing.assert_array_equal(reflectance, known)
    np.testing.assert_array_equal(np.isnan(radiance), image == 0)
    np.testing.assert_array_equal(fifesim.to_reflectance(radiance), reflectance)


def test_sensing_radiance_or_one_band_equals_sensing_reflectance(toa):
    """Digital numbers may differ by 1 where the values lie halfway between counts."""
    image, sun = fifesim.sense(toa, "TM"), np.array([band.solar_irradiance for band in RED_NIR])[:, None, None]
    radiance = toa.copy(data=calibration.reflectance_to_radiance(toa.values, sun, SUN.mu_s, SUN.earth_sun_distance))
    radiance.attrs = {"units": "W m-2 sr-1 um-1"}
    difference = fifesim.sense(radiance, "TM").astype(int) - image.astype(int)
    assert (difference == 0).mean() > 0.99 and np.abs(difference).max() <= 1
    one = fifesim.sense(toa.sel(band="TM3").assign_coords(band="tm3"), "TM")
    assert one.dims == ("band", "y", "x")
    np.testing.assert_array_equal(one, image.sel(band=["TM3"]))
    low = Geometry(60.0, 120.0)
    darker = fifesim.sense(toa, "TM", geometry=low)
    assert directions.geometry_of(darker) == low and darker.astype(int).sum() < image.astype(int).sum()


def test_pixels_of_another_size_warn_that_the_blur_stays(toa):
    """Native sampling is usual."""
    for cell in (20.0, 60.0):
        with pytest.warns(UserWarning, match=f"pixels of {cell:g} m have the blur of TM, .* of 30 m"):
            toa.fifesim.sense("TM", interval=cell)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message="pixels of")
        for interval in (25.0, 37.5, "native"):
            toa.fifesim.sense("TM", interval=interval)


# ------------------------------------------------------------------------------------------ pixels

INTERVAL = 43e-6 * 705e3
WIDE = replace(PAPER, lsf=responses.CosineResponse("cosine", step=4.778e-5, count=90))


def light(shape=(180, 198), values=None, row=90, column=180):
    grid = fifesim.fife_site(30 / 9, window=((row, row + shape[0]), (column, column + shape[1])))
    values = np.random.default_rng(2).uniform(10.0, 90.0, (2, *shape)) if values is None else values
    values = np.broadcast_to(values, (2, *shape))
    return products.radiance(values, grid, ["TM3", "TM4"])


def sensed(array, tm=PAPER, **options):
    return fifesim.sense(array, tm, quantise=False, **options)


def test_native_interval_sets_the_coordinates():
    image = check_raster_function(lambda toa: sensed(toa, interval="native"), light(), quantity="toa_radiance")
    np.testing.assert_allclose(np.diff(image["x"]), INTERVAL, rtol=0, atol=1e-6)
    corner = grids.geobox(light()).affine
    np.testing.assert_allclose([image["x"][0], image["y"][0]], [corner.c + INTERVAL / 2, corner.f - INTERVAL / 2])
    onto = fifesim.grid_at("EPSG:26914", corner.c, corner.f, 21 * INTERVAL, 19 * INTERVAL, INTERVAL)
    xr.testing.assert_allclose(image, sensed(light(), onto=onto), rtol=1e-9)
    # The interval may differ between rows and columns.
    assert grids.cell_size(grids.geobox(sensed(light(), interval=(60.0, 22.0)))) == (60.0, 22.0)


@pytest.mark.parametrize("offset", [(0.0, 0.25), (0.5, 0.0), (-0.3, 1.2)])
def test_offset_shifts_the_image_but_not_the_coordinates(offset):
    """A ramp shifts by slope times offset, exactly for an offset of whole cells."""
    y, x = np.meshgrid(np.arange(180) * 10 / 3, np.arange(198) * 10 / 3, indexing="ij")
    ramp = light(values=np.stack([0.01 * y + x] * 2))
    nominal, moved = sensed(ramp), sensed(ramp, offset=offset)
    np.testing.assert_array_equal(moved["x"], nominal["x"])
    np.testing.assert_array_equal(moved["y"], nominal["y"])
    inside = np.s_[:, 2:-2, 2:-2]
    # The ramp is constant within a cell: 0.01 cells.
    shift = 30 * (0.01 * offset[0] + offset[1])
    np.testing.assert_allclose((moved - nominal).values[inside], shift, rtol=0, atol=0.06)
    exact = sensed(ramp, offset=(0.0, 10 / 30)) - nominal
    np.testing.assert_allclose(exact.values[inside], 10.0, rtol=1e-10)


def test_offset_may_differ_by_column():
    """Pixels at the native interval on the product grid drift by 0.315 m per pixel."""
    steps = (np.arange(20) + 0.5) * (INTERVAL - 30) / 30
    drifting = sensed(light(), offset=(0.0, np.append(steps, [0.0, 0.0])), interval=30.0)
    onto = grids.geobox(sensed(light(), interval=(30.0, INTERVAL)))
    np.testing.assert_allclose(drifting[..., :20], sensed(light(), onto=onto)[..., :20], rtol=1e-10)
    jitter = np.random.default_rng(1).normal(0, 1.5, 20), -0.2
    check_raster_function(lambda toa: sensed(toa, offset=jitter), light(), quantity="toa_radiance")


def test_rows_use_the_along_track_response():
    """A point is smeared by a wide boxcar southward and by a narrow one eastward."""
    along, across = (responses.BoxcarResponse("boxcar", width=width / 705e3) for width in (90, 30))
    values = np.zeros((2, 180, 198))
    values[:, 94, 94] = 1000.0
    image = sensed(light(values=values), replace(PAPER, lsf=responses.TwoAxesResponse(along, across))).values
    assert (image[0] > 1e-9).sum(axis=0).max() == 3 and (image[0] > 1e-9).sum(axis=1).max() == 1


def test_bands_may_have_different_spatial_responses():
    other = replace(PAPER.bands[3], lsf=responses.GaussianResponse("gaussian", fwhm=60 / 705e3))
    mixed = replace(PAPER, bands=(*PAPER.bands[:3], other, *PAPER.bands[4:]))
    small = light((90, 99))
    image = check_raster_function(lambda toa: sensed(toa, mixed), small, quantity="toa_radiance")
    np.testing.assert_array_equal(image.sel(band="TM3"), sensed(small).sel(band="TM3"))
    np.testing.assert_array_equal(image.sel(band="TM4"), sensed(small, replace(PAPER, lsf=other.lsf)).sel(band="TM4"))
    turned = sensed(small.isel(band=[1, 0]), mixed)
    np.testing.assert_array_equal(turned.isel(band=[1, 0]), image)


def test_point_spread_must_mostly_lie_in_the_scene():
    assert np.isfinite(sensed(light(), WIDE, min_valid=0.01)).all()
    with pytest.raises(ValueError, match=r"point spread of TM TM3, TM4, 3031\.6 x 3031\.6 m, is wider than the scene"):
        sensed(light(), WIDE)
    boxes, pixels = (Boxcar(200.0), Boxcar(100.0)), fifesim.fife_site(30.0, ((0, 4), (0, 5)))
    check_scene(boxes, pixels, 0.6, "TM")
    with pytest.raises(ValueError, match="wider than the scene of 120 x 150 m, which holds 60% of it"):
        check_scene(boxes, pixels, 0.61, "TM")


def test_bands_of_different_pixel_sizes_form_a_tree_or_share_a_given_grid(site):
    mixed, msi = scene(site, ("MSI11", "MSI4", "MSI8")), instrument("MSI")
    with pytest.raises(ValueError, match=r"10 x 10 m: MSI4.*20 x 20 m: MSI11.*sense each group separately.*onto="):
        pixel_grid(site, msi, msi.select(["MSI4", "MSI11"]))
    noise = {"noise": "thermal", "seed": 3, "noise_models": NoiseModel(thermal=2.0, shot=0.01)}
    tree = fifesim.sense(mixed, "MSI", **noise)
    assert [node.path for node in tree.leaves] == ["/10m", "/20m"]
    for path, names in (("10m", ["MSI4", "MSI8"]), ("20m", ["MSI11"])):
        xr.testing.assert_identical(tree[path]["dn"], fifesim.sense(mixed.sel(band=names), "MSI", **noise))
        assert grids.cell_size(grids.geobox(tree[path]["dn"]))[0] == float(path.removesuffix("m"))
    with no_compute():
        lazy = fifesim.sense(in_chunks(mixed, ODD_CHUNKS), "MSI", **noise)
    xr.testing.assert_identical(lazy.compute(), tree)
    native = fifesim.sense(mixed, "MSI", interval="native", quantise=False)
    assert all(set(node.data_vars) == {"toa_radiance"} for node in native.leaves) and len(native.leaves) == 2
    for where in ({"interval": 20.0}, {"onto": grids.aligned_grid(site, 30.0)}):
        assert fifesim.sense(mixed, "MSI", **where)["band"].values.tolist() == ["MSI11", "MSI4", "MSI8"]


# ------------------------------------------------------------------------------------------ digital numbers

LOW_SUN = Geometry(50.0, 120.0, 7.0, 280.0, earth_sun_distance=1.0148)
UTM = fifesim.grid_at("EPSG:32614", 705000.0, 4334000.0, 240.0, 180.0, 10.0)


def bright(name):
    """Red and near-infrared reflectance for an instrument, with one missing cell."""
    near_infrared = 0.835 if "MSI" in name else 0.86
    found = scene(UTM, (1, 2), LOW_SUN, seed=5, wavelength=("band", [0.66, near_infrared])) * 1.8
    found[:, 4, 5] = np.nan
    return found.drop_vars("band")


@pytest.mark.parametrize(("name", "gain"), [("OLI", 2e-5), ("MSI-B", 1e-4)])
def test_product_numbers_follow_the_handbook_formula(name, gain):
    """Decoding with the formula gives the reflectance within half a count; numbers of OLI hold the solar cosine."""
    sza = ("y", "x"), np.linspace(40, 41, UTM.shape.y * UTM.shape.x).reshape(UTM.shape)
    onto = fifesim.grid_at("EPSG:32614", 705000.0, 4334000.0, 240.0, 180.0, 30.0)
    toa = bright(name).assign_coords(sza=sza) if name == "OLI" else bright(name)
    image = toa.fifesim.sense(name, scaling="product", onto=onto)
    assert image.dtype == np.uint16 and toa.fifesim.sense(name, onto=onto).max() <= 4095
    fine = toa.fifesim.sense(name, quantise=False, onto=onto).fifesim.to_reflectance()
    mu_s = np.cos(np.radians(image["sza"])) if name == "OLI" else xr.ones_like(image[0])
    by_hand = (image.astype(float).where(image > 0) * gain - 0.1) / mu_s
    assert float(abs(by_hand - fine).max()) <= 0.5 * gain / float(mu_s.min()) * (1 + 1e-9)
    np.testing.assert_allclose(image.fifesim.to_reflectance(), by_hand, rtol=0, atol=1e-12)
    with pytest.raises(ValueError, match="scaling='product' of MSI needs one direction of sun"):
        bright("MSI").assign_coords(sza=sza).fifesim.sense("MSI", scaling="product")


def clouded(bands):
    """Reflectance of a white cloud (0.8, 0.79) over the western half of grass (0.1, 0.35)."""
    values = np.broadcast_to(np.array([0.1, 0.35])[:, None, None], (2, 60, 60)).copy()
    values[..., :30] = np.array([0.8, 0.79])[:, None, None]
    grid = fifesim.fife_site(10, window=((0, 60), (0, 60)))
    return products.labelled(values, grid, bands, {"standard_name": "toa_bidirectional_reflectance"})


@pytest.mark.parametrize(
    ("name", "bands", "options", "largest"),
    [
        ("TM", ["TM3", "TM4"], {}, 255),
        ("MSS", ["MSS5", "MSS7"], {"onto": fifesim.fife_site(60, window=((1, 9), (1, 9)))}, 63),
        # Its range includes white clouds.
        ("OLI", ["OLI4", "OLI5"], {"scaling": "product"}, 65535),
    ],
)
@pytest.mark.parametrize("way", ["memory", "lazy", "file", "float"])
def test_saturated_pixels_are_no_data_in_derived_images(name, bands, options, largest, way, tmp_path):
    image = fifesim.sense(clouded(bands), name, geometry=LOW_SUN, min_valid=0.5, **options)
    assert image.attrs["saturated"] == largest
    full, missing = image.values == largest, image.values == 0
    if way == "lazy":
        with no_compute():
            assert "saturated_pixels" not in fifesim.ndvi(in_chunks(image, {"y": 3, "x": 3})).attrs
    if way == "file":
        image = fifesim.open_image(image.fifesim.to_geotiff(tmp_path / "image.tif"))
    if way == "float":
        image = image.where(image > 0)
    gone = full | missing
    for light in (fifesim.sensor.to_radiance(image), fifesim.to_reflectance(image)):
        np.testing.assert_array_equal(np.isnan(light), gone)
        assert light.attrs.get("saturated_pixels", 0) == full.any(0).sum()
    for index in (fifesim.ndvi(image), fifesim.index(image, "EVI2"), fifesim.ndvi(fifesim.to_reflectance(image))):
        np.testing.assert_array_equal(np.isnan(index), gone.any(0))
        assert index.attrs.get("saturated_pixels", 0) == full.any(0).sum()


def test_counts_of_landsat_1_are_on_a_square_root_scale(tmp_path):
    """Six bits from nearly dark to full scale; radiance round trips within half a count."""
    full, names = np.array([band.full_scale_radiance for band in MSS.bands]), [band.name for band in MSS.bands]
    grid = fifesim.fife_site(20.0, window=((0, 60), (0, 66)))
    values = np.random.default_rng(4).uniform(0.02, 0.98, (4, *grid.shape)) * full[:, None, None]
    radiance = products.radiance(values, grid, names)
    image = check_raster_function(lambda toa: fifesim.sense(toa, "MSS"), radiance, quantity="dn")
    assert image["compression"].values.tolist() == [63, 63, 63, 0]
    means = fifesim.sense(radiance, "MSS", quantise=False).values
    share = means / full[:, None, None]
    counts = np.where(np.arange(4)[:, None, None] < 3, 63 * np.sqrt(share), 63 * share)
    np.testing.assert_array_equal(image, np.nan_to_num(np.rint(counts)))
    back = check_raster_function(fifesim.sensor.to_radiance, image, quantity="toa_radiance")
    assert not {"gain", "offset", "compression"} & set(back.coords)
    # The counts n - 1/2 and n + 1/2 are 2 n / 63 linear steps apart.
    step = full[:, None, None] / 63 * np.where(np.arange(4)[:, None, None] < 3, 2 * image.values / 63, 1)
    seen = image.values > 0
    assert (np.abs(back.values - means) <= 0.5 * step * (1 + 1e-9))[seen].all() and np.isnan(back.values[~seen]).all()
    assert "compression" not in fifesim.sense(back.isel(band=[3]), "MSS").coords
    xr.testing.assert_identical(fifesim.open_image(fifesim.to_geotiff(image, tmp_path / "mss.tif")), image)
    user = image.drop_vars(["gain", "offset", "compression"])
    np.testing.assert_array_equal(fifesim.sensor.to_radiance(fifesim.calibrate(user, "MSS")), back)
    linear = fifesim.calibrate(user, "MSS", gain=1.0, offset=0.0)
    np.testing.assert_array_equal(fifesim.sensor.to_radiance(linear), user.where(user > 0))


# ------------------------------------------------------------------------------------------ noise


# Radiance of each band.
UNIFORM = np.array([40.0, 90.0])[:, None, None]


def test_noise_does_not_depend_on_chunks_windows_or_bands():
    for quantity, quantise in (("dn", True), ("toa_radiance", False)):
        options = {"noise": ALL, "seed": 3, "quantise": quantise}
        noisy_image = partial(fifesim.sense, instrument=NOISY, **options)
        check_raster_function(noisy_image, light((90, 99), UNIFORM), quantity=quantity)
    whole = fifesim.sense(light((180, 198), UNIFORM), NOISY, noise=ALL, seed=3)
    window = fifesim.sense(light((90, 99), UNIFORM, row=180, column=225), NOISY, noise=ALL, seed=3)
    np.testing.assert_array_equal(window, whole.sel(y=window["y"], x=window["x"]))
    assert whole.attrs["history"].endswith("sense: TM, 8 bits, noise shot thermal fixed-pattern, seed 3")
    one = fifesim.sense(light((180, 198), UNIFORM).sel(band=["TM4"]), NOISY, noise=ALL, seed=3)
    np.testing.assert_array_equal(one, whole.sel(band=["TM4"]))


def test_all_noise_uses_every_defined_kind_and_models_override():
    def seen(name=NOISY, noise="all", bands=("TM3", "TM4"), **options):
        return fifesim.sense(light((270, 297), UNIFORM).sel(band=list(bands)), name, noise=noise, seed=3, **options)

    np.testing.assert_array_equal(seen(), seen(noise=ALL))
    models = {"noise_models": {"tm3": NoiseModel(0.8, 0.0)}}
    mixed = seen(**models)
    np.testing.assert_array_equal(mixed.sel(band="TM4"), seen().sel(band="TM4"))
    np.testing.assert_array_equal(mixed.sel(band=["TM3"]), seen(noise="thermal", bands=["TM3"], **models))
    both = seen(PAPER, "thermal", noise_models=NoiseModel(0.8, 0.0), quantise=False)
    # 810 pixels: four standard errors.
    assert float(both.sel(band="TM3").std()) == pytest.approx(0.8, rel=0.1)


@pytest.mark.parametrize("chunk", [1, 2])
def test_noise_does_not_depend_on_band_chunks(chunk):
    """Each band uses its number in the instrument and its noise model, wherever its chunk begins."""
    names = ["TM5", "TM1", "TM4", "TM3", "TM2"]
    models = {name: NoiseModel(0.2 + 0.1 * k, 0.01) for k, name in enumerate(names)}
    radiance = xr.DataArray(np.full((5, 9, 11), 50.0), dims=("band", "y", "x"))
    bands, kinds = TM.select(names), ("shot", "thermal")
    parts = noisy(radiance.chunk(band=chunk, y=4), TM, bands, kinds, 5, (3, 4), models)
    for layer, name in enumerate(names):
        number = [band.name for band in TM.bands].index(name)
        alone = add_noise(radiance.values[layer], models[name], kinds, seed=5, band=number, row=3, column=4)
        np.testing.assert_array_equal(parts[layer], alone)
