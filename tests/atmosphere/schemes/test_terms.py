"""From wavelengths to bands."""

from itertools import pairwise

import numpy as np
import pytest

from fifesim.atmosphere.coupling import (
    WAVELENGTHS,
    BandTerms,
    Scattering,
    apparent_reflectance,
    on_wavelengths,
    spectral_nodes,
)
from fifesim.atmosphere.engines import band_terms
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.bands import Band, solar_irradiance


@pytest.mark.parametrize("visibility", [8.0, 45.0])
def test_band_factors_stand_for_the_spectral_sum(visibility):
    """One wide band against the mean of 34 slices of it: 5e-4 at a reflectance of 0.5."""
    atmosphere = Atmosphere(visibility=visibility)
    edges = np.linspace(0.75, 0.92, 35)
    slices = [Band("slice", (low, high), (1, 1)) for low, high in pairwise(edges)]
    whole = Band("whole", (edges[0], edges[-1]), (1, 1))
    weight = np.array([solar_irradiance(part) for part in slices])
    parts = apparent_reflectance(0.5, **band_terms(atmosphere, slices, 40.0, 20.0, 60.0).uniform)
    once = apparent_reflectance(0.5, **band_terms(atmosphere, [whole], 40.0, 20.0, 60.0).uniform)
    assert once[0] == pytest.approx(np.average(parts, weights=weight), abs=5e-4)


def test_thermal_band_is_refused():
    with pytest.raises(ValueError, match=r"band TM6 spans 10.4 to 12.5 um, the gas tables only 0.4 to 2.5 um"):
        band_terms(Atmosphere(), [Band("TM6", (10.4, 12.5), (1, 1))], 30.0, 0.0, 0.0)


def test_powers_of_the_wavelength_are_interpolated_as_they_are():
    """Depths and reflectances that fall off with a power of the wavelength, and the transmittance of such a depth."""
    between = np.sqrt(WAVELENGTHS[1:] * WAVELENGTHS[:-1])

    def spectra(wavelength):
        depth = 0.1 * wavelength**-3.5
        return Scattering(*(np.exp(-depth) if "transmittance" in name else depth for name in Scattering._fields))

    found = on_wavelengths(spectra(WAVELENGTHS), WAVELENGTHS, between)
    np.testing.assert_allclose(found, spectra(between), rtol=1e-12)


@pytest.mark.parametrize("low, high", [(0.6, 0.65), (0.4, 0.41), (2.1, 2.5), (0.55, 0.59)])
def test_a_stretch_of_the_spectrum_has_two_nodes_on_either_side(low, high):
    nodes = spectral_nodes(low, high)
    inside = np.flatnonzero((nodes > low) & (nodes < high))
    assert np.isin(nodes, WAVELENGTHS).all()
    assert (nodes <= low).sum() >= min(2, (low >= WAVELENGTHS).sum())
    assert (nodes >= high).sum() >= min(2, (high <= WAVELENGTHS).sum())
    assert np.array_equal(nodes[inside], WAVELENGTHS[(low < WAVELENGTHS) & (high > WAVELENGTHS)])


def test_terms_over_uniform_ground_are_in_the_order_of_the_equation():
    terms = BandTerms(*np.arange(len(BandTerms._fields)))
    names = apparent_reflectance.__code__.co_varnames[1:6]
    assert tuple(terms.uniform) == names
    assert all(value is getattr(terms, name) for name, value in terms.uniform.items())


def test_skylight_is_what_is_not_sunbeam():
    terms = band_terms(Atmosphere(visibility=8.0), [Band("red", (0.63, 0.69), (1, 1))], 50.0, 0.0, 0.0)
    assert terms.transmittance_down * (1 - terms.diffuse_fraction) == pytest.approx(terms.direct_transmittance_down)
    depth = -np.log(terms.direct_transmittance_down) * np.cos(np.radians(50.0))
    # A mean of exponentials over the band is not the exponential of the mean.
    assert depth == pytest.approx(terms.optical_depth, rel=2e-3)
