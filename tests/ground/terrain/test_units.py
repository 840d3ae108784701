"""Units of elevation and what whole numbers of them leave."""

import numpy as np
import pytest

from fifesim.ground.terrain import slope


def plane(shape=(80, 90)):
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return 400.0 + 3.0 * columns - 2.0 * rows


def test_terraces_are_known_by_their_step():
    gentle = plane() / 20
    assert slope.terrace_step(np.rint(gentle)) == 1
    assert slope.terrace_step(np.rint(gentle / 5) * 5) == 5
    assert slope.terrace_step(gentle) is None
    assert slope.terrace_step(np.full((9, 9), 400.0)) is None
    assert slope.terrace_step(np.rint(plane())) is None
    assert slope.terrace_step(np.full((9, 9), np.nan)) is None


@pytest.mark.parametrize(
    ("name", "metres"), [("m", 1), ("Foot", 0.3048), ("US survey foot", 1200 / 3937), ("ft", 0.3048), ("metre", 1)]
)
def test_units_by_the_names_that_files_use(name, metres):
    assert slope.metres_per_unit(name) == metres


def test_unknown_unit_is_refused():
    with pytest.raises(ValueError, match="vertical units must be one of m, ft, us-ft"):
        slope.metres_per_unit("furlong")
