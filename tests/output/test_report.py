"""What a page says of a scenario."""

import pytest
import xarray as xr

import fifesim
from fifesim.analysis.regression_labels import regress
from fifesim.output.report import engine_rows, finding, pairing, title
from fifesim.scenario.scenario import parse_scenario


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"ground": {"arp": 0.15}}, "arp 0.15, seen by TM"),
        ({"sensor": {"instrument": "OLI", "bands": ["OLI4", "OLI5"]}}, "seen by OLI"),
    ],
)
def test_title_names_ground_and_instrument_and_what_is_synthetic(values, said):
    assert title(parse_scenario(values)).endswith(f"{said} (synthetic landscape, hypothetical overpass)")


def test_title_has_the_names_of_files_and_not_their_folders():
    scenario = parse_scenario({"terrain": {"dem": "flat"}, "geometry": {"sza": 30.0, "saa": 120.0}})
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
    other = parse_scenario({"atmosphere": {"engine": "successive-orders"}})
    assert engine_rows(other) == []


GROUND = {"grid": {"width": 600, "height": 300}, "terrain": {"dem": "flat"}}


@pytest.fixture(scope="module", params=[{}, {"interval": "native"}, {"offset": [0.5, 0.0]}], ids=["", "native", "off"])
def run(request):
    scenario = parse_scenario(GROUND | {"sensor": request.param}).complete()
    tree = fifesim.simulate(scenario)
    return scenario, tree["image"].to_dataset().compute(), tree["truth"].to_dataset().compute()


def test_pairs_are_told_with_how_far_they_lie_apart(run):
    """Nineteen intervals of 30.315 m, from the middle of the first pixel on, end 6.2 m beyond as many blocks."""
    scenario, image, truth = run
    text = pairing(scenario, image, truth)
    assert "9 x 9 cells of 3.33 m, a square of 30 m" in text
    native = scenario.sensor.interval == "native"
    assert ("have the same centres" in text) is not native
    if native:
        down, across = (float(abs(image[axis][-1] - truth[axis][image.sizes[axis] - 1])) for axis in ("y", "x"))
        assert f"up to {(down**2 + across**2) ** 0.5:.1f} m apart" in text and across > 5
    assert ("0.5 pixels further south and 0 further east" in text) is (scenario.sensor.offset == [0.5, 0.0])


def test_finding_is_that_of_the_line(run):
    _, image, truth = run
    fit = regress(truth["lai"], image["ndvi"], pair="index")
    text = finding(truth, {"lai": fit}, {})
    assert f"explains {100 * fit.r2:.1f} % of the variance of true LAI." in text
    share = fit.residual_deviation / float(truth["lai"].mean())
    assert f"{fit.residual_deviation:.3f}, {100 * share:.0f} % of the mean" in text


def test_finding_without_a_line_says_why():
    assert finding(xr.Dataset(), {}, {"lai": "NDVI does not vary", "fpar": "NDVI does not vary"}) == (
        "No line was fitted: NDVI does not vary"
    )
    assert "no NDVI" in finding(xr.Dataset(), {}, {})
