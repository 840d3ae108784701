"""A file that names no bands is seen in green, red and near infrared where that is possible."""

import pytest

from fifesim.scenario.scenario import Scenario, read_scenario, with_false_colour


@pytest.mark.parametrize(
    ("text", "bands"),
    [
        ("", ["TM2", "TM3", "TM4"]),
        ("[sensor]\ninstrument = 'MSI'\n", ["MSI3", "MSI4", "MSI8"]),
        ("[sensor]\ninstrument = 'MODIS'\n", ["MODIS1", "MODIS2"]),
        ("[sensor]\ninstrument = 'AVHRR9'\npixel = 1100\n", ["AVHRR1", "AVHRR2"]),
        ("[sensor]\nbands = ['TM4']\n", ["TM4"]),
        ("[ground]\nbackground = { TM3 = 0.1, TM4 = 0.2 }\n", ["TM3", "TM4"]),
        ("[ground]\nbackground = { TM2 = 0.1, TM3 = 0.1, TM4 = 0.2 }\n", ["TM2", "TM3", "TM4"]),
    ],
)
def test_bands_that_a_file_leaves_out(tmp_path, text, bands):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    found = read_scenario(path).sensor.bands
    assert found == bands


def test_the_papers_case_keeps_its_two():
    assert Scenario().sensor.bands == ["TM3", "TM4"]


@pytest.mark.parametrize("sensor", [{"instrument": "TN"}, {"instrument": 3}, {"instrument": "missing.toml"}, "TM"])
def test_what_is_wrong_is_left_to_be_told(sensor):
    values = {"sensor": sensor}
    assert with_false_colour(values) == values


def test_noise_that_green_lacks_is_not_asked_of_it():
    """The noise of SuperDove is not known of any band: two are left, which is told of them."""
    values = {"sensor": {"instrument": "SuperDove", "noise": ["shot"]}}
    assert with_false_colour(values) == values
    noisy = {"sensor": {"instrument": "OLI", "noise": ["shot"]}}
    assert with_false_colour(noisy)["sensor"]["bands"] == ["OLI3", "OLI4", "OLI5"]
