"""Training on a study, and retrieval from images: intervals, flags, files and error messages."""

import hashlib
import re
import tomllib
import warnings
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import fifesim
from fifesim.chain.driver import Driver
from fifesim.retrieval import inversion, labels, methods, training
from fifesim.scenario.ensemble import uniform_reflectance
from fifesim.scenario.simulation import setup_of
from tests.lazy import CHUNKS, ODD_CHUNKS, in_chunks, no_compute

CHIP = fifesim.Scenario(
    grid={"width": 150, "height": 150},
    ground={"arp": 0.15},
    terrain={"dem": "flat"},
    sensor={"instrument": "MSI", "bands": ["MSI3", "MSI4", "MSI8"]},
)
SURFACE = "surface_bidirectional_reflectance"
SL2P_BANDS = [f"MSI{name}" for name in ("3", "4", "5", "6", "7", "8A", "11", "12")]
STUDY = fifesim.Study(
    CHIP,
    {"visibility": {"uniform": [20, 60]}, "soil": {"normal": [0, 0.02], "within": [-0.1, 0.1]}},
    landscapes=24,
    split={"train": 0.5, "validation": 0.25, "test": 0.25},
)


# The parts validation and test have six landscapes each.
pytestmark = pytest.mark.filterwarnings("ignore:the chips are of few landscapes")


@pytest.fixture(scope="module")
def chips():
    return training.made(STUDY, 96)


@pytest.fixture(scope="module")
def trained(chips):
    """Function that returns the retrieval of a method, trained once."""
    return cache(lambda method: fifesim.train(chips, method))


@pytest.fixture(scope="module", params=["line", "lookup", "quantiles", "optimal-estimation"])
def retrieval(request, trained):
    return trained(request.param)


@pytest.fixture(scope="module")
def image():
    return fifesim.simulate(CHIP.replace(width=180, height=150, **{"ground.seed": 1234}))


@pytest.fixture(scope="module")
def light(image):
    """Reflectance at the top of the atmosphere; tests must not change it."""
    return image["image"]["dn"].fifesim.to_reflectance().compute()


def test_each_half_of_an_interval_is_compared_with_the_errors_on_its_side():
    """Errors of -2 and 0.8 are 2 and 0.2 times the halves of 1 and 4."""
    truth, none = np.array([[-2.0], [0.8]]), np.zeros((2, 1))
    estimates = methods.Estimates(none, none, np.tile([-1.0, 4.0], (2, 1, 1)))
    for level, factor in ((0.4, 0.2), (0.9, 2.0)):
        assert methods.stretch_factors(estimates, truth, np.arange(2), [level]) == pytest.approx(factor)


def test_intervals_have_their_coverage_on_unseen_landscapes(retrieval):
    """The test part has 6 landscapes, so that coverage has a standard error of a few percent."""
    score = retrieval.score
    assert float(score.rmse.sel(quantity="lai")) < 0.25
    assert (np.abs(score.slope - 1) < 0.1).all(), "an estimate that shrinks twice has a slope of 1.3"
    for level in (0.5, 0.8, 0.95):
        found = score.sel(quantity="lai", level=level)
        assert abs(float(found.coverage) - level) < 0.05 + 3 * float(found.coverage_se)


def test_retrieved_map_is_near_the_truth_and_on_its_grid(retrieval, image, light):
    found, truth = light.fifesim.retrieve(retrieval), image["truth"]["lai"]
    assert float(fifesim.score(found, truth).rmse) < 0.25
    assert found.rio.crs == truth.rio.crs and np.array_equal(found.x, truth.x)
    inside = found.where(found.flag >= 0)
    assert bool((inside.lai_low <= inside.lai_high).where(inside.lai.notnull(), True).all())
    assert bool((inside.lai_low.diff("level") <= 0).where(inside.lai.notnull(), True).all())
    if retrieval.method == "line":
        # The intervals are normal where the lower end is not clipped.
        width = (found.lai_high - found.lai_low).sel(level=0.8).where(found.lai_low.sel(level=0.8) > 0)
        np.testing.assert_allclose(width / (2 * 1.28155 * found.lai_sd), np.where(width > 0, 1, np.nan), rtol=0.01)
    assert found.flag.dtype == np.int8
    missing = light.isnull().any("band")
    assert np.array_equal(found.flag.values == -1, missing.values) and np.array_equal(found.lai.isnull(), missing)


def test_retrieve_is_lazy_and_the_same_in_any_chunks(retrieval, light, monkeypatch):
    """Batches of pixels agree to single precision."""
    light = light.copy()
    light.attrs.pop("_FillValue", None)
    whole = light.fifesim.retrieve(retrieval)
    for chunks in (CHUNKS, ODD_CHUNKS | {"band": 1}):
        with no_compute():
            lazy = in_chunks(light, chunks).fifesim.retrieve(retrieval)
        xr.testing.assert_identical(lazy.compute(), whole)
    monkeypatch.setattr(labels, "_BATCH", 100)
    xr.testing.assert_allclose(light.fifesim.retrieve(retrieval), whole, rtol=1e-6, atol=1e-6)


def test_training_is_reproducible_to_the_bit(chips):
    chips = chips.isel(chip=slice(24))
    one, two = (fifesim.train(chips, "quantiles", seed=3) for _ in range(2))
    assert all(np.array_equal(one.tables[name], two.tables[name]) for name in one.tables)
    other = fifesim.train(chips, "quantiles", seed=4)
    assert not np.array_equal(one.tables["weight0"], other.tables["weight0"])


def test_retrieval_is_restored_from_its_file(retrieval, light, tmp_path):
    retrieval.to_netcdf(tmp_path / "mine.nc")
    again = fifesim.retrieval.read_retrieval(tmp_path / "mine.nc")
    other = retrieval.tables | {"stretch": np.full((2, 3), 2.0)}
    assert again == retrieval and again != replace(retrieval, tables=other)
    assert light.fifesim.retrieve(again).identical(light.fifesim.retrieve(retrieval))
    assert [path.name for path in tmp_path.iterdir()] == ["mine.nc"]


def test_spectra_outside_the_training_are_flagged(retrieval, light):
    water = light.copy(data=np.broadcast_to(np.array([0.03, 0.02, 0.01])[:, None, None], light.shape).copy())
    assert (water.fifesim.retrieve(retrieval).flag.values & 1).all()
    assert float((light.fifesim.retrieve(retrieval).flag > 0).mean()) < 0.1
    # Dense grass is brighter in the near infrared and darker in the red than all training pixels.
    dense = light.where(light.band == "MSI8", 0.04).where(light.band != "MSI8", 0.42)
    assert (dense.fifesim.retrieve(retrieval).flag.values[1:-1, 1:-1] > 0).all()


def test_quantiles_of_a_network_are_sorted_and_give_the_standard_deviation():
    """A normal distribution of standard deviation 3 has the interval whose level is nearest to 68 %."""
    levels, normal = (0.5, 0.8, 0.95), stats.norm.ppf([0.025, 0.1, 0.25, 0.5, 0.75, 0.9, 0.975])
    outputs = normal * [2, 1, 1.5, 1, 1.5, 1, 2]
    tables = {"weight0": np.zeros((5, 7)), "bias0": outputs[::-1], "input_mean": 0.0, "input_spread": 1.0}
    tables |= {"centre": np.array([2.0]), "scale": np.array([3.0])}
    found = methods.by_quantiles(tables, np.full((4, 2), 0.2), np.zeros((4, 3)), levels)
    np.testing.assert_allclose(found.quantiles, np.full((4, 1, 7), 2 + 3 * outputs))
    np.testing.assert_allclose(methods.probabilities_of((0.5, 0.8)), [0.1, 0.25, 0.5, 0.75, 0.9])
    np.testing.assert_allclose(np.stack([found.median, found.sd], axis=-1), np.full((4, 1, 2), (2.0, 3.0)))
    assert methods.ends_of(found.quantiles, levels, 0.8)[0][0, 0] == pytest.approx(2 + 3 * normal[1])


def test_stretch_factors_weight_landscapes_equally():
    """Intervals are too narrow in one landscape and too wide in the other; the first has ten times the pixels."""
    rng = np.random.default_rng(0)
    landscape = np.repeat([0, 1], [10_000, 1000])
    truth = rng.normal(size=(11_000, 1)) * np.where(landscape == 0, 3.0, 0.5)[:, None]
    z = np.array([-1.2816, 0, 1.2816])
    estimates = methods.Estimates(np.zeros((11_000, 1)), np.ones((11_000, 1)), np.tile(z, (11_000, 1, 1)))
    factor = methods.stretch_factors(estimates, truth, landscape, (0.8,))[0, 0]
    inside = np.abs(truth[:, 0]) <= factor * 1.2816
    assert (inside[landscape == 0].mean() + inside[landscape == 1].mean()) / 2 == pytest.approx(0.8, abs=0.002)
    assert inside.mean() < 0.7


@pytest.mark.parametrize("chips", [40, 400])
def test_lookup_estimates_the_error_covariance_within_chips(chips):
    rng = np.random.default_rng(1)
    chip = np.repeat(np.arange(chips), 4000 // chips)
    lai = rng.uniform(0, 4, 4000)
    error = rng.multivariate_normal([0, 0], [[4e-4, 3e-4], [3e-4, 9e-4]], 4000)
    light = np.stack([0.1 - 0.01 * lai, 0.2 + 0.05 * lai - 0.004 * lai**2], axis=1) + error
    light += rng.normal(0, 0.1, (chips, 2))[chip]
    pixels = methods.TrainingPixels(light, np.zeros((4000, 3)), lai[:, None], chip, chip)
    scale = methods.fit_lookup(pixels, (0.5,), 0)["scale"]
    assert np.linalg.inv(scale @ scale.T) == pytest.approx(np.array([[4e-4, 3e-4], [3e-4, 9e-4]]), rel=0.06)


def test_table_of_optimal_estimation_agrees_with_the_chain(chips):
    """Compared with the chain at states between the nodes, and with central differences."""
    tables = fifesim.train(chips, "optimal-estimation", quantities=["lai", "fpar"]).tables
    axes, rng, names = methods._axes(tables), np.random.default_rng(5), methods._names(tables)
    assert names == ["lai", "soil", "log_aot"]
    study, nodes = training.study_of(chips, "test"), dict(zip(names, axes, strict=True))
    light, values = inversion.simulated_tables(study, "toa", ("MSI4", "MSI8"), ("lai", "fpar"), nodes, (28.5, 0, 0))
    states = axes[:, 0] + rng.uniform(0, 1, (20, 3)) * (axes[:, 1] - axes[:, 0])
    found, slopes = inversion.interpolated(light, axes, states, np.empty((20, 0)))
    quantities, _ = inversion.interpolated(values, axes, states, np.empty((20, 0)))
    for state, spectrum, quantity in zip(states, found, quantities, strict=True):
        geometry = {"sza": 28.5, "saa": 0.0, "vza": 0.0, "vaa": 0.0}
        driver = Driver(setup_of(CHIP.replace(soil=state[1], visibility=None, aot=np.exp(state[2]), **geometry)))
        lai = state[:1, None]
        assert spectrum == pytest.approx(driver.toa(driver.reflectance(lai))[1:, 0, 0], abs=2e-4)
        assert quantity == pytest.approx([state[0], driver.fpar(lai, 0.94).item()], abs=1e-6)
    for at in range(3):
        step = 1e-5 * np.eye(3)[at]
        ends = [inversion.interpolated(light, axes, states + side * step, np.empty((20, 0)))[0] for side in (1, -1)]
        assert slopes[:, :, at] == pytest.approx((ends[0] - ends[1]) / 2e-5, abs=1e-7)


def test_table_of_varying_angles_agrees_with_the_chain(chips):
    """
    Between the nodes of sun and relative azimuth; the view zenith is the same in all chips.

    Five nodes in azimuth and four in sun zenith interpolate to 0.2 %.
    """
    study, axes = training.study_of(chips, "test"), {"lai": (0.0, 4.0), "sza": (20.0, 40.0), "raa": (0.0, 180.0)}
    light, values = inversion.simulated_tables(study, "surface", ("MSI4", "MSI8"), ("lai",), axes, (30.0, 10.0, 50.0))
    rng, ends = np.random.default_rng(5), np.array(list(axes.values()))
    places = rng.uniform(*ends.T, (10, 3))
    found = inversion.interpolated(light, ends, places[:, :1], places[:, 1:])[0]
    for spectrum, (lai, sza, raa) in zip(found, places, strict=True):
        scenario = CHIP.replace(sza=sza, saa=0.0, vza=10.0, vaa=raa)
        assert spectrum == pytest.approx(Driver(setup_of(scenario)).reflectance(np.array([[lai]]))[1:, 0, 0], rel=4e-3)
    assert inversion.interpolated(values, ends, places[:, :1], places[:, 1:])[0][:, 0] == pytest.approx(places[:, 0])


def test_remainder_and_spread_of_optimal_estimation_agree_with_the_posterior_of_normal_distributions(monkeypatch):
    """
    Two unknowns and two quantities: the first state itself, and one with a remainder that follows state and error.

    The error of the measurements is anticorrelated with the state, and the tables have rounding errors only.
    """
    rng, count = np.random.default_rng(8), 40_000
    states = rng.normal([1.0, 0.0], [0.2, 0.1], (count, 2))
    slope, error = np.array([[-0.1, 0.4], [0.3, 0.5], [0.1, -0.2]]), rng.normal(0, 0.03, (count, 3))
    light = states @ slope.T + error - 0.3 * (states[:, :1] - 1) * slope[:, 0]
    other = 0.1 + 0.5 * states[:, 0] + 0.3 * states[:, 1] + 0.7 * error[:, 0] + rng.normal(0, 0.02, count)
    truth = np.column_stack([states, states[:, 0], other])

    def tables_of(study, level, bands, quantities, axes, angles):
        # Chebyshev coefficients of linear functions.
        half = [(high - low) / 2 for low, high in axes.values()]
        light, values = np.zeros((2, 2, 3)), np.zeros((2, 2, 2))
        middle = np.array([sum(ends) / 2 for ends in axes.values()])
        light[0, 0], light[1, 0], light[0, 1] = slope @ middle, half[0] * slope[:, 0], half[1] * slope[:, 1]
        values[0, 0], values[1, 0] = [middle[0], 0.5 * middle[0]], [half[0], 0.5 * half[0]]
        return light, values

    monkeypatch.setattr(methods, "simulated_tables", tables_of)
    none = np.zeros(count, int)
    pixels = methods.TrainingPixels(light, np.zeros((count, 3)), truth, none, none)
    tables = methods.fit_optimal_estimation(pixels, None, ("lai", "soil"), "toa", "abc", ("lai", "fpar"))
    found = methods.by_optimal_estimation(tables, light, pixels.angles, (0.5, 0.95))
    wanted, own = truth[:, 2:], light - light.mean(0)
    best = wanted.mean(0) + own @ np.linalg.lstsq(own, wanted - wanted.mean(0), rcond=None)[0]
    rmse = np.sqrt(((wanted - best) ** 2).mean(0))
    # The offsets of the deciles are noise here, of 1 / sqrt(2000) of the error.
    assert (np.sqrt(((found.median - best) ** 2).mean(0)) < 0.04 * rmse).all()
    for kind in range(2):
        for part in np.array_split(np.argsort(found.median[:, kind]), 10):
            rest = (wanted - found.median)[part, kind]
            assert abs(rest.mean()) < 0.06 * rmse[kind]
            assert np.sqrt((rest**2).mean()) == pytest.approx(found.sd[part, kind].mean(), rel=0.04)


def test_diagnostics_of_optimal_estimation(chips, trained, light, monkeypatch):
    retrieval = trained("optimal-estimation")
    found = light.fifesim.retrieve(retrieval).compute()
    kernels = [found[f"averaging_kernel_{name}"] for name in ("lai", "soil", "log_aot")]
    assert np.allclose(sum(kernels), found.degrees_of_freedom, atol=1e-5, equal_nan=True)
    assert float(found.degrees_of_freedom.max()) < 3 and float(found.averaging_kernel_lai.min()) > 0.5
    # The expected misfit is the number of bands, minus a part because blur and registration errors depend on LAI.
    spectra = chips.toa_reflectance.transpose("chip", "y", "x", "band").values.reshape(-1, 3).astype(float)
    estimates = retrieval.estimate(spectra, np.tile([28.5, 0.0, 0.0], (len(spectra), 1)))
    assert 1.5 < estimates.diagnostics[1].mean() < 3.2
    assert not bool((found.flag & 4).where(found.flag >= 0, 0).any())
    monkeypatch.setattr(methods, "optimal_estimation", partial(methods.optimal_estimation, iterations=0))
    hasty = light.fifesim.retrieve(retrieval)
    assert bool((hasty.flag & 4).where(hasty.flag >= 0, 4).all())


def test_uniform_ground_is_corrected_exactly(chips):
    """Expected values from SAIL for each pixel, without the table of leaf area."""
    scenario = next(training._scenarios(chips, "test"))
    lai = np.linspace(0.1, 3, 900).reshape(30, 30)
    toa = uniform_reflectance(scenario, {"lai": lai})
    setup = setup_of(scenario)
    expected = fifesim.ground.canopy_spectra(
        {"lai": lai.ravel()}, "MSI", bands=setup.bands, canopy=setup.canopy, geometry=setup.geometry,
        atmosphere=setup.atmosphere,
    )  # fmt: skip
    np.testing.assert_allclose(Driver(setup).corrected(toa).reshape(3, -1).T, expected.reflectance, rtol=0, atol=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["quantiles", "optimal-estimation"])
def test_training_at_the_surface_or_on_uniform_ground_is_as_accurate(chips, trained, image, light, method):
    """The RMSE of these retrievals is at most 1.5 times the RMSE at the top of the atmosphere."""
    trainings = (fifesim.train(chips, method, level="surface", pixels=pixels) for pixels in ("chain", "uniform"))
    cases = [(trained(method), light), *((each, light.fifesim.to_surface()) for each in trainings)]
    rmse = []
    for retrieval, own in cases:
        rmse.append(float(fifesim.score(own.fifesim.retrieve(retrieval), image["truth"]["lai"]).rmse))
        assert abs(float(retrieval.score.coverage.sel(quantity="lai", level=0.8)) - 0.8) < 0.15
    assert max(rmse) < 1.5 * rmse[0]


def test_sl2p_maps_sentinel_2_reflectance(image):
    spectrum = [0.058, 0.0079, 0.0936, 0.2585, 0.2825, 0.3087, 0.1708, 0.0698]
    grid = image["truth"]["lai"].isel(x=slice(2), y=slice(3)).compute()
    light = (grid * 0 + xr.DataArray(spectrum, dims="band", coords={"band": SL2P_BANDS})).transpose("band", "y", "x")
    light = light.assign_coords(
        sza=np.degrees(np.arccos(0.40581)), vza=np.degrees(np.arccos(0.98434)), saa=10.0,
        vaa=10.0 + np.degrees(np.arccos(-0.55142)),
    )  # fmt: skip
    light.attrs["standard_name"] = SURFACE
    light[:, 0, 0] = np.nan
    found = light.fifesim.retrieve("sl2p")
    assert list(found.data_vars) == ["lai", "fpar", "fcover", "flag"]
    assert found.lai.values[1, 1] == pytest.approx(1.49, abs=0.01)  # the first published case, rounded
    assert np.isnan(found.lai.values[0, 0]) and found.flag.values[0, 0] == -1 and found.flag.values[1, 1] == 0


MISTAKES = tomllib.loads((Path(__file__).parents[1] / "data" / "retrieval_mistakes.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("title", MISTAKES["use"])
def test_unsuitable_images_and_chips_are_rejected(trained, light, chips, title):
    pastures = CHIP.replace(cover="pastures")
    several = fifesim.Study(pastures, {"visibility": {"uniform": [20, 60]}}, landscapes=3).to_toml()
    bare, names = chips.drop_attrs(deep=False), {"np": np, "fifesim": fifesim, "light": light, "line": trained("line")}
    names |= {"bare": bare.assign_attrs(instrument="MSI"), "several": bare.assign_attrs(study=several)}
    with pytest.raises(ValueError) as caught:
        eval(MISTAKES["use"][title]["code"], names)
    assert [word for word in MISTAKES["use"][title]["refused"] if word not in str(caught.value)] == []


@pytest.mark.slow
def test_learned_landscape_is_the_prior(tmp_path):
    konza = fifesim.ground.Landscape.read("konza")
    dense = konza.model_copy(update={"lai": tuple(2 * each for each in konza.lai)})
    dense.save(path := tmp_path / "dense.json")
    retrieval = fifesim.train(STUDY, "line", landscape=path, chips=48, quantities="lai")
    grid = fifesim.grid_at("EPSG:32614", 707600.0, 4331900.0, 3000.0, 3000.0, 10.0)
    mean = float(retrieval.prior.removeprefix("lai mean ").split(",")[0])
    # The standard error of the mean of 12 landscapes of 150 m is 6 %.
    assert mean == pytest.approx(float(dense.simulate(grid, seed=1)["lai"].mean()), rel=0.18)
    assert retrieval.prior.endswith(f"learned from {path}")


def test_corrected_chips_of_many_landscapes_are_trained_at_the_surface_without_a_study(chips):
    """Twice as many chips of the same landscapes do not help against a warning; other landscapes do."""
    with pytest.warns(UserWarning, match=r"few landscapes \(train 12, validation 6, test 6\).*at least 10 landscapes"):
        fifesim.train(chips, "line")
    corrected = chips.assign(surface_reflectance=chips.toa_reflectance)
    corrected.attrs = {"instrument": "MSI"}
    enough = corrected.assign(landscape=("chip", np.arange(chips.sizes["chip"])))
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message="the chips are of few landscapes")
        assert fifesim.train(enough, "line", level="surface").level == "surface"
    with pytest.raises(ValueError, match="is not of uniform ground"):
        fifesim.train(enough, "line", level="surface", pixels="uniform")


@pytest.mark.parametrize("change", [lambda light: light.rename("renamed"), lambda light: light.drop_attrs(deep=False)])
def test_chips_of_a_dataset_are_retrieved_as_reflectance(light, trained, change):
    """The calibration of digital numbers is a coordinate of all variables; standard name or name tell them apart."""
    carries = change(light).assign_coords(gain=("band", [0.5, 0.5, 0.5]), offset=("band", [0.0, 0.0, 0.0]))
    expected = light.fifesim.retrieve(trained("line"))
    np.testing.assert_array_equal(carries.fifesim.retrieve(trained("line")).lai, expected.lai)
    np.testing.assert_array_equal(carries.fifesim.ndvi(), light.fifesim.ndvi())


def test_changed_bytes_of_a_file_are_rejected(tmp_path, trained):
    """Any change of content, checksum or length; netCDF's library does not return from some damaged files."""
    path, random = tmp_path / "mine.nc", np.random.default_rng(5)
    trained("line").to_netcdf(path)
    whole = path.read_bytes()
    places = [*range(len(whole) - 90, len(whole)), *random.integers(0, len(whole), 40).tolist()]
    damaged = [whole[:at] + bytes([whole[at] ^ 1 << int(random.integers(8))]) + whole[at + 1 :] for at in places]
    older = whole.replace(b"retrieval 3 ", b"retrieval 2 ")
    for content in (*damaged, whole[:-1], whole + b"0", whole[: len(whole) // 2], older, b""):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=r"mine.nc.*train it again") as caught:
            fifesim.retrieval.read_retrieval(path)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("title", MISTAKES["file"])
def test_files_with_impossible_content_are_rejected(tmp_path, trained, title):
    changed = eval(MISTAKES["file"][title]["code"], {"np": np, "file": trained("quantiles")._dataset()})
    content = bytes(changed.to_netcdf(engine="netcdf4"))
    seal = f"\nfifesim retrieval 3 {hashlib.sha256(content).hexdigest()}".encode()
    (tmp_path / "mine.nc").write_bytes(content + seal)
    said = re.escape(MISTAKES["file"][title]["refused"])
    with pytest.raises(ValueError, match=rf"mine.nc is not a valid retrieval.*{said}.*train it again"):
        fifesim.retrieval.read_retrieval(tmp_path / "mine.nc")


def test_links_in_the_folder_of_a_file_are_not_followed(tmp_path, trained):
    (tmp_path / "victim").write_text("mine")
    for name in (".r.nc.partial", "r.nc"):
        (tmp_path / name).symlink_to("victim")
    trained("line").to_netcdf(tmp_path / "r.nc")
    assert (tmp_path / "victim").read_text() == "mine" and not (tmp_path / "r.nc").is_symlink()
    assert fifesim.retrieval.read_retrieval(tmp_path / "r.nc") == trained("line")
