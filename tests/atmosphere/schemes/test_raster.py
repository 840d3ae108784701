import numpy as np
import pytest

import fifesim
from fifesim.atmosphere.engines import band_terms
from fifesim.base.bands import Band

SUN = fifesim.Geometry(40.0, 120.0, 20.0, 30.0)


def test_spectrum_is_what_narrow_bands_see():
    """A band of one step between the knots of the gas table's curves has the terms of its wavelength."""
    spectrum = fifesim.atmosphere.spectrum(geometry=SUN)
    for centre in (0.45, 0.65, 0.86, 1.65):
        band = Band("narrow", (centre - 0.0025, centre, centre + 0.0025), (0, 1, 0))
        terms = band_terms(fifesim.Atmosphere(), [band], SUN.sza, SUN.vza, SUN.raa)
        at = spectrum.sel(wavelength=centre, method="nearest")
        for name in ("transmittance_down", "transmittance_up", "spherical_albedo", "direct_transmittance_up"):
            assert float(at[name]) == pytest.approx(getattr(terms, name)[0], rel=1e-4)


def test_depths_add_up():
    spectrum = fifesim.atmosphere.spectrum(geometry=SUN)
    depth = spectrum["molecules_optical_depth"] + spectrum["aerosol_optical_depth"]
    # Interpolated between the aerosol's wavelengths in one and not in the other.
    np.testing.assert_allclose(spectrum["direct_transmittance_up"], np.exp(-depth / SUN.mu_v), rtol=2e-3)
    np.testing.assert_allclose(spectrum["gas_transmittance"], spectrum["transmittance_of_gas"].prod("gas"), rtol=1e-12)


def test_everything_has_a_name_and_a_unit():
    spectrum = fifesim.atmosphere.spectrum()
    for variable in spectrum.data_vars.values():
        assert {"long_name", "units"} <= set(variable.attrs)
    assert spectrum["wavelength"].attrs["units"] == "um"
    assert fifesim.Atmosphere.parse(spectrum.attrs["atmosphere"]) == fifesim.Atmosphere()


def test_bands_only_engine_is_named():
    with pytest.raises(ValueError, match="engine must be one of 5S, successive-orders"):
        fifesim.atmosphere.spectrum(fifesim.Atmosphere(engine="6S"))
