"""Tests of the brightness of soil along the soil line, and of its darkening by water."""

import numpy as np
import pytest
from scipy import stats

import fifesim
from fifesim.base import files
from fifesim.base.bands import Band
from fifesim.ground.canopy.soil import FILM, below_film, brightened, grains_in_water, moistened, soil_line, water_films

TM = tuple(band.response for band in fifesim.instrument("TM").select(None))
FILMS = water_films(TM)


def narrow(wavelength):
    return Band(f"{wavelength} um", (wavelength - 0.001, wavelength, wavelength + 0.001), (0, 1, 0))


def test_soil_line_passes_through_wet_and_dry_soil():
    """In every band, one change of brightness leads from the wet to the dry soil."""
    table = files.table("ground_spectra.csv").set_index("wavelength")
    places = [0.45, 0.55, 0.66, 0.86, 1.65, 2.2]
    line = soil_line([narrow(place) for place in places])
    steps = (table["soil_dry"] - table["soil_wet"]).loc[places].to_numpy() / line
    np.testing.assert_allclose(steps, steps[0], rtol=2e-3)
    assert line[1] == pytest.approx(1, rel=2e-3)
    # The soil line rises more in the near infrared than in the red.
    red, near_infrared = soil_line(TM[2:4])
    assert near_infrared / red == pytest.approx(1.2, abs=0.02)


def test_brightened_soil_is_clipped_to_0_and_1():
    found = brightened(np.array([0.15, 0.19]), np.array([0.0, 0.1, -0.5, 1.0, np.nan]), np.array([1.2, 1.4]))
    np.testing.assert_array_equal(found[[0, 2, 3]], [[0.15, 0.19], [0, 0], [1, 1]])
    np.testing.assert_allclose(found[1], [0.27, 0.33])
    assert np.isnan(found[4]).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: brightened(0.2, 4.0, np.ones(1)), r"soil must be in \[-1, 1\], got 4: .* along the soil line"),
        (lambda: soil_line([narrow(3.75)]), "no soil line for band 3.75 um, .* have 0.4 to 2.45 um"),
        (lambda: moistened([0.2] * 6, 30.0, FILMS), r"moisture must be in \[0, 1\], got 30: .* moisture=0.3"),
        (lambda: moistened([0.2] * 6, -0.1, FILMS), r"moisture must be in \[0, 1\], got -0.1: .* moisture=0.3"),
    ],
)
def test_impossible_soils_are_refused_with_a_short_message(call, message):
    with pytest.raises(ValueError, match=message) as caught:
        call()
    assert len(str(caught.value)) <= 500


DRY = np.linspace(0.02, 0.9, 12)


def wet_soil(below, passed, surface, inside):
    """Reflectance of a soil below one water film."""
    up, kept = below_film(below, passed, inside)
    return surface + (1 - surface) * (1 - inside) * up / kept


def test_film_sums_all_reflections():
    """Light followed order by order: absorption by water and soil, then reflection below the water surface."""
    surface, inside, passed = 0.021, 0.47, 0.8
    light, out = 1 - surface, surface
    for _ in range(200):
        light *= passed * DRY
        out = out + light * (1 - inside)
        light *= inside
    np.testing.assert_allclose(wet_soil(DRY, passed, surface, inside), out, rtol=1e-12)


def test_limits_of_moist_soil():
    """Grains in a medium like air, white ground below clear water, and dry soil keep their reflectance."""
    np.testing.assert_allclose(grains_in_water(DRY, 1.0), DRY, rtol=1e-12)
    assert np.all(grains_in_water(DRY, 1.08) < DRY)
    films = water_films((narrow(0.45),))
    assert moistened(np.ones(1), 1.0, films._replace(passed=np.ones((1, 6)))) == pytest.approx(1, abs=1e-12)
    background = np.array([0.15, 0.19, 0.3, 0.31, 0.32, 0.33])
    assert (moistened(background, 0.0, FILMS) == background).all()


def test_numbers_of_films_follow_poisson():
    """Sum over up to twenty films with Poisson probabilities from scipy, at a single wavelength."""
    place = 1.65
    films = water_films((narrow(place),))
    table = files.table("prospect_d.csv")
    absorption = float(np.interp(place, table["wavelength"], table["water"]))
    for moisture in (0.1, 0.5, 1.0):
        counts = np.arange(20)
        passed = np.exp(-2 * absorption * FILM * counts)
        below = grains_in_water(0.3, films.entrance[0])
        each = np.where(counts == 0, 0.3, wet_soil(below, passed, films.surface[0], films.inside[0]))
        expected = np.sum(stats.poisson.pmf(counts, 2 * moisture) * each)
        # More than six films count as six: 0.5 % of the wettest soil.
        assert moistened(np.array([0.3]), moisture, films)[0] == pytest.approx(expected, abs=2e-4)


def test_water_surface_has_fresnel_reflectance():
    """Hemispherical means at n = 1.333: 0.066 from above and 0.475 from below (Lekner and Dorf 1988)."""
    films = water_films((narrow(0.55),))
    assert films.inside[0] == pytest.approx(1 - (1 - 0.066) / 1.333**2, abs=1e-3)
    # Reflectance is ((n - 1) / (n + 1))**2 = 0.0204 at normal incidence and little more up to 40 degrees.
    assert 0.0204 < films.surface[0] < 0.0225


def test_moisture_broadcasts_and_nan_stays_in_its_cell():
    films = water_films(TM[:2])
    cells = np.array([[0.1, 0.2], [np.nan, 0.4], [0.3, 0.5]])
    found = moistened(cells, np.array([0.5, 0.5, np.nan]), films)
    assert np.isnan(found).tolist() == [[False, False], [True, False], [True, True]]
    np.testing.assert_array_equal(found[0], moistened(cells[0], 0.5, films))


def test_moist_cells_do_not_depend_on_their_block():
    """More cells than one internal block holds."""
    rng = np.random.default_rng(3)
    dry, moisture = rng.uniform(0, 0.5, (40_000, 6)), rng.uniform(0, 1, 40_000)
    whole = moistened(dry, moisture, FILMS)
    for part in (slice(0, 20_000), slice(17_001, 40_000), slice(39_999, None)):
        np.testing.assert_array_equal(whole[part], moistened(dry[part], moisture[part], FILMS))
