"""Tests of optics of leaves and soil: PROSPECT-D, tables over leaf contents, brightness and moisture, and ranges."""

import warnings
from dataclasses import replace

import numpy as np
import prosail
import pytest
from scipy import stats
from scipy.integrate import quad

import fifesim
from fifesim.base import files
from fifesim.base.arrays import distinct_columns
from fifesim.base.bands import Band
from fifesim.ground.canopy import prospect
from fifesim.ground.canopy.leaf_area import check_share, warn_of_large, within
from fifesim.ground.canopy.optics import (
    LEAF_TOLERANCE,
    band_background,
    band_leaf_optics,
    leaf_means,
)
from fifesim.ground.canopy.prospect import CONTENTS, LEAF_RANGES, Leaf
from fifesim.ground.canopy.soil import FILM, below_film, brightened, grains_in_water, moistened, soil_line, water_films


def test_random_leaves_agree_with_prosail():
    """Both sum the same terms in double precision without cancellation, hence 1e-12."""
    rng = np.random.default_rng(0)
    low, high = np.array([(each.lowest, each.highest) for each in LEAF_RANGES.values()]).T
    for values in rng.uniform(low, low + 0.3 * (high - low), (10, len(low))):
        leaf = Leaf(**dict(zip(LEAF_RANGES, values.tolist(), strict=True)))
        wavelength, *ours = prospect.leaf_spectrum(leaf)
        nanometres, *theirs = prosail.run_prospect(
            leaf.structure, leaf.chlorophyll, leaf.carotenoids, leaf.brown, leaf.water, leaf.dry_matter,
            ant=leaf.anthocyanins, prospect_version="D",
        )  # fmt: skip
        np.testing.assert_allclose(wavelength, nanometres / 1000, rtol=1e-14)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12)


@pytest.mark.parametrize("k", [1e-6, 0.01, 0.3, 2.0, 20.0])
def test_layer_transmissivity_is_the_mean_over_isotropic_paths(k):
    """Quadrature over directions: light at the zenith angle theta is attenuated by exp(-k / cos theta)."""
    expected, _ = quad(lambda mu: 2 * mu * np.exp(-k / mu), 0, 1, epsabs=1e-13, epsrel=1e-11, limit=200)
    assert prospect.layer_transmissivity(k) == pytest.approx(expected, rel=1e-8, abs=1e-14)


@pytest.mark.parametrize("structure", [1.0, 3.2, 10.0])
def test_leaf_without_absorption_conserves_energy(structure):
    _, reflectance, transmittance = prospect.leaf_spectrum(Leaf(structure, *[0.0] * 6))
    np.testing.assert_allclose(reflectance + transmittance, 1, rtol=1e-13)


@pytest.mark.parametrize("k", [1e-12, 1e-7, 1e-3])
@pytest.mark.parametrize("layers", [2, 5])
def test_pile_equals_layers_added_one_by_one(k, layers):
    """Also for nearly no absorption, where Stokes' solution becomes 0 / 0."""
    entering = float(prospect.interface_transmissivity(1.4, 90.0))
    surfaces = entering, entering / 1.4**2
    r, t = prospect.plate(*surfaces, prospect.layer_transmissivity(k))
    reflectance, transmittance = r, t
    for _ in range(layers - 1):
        multiple = 1 - reflectance * r
        reflectance, transmittance = reflectance + transmittance**2 * r / multiple, transmittance * t / multiple
    np.testing.assert_allclose(prospect.pile(r, t, layers), (reflectance, transmittance), rtol=1e-9)


def test_pile_of_infinitely_many_or_opaque_layers_transmits_nothing():
    """Another layer does not change an infinite pile, R = r + t^2 R / (1 - r R); an opaque pile is its first layer."""
    r, t = 0.3, 0.6
    reflectance, transmittance = prospect.pile(r, t, 1000.0)
    assert transmittance == pytest.approx(0, abs=1e-100)
    assert reflectance == pytest.approx(r + t**2 * reflectance / (1 - r * reflectance), rel=1e-13)
    np.testing.assert_allclose(prospect.pile(0.1, 0.0, 2.5), (0.1, 0.0), rtol=1e-14)


def test_defaults_are_calibrated_to_table_2_of_the_paper():
    """Changing a result does not change the defaults."""
    reflectance, transmittance = band_leaf_optics(["TM4", "TM3"])
    np.testing.assert_array_equal(reflectance, [0.45, 0.07])
    np.testing.assert_array_equal(transmittance, [0.42, 0.04])
    np.testing.assert_array_equal(band_background(["TM3", "TM4"]), [0.15, 0.19])
    reflectance[:] = 0
    assert band_leaf_optics(["TM3"])[0] == 0.07


def test_given_optics_are_matched_by_band_name_or_order():
    given = {"B3": (0.1, 0.05), "B4": (0.5, 0.4)}
    np.testing.assert_array_equal(band_leaf_optics(["B4"], given), [[0.5], [0.4]])
    np.testing.assert_array_equal(band_leaf_optics(["a", "b"], ([0.1, 0.5], [0.05, 0.4])), [[0.1, 0.5], [0.05, 0.4]])
    np.testing.assert_array_equal(band_background(["B4"], {"B4": 0.2}), [0.2])
    np.testing.assert_array_equal(band_background(["a", "b"], 0.2), [0.2, 0.2])


def test_mean_leaf_area_above_dense_forest_causes_a_warning():
    with pytest.warns(UserWarning, match=r"mean leaf area index is 9, dense forests have about 8.*lai \* 0\.1"):
        warn_of_large(np.array([[4, 12, np.nan], [9, 17, 3]]))
    with warnings.catch_warnings(action="error"):
        warn_of_large(np.array([7.9, 8.1, np.nan]))
        warn_of_large(np.full(3, np.nan))


def test_within_finds_values_outside_a_range_in_any_memory_layout():
    assert within(np.array([0.0, 1.0, np.nan]), 0, 1) and within(0.5, 0, 1) and within(np.empty(0), 0, 1)
    for wrong in (-0.01, 1.01, np.inf):
        for cells in (np.array([[0.5, wrong]] * 4).T, np.array([[0.5, wrong]] * 4)[::2, ::-1]):
            assert not within(cells, 0, 1)
    with pytest.raises(ValueError, match=r"brown must be in \[0, 1\], got 1\.005"):
        check_share("brown", np.array([0.4, np.nan, 1.005]))


BANDS = tuple(band.response for band in fifesim.instrument("TM").select(["TM3", "TM4"]))


def one_by_one(name, values):
    """Leaf optics for each value of one content, by PROSPECT without a table."""
    return np.stack([band_leaf_optics(BANDS, replace(Leaf(), **{name: float(each)})) for each in values], axis=-1)


@pytest.mark.parametrize("name", list(LEAF_RANGES))
def test_table_over_a_content_is_within_its_tolerance(name):
    """Over the whole range with its ends, and small contents, where optics change fastest."""
    low, high = LEAF_RANGES[name].lowest, LEAF_RANGES[name].highest
    share = np.concatenate([[0, 1], np.random.default_rng(5).uniform(0, 1, 20) ** 4])
    values = np.minimum(low + share * (high - low), high)
    found = leaf_means(BANDS, Leaf(**{name: values}))
    np.testing.assert_allclose(found, one_by_one(name, values), rtol=0, atol=LEAF_TOLERANCE)


def test_exact_leaves_equal_prospect_and_nan_stays_in_its_cell():
    values = np.array([[5.0, 20.0, 20.0], [80.0, 5.0, 0.0]])
    expected = one_by_one("chlorophyll", values.ravel()).reshape(2, 2, 2, 3)
    np.testing.assert_allclose(leaf_means(BANDS, Leaf(chlorophyll=values), exact=True), expected, rtol=1e-12)
    for brown in (0.0, np.array([0.1, 0.2])):
        found = leaf_means(BANDS, Leaf(water=np.array([0.01, np.nan]), brown=brown))
        assert np.isfinite(found[..., 0]).all() and np.isnan(found[..., 1]).all()


def test_nearly_transparent_leaves_conserve_energy():
    """The error of the table is larger than rounding, and SAIL refuses leaves that scatter more than 1."""
    coastal = fifesim.instrument("MSI").select(["MSI1"])[0].response
    clear = dict.fromkeys(CONTENTS, 0.0) | {"brown": np.geomspace(1e-15, 0.1, 3000)}
    assert leaf_means((coastal,), Leaf(structure=1.0, **clear)).sum(axis=0).max() <= 1 + 1e-15


def test_distinct_columns_finds_equal_columns():
    rows = np.array([[1.0, 2.0, 1.0, np.nan, 2.0, np.nan], [5.0, 5.0, 5.0, 1.0, 6.0, 1.0]])
    first, kind = distinct_columns(rows)
    assert first.tolist() == [0, 1, 3, 4] and kind.tolist() == [0, 1, 0, 2, 3, 2]
    assert [each.tolist() for each in distinct_columns(np.empty((2, 0)))] == [[], []]


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
    with pytest.raises(ValueError, match=r"no soil line for band 3.75 um, .* have 0.4 to 2.45 um"):
        soil_line([narrow(3.75)])


def test_brightened_soil_is_clipped_to_0_and_1():
    found = brightened(np.array([0.15, 0.19]), np.array([0.0, 0.1, -0.5, 1.0, np.nan]), np.array([1.2, 1.4]))
    np.testing.assert_array_equal(found[[0, 2, 3]], [[0.15, 0.19], [0, 0], [1, 1]])
    np.testing.assert_allclose(found[1], [0.27, 0.33])
    assert np.isnan(found[4]).all()


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


def test_moist_cells_do_not_depend_on_their_block_and_nan_stays_in_its_cell():
    """More cells than one internal block holds."""
    rng = np.random.default_rng(3)
    dry, moisture = rng.uniform(0, 0.5, (40_000, 6)), rng.uniform(0, 1, 40_000)
    dry[7, 2] = moisture[9] = np.nan
    whole = moistened(dry, moisture, FILMS)
    assert np.argwhere(np.isnan(whole)).tolist() == [[7, 2], *([9, band] for band in range(6))]
    for part in (slice(0, 20_000), slice(17_001, 40_000), slice(39_999, None)):
        np.testing.assert_array_equal(whole[part], moistened(dry[part], moisture[part], FILMS))
