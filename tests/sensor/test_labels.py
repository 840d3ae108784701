"""Sensor on labelled rasters: images, calibration, digital numbers of products, and noise."""

import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import products
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, check_raster_function, in_chunks, no_compute

import fifesim
from fifesim.base.footprints import axis_operator, regularize
from fifesim.base.geometry import Geometry
from fifesim.grids import cf, directions
from fifesim.grids import grid as grids
from fifesim.sensor.description.instrument_file import Noise
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.labels import noisy
from fifesim.sensor.response import calibration
from fifesim.sensor.response.noise import NoiseModel, add_noise

TM, PAPER = instrument("TM"), instrument("TM", "paper")
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
BARE = NoiseModel(0.5, 0.0)
SILENT = replace(PAPER, bands=tuple(replace(band, noise=None) for band in TM.bands))


def scene(grid, bands=("TM3", "TM4"), sun=SUN, seed=2, **coords):
    """Random top-of-atmosphere reflectance in each cell."""
    values = np.random.default_rng(seed).uniform(0.02, 0.5, (len(bands), *grid.shape))
    return directions.with_geometry(products.labelled(values, grid, list(bands), coords), sun)


@pytest.fixture
def toa(site):
    return scene(site)


def radiance_by_kernels(toa, pixels):
    """Radiance of pixels from direct calls of the footprint and calibration kernels."""
    cells = grids.geobox(toa)
    rows, columns = (
        axis_operator(
            TM.line_spread, cell_origin=origin, cell_size=cell, n_cells=n, pixel_origin=start, pixel_size=size,
            n_pixels=count,
        )
        for origin, cell, n, start, size, count in (
            (cells.affine.f, cells.affine.e, cells.shape.y, pixels.affine.f, pixels.affine.e, pixels.shape.y),
            (cells.affine.c, cells.affine.a, cells.shape.x, pixels.affine.c, pixels.affine.a, pixels.shape.x),
        )
    )  # fmt: skip
    sun = np.array([band.solar_irradiance for band in RED_NIR])[:, None, None]
    means = regularize(toa.values, rows, columns)
    return calibration.reflectance_to_radiance(means, sun, SUN.mu_s, SUN.earth_sun_distance)


ONTO = {
    "aligned": None,
    "offset": fifesim.grid_at("EPSG:26914", 705581.3, 4333911.9, 110.0, 95.0, 30.0),
    "own-interval": fifesim.grid_at("EPSG:26914", 705571.0, 4333919.0, 150.0, 130.0, 30.315),
    "beyond-the-scene": fifesim.grid_at("EPSG:26914", 705520.0, 4333960.0, 300.0, 300.0, 30.0),
}


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
    assert "gain drift" in found.attrs["history"]
    lazy = in_chunks(toa, ODD_CHUNKS).fifesim.sense("TM", gain_drift=0.9)
    np.testing.assert_array_equal(lazy.values, toa.fifesim.sense("TM", gain_drift=0.9).values)


@pytest.mark.parametrize("onto", ONTO.values(), ids=ONTO.keys())
def test_sense_follows_the_raster_rules_and_equals_the_kernels(toa, site, onto):
    image = check_raster_function(lambda toa: fifesim.sense(toa, "TM", onto=onto), toa, quantity="dn")
    pixels = grids.aligned_grid(site, 30.0) if onto is None else onto
    assert grids.same_grid(grids.geobox(image), pixels)
    full, low = ([getattr(band, f"{name}_radiance") for band in RED_NIR] for name in ("full_scale", "min"))
    gain, offset = (each[:, None, None] for each in calibration.gain_offset(full, low, 8))
    radiance = radiance_by_kernels(toa, pixels)
    np.testing.assert_array_equal(image, calibration.radiance_to_dn(radiance, gain, offset, bits=8))
    assert image.dtype == np.uint8 and (image > 0).any()
    # Half a count, plus rounding of a division.
    inside = (image.values > 1) & (image.values < 255)
    assert (np.abs(fifesim.sensor.to_radiance(image).values - radiance) <= 0.5 * gain * (1 + 1e-9))[inside].all()


def test_pixels_over_missing_cells_are_no_data(toa):
    toa[0, 20:26, 20:26] = np.nan
    image = fifesim.sense(toa, PAPER)
    assert (image.sel(band="TM3") == 0).sum() == 1 and (image.sel(band="TM4") > 0).all()
    assert (fifesim.sense(toa, PAPER, min_valid=0.3) > 0).all()


def test_radiance_and_reflectance_follow_the_raster_rules(toa):
    image = fifesim.sense(toa.where(toa["x"] > 705640), "TM")
    for name in ("gain", "offset", "wavelength", "solar_irradiance"):
        assert image[name].dims == ("band",) and cf.attributes(name).items() <= image[name].attrs.items()
    assert image["solar_irradiance"].values.tolist() == [band.solar_irradiance for band in RED_NIR]
    assert image.attrs["instrument"] == "TM" and directions.geometry_of(image) == SUN
    assert image.attrs["_FillValue"] == 0 and image.attrs["_FillValue"].dtype == image.dtype
    radiance = check_raster_function(fifesim.sensor.to_radiance, image, quantity="toa_radiance")
    reflectance = check_raster_function(fifesim.to_reflectance, image, quantity="toa_reflectance")
    gain, offset, sun = (image[name].values[:, None, None] for name in ("gain", "offset", "solar_irradiance"))
    expected = calibration.dn_to_radiance(image.values, gain, offset)
    np.testing.assert_array_equal(radiance, expected)
    known = calibration.radiance_to_reflectance(expected, sun, SUN.mu_s, SUN.earth_sun_distance)
    np.testing.assert_array_equal(reflectance, known)
    assert (image == 0).any()
    np.testing.assert_array_equal(np.isnan(radiance), image == 0)
    np.testing.assert_array_equal(fifesim.to_reflectance(radiance), reflectance)


def test_sensing_radiance_equals_sensing_reflectance(toa):
    """Digital numbers may differ by 1 where the values lie halfway between counts."""
    sun = np.array([band.solar_irradiance for band in RED_NIR])[:, None, None]
    radiance = toa.copy(data=calibration.reflectance_to_radiance(toa.values, sun, SUN.mu_s, SUN.earth_sun_distance))
    radiance.attrs = {"units": "W m-2 sr-1 um-1"}
    difference = fifesim.sense(radiance, "TM").astype(int) - fifesim.sense(toa, "TM").astype(int)
    assert (difference == 0).mean() > 0.99 and np.abs(difference).max() <= 1


def test_one_band_becomes_an_image_of_one_band(toa):
    one = fifesim.sense(toa.sel(band="TM3").assign_coords(band="tm3"), "TM")
    assert one.dims == ("band", "y", "x")
    np.testing.assert_array_equal(one, fifesim.sense(toa, "TM").sel(band=["TM3"]))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda toa: fifesim.sense(toa.assign_attrs(units="K"), "TM"), "units 'K', toa_reflectance needs '1' or 'W"),
        (lambda toa: fifesim.sense(toa.drop_vars("band"), "TM"), "neither names of TM.*nor a wavelength"),
        (
            lambda toa: fifesim.sense(toa, "TM", scaling="product"),
            "TM has no product scaled to reflectance, unlike OLI",
        ),
        (lambda toa: fifesim.sense(toa, "TM", scaling="product", quantise=False), "is one of digital numbers"),
        (lambda toa: fifesim.sense(toa, "TM", gain_drift=0.0), "gain_drift must be a factor from 0.1 to 10, got 0"),
        (lambda toa: fifesim.sense(toa, "TM", gain_drift={"TM3": 1.0}), "gain_drift has no number for TM4: it has TM3"),
        (lambda toa: fifesim.sense(toa, "TM", gain_drift=[1.0, 2.0, 3.0]), "one for each of 2 bands, got a list of 3"),
        (lambda toa: fifesim.sense(toa, SILENT, noise="shot"), "TM has no noise for TM3"),
        (lambda toa: fifesim.sense(toa, NOISY, noise=["all", "shot"]), "'all' alone"),
        (
            lambda toa: fifesim.sense(toa, NOISY, noise=ALL, noise_models=BARE),
            r"TM has no shot and no fixed-pattern noise for TM3.*noise_models=\{'TM3'",
        ),
        (lambda toa: fifesim.sense(toa, NOISY, noise="shot", noise_models={"TM4": BARE}), "no shot noise for TM4"),
        (lambda toa: fifesim.sense(toa, NOISY, noise="all", noise_models={"TM33": BARE}), "'TM33': did you mean TM3"),
        (
            lambda toa: fifesim.sensor.to_radiance(fifesim.sense(toa, "TM").drop_vars("gain")),
            r"no gain: .*fifesim\.open_image",
        ),
        (lambda toa: fifesim.sensor.to_radiance(fifesim.sense(toa, "TM").assign_attrs(units="m")), "'m', dn needs '1'"),
    ],
)
def test_invalid_input_raises(toa, call, message):
    with pytest.raises(ValueError, match=message):
        call(toa)


def test_pixels_of_another_size_warn_that_the_blur_stays(toa, site):
    """Also in comparisons and adjustments. Native sampling, and one grid for bands of several sizes, are usual."""
    box = site.boundingbox

    def onto(cell):
        return fifesim.grid_at(site.crs, box.left, box.top, 600, 600, cell=cell)

    lai = fifesim.lai_scene(site, seed=7)
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    verbs = [
        lambda cell: toa.fifesim.sense("TM", onto=onto(cell)),
        lambda cell: toa.fifesim.sense("TM", interval=cell),
        lambda cell: rho.fifesim.as_seen_by("OLI", bands=["OLI4", "OLI5"], onto=onto(cell)),
        lambda cell: lai.fifesim.compare(["TM"], fifesim.Setup(onto=onto(cell))),
    ]
    for verb in verbs:
        for cell in (20.0, 60.0):
            with pytest.warns(UserWarning, match=f"pixels of {cell:g} m have the blur of (TM|OLI), .* of 30 m"):
                verb(cell)
        with warnings.catch_warnings():
            warnings.filterwarnings("error", message="pixels of")
            verb(25.0), verb(37.5)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message="pixels of")
        toa.fifesim.sense("TM", interval="native")


def test_geometry_argument_overrides_coordinates(toa):
    low = Geometry(60.0, 120.0)
    image = fifesim.sense(toa, "TM", geometry=low)
    assert directions.geometry_of(image) == low
    assert image.astype(int).sum() < fifesim.sense(toa, "TM").astype(int).sum()


# ------------------------------------------------------------------------------------------ several resolutions


@pytest.fixture
def mixed(site):
    return scene(site, ("MSI11", "MSI4", "MSI8"))


def test_bands_of_different_pixel_sizes_form_a_tree(mixed):
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


def test_one_resolution_or_a_given_grid_returns_an_array(mixed, site, tmp_path):
    assert isinstance(fifesim.sense(mixed.sel(band=["MSI4", "MSI8"]), "MSI"), xr.DataArray)
    for where in ({"interval": 20.0}, {"onto": grids.aligned_grid(site, 30.0)}):
        assert fifesim.sense(mixed, "MSI", **where)["band"].values.tolist() == ["MSI11", "MSI4", "MSI8"]
    tree = fifesim.sense(mixed, "MSI")
    with pytest.raises(TypeError, match=r"got an xarray.DataTree of 10m, 20m: take one of its arrays, such as"):
        fifesim.to_geotiff(tree, tmp_path / "image.tif")
    path = fifesim.to_geotiff(tree["10m/dn"], tmp_path / "image_10m.tif")
    np.testing.assert_array_equal(fifesim.open_image(path), tree["10m/dn"])


# ------------------------------------------------------------------------------------------ digital numbers

LOW_SUN = Geometry(50.0, 120.0, 7.0, 280.0, earth_sun_distance=1.0148)
UTM = fifesim.grid_at("EPSG:32614", 705000.0, 4334000.0, 240.0, 180.0, 10.0)


def bright(name):
    """Red and near-infrared reflectance for an instrument, with one missing cell."""
    near_infrared = 0.835 if "MSI" in name else 0.86
    found = scene(UTM, (1, 2), LOW_SUN, seed=5, wavelength=("band", [0.66, near_infrared])) * 1.8
    found[:, 4, 5] = np.nan
    return found.drop_vars("band")


@pytest.mark.parametrize(
    ("name", "gain", "mu_s"),
    [("OLI", 2e-5, LOW_SUN.mu_s), ("OLI2", 2e-5, LOW_SUN.mu_s), ("MSI", 1e-4, 1.0), ("MSI-B", 1e-4, 1.0)],
)
def test_product_numbers_follow_the_handbook_formula(name, gain, mu_s, tmp_path):
    """Decoding with the formula of the product handbook gives the reflectance within half a count."""
    onto = fifesim.grid_at("EPSG:32614", 705000.0, 4334000.0, 240.0, 180.0, 30.0)
    image = bright(name).fifesim.sense(name, scaling="product", onto=onto)
    assert image.dtype == np.uint16
    fine = bright(name).fifesim.sense(name, quantise=False, onto=onto).fifesim.to_reflectance()
    by_hand = (image.astype(float).where(image > 0) * gain - 0.1) / mu_s
    assert float(abs(by_hand - fine).max()) <= 0.5 * gain / mu_s * (1 + 1e-9)
    np.testing.assert_allclose(image.fifesim.to_reflectance(), by_hand, rtol=0, atol=1e-12)
    assert "scaling product" in image.attrs["history"] and "16 bits" in image.attrs["history"]
    again = fifesim.open_image(image.fifesim.to_geotiff(tmp_path / "image.tif"))
    np.testing.assert_array_equal(again, image)
    np.testing.assert_array_equal(again.fifesim.ndvi(), image.fifesim.ndvi())


def test_detector_scaling_is_the_default():
    image = bright("OLI").fifesim.sense("OLI")
    assert int(image.max()) <= 4095
    xr.testing.assert_identical(image, bright("OLI").fifesim.sense("OLI", scaling="detector"))


def test_msi_product_scaling_needs_one_solar_direction():
    sza = ("y", "x"), np.linspace(40, 41, UTM.shape.y * UTM.shape.x).reshape(UTM.shape)
    varying = bright("OLI").assign_coords(sza=sza)
    image = varying.fifesim.sense("OLI", scaling="product")
    fine = varying.fifesim.sense("OLI", quantise=False).fifesim.to_reflectance()
    assert float(abs(image.fifesim.to_reflectance() - fine).max()) <= 0.5 * 2e-5 / np.cos(np.radians(41))
    with pytest.raises(ValueError, match="scaling='product' of MSI needs one direction of sun"):
        bright("MSI").assign_coords(sza=sza).fifesim.sense("MSI", scaling="product")


@pytest.fixture(scope="module")
def image():
    dn = np.random.default_rng(8).integers(1, 256, (2, *UTM.shape)).astype(np.uint8)
    dn[:, 1, 1] = 0
    return fifesim.calibrate(products.labelled(dn, UTM, ["TM3", "TM4"], {}), "TM", geometry=LOW_SUN)


CHANGES = {
    "radiance": lambda image: image * image.gain + image.offset,
    "half": lambda image: image * 0.5,
    "doubled": lambda image: image.astype(np.int32) * 2,
    "negative": lambda image: image.astype(np.int16) - 100,
    "wider": lambda image: image.astype(np.uint16) * np.uint16(2),
}
VERBS = {
    "radiance": fifesim.sensor.to_radiance,
    "reflectance": fifesim.to_reflectance,
    "ndvi": fifesim.ndvi,
    "index": lambda image: fifesim.index(image, "EVI2"),
    "surface": lambda image: fifesim.to_surface(image, fifesim.Atmosphere()),
}


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("change", CHANGES)
def test_values_that_are_not_digital_numbers_raise(image, change, verb):
    with xr.set_options(keep_attrs=True):
        changed = CHANGES[change](image).assign_attrs(units="1")
    with pytest.raises(ValueError, match=r"is not a whole number from 0 to (255|65535): calibrate with .*drop_vars"):
        VERBS[verb](changed)
    with no_compute():
        lazy = VERBS[verb](in_chunks(changed, {"y": 5, "x": 7}))
    with pytest.raises(ValueError, match="is not a whole number"):
        lazy.compute()


@pytest.mark.parametrize("change", ["kept", "dropped"])
def test_radiance_computed_by_hand_is_not_calibrated_again(image, change):
    """Arithmetic keeps attributes since xarray 2025.11; before, it dropped them."""
    with xr.set_options(keep_attrs=change == "kept"):
        radiance = image * image.gain + image.offset
    radiance = radiance.assign_attrs(units="W m-2 sr-1 um-1") if change == "kept" else radiance
    with pytest.raises(ValueError, match=r"type \.drop_vars\(\['gain', 'offset'\]\)\.assign_attrs"):
        fifesim.ndvi(radiance.rio.write_crs(image.rio.crs))
    remedied = radiance.where(image > 0).drop_vars(["gain", "offset"]).assign_attrs(units="W m-2 sr-1 um-1")
    np.testing.assert_allclose(fifesim.ndvi(remedied.rio.write_crs(image.rio.crs)), fifesim.ndvi(image), rtol=1e-12)


@pytest.mark.parametrize("dtype", [np.uint16, np.int16, np.float32, np.float64])
def test_digital_numbers_of_another_type_are_calibrated(image, dtype):
    np.testing.assert_array_equal(fifesim.sensor.to_radiance(image.astype(dtype)), fifesim.sensor.to_radiance(image))
    masked = image.astype(np.float32).where(image > 0)
    np.testing.assert_array_equal(fifesim.sensor.to_radiance(masked), fifesim.sensor.to_radiance(image))


# ------------------------------------------------------------------------------------ saturation


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
        (replace(instrument("TM"), bits=10), ["TM3", "TM4"], {}, 1023),
        ("MSS", ["MSS5", "MSS7"], {"onto": fifesim.fife_site(60, window=((1, 9), (1, 9)))}, 63),
        # Their ranges include white clouds.
        ("OLI", ["OLI4", "OLI5"], {}, 4095),
        ("OLI", ["OLI4", "OLI5"], {"scaling": "product"}, 65535),
    ],
)
@pytest.mark.parametrize("way", ["memory", "lazy", "file", "netcdf", "float"])
def test_saturated_pixels_are_no_data_in_derived_images(name, bands, options, largest, way, tmp_path):
    toa = clouded(bands)
    image = fifesim.sense(toa, name, geometry=LOW_SUN, min_valid=0.5, **options)
    assert image.attrs["saturated"] == largest
    counts = image.values
    if way == "lazy":
        with no_compute():
            seen = fifesim.ndvi(in_chunks(image, {"y": 3, "x": 3}))
        assert "saturated_pixels" not in seen.attrs
    if way == "file":
        image = fifesim.open_image(image.fifesim.to_geotiff(tmp_path / "image.tif"))
    if way == "netcdf":
        image.to_netcdf(tmp_path / "image.nc")
        image = xr.open_dataset(tmp_path / "image.nc", decode_coords="all")["dn"]
    if way == "float":
        image = image.where(image > 0)
    full = counts == largest
    gone = full | (counts == 0)
    for light in (fifesim.sensor.to_radiance(image), fifesim.to_reflectance(image)):
        np.testing.assert_array_equal(np.isnan(light), gone)
        assert light.attrs.get("saturated_pixels", 0) == full.any(0).sum()
    for index in (fifesim.ndvi(image), fifesim.index(image, "EVI2"), fifesim.ndvi(fifesim.to_reflectance(image))):
        np.testing.assert_array_equal(np.isnan(index), gone.any(0))
        assert index.attrs.get("saturated_pixels", 0) == full.any(0).sum()


def test_saturated_cloud_is_no_grass_in_a_composite():
    """On the second date the sky is clear over bare soil, with an NDVI of 0.1 that is below the 0.2 of the counts."""
    toa = clouded(["TM3", "TM4"])
    soil = toa.copy(data=np.broadcast_to(np.array([0.27, 0.33])[:, None, None], toa.shape))
    times = xr.DataArray(np.array(["1987-06-06", "1987-06-22", "1987-07-08"], "M8[ns]"), dims="time", name="time")
    images = fifesim.sense(xr.concat([toa, soil, toa], times), "TM", geometry=LOW_SUN, min_valid=0.5)
    reflectance = fifesim.to_reflectance(images)
    assert reflectance.attrs["saturated_pixels"] == (images == 255).any("band").sum()
    best = fifesim.composite(reflectance)
    assert (best.date.isel(x=slice(0, 9)) == times[1]).all() and (best.date.isel(x=slice(11, None)) == times[0]).all()
    assert "saturated_pixels" not in best.attrs


# ------------------------------------------------------------------------------------------ noise


def uniform(shape, row=0, column=0):
    """Radiance raster with one value per band."""
    grid = fifesim.fife_site(30 / 9, window=((row, row + shape[0]), (column, column + shape[1])))
    values = np.broadcast_to([[[40.0]], [[90.0]]], (2, *shape))
    return products.radiance(values, grid, ["TM3", "TM4"])


def test_noise_does_not_depend_on_chunks_windows_or_bands():
    for quantity, quantise in (("dn", True), ("toa_radiance", False)):
        options = {"noise": ALL, "seed": 3, "quantise": quantise}
        noisy_image = partial(fifesim.sense, instrument=NOISY, **options)
        check_raster_function(noisy_image, uniform((90, 99)), quantity=quantity)
    whole = fifesim.sense(uniform((180, 198)), NOISY, noise=ALL, seed=3)
    window = fifesim.sense(uniform((90, 99), row=90, column=45), NOISY, noise=ALL, seed=3)
    np.testing.assert_array_equal(window, whole.sel(y=window["y"], x=window["x"]))
    assert whole.attrs["history"].endswith("sense: TM, 8 bits, noise shot thermal fixed-pattern, seed 3")
    assert fifesim.sense(uniform((90, 99)), NOISY).attrs["history"].endswith("sense: TM, 8 bits")
    one = fifesim.sense(uniform((180, 198)).sel(band=["TM4"]), NOISY, noise=ALL, seed=3)
    np.testing.assert_array_equal(one, whole.sel(band=["TM4"]))


def test_all_noise_uses_every_defined_kind_and_models_override():
    def seen(name=NOISY, noise="all", bands=("TM3", "TM4"), **options):
        return fifesim.sense(uniform((270, 297)).sel(band=list(bands)), name, noise=noise, seed=3, **options)

    np.testing.assert_array_equal(seen(), seen(noise=ALL))
    models = {"noise_models": {"TM3": NoiseModel(0.8, 0.0)}}
    mixed = seen(**models)
    np.testing.assert_array_equal(mixed.sel(band="TM4"), seen().sel(band="TM4"))
    np.testing.assert_array_equal(mixed.sel(band=["TM3"]), seen(noise="thermal", bands=["TM3"], **models))
    np.testing.assert_array_equal(seen(noise_models={"tm3": NoiseModel(0.8, 0.0)}), mixed)
    both = seen(PAPER, "thermal", noise_models=NoiseModel(0.8, 0.0), quantise=False)
    # 810 pixels: four standard errors.
    assert float(both.sel(band="TM3").std()) == pytest.approx(0.8, rel=0.1)


@pytest.mark.parametrize("chunk", [1, 2, 3])
def test_noise_does_not_depend_on_band_chunks(chunk):
    """Each band uses its number in the instrument and its noise model, wherever its chunk begins."""
    names = ["TM5", "TM1", "TM4", "TM3", "TM2"]
    models = {name: NoiseModel(0.2 + 0.1 * k, 0.01) for k, name in enumerate(names)}
    radiance = xr.DataArray(np.full((5, 9, 11), 50.0), dims=("band", "y", "x"))
    bands, kinds = TM.select(names), ("shot", "thermal")
    whole = noisy(radiance, TM, bands, kinds, 5, (3, 4), models)
    parts = noisy(radiance.chunk(band=chunk, y=4), TM, bands, kinds, 5, (3, 4), models)
    np.testing.assert_array_equal(parts, whole)
    for layer, name in enumerate(names):
        number = [band.name for band in TM.bands].index(name)
        alone = add_noise(radiance.values[layer], models[name], kinds, seed=5, band=number, row=3, column=4)
        np.testing.assert_array_equal(whole[layer], alone)
