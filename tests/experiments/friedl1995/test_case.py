"""The repeated experiment: its readings, its numbers beside the paper's, and its files."""

import numpy as np
import pytest

from fifesim.chain.setup import image_of, reflectance_of
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995.case import READINGS, Case
from fifesim.rasters import grid as grids


def reading(name):
    return next(each for each in READINGS if each.name == name)


@pytest.fixture(scope="module")
def ground():
    case = Case(cells=180)
    return reflectance_of(case.read, friedl1995.landscape(case, "burned-grazed", 0.24, 3)[0])


def test_native_pixels_drift_from_the_truth_by_the_interval(ground):
    """43 microradian x 705 km = 30.315 m (Table 1): 0.315 m a pixel."""
    native = grids.geobox(image_of(Case(cells=180).read, ground))
    assert grids.cell_size(native) == pytest.approx((30.315, 30.315), rel=1e-12)
    blocks = grids.aligned(grids.geobox(ground), 30.0)
    drift = (native.affine * (15.5, 15.5))[0] - (blocks.affine * (15.5, 15.5))[0]
    assert drift == pytest.approx(15.5 * 0.315, rel=1e-6)


def test_offset_pixels_see_the_ground_to_the_south_east(ground):
    """Two cells each way: the image of the scene without its first two rows and columns."""
    moved = image_of(Case(cells=180, reading=reading("constant offset")).read, ground)
    cut = image_of(Case(cells=180, reading=reading("aligned")).read, ground[:, 2:, 2:])
    np.testing.assert_array_equal(moved[:, :19, :19], cut[:, :19, :19])


def test_scene_has_exactly_the_density():
    """Exact ranks: the quantiles of the cells are those of the distribution."""
    case = Case(cells=90)
    lai, fpar = friedl1995.landscape(case, "burned-ungrazed", 0.24, 3)
    ranks = (np.arange(8100) + 0.5) / 8100
    np.testing.assert_allclose(np.sort(lai.values.ravel()), case.densities["burned-ungrazed"].ppf(ranks), rtol=1e-12)
    assert (fpar > 0).all() and (fpar < 0.94).all()


def test_densities_keep_mean_and_deviation_of_the_shipped_ones():
    for name, density in Case().densities.items():
        lower, upper = density.support()
        assert upper == pytest.approx(density.mean() + 3 * density.std(), abs=0.005)
        assert lower == pytest.approx(max(density.mean() - 3 * density.std(), 0), abs=0.005), name
