"""The adjacency effect on labelled rasters, and its environment function."""

from pathlib import Path

import dask
import dask.array as da
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from dask.callbacks import Callback
from lazy import CHUNKS, ODD_CHUNKS, check_place, in_chunks, no_compute

import fifesim
from fifesim.atmosphere import adjacency
from fifesim.atmosphere import adjacency_labels as adjacency_raster
from fifesim.atmosphere.coupling import BandTerms, TargetTerms, inhomogeneous_reflectance
from fifesim.grids import grid as grids

CRS = "EPSG:26914"


def make_terms(*bands):
    """Band terms with these values, and NaN for the terms that adjacency does not use."""
    names = ("path_reflectance", "transmittance_down", "transmittance_up", "direct_transmittance_up")
    names += ("diffuse_up_molecules", "diffuse_up_aerosol", "spherical_albedo", "gas_transmittance")
    unknown = dict.fromkeys(BandTerms._fields, np.full(len(bands), np.nan))
    return BandTerms(**unknown | dict(zip(names, np.array(bands).T, strict=True)))


# Similar to TM1 and TM3 at a visibility of 10 km.
HAZE = make_terms((0.09, 0.8, 0.83, 0.52, 0.07, 0.29, 0.19, 0.98), (0.04, 0.85, 0.88, 0.62, 0.02, 0.26, 0.12, 0.93))
# Slant view that receives more light from the environment than from the target.
SLANTED = make_terms((0.3, 0.6, 0.7, 0.1, 0.1, 0.5, 0.2, 0.9), (0.3, 0.6, 0.7, 0.2, 0.1, 0.4, 0.2, 0.9))


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


@pytest.mark.parametrize("vza", [0.0, 40.0])
@pytest.mark.parametrize("radius", [120.0, 300.0, 1000.0, 3500.0])
def test_centre_of_a_disc_gives_the_environment_function(radius, vza):
    """
    Each block has the correct mean, but its ground is spread over the block of width w.

    This displaces a point by w^2 / 6 along each axis (mean square). To second order the share changes by
    w^2 / 12 (F'' - F' / r), where the magnitude of F'' is at most F' / r.
    """
    size, cell = 3 * 141, 20.0
    centre = (np.arange(size) + 0.5) * cell - size * cell / 2
    inside = np.hypot(centre[:, None], centre) < radius
    # 699 960 m and 4 330 020 m are multiples of 60 m.
    disc = raster(np.where(inside, 0.5, 0.1)[None], cell, west=699_960.0, north=4_330_020.0)
    around = adjacency_raster.environment(disc, 0.3, 0.7, vza, surroundings=0.1)[0]
    share = (float(around[size // 2, size // 2]) - 0.1) / 0.4
    covered = np.sqrt(inside.sum() / np.pi) * cell
    expected, beside = (adjacency.mixed_environment_function(r, vza, 0.3, 0.7) for r in (covered, covered + 1.0))
    assert share == pytest.approx(expected, abs=(beside - expected) / covered * 60.0**2 / 6)


def environment_of_one(array, surroundings, weights=(0.3, 0.7)):
    return adjacency_raster.environment(array, *weights, 0.0, surroundings=surroundings)


def test_surroundings_are_the_mean_of_each_band_by_default(scene):
    """Bands are independent, and cells of 32 bits lose nothing."""
    found, far = environment(scene), scene.mean(("y", "x"))
    np.testing.assert_allclose(found, environment(scene, far.values.tolist()), rtol=1e-14)
    np.testing.assert_allclose(found[[1]], environment_of_one(scene[[1]], float(far[1]), (0.2, 0.8)), rtol=1e-14)
    narrow = scene.astype(np.float32)
    np.testing.assert_array_equal(forth(narrow, 0.2), forth(narrow.astype(float), 0.2))


def test_cells_below_minus_1000_are_clipped(scene):
    """Clipping keeps the integer sums from overflowing."""
    low = environment(xr.full_like(scene, -1e30), 0.0)
    np.testing.assert_allclose(low, environment(xr.full_like(scene, -1000.0), 0.0), rtol=1e-12)


def test_scene_without_data_has_the_environment_of_its_surroundings(scene):
    empty = xr.full_like(scene, np.nan)
    np.testing.assert_allclose(environment(empty, [0.1, 0.2])[1], 0.2, rtol=1e-14)
    assert environment(empty).isnull().all()


def test_raster_of_surroundings_is_georeferenced():
    """Environment of a window, with the whole scene as surroundings, also in cells nine times as wide."""
    coarse = np.random.default_rng(5).random((40, 40)) * 0.5
    place = {"west": 699_960.0, "north": 4_330_020.0}
    whole, wide = (
        raster(coarse.repeat(9, axis=0).repeat(9, axis=1)[None], 20.0, **place),
        raster(coarse, 180.0, **place),
    )
    everywhere = environment_of_one(whole, float(whole.mean()))
    # Where a scene ends within blocks, the rest of these blocks comes from the block mean of the surroundings.
    for rows, columns, edge, limit in (((97, 180), (50, 161), 3, 0.004), ((96, 180), (51, 162), 0, 1e-12)):
        part = {"y": slice(*rows), "x": slice(*columns)}
        inner = {name: slice(edge, each.stop - each.start - edge) for name, each in part.items()}
        expected, scene = everywhere.isel(part).isel(inner), whole.isel(part)
        for surroundings in (whole, whole[0], wide):
            found = environment_of_one(scene, surroundings).isel(inner)
            np.testing.assert_allclose(found, expected, rtol=0, atol=limit)
        assert np.abs(environment_of_one(scene, float(whole.mean())).isel(inner) - expected).max() > 0.01


@pytest.mark.parametrize("cell", [3.0, 30.0, 40.0, 90.0, (30.0, 80.0)])
@pytest.mark.parametrize("terms", [HAZE, SLANTED], ids=["haze", "slanted"])
def test_round_trip_is_exact(cell, terms):
    """The environment is solved to 1e-12; as little as 0.1 of the light of a target arrives unscattered."""
    values = np.random.default_rng(7).random((2, 41, 53)) * 0.6
    values[0, 7:12, 3:30] = np.nan
    ground = raster(values, cell)
    for surroundings in (None, 0.3, [0.1, 0.4], surroundings_of(ground)):
        toa = adjacency_raster.apparent_reflectance_of_scene(ground, terms, 40.0, surroundings)
        back = adjacency_raster.corrected_reflectance_of_scene(toa, terms, 40.0, surroundings)
        np.testing.assert_allclose(back, ground, rtol=0, atol=1e-10)


def test_correction_without_direct_light_raises(scene):
    blind = HAZE._replace(direct_transmittance_up=np.array([1e-6, 1e-6]))
    with pytest.raises(RuntimeError, match="of the light of a target 1e-06 comes to the sensor unscattered"):
        adjacency_raster.corrected_reflectance_of_scene(scene, blind, 0.0)


def forth(array, surroundings=None):
    return adjacency_raster.apparent_reflectance_of_scene(array, HAZE, 20.0, surroundings)


def back(array, surroundings=None):
    return adjacency_raster.corrected_reflectance_of_scene(array, HAZE, 20.0, surroundings)


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


class _Held(Callback):
    """Peak number of bytes of results held at once."""

    most = 0

    def _posttask(self, key, value, graph, state, worker):
        self.most = max(self.most, sum(getattr(each, "nbytes", 0) for each in state["cache"].values()))


class _Nowhere:
    def __setitem__(self, place, values):
        pass


@pytest.mark.parametrize("function", [forth, back])
def test_results_are_streamed(function):
    """
    Results that are written at once occupy a few of 64 chunks; sums need 18 numbers per block of 400 cells.
    """
    chunks = ((2,), (200,) * 8, (200,) * 8)
    made = da.map_blocks(lambda block_info=None: np.full((2, 200, 200), 0.3), chunks=chunks, dtype=float)
    place = raster(np.zeros((1600, 1600)), 3.0)
    scene = grids.place(xr.DataArray(made, dims=("band", "y", "x")), place.odc.geobox)
    with _Held() as held, dask.config.set(scheduler="sync"):
        da.store(function(scene).data, _Nowhere(), lock=False)
    assert held.most < scene.nbytes / 12


@pytest.mark.parametrize(
    "around, message",
    [
        (float("nan"), "surroundings must be reflectances from 0 to 1, got"),
        ([0.1, 0.2, 0.3], "surroundings must be a number, or one for each of the 2 bands, got 3"),
        (raster(np.zeros((9, 9)), 60.0, west=900_000.0), "must lie within 100 km of the scene"),
        (raster(np.zeros((3, 9, 9)), 60.0), "the surroundings have 3 bands, the scene 2"),
        (
            raster(np.zeros((2, 9, 9)), 60.0).assign_coords(band=["TM1", "TM4"]),
            "the surroundings have the bands TM1, TM4, the scene TM1, TM3",
        ),
        (
            raster(np.zeros((9, 9)), 60.0).rio.write_crs("EPSG:26915"),
            "CRS of the scene, EPSG:26914, got EPSG:26915",
        ),
    ],
)
def test_invalid_surroundings_raise(scene, around, message):
    with pytest.raises(ValueError, match=message):
        environment(scene.assign_coords(band=["TM1", "TM3"]), around)


def test_surroundings_are_matched_by_band_name(scene):
    scene = scene.assign_coords(band=["TM1", "TM3"])
    around = raster(np.broadcast_to([[[0.5]], [[0.1]], [[0.3]]], (3, 9, 9)), 3000.0)
    named = around.assign_coords(band=["TM4", "TM3", "TM1"])
    xr.testing.assert_identical(environment(scene, named), environment(scene, around[[2, 1]]))
    numbers = xr.DataArray([0.1, 0.3], {"band": ["TM3", "TM1"]})
    xr.testing.assert_identical(environment(scene, numbers), environment(scene, [0.3, 0.1]))


# ------------------------------------------------------------------------------------------ environment function


SIXS = pd.read_csv(Path(__file__).parents[1] / "data" / "sixs_adjacency.csv", comment="#")


def test_environment_function_and_target_agree_with_6s():
    """
    6S computes in single precision and prints seven digits.

    The table holds band means of the transmittances that weight the mixture: at most 1.2e-3 off in 244 cases. In the
    apparent reflectance, band means replace the sum over wavelengths: at most 2.1e-4 off, for an effect of up to 0.11.
    """
    found = adjacency.environment_function(1000 * SIXS["radius"], SIXS["vza"])
    expected = SIXS["environment_function_molecules"], SIXS["environment_function_aerosol"]
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-7)
    up = SIXS["diffuse_up_molecules"], SIXS["diffuse_up_aerosol"]
    share = adjacency.mixed_environment_function(1000 * SIXS["radius"], SIXS["vza"], *up)
    np.testing.assert_allclose(share, SIXS["environment_function"], rtol=0, atol=1.5e-3)
    around = share * SIXS["target_reflectance"] + (1 - share) * SIXS["environment_reflectance"]
    path, diffuse = SIXS["path_reflectance_with_gas"] / SIXS["gas_transmittance"], SIXS["transmittance_up"]
    names = ["transmittance_down", "direct_transmittance_up", "spherical_albedo", "gas_transmittance"]
    down, direct, *rest = (SIXS[name] for name in names)
    terms = TargetTerms(path, down, direct, diffuse - direct, *rest)
    toa = inhomogeneous_reflectance(SIXS["target_reflectance"], around, terms)
    np.testing.assert_allclose(toa, SIXS["toa_reflectance"], rtol=0, atol=3e-4)


def test_weights_of_the_plane_sum_to_one():
    """Weights beyond 400 km are missing: e^-32 for molecules. Without scattering, all weight is on the target."""
    weights = adjacency.point_spread((400, 400), (1000.0, 1000.0), 0.0, 1.0, 0.0)
    whole = 4 * weights.sum() - 2 * weights[0].sum() - 2 * weights[:, 0].sum() + weights[0, 0]
    assert whole == pytest.approx(1.0, abs=1e-8)
    assert weights.min() > -1e-17
    np.testing.assert_array_equal(adjacency.point_spread((2, 2), (60, 60), 0.0, 0.0, 0.0), [[1, 0], [0, 0]])
    assert adjacency.environment_weights(0.0, 0.0) == (0.0, 0.0)
