"""Tests of correlated fields on rasters: correlations, same bits in windows and chunks, labels, and errors."""

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


ONE_LATTICE = {"arps": {"lai": 0.15, "soil": 0.24}, "covary": COVARY, "seed": 7}
COARSER = {"arps": {"soil": 0.05, "moisture": 0.05, "lai": 0.15}, "coarser": {"soil": 4, "moisture": 3}}


@pytest.fixture(scope="module")
def following(grid, ground):
    return landscape_fields(grid, covariates=ground, **ONE_LATTICE)


def standard_error(one, other, cells):
    """Upper bound of the standard error of a correlation of two fields, by Bartlett's formula."""
    # (sum over lags of the product of autocorrelations and of the squared cross-correlation) / cells
    u = 2 * np.pi * np.arange(512) / 512
    spectra = [response(arp, u[:, None], u) ** 2 for arp in (one, other)]
    spectra = [each / each.mean() for each in spectra]
    return np.sqrt(2 * np.mean(spectra[0] * spectra[1]) / cells)


def test_fields_have_the_given_correlations(fields):
    for (one, other), requested in PAIRS.items():
        r = np.corrcoef(fields[one].values.ravel(), fields[other].values.ravel())[0, 1]
        assert r == pytest.approx(requested, abs=4 * standard_error(ARPS[one], ARPS[other], 600**2)), (one, other)


def test_fields_on_coarser_lattices_have_the_given_correlations(grid):
    """With six seeds, correlations differed by at most 0.02 and standard deviations by at most 0.021."""
    requested = {("lai", "soil"): -0.7, ("lai", "moisture"): 0.5, ("soil", "moisture"): -0.3}
    found = correlated_fields(grid, correlations=requested, seed=7, **COARSER)
    for (one, other), r in requested.items():
        assert np.corrcoef(found[one].values.ravel(), found[other].values.ravel())[0, 1] == pytest.approx(r, abs=0.04)
    assert [float(each.std()) for each in found.values()] == pytest.approx([1, 1, 1], abs=0.03)


def test_field_of_a_name_does_not_depend_on_other_fields(grid):
    """Nor on the lattice of other fields."""
    first = correlated_fields(grid, {"sand": 0.1, "moisture": 0.05}, seed=7)
    second = correlated_fields(grid, {"moisture": 0.05, "lai": 0.1}, seed=7)
    third = correlated_fields(grid, {"soil": 0.05, "moisture": 0.05}, seed=7, coarser={"soil": 4})
    np.testing.assert_array_equal(first["moisture"], second["moisture"])
    np.testing.assert_array_equal(first["moisture"], third["moisture"])
    assert abs(np.corrcoef(first["sand"].values.ravel(), first["moisture"].values.ravel())[0, 1]) < 0.01


def test_correlated_fields_have_the_same_bits_in_windows_and_chunks(grid, fields):
    part = correlated_fields(grid[100:160, 37:111], ARPS, PAIRS, seed=7)
    with no_compute():
        lazy = correlated_fields(grid, ARPS, PAIRS, seed=7, chunks={"y": 211, "x": 397})
    for name, whole in fields.items():
        np.testing.assert_array_equal(part[name], whole[100:160, 37:111])
        assert lazy[name].chunks is not None
        xr.testing.assert_identical(lazy[name].compute(), whole)


def test_labels_and_history_of_fields(grid, fields):
    for name, field in fields.items():
        assert field.name == name and cf.attributes("normal_score").items() <= field.attrs.items()
        assert field.attrs["arp"] == ARPS[name] and field.attrs["rng_seed"] == "7"
        assert f"{name}, arp {ARPS[name]:g}" in field.attrs["history"]
        check_place(field, grid.crs)
    assert "lai-soil -0.4" in fields["soil"].attrs["history"]


def test_leaf_area_has_the_given_correlations_with_the_ground(ground, following):
    """Hills vary over kilometres, so only the noise has a sampling error; about every 100th cell is independent."""
    lai = following["lai"].values.ravel()
    for name, requested in COVARY.items():
        if name == "soil":
            other = following["soil"].values.ravel()
        else:
            other = normal_scores(ground[name].values.ravel(), score_table(ground[name].values.ravel()))
        assert np.corrcoef(lai, other)[0, 1] == pytest.approx(requested, abs=0.02), name
    assert stats.kstest(lai[::97], "norm").pvalue > 0.01


@pytest.mark.parametrize("options", [ONE_LATTICE, ONE_LATTICE | COARSER], ids=["one-lattice", "coarser"])
def test_fields_on_ground_have_the_same_bits_in_windows_and_chunks(grid, ground, options):
    whole, window = landscape_fields(grid, covariates=ground, **options), (slice(201, 300), slice(50, 222))
    cut = {name: each[window] for name, each in ground.items()}
    part = landscape_fields(grid[window], reference=ground, covariates=cut, **options)
    chunked = {name: in_chunks(each, {"y": 250, "x": 333}) for name, each in ground.items()}
    with no_compute():
        lazy = landscape_fields(grid, covariates=chunked, **options)
    for name, field in whole.items():
        np.testing.assert_array_equal(part[name], field[window])
        xr.testing.assert_identical(lazy[name].compute(), field)


def test_one_lazy_covariate_makes_the_field_lazy(grid, ground):
    requested = {"elevation": 0.3, "wetness": 0.4}
    expected = landscape_fields(grid, {"lai": 0.15}, requested, seed=7, covariates=ground)["lai"]
    mixed = ground | {"elevation": in_chunks(ground["elevation"], {"y": 250, "x": 333})}
    found = landscape_fields(grid, {"lai": 0.15}, requested, seed=7, covariates=mixed)["lai"]
    assert found.chunks is not None
    xr.testing.assert_identical(found.compute(), expected)


def test_kernels_hold_no_rasters(grid, ground, monkeypatch):
    """dask would hash and pickle rasters in the closure of a kernel."""
    kernels, made = [], chunking.pointwise
    monkeypatch.setattr(chunking, "pointwise", lambda kernel, *a, **k: kernels.append(kernel) or made(kernel, *a, **k))
    lazy = {"elevation": in_chunks(ground["elevation"], {"y": 250, "x": 333})}
    landscape_fields(grid, {"lai": 0.15}, {"elevation": 0.3}, seed=7, covariates=lazy)
    assert len(cloudpickle.dumps(kernels[-1])) < ground["elevation"].nbytes / 4


def test_covariates_are_computed_from_the_elevation(grid, hills, following):
    from_hills = landscape_fields(grid, {"lai": 0.15, "soil": 0.24}, COVARY, seed=7, dem=hills)
    xr.testing.assert_identical(from_hills["lai"], following["lai"])
    with pytest.raises(ValueError, match=r"covary names elevation, .* give dem="):
        landscape_fields(grid, {"lai": 0.15}, {"elevation": 0.3})
    with pytest.raises(ValueError, match="rain cannot be computed from an elevation model"):
        of_elevation(hills, ["rain"])


def test_nan_in_a_covariate_is_nan_in_the_fields_that_follow_it(grid, ground):
    hole = ground["elevation"].copy(deep=True)
    hole[3, 4] = np.nan
    found = landscape_fields(grid, {"lai": 0.1, "soil": 0.1}, {"elevation": 0.5}, covariates={"elevation": hole})
    assert int(np.isnan(found["lai"]).sum()) == 1 and np.isnan(found["lai"][3, 4])
    assert not np.isnan(found["soil"]).any()


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        ({"arps": {"lai": 0.3}}, ValueError, "arp must be in"),
        ({"arps": {"lai": "coarse"}}, TypeError, "arps must be a number for each field"),
        ({"arps": {"lai": 0.1, "soil": 0.1}, "correlations": {("lai", "soil"): 2}}, ValueError, r"\[-1, 1\], got 2"),
        ({"arps": {"lai": 0.15}, "coarser": {"sand": 4}}, ValueError, "coarser names sand, there are 'lai'"),
    ],
)
def test_impossible_fields_are_refused(grid, arguments, kind, message):
    with pytest.raises(kind, match=message):
        fifesim.ground.correlated_fields(grid, **arguments)


def test_impossible_covariates_are_refused(grid, ground):
    """Impossible correlations with a lazy ground raise when computed."""
    moved = ground["elevation"].assign_coords(x=ground["elevation"]["x"] + 9)
    with pytest.raises(ValueError, match="elevation lies on another grid"):
        landscape_fields(grid, {"lai": 0.1}, {"elevation": 0.3}, covariates={"elevation": moved})
    with pytest.raises(ValueError, match="reference has no 'elevation'"):
        landscape_fields(grid, {"lai": 0.1}, {"elevation": 0.3}, covariates=ground, reference={})
    requested = {"elevation": 0.95, "wetness": 0.95}
    with pytest.raises(ValueError, match="lai cannot follow all of elevation, wetness"):
        landscape_fields(grid, {"lai": 0.1}, requested, covariates=ground)
    chunked = {name: in_chunks(each, {"y": 300}) for name, each in ground.items()}
    lazy = landscape_fields(grid, {"lai": 0.1}, requested, covariates=chunked)
    with pytest.raises(ValueError, match="nearest allowed in their proportion"):
        lazy["lai"].compute()


FOUR_ARPS = {"soil": 0.05, "moisture": 0.1, "lai": 0.15, "brown": 0.2}
OF_GROUND = {("lai", "elevation"): 0.3, ("lai", "soil"): -0.3, ("soil", "moisture"): -0.5, ("brown", "lai"): 0.2}


@pytest.fixture(scope="module")
def coarse_hills():
    return {"elevation": fifesim.flint_hills(fifesim.fife_site(10, window=((0, 60), (0, 70))), seed=7)}


@pytest.mark.parametrize("coarser", [(), ("soil",), ("soil", "moisture")], ids=str)
def test_copulas_of_fields_that_do_not_follow_the_ground_are_not_lazy(coarse_hills, coarser):
    """Their weights equal the weights computed with the ground."""
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
