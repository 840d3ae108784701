"""User rasters: accepted reflectances, units, scales and band names; names, units and provenance of results."""

import warnings
from pathlib import Path

import dask.array as da
import numpy as np
import pandas as pd
import pytest
import rasterio
import rioxarray
import xarray as xr
from lazy import no_compute

import fifesim
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.grids.inputs import check_reflectance, in_micrometres, incoming, opened, unpacked

AIR, TIME = fifesim.Atmosphere(), "2022-06-03T17:10Z"


def own(site, values, dtype, **attrs):
    """Raster of one value from another program."""
    cells = xr.DataArray(np.full(site.shape, values, dtype), dims=("y", "x"), name="mine")
    return grids.place(cells, site).assign_attrs(attrs)


@pytest.fixture
def fractions(site):
    values = np.round(np.random.default_rng(2).uniform(0.02, 0.5, (2, *site.shape)), 4)
    cells = xr.DataArray(values, dims=("band", "y", "x"), coords={"band": ["B04", "B08"]}, name="mine")
    return grids.place(cells, site)


def as_stored(fractions, **attrs):
    """The raster as agencies store it: integers, with one cell without data."""
    whole = np.round(fractions * 10000).astype("int16")
    whole[:, 3, 4] = -9999
    return whole.drop_attrs(deep=False).assign_attrs(attrs)


def by_variable(raster):
    return xr.Dataset({name: raster.sel(band=band, drop=True) for name, band in (("red", "B04"), ("nir", "B08"))})


@pytest.fixture
def with_hole(fractions):
    return fractions.where((fractions.x != fractions.x[4]) | (fractions.y != fractions.y[3]))


@pytest.fixture
def toa(with_hole):
    return with_hole.fifesim.to_toa(AIR, time=TIME, instrument="MSI")


def test_integers_are_scaled_to_reflectance(fractions, with_hole, toa, array_type):
    """Band names of Sentinel-2 are recognised."""
    for no_data in ("_FillValue", "nodata", "missing_value"):
        mine = array_type(as_stored(fractions, scale_factor=1e-4, add_offset=0.0, **{no_data: -9999}))
        np.testing.assert_allclose(incoming(opened(mine), "surface_reflectance"), with_hole, rtol=0, atol=1e-12)
    found = mine.fifesim.to_toa(AIR, time=TIME, instrument="Sentinel-2")
    np.testing.assert_allclose(found, toa, rtol=0, atol=1e-12)
    assert found["band"].values.tolist() == ["MSI4", "MSI8"]


def test_offset_is_added_and_undeclared_nodata_gives_a_warning(site):
    """Landsat Collection 2 surface reflectance: 7273 is 0 and 43636 is 1, so 0 would be read as -0.2."""
    mine = own(site, 10909, "uint16", scale_factor=2.75e-5, add_offset=-0.2)
    with pytest.warns(UserWarning, match=r"no value for no data.*_FillValue=0"):
        found = incoming(opened(mine), "surface_reflectance")
    np.testing.assert_allclose(found, 0.0999975, rtol=0, atol=1e-9)


def test_impossible_reflectance_is_refused_and_bright_or_dark_ground_is_not():
    """Snow, a glint, white slopes toward a low sun and dark water give no warning."""
    edge, cells = np.array([-0.5, 5.0, np.nan]), np.arange(100).reshape(1, 10, 10)
    assert check_reflectance(edge) is edge
    for wrong in (-0.51, 5.01, np.inf):
        with pytest.raises(ValueError, match=r"-0\.5 to 5 is allowed"):
            check_reflectance(np.array([0.2, wrong]))
    glint, slopes = np.where(cells < 60, 0.03, 2.0), np.where(cells % 5 < 2, 2.4, 0.5)
    flat = np.append(np.full(60, 0.2), np.full(40, 1.2)), np.array([-0.2, -0.2, 0.1, 0.1]), np.asarray(0.4)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for values in (np.full((2, 6, 6), 0.95), slopes, glint, np.full((1, 6, 6), -0.004), *flat):
            check_reflectance(values)


def test_dataset_with_a_variable_per_band_and_dates(fractions, with_hole, toa):
    """odc.stac.load returns a Dataset with one variable over (time, y, x) per band."""
    found = by_variable(with_hole).fifesim.to_toa(AIR, time=TIME, instrument="MSI")
    np.testing.assert_array_equal(found, toa)
    whole = by_variable(as_stored(fractions)).assign_attrs(scale_factor=1e-4, nodata=-9999)
    np.testing.assert_allclose(incoming(opened(whole), "surface_reflectance"), with_hole, rtol=0, atol=1e-12)
    stored = as_stored(fractions, scale_factor=1e-4, nodata=-9999)
    mixed = by_variable(stored).assign(nir=fractions[1].drop_vars("band"))
    np.testing.assert_allclose(incoming(opened(mixed), "surface_reflectance")[1], fractions[1])
    times = np.array(["2022-05-01T17:10", "2022-06-03T17:10"], "M8[ns]")
    dates = by_variable(xr.concat([stored, stored], dim=xr.DataArray(times, dims="time", name="time")))
    both = dates.fifesim.to_toa(AIR, instrument="MSI")
    assert both.dims == ("time", "band", "y", "x") and both["sza"].dims == ("time",)
    np.testing.assert_array_equal(both[1], stored.fifesim.to_toa(AIR, time=times[1], instrument="MSI"))


def test_file_opened_with_rioxarray(fractions, toa, tmp_path):
    """rioxarray numbers bands from 1 and stores their names in long_name."""
    path = tmp_path / "mine.tif"
    as_stored(fractions).rio.write_nodata(-9999).rio.to_raster(path)
    with rasterio.open(path, "r+") as file:
        file.descriptions, file.scales = ("red", "nir"), (1e-4, 1e-4)
    for options in ({}, {"chunks": {"y": 20}}, {"mask_and_scale": True}):
        with rioxarray.open_rasterio(path, **options) as mine:
            found = mine.fifesim.to_toa(AIR, time=TIME, instrument="Sentinel-2")
            np.testing.assert_allclose(found, toa, rtol=0, atol=1e-7)
            assert found["band"].values.tolist() == ["MSI4", "MSI8"]


def test_band_names_follow_the_band_numbers(fractions, tmp_path):
    """A band selection keeps the band numbers, but long_name still lists all names of the file."""
    path, names = tmp_path / "six.tif", ("B02", "B03", "B04", "B08", "B11", "B12")
    xr.concat([fractions] * 3, "band").drop_vars("band").rio.to_raster(path)
    with rasterio.open(path, "r+") as file:
        file.descriptions = names
    with rioxarray.open_rasterio(path) as mine:
        for chosen in ([2, 3], [5, 4, 3], [0]):
            taken = incoming(mine.isel(band=chosen), "surface_reflectance")
            assert taken["band"].values.tolist() == [names[number] for number in chosen]
        assert incoming(mine.sel(band=3), "surface_reflectance")["band"].item() == "B04"
    with rioxarray.open_rasterio(path, band_as_variable=True) as mine:
        assert incoming(opened(mine), "surface_reflectance")["band"].values.tolist() == list(names)


def test_wavelengths_are_converted_to_micrometres(fractions):
    for unit in ("nm", "Nanometers"):
        there = fractions.drop_vars("band").assign_coords(wavelength=("band", [665.0, 833.0], {"units": unit}))
        np.testing.assert_allclose(in_micrometres(there)["wavelength"], [0.665, 0.833], rtol=1e-12)
    single = there.astype("float32")
    assert single.fifesim.to_toa(AIR, time=TIME).dtype == incoming(single, "surface_reflectance").dtype == np.float32


def test_scale_offset_and_fill_value_are_applied_and_removed():
    packed = xr.DataArray(np.array([[0, 35], [255, 100]], np.uint8), dims=("y", "x"), name="Lai_500m")
    packed.attrs = {"scale_factor": 0.1, "add_offset": 1.0, "_FillValue": 255, "units": "m2/m2"}
    found = unpacked(packed)
    np.testing.assert_allclose(found, [[1.0, 4.5], [np.nan, 11.0]], rtol=1e-15)
    assert (found.attrs, found.name, packed.attrs["scale_factor"]) == ({"units": "m2/m2"}, "Lai_500m", 0.1)
    with no_compute():
        lazy = unpacked(packed.chunk())
    assert isinstance(lazy.data, da.Array)
    np.testing.assert_array_equal(lazy, found)
    plain = packed.astype(np.float32).assign_attrs(_FillValue=np.nan, scale_factor=1, add_offset=0)
    assert unpacked(plain) is plain


def test_scales_by_band_follow_the_numbers_of_the_bands(fractions, with_hole):
    """rioxarray has `scales` and `offsets` for all bands of the file, also after a selection."""
    stored = as_stored(fractions, scales=(1e-4, 2e-4), offsets=(0.0, 0.1), _FillValue=-9999)
    stored = stored.assign_coords(band=[1, 2])
    expected = with_hole.values * [[[1]], [[2]]] + [[[0]], [[0.1]]]
    np.testing.assert_allclose(opened(stored), expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(opened(stored.sel(band=2)), expected[1], rtol=0, atol=1e-12)
    with pytest.raises(ValueError, match=r"scale_factor \(0\.0001, 0\.0002\).*one for each numbered band"):
        opened(stored.assign_coords(band=["red", "nir"]))


def test_numbers_beyond_the_valid_range_are_no_data(site):
    """LAI of MODIS: 249 to 254 stand for water, cities and the like, and CF takes them as missing."""
    whole = own(site, 25, "uint8")
    whole[2, 3], whole[4, 5] = 253, 255
    expected = whole.where(whole == 25) * 0.1
    for attrs in ({"valid_range": (0, 100)}, {"valid_min": 0, "valid_max": np.uint8(100)}):
        lai = opened(whole.assign_attrs(scale_factor=0.1, _FillValue=255, **attrs))
        np.testing.assert_allclose(lai, expected, rtol=1e-15)
        assert not {"valid_range", "valid_min", "valid_max", "scale_factor"} & set(lai.attrs)
        # In fractions, the attributes may still refer to the stored numbers.
        np.testing.assert_array_equal(opened((expected * 1000).assign_attrs(attrs)), expected * 1000)


def test_codes_and_digital_numbers_stay_whole_numbers(site):
    codes = own(site, 0, "int16", _FillValue=-1, flag_values=[0, 1])
    counts = own(site, 0, "int16", _FillValue=0).assign_coords(gain=0.8, offset=-1.2)
    assert opened(codes) is codes and opened(counts) is counts


def test_written_file_has_the_scale_of_its_whole_numbers(site, tmp_path):
    stored = own(site, 8, "int16").rename("lai")
    stored[1, 1] = -1
    packing = {"scale_factor": 0.1, "add_offset": 0.5, "_FillValue": -1}
    encoded = stored.copy()
    encoded.encoding |= packing
    for mine in (stored.assign_attrs(packing), encoded):
        path = mine.fifesim.to_geotiff(tmp_path / "lai.tif", overwrite=True)
        with rasterio.open(path) as file:
            assert (file.scales, file.offsets, file.nodata, file.dtypes) == ((0.1,), (0.5,), -1, ("int16",))
        again = fifesim.open_image(path)
        np.testing.assert_array_equal(again, mine)
        np.testing.assert_allclose(opened(again)[:2, :2], [[1.3, 1.3], [1.3, np.nan]], rtol=1e-12)
        np.testing.assert_allclose(fifesim.open_lai(path, site), opened(mine), rtol=1e-12)


def test_quantities_have_names_and_units_of_the_cf_table():
    table = pd.read_csv(Path(__file__).parents[1] / "data" / "cf_standard_names.csv", comment="#", dtype=str)
    units = dict(zip(table["standard_name"], table["units"], strict=True))
    for name, quantity in cf.QUANTITIES.items():
        if quantity.standard_name:
            assert quantity.units == units[quantity.standard_name.removesuffix(" standard_error")], name
        assert quantity.units in {*units.values(), "astronomical_unit"} and all(cf.attributes(name).values()), name


def test_label_replaces_attributes_and_keeps_provenance_and_history(site):
    before = own(site, 1.0, float, units="percent", valid_range="0 100", history="mine")
    after = cf.label(before, "ndvi", history="ndvi")
    assert after.name == "ndvi" and after.attrs == cf.attributes("ndvi") | {"history": "ndvi"}
    assert before.name == "mine" and before.attrs["units"] == "percent"
    source = own(site, 1.0, float, history="one", arp=0.15, references="Friedl", units="1", something="else")
    after = cf.label(before, "fpar", source=source, history="two", references="Tanre", arp=0.2)
    assert (after.attrs["history"], after.attrs["references"], after.attrs["arp"]) == ("one\ntwo", "Friedl; Tanre", 0.2)
    again = cf.label(before, "toa_reflectance", source=after, history="to_toa", references="Tanre")
    assert again.attrs["references"] == "Friedl; Tanre" and "something" not in after.attrs


def test_units_have_several_spellings(site):
    for units in ("1", "", "m2 m-2", " 1 ", "dimensionless"):
        cf.check_units(own(site, 1.0, float, units=units), "lai")
    # rioxarray gives the units of bands as a tuple.
    radiance = own(site, 1.0, float, units=("W m-2 sr-1 um-1",) * 3)
    cf.check_units(radiance, "toa_radiance")
