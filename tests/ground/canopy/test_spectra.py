"""Tests of mixtures of spectra, means over bands, and the defaults of bands without a calibrated value."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import quad

import fifesim
from fifesim.base import files
from fifesim.base.bands import Band, solar_spectrum
from fifesim.ground.canopy import optics, spectra
from fifesim.ground.canopy.prospect import leaf_spectrum
from fifesim.ground.canopy.spectra import LEAVES, SPECTRA, library_spectra

TM = [band.response for band in fifesim.instrument("TM").bands]
NAMES = [band.name for band in TM]


def written(tmp_path, text):
    path = tmp_path / "mine.csv"
    path.write_text(text, encoding="utf-8")
    return str(path)


def scene(lai, **canopy):
    return fifesim.surface_reflectance(lai, "TM", bands=["TM3", "TM4"], canopy=fifesim.Canopy(**canopy))


def test_band_mean_is_weighted_by_response_and_sun():
    """Compare with quadrature between nodes, where response, sun and spectrum are straight lines."""
    band = Band("red", (0.61, 0.645, 0.69), (0.1, 1.0, 0.0))
    wavelength, values = np.array([0.5, 0.62, 0.66, 0.8]), np.array([0.1, 0.3, 0.2, 0.6])
    sun_wavelength, sun = solar_spectrum()
    # Error of the trapezoidal rule: a sixth of the product of the relative changes between nodes 1 nm apart, 10 % for
    # the sun at a Fraunhofer line and 1 % for the spectrum.
    nodes = np.union1d(np.union1d(sun_wavelength, wavelength), band.wavelength)
    nodes = nodes[(nodes >= 0.61) & (nodes <= 0.69)]

    def weight(x):
        return np.interp(x, band.wavelength, band.response) * np.interp(x, sun_wavelength, sun)

    def total(function):
        return sum(quad(function, low, high)[0] for low, high in pairwise(nodes))

    expected = total(lambda x: weight(x) * np.interp(x, wavelength, values)) / total(weight)
    assert spectra.band_means([band], wavelength, values)[0] == pytest.approx(expected, rel=0.1 * 0.01 / 6)


def test_default_spectra_agree_with_the_calibrated_bands():
    """TM bands were modelled with this leaf and soil, within 0.001 and 0.0006 (data/README.md)."""
    wavelength, *leaf = leaf_spectrum(fifesim.Leaf())
    means = spectra.band_means(TM, wavelength, leaf)
    np.testing.assert_allclose(means, optics.band_leaf_optics(NAMES), rtol=0, atol=1e-3)
    soil = optics.band_background(TM, {"soil_dry": 0.475, "shade": 0.525})
    np.testing.assert_allclose(soil, optics.band_background(NAMES), rtol=0, atol=6e-4)
    np.testing.assert_array_equal(optics.band_leaf_optics(TM), optics.band_leaf_optics(NAMES))
    np.testing.assert_array_equal(optics.band_background(TM), optics.band_background(NAMES))
    # Other bands use the spectra.
    red = [fifesim.instrument("OLI").bands[3].response]
    np.testing.assert_array_equal(optics.band_leaf_optics(red), optics.band_leaf_optics(red, fifesim.Leaf()))


def test_mixture_is_linear_in_its_parts():
    parts = {"soil_dry": 0.2, "soil_wet": 0.3, "dead_grass": 0.4, "shade": 0.1}
    pure = {name: optics.band_background(TM, {name: 1.0}) for name in parts}
    expected = sum(share * pure[name] for name, share in parts.items())
    np.testing.assert_allclose(optics.band_background(TM, fifesim.Background(parts)), expected, rtol=1e-14)
    np.testing.assert_array_equal(pure["shade"], 0)


def test_numbers_by_name_are_a_mixture_only_if_they_sum_to_1():
    """Otherwise the names are bands, also if spectra have the same names."""
    given = {"soil_dry": 0.2, "dead_grass": 0.3}
    np.testing.assert_array_equal(optics.band_background(list(given), given), [0.2, 0.3])
    with pytest.raises(ValueError, match="no background for band 'soil_dry'"):
        optics.band_background(["soil_dry", "shade"], {"shade": 0.3})
    dry = dataclasses.replace(TM[2], name="soil_dry")
    mixture = {"soil_dry": 0.5, "dead_grass": 0.5}
    np.testing.assert_array_equal(optics.band_background([dry], mixture), optics.band_background(TM[2:3], mixture))


def test_background_spectrum_from_file_dataset_or_mixture(tmp_path, lai):
    path = written(tmp_path, "# my soil\nwavelength,reflectance\n0.4,0.1\n1.4,0.6\n2.5,0.6\n")
    data = xr.Dataset({"reflectance": ("wavelength", [0.1, 0.6, 0.6])}, {"wavelength": [0.4, 1.4, 2.5]})
    given = path, data, fifesim.Background({path: 1.0})
    by_file, by_data, by_mixture = (scene(lai, background=each) for each in given)
    xr.testing.assert_identical(by_file, by_data)
    xr.testing.assert_identical(by_file, by_mixture)
    red, nir = optics.band_background(TM[2:4], path)
    # The spectrum is a straight line within each band, so its mean is its value at a wavelength inside the band.
    assert 0.1 + 0.5 * (0.63 - 0.4) < red < 0.1 + 0.5 * (0.69 - 0.4)
    assert 0.1 + 0.5 * (0.76 - 0.4) < nir < 0.1 + 0.5 * (0.9 - 0.4)


# The headers of a spectrum of ECOSTRESS, of splib06 of the USGS and of RELAB, shortened.
ECOSTRESS = "Name: soil\n\nX Units: Wavelength (micrometers)\nY Units: Reflectance (percent)\n\n"
SPLIB06 = "USGS library\nline 17 to end:  3-columns of data:\n     wavelength    reflectance    standard deviation\n"
SPLIB06 += "(      -1.23e34  indicates a deleted number)\nDry soil  W1R1Ba AREF\n"


@pytest.mark.parametrize(
    "text",
    [
        ECOSTRESS + "2.5\t60\n1.4\t60\n0.4\t10\n",
        SPLIB06 + "  0.3  -1.23e34  -1.23e34\n  0.4  0.1  0.0\n  1.4  0.6  0.0\n  2.5  0.6  0.0\n",
        "sample.asc\n3\nWavelength(nm) Reflectance\n400 0.1\n1400 0.6\n2500 0.6\n",
        "wavelength_nm;reflectance (%);site\n400;10;1\n1400;60;1\n2500;60;1\n",
        "\ufeffWavelength (um)\tReflectance\n0.4\t0.1\n1.4\t0.6\n2.5\t0.6\n",
        '"wavelength [µm]","transmittance","reflectance"\n0.4,,0.1\n1.4,,0.6\n2.5,,0.6\n',
    ],
)
def test_spectra_are_read_by_their_header(tmp_path, text):
    path = tmp_path / "soil.spectrum.txt"
    path.write_text(text, encoding="utf-8")
    plain = optics.band_background(TM, written(tmp_path, "wavelength,reflectance\n0.4,0.1\n1.4,0.6\n2.5,0.6\n"))
    np.testing.assert_allclose(optics.band_background(TM, path), plain, rtol=1e-12)


def test_narrow_gaps_are_interpolated_and_bands_in_wide_gaps_are_refused(tmp_path):
    wavelength = np.round(np.arange(0.4, 2.5005, 0.001), 3)
    straight = 0.1 + 0.2 * wavelength

    def read(low, high, bands=TM):
        values = np.where((wavelength > low) & (wavelength < high), np.nan, straight)
        lines = [f"{each},{value}" for each, value in zip(wavelength, values, strict=True)]
        return optics.band_background(bands, written(tmp_path, "\n".join(["wavelength,reflectance", *lines])))

    whole = read(3, 3)
    np.testing.assert_allclose(read(0.649, 0.668), whole, rtol=1e-12)
    # Water vapour lies between the bands of TM.
    np.testing.assert_array_equal(read(1.34, 1.45), whole)
    with pytest.raises(ValueError, match=r"band TM3 lies by \d\d\.\d% in a gap .* from 0\.649 to 0\.671 um"):
        read(0.6495, 0.6705)
    np.testing.assert_array_equal(read(0.6495, 0.6705, TM[3:]), whole[3:])


def test_noise_of_a_spectrum_is_removed_with_a_warning(tmp_path):
    path = written(tmp_path, "wavelength,reflectance\n0.4,-0.0004\n0.5,0\n1.4,0.5\n2.5,0.2\n")
    with pytest.warns(UserWarning, match=r"reflectance of a spectrum is -0\.0004 at 0\.4 um, 0\.0008 of its peak"):
        found = optics.band_background(TM, path)
    plain = written(tmp_path, "wavelength,reflectance\n0.4,0\n0.5,0\n1.4,0.5\n2.5,0.2\n")
    np.testing.assert_array_equal(found, optics.band_background(TM, plain))
    with pytest.raises(ValueError, match=r"must be in \[0, 1\], got -0\.006"):
        optics.band_background(TM, written(tmp_path, "wavelength,reflectance\n0.4,-0.006\n1.4,0.5\n2.5,0.2\n"))


def at(wavelength):
    """Spectra of the library at a wavelength, shape (leaf, spectrum)."""
    known, spectra = library_spectra()
    return spectra[..., np.argmin(abs(known - wavelength))]


def test_library_covers_bare_soil_to_closed_canopies():
    wavelength, spectra = library_spectra()
    assert spectra.shape == (LEAVES, SPECTRA, wavelength.size) == (600, 8, 411)
    assert (wavelength[0], round(wavelength[-1], 9)) == (0.4, 2.45)
    assert spectra.min() > 0.004 and spectra.max() < 0.9 and not spectra.flags.writeable
    ndvi = (at(0.84) - at(0.66)) / (at(0.84) + at(0.66))
    assert ndvi.min() < 0.1 and ndvi.max() > 0.9 and 0.25 < np.mean(ndvi < 0.5) < 0.35


def test_first_spectrum_of_each_leaf_in_the_library_is_bare_ground():
    """The ratio of two wavelengths equals the ratio of a measured spectrum; only the brightness differs."""
    table = files.table("library_ground.csv").set_index("wavelength")
    measured = (table.loc[1.65] / table.loc[0.66]).to_numpy()
    found = (at(1.65) / at(0.66))[:, 0]
    apart = np.abs(found[:, None] / measured - 1).min(axis=1)
    np.testing.assert_allclose(apart, 0, atol=1e-9)
    assert len(np.unique(found.round(6))) == table.shape[1]


LEAF = "Wavelength,Reflectance, Transmittance\n0.4,0.05,0.01\n0.7,0.1,0.05\n0.8,0.5,0.4\n2.5,0.2,0.1\n"


def test_leaf_spectra_from_file_or_dataset(tmp_path, lai):
    """Column names may be capitalised; a Dataset in nanometres is converted."""
    path = written(tmp_path, LEAF)
    values = {"reflectance": [0.05, 0.1, 0.5, 0.2], "transmittance": [0.01, 0.05, 0.4, 0.1]}
    data = xr.Dataset({name: ("wavelength", each) for name, each in values.items()})
    micrometres = data.assign_coords(wavelength=[0.4, 0.7, 0.8, 2.5])
    nanometres = data.assign_coords(wavelength=("wavelength", [400, 700, 800, 2500], {"units": "nm"}))
    given = path, tmp_path / "mine.csv", micrometres, nanometres
    for name in ("leaf_optics", "brown_leaf"):
        first, *others = (scene(lai, **{name: each}, brown=0.5) for each in given)
        for other in others:
            xr.testing.assert_allclose(first, other, rtol=1e-12)
    reflectance, transmittance = optics.band_leaf_optics(TM[2:4], path)
    # The spectra are straight lines within the red band, so their means are values inside the band.
    assert 0.05 + 0.05 * (0.63 - 0.4) / 0.3 < reflectance[0] < 0.05 + 0.05 * (0.69 - 0.4) / 0.3
    assert 0.01 + 0.04 * (0.63 - 0.4) / 0.3 < transmittance[0] < 0.01 + 0.04 * (0.69 - 0.4) / 0.3
    numbers = {"TM3": (reflectance[0], transmittance[0]), "TM4": (reflectance[1], transmittance[1])}
    xr.testing.assert_allclose(scene(lai, leaf_optics=path), scene(lai, leaf_optics=numbers), rtol=1e-12)
