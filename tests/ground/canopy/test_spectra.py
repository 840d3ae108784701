"""Mixtures of spectra, means over bands, and the defaults of bands without a calibrated value."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import quad

import fifesim
from fifesim.base.bands import Band, solar_spectrum
from fifesim.ground.canopy import optics, spectra
from fifesim.ground.canopy.prospect import leaf_spectrum

TM = [band.response for band in fifesim.instrument("TM").bands]
NAMES = [band.name for band in TM]


def written(tmp_path, text):
    path = tmp_path / "mine.csv"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_mean_is_the_integral_over_response_and_sun():
    """Quadrature over pieces on which each of the three is a straight line, so that it is exact."""
    band = Band("red", (0.61, 0.645, 0.69), (0.1, 1.0, 0.0))
    wavelength, values = np.array([0.5, 0.62, 0.66, 0.8]), np.array([0.1, 0.3, 0.2, 0.6])
    sun_wavelength, sun = solar_spectrum()
    # The trapezoidal rule misses a sixth of the product of changes between nodes 1 nm apart: the sun's, up to 10 % at a
    # Fraunhofer line, and the spectrum's, 1 %.
    nodes = np.union1d(np.union1d(sun_wavelength, wavelength), band.wavelength)
    nodes = nodes[(nodes >= 0.61) & (nodes <= 0.69)]

    def weight(x):
        return np.interp(x, band.wavelength, band.response) * np.interp(x, sun_wavelength, sun)

    def total(function):
        return sum(quad(function, low, high)[0] for low, high in pairwise(nodes))

    expected = total(lambda x: weight(x) * np.interp(x, wavelength, values)) / total(weight)
    assert spectra.band_means([band], wavelength, values)[0] == pytest.approx(expected, rel=0.1 * 0.01 / 6)


def test_default_spectra_meet_the_calibrated_bands():
    """The one leaf and soil that the table of TM bands was modelled with: within .001 and .0006, README.md of data."""
    wavelength, *leaf = leaf_spectrum(fifesim.Leaf())
    means = spectra.band_means(TM, wavelength, leaf)
    np.testing.assert_allclose(means, optics.band_leaf_optics(NAMES), rtol=0, atol=1e-3)
    soil = optics.band_background(TM, {"soil_dry": 0.475, "shade": 0.525})
    np.testing.assert_allclose(soil, optics.band_background(NAMES), rtol=0, atol=6e-4)


def test_tm_keeps_its_table_and_other_bands_have_spectra():
    red = [fifesim.instrument("OLI").bands[3].response]
    np.testing.assert_array_equal(optics.band_leaf_optics(TM), optics.band_leaf_optics(NAMES))
    np.testing.assert_array_equal(optics.band_background(TM), optics.band_background(NAMES))
    np.testing.assert_array_equal(optics.band_leaf_optics(red), optics.band_leaf_optics(red, fifesim.Leaf()))
    assert 0.05 < optics.band_leaf_optics(red)[0][0] < 0.08


def test_mixture_is_linear_in_its_parts():
    parts = {"soil_dry": 0.2, "soil_wet": 0.3, "dead_grass": 0.4, "shade": 0.1}
    pure = {name: optics.band_background(TM, {name: 1.0}) for name in parts}
    expected = sum(share * pure[name] for name, share in parts.items())
    np.testing.assert_allclose(optics.band_background(TM, fifesim.Background(parts)), expected, rtol=1e-14)
    np.testing.assert_array_equal(pure["shade"], 0)


def test_a_mapping_of_spectra_is_a_mixture_and_one_of_bands_is_not():
    mixture = {"soil_dry": 0.5, "dead_grass": 0.5}
    np.testing.assert_array_equal(
        optics.band_background(TM, mixture), optics.band_background(TM, fifesim.Background(mixture))
    )
    np.testing.assert_array_equal(optics.band_background(TM[2:4], {"TM3": 0.1, "TM4": 0.2}), [0.1, 0.2])


def test_names_of_bands_are_bands_although_spectra_have_them_too():
    """Shares of a mixture add up to 1 and reflectances of bands do not: .2 and .3 are no mixture."""
    given = {"soil_dry": 0.2, "dead_grass": 0.3}
    np.testing.assert_array_equal(optics.band_background(list(given), given), [0.2, 0.3])
    with pytest.raises(ValueError, match="no background for band 'soil_dry'"):
        optics.band_background(["soil_dry", "shade"], {"shade": 0.3})
    dry = dataclasses.replace(TM[2], name="soil_dry")
    mixture = {"soil_dry": 0.5, "dead_grass": 0.5}
    np.testing.assert_array_equal(optics.band_background([dry], mixture), optics.band_background(TM[2:3], mixture))


def test_own_spectrum_is_a_file_or_a_dataset(tmp_path, lai):
    path = written(tmp_path, "# my soil\nwavelength,reflectance\n0.4,0.1\n1.4,0.6\n2.5,0.6\n")
    data = xr.Dataset({"reflectance": ("wavelength", [0.1, 0.6, 0.6])}, {"wavelength": [0.4, 1.4, 2.5]})
    by_file, by_data, by_mixture = (
        fifesim.surface_reflectance(lai, "TM", bands=["TM3", "TM4"], canopy=fifesim.Canopy(background=given))
        for given in (path, data, fifesim.Background({path: 1.0}))
    )
    xr.testing.assert_identical(by_file, by_data)
    xr.testing.assert_identical(by_file, by_mixture)
    red, nir = optics.band_background(TM[2:4], path)
    # The spectrum is a straight line there: its mean is its value at the sun-weighted wavelength, inside the band.
    assert 0.1 + 0.5 * (0.63 - 0.4) < red < 0.1 + 0.5 * (0.69 - 0.4)
    assert 0.1 + 0.5 * (0.76 - 0.4) < nir < 0.1 + 0.5 * (0.9 - 0.4)


def test_a_chosen_leaf_reaches_the_canopy(lai):
    brown, green = (
        fifesim.surface_reflectance(lai, "MODIS", bands=["MODIS1", "MODIS2"], canopy=fifesim.Canopy(leaf_optics=leaf))
        for leaf in (fifesim.Leaf(chlorophyll=0, carotenoids=0, brown=0.5), fifesim.Leaf())
    )
    assert float(brown.sel(band="MODIS1").mean()) > float(green.sel(band="MODIS1").mean())


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"soil_dri": 0.6, "dead_grass": 0.4}, "no spectrum 'soil_dri', did you mean 'soil_dry'. There are soil_dry, "),
        ({"soil_dry": 0.6}, "must add up to 1, got 0.6: the part without reflection is 'shade'"),
        ({"soil_dry": 1.5, "shade": -0.5}, r"fraction of 'soil_dry' must be in \[0, 1\], got 1.5"),
        ({"no_such.csv": 1.0}, "cannot read the spectrum no_such.csv"),
    ],
)
def test_impossible_mixture_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        optics.band_background(TM, fifesim.Background(given))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nm,reflectance\n400,0.1\n2500,0.2\n", "mine.csv has no column wavelength"),
        ("wavelength,reflectance\n400,0.1\n2500,0.2\n", r"mine.csv: wavelengths are in um, got 2500"),
        ("wavelength,reflectance\n0.4,10\n2.5,20\n", "got 10 at 0.4 um: give a fraction"),
        ("wavelength,reflectance\n0.5,0.1\n0.4,0.2\n", "must increase"),
        ("wavelength,reflectance\n0.5,0.1\n1.0,0.2\n", "no leaf or background spectrum for band TM1.*by band"),
    ],
)
def test_unusable_spectrum_is_refused(tmp_path, text, message):
    with pytest.raises(ValueError, match=message):
        optics.band_background(TM, written(tmp_path, text))


def test_spectra_need_responses():
    with pytest.raises(TypeError, match="a Leaf is a spectrum, it needs the bands' responses"):
        optics.band_leaf_optics(["TM3"], fifesim.Leaf())
    with pytest.raises(TypeError, match="Background takes"):
        fifesim.Background(0.2)


def test_dataset_without_reflectance_is_refused(lai):
    with pytest.raises(ValueError, match="background: the Dataset has no reflectance"):
        fifesim.surface_reflectance(
            lai, "TM", canopy=fifesim.Canopy(background=xr.Dataset(coords={"wavelength": [0.4, 2.5]}))
        )
