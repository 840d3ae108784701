"""What a page says of a scenario."""

import re

import numpy as np
import pytest

import fifesim
from fifesim.analysis.regression_labels import regress
from fifesim.output.report import (
    cautions,
    engine_rows,
    finding,
    fixed,
    headline,
    inputs_in_words,
    main_results,
    pairing,
    title,
)
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


def test_results_are_those_of_the_line(run):
    """Residuals by numpy, paired by row and column as the regression is."""
    _, image, truth = run
    fit = regress(truth["lai"], image["ndvi"], pair="index")
    (value, name, text), (span, *_) = main_results(truth, image, truth, {"lai": fit})
    share = fit.residual_deviation / float(truth["lai"].mean())
    assert (value, name) == (f"± {fit.residual_deviation:.3f}", "LAI")
    assert f", {100 * share:.0f} % of the mean; R² = {fit.r2:.3f}" in text
    rows, columns = (min(image.sizes[axis], truth.sizes[axis]) for axis in ("y", "x"))
    ndvi, true = (each.values[:rows, :columns] for each in (image["ndvi"], truth["lai"]))
    low, high = np.nanpercentile(fit.intercept + fit.slope * ndvi - true, [5, 95])
    assert span == f"{fixed(low, 2, True)} to {fixed(high, 2, True)}"
    assert main_results(truth, image, truth, {}) == []


def test_finding_without_a_line_says_why():
    assert finding({}, {"lai": "NDVI does not vary", "fpar": "NDVI does not vary"}) == (
        "No line was fitted: NDVI does not vary"
    )
    assert "no NDVI" in finding({}, {})


def test_headline_names_instrument_place_and_time():
    far = {"crs": "EPSG:32735", "west": 600000.0, "north": 7200000.0, "width": 600.0, "height": 600.0}
    case = {
        "grid": far,
        "geometry": {"time": "2022-06-01T10:05Z"},
        "atmosphere": {"altitude": 1.0},
        "terrain": {"dem": "flat"},
        "sensor": {"instrument": "OLI"},
    }
    text = headline(parse_scenario(case).complete())
    assert re.fullmatch(
        r"Simulated .*Operational Land Imager.* image, 25\.\d\d° S, 2[78]\.\d\d° E, 1 June 2022 10:05 UTC \(.*\)", text
    )


def test_cautions_name_what_is_left_out(run):
    scenario, image, _ = run
    said = " ".join(cautions(scenario))
    assert ("perfectly registered" in said) is not any(scenario.sensor.offset)
    assert "No detector noise" in said
    assert "visibility 45 km" in inputs_in_words(scenario, image) and "nadir view" in inputs_in_words(scenario, image)
