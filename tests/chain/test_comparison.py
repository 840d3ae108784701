"""Comparison of instruments, of atmospheric engines, and of propagated noise with the noise of many images."""

import warnings

import dask
import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function, in_chunks, no_compute

import fifesim
from fifesim.atmosphere.engines import band_terms
from fifesim.chain.comparison import compare_engines, engine_error
from fifesim.chain.noise_propagation import noise_std
from fifesim.grids import directions
from fifesim.grids import grid as grids

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


def test_all_images_are_computed_in_one_pass(lai):
    """The result is lazy and identical to separate runs, and each chunk of the scene is read once."""
    reads, names = [], ["TM", "OLI", "MSI"]

    def read(block):
        reads.append(block.shape)
        return block

    with no_compute():
        scene = in_chunks(lai, {"y": 23, "x": 27})
        scene = scene.copy(data=scene.data.map_blocks(read, meta=np.empty((0, 0))))
        images = fifesim.compare(scene, names)
    arrays = dask.compute(*(images[name]["dn"] for name in names), scheduler="synchronous")
    assert len(reads) == 4
    for name, array in zip(names, arrays, strict=True):
        xr.testing.assert_identical(array, fifesim.compare(lai, [name])[name]["dn"])


def test_bands_and_options_reach_the_instruments(lai):
    leaf = {"TM2": (0.16, 0.12), "TM5": (0.28, 0.31)} | dict.fromkeys(("OLI4", "OLI5"), (0.3, 0.3))
    canopy = fifesim.Canopy(background=0.2, leaf_optics=leaf)
    setup = fifesim.Setup(interval=(20.0, 25.0), quantise=False, canopy=canopy)
    images = fifesim.compare(lai, ["TM", "OLI"], setup, bands={"TM": ["TM2", "TM5"]})
    assert images["TM"]["toa_radiance"]["band"].values.tolist() == ["TM2", "TM5"]
    for name in ("TM", "OLI"):
        assert grids.cell_size(grids.geobox(images[name]["toa_radiance"])) == (20.0, 25.0)


def test_resolutions_are_separate_nodes_and_rows(lai):
    """NDVI is missing without a red and a near infrared band."""
    images = fifesim.compare(lai, ["MSI", "TM"], bands={"MSI": ["MSI4", "MSI11"]})
    assert sorted(node.path for node in images.leaves) == ["/MSI/10m", "/MSI/20m", "/TM"]
    assert images["MSI/20m/dn"]["band"].values.tolist() == ["MSI11"]
    table = images.fifesim.comparison_table()
    assert table.index.tolist() == ["MSI/10m", "MSI/20m", "TM"] and "r2" not in table
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


def test_origins_of_blur_are_stated_and_different_origins_are_a_warning(lai):
    """Blur is measured, assumed, and unknown (only the detector is known)."""
    grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    with pytest.warns(UserWarning, match=r"blur in-flight \(MSI\), assumed \(OLI\), unknown \(SuperDove\)") as caught:
        images = fifesim.compare(fifesim.lai_scene(grid, seed=7), ["MSI", "OLI", "SuperDove"])
    assert not any("noise" in str(each.message) for each in caught)
    table = fifesim.sensor.comparison_table(images)
    assert table["blur"].to_dict() == {"MSI": "in-flight ± 0.03", "OLI": "assumed ± 0.06", "SuperDove": "–"}
    assert table["geolocation"].to_dict() == {"MSI": "in-flight ± 1 m", "OLI": "in-flight ± 4 m", "SuperDove": "–"}
    assert table.loc["OLI", "noise"] == "pre-launch within a factor of 1.05" and table.loc["SuperDove", "noise"] == "–"
    with warnings.catch_warnings(action="error", category=UserWarning):
        fifesim.compare(lai, ["MSI", "MSI-C", "TM"])


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
