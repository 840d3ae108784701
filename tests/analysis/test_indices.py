"""Vegetation indices compared with a catalogue, and composites compared with numpy."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, check_place, check_raster_function, in_chunks, no_compute

import fifesim
from fifesim.analysis import indices
from fifesim.analysis.index_labels import INDICES, reflectance_index, reflectance_ndvi
from fifesim.analysis.indices import date_of_maximum, normalized_difference, normalized_difference_std
from fifesim.base.bands import BLUE, GREEN, NEAR_INFRARED, RED, SHORTWAVE_INFRARED, nearest_band
from fifesim.grids import grid as grids
from fifesim.sensor.description.instruments import instrument

# Formulas in the notation of the spyndex catalogue, with its letters for the bands.
CATALOGUE = {
    "normalized_difference": ("NR", "(N - R) / (N + R)"),
    "enhanced": ("NRB", "2.5 * (N - R) / (N + 6.0 * R - 7.5 * B + 1.0)"),
    "enhanced_of_two_bands": ("NR", "2.5 * (N - R) / (N + 2.4 * R + 1.0)"),
    "soil_adjusted": ("NR", "(1.0 + 0.5) * (N - R) / (N + R + 0.5)"),
    "modified_soil_adjusted": ("NR", "0.5 * (2.0 * N + 1 - (((2 * N + 1) ** 2) - 8 * (N - R)) ** 0.5)"),
    "near_infrared_of_vegetation": ("NR", "((N - R) / (N + R)) * N"),
}


@pytest.mark.parametrize("name", CATALOGUE)
def test_formulas_agree_with_the_catalogue(name):
    letters, formula = CATALOGUE[name]
    values = dict(zip("NRB", np.random.default_rng(1).uniform(0.01, 0.6, (3, 50)), strict=True))
    values["B"] = values["B"] / 6
    index = getattr(indices, name)
    np.testing.assert_allclose(index(*(values[each] for each in letters)), eval(formula, {}, values), rtol=1e-13)
    # Bare ground without spectral contrast has an index of 0.
    np.testing.assert_allclose(index(*[0.2] * len(letters)), 0.0, rtol=0, atol=1e-15)
    assert np.isnan(index(np.nan, *[0.2] * (len(letters) - 1)))


def test_undefined_index_is_missing_and_integers_do_not_overflow():
    assert np.isnan(indices.enhanced(0.5, 0.0, 0.2)) and np.isnan(indices.modified_soil_adjusted(0.5, -0.3))
    assert np.isnan(normalized_difference([0.0, 0.1, 0.1], [0.0, -0.1, np.nan])).all()
    # An index beyond 1, and one of two negative reflectances, which is within.
    assert np.isnan(normalized_difference([0.3, -0.1, -0.1], [-0.02, 0.2, -0.2])).all()
    assert np.isnan(normalized_difference_std(0.3, -0.02, 0.01, 0.01))
    np.testing.assert_array_equal(normalized_difference([0.5, 0.0], [0.0, 0.5]), [1.0, -1.0])
    ndvi = normalized_difference(np.array([1000, 65000], "uint16"), np.array([2000, 65000], "uint16"))
    np.testing.assert_allclose(ndvi, [-1 / 3, 0.0], rtol=1e-12)


def test_error_of_ndvi_follows_from_its_derivatives():
    """Central differences; the errors of both bands are added in quadrature."""
    h, nir, red = 1e-6, np.array([0.4, 0.25, 0.05]), np.array([0.05, 0.25, 0.2])
    by_nir = (normalized_difference(nir + h, red) - normalized_difference(nir - h, red)) / (2 * h)
    by_red = (normalized_difference(nir, red + h) - normalized_difference(nir, red - h)) / (2 * h)
    found = normalized_difference_std(nir, red, 0.003, 0.001)
    np.testing.assert_allclose(found, np.hypot(by_nir * 0.003, by_red * 0.001), rtol=1e-8)
    assert np.isnan(normalized_difference_std(0.0, 0.0, 0.003, 0.001))


def test_missing_dates_are_skipped_and_ties_take_the_first():
    index = np.array([[np.nan, -0.2, -0.1], [0.3, 0.3, np.nan], [np.nan, -np.inf, np.nan], [np.nan] * 3])
    assert date_of_maximum(index).tolist() == [2, 0, 1, -1]


def test_maximum_of_normals_agrees_with_the_table():
    """rtol=1e-9: accuracy of the quadrature behind the table."""
    known = pd.read_csv(Path(__file__).parents[1] / "data" / "clouds" / "maximum_of_normals.csv", comment="#")
    found = [indices.maximum_of_normals(dates) for dates in known["dates"]]
    np.testing.assert_allclose(found, known[["mean", "sd"]], rtol=1e-9, atol=1e-12)


def reflectance(lai, wavelengths):
    bands = xr.DataArray(np.linspace(0.1, 0.6, len(wavelengths)), dims="band")
    cube = (lai * bands + 0.02).transpose("band", "y", "x")
    cube = grids.place(cube.assign_coords(wavelength=("band", list(wavelengths))), grids.geobox(lai))
    cube.attrs = {"units": "1", "atmosphere": "some", "arp": 0.15}
    return cube.rename("toa_reflectance")


def test_indices_are_raster_functions_and_equal_the_kernels(lai_with_hole):
    """Bands are in the order of wavelength: blue, green, red, near and shortwave infrared."""
    cube = reflectance(lai_with_hole, (0.48, 0.56, 0.66, 0.83, 1.65))
    known = dict(zip((BLUE, GREEN, RED, NEAR_INFRARED, SHORTWAVE_INFRARED), cube.values, strict=True))
    for name, (kernel, windows) in INDICES.items():
        result = check_raster_function(lambda array, n=name: reflectance_index(array, n), cube, quantity=name.lower())
        np.testing.assert_array_equal(result, kernel(*(known[each] for each in windows)))
    blue, green, red, nir, swir = cube.values
    for name, (one, other) in {"NDVI": (nir, red), "NDWI": (green, nir), "NDMI": (nir, swir)}.items():
        np.testing.assert_array_equal(reflectance_index(cube, name), normalized_difference(one, other))
    np.testing.assert_array_equal(reflectance_index(cube, "EVI"), indices.enhanced(nir, red, blue))
    result = reflectance_ndvi(cube)
    np.testing.assert_array_equal(result, reflectance_index(cube, "ndvi"))
    assert result.dims == ("y", "x") and "band" not in result.coords and "wavelength" not in result.coords
    assert result.attrs["arp"] == 0.15
    several = reflectance(lai_with_hole, (0.61, 0.64, 0.69, 0.76, 0.95, 0.86))
    expected = normalized_difference(several.values[5], several.values[1])
    np.testing.assert_array_equal(reflectance_ndvi(several), expected)
    np.testing.assert_array_equal(reflectance_ndvi(several[::-1]), expected)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("TM", "TM1 TM2 TM3 TM4 TM5"),
        ("OLI", "OLI2 OLI3 OLI4 OLI5 OLI6"),
        ("MSI", "MSI2 MSI3 MSI4 MSI8 MSI11"),
        ("MODIS", "MODIS3 MODIS4 MODIS1 MODIS2 MODIS6"),
    ],
)
def test_instruments_have_the_bands_of_every_index(name, expected):
    """The indices use the broad bands; coastal blue, red edge and 1.24 um are not among them."""
    bands = instrument(name).bands
    wavelengths, windows = [band.wavelength for band in bands], (BLUE, GREEN, RED, NEAR_INFRARED, SHORTWAVE_INFRARED)
    assert [bands[nearest_band(wavelengths, window)].name for window in windows] == expected.split()


# ------------------------------------------------------------------------------------------ composites


DATES = np.array(["1987-06-06T16:35", "1987-07-08T16:35", "1987-08-09T16:34"], "datetime64[ns]")


@pytest.fixture(scope="module")
def stack(lai_values):
    """NDVI of three dates with low values for clouds and with gaps; one cell has no data."""
    rng = np.random.default_rng(3)
    dates = [lai_values * 0.1 + rng.normal(0, 0.1, lai_values.shape) for _ in DATES]
    found = xr.concat(dates, xr.DataArray(DATES, dims="time", name="time")).rename("ndvi")
    found = found.where(rng.uniform(size=found.shape) > 0.3).assign_attrs(units="1", standard_name="x")
    found[:, 2, 3] = np.nan
    found = grids.place(found.assign_coords(sza=("time", [28.0, 30.0, 35.0])), grids.geobox(lai_values))
    return found


def test_composite_is_the_maximum_ndvi_with_its_date_and_sun(stack):
    """Composites are lazy, and sun angles are by date or by cell."""
    before, found = stack.copy(deep=True), fifesim.composite(stack)
    check_place(found, grids.geobox(stack).crs)
    for chunks in (ODD_CHUNKS, ODD_CHUNKS | {"time": 1}):
        with no_compute():
            lazy = fifesim.composite(in_chunks(stack, chunks))
        assert lazy.chunks is not None and lazy["date"].chunks is not None
        xr.testing.assert_identical(lazy.compute(), found)
    xr.testing.assert_identical(stack, before)
    np.testing.assert_array_equal(found, stack.max("time"))
    assert np.isnan(found[2, 3]) and np.isnat(found["date"][2, 3]) and np.isnan(found["sza"][2, 3])
    chosen = stack.fillna(-9).argmax("time").values
    kept = ~np.isnan(found.values)
    np.testing.assert_array_equal(found["date"].values[kept], DATES[chosen[kept]])
    np.testing.assert_array_equal(found["sza"].values[kept], np.array([28.0, 30.0, 35.0])[chosen[kept]])
    assert found["sza"].attrs["standard_name"] == "solar_zenith_angle" and "history" not in found["sza"].attrs
    sza = np.random.default_rng(3).uniform(20, 60, stack.shape)
    by_cell = fifesim.composite(stack.assign_coords(sza=(stack.dims, sza)))["sza"].values
    np.testing.assert_array_equal(by_cell[kept], np.take_along_axis(sza, chosen[None], axis=0)[0][kept])


def test_composite_is_restored_from_netcdf(stack, tmp_path):
    found = fifesim.composite(stack)
    found.to_netcdf(tmp_path / "composite.nc")
    with xr.open_dataset(tmp_path / "composite.nc", decode_coords="all") as again:
        xr.testing.assert_identical(again["ndvi"].load(), found)


def test_images_are_composited_by_their_ndvi_or_a_given_index(stack):
    """All bands of a cell come from one date, selected by NDVI of the images or by a given index."""
    red = 0.05 + 0 * stack
    images = xr.concat([red, red * (1 + stack) / (1 - stack)], xr.DataArray(["TM3", "TM4"], dims="band", name="band"))
    images = images.assign_coords(wavelength=("band", [0.66, 0.83])).transpose("time", "band", "y", "x")
    images = grids.place(images.rename("surface_reflectance"), grids.geobox(stack))
    images.attrs = {"units": "1"}
    found = images.fifesim.composite()
    assert found.dims == ("band", "y", "x") and found["wavelength"].values.tolist() == [0.66, 0.83]
    np.testing.assert_allclose(found.fifesim.ndvi(), fifesim.composite(stack), rtol=0, atol=1e-14)
    kept = fifesim.composite(images.astype("float32"), by=stack)
    assert kept.dtype == np.float32 and kept[:, 2, 3].isnull().all()
    np.testing.assert_array_equal(kept["date"], fifesim.composite(stack)["date"])
    # An index without labels selects the same dates.
    plain = stack.drop_vars("spatial_ref").drop_attrs(deep=False) * 2
    np.testing.assert_array_equal(fifesim.composite(stack, by=plain), fifesim.composite(stack))


@pytest.mark.parametrize("lazy", [False, True])
def test_composites_select_by_median_view_or_clear_dates(lai, lazy):
    """Expected values from numpy, for five dates with gaps, clouds and different views."""
    rng, grid = np.random.default_rng(4), grids.geobox(lai)
    values = rng.random((5, *grid.shape))
    values[rng.random(values.shape) < 0.2] = np.nan
    cloudless = rng.random(values.shape) < 0.7
    vza = np.array([40.0, 5.0, 20.0, 50.0, 30.0])
    dates = np.arange("1987-06-01", "1987-06-06", dtype="M8[D]").astype("M8[ns]")

    def layers(array):
        found = grids.place(xr.DataArray(array, dims=("time", "y", "x"), coords={"time": dates}), grid)
        return found.chunk({"y": 7, "x": 11}) if lazy else found

    def by_date(array, date):
        return np.take_along_axis(array, date[None], axis=0)[0]

    ndvi, clear = layers(values).rename("ndvi").assign_coords(vza=("time", vza)), layers(cloudless)
    seen = np.where(cloudless, values, np.nan)
    count = np.isfinite(seen).sum(axis=0)
    some, last = count > 0, np.maximum(count - 1, 0)
    ordered, slant = np.sort(seen, axis=0), np.where(np.isnan(seen), 99, vza[:, None, None])
    expected = {
        "median": by_date(ordered, last // 2),
        "nadir-most": by_date(seen, slant.argmin(axis=0)),
        "mean-of-clear": np.where(some, np.nansum(seen, axis=0) / np.maximum(count, 1), np.nan),
        "maximum-value": by_date(ordered, last),
    }
    found = {method: ndvi.fifesim.composite(method, clear=clear) for method in expected}
    for method, each in expected.items():
        assert (found[method].chunks is not None) == lazy
        np.testing.assert_allclose(found[method].values, each, rtol=1e-12)
        assert found[method].attrs["composite"] == method
    np.testing.assert_array_equal(found["nadir-most"].vza.values[some], slant.min(axis=0)[some])
    np.testing.assert_array_equal(found["mean-of-clear"].dates.values, count)
    # Views from the other side of the track are equally far from nadir.
    signed = ndvi.assign_coords(vza=-ndvi.vza).fifesim.composite("nadir-most", clear=clear)
    np.testing.assert_array_equal(signed.values, found["nadir-most"].values)
