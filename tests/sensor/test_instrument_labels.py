"""Instruments in raster attributes, bands by name and wavelength, and PSF, MTF and noise as rasters."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import fifesim
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

TM = instrument("TM")
PAPER = instrument("TM", "paper")
SILENT = replace(TM, bands=tuple(replace(each, noise=None) for each in TM.bands))
TM34, WRONG = ["TM3", "TM4"], [0.83, 0.66]


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
    assert carried_instrument(raster(instrument="TM")) == TM
    assert carried_instrument(raster(instrument="landsat 5")) == TM, "an alias"
    assert carried_instrument(raster()) is None
    assert carried_instrument(raster(**attributes_of(replace(TM, bits=10)))).bits == 10, "another of the same name"


def test_argument_overrides_the_attribute(lai):
    assert given_instrument("MSI", raster(instrument="TM")).name == "MSI"
    assert given_instrument(None, raster(instrument="OLI")).name == "OLI"
    assert given_instrument(None, lai).name == "TM"


# ------------------------------------------------------------------------------------------ bands


def named(bands=None, wavelengths=None, **attrs):
    count = len(bands or wavelengths)
    found = xr.DataArray(np.zeros((count, 1, 1)), dims=("band", "y", "x"), attrs=attrs)
    found = found.assign_coords(band=bands) if bands else found
    return found.assign_coords(wavelength=("band", wavelengths)) if wavelengths else found


def matched(array, name):
    return [band.name for band in matching_bands(array, instrument(name))]


@pytest.mark.parametrize(
    ("name", "bands", "wavelengths", "said"),
    [
        ("TM", ["TM3", "TM4"], [0.83, 0.66], r"band TM3 has the wavelength 0.83 um, and TM3 of TM is at 0.661 um"),
        ("TM", ["TM4"], [0.66], "band TM4 has the wavelength 0.66 um"),
        # Other instruments in the catalogue have bands with these names and wavelengths.
        ("L4TM", ["TM3", "TM4"], [0.83, 0.66], "band TM3 has the wavelength 0.83 um, and TM3 of L4TM"),
        ("MSI", ["MSI8", "MSI8A"], [0.865, 0.833], "band MSI8A has the wavelength 0.833 um"),
        ("MSS", ["MSS5", "MSS4"], [0.55, 0.65], "band MSS5 has the wavelength 0.55 um"),
        ("OLI", ["OLI4", "OLI8"], [0.592, 0.655], "band OLI4 has the wavelength 0.592 um"),
    ],
)
def test_names_that_contradict_wavelengths_raise(name, bands, wavelengths, said):
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


def test_only_names_of_instrument_bands_are_checked():
    for bands, wavelengths in ((None, WRONG), (["a", "b"], WRONG), (["MSS4", "MSS5"], [0.55, 0.65]), (TM34, None)):
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


# ------------------------------------------------------------------------------------------ PSF and MTF


def test_psf_integrates_to_one():
    spread = fifesim.sensor.psf(PAPER, "TM4")
    step = float(spread["x"][1] - spread["x"][0])
    assert float(spread.sum()) * step**2 == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(spread, spread.T, rtol=1e-12)
    # Squared peak density of the cosine of the paper, which is half at its ends.
    peak = (2 * np.pi / (3 * PAPER.line_spread.width) / np.sqrt(3)) ** 2
    assert float(spread.sel(x=0, y=0)) == pytest.approx(peak, rel=1e-3)
    assert spread["x"].attrs["units"] == "m" and spread.attrs["units"] == "m-2" and spread["band"] == "TM4"


def test_along_and_across_responses_are_on_the_right_axes():
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
    np.testing.assert_allclose(transfer.sel(frequency=0), 1.0, rtol=1e-12)
    transfer = fifesim.sensor.mtf("MSI")
    assert transfer["band"].values.tolist() == [band.name for band in instrument("MSI").bands]
    assert float(transfer["nyquist"].sel(band="MSI1", direction="across")) == pytest.approx(0.5 / 60, rel=1e-3)
    assert float(transfer["product_nyquist"].sel(band="MSI11")) == 0.5 / 20
    np.testing.assert_allclose(transfer["at_nyquist"].sel(band="MSI4"), [0.24, 0.31], rtol=0, atol=0.01)
    # A boxcar detector passes sinc(width times frequency).
    modis = fifesim.sensor.mtf(fifesim.instrument("MODIS", response="detector"), ["MODIS1"]).sel(direction="along")
    width = instrument("MODIS").ground_fields(instrument("MODIS").bands[0]).along
    np.testing.assert_allclose(modis["at_product_nyquist"], np.sinc(width * modis["product_nyquist"]), rtol=1e-12)
    assert fifesim.sensor.mtf("SuperDove", "PS6")["at_nyquist"].values == pytest.approx(2 / np.pi, rel=1e-6)


# ------------------------------------------------------------------------------------------ noise


def test_snr_agrees_with_the_specification_and_the_shot_share():
    """MSI4: 223 at 108 W m-2 sr-1 um-1. The variance at zero radiance is not shot noise."""
    (band,) = instrument("MSI").select("MSI4")
    assert float(snr("MSI", "msi4", 108.0)) == pytest.approx(223.0, rel=1e-12)
    full = (108.0 / 223.0) ** 2
    found = noise_equivalent_radiance("MSI", "MSI4", np.array([108.0, 54.0, 0.0])) ** 2
    np.testing.assert_allclose(found, full * (1 - band.noise.shot * np.array([0.0, 0.5, 1.0])), rtol=1e-12)
    np.testing.assert_allclose(snr("MSI", "MSI4", 54.0), 54.0 / np.sqrt(found[1]), rtol=1e-12)


# ------------------------------------------------------------------------------------------ errors


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: given_instrument(None, raster()), "the instrument of mine is unknown: give instrument=, one of AVHRR"),
        (
            lambda: carried_instrument(raster(instrument="MINE")),
            "'MINE', which fifesim does not have: give instrument=",
        ),
        (
            lambda: carried_instrument(raster(instrument="MINE", instrument_description='{"name": "MINE"}')),
            "instrument_description is no instrument",
        ),
        (
            lambda: check_wavelengths(named(TM34, WRONG, instrument="TM")),
            "TM3 has the wavelength 0.83 um, and TM3 of T",
        ),
        (lambda: check_wavelengths(named(TM34, WRONG, instrument="unknown")), "contradict each other"),
        (lambda: fifesim.sensor.psf("TM", spacing=0), "spacing"),
        (lambda: fifesim.sensor.mtf("TM", "TM9"), "TM9"),
        (lambda: fifesim.sensor.snr(SILENT, "TM3", 50.0), "TM has no noise for TM3"),
    ],
)
def test_unknown_instruments_bands_or_noise_raise(call, said):
    with pytest.raises(ValueError, match=said):
        call()
