"""Soil that is brighter or darker along the soil line."""

import numpy as np
import pytest

import fifesim
from fifesim.base import files
from fifesim.base.bands import Band
from fifesim.ground.canopy.soil import brightened, soil_line

TM = tuple(band.response for band in fifesim.instrument("TM").select(None))


def narrow(wavelength):
    return Band(f"{wavelength} um", (wavelength - 0.001, wavelength, wavelength + 0.001), (0, 1, 0))


def test_line_leads_from_the_wet_soil_to_the_dry():
    """Of any bands: a walk of one length reaches the dry soil from the wet one in all of them."""
    table = files.table("ground_spectra.csv").set_index("wavelength")
    places = [0.45, 0.55, 0.66, 0.86, 1.65, 2.2]
    line = soil_line([narrow(place) for place in places])
    steps = (table["soil_dry"] - table["soil_wet"]).loc[places].to_numpy() / line
    np.testing.assert_allclose(steps, steps[0], rtol=2e-3)
    assert line[1] == pytest.approx(1, rel=2e-3)
    # A brighter soil is more so in the near infrared than in the red.
    red, near_infrared = soil_line(TM[2:4])
    assert near_infrared / red == pytest.approx(1.2, abs=0.02)


def test_soils_beyond_all_and_nothing_are_cut_off():
    found = brightened(np.array([0.15, 0.19]), np.array([0.0, 0.1, -0.5, 1.0, np.nan]), np.array([1.2, 1.4]))
    np.testing.assert_array_equal(found[[0, 2, 3]], [[0.15, 0.19], [0, 0], [1, 1]])
    np.testing.assert_allclose(found[1], [0.27, 0.33])
    assert np.isnan(found[4]).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: brightened(0.2, 4.0, np.ones(1)), r"soil must be in \[-1, 1\], got 4: .* along the soil line"),
        (lambda: soil_line([narrow(3.75)]), "no soil line for band 3.75 um, .* have 0.4 to 2.45 um"),
    ],
)
def test_what_no_soil_has_is_one_line(call, message):
    with pytest.raises(ValueError, match=message) as caught:
        call()
    assert len(str(caught.value)) <= 500
