"""Comparison of instruments and engines, conversion from one instrument to another, and propagated noise."""

import warnings

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from lazy import check_raster_function, in_chunks, no_compute
from verification import tables

import fifesim
from fifesim.atmosphere.engines import band_terms
from fifesim.base import files
from fifesim.chain import adjustment
from fifesim.chain.adjustment import UNCERTAINTY, _beside
from fifesim.chain.comparison import compare_engines, engine_error
from fifesim.chain.noise_propagation import noise_std
from fifesim.grids import directions
from fifesim.grids import grid as grids
from fifesim.ground.canopy.spectra import library_spectra

# ------------------------------------------------------------------------------------------ instruments


def test_images_equal_the_chain(lai, site):
    names = {"TM": ["TM3", "TM4"], "OLI": ["OLI4", "OLI5"]}
    land = fifesim.landscape(site, seed=3, soil=fifesim.ground.Field(sd=0.03))
    for scene in (lai, land):
        images = scene.fifesim.compare(list(names))
        assert isinstance(images, xr.DataTree) and list(images.children) == ["TM", "OLI"]
        for name, bands in names.items():
            rho = scene.fifesim.surface_reflectance(name, bands=bands)
            xr.testing.assert_identical(images[name]["dn"], rho.fifesim.to_toa().fifesim.sense(name))
    with no_compute():
        lazy = fifesim.compare(in_chunks(lai, {"y": 23, "x": 27}), list(names))
    xr.testing.assert_identical(lazy["OLI"]["dn"].compute(), fifesim.compare(lai, ["OLI"])["OLI"]["dn"])


def test_resolutions_are_separate_nodes_and_rows(lai):
    """NDVI is missing without a red and a near infrared band."""
    with warnings.catch_warnings(action="error", category=UserWarning):
        images = fifesim.compare(lai, ["MSI", "TM"], bands={"MSI": ["MSI4", "MSI11"]})
    assert sorted(node.path for node in images.leaves) == ["/MSI/10m", "/MSI/20m", "/TM"]
    assert images["MSI/20m/dn"]["band"].values.tolist() == ["MSI11"]
    table = images.fifesim.comparison_table()
    assert table.index.tolist() == ["TM", "MSI/10m", "MSI/20m"] and "r2" not in table
    assert np.isnan(table.loc["MSI/10m", "ndvi_mean"]) and table.loc["MSI/10m", "bands"] == "MSI4"


def test_table_has_one_row_per_instrument(lai):
    images = fifesim.compare(in_chunks(lai, {"y": 23, "x": 27}), ["MSI", "TM"])
    table = images.fifesim.comparison_table(truth=lai)
    assert table.index.tolist() == ["MSI", "TM"] and table.index.name == "instrument"
    assert table.loc["TM", "bands"] == "TM3, TM4" and table["pixel"].tolist() == [10.0, 30.0]
    assert (table.loc["TM", "rows"], table.loc["TM", "columns"]) == (5, 6)
    ndvi = images["TM"]["dn"].fifesim.ndvi().compute()
    assert table.loc["TM", "ndvi_mean"] == pytest.approx(float(ndvi.mean()), rel=1e-14)
    assert table.loc["TM", "ndvi_sd"] == pytest.approx(float(ndvi.std(ddof=1)), rel=1e-14)
    fit = fifesim.regress(lai.fifesim.aggregate(30), ndvi)
    found = table.loc["TM", ["slope", "intercept", "r2", "n"]]
    np.testing.assert_allclose(found.astype(float), [fit.slope, fit.intercept, fit.r2, fit.n], rtol=1e-10)


# ------------------------------------------------------------------------------------------ engines

HAZE = fifesim.Atmosphere(aerosol="urban", visibility=6)


def setup_of(atmosphere=HAZE, bands=("TM4", "TM3")):
    return fifesim.Setup(atmosphere=atmosphere, geometry=fifesim.Geometry(70, 120, 0, 0), bands=bands)


@pytest.fixture(scope="module")
def both():
    return compare_engines(setup_of())


def test_comparison_has_the_terms_of_the_engine(both):
    """Reflectance from the equation of a uniform surface, written out."""
    bands = [fifesim.instrument("TM").select(name)[0].response for name in ("TM4", "TM3")]
    terms = band_terms(HAZE, bands, 70.0, 0.0, 120.0)
    found = both.sel(engine="5S")
    for name in ("path_reflectance", "transmittance_down", "transmittance_up", "spherical_albedo"):
        np.testing.assert_allclose(found[name], getattr(terms, name), rtol=1e-12)
    rho = both["surface_reflectance"].values
    ground = terms.transmittance_down * terms.transmittance_up * rho / (1 - rho * terms.spherical_albedo)
    expected = terms.gas_transmittance * (terms.path_reflectance + ground)
    np.testing.assert_allclose(found["toa_reflectance"], expected, rtol=1e-12)
    infrared, red = expected
    assert float(found["ndvi"]) == pytest.approx((infrared - red) / (infrared + red), rel=1e-12)
    assert float(both["sza"]) == 70 and "visibility=6" in both.attrs["atmosphere"]


def test_quick_error_agrees_with_the_bands(both):
    """
    Urban haze under a low sun: 5S is more than 2 % too bright in red and near infrared.

    The quick error uses one wavelength per band and no gases, which costs 0.5 %.
    """
    toa, found = both["toa_reflectance"], engine_error(setup_of())
    expected = toa.sel(engine="5S") / toa.sel(engine="successive-orders") - 1
    assert (expected > 0.02).all() and list(found) == ["TM4", "TM3"]
    np.testing.assert_allclose(list(found.values()), expected, atol=5e-3)
    exact = fifesim.Atmosphere(aerosol="urban", visibility=6, engine="successive-orders")
    assert engine_error(setup_of(exact)) == {"TM4": 0.0, "TM3": 0.0}


def test_quick_error_names_the_bands_in_any_order():
    """5S is 3 % too low in the red over leaves, in the case of the paper."""
    for bands in (("TM4", "TM3"), ("TM3", "TM4")):
        error = engine_error(fifesim.Setup(bands=bands))
        assert list(error) == list(bands)
        assert -0.04 < error["TM3"] < -0.02 < error["TM4"] < 0


def test_surface_reflectance_of_engines_can_be_given():
    found = compare_engines(setup_of(bands=("TM3",)), reflectance=0.25, engines="5S")
    assert found["surface_reflectance"].values.tolist() == [0.25] and "ndvi" not in found


# ------------------------------------------------------------------------------------------ noise

MODEL = fifesim.NoiseModel(0.5, 0.006, detectors=100, gain_spread=0.004, offset_spread=0.2)
METHODS = {"radiance": "to_radiance", "reflectance": "to_reflectance", "ndvi": "ndvi"}
# Reflectances at the top of the atmosphere, from a closed canopy to bright soil.
RED, NEAR_INFRARED = (0.02, 0.05, 0.1, 0.2, 0.3), (0.5, 0.4, 0.3, 0.3, 0.32)


@pytest.fixture(scope="module")
def toa():
    """100 x 100 pixels of OLI in five stripes, 20 pixels wide."""
    grid = fifesim.fife_site(30, window=((0, 100), (0, 100)))
    stripes = np.repeat(np.array([RED, NEAR_INFRARED]), 20, axis=1)
    values = np.broadcast_to(stripes[:, None], (2, 100, 100))
    raster = xr.DataArray(values, dims=("band", "y", "x"), coords={"band": ["OLI4", "OLI5"]}, attrs={"units": "1"})
    return directions.with_geometry(grids.place(raster, grid).assign_attrs(site="FIFE"), fifesim.fife_geometry())


@pytest.mark.parametrize("quantity", METHODS)
@pytest.mark.parametrize("model", [None, MODEL])
def test_propagated_noise_agrees_with_many_images(toa, quantity, model):
    """
    Standard deviations agree within 2 % in each stripe: 20 images of 2000 pixels have a relative standard error of 0.4
    %.

    Without a model, noise is shot and thermal noise of OLI; with a model, it includes the fixed pattern of 100
    detectors.
    """
    options = {"noise_models": model}
    std = toa.fifesim.sense("OLI").fifesim.noise_std(quantity, **options)
    exact = toa.fifesim.sense("OLI", quantise=False)
    expected = exact if quantity == "radiance" else getattr(exact.fifesim, METHODS[quantity])()
    squares = []
    for seed in range(20):
        image = toa.fifesim.sense("OLI", noise="all", seed=seed, **options)
        squares.append(((getattr(image.fifesim, METHODS[quantity])() - expected) / std) ** 2)
    mean = xr.concat(squares, "seed").coarsen(x=20).mean().mean(["seed", "y"])
    np.testing.assert_allclose(np.sqrt(mean), 1, atol=0.02)


def test_noise_std_is_a_raster_function_and_missing_by_pixel(toa):
    image = toa.fifesim.sense(fifesim.instrument("OLI", "detector")).copy(deep=True)
    image[0, 5, 6] = 0
    for quantity in METHODS:
        name = "ndvi_std" if quantity == "ndvi" else f"toa_{quantity}_std"
        found = check_raster_function(lambda each, what=quantity: each.fifesim.noise_std(what), image, quantity=name)
        assert found.attrs["history"].splitlines()[-1].startswith(f"noise_std: {quantity}, OLI, ")
        assert found.dims == (("y", "x") if quantity == "ndvi" else ("band", "y", "x"))
        assert np.argwhere(np.isnan(found.values)).tolist() == [[5, 6] if quantity == "ndvi" else [0, 5, 6]]


def test_saturated_pixels_have_no_noise(toa):
    image = fifesim.sense(toa.where(toa.x < toa.x[80], 2.0), "OLI")
    number = int((image == image.attrs["saturated"]).any("band").sum())
    std = noise_std(image, "reflectance", noise=())
    assert number and std.attrs["saturated_pixels"] == number
    np.testing.assert_array_equal(np.isnan(std), (image == 0) | (image == image.attrs["saturated"]))


def test_radiance_reflectance_and_digital_numbers_agree(toa):
    """Only quantisation differs, and its variance is the variance of a uniform error."""
    image = toa.fifesim.sense("OLI")
    radiance, reflectance = image.fifesim.to_radiance(), image.fifesim.to_reflectance()
    for quantity in METHODS:
        found = [each.fifesim.noise_std(quantity, noise_models=MODEL) for each in (radiance, reflectance)]
        np.testing.assert_allclose(*found, rtol=1e-12)
    of_numbers, of_radiance = (each.fifesim.noise_std("radiance", noise_models=MODEL) for each in (image, radiance))
    np.testing.assert_allclose(of_numbers**2 - of_radiance**2, image["gain"] ** 2 / 12 + 0 * of_radiance, rtol=1e-6)


def test_kinds_of_noise_add_up_in_variance_and_models_are_assigned_by_name(toa):
    radiance = toa.fifesim.sense("OLI", quantise=False)
    kinds, whole = ("shot", "thermal", "fixed-pattern"), radiance.fifesim.noise_std(noise_models=MODEL)
    parts = sum(radiance.fifesim.noise_std(noise=kind, noise_models=MODEL) ** 2 for kind in kinds)
    np.testing.assert_allclose(parts, whole**2, rtol=1e-12)
    assert float(radiance.fifesim.noise_std(noise=()).max()) == 0
    models = {"OLI4": fifesim.NoiseModel(0.5, 0.0), "OLI5": fifesim.NoiseModel(0.2, 0.0)}
    for order in (["OLI4", "OLI5"], ["OLI5", "OLI4"]):
        std = radiance.sel(band=order).fifesim.noise_std("radiance", noise_models=models)
        assert std.max(["y", "x"]).to_series().to_dict() == {"OLI4": 0.5, "OLI5": 0.2}


def test_square_root_scale_has_increasing_steps(toa):
    """Steps of MSS on Landsat-2 from the radiances of neighbouring digital numbers."""
    mss = toa.assign_coords(band=["MSS5", "MSS6"]).fifesim.sense("MSS2")[:, 2:-2, 2:-2]
    assert float(mss["compression"].sel(band="MSS5")) == 63
    std = mss.fifesim.noise_std("radiance", noise=())
    up, down = (
        (mss.astype(int) + step).assign_coords(mss.coords).assign_attrs(mss.attrs).fifesim.to_radiance()
        for step in (1, -1)
    )
    # The centre of the radiances of digital number n deviates by a relative 1 / (8 n^2) from the radiance of n.
    np.testing.assert_allclose(std, (up - down) / 2 / np.sqrt(12), rtol=1 / (8 * 5**2))


# ------------------------------------------------------------------------------------------ conversion

# MSI band nearest to each TM band.
NEAREST = {"TM1": "MSI2", "TM2": "MSI3", "TM3": "MSI4", "TM4": "MSI8", "TM5": "MSI11", "TM7": "MSI12"}

TEN_METRES = ["MSI2", "MSI3", "MSI4", "MSI8"]

# Leaves and ground that are not in the library.
GREEN = fifesim.Canopy(
    leaf_optics=fifesim.Leaf(1.4, 42, 9, 0, 0.1, 0.009, 0.006),
    background=fifesim.Background({"soil_wet": 0.6, "golden_grass": 0.4}),
    leaf_angles="campbell(63)",
    hotspot=0.1,
)


def rms(found, expected):
    """Root mean square error of each band."""
    error = np.asarray(found.transpose("band", ...)) - np.asarray(expected.transpose("band", ...))
    return np.sqrt(np.mean(error**2, axis=tuple(range(1, error.ndim))))


@pytest.fixture(scope="module")
def dense():
    """45 x 45 cells of 3.33 m, from bare ground to closed canopies."""
    grid = fifesim.fife_site(30 / 9, window=((0, 45), (0, 45)))
    return fifesim.lai_scene(grid, "burned-ungrazed", arp=0.2, seed=3) * 1.5


@pytest.fixture(scope="module")
def msi(dense):
    return dense.fifesim.surface_reflectance("MSI", canopy=GREEN)


WAVELENGTH = np.arange(400, 2451) / 1000
PAIRS = (
    ("MSI", "OLI"), ("MSI", "TM"), ("MSI", "MODIS"), ("OLI", "MSI"), ("OLI", "TM"), ("OLI", "VIIRS"),
    ("ETM+", "OLI"), ("TM", "MODIS"), ("MODIS", "AVHRR"), ("VIIRS", "TM"),
)  # fmt: skip


@pytest.fixture(scope="module")
def held_out():
    """Spectra of prosail over soils that the library lacks, dims (sample, wavelength); one of 15 is bare soil."""
    prosail = pytest.importorskip("prosail")
    random = np.random.Generator(np.random.Philox(36))
    between = random.uniform
    table = tables.table("held_out_soils.csv").set_index("wavelength")
    spectra = []
    for name in table:
        soil = np.interp(np.arange(400, 2501) / 1000, table.index, table[name])
        for number in range(15):
            dead = random.random() < 0.25
            n, cm, cab = between(1.1, 2.8), between(0.002, 0.018), between(0, 10) if dead else between(5, 80)
            leaf = {"n": n, "cm": cm, "cab": cab, "car": cab * between(0.15, 0.35)}
            leaf["cw"] = between(0.0005, 0.005) if dead else between(0.004, 0.03)
            leaf["cbrown"] = between(0.5, 2) if dead else between(0, 1) ** 2 * (random.random() < 0.5)
            leaf["ant"] = 0.0 if dead else between(0, 6) * (random.random() < 0.3)
            below = between(0.4, 1.1) * soil
            directions = {"tts": between(20, 60), "tto": 0.0, "psi": 0.0}
            canopy = {"lai": between(0, 6), "lidfa": between(30, 75), "hspot": between(0.01, 0.3), "typelidf": 2}
            options = {"prospect_version": "D", "factor": "SDR", "rsoil0": below}
            spectra.append(below if number == 0 else prosail.run_prosail(**leaf, **canopy, **directions, **options))
    spectra = np.array(spectra)[:, : WAVELENGTH.size]
    return xr.DataArray(spectra, dims=("sample", "wavelength"), coords={"wavelength": WAVELENGTH})


@pytest.mark.parametrize(("source", "target"), PAIRS)
def test_stated_error_holds_for_other_leaves_and_soils(held_out, source, target):
    """Spectra of PROSPECT-D and SAIL from another code over other soils, with noise of the stated uncertainty."""
    inside = [each.name for each in fifesim.instrument(source).bands if _inside(each)]
    seen = held_out.fifesim.to_bands(source, bands=inside)
    noise = np.random.Generator(np.random.Philox(7)).standard_normal(seen.shape)
    seen = (seen + UNCERTAINTY * noise).assign_attrs(seen.attrs)
    sources = fifesim.instrument(source).select(inside)
    names = [each.name for each in fifesim.instrument(target).bands if _inside(each) and _beside(sources, each)]
    found = seen.fifesim.adjust_bands(target, bands=names)
    ratio = rms(found, held_out.fifesim.to_bands(target, bands=names)) / found["adjustment_error"].values
    assert np.all((ratio > 0.7) & (ratio < 1.3)), dict(zip(names, ratio.round(2), strict=True))


def _inside(band):
    """Whether the library covers the response of a band."""
    return WAVELENGTH[0] <= band.response.limits[0] and band.response.limits[1] <= WAVELENGTH[-1]


@pytest.mark.parametrize(
    ("table", "band", "most"),
    [(files.table("ground_spectra.csv"), "TM5", 0.004), (tables.table("held_out_soils.csv"), "TM7", 0.003)],
    ids=["dead grass", "soils"],
)
def test_measured_ground_spectra_are_estimated(table, band, most):
    """
    Measured dead grass and soils that the library lacks, without a canopy model.

    TM5 extends 0.1 um beyond the nearest band, into an absorption of dry grass. In TM7, clay minerals absorb outside
    the MSI band, and the nearest band is equally good.
    """
    table = table.set_index("wavelength")
    spectra = xr.DataArray(table.to_numpy().T, dims=("sample", "wavelength"), coords={"wavelength": table.index})
    # The table has gaps where the atmosphere is opaque.
    spectra = spectra.interp(wavelength=np.linspace(0.4, 2.45, 206))
    msi, truth = (spectra.fifesim.to_bands(name) for name in ("MSI", "TM"))
    ours = rms(msi.fifesim.adjust_bands("TM"), truth)
    nearest = rms(msi.sel(band=list(NEAREST.values())), truth)
    other = np.array(list(NEAREST)) != band
    assert np.all(ours[other] <= nearest[other] / 2) and ours[~other] < most


def test_grey_surfaces_stay_grey_and_fewer_bands_state_larger_errors(msi):
    """A road is not in the library and must not be converted to vegetation."""
    road = xr.full_like(msi, 0.2).fifesim.adjust_bands("TM")
    np.testing.assert_allclose(road, 0.2, atol=0.0015)
    fewer = msi.sel(band=TEN_METRES).fifesim.adjust_bands("TM", bands=["TM3", "TM4"])
    assert np.all(fewer["adjustment_error"] > road["adjustment_error"])


def test_adjusted_bands_and_images_are_raster_functions(msi):
    """A missing band affects only its cell; pixel sizes of one instrument are nodes of a tree."""
    msi = msi.copy(deep=True)
    msi[2, 5, 6] = np.nan
    found = check_raster_function(lambda each: each.fifesim.adjust_bands("TM"), msi, quantity="surface_reflectance")
    assert found["band"].values.tolist() == list(NEAREST) and found.attrs["instrument"] == "TM"
    assert found["adjustment_error"].attrs["units"] == "1"
    assert found.attrs["history"].endswith("MSI10 MSI11 MSI12, uncertainty 0.0005")
    missing = np.argwhere(np.isnan(found.values))
    assert {tuple(each[1:]) for each in missing} == {(5, 6)} and len(missing) == 6
    options = {"bands": ["TM3", "TM4"], "recorded": True}
    check_raster_function(
        lambda each: each.fifesim.as_seen_by("TM", **options), msi.sel(band=TEN_METRES), quantity="dn"
    )
    tree = msi.fifesim.as_seen_by("OLI", bands=["OLI4", "OLI8"])
    assert sorted(node.path for node in tree.leaves) == ["/15m", "/30m"]
    surface = msi.fifesim.adjust_bands("OLI", bands=["OLI4", "OLI8"])
    for node, band in (("15m", "OLI8"), ("30m", "OLI4")):
        error = tree[f"{node}/dn"]["adjustment_error"]
        assert float(error[0]) == float(surface["adjustment_error"].sel(band=band))


def test_image_of_another_instrument_agrees_with_direct_simulation(dense):
    """The image from MSI bands equals the image from the ground within two digital numbers."""
    scenes = {name: dense.fifesim.surface_reflectance(name, canopy=GREEN) for name in ("MSI", "TM")}
    seen = scenes["MSI"].fifesim.as_seen_by("TM", noise=(), seed=1)
    truth = scenes["TM"].fifesim.to_toa().fifesim.sense("TM")
    assert seen.dtype == np.uint8 and seen.attrs["instrument"] == "TM"
    assert np.max(np.abs(seen.astype(int) - truth.astype(int))) <= 2
    assert seen["adjustment_error"].dims == ("band",)


def test_sun_position_follows_the_given_time(msi):
    when = pd.Timestamp("1987-08-15T16:40Z")
    seen = msi.fifesim.as_seen_by("TM", bands=["TM3", "TM4"], time=when)
    sun = fifesim.sun_position(when, 39.1, -96.6)
    assert float(seen["sza"]) == pytest.approx(sun.sza, abs=0.1)
    assert float(seen["earth_sun_distance"]) == pytest.approx(sun.earth_sun_distance, abs=1e-6)
    given = msi.fifesim.as_seen_by("TM", bands=["TM3", "TM4"], geometry=sun)
    assert int(np.max(np.abs(given.astype(int) - seen.astype(int)))) <= 1
    oblique = msi.assign_coords(vza=7.0, vaa=100.0).fifesim.as_seen_by("TM", bands=["TM3", "TM4"], time=when)
    assert (float(oblique["vza"]), float(oblique["vaa"])) == (7.0, 100.0)


def test_adjustment_lines_agree_with_hls():
    """HLS used 500 spectra from 160 Hyperion scenes, including deserts, and another blue response."""
    lines = fifesim.sensor.spectral_adjustment("Sentinel-2A", "OLI", bands=[f"OLI{number}" for number in range(1, 8)])
    assert lines["source_band"].values.tolist() == ["MSI1", "MSI2", "MSI3", "MSI4", "MSI8A", "MSI11", "MSI12"]
    reflectance = 0.15
    ours = lines["slope"] * reflectance + lines["offset"]
    theirs = lines["published_slope"] * reflectance + lines["published_offset"]
    assert set(lines["reference"].values) == {"HLS"}
    apart = abs(ours - theirs).values
    assert np.all(np.delete(apart, 1) < 0.004) and apart[1] < 0.006
    assert np.all(lines["error"].values <= lines["difference"].values)
    unpublished = fifesim.sensor.spectral_adjustment("AVHRR", "TM")
    assert unpublished["band"].values.tolist() == ["TM2", "TM3", "TM4"]
    assert np.isnan(unpublished["published_slope"].values).all() and set(unpublished["reference"].values) == {""}


def grey_wave(names, period):
    """Grey ground with a wave along x, in the bands of an instrument, on cells of 3.33 m."""
    grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 540)))
    x = (np.arange(540) + 0.5) * 30 / 9
    wave = np.broadcast_to(0.3 + 0.1 * np.cos(2 * np.pi * x / period), (len(names), 90, 540))
    ground = grids.place(xr.DataArray(wave, dims=("band", "y", "x"), coords={"band": names}), grid)
    instrument = "MSI" if names[0].startswith("MSI") else "TM"
    light = directions.with_geometry(ground.rename("surface_reflectance"), fifesim.Geometry(30, 120))
    return light.assign_attrs(units="1", instrument=instrument)


def contrast(image, period):
    """Amplitude of a wave in an image divided by the mean of the image."""
    x = image["x"].values - float(image["x"][0]) + 15.0
    rows = image.isel(y=slice(3, -3), x=slice(5, -5)).mean("y").values
    phase = 2 * np.pi * x[5:-5] / period
    basis = np.stack([np.ones_like(phase), np.cos(phase), np.sin(phase)], axis=1)
    mean, *amplitude = np.linalg.lstsq(basis, rows, rcond=None)[0]
    return float(np.hypot(*amplitude) / mean)


@pytest.mark.parametrize(("target", "period"), [("TM", 75.0), ("L4TM", 75.0), ("L4TM", 150.0)])
def test_contrast_equals_direct_observation(target, period):
    """A wave recorded by MSI has the contrast that TM would record; the regularisation costs 1.1 % at 75 m."""
    direct = grey_wave(["TM3", "TM4"], period).fifesim.to_toa().fifesim.sense(target, quantise=False)
    scene = grey_wave(TEN_METRES, period).fifesim.to_toa().fifesim.sense("MSI", quantise=False).fifesim.to_surface()
    assert scene.attrs["recorded_by"] == "MSI"
    seen = scene.fifesim.as_seen_by(target, bands=["TM3", "TM4"])
    twice = scene.fifesim.as_seen_by(target, bands=["TM3", "TM4"], recorded=False)
    for band in ("TM3", "TM4"):
        expected = contrast(direct.sel(band=band), period)
        assert contrast(seen.sel(band=band).fifesim.to_radiance(), period) == pytest.approx(expected, rel=0.02)
        assert contrast(twice.sel(band=band).fifesim.to_radiance(), period) < (1 - 0.07 * (75 / period) ** 2) * expected
    assert np.all(seen["contrast_left"] > 0.97) and "contrast_left" not in twice.coords
    assert "less the blur of MSI" in seen.attrs["history"] and seen.attrs["recorded_by"] == target


def test_coarse_scene_warns_about_missing_contrast():
    """At the Nyquist frequency of 30 m, OLI passes 0.64 as a detector and 0.64 as square cells."""
    oli = fifesim.instrument("OLI", "detector")
    ground = grey_wave(["TM3", "TM4"], 150.0).assign_coords(band=["OLI4", "OLI5"]).drop_attrs(deep=False)
    scene = ground.fifesim.to_toa(instrument="OLI").fifesim.sense(oli, quantise=False).fifesim.to_surface()
    with pytest.warns(UserWarning, match=r"image of TM3, TM4 is too smooth: it has 84% of the contrast of TM"):
        seen = scene.fifesim.as_seen_by("TM", bands=["TM3", "TM4"])
    passed = np.sinc(0.5 * oli.ground_fields(oli.bands[0]).along / 30) * np.sinc(0.5)
    np.testing.assert_allclose(seen["contrast_left"], passed**2 * 1.04 / (passed**2 + 0.04), rtol=2e-3)


def test_coarser_cells_average_pixels_and_finer_cells_repeat_them():
    msi = fifesim.instrument("MSI")
    ten, twenty = msi.select(["MSI4", "MSI11"])
    for band, cells, widths in ((ten, (10, 10), [10]), (ten, (20, 20), [20, 20]), (twenty, (10, 10), [20])):
        for spread, *boxes in adjustment._parts(msi, band, cells):
            assert spread in msi.line_spreads(band) and [box.width for box in boxes] == widths


def test_band_shares_are_shares_of_the_variance():
    sources = tuple(band.response for band in fifesim.instrument("MSI").select(TEN_METRES))
    others = tuple(band.response for band in fifesim.instrument("TM").select(["TM2", "TM4"]))
    means = (library_spectra()[1] @ adjustment._weights(sources).T).reshape(-1, len(sources))
    found = adjustment._variance_shares(sources, others, 5e-4)
    for shares, weights in zip(found, adjustment._estimate(sources, others, 5e-4).weights, strict=True):
        parts = weights * means
        expected = [np.cov(part, parts.sum(axis=1))[0, 1] / np.var(parts.sum(axis=1), ddof=1) for part in parts.T]
        np.testing.assert_allclose(shares, expected, rtol=1e-9, atol=1e-12)
