"""Bands of rasters and of instruments: names, wavelengths, and contradictions between them."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.instrument_labels import attributes_of, check_wavelengths, matching_bands

TM = instrument("TM")


@pytest.mark.parametrize(
    ("name", "bands", "wavelengths", "said"),
    [
        ("TM", ["TM3", "TM4"], [0.83, 0.66], r"band TM3 has the wavelength 0.83 um, and TM3 of TM is at 0.661 um"),
        ("TM", ["TM4"], [0.66], "band TM4 has the wavelength 0.66 um"),
        # The catalogue has other instruments with bands of these names, at the same wavelengths.
        ("L4TM", ["TM3", "TM4"], [0.83, 0.66], "band TM3 has the wavelength 0.83 um, and TM3 of L4TM"),
        ("MSI", ["MSI8", "MSI8A"], [0.865, 0.833], "band MSI8A has the wavelength 0.833 um"),
        ("MSS", ["MSS5", "MSS4"], [0.55, 0.65], "band MSS5 has the wavelength 0.55 um"),
        ("OLI", ["OLI4", "OLI8"], [0.592, 0.655], "band OLI4 has the wavelength 0.592 um"),
    ],
)
def test_names_that_contradict_wavelengths_are_refused(name, bands, wavelengths, said):
    values = xr.DataArray(np.zeros((len(bands), 1, 1)), dims=("band", "y", "x"))
    array = values.assign_coords(band=bands, wavelength=("band", wavelengths))
    with pytest.raises(ValueError, match=f"{said}.*contradict each other.*drop_vars"):
        matching_bands(array, instrument(name))
    assert [band.name for band in matching_bands(array.drop_vars("wavelength"), instrument(name))] == bands


def test_the_wavelengths_of_every_sentinel_hold_for_the_others():
    """Centres differ by up to 17 nm from satellite to satellite."""
    for one in ("MSI", "MSI-B", "MSI-C"):
        own = instrument(one).bands
        values = xr.DataArray(np.zeros((len(own), 1, 1)), dims=("band", "y", "x"))
        array = values.assign_coords(
            band=[band.name for band in own], wavelength=("band", [band.wavelength for band in own])
        )
        for other in ("MSI", "MSI-B", "MSI-C"):
            names = [band.name for band in matching_bands(array, instrument(other))]
            assert names == [band.name for band in own]


def test_ones_own_instrument_may_have_the_names_of_another():
    """Bands TM3 and TM4 that the raster's own instrument has elsewhere are matched by wavelength."""
    own = replace(TM, name="mine", bands=tuple(replace(TM.bands[k], name=n) for k, n in ((3, "TM3"), (2, "TM4"))))
    array = xr.DataArray(np.zeros((2, 1, 1)), dims=("band", "y", "x"), attrs=attributes_of(own))
    array = array.assign_coords(band=["TM3", "TM4"], wavelength=("band", [0.84, 0.66]))
    assert [band.name for band in matching_bands(array, TM)] == ["TM4", "TM3"]


def test_names_that_two_instruments_share_hold_where_the_wavelength_is_the_bands():
    """MSS4 is green on Landsat-1, near infrared on Landsat-5; MSI4 is red on each Sentinel-2."""
    values = xr.DataArray(np.zeros((2, 1, 1)), dims=("band", "y", "x"))
    first = values.assign_coords(band=["MSS4", "MSS5"], wavelength=("band", [0.55, 0.65]))
    assert [band.name for band in matching_bands(first, instrument("MSS"))] == ["MSS4", "MSS5"]
    assert [band.name for band in matching_bands(first, instrument("MSS5"))] == ["MSS1", "MSS2"]
    fourth = values.isel(band=[0]).assign_coords(band=["MSS4"])
    for wavelength, names in ((0.553, ("MSS4", "MSS1")), (0.93, ("MSS7", "MSS4"))):
        seen = fourth.assign_coords(wavelength=("band", [wavelength]))
        assert tuple(matching_bands(seen, instrument(name))[0].name for name in ("MSS", "MSS5")) == names
    unknown = first.assign_coords(wavelength=("band", [np.nan, np.nan]))
    assert [band.name for band in matching_bands(unknown, instrument("MSS"))] == ["MSS4", "MSS5"]
    nominal = values.assign_coords(band=["MSI4", "MSI8"], wavelength=("band", [0.665, 0.842]))
    assert [band.name for band in matching_bands(nominal, instrument("MSI-B"))] == ["MSI4", "MSI8"]


def test_only_names_of_an_instrument_are_checked():
    values = xr.DataArray(np.zeros((2, 1, 1)), dims=("band", "y", "x"), coords={"wavelength": ("band", [0.83, 0.66])})
    check_wavelengths(values)
    check_wavelengths(values.assign_coords(band=["a", "b"]))
    check_wavelengths(values.assign_coords(band=["MSS4", "MSS5"]).assign_coords(wavelength=("band", [0.55, 0.65])))
    named = values.assign_coords(band=["TM3", "TM4"])
    check_wavelengths(named.drop_vars("wavelength"))
    with pytest.raises(ValueError, match=r"band TM3 has the wavelength 0.83 um, and TM3 of TM is at"):
        check_wavelengths(named.assign_attrs(instrument="TM"))
    with pytest.raises(ValueError, match="contradict each other"):
        check_wavelengths(named.assign_attrs(instrument="unknown"))


@pytest.mark.parametrize(
    ("name", "expected"),
    [("ETM+", {"TM2": "ETM2", "TM3": "ETM3", "TM4": "ETM4"}), ("OLI", {"TM2": "OLI3", "TM3": "OLI4"})],
)
def test_a_wavelength_finds_the_narrow_band_beside_a_panchromatic_one(name, expected):
    """The panchromatic bands, 0.52 to 0.90 and 0.50 to 0.68 um, respond there too, and at some of them more."""
    wavelengths = [band.wavelength for band in TM.select(list(expected))]
    array = xr.DataArray(np.zeros(len(expected)), dims="band", coords={"wavelength": ("band", wavelengths)})
    assert [band.name for band in matching_bands(array, instrument(name))] == list(expected.values())
