import numpy as np
import pytest

from fifesim.base.line_spread import Boxcar
from fifesim.grids.sites import fife_site
from fifesim.sensor.pixel_labels import check_scene, shifts_of

PIXELS = fife_site(30.0, ((0, 4), (0, 5)))


def test_shifts_are_offsets_in_metres():
    south, east = shifts_of((0.5, np.arange(5)), PIXELS)
    assert south == 15.0 and east.tolist() == [0.0, 30.0, 60.0, 90.0, 120.0]


@pytest.mark.parametrize("offset", [0.5, (0.5,), (np.zeros(3), 0.0), (np.nan, 0.0)])
def test_offsets_that_fit_no_pixels_are_refused(offset):
    with pytest.raises(ValueError, match="offset"):
        shifts_of(offset, PIXELS)


def test_a_response_wider_than_the_scene_is_refused():
    wide = Boxcar(200.0), Boxcar(100.0)
    check_scene(wide, PIXELS, 0.6, "TM")
    with pytest.raises(ValueError, match="wider than the scene of 120 x 150 m, which holds 60% of it"):
        check_scene(wide, PIXELS, 0.61, "TM")
