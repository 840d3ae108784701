"""The library of spectra holds land, and is the same everywhere."""

import numpy as np

from fifesim.base import files
from fifesim.ground.canopy.library import LEAVES, SPECTRA, library_spectra


def at(wavelength):
    """Spectra of the library at a wavelength, shape (leaf, spectrum)."""
    known, spectra = library_spectra()
    return spectra[..., np.argmin(abs(known - wavelength))]


def test_spectra_are_those_of_land():
    wavelength, spectra = library_spectra()
    assert spectra.shape == (LEAVES, SPECTRA, wavelength.size) == (600, 8, 411)
    assert (wavelength[0], round(wavelength[-1], 9)) == (0.4, 2.45)
    assert spectra.min() > 0.004 and spectra.max() < 0.9
    ndvi = (at(0.84) - at(0.66)) / (at(0.84) + at(0.66))
    # From bare soil to closed canopies.
    assert ndvi.min() < 0.1 and ndvi.max() > 0.9 and 0.25 < np.mean(ndvi < 0.5) < 0.35


def test_leaves_are_green_red_dry_and_dead():
    """Features of the contents in the closed canopies: the green peak, the water bands and the red edge."""
    closed = at(0.84) > 0.3
    green_peak, water = (at(0.55) / at(0.66))[closed], (at(1.65) / at(1.25))[closed]
    assert np.quantile(green_peak, 0.05) < 0.9 < 1.3 < np.quantile(green_peak, 0.95)
    assert np.quantile(water, 0.05) < 0.6 < 0.9 < np.quantile(water, 0.95)


def test_first_spectrum_of_a_leaf_is_bare_ground():
    """Measured spectra times a brightness, which keeps the ratio of wavelengths."""
    table = files.table("library_ground.csv").set_index("wavelength")
    measured = (table.loc[1.65] / table.loc[0.66]).to_numpy()
    found = (at(1.65) / at(0.66))[:, 0]
    apart = np.abs(found[:, None] / measured - 1).min(axis=1)
    np.testing.assert_allclose(apart, 0, atol=1e-9)
    assert len(np.unique(found.round(6))) == table.shape[1]


def test_library_cannot_be_changed():
    _, spectra = library_spectra()
    assert not spectra.flags.writeable
