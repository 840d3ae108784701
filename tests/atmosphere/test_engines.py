"""Band terms compared with 6S, and terms from successive orders."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pyrsr.rsr import RSR_reader

from fifesim.atmosphere.coupling import BandTerms, apparent_reflectance
from fifesim.atmosphere.engines import _quadrature, band_terms, mixed_scattering, whole_scattering
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.bands import Band

NAMES = ("TM1", "TM2", "TM3", "TM4", "TM5", "TM7")
RESPONSES = RSR_reader("Landsat-5", "TM")
BANDS = tuple(Band(name, *RESPONSES[name[2:]].T) for name in NAMES)
DATA = Path(__file__).parents[1] / "data"
FIFE = pd.read_csv(DATA / "sixs_fife.csv", comment="#")


def test_other_angles_and_visibilities_agree_with_6s():
    """RMS relative difference by band for a surface of 0.3, a solar zenith angle up to 45 degrees and 23 km or more."""
    cases, found = pd.read_csv(DATA / "sixs_grid.csv", comment="#").groupby(["visibility", "sza", "vza", "raa"]), []
    for (visibility, *angles), rows in cases:
        terms = band_terms(Atmosphere(visibility=visibility, altitude=0.0), BANDS, *angles)
        expected = rows.set_index("band")["toa_reflectance"].loc[list(NAMES)]
        found.append(apparent_reflectance(0.3, **terms.uniform) / expected - 1)
    assert len(found) == 24
    assert np.all(100 * np.sqrt(np.mean(np.square(found), axis=0)) <= [2.3, 1.7, 1.2, 1.0, 0.5, 0.5])


def test_factors_of_the_fife_case_agree_with_6s():
    """
    Gas transmittance 1e-3 and transmittances 2e-3, since 6S has other filters.

    Spherical albedo 0.025, since S_R + S_A omits the coupling.
    """
    for row in FIFE[FIFE["surface_reflectance"] == FIFE["surface_reflectance"].iloc[0]].itertuples():
        air, angles = Atmosphere(visibility=row.visibility, altitude=row.altitude), (row.sza, row.vza, row.raa)
        terms = BandTerms(*(values[NAMES.index(row.band)] for values in band_terms(air, BANDS, *angles)))
        assert terms.gas_transmittance == pytest.approx(row.gas_transmittance, abs=1e-3)
        assert terms.transmittance_down == pytest.approx(row.transmittance_down, abs=2e-3)
        assert terms.transmittance_up == pytest.approx(row.transmittance_up, abs=2e-3)
        assert terms.direct_transmittance_down == pytest.approx(row.direct_transmittance_down, abs=1e-3)
        assert terms.optical_depth == pytest.approx(row.rayleigh_optical_depth + row.aerosol_optical_depth, abs=1e-3)
        assert terms.spherical_albedo == pytest.approx(row.spherical_albedo, abs=0.025)
        diffuse = 1 - row.direct_transmittance_down / row.transmittance_down
        assert terms.diffuse_fraction == pytest.approx(diffuse, abs=2e-3)


@pytest.mark.parametrize("engine", ["5S", "successive-orders"])
@pytest.mark.parametrize(
    "angles, name", [((76.0, 0.0), "sza"), ((30.0, 80.0), "vza"), ((np.nan, 0.0), "sza"), ((0.0, -1.0), "vza")]
)
def test_low_sun_or_view_raises(engine, angles, name):
    with pytest.raises(ValueError, match=rf"{name} must be in \[0, 75\] degrees, got"):
        band_terms(Atmosphere(engine=engine), BANDS, *angles, 0.0)


def test_thermal_band_raises():
    with pytest.raises(ValueError, match=r"band TM6 spans 10.4 to 12.5 um, the gas tables only 0.4 to 2.5 um"):
        band_terms(Atmosphere(), [Band("TM6", (10.4, 12.5), (1, 1))], 30.0, 0.0, 0.0)


def test_terms_are_read_only():
    """Terms are shared between calls."""
    with pytest.raises(ValueError, match="read-only"):
        band_terms(Atmosphere(), BANDS, 30.0, 0.0, 0.0).gas_transmittance[0] = 1


# ------------------------------------------------------------------------------------------ successive orders


WAVELENGTH = np.array([0.47, 0.86])
SZA, VZA, RAA = 50.0, np.array([0.0, 35.0]), np.array([60.0])
MU_S, MU_V = np.cos(np.radians(SZA)), np.cos(np.radians(VZA))[:, None, None]
HAZE = Atmosphere(visibility=10.0)


@pytest.fixture(scope="module")
def hazy():
    return mixed_scattering(HAZE, WAVELENGTH, SZA, VZA, RAA)


def test_whole_scattering_equals_mixed_scattering(hazy):
    whole = whole_scattering(HAZE, WAVELENGTH, SZA, VZA, RAA)
    for name, values in whole._asdict().items():
        np.testing.assert_array_equal(values, getattr(hazy, name))


def test_gauss_points_agree_with_numpy():
    points, weights = np.polynomial.legendre.leggauss(500)
    found = _quadrature()
    np.testing.assert_allclose(found[0], points, rtol=0, atol=1e-15)
    # numpy before 2.2 has an error of 3e-15 in the smallest weights, at the ends.
    np.testing.assert_allclose(found[1], weights, rtol=0, atol=1e-14)
    for power in (0, 2, 998):
        assert np.sum(found[1] * found[0] ** power) == pytest.approx(2 / (power + 1), rel=1e-13)


def test_direct_light_is_less_than_transmitted_light(hazy):
    """The molecular terms of haze equal the terms without aerosol."""
    assert np.all(hazy.direct_transmittance_up < hazy.transmittance_up) and np.all(hazy.transmittance_up < 1)
    clear = mixed_scattering(Atmosphere(aerosol="none"), WAVELENGTH, SZA, VZA, RAA)
    np.testing.assert_allclose(
        clear.diffuse_up_molecules, clear.transmittance_up - clear.direct_transmittance_up, rtol=1e-12
    )
    np.testing.assert_allclose(clear.diffuse_up_molecules, hazy.diffuse_up_molecules, rtol=1e-12)
    np.testing.assert_allclose(clear.molecules_reflectance, hazy.molecules_reflectance, rtol=1e-12)
    np.testing.assert_allclose(clear.diffuse_up_aerosol, 0, atol=1e-11)
