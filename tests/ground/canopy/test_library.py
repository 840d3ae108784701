"""The library of spectra holds land, and is the same everywhere."""

import numpy as np

from fifesim.base import files
from fifesim.ground.canopy.library import CANOPIES, LEAVES, library_spectra


def test_spectra_are_those_of_land():
    wavelength, spectra = library_spectra()
    assert spectra.shape == (LEAVES * CANOPIES, wavelength.size) == (480, 411)
    assert (wavelength[0], round(wavelength[-1], 9)) == (0.4, 2.45)
    assert spectra.min() > 0.003 and spectra.max() < 0.75
    red, infrared = (spectra[:, np.argmin(abs(wavelength - at))] for at in (0.66, 0.84))
    ndvi = (infrared - red) / (infrared + red)
    # From bare soil to closed canopies.
    assert ndvi.min() < 0.25 and ndvi.max() > 0.85 and 0.2 < np.mean(ndvi < 0.5) < 0.35


def test_library_reaches_from_dark_to_bright_ground():
    wavelength, spectra = library_spectra()
    at = np.argmin(abs(wavelength - 1.65))
    ground = files.table("ground_spectra.csv").set_index("wavelength").loc[1.65]
    assert spectra[:, at].min() < 0.6 * ground.min() and spectra[:, at].max() > 0.8 * ground.max()


def test_library_cannot_be_changed():
    _, spectra = library_spectra()
    assert not spectra.flags.writeable
