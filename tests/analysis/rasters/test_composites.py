"""Composites of labelled images."""

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, check_place, in_chunks, no_compute

import fifesim
from fifesim.grids import grid as grids

DATES = np.array(["1987-06-06T16:35", "1987-07-08T16:35", "1987-08-09T16:34"], "datetime64[ns]")


@pytest.fixture(scope="module")
def stack(lai_values):
    """NDVI of three dates with clouds of low values and with holes; one cell has no data."""
    rng = np.random.default_rng(3)
    dates = [lai_values * 0.1 + rng.normal(0, 0.1, lai_values.shape) for _ in DATES]
    found = xr.concat(dates, xr.DataArray(DATES, dims="time", name="time")).rename("ndvi")
    found = found.where(rng.uniform(size=found.shape) > 0.3).assign_attrs(units="1", standard_name="x")
    found[:, 2, 3] = np.nan
    found = grids.place(found.assign_coords(sza=("time", [28.0, 30.0, 35.0])), grids.geobox(lai_values))
    return found


def test_composite_of_ndvi_is_the_largest_with_its_date_and_sun(stack):
    found = fifesim.composite(stack)
    check_place(found, grids.geobox(stack).crs)
    np.testing.assert_array_equal(found, stack.max("time"))
    assert np.isnan(found[2, 3]) and np.isnat(found["date"][2, 3]) and np.isnan(found["sza"][2, 3])
    chosen = stack.fillna(-9).argmax("time").values
    kept = ~np.isnan(found.values)
    np.testing.assert_array_equal(found["date"].values[kept], DATES[chosen[kept]])
    np.testing.assert_array_equal(found["sza"].values[kept], np.array([28.0, 30.0, 35.0])[chosen[kept]])
    assert found.attrs["composite"] == "maximum-value" and "composite" in found.attrs["history"]


@pytest.mark.parametrize("chunks", [ODD_CHUNKS, ODD_CHUNKS | {"time": 1}])
def test_composite_is_lazy_and_the_same_in_chunks(stack, chunks):
    before = stack.copy(deep=True)
    with no_compute():
        lazy = fifesim.composite(in_chunks(stack, chunks))
    assert lazy.chunks is not None and lazy["date"].chunks is not None
    xr.testing.assert_identical(lazy.compute(), fifesim.composite(stack))
    xr.testing.assert_identical(stack, before)


def test_images_are_composed_by_their_ndvi_or_by_what_is_given(stack):
    """All bands of a cell are of one date, by their own NDVI or by an index that is given."""
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


@pytest.mark.parametrize(
    ("change", "options", "said"),
    [
        (
            lambda ndvi: ndvi.fillna(0).astype(np.uint8),
            {},
            r"the sun of each date: convert them with \.fifesim\.to_reflectance",
        ),
        (lambda ndvi: ndvi.isel(time=0), {}, "images along time, got dimensions"),
        (lambda ndvi: ndvi, {"method": "median"}, "method must be one of maximum-value, got 'median'"),
        (lambda ndvi: ndvi, {"by": xr.DataArray(np.zeros((2, 2, 2)), dims=("time", "y", "x"))}, "dates of the images"),
        (lambda ndvi: ndvi.assign_attrs(standard_name="leaf_area_index"), {}, "leaf area index by its standard_name"),
    ],
)
def test_what_makes_no_composite_is_refused(stack, change, options, said):
    with pytest.raises(ValueError, match=said):
        fifesim.composite(change(stack), **options)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda by: by.isel(time=[1, 0, 2]), r"other dates than the images, or in another order: .*\.sortby\('time'\)"),
        (lambda by: by.isel(time=[1, 0, 2]).drop_vars(set(by.coords) - {"time"}), "other dates than the images"),
        (lambda by: by.assign_coords(x=by["x"] + 30.0), "have different grids"),
    ],
)
def test_what_decides_has_the_dates_and_cells_of_the_images(stack, change, said):
    """Of as many dates and cells it would choose wrong ones in silence."""
    with pytest.raises(ValueError, match=said):
        fifesim.composite(stack, by=change(stack))
    plain = stack.drop_vars("spatial_ref").drop_attrs(deep=False) * 2
    np.testing.assert_array_equal(fifesim.composite(stack, by=plain), fifesim.composite(stack))


def test_angles_by_cell_are_those_of_the_date(stack):
    """As a product opened by pixel has them."""
    sza = stack.copy(data=np.random.default_rng(3).uniform(20, 60, stack.shape)).drop_vars("date", errors="ignore")
    found = fifesim.composite(stack.assign_coords(sza=(stack.dims, sza.values)))
    for number, date in enumerate(stack["time"].values):
        there = (found["date"] == date).values
        np.testing.assert_array_equal(found["sza"].values[there], sza.values[number][there])


def test_nothing_records_a_composite(lai):
    toa = lai.fifesim.surface_reflectance().fifesim.to_toa()
    times = xr.DataArray(np.array(["2022-06-01T17:00", "2022-06-11T17:00"], "M8[ns]"), dims="time", name="time")
    clear = xr.concat([toa, toa], times).fifesim.composite()
    with pytest.raises(ValueError, match="a composite is of many dates, and nothing records it"):
        clear.fifesim.sense()


@pytest.mark.parametrize("kind", ["netcdf", "zarr"])
@pytest.mark.parametrize("chunks", [None, ODD_CHUNKS], ids=["eager", "lazy"])
def test_a_composite_comes_back_from_netcdf_and_zarr(stack, tmp_path, kind, chunks):
    found = fifesim.composite(stack if chunks is None else in_chunks(stack, chunks))
    path = tmp_path / "composite"
    if kind == "netcdf":
        found.to_netcdf(path)
        again = xr.open_dataset(path, decode_coords="all")
    else:
        found.to_dataset().to_zarr(path, consolidated=False)
        again = xr.open_zarr(path, decode_coords="all", consolidated=False)
    with again:
        xr.testing.assert_identical(again["ndvi"].load(), found.compute())


def test_the_date_of_a_composite_has_its_own_attributes(stack):
    found = fifesim.composite(stack)
    assert found["date"].attrs == {"long_name": "date of the selected image"}
    assert found["sza"].attrs["standard_name"] == "solar_zenith_angle" and "history" not in found["sza"].attrs


def test_a_composite_with_angles_of_its_cells_goes_to_netcdf_as_the_warning_says(stack, tmp_path):
    found = fifesim.composite(stack)
    with pytest.warns(UserWarning, match="lacks sza, .* or write a netCDF with"):
        again = fifesim.open_image(found.fifesim.to_geotiff(tmp_path / "composite.tif"))
    xr.testing.assert_identical(again, found.drop_vars("sza"))
    found.to_netcdf(tmp_path / "composite.nc")
    with xr.open_dataset(tmp_path / "composite.nc", decode_coords="all") as opened:
        xr.testing.assert_identical(opened["ndvi"].load(), found)
