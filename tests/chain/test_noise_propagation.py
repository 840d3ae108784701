"""Propagated noise compared with the noise of many images, and with finite differences."""

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim
from fifesim.grids import directions

MODEL = fifesim.NoiseModel(0.5, 0.006, detectors=100, gain_spread=0.004, offset_spread=0.2)
RED, NEAR_INFRARED = (0.02, 0.05, 0.1, 0.2, 0.3), (0.5, 0.4, 0.3, 0.3, 0.32)
"""Reflectances at the top of the atmosphere, from a closed canopy to bright soil."""


@pytest.fixture(scope="module")
def toa():
    """100 x 100 pixels of OLI in five stripes, 20 pixels wide."""
    grid = fifesim.fife_site(30, window=((0, 100), (0, 100)))
    stripes = np.repeat(np.array([RED, NEAR_INFRARED]), 20, axis=1)
    values = np.broadcast_to(stripes[:, None], (2, 100, 100))
    place = fifesim.lai_scene(grid, seed=7)
    raster = xr.DataArray(values, dims=("band", "y", "x"), coords=place.coords | {"band": ["OLI4", "OLI5"]})
    raster.encoding = place.encoding
    return directions.with_geometry(raster.assign_attrs(units="1", site="FIFE"), fifesim.fife_geometry())


METHODS = {"radiance": "to_radiance", "reflectance": "to_reflectance", "ndvi": "ndvi"}


@pytest.mark.parametrize("quantity", ["radiance", "reflectance", "ndvi"])
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
    squares = []
    for seed in range(20):
        image = toa.fifesim.sense("OLI", noise="all", seed=seed, **options)
        exact = toa.fifesim.sense("OLI", quantise=False)
        found = getattr(image.fifesim, METHODS[quantity])()
        expected = exact if quantity == "radiance" else getattr(exact.fifesim, METHODS[quantity])()
        squares.append(((found - expected) / std) ** 2)
    mean = xr.concat(squares, "seed").coarsen(x=20).mean().mean(["seed", "y"])
    np.testing.assert_allclose(np.sqrt(mean), 1, atol=0.02)


def test_noise_std_is_a_raster_function(toa):
    image = toa.fifesim.sense("OLI")
    for quantity, name in zip(METHODS, ("toa_radiance_std", "toa_reflectance_std", "ndvi_std"), strict=True):
        found = check_raster_function(lambda each, what=quantity: each.fifesim.noise_std(what), image, quantity=name)
        assert found.attrs["history"].splitlines()[-1].startswith(f"noise_std: {quantity}, OLI, ")
        assert found.dims == (("y", "x") if quantity == "ndvi" else ("band", "y", "x"))


def test_missing_pixel_affects_only_its_cell_and_band(toa):
    image = toa.fifesim.sense(fifesim.instrument("OLI", "detector")).copy(deep=True)
    image[0, 5, 6] = 0
    for quantity, place in (("radiance", [0, 5, 6]), ("reflectance", [0, 5, 6]), ("ndvi", [5, 6])):
        assert np.argwhere(np.isnan(image.fifesim.noise_std(quantity).values)).tolist() == [place]


def test_saturated_pixels_have_no_noise(toa):
    image = fifesim.sense(toa.where(toa.x < toa.x[80], 2.0), "OLI")
    number = int((image == image.attrs["saturated"]).any("band").sum())
    std = fifesim.sensor.noise_std(image, "reflectance", noise=())
    assert number and std.attrs["saturated_pixels"] == number
    np.testing.assert_array_equal(np.isnan(std), (image == 0) | (image == image.attrs["saturated"]))


def test_radiance_reflectance_and_digital_numbers_agree(toa):
    """Only quantisation differs, and its variance is the variance of a uniform error."""
    image = toa.fifesim.sense("OLI")
    radiance, reflectance = image.fifesim.to_radiance(), image.fifesim.to_reflectance()
    for quantity in ("radiance", "reflectance", "ndvi"):
        found = [each.fifesim.noise_std(quantity, noise_models=MODEL) for each in (radiance, reflectance)]
        np.testing.assert_allclose(*found, rtol=1e-12)
    of_numbers, of_radiance = (each.fifesim.noise_std("radiance", noise_models=MODEL) for each in (image, radiance))
    np.testing.assert_allclose(of_numbers**2 - of_radiance**2, image["gain"] ** 2 / 12 + 0 * of_radiance, rtol=1e-6)


def test_kinds_of_noise_add_up_in_variance(toa):
    radiance = toa.fifesim.sense("OLI", quantise=False)
    kinds, whole = ("shot", "thermal", "fixed-pattern"), radiance.fifesim.noise_std(noise_models=MODEL)
    parts = sum(radiance.fifesim.noise_std(noise=kind, noise_models=MODEL) ** 2 for kind in kinds)
    np.testing.assert_allclose(parts, whole**2, rtol=1e-12)
    assert float(radiance.fifesim.noise_std(noise=()).max()) == 0


def test_noise_models_are_assigned_to_bands_by_name(toa):
    models = {"OLI4": fifesim.NoiseModel(0.5, 0.0), "OLI5": fifesim.NoiseModel(0.2, 0.0)}
    radiance = toa.fifesim.sense("OLI", quantise=False)
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


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        (lambda image: image, {"quantity": "evi"}, "quantity"),
        (lambda image: image.drop_vars("sza"), {}, "carries no sza"),
        (lambda image: image.isel(band=[1]), {}, "no red band"),
        (lambda image: image, {"noise": "shot", "noise_models": fifesim.NoiseModel(0.5, 0)}, "no shot noise for OLI5"),
        (lambda image: image.fifesim.ndvi(), {}, "NDVI|reflectance"),
        (lambda image: image.fifesim.to_reflectance().fifesim.to_surface(), {}, "to_toa"),
    ],
)
def test_invalid_noise_requests_are_rejected(toa, change, options, message):
    with pytest.raises(ValueError, match=message):
        change(toa.fifesim.sense("OLI")).fifesim.noise_std(**options)
