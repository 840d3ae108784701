"""Effects of readings, sizes and chosen numbers on Table 2."""

from dataclasses import replace

import numpy as np
import paper_effects as effects
import pytest
from paper_effects import READINGS, Case

from fifesim.chain.setup import image_of
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.ground.landscape.distribution import lai_distribution, treatments
from fifesim.scenario.simulation import simulate


def test_every_chosen_number_is_changed_once():
    changed = effects.changes(Case())
    assert len({change.name for change in changed}) == len(changed) == 10
    by_name = {change.name: change for change in changed}
    leaves = {"leaf_reflectance": {"TM3": 0.065, "TM4": 0.45}, "leaf_transmittance": {"TM3": 0.04, "TM4": 0.42}}
    assert by_name["leaf reflectance TM3"].case.plants == leaves
    assert by_name["background TM4"].case.plants == {"background": {"TM3": 0.15, "TM4": 0.2}}
    assert by_name["radiometric bits"].case.instrument.bits == 16
    assert all(change.case.reading == Case().reading for change in changed)


def test_shifted_densities_have_the_stated_moments():
    for change, mean, deviation in (({"shift": 0.1}, 0.1, 1.0), ({"factor": 0.9}, 0.0, 0.9)):
        for name, found in effects.shifted_densities(**change).items():
            own = lai_distribution(name)
            assert found.mean() == pytest.approx(own.mean() + mean, abs=1e-6)
            assert found.std() == pytest.approx(deviation * own.std(), rel=1e-6)
    wider = effects.shifted_densities(bound=0.25)
    assert list(wider) == treatments()
    for name, found in wider.items():
        low, high = found.support()
        assert high == pytest.approx(found.mean() + 3 * found.std(), abs=0.01)
        assert low == pytest.approx(max(found.mean() - 3 * found.std(), 0), abs=0.01), name


def test_row_of_a_reading_has_the_r2_and_slopes_of_the_table(found):
    row = effects.row_of(found.sel(reading="native"))
    scene = found.sel(reading="native", distribution="burned-ungrazed", variable="lai").mean("realisation")
    for arp in (0.05, 0.24):
        assert row[f"r2 burned-ungrazed {arp:g}"] == pytest.approx(float(scene["r2"].sel(arp=arp)))
        assert row[f"slope burned-ungrazed {arp:g}"] == pytest.approx(float(scene["slope"].sel(arp=arp)))
    assert row["paper_slope burned-ungrazed 0.24"] == 4.08
    assert row["paper_growth"] == pytest.approx(np.mean([3.09 / 2.46, 4.08 / 3.44, 3.47 / 2.58]))


def test_readings_are_tabulated_on_flat_ground_and_on_hills(effect_tables):
    table = effect_tables["readings"]
    assert list(table["name"]) == ["native", "aligned", "offset", "blur-48.6", "native", "aligned"]
    assert list(table["dem"]) == ["flat"] * 4 + ["flint-hills"] * 2
    rows = table.set_index(["name", "dem"])
    # Blur narrows NDVI and thus steepens slopes; relief adds scatter to aligned pixels.
    assert rows.loc[("blur-48.6", "flat"), "lai_slope_factor"] > 1.3 * rows.loc[("aligned", "flat"), "lai_slope_factor"]
    relief = rows.loc[("aligned", "flint-hills")]["r2 burned-ungrazed 0.05"]
    assert relief < rows.loc[("aligned", "flat")]["r2 burned-ungrazed 0.05"]


def test_unchanged_case_has_no_effect_and_sizes_are_listed(effect_tables):
    (row,) = effect_tables["sensitivity"].to_dict("records")
    assert all(value == 0 for name, value in row.items() if name not in ("name", "before", "after"))
    assert list(effect_tables["sizes"]["name"]) == ["90 cells, 300 m"]
    assert effect_tables["sizes"]["lai_r2_rms"][0] == effect_tables["readings"]["lai_r2_rms"][0]


def test_fitted_numbers_are_counted():
    """Three means and deviations, four of leaves, two of background, the scene size and the reading."""
    assert effects.fitted_count(Case()) == 3 + 3 + 4 + 2 + 1 + 1
    rows = {row.name: row for row in effects.number_sources(Case())}
    assert rows["elevation"].origin == rows["hour and view"].origin == "assumed"
    assert rows["bounds of LAI"].origin == rows["form of the random field"].origin == "fitted to the text"
    assert rows["mean LAI"].text.startswith("0.74, 1.41, 1.18 (burned-grazed, burned-ungrazed, unburned-ungrazed)")


def test_blur_readings_have_the_widths_measured_in_flight():
    """The transfer function is 0.5 at the frequency whose half period is the effective field of view."""
    for name, metres in (("blur-40.8", 40.8), ("blur-48.6", 48.6)):
        spread = Case(reading=READINGS[name]).instrument.line_spread
        assert float(spread.mtf(1 / (2 * metres))) == pytest.approx(0.5, abs=1e-4)
    assert Case(reading=READINGS["narrow"]).instrument.line_spread.width == pytest.approx(7 / 9 * 30.32, abs=0.005)


@pytest.fixture
def table(found):
    """Table 2 with the published values, in which a sample has a standard deviation of 0.1."""
    table = friedl1995_table.table2(found.sel(reading="native"))
    for name in friedl1995_table.COEFFICIENTS:
        table[name], table[f"{name}_deviation_200"] = table[f"paper_{name}"], 0.1
    return table


@pytest.mark.parametrize(
    ("column", "change", "name"),
    [
        ("r2", 0.13, "R² of LAI, largest difference of nine rows"),
        ("intercept", -0.3, "intercept of LAI"),
        ("slope", 0.5, "slope of LAI"),
    ],
)
def test_number_beyond_its_limit_is_named(table, column, change, name):
    other = table.copy()
    table.loc[table.index[table["variable"] == "lai"][0], column] += change
    rows = effects.limits(table, other)
    missed = [row["name"] for row in rows if not row["met"]]
    assert len(missed) == 1 and missed[0].startswith(name)
    assert all(row["beside"] == 0 for row in rows)
    assert [row["name"] for row in effects.limits(other, table) if not row["met"]] == []


def test_limits_are_expressed_in_standard_deviations_of_a_sample(table):
    told = {row["name"]: row["deviations"] for row in effects.limits(table, table)}
    assert told["R² of LAI, largest difference of nine rows"] == pytest.approx(1.2)
    assert told["R² of LAI, root mean square difference"] == pytest.approx(0.6)
    assert told["intercept of LAI, largest difference"] == pytest.approx(2.5)
    smallest = table[table["variable"] == "lai"]["paper_slope"].min()
    assert told["slope of LAI, largest relative difference"] == pytest.approx(0.15 / (0.1 / smallest))
    long = table["arp"] == 0.24
    table.loc[long, "r2_deviation_200"] = 0.02
    told = {row["name"]: row["deviations"] for row in effects.limits(table, table)}
    assert told["R² of FPAR, largest difference at arp 0.24"] == pytest.approx(4)
    assert told["R² of FPAR, root mean square difference"] == pytest.approx(0.06 / np.sqrt((6 * 0.01 + 3 * 0.0004) / 9))


def test_agreement_is_in_standard_deviations_and_includes_a_common_factor(found):
    """Published numbers with slopes 1.5 times as high, and R2 two standard deviations of a sample off."""
    table = friedl1995_table.table2(found.sel(reading="native"))
    for name in friedl1995_table.COEFFICIENTS:
        table[name] = table[f"paper_{name}"]
        table[f"{name}_deviation_200"], table[f"{name}_deviation"] = 0.1, 0.02
    table["r2"] += 0.2
    found = effects.agreement(table)
    assert found["if_sampled"] == pytest.approx(np.sqrt(4 / 3), rel=1e-9)
    assert found["if_all"] == pytest.approx(np.sqrt(100 / 3), rel=1e-9)
    table["slope"] *= 1.5
    found = effects.agreement(table)
    assert found["lai_slope_factor"] == pytest.approx(1.5) and found["lai_slope_rest"] == pytest.approx(0, abs=1e-12)
    assert found["lai_slope_rms"] == pytest.approx(0.5) and found["fpar_slope_largest"] == pytest.approx(0.5)


SCENE = ("burned-ungrazed", 0.24, 3)


def test_offset_pixels_see_the_ground_to_the_south_east():
    """
    The offset is two cells each way, so the image equals the aligned image of the scene without its first two rows and
    columns.
    """
    case, scene = Case(cells=180, reading=READINGS["offset"]), Case(cells=180, reading=READINGS["aligned"])
    reflectance = simulate(case.scenario(*SCENE))["scene"]["surface_reflectance"].compute()
    moved = image_of(case.setup, reflectance)
    aligned = image_of(replace(scene.setup, onto=None), reflectance[:, 2:, 2:])
    # Sums over another window round differently, so that a value may cross the boundary between two counts.
    off = abs(moved[:, :19, :19].values.astype(int) - aligned[:, :19, :19].values)
    assert off.max() <= 1 and (off > 0).mean() < 0.005
