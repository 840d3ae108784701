"""The nine scenarios of the experiment and their inputs."""

import pytest
from mistakes import mistakes

from fifesim.experiments.friedl1995 import case
from fifesim.experiments.friedl1995.case import NATIVE, READINGS, Case, case_of
from fifesim.ground.landscape.distribution import lai_distribution, treatments


def test_scenario_sets_the_ground_explicitly():
    scenario = Case().scenario("burned-ungrazed", 0.15, 7)
    assert {"distribution", "arp", "seed", "method"} <= scenario.ground.model_fields_set
    assert "dem" in scenario.terrain.model_fields_set and scenario.terrain.dem == "flat"
    assert {"instrument", "bands", "interval", "offset"} <= scenario.sensor.model_fields_set
    assert scenario.geobox().shape == (333, 333)


def test_user_inputs_are_in_the_scenario(folders):
    case = case_of(reading="aligned", dem="flint-hills", **folders)
    scenario = case.scenario("burned-ungrazed", 0.05, 1)
    assert scenario.ground.distribution == str(folders["densities"] / "burned-ungrazed.csv")
    assert scenario.ground.leaf_transmittance == {"TM3": 0.05, "TM4": 0.4}
    assert scenario.ground.background == {"TM3": 0.10, "TM4": 0.16}
    assert scenario.terrain.dem == "flint-hills" and scenario.sensor.interval == "product"
    for given in ("soil_dry:0.4+shade: 0.6", "soil_dry : 0.4 + shade:0.6", {"soil_dry": 0.4, "shade": 0.6}):
        shares = case_of(background=given).scenario("burned-grazed", 0.05, 1)
        assert shares.ground.background_spectra == {"soil_dry": 0.4, "shade": 0.6} and not shares.ground.background


@pytest.mark.parametrize(("stage", "options", "said"), mistakes("case", name="experiment_mistakes"), ids=str)
def test_impossible_case_is_refused_before_computing(stage, options, said):
    with pytest.raises(ValueError, match=said):
        case_of(**options)


def test_another_sensor_or_corner_makes_other_scenes():
    """A coarse sensor gets a larger scene; the corner lies a third of 10 km inside the corner of the site."""
    case = case_of(sensor="MODIS")
    assert (case.bands, case.pixel, case.cells) == (("MODIS1", "MODIS2"), 250, 900)
    assert case_of(sensor="OLI").cells == 333 and Case(cells=90).light() is None
    corner, own = {"west": 704970 + 10000 / 3, "north": 4334220 - 10000 / 3}, {"west": 706000.0, "north": 4333000.0}
    for options, expected in (({}, corner), (own, own)):
        box = case_of(**options).grid.boundingbox
        assert (box.left, box.top) == pytest.approx(tuple(expected.values()))


def test_densities_from_a_folder_keep_both_modes(folders):
    found = case.densities_of(folders["densities"])
    assert list(found) == treatments()
    density = lai_distribution(found["burned-grazed"])
    middle, low, high = density.pdf([1.1, 0.7, 1.5])
    assert middle < 0.8 * min(low, high)


def test_missing_density_is_named(folders, tmp_path):
    for name in ("burned-grazed.csv", "unburned-ungrazed.csv"):
        (tmp_path / name).write_text((folders["densities"] / name).read_text())
    refused = {
        r"burned-ungrazed\.csv: there is no such file": tmp_path,
        "must have the treatments burned-grazed, .*, got burned-grazed$": {"burned-grazed": "burned-grazed"},
        "got burned-grazed, .*, grazed$": case.densities_of(None) | {"grazed": "burned-grazed"},
    }
    for message, given in refused.items():
        with pytest.raises(ValueError, match=message):
            case.densities_of(given)


INVALID = mistakes("optics", "background", name="experiment_mistakes")


@pytest.mark.parametrize(("stage", "given", "said"), INVALID, ids=str)
def test_invalid_optics_and_background_are_refused(tmp_path, stage, given, said):
    if stage == "optics":
        (tmp_path / "mine.csv").write_text(given)
        given = tmp_path / "mine.csv"
    with pytest.raises(ValueError, match=said) as told:
        case_of(**{stage: given})
    assert len(str(told.value)) < 500


def test_sensor_without_a_near_infrared_band_is_refused(tmp_path):
    text = "name = 'CAMERA'\naltitude = 500000.0\ngsd = 30.0\nbits = 10\n"
    text += "[[bands]]\nname = 'red'\ncenter = 0.65\nwidth = 0.04\n"
    (tmp_path / "camera.toml").write_text(text)
    with pytest.raises(ValueError, match="no near infrared band"):
        case.sensor_of(str(tmp_path / "camera.toml"))
    assert case.sensor_of("OLI")[1] == ("OLI4", "OLI5")


def test_text_of_a_reading_states_the_numbers_of_the_instrument():
    assert all(each.in_words(43e-6 * 705000, 30.0) == each.text for each in READINGS.values())
    assert "every 21.900 m" in NATIVE.in_words(21.9, 20.0) and "the 20 m blocks" in NATIVE.in_words(21.9, 20.0)
