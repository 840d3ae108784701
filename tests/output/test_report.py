"""What a page says of a scenario."""

import pytest

from fifesim.output.report import engine_rows, title
from fifesim.scenario.scenario import parse_scenario


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"ground": {"arp": 0.15}}, "arp 0.15, seen by TM"),
        ({"sensor": {"instrument": "OLI", "bands": ["OLI4", "OLI5"]}}, "seen by OLI"),
    ],
)
def test_title_names_ground_and_instrument(values, said):
    assert title(parse_scenario(values)).endswith(said)


def test_title_has_the_names_of_files_and_not_their_folders():
    scenario = parse_scenario({})
    ground = scenario.ground.model_copy(update={"lai_file": "/somewhere/leaves.tif"})
    sensor = scenario.sensor.model_copy(update={"instrument": "/elsewhere/camera.toml"})
    scenario = scenario.model_copy(update={"ground": ground, "sensor": sensor})
    assert title(scenario) == "leaves.tif, seen by camera.toml"


def engine_row(sza, **atmosphere):
    rows = engine_rows(parse_scenario({"geometry": {"sza": sza, "saa": 120.0}, "atmosphere": atmosphere}))
    assert len(rows) == 1
    return rows[0][1]


def test_report_says_where_5s_is_beyond_two_percent():
    """Urban haze under a low sun; and in clear air over the near infrared alone."""
    haze = engine_row(70.0, aerosol="urban", visibility=6)
    assert 'beyond 2 % in TM3, TM4: engine = "successive-orders"' in haze and "TM4 +" in haze
    clear = engine_row(25.0, aerosol="none", visibility=None)
    assert clear.endswith("within 2 %")
    other = parse_scenario({"atmosphere": {"engine": "successive-orders-scalar"}})
    assert engine_rows(other) == []
