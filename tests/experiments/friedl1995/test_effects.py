"""What each choice does."""

import numpy as np
import pytest

from fifesim.experiments.friedl1995 import effects
from fifesim.experiments.friedl1995.case import READINGS, Case, case_of
from fifesim.ground.landscape.distribution import lai_distribution, treatments


def test_every_chosen_number_is_changed_once():
    changed = effects.changes(Case())
    assert len({change.name for change in changed}) == len(changed) == 10
    by_name = {change.name: change for change in changed}
    assert by_name["leaf reflectance TM3"].case.optics == {"TM3": (0.065, 0.04), "TM4": (0.45, 0.42)}
    assert by_name["background TM4"].case.background == {"TM3": 0.15, "TM4": 0.2}
    assert by_name["radiometric bits"].case.instrument.bits == 16
    assert all(change.case.reading == Case().reading for change in changed)


def test_numbers_of_a_readers_own_are_the_ones_that_change(folders):
    changed = {change.name: change for change in effects.changes(case_of(**folders))}
    assert changed["leaf reflectance TM4"].before == "0.42" and changed["background TM3"].before == "0.1"
    assert not any("LAI" in name for name in changed)


def test_densities_move_as_they_say():
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


def test_row_of_a_reading_has_r2_and_slopes_of_the_table(found):
    row = effects.row_of(found.sel(reading="native"))
    scene = found.sel(reading="native", distribution="burned-ungrazed", variable="lai").mean("realisation")
    for arp in (0.05, 0.24):
        assert row[f"r2 burned-ungrazed {arp:g}"] == pytest.approx(float(scene["r2"].sel(arp=arp)))
        assert row[f"slope burned-ungrazed {arp:g}"] == pytest.approx(float(scene["slope"].sel(arp=arp)))
    assert row["paper_slope burned-ungrazed 0.24"] == 4.08
    assert row["paper_growth"] == pytest.approx(np.mean([3.09 / 2.46, 4.08 / 3.44, 3.47 / 2.58]))


def test_readings_stand_side_by_side_on_both_kinds_of_ground(effect_tables):
    table = effect_tables["readings"]
    assert list(table["name"]) == ["native", "aligned", "offset", "blur-48.6", "native", "aligned"]
    assert list(table["dem"]) == ["flat"] * 4 + ["flint-hills"] * 2
    rows = table.set_index(["name", "dem"])
    # Blur narrows NDVI, so that slopes rise above those of the sharper response; relief scatters what is aligned.
    assert rows.loc[("blur-48.6", "flat"), "lai_slope_factor"] > 1.3 * rows.loc[("aligned", "flat"), "lai_slope_factor"]
    relief = rows.loc[("aligned", "flint-hills")]["r2 burned-ungrazed 0.05"]
    assert relief < rows.loc[("aligned", "flat")]["r2 burned-ungrazed 0.05"]


def test_another_sensor_has_no_line_spread_of_table_1():
    assert effects.readings_for(Case()) == list(READINGS.values())
    assert [each.name for each in effects.readings_for(Case(sensor="OLI"))] == ["native", "aligned", "offset"]


def test_sensitivity_is_the_difference_that_a_change_makes(effect_tables):
    """A change to the same is none."""
    (row,) = effect_tables["sensitivity"].to_dict("records")
    assert all(value == 0 for name, value in row.items() if name not in ("name", "before", "after"))


def test_sizes_are_those_of_a_scene(effect_tables):
    assert list(effect_tables["sizes"]["name"]) == ["90 cells, 300 m"]
    assert effect_tables["sizes"]["lai_r2_rms"][0] == effect_tables["readings"]["lai_r2_rms"][0]
