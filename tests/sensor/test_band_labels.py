"""Bands of rasters: instruments in attributes, names and wavelengths, PSF, MTF and noise, and bands from spectra."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function
from mistakes import mistakes

import fifesim
from fifesim.grids import grid as grids
from fifesim.ground.canopy.prospect import Leaf, leaf_spectrum
from fifesim.sensor.band_labels import spectral_axis
from fifesim.sensor.description.instruments import instrument, instrument_names
from fifesim.sensor.description.spatial_response import BoxcarResponse, CosineResponse, TwoAxesResponse
from fifesim.sensor.description.spectral_response import ResponseList
from fifesim.sensor.instrument_labels import (
    attributes_of,
    carried_instrument,
    check_wavelengths,
    given_instrument,
    matching_bands,
    noise_equivalent_radiance,
    snr,
    warn_of_others,
)
from fifesim.sensor.response.spectral import band_weights, covered_steps

TM, PAPER = instrument("TM"), instrument("TM", "paper")


def raster(**attrs):
    return xr.DataArray(0.1, name="mine", attrs=attrs)


@pytest.mark.parametrize("name", instrument_names())
def test_user_instrument_round_trips_through_attributes(name):
    own = replace(instrument(name), name="MINE")
    again = carried_instrument(raster(**attributes_of(own)))
    assert [band.response for band in again.bands] == [band.response for band in own.bands]
    assert [again.line_spreads(band) for band in again.bands] == [own.line_spreads(band) for band in own.bands]
    srf = own.bands[0].srf
    one, other = (replace(each, bands=tuple(replace(band, srf=srf) for band in each.bands)) for each in (again, own))
    assert one == other


def test_built_in_instrument_is_stored_by_name():
    assert attributes_of(TM) == {"instrument": "TM"}
    assert carried_instrument(raster(instrument="landsat 5")) == TM, "an alias"
    assert carried_instrument(raster()) is None
    assert carried_instrument(raster(**attributes_of(replace(TM, bits=10)))).bits == 10, "another of the same name"
    assert given_instrument("MSI", raster(instrument="TM")).name == "MSI"
    assert given_instrument(None, raster(instrument="OLI")).name == "OLI"


# ------------------------------------------------------------------------------------------ bands


def named(bands=None, wavelengths=None, **attrs):
    count = len(bands or wavelengths)
    found = xr.DataArray(np.zeros((count, 1, 1)), dims=("band", "y", "x"), attrs=attrs)
    found = found.assign_coords(band=bands) if bands else found
    return found.assign_coords(wavelength=("band", wavelengths)) if wavelengths else found


def matched(array, name):
    return [band.name for band in matching_bands(array, instrument(name))]


@pytest.mark.parametrize(("stage", "case", "said"), mistakes("contradiction", name="sensor_mistakes"), ids=str)
def test_names_that_contradict_wavelengths_raise(stage, case, said):
    """Other instruments in the catalogue have bands with these names and wavelengths."""
    name, bands, wavelengths = case
    with pytest.raises(ValueError, match=f"{said}.*contradict each other.*drop_vars"):
        matched(named(bands, wavelengths), name)
    assert matched(named(bands), name) == bands


def test_shared_names_apply_if_the_wavelength_matches():
    """MSS4 is green on Landsat-1 and near infrared on Landsat-5; MSI4 is red on every Sentinel-2."""
    first = named(["MSS4", "MSS5"], [0.55, 0.65])
    assert (matched(first, "MSS"), matched(first, "MSS5")) == (["MSS4", "MSS5"], ["MSS1", "MSS2"])
    for wavelength, names in ((0.553, ("MSS4", "MSS1")), (0.93, ("MSS7", "MSS4"))):
        seen = named(["MSS4"], [wavelength])
        assert tuple(matched(seen, name)[0] for name in ("MSS", "MSS5")) == names
    assert matched(named(["MSS4", "MSS5"], [np.nan, np.nan]), "MSS") == ["MSS4", "MSS5"]
    assert matched(named(["MSI4", "MSI8"], [0.665, 0.842]), "MSI-B") == ["MSI4", "MSI8"]
    # If the instrument of the raster defines TM3 and TM4 differently, wavelengths decide.
    own = replace(TM, name="mine", bands=tuple(replace(TM.bands[k], name=n) for k, n in ((3, "TM3"), (2, "TM4"))))
    assert matched(named(["TM3", "TM4"], [0.84, 0.66], **attributes_of(own)), "TM") == ["TM4", "TM3"]
    # Only names of instrument bands are checked.
    for bands, wavelengths in ((None, [0.83, 0.66]), (["a", "b"], [0.83, 0.66]), (["TM3", "TM4"], None)):
        check_wavelengths(named(bands, wavelengths))


def test_wavelength_matches_the_narrow_band_instead_of_panchromatic():
    """The panchromatic bands, 0.52 to 0.90 um and 0.50 to 0.68 um, also respond there, sometimes more strongly."""
    known = {"ETM+": {"TM2": "ETM2", "TM3": "ETM3", "TM4": "ETM4"}, "OLI": {"TM2": "OLI3", "TM3": "OLI4"}}
    for name, expected in known.items():
        wavelengths = [band.wavelength for band in TM.select(list(expected))]
        assert matched(named(None, wavelengths), name) == list(expected.values())


def test_responses_are_relative_to_their_peak():
    """The threshold is 5 % of the peak, in any unit of the response."""
    table = TM.bands[2].response
    strong = ResponseList(table.wavelength, tuple(50 * value for value in table.response))
    own = replace(TM, name="mine", bands=(*TM.bands[:2], replace(TM.bands[2], srf=strong), *TM.bands[3:]))
    edge = next(w for w, r in zip(table.wavelength, table.response, strict=True) if r >= 0.05 * max(table.response))
    assert matching_bands(named(["TM3"], [0.66]), own)[0].name == "TM3"
    with pytest.raises(ValueError, match="contradict each other"):
        check_wavelengths(named(["TM3"], [edge], **attributes_of(own)), own)


def test_only_bands_of_another_instrument_warn(recwarn):
    for array, name in ((named(["TM3"], instrument="TM"), "TM"), (named(["OLI4"], instrument="TM"), "OLI")):
        warn_of_others(array, instrument(name), matching_bands(array, instrument(name)))
    assert not recwarn
    with pytest.warns(UserWarning, match=r"bands TM3 of TM are taken for OLI4 of OLI, as they are: .*adjust_bands"):
        warn_of_others(named(["TM3"], instrument="TM"), instrument("OLI"), instrument("OLI").select("OLI4"))


# ------------------------------------------------------------------------------------------ PSF, MTF and noise


def test_along_and_across_responses_are_on_the_right_axes():
    """The PSF sums to 1; its peak is the squared peak density of the cosine of the paper, half of it at the ends."""
    spread = fifesim.sensor.psf(PAPER, "TM4")
    assert float(spread.sum()) * float(spread["x"][1] - spread["x"][0]) ** 2 == pytest.approx(1.0, rel=1e-12)
    peak = (2 * np.pi / (3 * PAPER.line_spread.width) / np.sqrt(3)) ** 2
    assert float(spread.sel(x=0, y=0)) == pytest.approx(peak, rel=1e-3)
    along, across = BoxcarResponse("boxcar", width=90 / 705e3), CosineResponse("cosine", step=4.778e-6, count=9)
    mixed = replace(PAPER, lsf=TwoAxesResponse(along, across))
    spread = fifesim.sensor.psf(mixed, spacing=1.0)
    assert (spread.sum("x") > 1e-9).sum() == 91 and (spread.sum("y") > 1e-9).sum() == 31
    transfer = fifesim.sensor.mtf(mixed, "TM3", frequency=[0.0, 1 / 90])[0]
    np.testing.assert_allclose(transfer.sel(direction="along"), [1.0, 0.0], rtol=0, atol=1e-12)
    assert transfer.sel(direction="across")[1] > 0.8


def test_mtf_extends_to_the_sampling_frequency_of_each_band():
    transfer = fifesim.sensor.mtf("TM", "TM3")
    assert transfer.dims == ("band", "direction", "frequency")
    assert float(transfer["frequency"][-1]) == pytest.approx(1 / 30.315)
    assert float(transfer["nyquist"].sel(band="TM3", direction="along")) == pytest.approx(0.5 / 30.315)
    transfer = fifesim.sensor.mtf("MSI")
    assert float(transfer["nyquist"].sel(band="MSI1", direction="across")) == pytest.approx(0.5 / 60, rel=1e-3)
    assert float(transfer["product_nyquist"].sel(band="MSI11")) == 0.5 / 20
    np.testing.assert_allclose(transfer["at_nyquist"].sel(band="MSI4"), [0.24, 0.31], rtol=0, atol=0.01)
    # A boxcar detector passes sinc(width times frequency).
    modis = fifesim.sensor.mtf(fifesim.instrument("MODIS", response="detector"), ["MODIS1"]).sel(direction="along")
    width = instrument("MODIS").ground_fields(instrument("MODIS").bands[0]).along
    np.testing.assert_allclose(modis["at_product_nyquist"], np.sinc(width * modis["product_nyquist"]), rtol=1e-12)


def test_snr_agrees_with_the_specification_and_the_shot_share():
    """MSI4: 223 at 108 W m-2 sr-1 um-1. The variance at zero radiance is not shot noise."""
    (band,) = instrument("MSI").select("MSI4")
    assert float(snr("MSI", "msi4", 108.0)) == pytest.approx(223.0, rel=1e-12)
    full = (108.0 / 223.0) ** 2
    found = noise_equivalent_radiance("MSI", "MSI4", np.array([108.0, 54.0, 0.0])) ** 2
    np.testing.assert_allclose(found, full * (1 - band.noise.shot * np.array([0.0, 0.5, 1.0])), rtol=1e-12)
    np.testing.assert_allclose(snr("MSI", "MSI4", 54.0), 54.0 / np.sqrt(found[1]), rtol=1e-12)


# ------------------------------------------------------------------------------------------ bands from spectra


@pytest.fixture(scope="module")
def leaf():
    """Reflectance and transmittance of a leaf as two field spectra."""
    wavelength, reflectance, transmittance = leaf_spectrum(Leaf())
    values = np.stack([reflectance, transmittance])
    return xr.DataArray(values, dims=("sample", "wavelength"), coords={"wavelength": wavelength})


def test_cube_becomes_bands_lazily(site):
    """Leaf spectrum in steps of 20 nm, with a different brightness in each cell; a missing value affects one band."""
    wavelength, reflectance, _ = leaf_spectrum(Leaf())
    values = reflectance[::20, None, None] * np.random.Generator(np.random.Philox(5)).uniform(0.2, 1, site.shape)
    values[int(np.argmin(abs(wavelength[::20] - 0.865))), 3, 4] = np.nan
    coords = {"wavelength": ("band", wavelength[::20] * 1000, {"units": "nm"}), "sza": 30.0, "saa": 120.0}
    cube = grids.place(xr.DataArray(values, dims=("band", "y", "x"), coords=coords), site)
    image = check_raster_function(lambda each: each.fifesim.to_bands("OLI"), cube, quantity="surface_reflectance")
    assert image["band"].values.tolist() == [band.name for band in fifesim.instrument("OLI").bands]
    assert image.attrs["instrument"] == "OLI" and float(image["sza"]) == 30
    assert image.attrs["history"] == "to_bands: OLI, 106 wavelengths weighted by response and sun"
    missing = [(image["band"].values[band], row, column) for band, row, column in np.argwhere(np.isnan(image.values))]
    assert missing == [("OLI5", 3, 4)]
    # Bands are weighted sums of samples in any order.
    back = cube.isel(band=slice(None, None, -1)).fifesim.to_bands("OLI", bands=["OLI4", "OLI2"])
    np.testing.assert_allclose(back, image.sel(band=["OLI4", "OLI2"]), rtol=1e-13)
    (band,) = fifesim.instrument("OLI").select("OLI4")
    weights = band_weights(band.response, wavelength[::20], covered_steps(wavelength[::20])).weights
    np.testing.assert_allclose(image.sel(band="OLI4")[0], weights @ values[:, 0], rtol=1e-9)
    toa = cube.assign_attrs(standard_name="toa_bidirectional_reflectance")
    assert toa.fifesim.to_bands("OLI").name == "toa_reflectance"


def test_radiance_is_weighted_by_the_response_only():
    wavelength = np.linspace(0.4, 1.0, 121)
    radiance = xr.DataArray(100 * wavelength, dims="wavelength", coords={"wavelength": wavelength})
    radiance.attrs["units"] = "W m-2 sr-1 um-1"
    found = radiance.fifesim.to_bands("OLI", bands=["OLI4"])
    assert found.name == "toa_radiance" and found.attrs["units"] == "W m-2 sr-1 um-1"
    # The mean wavelength over the response is the band centre.
    assert float(found[0]) == pytest.approx(100 * fifesim.instrument("OLI").select("OLI4")[0].wavelength, rel=1e-5)
    assert "solar_irradiance" in found.coords
    reflectance = radiance.drop_attrs() / 100
    assert float(reflectance.fifesim.to_bands("OLI", bands=["OLI4"])[0]) < float(found[0]) / 100 - 1e-5


def without(leaf, low, high):
    return leaf.isel(wavelength=(leaf["wavelength"].values < low) | (leaf["wavelength"].values > high))


def test_gaps_are_determined_by_fwhm_and_refused_or_without_weight(leaf):
    """An accepted gap has no weight, and a flat spectrum keeps its mean."""
    flat = without(xr.full_like(leaf, 0.3), 1.58, 1.61).fifesim.to_bands("OLI", bands="OLI6", min_coverage=0.5)
    np.testing.assert_allclose(flat, 0.3, rtol=0, atol=1e-12)
    sparse = leaf.isel(wavelength=slice(None, None, 20))
    assert sparse.fifesim.to_bands("OLI", bands="OLI6").notnull().all()
    narrow = sparse.assign_coords(fwhm=("wavelength", np.full(sparse.sizes["wavelength"], 0.005)))
    for cube, said in (
        (narrow, r"hold nothing of OLI1"),
        (without(leaf, 1.58, 1.61), r"OLI6 [\d.]+%, without 1\.579 to 1\.611 um: pick others with band"),
        (without(leaf, 2.2, 9.0), r"to 2\.199 um, and cover less than 0\.99 of OLI7 \d"),
        (without(leaf, 1.0, 9.0), r"hold nothing of OLI6, OLI7, OLI9 of OLI: pick bands, .*'OLI8'\]"),
    ):
        with pytest.raises(ValueError, match=said) as error:
            cube.fifesim.to_bands("OLI")
        assert len(str(error.value)) <= 500


def spectra(wavelength, units=None, dim="band", **coords):
    attrs = {} if units is None else {"units": units}
    found = xr.DataArray(np.zeros((2, len(wavelength))), dims=("sample", dim))
    return found.assign_coords(wavelength=(dim, wavelength, attrs), **coords)


def test_wavelengths_and_widths_default_to_micrometres():
    for units in ("nm", "Nanometers", "nanometre"):
        np.testing.assert_allclose(spectral_axis(spectra([500.0, 600.0], units)).wavelength, [0.5, 0.6], rtol=1e-15)
    for units in (None, "um", "µm", "micrometers"):
        axis = spectral_axis(spectra([0.5, 0.6], units, dim="wavelength"))
        assert (axis.dim, axis.wavelength.tolist(), axis.fwhm) == ("wavelength", [0.5, 0.6], None)
    widths = {"units": "nm"}
    for cube in (
        spectra([500.0, 600.0], "nm", fwhm=("band", [5.0, 6.0])),
        spectra([500.0, 600.0], "nm", fwhm=("band", [5.0, 6.0], widths)),
        spectra([0.5, 0.6], fwhm=("band", [5.0, 6.0], widths)),
    ):
        np.testing.assert_allclose(spectral_axis(cube).fwhm, [0.005, 0.006])
