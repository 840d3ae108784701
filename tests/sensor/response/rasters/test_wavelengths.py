"""The spectral axis is found, and its unit never guessed."""

import numpy as np
import pytest
import xarray as xr

from fifesim.sensor.band_labels import spectral_axis


def spectra(wavelength, units=None, dim="band", **coords):
    attrs = {} if units is None else {"units": units}
    found = xr.DataArray(np.zeros((2, len(wavelength))), dims=("sample", dim))
    return found.assign_coords(wavelength=(dim, wavelength, attrs), **coords)


@pytest.mark.parametrize("units", ["nm", "Nanometers", "nanometre"])
def test_nanometres_that_say_so_are_converted(units):
    axis = spectral_axis(spectra([500.0, 600.0], units))
    np.testing.assert_allclose(axis.wavelength, [0.5, 0.6], rtol=1e-15)


@pytest.mark.parametrize("units", [None, "um", "µm", "micrometers"])
def test_micrometres_are_taken_as_they_are(units):
    axis = spectral_axis(spectra([0.5, 0.6], units, dim="wavelength"))
    assert (axis.dim, axis.wavelength.tolist(), axis.fwhm) == ("wavelength", [0.5, 0.6], None)


def test_widths_have_the_unit_of_the_wavelengths_or_their_own():
    cube = spectra([500.0, 600.0], "nm", fwhm=("band", [5.0, 6.0]))
    np.testing.assert_allclose(spectral_axis(cube).fwhm, [0.005, 0.006])
    cube["fwhm"].attrs["units"] = "nm"
    np.testing.assert_allclose(spectral_axis(cube).fwhm, [0.005, 0.006])
    cube = spectra([0.5, 0.6], fwhm=("band", [5.0, 6.0], {"units": "nm"}))
    np.testing.assert_allclose(spectral_axis(cube).fwhm, [0.005, 0.006])


@pytest.mark.parametrize(
    ("cube", "said"),
    [
        (spectra([400.0, 2500.0]), "reaches 2500 without a unit.*'nm'"),
        (spectra([400.0, 2500.0], "um"), "reaches 2500 um"),
        (spectra([0.4, 2.5], "nm"), "reaches only 2.5 nm"),
        (spectra([400.0, 2500.0], "cm-1"), "'cm-1', it must be in 'um' or 'nm'"),
        (spectra([0.5, np.nan]), "positive throughout, got nan"),
        (spectra([0.5, 0.5]), "each once, got 2, of which 1 differ"),
        (spectra([0.5]), "two different wavelengths"),
        (spectra([0.5, 0.6]).drop_vars("wavelength"), "need a coordinate 'wavelength'"),
        (spectra([0.5, 0.6], fwhm=("band", [0.01, -0.01])), "fwhm must be positive"),
    ],
)
def test_what_is_not_known_is_refused(cube, said):
    with pytest.raises(ValueError, match=said):
        spectral_axis(cube)
