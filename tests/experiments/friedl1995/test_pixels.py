"""Ground and pixels of a scene."""

from dataclasses import replace

import numpy as np
import pytest

from fifesim.chain.setup import image_of
from fifesim.experiments.friedl1995.case import READINGS, Case
from fifesim.experiments.friedl1995.table import ground_of, paired, scene_image, truth_means
from fifesim.grids import grid as grids
from fifesim.ground.landscape.distribution import lai_distribution

SCENE = ("burned-grazed", 0.24, 3)


@pytest.fixture(scope="module")
def ground():
    return ground_of(Case(cells=180), *SCENE)


def test_native_pixels_drift_from_the_truth_by_the_interval(ground):
    """43 microradian x 705 km = 30.315 m (Table 1): 0.315 m a pixel."""
    case = Case(cells=180)
    native = grids.geobox(scene_image(case, ground))
    assert grids.cell_size(native) == pytest.approx((30.315, 30.315), rel=1e-12)
    blocks = grids.geobox(truth_means(case, ground, ground.lai))
    drift = (native.affine * (15.5, 15.5))[0] - (blocks.affine * (15.5, 15.5))[0]
    assert drift == pytest.approx(15.5 * 0.315, rel=1e-6)
    assert case.drift == pytest.approx((native.shape.x - 1) * 0.315, rel=1e-9)
    assert Case(cells=180, reading=READINGS["aligned"]).drift == 0


def test_offset_pixels_see_the_ground_to_the_south_east(ground):
    """Two cells each way: the aligned image of the scene without its first two rows and columns."""
    moved = scene_image(Case(cells=180, reading=READINGS["offset"]), ground)
    aligned = image_of(replace(ground.setup, onto=None, interval=None), ground.reflectance[:, 2:, 2:])
    # Sums of another window round otherwise, which may carry a value over the middle of two counts.
    off = abs(moved[:, :19, :19].values.astype(int) - aligned[:, :19, :19].values)
    assert off.max() <= 1 and (off > 0).mean() < 0.005


def test_scene_has_exactly_the_density():
    """Exact ranks: the quantiles of the cells are those of the distribution."""
    ground = ground_of(Case(cells=90), "burned-ungrazed", 0.24, 3)
    ranks = (np.arange(8100) + 0.5) / 8100
    expected = lai_distribution("burned-ungrazed").ppf(ranks)
    np.testing.assert_allclose(np.sort(ground.lai.values.ravel()), expected, rtol=1e-12)
    assert (ground.fpar > 0).all() and (ground.fpar < 0.94).all()


def test_pixels_pair_by_row_and_column_without_what_lacks_data(ground):
    truth = ground.lai[:3, :4].copy(deep=True)
    truth[0, 0] = np.nan
    other = ground.lai[:4, :3] * 2
    values = paired(truth.values, other.values)
    assert values.shape == (2, 8)
    np.testing.assert_allclose(values[1], 2 * values[0])
