"""The adjacency effect on labelled rasters: environment of cells, and its surroundings."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, check_place, in_chunks, no_compute

import fifesim
from fifesim.atmosphere import adjacency
from fifesim.atmosphere import adjacency_labels as adjacency_raster
from fifesim.atmosphere.coupling import BandTerms
from fifesim.grids import grid as grids

CRS = "EPSG:26914"
# A slant view that receives more light from the environment than from the target. Adjacency uses no other terms.
NAMES = ("path_reflectance", "transmittance_down", "transmittance_up", "direct_transmittance_up")
NAMES += ("diffuse_up_molecules", "diffuse_up_aerosol", "spherical_albedo", "gas_transmittance")
SLANTED = (0.3, 0.6, 0.7, 0.1, 0.1, 0.5, 0.2, 0.9), (0.25, 0.65, 0.75, 0.2, 0.12, 0.43, 0.15, 0.93)
UNKNOWN = dict.fromkeys(BandTerms._fields, np.full(2, np.nan))
SLANTED = BandTerms(**UNKNOWN | dict(zip(NAMES, np.array(SLANTED).T, strict=True)))


def raster(values, cell, west=700_000.0, north=4_330_000.0):
    values = np.asarray(values, float)
    down, across = np.broadcast_to(cell, 2)
    grid = fifesim.grids.grid.grid_at(CRS, west, north, values.shape[-1] * across, values.shape[-2] * down, cell)
    dims = ("band", "y", "x")[-values.ndim :]
    return grids.place(xr.DataArray(values, dims=dims, name="surface_reflectance"), grid)


@pytest.fixture
def scene():
    """Two bands of 47 x 62 cells of 20 m, 3 x 3 cells per block, starting within a block, with gaps in one band."""
    values = np.random.default_rng(3).random((2, 47, 62)) * 0.5
    values[0, 10:21, 30:47] = np.nan
    values[0, 0, 3] = np.nan
    return raster(values, 20.0, west=700_020.0, north=4_330_040.0)


def environment(array, surroundings=None, vza=0.0):
    return adjacency_raster.environment(array, [0.3, 0.2], [0.7, 0.8], vza, surroundings=surroundings)


def forth(array, surroundings=None):
    return adjacency_raster.apparent_reflectance_of_scene(array, SLANTED, 20.0, surroundings)


def back(array, surroundings=None):
    return adjacency_raster.corrected_reflectance_of_scene(array, SLANTED, 20.0, surroundings)


def surroundings_of(array):
    """Raster of 150 m cells, far beyond the scene on two sides and slightly on the others, with a gap."""
    values = np.random.default_rng(4).random((30, 25)) * 0.4
    values[:4, :4] = np.nan
    place = array.odc.geobox.boundingbox
    return raster(values, 150.0, west=place.left - 333.0, north=place.top + 1777.0)


@pytest.mark.parametrize("vza", [0.0, 40.0])
@pytest.mark.parametrize("kind", ["mean", "number", "bands", "raster"])
def test_environment_of_uniform_ground_is_uniform(scene, kind, vza):
    flat = xr.full_like(scene, 0.3).where(scene.notnull())
    around = {"mean": None, "number": 0.3, "bands": [0.3, 0.3], "raster": surroundings_of(scene) * 0 + 0.3}[kind]
    np.testing.assert_allclose(environment(flat, around, vza), 0.3, rtol=0, atol=1e-14)


def environment_of_one(array, surroundings, weights=(0.3, 0.7)):
    return adjacency_raster.environment(array, *weights, 0.0, surroundings=surroundings)


def test_surroundings_are_the_mean_of_each_band_by_default(scene):
    """Bands are independent, and cells of 32 bits lose nothing."""
    found, far = environment(scene), scene.mean(("y", "x"))
    np.testing.assert_allclose(found, environment(scene, far.values.tolist()), rtol=1e-14)
    np.testing.assert_allclose(found[[1]], environment_of_one(scene[[1]], float(far[1]), (0.2, 0.8)), rtol=1e-14)
    narrow = scene.astype(np.float32)
    np.testing.assert_array_equal(forth(narrow, 0.2), forth(narrow.astype(float), 0.2))


def test_cells_at_the_limits_of_the_environment(scene):
    """Clipping below -1000 keeps the integer sums from overflowing. Without scattering, all weight is on the target."""
    low = environment(xr.full_like(scene, -1e30), 0.0)
    np.testing.assert_allclose(low, environment(xr.full_like(scene, -1000.0), 0.0), rtol=1e-12)
    empty = xr.full_like(scene, np.nan)
    np.testing.assert_allclose(environment(empty, [0.1, 0.2])[1], 0.2, rtol=1e-14)
    assert environment(empty).isnull().all()
    np.testing.assert_array_equal(adjacency.point_spread((2, 2), (60, 60), 0.0, 0.0, 0.0), [[1, 0], [0, 0]])
    assert adjacency.environment_weights(0.0, 0.0) == (0.0, 0.0)
    blind = SLANTED._replace(direct_transmittance_up=np.array([1e-6, 1e-6]))
    with pytest.raises(RuntimeError, match="of the light of a target 1e-06 comes to the sensor unscattered"):
        adjacency_raster.corrected_reflectance_of_scene(scene, blind, 0.0)


def test_raster_of_surroundings_is_georeferenced():
    """Environment of a window, with the whole scene as surroundings, in cells of the window or nine times as wide."""
    coarse = np.random.default_rng(5).random((1, 40, 40)) * 0.5
    place = {"west": 699_960.0, "north": 4_330_020.0}
    whole, wide = raster(coarse.repeat(9, axis=1).repeat(9, axis=2), 20.0, **place), raster(coarse, 180.0, **place)
    everywhere = environment_of_one(whole, float(whole.mean()))
    # Where a scene ends within blocks, the rest of these blocks comes from the block mean of the surroundings.
    for rows, columns, edge, limit in (((97, 180), (50, 161), 3, 0.004), ((96, 180), (51, 162), 0, 1e-12)):
        part, inner = {"y": slice(*rows), "x": slice(*columns)}, {"y": slice(edge, -edge or None)}
        inner["x"] = inner["y"]
        for surroundings in (whole, whole[0], wide):
            found = environment_of_one(whole.isel(part), surroundings).isel(inner)
            np.testing.assert_allclose(found, everywhere.isel(part).isel(inner), rtol=0, atol=limit)


@pytest.mark.parametrize("cell", [3.0, 30.0, (30.0, 80.0)])
def test_round_trip_is_exact(scene, cell):
    """The environment is solved to 1e-12; as little as 0.1 of the light of a target arrives unscattered."""
    ground = raster(scene.values, cell)
    for surroundings in (None, [0.1, 0.4], surroundings_of(ground)):
        toa = adjacency_raster.apparent_reflectance_of_scene(ground, SLANTED, 40.0, surroundings)
        back = adjacency_raster.corrected_reflectance_of_scene(toa, SLANTED, 40.0, surroundings)
        np.testing.assert_allclose(back, ground, rtol=0, atol=1e-10)


@pytest.mark.parametrize("function", [environment, forth, back])
def test_chunks_give_bitwise_equal_results_lazily(scene, function):
    """Lazy surroundings alone make the result lazy; only missing cells are missing."""
    scene = scene.assign_coords(band=["TM1", "TM3"], sza=30.0)
    for around in (None, surroundings_of(scene)):
        result, before = function(scene, around), scene.copy(deep=True)
        check_place(result, CRS)
        assert result.dims == ("band", "y", "x") and result["band"].values.tolist() == ["TM1", "TM3"]
        for chunks in (CHUNKS, ODD_CHUNKS, ODD_CHUNKS | {"band": 1}):
            with no_compute():
                lazy = function(in_chunks(scene, chunks), None if around is None else in_chunks(around, chunks))
            assert lazy.chunks == in_chunks(scene, {"band": 2} | chunks).chunks
            xr.testing.assert_identical(lazy.compute(), result)
        xr.testing.assert_identical(scene, before)
    assert function is environment or (result.isnull() == scene.isnull()).all()
    with no_compute():
        lazy = function(scene, in_chunks(around, CHUNKS))
    xr.testing.assert_identical(lazy.compute(), result)


def test_surroundings_are_matched_by_band_name(scene):
    scene = scene.assign_coords(band=["TM1", "TM3"])
    around = raster(np.broadcast_to([[[0.5]], [[0.1]], [[0.3]]], (3, 9, 9)), 3000.0)
    named = around.assign_coords(band=["TM4", "TM3", "TM1"])
    xr.testing.assert_identical(environment(scene, named), environment(scene, around[[2, 1]]))
    with pytest.raises(ValueError, match="the surroundings have the bands TM1, TM4, the scene TM1, TM3"):
        environment(scene, named[[2, 0]])
    numbers = xr.DataArray([0.1, 0.3], {"band": ["TM3", "TM1"]})
    xr.testing.assert_identical(environment(scene, numbers), environment(scene, [0.3, 0.1]))


def test_environment_function_agrees_with_6s():
    """6S computes in single precision and prints seven digits."""
    table = pd.read_csv(Path(__file__).parents[1] / "data" / "sixs_adjacency.csv", comment="#")
    found = adjacency.environment_function(1000 * table["radius"], table["vza"])
    expected = table["environment_function_molecules"], table["environment_function_aerosol"]
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-7)
