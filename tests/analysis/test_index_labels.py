"""Vegetation indices of labelled reflectance, and composites of labelled images."""

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, check_place, check_raster_function, in_chunks, no_compute

import fifesim
from fifesim.analysis import indices
from fifesim.analysis.index_labels import INDICES, reflectance_index, reflectance_ndvi
from fifesim.base.bands import BLUE, GREEN, NEAR_INFRARED, RED, SHORTWAVE_INFRARED, nearest_band
from fifesim.grids import grid as grids
from fifesim.sensor.description.instruments import instrument


def reflectance(lai, wavelengths=(0.56, 0.66, 0.83, 1.65)):
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
        np.testing.assert_array_equal(reflectance_index(cube, name), indices.normalized_difference(one, other))
    np.testing.assert_array_equal(reflectance_index(cube, "EVI"), indices.enhanced(nir, red, blue))
    result = reflectance_ndvi(cube)
    np.testing.assert_array_equal(result, reflectance_index(cube, "ndvi"))
    np.testing.assert_array_equal(np.isnan(result), np.isnan(lai_with_hole))
    assert result.dims == ("y", "x") and "band" not in result.coords and "wavelength" not in result.coords
    assert result.attrs["arp"] == 0.15


@pytest.mark.parametrize(
    "wavelengths, red, nir",
    [((0.83, 0.66), 1, 0), ((0.61, 0.64, 0.69, 0.76, 0.95, 0.86), 1, 5), ((0.45, 0.665, 0.71, 0.842, 1.6), 1, 3)],
)
def test_bands_are_selected_by_wavelength(lai, wavelengths, red, nir):
    cube = reflectance(lai, wavelengths)
    np.testing.assert_array_equal(
        reflectance_ndvi(cube), indices.normalized_difference(cube.values[nir], cube.values[red])
    )


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda cube: cube.drop_vars("wavelength"), "no coordinate 'wavelength'"),
        (lambda cube: cube.isel(band=1), "along band"),
        (lambda cube: cube.assign_attrs(units="K"), "units 'K'"),
    ],
)
def test_raster_without_bands_or_of_other_units_is_refused(lai, change, message):
    with pytest.raises(ValueError, match=message):
        reflectance_ndvi(change(reflectance(lai)))


@pytest.mark.parametrize("name", ["TM", "ETM+", "OLI", "MSI", "MODIS"])
def test_instruments_have_the_bands_of_every_index(name):
    """The indices use the broad bands; coastal blue, red edge and 1.24 um are not among them."""
    bands = instrument(name).bands
    wavelengths = [band.wavelength for band in bands]
    picked = {window.name: bands[nearest_band(wavelengths, window)].name for _, ws in INDICES.values() for window in ws}
    expected = {
        "TM": "TM1 TM2 TM3 TM4 TM5",
        "ETM+": "ETM1 ETM2 ETM3 ETM4 ETM5",
        "OLI": "OLI2 OLI3 OLI4 OLI5 OLI6",
        "MSI": "MSI2 MSI3 MSI4 MSI8 MSI11",
        "MODIS": "MODIS3 MODIS4 MODIS1 MODIS2 MODIS6",
    }
    order = ("blue", "green", "red", "near infrared", "shortwave infrared")
    assert [picked[each] for each in order] == expected[name].split()


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
    assert found.attrs["composite"] == "maximum-value" and "composite" in found.attrs["history"]
    assert found["date"].attrs == {"long_name": "date of the selected image"}
    assert found["sza"].attrs["standard_name"] == "solar_zenith_angle" and "history" not in found["sza"].attrs
    sza = np.random.default_rng(3).uniform(20, 60, stack.shape)
    by_cell = fifesim.composite(stack.assign_coords(sza=(stack.dims, sza)))["sza"].values
    np.testing.assert_array_equal(by_cell[kept], np.take_along_axis(sza, chosen[None], axis=0)[0][kept])


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


def test_equal_dates_in_a_composite_give_a_warning(stack):
    with pytest.warns(UserWarning, match=r"have 1987-.* 2 times.*drop_duplicates\('time'\)"):
        fifesim.composite(stack.isel(time=[0, 1, 1]), "median")


def swapped(ndvi):
    return ndvi.isel(time=[1, 0, 2])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda ndvi: fifesim.composite(ndvi.fillna(0).astype(np.uint8)), r"sun of .*\.fifesim\.to_reflect"),
        (lambda ndvi: fifesim.composite(ndvi.isel(time=0)), "images along time, got dimensions"),
        (lambda ndvi: fifesim.composite(ndvi, "mode"), "'median', 'nadir-most' or 'mean-of-clear', got 'mode'"),
        (lambda ndvi: fifesim.composite(ndvi, "nadir-most"), "nadir-most needs the view of each date"),
        (lambda ndvi: fifesim.composite(ndvi, "mean-of-clear"), "needs to know where the images are clear"),
        (lambda ndvi: fifesim.composite(ndvi.assign_attrs(standard_name="leaf_area_index")), "leaf area index by its"),
        # An index of the same shape would silently select wrong dates or cells.
        (lambda ndvi: fifesim.composite(ndvi, by=ndvi[:2]), "dates of the images"),
        (lambda ndvi: fifesim.composite(ndvi, by=swapped(ndvi)), r"another order: .*\.sortby\('time'\)"),
        (lambda ndvi: fifesim.composite(ndvi, by=swapped(ndvi).drop_vars(["x", "y"])), "other dates than the images"),
        (lambda ndvi: fifesim.composite(ndvi, by=ndvi.assign_coords(x=ndvi["x"] + 30.0)), "have different grids"),
        (lambda ndvi: ndvi.fifesim.composite().fifesim.sense(), "of many dates, and nothing records it"),
    ],
)
def test_invalid_composites_are_rejected(stack, call, message):
    """An index without labels is accepted."""
    with pytest.raises(ValueError, match=message):
        call(stack)
    plain = stack.drop_vars("spatial_ref").drop_attrs(deep=False) * 2
    np.testing.assert_array_equal(fifesim.composite(stack, by=plain), fifesim.composite(stack))


@pytest.mark.parametrize("chunks", [None, ODD_CHUNKS], ids=["eager", "lazy"])
def test_composite_is_restored_from_netcdf_and_zarr(stack, tmp_path, chunks):
    found = fifesim.composite(stack if chunks is None else in_chunks(stack, chunks))
    found.to_netcdf(tmp_path / "netcdf")
    found.to_dataset().to_zarr(tmp_path / "zarr", consolidated=False)
    with (
        xr.open_dataset(tmp_path / "netcdf", decode_coords="all") as netcdf,
        xr.open_zarr(tmp_path / "zarr", decode_coords="all", consolidated=False) as zarr,
    ):
        for again in (netcdf, zarr):
            xr.testing.assert_identical(again["ndvi"].load(), found.compute())


@pytest.mark.parametrize("lazy", [False, True])
def test_composites_select_by_median_view_or_clear_dates(lai, lazy):
    """Expected values from numpy, for five dates with gaps, clouds and different views."""
    rng = np.random.default_rng(4)
    grid = grids.geobox(lai)
    values = rng.random((5, *grid.shape))
    values[rng.random(values.shape) < 0.2] = np.nan
    cloudless = rng.random(values.shape) < 0.7
    vza = np.array([40.0, 5.0, 20.0, 50.0, 30.0])
    dates = np.arange("1987-06-01", "1987-06-06", dtype="M8[D]").astype("M8[ns]")

    def stack(array):
        layers = grids.place(xr.DataArray(array, dims=("time", "y", "x"), coords={"time": dates}), grid)
        return layers.chunk({"y": 7, "x": 11}) if lazy else layers

    ndvi = stack(values).rename("ndvi").assign_coords(vza=("time", vza))
    clear = stack(cloudless)
    seen = np.where(cloudless, values, np.nan)
    count = np.isfinite(seen).sum(axis=0)
    some, last = count > 0, np.maximum(count - 1, 0)
    ordered, slant = np.sort(seen, axis=0), np.where(np.isnan(seen), 99, vza[:, None, None])

    def by_date(array, date):
        return np.take_along_axis(array, date[None], axis=0)[0]

    expected = {
        "median": by_date(ordered, last // 2),
        "nadir-most": by_date(seen, slant.argmin(axis=0)),
        "mean-of-clear": np.where(some, np.nansum(seen, axis=0) / np.maximum(count, 1), np.nan),
        "maximum-value": by_date(ordered, last),
    }
    for method, each in expected.items():
        found = ndvi.fifesim.composite(method, clear=clear)
        assert (found.chunks is not None) == lazy
        np.testing.assert_allclose(found.values, each, rtol=1e-12)
        assert found.attrs["composite"] == method
    nearest = ndvi.fifesim.composite("nadir-most", clear=clear)
    np.testing.assert_array_equal(nearest.vza.values[some], slant.min(axis=0)[some])
    # Views from the other side of the track are equally far from nadir.
    signed = ndvi.assign_coords(vza=-ndvi.vza)
    np.testing.assert_array_equal(signed.fifesim.composite("nadir-most", clear=clear).values, nearest.values)
    mean = ndvi.fifesim.composite("mean-of-clear", clear=clear)
    np.testing.assert_array_equal(mean.dates.values, count)
