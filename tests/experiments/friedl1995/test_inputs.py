"""Inputs of a reader's own, and what is said of those that are not right."""

import pytest

from fifesim.experiments.friedl1995 import case
from fifesim.ground.landscape.distribution import lai_distribution, treatments

BANDS = ("TM3", "TM4")


def test_samples_of_a_folder_are_the_densities_with_their_modes(folders):
    found = case.densities_of(folders["densities"])
    assert list(found) == treatments()
    density = lai_distribution(found["burned-grazed"])
    middle, low, high = density.pdf([1.1, 0.7, 1.5])
    assert middle < 0.8 * min(low, high)


def test_own_densities_are_the_default():
    assert case.densities_of(None) == {name: name for name in treatments()}


def test_missing_density_is_named(folders, tmp_path):
    (tmp_path / "burned-grazed.csv").write_text((folders["densities"] / "burned-grazed.csv").read_text())
    (tmp_path / "unburned-ungrazed.csv").write_text((folders["densities"] / "burned-grazed.csv").read_text())
    with pytest.raises(
        ValueError, match=r"lacks a file of burned-ungrazed: Table 2 needs burned-grazed\.csv, burned-un"
    ):
        case.densities_of(tmp_path)
    with pytest.raises(ValueError, match="lacks an entry of burned-ungrazed and unburned-ungrazed"):
        case.densities_of({"burned-grazed": "burned-grazed"})
    with pytest.raises(ValueError, match="unknown treatment 'grazed'"):
        case.densities_of(case.densities_of(None) | {"grazed": "burned-grazed"})
    with pytest.raises(ValueError, match=r"is no folder: it holds burned-grazed\.csv"):
        case.densities_of(tmp_path / "nowhere")


def test_optics_and_background_of_a_file(folders):
    optics = case.optics_by_band(folders["optics"], BANDS, case.OPTICS, "optics")
    assert optics == {"TM3": (0.09, 0.05), "TM4": (0.42, 0.4)}
    assert case.background_of(folders["background"], BANDS) == {"TM3": 0.10, "TM4": 0.16}
    assert case.background_of("soil_dry:0.4 + shade:0.6", BANDS) == {"soil_dry": 0.4, "shade": 0.6}
    assert case.optics_by_band(None, BANDS, case.OPTICS, "optics") is None
    assert case.background_of(None, BANDS) is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("band,leaf_reflectance,leaf_transmittance\nTM3,0.1,0.1\n", "no line for band TM4: it has TM3"),
        ("band,reflectance\nTM3,0.1\n", "lacks the column leaf_reflectance and leaf_transmittance"),
        ("band,leaf_reflectance,leaf_transmittance\nTM3,x,0.1\nTM4,0.4,0.4\n", "band 'TM3' has no number"),
        ("band,leaf_reflectance,leaf_transmittance\nTM3,0.7,0.4\nTM4,0.4,0.4\n", "add up to more than 1"),
        ("", "optics file mine.csv"),
    ],
)
def test_optics_that_are_not_right_are_one_line(tmp_path, text, said):
    (tmp_path / "mine.csv").write_text(text)
    with pytest.raises(ValueError, match=said) as told:
        case.optics_by_band(tmp_path / "mine.csv", BANDS, case.OPTICS, "optics")
    assert "\n" not in str(told.value) and len(str(told.value)) < 500


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("nofile.csv", "there is no background file nofile.csv"),
        ("soil:0.5+shade:0.5", "no spectrum 'soil'"),
        ("soil_dry:half", "type shares such as"),
        ({"TM3": 0.1}, "no line for band TM4"),
        ({"TM3": 0.1, "TM4": 1.5}, "must be in"),
    ],
)
def test_background_that_is_not_right_is_named(given, said):
    with pytest.raises(ValueError, match=said):
        case.background_of(given, BANDS)


def test_sensor_without_a_near_infrared_band_is_refused(tmp_path):
    text = "name = 'CAMERA'\naltitude = 500000.0\ngsd = 30.0\nbits = 10\n"
    text += "[[bands]]\nname = 'red'\ncenter = 0.65\nwidth = 0.04\n"
    (tmp_path / "camera.toml").write_text(text)
    with pytest.raises(ValueError, match="no near infrared band"):
        case.sensor_of(str(tmp_path / "camera.toml"))
    assert case.sensor_of("OLI")[1] == ("OLI4", "OLI5")
