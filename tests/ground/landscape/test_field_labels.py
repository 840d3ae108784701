"""Fields that correlate, on rasters: what they are, where they are the same, and what is refused."""

import cloudpickle
import numpy as np
import pytest
import xarray as xr
from lazy import check_place, in_chunks, no_compute
from scipy import stats

import fifesim
from fifesim.grids import cf
from fifesim.grids import chunks as chunking
from fifesim.ground.landscape.autoregression import response
from fifesim.ground.landscape.covariance import Copula, copula, normal_scores, score_table
from fifesim.ground.landscape.field_labels import copulas, correlated_fields, landscape_fields, of_elevation

ARPS = {"lai": 0.15, "soil": 0.24, "moisture": 0.05}
PAIRS = {("lai", "soil"): -0.4, ("lai", "moisture"): 0.3, ("soil", "moisture"): 0.2}
COVARY = {"elevation": 0.3, "wetness": 0.5, "illumination": -0.2, "soil": -0.4}


@pytest.fixture(scope="module")
def grid():
    return fifesim.fife_site(30 / 9, window=((300, 900), (1000, 1600)))


@pytest.fixture(scope="module")
def fields(grid):
    return correlated_fields(grid, ARPS, PAIRS, seed=7)


@pytest.fixture(scope="module")
def hills(grid):
    return fifesim.flint_hills(grid, seed=7)


@pytest.fixture(scope="module")
def ground(hills):
    return of_elevation(hills, ["elevation", "wetness", "illumination"])


@pytest.fixture(scope="module")
def following(grid, ground):
    return landscape_fields(grid, {"lai": 0.15, "soil": 0.24}, COVARY, seed=7, covariates=ground)


def standard_error(one, other, cells):
    """
    Of the correlation of two fields over so many cells, at most.

    Bartlett's: (sum over lags of their autocorrelations' product, and of the squared cross-correlation) / cells.
    """
    u = 2 * np.pi * np.arange(512) / 512
    spectra = [response(arp, u[:, None], u) ** 2 for arp in (one, other)]
    spectra = [each / each.mean() for each in spectra]
    return np.sqrt(2 * np.mean(spectra[0] * spectra[1]) / cells)


def test_fields_correlate_as_asked(fields):
    for (one, other), asked in PAIRS.items():
        r = np.corrcoef(fields[one].values.ravel(), fields[other].values.ravel())[0, 1]
        assert r == pytest.approx(asked, abs=4 * standard_error(ARPS[one], ARPS[other], 600**2)), (one, other)


def test_a_name_has_the_same_field_beside_any_others(grid, fields):
    alone = correlated_fields(grid, {"sand": 0.1, "moisture": 0.05}, seed=7)
    beside = correlated_fields(grid, {"moisture": 0.05, "lai": 0.1}, seed=7)
    np.testing.assert_array_equal(alone["moisture"], beside["moisture"])
    assert abs(np.corrcoef(alone["sand"].values.ravel(), alone["moisture"].values.ravel())[0, 1]) < 0.01


def test_windows_and_chunks_are_slices_of_the_whole(grid, fields):
    part = correlated_fields(grid[100:160, 37:111], ARPS, PAIRS, seed=7)
    with no_compute():
        lazy = correlated_fields(grid, ARPS, PAIRS, seed=7, chunks={"y": 211, "x": 397})
    for name, whole in fields.items():
        np.testing.assert_array_equal(part[name], whole[100:160, 37:111])
        assert lazy[name].chunks is not None
        xr.testing.assert_identical(lazy[name].compute(), whole)


def test_labels_say_how_they_were_made(grid, fields):
    for name, field in fields.items():
        assert field.name == name and cf.attributes("normal_score").items() <= field.attrs.items()
        assert field.attrs["arp"] == ARPS[name] and field.attrs["rng_seed"] == "7"
        assert f"{name}, arp {ARPS[name]:g}" in field.attrs["history"]
        check_place(field, grid.crs)
    assert "lai-soil -0.4" in fields["soil"].attrs["history"]


def test_leaf_area_follows_the_ground(ground, following):
    """Hills vary over kilometres: the noise is what is left to chance, and it has an independent cell in some 100."""
    lai = following["lai"].values.ravel()
    for name, asked in COVARY.items():
        if name == "soil":
            other = following["soil"].values.ravel()
        else:
            other = normal_scores(ground[name].values.ravel(), score_table(ground[name].values.ravel()))
        assert np.corrcoef(lai, other)[0, 1] == pytest.approx(asked, abs=0.02), name
    assert stats.kstest(lai[::97], "norm").pvalue > 0.01


def test_lazy_ground_makes_lazy_fields_of_the_same_bits(grid, ground, following):
    chunks = {"y": 250, "x": 333}
    with no_compute():
        lazy = landscape_fields(
            grid, {"lai": 0.15, "soil": 0.24}, COVARY, seed=7,
            covariates={name: in_chunks(raster, chunks) for name, raster in ground.items()},
        )  # fmt: skip
    for name, field in lazy.items():
        xr.testing.assert_identical(field.compute(), following[name])


def test_one_lazy_property_beside_others_in_memory(grid, ground):
    asked = {"elevation": 0.3, "wetness": 0.4}
    expected = landscape_fields(grid, {"lai": 0.15}, asked, seed=7, covariates=ground)["lai"]
    mixed = ground | {"elevation": in_chunks(ground["elevation"], {"y": 250, "x": 333})}
    found = landscape_fields(grid, {"lai": 0.15}, asked, seed=7, covariates=mixed)["lai"]
    assert found.chunks is not None
    xr.testing.assert_identical(found.compute(), expected)


def test_kernels_hold_no_rasters(grid, ground, monkeypatch):
    """What they hold is read through when they are named, and goes with them into each worker."""
    kernels, made = [], chunking.pointwise
    monkeypatch.setattr(chunking, "pointwise", lambda kernel, *a, **k: kernels.append(kernel) or made(kernel, *a, **k))
    lazy = {"elevation": in_chunks(ground["elevation"], {"y": 250, "x": 333})}
    landscape_fields(grid, {"lai": 0.15}, {"elevation": 0.3}, seed=7, covariates=lazy)
    assert len(cloudpickle.dumps(kernels[-1])) < ground["elevation"].nbytes / 4


def test_window_with_the_reference_of_the_whole_is_a_slice(grid, ground, following):
    window = (slice(200, 300), slice(50, 222))
    part = landscape_fields(
        grid[window], {"lai": 0.15, "soil": 0.24}, COVARY, seed=7, reference=ground,
        covariates={name: raster[window] for name, raster in ground.items()},
    )  # fmt: skip
    for name, whole in following.items():
        np.testing.assert_array_equal(part[name], whole[window])


def test_elevation_is_asked_what_it_tells(grid, hills, following):
    from_hills = landscape_fields(grid, {"lai": 0.15, "soil": 0.24}, COVARY, seed=7, dem=hills)
    xr.testing.assert_identical(from_hills["lai"], following["lai"])
    with pytest.raises(ValueError, match=r"covary names elevation, .* give dem="):
        landscape_fields(grid, {"lai": 0.15}, {"elevation": 0.3})
    with pytest.raises(ValueError, match="rain cannot be computed from an elevation model"):
        of_elevation(hills, ["rain"])


def test_missing_ground_is_missing_by_cell(grid, ground):
    hole = ground["elevation"].copy(deep=True)
    hole[3, 4] = np.nan
    found = landscape_fields(grid, {"lai": 0.1, "soil": 0.1}, {"elevation": 0.5}, covariates={"elevation": hole})
    assert int(np.isnan(found["lai"]).sum()) == 1 and np.isnan(found["lai"][3, 4])
    assert not np.isnan(found["soil"]).any()


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        (({"lai": 0.3},), ValueError, "arp must be in"),
        (({"lai": "coarse"},), TypeError, "arps must be a number for each field"),
        (({"lai": 0.1}, {("lai", "soil"): 0.1}), ValueError, "name 'soil'"),
        (({"lai": 0.1, "soil": 0.1}, {("lai", "soil"): 2}), ValueError, r"\[-1, 1\], got 2"),
        (([0.1],), TypeError, "arps must be a mapping"),
    ],
)
def test_what_cannot_be_is_one_line(grid, arguments, kind, message):
    with pytest.raises(kind, match=message):
        fifesim.correlated_fields(grid, *arguments)


def test_ground_elsewhere_is_refused_and_lazy_impossible_correlations_when_they_compute(grid, ground):
    moved = ground["elevation"].assign_coords(x=ground["elevation"]["x"] + 9)
    with pytest.raises(ValueError, match="elevation lies on another grid"):
        landscape_fields(grid, {"lai": 0.1}, {"elevation": 0.3}, covariates={"elevation": moved})
    with pytest.raises(ValueError, match="reference has no 'elevation'"):
        landscape_fields(grid, {"lai": 0.1}, {"elevation": 0.3}, covariates=ground, reference={})
    asked = {"elevation": 0.95, "wetness": 0.95}
    with pytest.raises(ValueError, match="lai cannot follow all of elevation, wetness"):
        landscape_fields(grid, {"lai": 0.1}, asked, covariates=ground)
    lazy = landscape_fields(
        grid, {"lai": 0.1}, asked, covariates={name: in_chunks(each, {"y": 300}) for name, each in ground.items()}
    )
    with pytest.raises(ValueError, match="nearest allowed in their proportion"):
        lazy["lai"].compute()


COARSE = {"soil": 4, "moisture": 3}


@pytest.fixture(scope="module")
def mixed(grid, ground):
    return landscape_fields(
        grid, {"soil": 0.05, "moisture": 0.05, "lai": 0.15}, COVARY, seed=7, coarser=COARSE, covariates=ground
    )


def test_coarser_lattices_give_the_same_bits_in_chunks_and_windows(grid, ground, mixed):
    window = (slice(201, 300), slice(50, 222))
    options = {"arps": {"soil": 0.05, "moisture": 0.05, "lai": 0.15}, "covary": COVARY, "seed": 7, "coarser": COARSE}
    part = landscape_fields(
        grid[window], reference=ground, covariates={n: each[window] for n, each in ground.items()}, **options
    )
    with no_compute():
        lazy = landscape_fields(
            grid, covariates={n: in_chunks(r, {"y": 250, "x": 333}) for n, r in ground.items()}, **options
        )
    for name, whole in mixed.items():
        np.testing.assert_array_equal(part[name], whole[window])
        xr.testing.assert_identical(lazy[name].compute(), whole)


def test_leaf_area_alone_stays_that_of_the_scene(grid):
    """What varies beside it, and how coarsely, is nothing to it."""
    beside = correlated_fields(grid[:80, :80], {"soil": 0.05, "lai": 0.15}, seed=7, coarser={"soil": 4})
    alone = correlated_fields(grid[:80, :80], {"lai": 0.15}, seed=7)
    np.testing.assert_array_equal(beside["lai"], alone["lai"])


def test_unknown_names_of_coarser_lattices_are_refused(grid):
    with pytest.raises(ValueError, match="coarser names sand, there are 'lai'"):
        correlated_fields(grid, {"lai": 0.15}, coarser={"sand": 4})


FOUR_ARPS = {"soil": 0.05, "moisture": 0.1, "lai": 0.15, "brown": 0.2}
OF_GROUND = {("lai", "elevation"): 0.3, ("lai", "soil"): -0.3, ("soil", "moisture"): -0.5, ("brown", "lai"): 0.2}


@pytest.fixture(scope="module")
def coarse_hills():
    return {"elevation": fifesim.flint_hills(fifesim.fife_site(10, window=((0, 60), (0, 70))), seed=7)}


@pytest.mark.parametrize("coarser", [(), ("soil",), ("soil", "moisture")], ids=str)
def test_fields_before_the_first_that_follows_the_ground_do_not_wait_for_it(coarse_hills, coarser):
    """And are put together as with it."""
    whole = copula(FOUR_ARPS, OF_GROUND, {"elevation": coarse_hills["elevation"].values.ravel()}, coarser)
    with no_compute():
        lazy = {name: in_chunks(each, {"y": 40, "x": 33}) for name, each in coarse_hills.items()}
        found = copulas(FOUR_ARPS, OF_GROUND, lazy, None, coarser)
    for name in ("soil", "moisture"):
        assert isinstance(found[name], Copula)
        assert found[name].noise[name] == whole.noise[name]
        assert found[name].coarse.get(name) == whole.coarse.get(name)
    for name in ("lai", "brown"):
        assert found[name].chunks == () and found[name].values.item().noise == whole.noise
