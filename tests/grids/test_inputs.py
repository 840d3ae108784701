"""User rasters: accepted reflectances, units, scales and band names."""

import warnings

import dask.array as da
import numpy as np
import pytest
import rasterio
import rioxarray
import xarray as xr
from lazy import in_chunks, no_compute

import fifesim
from fifesim.grids import grid as grids
from fifesim.grids.inputs import check_reflectance, in_micrometres, incoming, opened, unpacked

AIR, TIME = fifesim.Atmosphere(), "2022-06-03T17:10Z"


@pytest.fixture
def fractions(site):
    values = np.round(np.random.default_rng(2).uniform(0.02, 0.5, (2, *site.shape)), 4)
    return grids.place(
        xr.DataArray(values, dims=("band", "y", "x"), coords={"band": ["B04", "B08"]}, name="mine"), site
    )


def as_stored(fractions, **attrs):
    """The raster as agencies store it: integers, with one cell without data."""
    whole = np.round(fractions * 10000).astype("int16")
    whole[:, 3, 4] = -9999
    return whole.drop_attrs(deep=False).assign_attrs(attrs)


def by_variable(raster):
    return xr.Dataset({name: raster.sel(band=band, drop=True) for name, band in (("red", "B04"), ("nir", "B08"))})


def with_hole(fractions):
    fractions = fractions.copy()
    fractions[:, 3, 4] = np.nan
    return fractions


@pytest.mark.parametrize("no_data", ["_FillValue", "nodata", "missing_value"])
def test_integers_are_scaled_to_reflectance(fractions, no_data, array_type):
    mine = array_type(as_stored(fractions, scale_factor=1e-4, add_offset=0.0, **{no_data: -9999}))
    np.testing.assert_allclose(incoming(opened(mine), "surface_reflectance"), with_hole(fractions), rtol=0, atol=1e-12)
    surface = mine.fifesim.to_toa(AIR, time=TIME, instrument="Sentinel-2")
    known = with_hole(fractions).fifesim.to_toa(AIR, time=TIME, instrument="Sentinel-2")
    np.testing.assert_allclose(surface, known, rtol=0, atol=1e-12)
    assert surface["band"].values.tolist() == ["MSI4", "MSI8"]


def test_offset_is_added_and_undeclared_nodata_gives_a_warning(site, fractions):
    """Landsat Collection 2 surface reflectance: 7273 is 0 and 43636 is 1, so 0 would be read as -0.2."""
    whole = xr.DataArray(np.full((1, *site.shape), 10909, "uint16"), dims=("band", "y", "x"))
    mine = grids.place(whole, site).assign_attrs(scale_factor=2.75e-5, add_offset=-0.2)
    np.testing.assert_allclose(incoming(opened(mine), "surface_reflectance"), 0.0999975, rtol=0, atol=1e-9)
    with pytest.warns(UserWarning, match=r"no value for no data.*_FillValue=0"):
        incoming(opened(as_stored(fractions.fillna(0), scale_factor=2.75e-5, add_offset=-0.2)), "surface_reflectance")


def test_raw_digital_numbers_are_rejected(fractions):
    dn = (fractions * 400).astype("uint8")
    said = r"mine holds whole numbers \(uint8\) without a scale.*calibrate.*; for scaled"
    for verb in (fifesim.to_surface, fifesim.to_toa):
        with pytest.raises(ValueError, match=said):
            verb(dn, AIR, time=TIME, instrument="MSI")
    with pytest.raises(ValueError, match=r"reflectance of -0\.9999.*Mask no data"):
        (as_stored(fractions) / 10000).fifesim.to_toa(AIR, time=TIME, instrument="MSI")
    with no_compute():
        lazy = in_chunks(fractions * 100, {"y": 20}).fifesim.to_toa(AIR, time=TIME, instrument="MSI")
    with pytest.raises(ValueError, match="it is a fraction"):
        lazy.compute()


def test_valid_range_of_reflectance():
    edge = np.array([-0.5, 5.0, np.nan])
    assert check_reflectance(edge) is edge
    for wrong in (-0.51, 5.01, np.inf):
        with pytest.raises(ValueError, match=r"-0\.5 to 5 is allowed"):
            check_reflectance(np.array([0.2, wrong]))


def test_dark_scene_in_percent_gives_a_warning():
    """All values are below 5 %, so none is impossible; a few bright cells do not matter."""
    for percent in (np.linspace(0.9, 4.5, 100), np.append(np.full(40, 0.2), np.full(60, 1.2))):
        with pytest.warns(UserWarning, match=r"reflectances above 1.*divide by\s+100"):
            check_reflectance(percent)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_reflectance(np.append(np.full(60, 0.2), np.full(40, 1.2)))


def test_bands_ten_times_too_large_give_a_warning():
    """Red 0.5 and near infrared 3.0; snow, a glint and white slopes toward a low sun do not."""
    grass = np.stack([np.full((6, 6), 0.5), np.full((6, 6), 3.0), np.full((6, 6), 0.4)])
    with pytest.warns(UserWarning, match=r"of a band above 1\.5.*their scale"):
        check_reflectance(grass)
    snow = np.stack([np.full((6, 6), 0.95), np.full((6, 6), 0.9)])
    slopes = np.where(np.arange(36).reshape(6, 6) % 5 < 2, 2.4, 0.5)[None]
    glint = np.append(np.full(60, 0.03), np.full(40, 2.0)).reshape(1, 10, 10)
    cloudy = np.where(np.arange(100).reshape(1, 10, 10) < 90, np.nan, 3.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for values in (snow, slopes, glint, np.float64(0.4)):
            check_reflectance(np.asarray(values))
    # Missing values are not counted.
    with pytest.warns(UserWarning, match="above 1"):
        check_reflectance(cloudy)


def test_band_that_is_mostly_negative_gives_a_warning(fractions):
    """An offset applied twice makes the red negative; dark water is slightly negative."""
    with pytest.warns(UserWarning, match=r"negative reflectances, down to -0\.05.*offset.*scale.*applied once"):
        check_reflectance(np.stack([np.full((4, 4), -0.05), np.full((4, 4), 0.3)]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_reflectance(np.full((1, 4, 4), -0.004))
        check_reflectance(np.array([-0.2, -0.2, 0.1, 0.1]))
    lazy = (0 * fractions - 0.05).chunk().fifesim.to_toa(AIR, time=TIME, instrument="MSI")
    with pytest.warns(UserWarning, match="negative reflectances"):
        lazy.compute()


def test_remedy_suggests_nodata_only_if_it_is_missing(fractions):
    whole = (fractions * 10000).astype("int16")
    with pytest.raises(ValueError, match=r"scale_factor=0\.0001\), as.*; calibrate"):
        incoming(opened(whole.assign_attrs(_FillValue=-9999)), "surface_reflectance")
    with pytest.raises(ValueError, match=r"scale_factor=0\.0001, _FillValue=0\), as"):
        incoming(opened(whole), "surface_reflectance")
    with pytest.raises(ValueError, match=r"open its file with fifesim\.open_image"):
        incoming(opened(whole.assign_attrs(FIFESIM="{}")), "surface_reflectance")


def test_fractions_with_a_scale_attribute_are_rejected(fractions):
    """Arithmetic keeps attributes, so a raster that was already scaled still carries its scale."""
    with pytest.raises(ValueError, match=r"also scale_factor 0\.0001.*remove them from \.attrs.*mask_and_scale=True"):
        incoming(opened(fractions.assign_attrs(scale_factor=1e-4)), "surface_reflectance")
    incoming(opened(fractions.assign_attrs(scale_factor=1.0, add_offset=0.0)), "surface_reflectance")


def test_dataset_with_a_variable_per_band(fractions):
    dataset = by_variable(fractions)
    known = fractions.fifesim.to_toa(AIR, time=TIME, instrument="MSI")
    np.testing.assert_array_equal(dataset.fifesim.to_toa(AIR, time=TIME, instrument="MSI"), known)
    whole = by_variable(as_stored(fractions)).assign_attrs(scale_factor=1e-4, nodata=-9999)
    np.testing.assert_allclose(incoming(opened(whole), "surface_reflectance"), with_hole(fractions), rtol=0, atol=1e-12)
    mixed = by_variable(as_stored(fractions, scale_factor=1e-4, nodata=-9999)).assign(nir=dataset["nir"])
    np.testing.assert_allclose(incoming(opened(mixed), "surface_reflectance")[1], fractions[1])
    with pytest.raises(ValueError, match=r"no variables over \(y, x\): sza"):
        incoming(xr.Dataset({"sza": 3.0}), "surface_reflectance")


def test_dataset_with_dates(fractions):
    """odc.stac.load returns such a Dataset, with one variable over (time, y, x) per band."""
    times = np.array(["2022-05-01T17:10", "2022-06-03T17:10"], "M8[ns]")
    whole = as_stored(fractions, scale_factor=1e-4, nodata=-9999)
    dates = xr.concat([whole, whole], dim=xr.DataArray(times, dims="time", name="time"))
    toa = by_variable(dates).fifesim.to_toa(AIR, instrument="MSI")
    assert toa.dims == ("time", "band", "y", "x") and toa["sza"].dims == ("time",)
    alone = whole.fifesim.to_toa(AIR, time=times[1], instrument="MSI")
    np.testing.assert_array_equal(toa[1], alone)


def test_file_opened_with_rioxarray(fractions, tmp_path):
    """rioxarray numbers bands from 1 and stores their names in long_name."""
    path = tmp_path / "mine.tif"
    whole = as_stored(fractions).rio.write_nodata(-9999)
    whole.rio.to_raster(path)
    with rasterio.open(path, "r+") as file:
        file.descriptions, file.scales = ("red", "nir"), (1e-4, 1e-4)
    known = with_hole(fractions).fifesim.to_toa(AIR, time=TIME, instrument="MSI")
    for options in ({}, {"chunks": {"y": 20}}, {"mask_and_scale": True}):
        with rioxarray.open_rasterio(path, **options) as mine:
            toa = mine.fifesim.to_toa(AIR, time=TIME, instrument="Sentinel-2")
            np.testing.assert_allclose(toa, known, rtol=0, atol=1e-7)
            assert toa["band"].values.tolist() == ["MSI4", "MSI8"]


@pytest.mark.parametrize("unit", ["nm", "Nanometers"])
def test_wavelengths_in_nanometres(fractions, unit):
    there = fractions.drop_vars("band").assign_coords(wavelength=("band", [665.0, 833.0], {"units": unit}))
    np.testing.assert_allclose(in_micrometres(there)["wavelength"], [0.665, 0.833], rtol=1e-12)
    here = fractions.drop_vars("band").assign_coords(wavelength=("band", [0.665, 0.833])).astype("float32")
    toa = here.fifesim.to_toa(AIR, time=TIME)
    assert toa.dtype == incoming(here, "surface_reflectance").dtype == np.float32
    np.testing.assert_allclose(there.fifesim.to_toa(AIR, time=TIME), toa, rtol=1e-6)
    with pytest.raises(ValueError, match="are in 'angstrom': convert them to 'um' or 'nm'"):
        in_micrometres(fractions.assign_coords(wavelength=("band", [6650.0, 8330.0], {"units": "angstrom"})))


def test_band_names_follow_the_band_numbers(fractions, tmp_path):
    """A band selection keeps the band numbers, but long_name still lists all names of the file."""
    path = tmp_path / "six.tif"
    six = xr.concat([fractions * share for share in (1.0, 0.5, 0.25)], "band").drop_vars("band")
    six.rio.to_raster(path)
    names = ("B02", "B03", "B04", "B08", "B11", "B12")
    with rasterio.open(path, "r+") as file:
        file.descriptions = names
    with rioxarray.open_rasterio(path) as mine:
        for chosen in ([2, 3], [5, 4, 3], [0]):
            taken = incoming(mine.isel(band=chosen), "surface_reflectance")
            assert taken["band"].values.tolist() == [names[number] for number in chosen]
        assert incoming(mine.sel(band=3), "surface_reflectance")["band"].item() == "B04"
    with rioxarray.open_rasterio(path, band_as_variable=True) as mine:
        assert incoming(opened(mine), "surface_reflectance")["band"].values.tolist() == list(names)


def test_numbered_bands_give_a_warning(fractions):
    with pytest.warns(UserWarning, match="counts its bands 1 to 2, taken for TM1 to TM2: name them"):
        fractions.assign_coords(band=[1, 2]).fifesim.to_toa(AIR, time=TIME, instrument="TM")


def test_bands_of_another_instrument_give_a_warning(lai):
    rho = lai.fifesim.surface_reflectance("MSI", bands=["MSI4", "MSI8"])
    with pytest.warns(UserWarning, match=r"MSI4, MSI8 of MSI are taken for TM3, TM4 of TM.*adjust_bands\('TM'\)"):
        as_tm = rho.fifesim.to_toa(instrument="TM")
    assert as_tm["band"].values.tolist() == ["TM3", "TM4"] and as_tm.attrs["instrument"] == "TM"


CELLS = np.array([[0, 35], [255, 100]], np.uint8)


def test_scale_offset_and_fill_value_are_applied_and_removed():
    packed = xr.DataArray(CELLS, dims=("y", "x"), name="Lai_500m")
    packed.attrs = {"scale_factor": 0.1, "add_offset": 1.0, "_FillValue": 255, "units": "m2/m2"}
    found = unpacked(packed)
    np.testing.assert_allclose(found, [[1.0, 4.5], [np.nan, 11.0]], rtol=1e-15)
    assert (found.attrs, found.name, packed.attrs["scale_factor"]) == ({"units": "m2/m2"}, "Lai_500m", 0.1)
    with no_compute():
        lazy = unpacked(packed.chunk())
    assert isinstance(lazy.data, da.Array)
    np.testing.assert_array_equal(lazy, found)


def test_unpacked_values_are_unchanged():
    plain = xr.DataArray(CELLS.astype(np.float32), dims=("y", "x"), attrs={"_FillValue": np.nan, "scale_factor": 1})
    assert unpacked(plain) is plain


def test_scales_by_band_follow_the_numbers_of_the_bands(fractions):
    """rioxarray has `scales` and `offsets` for all bands of the file, also after a selection."""
    stored = as_stored(fractions, scales=(1e-4, 2e-4), offsets=(0.0, 0.1), _FillValue=-9999)
    stored = stored.assign_coords(band=[1, 2])
    expected = with_hole(fractions).values * [[[1]], [[2]]] + [[[0]], [[0.1]]]
    np.testing.assert_allclose(opened(stored), expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(opened(stored.sel(band=2)), expected[1], rtol=0, atol=1e-12)
    with pytest.raises(ValueError, match=r"scale_factor \(0\.0001, 0\.0002\).*one for each numbered band"):
        opened(stored.assign_coords(band=["red", "nir"]))


@pytest.mark.parametrize(
    "attrs", [{"valid_range": (0, 100)}, {"valid_min": 0, "valid_max": np.uint8(100)}, {"valid_max": 100}]
)
def test_numbers_beyond_the_valid_range_are_no_data(site, attrs):
    """LAI of MODIS: 249 to 254 stand for water, cities and the like, and CF takes them as missing."""
    whole = grids.place(xr.DataArray(np.full(site.shape, 25, "uint8"), dims=("y", "x"), name="lai"), site)
    whole[2, 3], whole[4, 5] = 253, 255
    expected = whole.where(whole == 25) * 0.1
    lai = opened(whole.assign_attrs(scale_factor=0.1, _FillValue=255, **attrs))
    np.testing.assert_allclose(lai, expected, rtol=1e-15)
    assert not {"valid_range", "valid_min", "valid_max", "scale_factor"} & set(lai.attrs)
    # In fractions, the attributes may still refer to the stored numbers.
    np.testing.assert_array_equal(opened((expected * 1000).assign_attrs(attrs)), expected * 1000)


@pytest.mark.parametrize("scale", [0.0, np.nan, "0.1", (0.1, 0.2)])
def test_impossible_scale_is_named(site, scale):
    whole = grids.place(xr.DataArray(np.full(site.shape, 25, "uint8"), dims=("y", "x"), name="mine"), site)
    with pytest.raises(ValueError, match=r"mine has scale_factor .* must be a finite number"):
        opened(whole.assign_attrs(scale_factor=scale))


def test_codes_and_digital_numbers_stay_whole_numbers(site):
    codes = grids.place(xr.DataArray(np.zeros(site.shape, "int16"), dims=("y", "x")), site)
    codes = codes.assign_attrs(_FillValue=-1, flag_values=[0, 1])
    counts = codes.drop_attrs().assign_attrs(_FillValue=0).assign_coords(gain=0.8, offset=-1.2)
    assert opened(codes) is codes and opened(counts) is counts


def test_written_file_has_the_scale_of_its_whole_numbers(site, tmp_path):
    stored = grids.place(xr.DataArray(np.full(site.shape, 8, "int16"), dims=("y", "x"), name="lai"), site)
    stored[1, 1] = -1
    for key, mine in {
        "attrs": stored.assign_attrs(scale_factor=0.1, add_offset=0.5, _FillValue=-1),
        "encoding": stored.copy(),
    }.items():
        mine.encoding |= {"scale_factor": 0.1, "add_offset": 0.5, "_FillValue": -1} if key == "encoding" else {}
        path = mine.fifesim.to_geotiff(tmp_path / f"{key}.tif")
        with rasterio.open(path) as file:
            assert (file.scales, file.offsets, file.nodata, file.dtypes) == ((0.1,), (0.5,), -1, ("int16",))
        with rioxarray.open_rasterio(path, mask_and_scale=True) as read:
            np.testing.assert_allclose(read[0, 0], 1.3, rtol=1e-6)
        again = fifesim.open_image(path)
        np.testing.assert_array_equal(again, mine)
        np.testing.assert_allclose(fifesim.open_lai(path, site), opened(mine), rtol=1e-12)
        np.testing.assert_allclose(opened(again), opened(mine), rtol=1e-12)
    with pytest.raises(ValueError, match="fractions but also scale_factor"):
        (stored * 0.1).assign_attrs(scale_factor=0.1).fifesim.to_geotiff(tmp_path / "scaled.tif")
