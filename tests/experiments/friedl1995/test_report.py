"""What the page concludes follows from its figures."""

import pandas as pd
import pytest

from fifesim.experiments.friedl1995 import report


def row(name, r2, slope, growth, *, dem="flat", lowest=0.45):
    """A row of the table of readings."""
    found = {f"r2 {treatment} {arp:g}": 0.6 for treatment in report.treatments() for arp in report.ARPS}
    found["r2 burned-ungrazed 0.05"] = lowest
    found |= {"name": name, "dem": dem, "lai_r2_rms": r2, "lai_slope_rms": slope, "lai_slope_rest": slope / 5}
    return found | {"lai_slope_factor": 1 + slope, "growth": growth, "paper_growth": 1.26, "lai_slope_largest": slope}


@pytest.fixture
def readings():
    return pd.DataFrame(
        [
            row("native", 0.05, 0.07, 1.27),
            row("aligned", 0.36, 0.2, 1.1),
            row("offset", 0.06, 0.1, 1.3),
            row("blur-40.8", 0.15, 0.78, 1.0),
            row("blur-48.6", 0.08, 0.89, 1.05),
            row("native", 0.08, 0.47, 1.6, dem="flint-hills", lowest=0.25),
            row("aligned", 0.30, 0.3, 1.4, dem="flint-hills", lowest=0.5),
        ]
    )


SENSITIVITY = pd.DataFrame({"lai_slope": [0.01, -0.06], "r2_largest": [0.01, 0.02]})


@pytest.fixture
def on_blur(readings, sentence):
    def told():
        found = report.conclusions({"readings": readings, "sensitivity": SENSITIVITY})
        return sentence("on_blur", found["blurred"], found["drifting"], found["slope_step"])

    return told


def test_slopes_decide_between_blur_and_drift_where_the_figures_say_so(on_blur):
    text = on_blur()
    assert "R² of blur-48.6 is off by 0.08" in text and "that of the drift by 0.05" in text
    assert "rise 1.89 times" in text and "more than 6 %" in text
    assert "1.26 times in the paper, 1.27 with drift, 1.05 with blur. So slopes decide, not R²." in text


def test_blur_that_has_the_papers_slopes_is_not_told_from_drift(readings, on_blur):
    readings.loc[readings["name"] == "blur-48.6", "lai_slope_rms"] = 0.09
    assert on_blur().endswith("these figures do not tell blur from drift.")


def test_growth_like_the_papers_leaves_only_the_height_of_slopes(readings, on_blur):
    readings.loc[readings["name"] == "blur-48.6", "growth"] = 1.27
    assert on_blur().endswith("against blur, and no more.")


def test_without_blur_nothing_is_said_of_it(readings):
    few = readings[~readings["name"].str.startswith("blur")]
    assert report.conclusions({"readings": few, "sensitivity": SENSITIVITY})["blurred"] is None


def test_displacement_is_told_apart_where_it_differs(readings, sentence):
    def told():
        found = report.conclusions({"readings": readings, "sensitivity": SENSITIVITY})
        return sentence("on_displacement", found["displaced"], found["drifting"], found["alike"])

    assert told().endswith("Table 2 does not tell them apart.")
    readings.loc[readings["name"] == "offset", "lai_r2_rms"] = 0.12
    assert "tell them apart" not in told()


def test_relief_is_told_by_the_row_that_it_lowers_most(readings, sentence):
    found = report.on_relief(readings)
    assert (found["treatment"], found["arp"], found["dem"]) == ("burned-ungrazed", "0.05", "flint-hills")
    assert found["level"]["native"][found["most"]] == 0.45 and found["hills"]["native"][found["most"]] == 0.25
    assert "was not in Table 2" in sentence("on_relief", found["worse"], report._ALIKE)
    # Of a case on hills, level ground is the other.
    turned = pd.concat([readings.iloc[5:], readings.iloc[:5]], ignore_index=True)
    again = report.on_relief(turned)
    assert again["hills"]["native"]["lai_r2_rms"] == 0.08 and again["level"]["native"]["lai_r2_rms"] == 0.05


def test_relief_that_changes_little_is_not_ruled_out(readings, sentence):
    readings.loc[5, "lai_r2_rms"] = 0.055
    assert "too little to be told" in sentence("on_relief", report.on_relief(readings)["worse"], report._ALIKE)
    readings.loc[5, "lai_r2_rms"] = 0.01
    assert "nearer to the paper's" in sentence("on_relief", report.on_relief(readings)["worse"], report._ALIKE)
