"""Tests of leaf area maps downscaled to a scene: labels, bits in chunks and windows, pixels, and errors."""

import re
import warnings

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, check_place, no_compute

import fifesim
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.ground.landscape.downscaling import kriging_block_means

# The map crosses the edge of two tiles of 504 cells.
SOURCE = fifesim.grid_at("EPSG:32614", 1680 * 400 - 300, 1680 * 2600 - 200, 700, 500, 10)
GRID = SOURCE.zoom_out(1 / 3)


@pytest.fixture(scope="module")
def map_values():
    y, x = np.mgrid[:50, :70]
    values = 1.5 + np.sin(x / 9) * np.cos(y / 7)
    values += 0.2 * np.random.default_rng(1).standard_normal(values.shape)
    values = np.maximum(values, 0.1)
    values[20:22, 30:40] = 0.0
    values[5:8, 50:55] = np.nan
    return values


@pytest.fixture(scope="module")
def lai_map(map_values):
    return grids.place(xr.DataArray(map_values, dims=("y", "x"), name="lai"), SOURCE)


@pytest.fixture(scope="module")
def scene(lai_map):
    return fifesim.ground.downscale(lai_map, GRID, arp=0.2, cv=0.3, seed=7)


def means(cells):
    return kriging_block_means(np.asarray(cells), (3, 3))


def test_scene_has_the_means_of_the_map_labels_and_georeferencing(scene, map_values):
    np.testing.assert_allclose(means(scene), map_values, rtol=1e-12, atol=0)
    assert np.nanmin(scene) == 0
    assert np.all(scene.values.reshape(50, 3, 70, 3)[20:22, :, 30:40] == 0)
    check_place(scene, "EPSG:32614")
    assert grids.same_grid(grids.geobox(scene), GRID)
    assert scene.name == "lai" and cf.attributes("lai").items() <= scene.attrs.items()
    assert scene.attrs["arp"] == 0.2 and scene.attrs["rng_seed"] == "7"
    assert scene.attrs["lai_distribution"] == "log-normal, cv 0.3"
    assert "site" not in scene.attrs


@pytest.mark.parametrize("chunks", [{"y": 40, "x": 70}, 100, "auto", {"y": -1}])
def test_scene_has_the_same_bits_in_any_chunks(scene, lai_map, chunks):
    lazy_map = lai_map.copy(data=lai_map.variable.chunk(ODD_CHUNKS).data)
    # The realised variation is known only after the cells are computed.
    expected = scene.assign_attrs()
    del expected.attrs["cv_within_pixels"]
    for given in (lai_map, lazy_map):
        with no_compute():
            lazy = fifesim.ground.downscale(given, GRID, arp=0.2, cv=0.3, seed=7, chunks=chunks)
        assert lazy.chunks is not None
        xr.testing.assert_identical(lazy.compute(), expected)


@pytest.mark.parametrize(("arp", "short"), [(0.15, False), (0.24, True)])
def test_variation_below_the_requested_one_causes_a_warning(arp, short):
    """At a high arp, the texture of the map leaves less variation for the cells; by whole pixels of the grid."""
    coarse = fifesim.lai_scene(fifesim.fife_site(10, window=((0, 80), (0, 90))), "burned-ungrazed", arp=0.24, seed=7)
    grid = fifesim.fife_site(10 / 3, window=((1, 240), (2, 270)))
    for chunks in (120, None):
        with warnings.catch_warnings(record=True, action="always", category=UserWarning) as caught:
            cells = fifesim.ground.downscale(coarse, grid, cv=0.4, arp=arp, seed=1, chunks=chunks).compute()
        assert any("cv=0.4 was requested" in str(each.message) for each in caught) == short
    inside = cells.values[2:, 1:].reshape(79, 3, 89, 3)
    realised = np.sqrt(np.mean(inside.var(axis=(1, 3)) / inside.mean(axis=(1, 3)) ** 2))
    np.testing.assert_allclose(cells.attrs["cv_within_pixels"], realised, rtol=1e-12)


def test_window_within_a_pixel_equals_a_slice_and_cells_outside_the_map_are_nan(scene, lai_map):
    window = fifesim.ground.downscale(lai_map, GRID[31:95, 44:200], arp=0.2, cv=0.3, seed=7)
    np.testing.assert_array_equal(window, scene[31:95, 44:200])
    xr.testing.assert_allclose(window["x"], scene["x"][44:200], rtol=0, atol=1e-6)

    larger = fifesim.ground.downscale(lai_map, GRID.pad(9), arp=0.2, cv=0.3, seed=7)
    np.testing.assert_array_equal(larger[9:-9, 9:-9], scene)
    assert np.isnan(larger[:9]).all() and np.isnan(larger[:, -9:]).all()


def test_tiles_have_no_seams(lai_map):
    """Shifting the map by half a tile changes no cell by more than 1e-4, relatively."""
    moved = fifesim.grid_at("EPSG:32614", SOURCE.affine.c + 840, SOURCE.affine.f - 840, 700, 500, 10)
    there = fifesim.ground.downscale(grids.place(lai_map, moved), moved.zoom_out(1 / 3), arp=0.2, cv=0.0)
    here = fifesim.ground.downscale(lai_map, GRID, arp=0.2, cv=0.0)
    np.testing.assert_allclose(there.values, here.values, rtol=1e-4)


def test_dates_are_downscaled_one_by_one(lai_map):
    days = xr.Variable("time", np.array(["2022-06-03", "2022-07-03"], "M8[ns]"))
    cube = xr.concat([lai_map, 2 * lai_map], dim=days)
    cells = fifesim.ground.downscale(cube, GRID, cv=0.3)
    assert cells.dims == ("time", "y", "x")
    np.testing.assert_allclose(means(cells[1]), 2 * lai_map, rtol=1e-12)
    np.testing.assert_allclose(cells[1], 2 * cells[0], rtol=1e-5)


def test_cells_follow_a_distribution_or_a_function_of_the_mean(lai_map):
    low = fifesim.ground.downscale(lai_map * 0.5, GRID, distribution="unburned-ungrazed", seed=1)
    np.testing.assert_allclose(means(low), 0.5 * lai_map, rtol=1e-12)
    assert low.attrs["lai_distribution"] == "unburned-ungrazed" and np.nanmax(low) < 2.75 * 1.01
    of_mean = fifesim.ground.downscale(lai_map, GRID, cv=lambda mean: np.where(mean > 1.5, 0.0, 0.5), seed=1)
    smooth = fifesim.ground.downscale(lai_map, GRID, cv=0.0)
    spread, smooth = (
        each.values.reshape(50, 3, 70, 3).std(axis=(1, 3)) / lai_map.where(lai_map > 0).values
        for each in (of_mean, smooth)
    )
    dense = lai_map.values > 2.2
    np.testing.assert_allclose(spread[dense].mean(), smooth[dense].mean(), rtol=0.6)
    assert np.nanmean(spread[lai_map.values < 0.7]) > 0.35


@pytest.mark.parametrize("off", [0, 1])
def test_cells_correlate_with_a_lai_scene_of_the_same_seed(off):
    """Also where the pixel corner is not a multiple of the pixel size from the origin of the CRS."""
    source = fifesim.grid_at("EPSG:32614", 672000 + 30 + off * 10 / 3, 4368000 - off * 20 / 3, 450, 450, 10)
    pixels = grids.place(xr.DataArray(np.ones((45, 45)), dims=("y", "x"), name="lai"), source)
    grid = source.zoom_out(1 / 3)
    plain = fifesim.lai_scene(grid, "burned-ungrazed", arp=0.05, seed=7).values.ravel()
    same, other = (
        fifesim.ground.downscale(pixels, grid, arp=0.05, cv=0.3, seed=seed).values.ravel() for seed in (7, 8)
    )
    assert np.corrcoef(plain, same)[0, 1] > 0.85
    assert abs(np.corrcoef(plain, other)[0, 1]) < 0.05


def test_unusable_maps_are_refused(lai_map):
    with no_compute():
        lazy = fifesim.ground.downscale((lai_map - 0.5).chunk(100), GRID)
    with pytest.raises(ValueError, match="negative"):
        lazy.compute()
    with pytest.raises(ValueError, match=r"mean LAI 2.*, which cells .* from 0 to 2.2 cannot have"):
        fifesim.ground.downscale(lai_map, GRID, distribution="burned-grazed")


def test_scaled_integers_and_rows_from_south_to_north_are_accepted(lai_map, scene):
    packed = (lai_map * 1000).round().fillna(65535).astype("u2").assign_attrs(scale_factor=0.001, _FillValue=65535)
    cells = packed[::-1].fifesim.downscale(GRID, arp=0.2, cv=0.3, seed=7)
    np.testing.assert_allclose(means(cells), np.round(lai_map, 3), rtol=1e-9)
    np.testing.assert_allclose(cells, scene, rtol=0.02, atol=1e-3)


@pytest.mark.parametrize("cv", [0.4, lambda mean: 0.4 + 0 * mean], ids=["number", "function"])
def test_variation_of_a_map_that_is_smoother_than_its_cells(cv):
    """A uniform map has no texture across pixels, so that cells vary less; the stated factor makes up for it."""
    uniform = fifesim.lai_scene(fifesim.fife_site(10, window=((0, 60), (0, 60))), seed=7) * 0 + 2.0
    grid = fifesim.fife_site(10 / 3, window=((0, 180), (0, 180)))
    with pytest.warns(
        UserWarning, match=r"cv=0\.4 was requested, .* is 0\.32.*smoother.*cv 1\.2\d times larger"
    ) as said:
        uniform.fifesim.downscale(grid, cv=cv, arp=0.24, seed=11)
    factor = float(re.search(r"cv ([\d.]+) times", str(said[0].message)).group(1))
    with pytest.warns(UserWarning, match="smoother"):
        cells = uniform.fifesim.downscale(grid, cv=0.4 * factor, arp=0.24, seed=11)
    assert cells.attrs["cv_within_pixels"] == pytest.approx(0.4, rel=0.02)
