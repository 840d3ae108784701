"""Turned footprints against separable ones, moments and dense sums."""

import numpy as np
import pytest

from fifesim.base.footprints import axis_operator
from fifesim.base.line_spread import Boxcar
from fifesim.sensor.response.scan import Footprints, apply_operator, footprint_operator
from fifesim.sensor.response.spatial import CosineSpread, GaussianSpread

N = 60
CELL = 10 / 3


def turned(angle, cell=CELL, growth=(1.0, 1.0)):
    """Steps of a row and a column in a frame that is turned by an angle and grown."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return cell * np.array([[c, s], [-s, c]]) / np.array(growth)[:, None]


def weights(angle, along, across, row=30.3, column=28.7, growth=(1.0, 1.0), cell=CELL):
    pixel = Footprints(np.array([row]), np.array([column]), turned(angle, cell, growth)[None], along, across)
    operator = footprint_operator(pixel, slice(0, N), slice(0, N))
    return operator.toarray().reshape(N, N)


@pytest.mark.parametrize("quarter", [0, 90, 180])
def test_a_footprint_along_the_grid_is_separable(quarter):
    """Exactly so, but for the steps of the tables, 1/4096 of the support."""
    along, across = CosineSpread(30.32), GaussianSpread(24.0)
    order = (along, across) if quarter % 180 == 0 else (across, along)
    rows, columns = (
        axis_operator(
            spread,
            cell_origin=0.0,
            cell_size=CELL,
            n_cells=N,
            pixel_origin=center * CELL - 15,
            pixel_size=30.0,
            n_pixels=1,
        )
        for spread, center in zip(order, (30.3, 28.7), strict=True)
    )
    expected = np.zeros((N, N))
    expected[rows.start[0] : rows.start[0] + rows.count[0], columns.start[0] : columns.start[0] + columns.count[0]] = (
        np.outer(rows.weights[0, : rows.count[0]], columns.weights[0, : columns.count[0]])
    )
    found = weights(quarter, along, across)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("angle", [13.6, 45.0, -72.0])
@pytest.mark.parametrize(
    ("along", "across", "growth"),
    [(Boxcar(30.0), CosineSpread(30.32), (1.0, 1.0)), (CosineSpread(30.32), GaussianSpread(20.0), (1.25, 1.36))],
)
def test_a_turned_footprint_agrees_with_dense_sums(angle, along, across, growth):
    """Each cell cut in 24 x 24 points, and densities from differences of the cumulative response."""
    fine = 24
    places = (np.arange(N * fine) + 0.5) / fine
    down, right = np.meshgrid(places - 30.3, places - 28.7, indexing="ij")
    frame = turned(angle, growth=growth)
    step = 0.01
    dense = np.ones_like(down)
    for spread, (by_row, by_column) in zip((along, across), frame, strict=True):
        x = by_row * down + by_column * right
        dense *= spread.cumulative(x + step / 2) - spread.cumulative(x - step / 2)
    expected = dense.reshape(N, fine, N, fine).sum(axis=(1, 3)) / dense.sum()
    found = weights(angle, along, across, growth=growth)
    # Pieces that the jump of a response cuts are upright instead of turned.
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.04 * expected.max())
    assert np.abs(found - expected).sum() < 0.015


@pytest.mark.parametrize("angle", [0.0, 30.0, 77.0])
def test_moments_are_those_of_the_turned_response(angle):
    """Centre of the pixel; covariance of the Gaussians, turned and grown, plus a twelfth of a cell."""
    growth = (1.25, 1.6)
    found = weights(angle, GaussianSpread(12.0), GaussianSpread(18.0), growth=growth, cell=CELL)
    place = np.arange(N) + 0.5
    down, right = np.meshgrid(place - 30.3, place - 28.7, indexing="ij")
    assert float((found * down).sum()) == pytest.approx(0, abs=1e-6)
    assert float((found * right).sum()) == pytest.approx(0, abs=1e-6)
    back = np.linalg.inv(turned(angle, growth=growth))
    sigma = np.array([12.0, 18.0]) / np.sqrt(8 * np.log(2))
    expected = back @ np.diag(sigma**2) @ back.T + np.eye(2) / 12
    covariance = np.array([[np.sum(found * a * b) for b in (down, right)] for a in (down, right)])
    np.testing.assert_allclose(covariance, expected, rtol=0, atol=2e-3 * expected.max())


def test_a_footprint_smaller_than_a_cell_stays_whole():
    found = weights(20.0, Boxcar(0.5), Boxcar(0.5), row=30.5, column=28.5)
    assert found[30, 28] == pytest.approx(1.0, rel=1e-12) and found.sum() == pytest.approx(1.0, rel=1e-12)


def test_means_are_over_valid_cells():
    pixels = Footprints(
        np.array([30.3, 2.0]), np.array([28.7, 28.7]), np.stack([turned(14.0)] * 2), CosineSpread(30.32), Boxcar(30.0)
    )
    operator = footprint_operator(pixels, slice(0, N), slice(0, N))
    share = operator.sum(axis=1)
    assert share[0] == pytest.approx(1.0, rel=1e-12) and 0.5 < share[1] < 0.98
    constant = np.full((2, N * N), 0.3)
    constant[1, 30 * N + 28] = np.nan
    means = apply_operator(operator, constant, 0.9)
    assert means[:, 0] == pytest.approx(0.3, rel=1e-14)
    assert np.isnan(means[:, 1]).all()
    assert np.isfinite(apply_operator(operator, constant, 0.5)).all()
    scene = np.random.default_rng(1).random((1, N * N))
    weight = operator.toarray()[0]
    assert apply_operator(operator, scene, 0.9)[0, 0] == pytest.approx(weight @ scene[0], rel=1e-12)


def test_the_window_holds_the_footprint():
    pixels = Footprints(np.array([30.3]), np.array([28.7]), turned(33.0)[None], CosineSpread(30.32), Boxcar(30.0))
    rows, columns = pixels.window((N, N))
    whole = footprint_operator(pixels, slice(0, N), slice(0, N)).toarray().reshape(N, N)
    part = footprint_operator(pixels, rows, columns).toarray().reshape(rows.stop - rows.start, -1)
    np.testing.assert_array_equal(part, whole[rows, columns])
    assert part.sum() == pytest.approx(1.0, rel=1e-12)
