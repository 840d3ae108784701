"""Studies draw parameters of chips from distributions, and sweeps compute scenarios along axes."""

import itertools
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from lazy import no_compute
from mistakes import check_message, mistakes
from scipy import stats

import fifesim
from fifesim.grids.sites import on_fife_site
from fifesim.ground import arp_for_length
from fifesim.ground.landscape.autoregression import FIELD_TILE
from fifesim.scenario.chips import chips_of, first_cell_of_chip
from fifesim.scenario.distributions import distribution_of, points
from fifesim.scenario.ground import warn_of_canopy
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.studies import Study, read_study

SHARES = np.linspace(0, 1, 1001)[:-1]

ORACLES = (
    ({"uniform": [0.1, 0.3]}, stats.uniform(0.1, 0.2)),
    ({"log-uniform": [0.1, 0.3]}, stats.loguniform(0.1, 0.3)),
    ({"normal": [0.2, 0.1], "within": [0, 0.5]}, stats.truncnorm(-2, 3, 0.2, 0.1)),
)


def test_draws_follow_their_distribution_within_its_limits():
    """The CDF at a draw equals its probability; for integers it steps across the probability."""
    almost = np.array([0.0, np.nextafter(1, 0)])
    for table, oracle in ORACLES:
        np.testing.assert_allclose(oracle.cdf(distribution_of(table).quantile(SHARES)), SHARES, atol=1e-9)
        lowest, highest = table.get("within") or next(iter(table.values()))
        low, high = distribution_of(table).quantile(almost)
        assert lowest <= low < high <= highest
    whole, oracle = distribution_of({"integers": [3, 7]}), stats.randint(3, 8)
    values = np.array(whole.quantile(SHARES))
    assert (oracle.cdf(values) > SHARES).all() and (oracle.cdf(values - 1) <= SHARES + 1e-12).all()
    assert whole.quantile(almost) == [3, 7]
    drawn = distribution_of({"choice": ["a", "b", "c"], "weights": [1, 0, 3]}).quantile(SHARES)
    assert [drawn.count(each) for each in "abc"] == [250, 0, 750]
    assert distribution_of({"choice": [True, False]}).quantile(SHARES).count(True) == 500


@pytest.mark.parametrize("sequence", ["sobol", "random"])
def test_points_depend_on_seed_and_stream_alone(sequence):
    found = points(sequence, 7, 3, 16, 2)
    assert found.shape == (16, 2) and (found >= 0).all() and (found < 1).all()
    np.testing.assert_array_equal(found, points(sequence, 7, 3, 16, 2))
    assert (found != points(sequence, 8, 3, 16, 2)).any() and (found != points(sequence, 7, 4, 16, 2)).any()
    np.testing.assert_array_equal(found, points(sequence, 7, 3, 500, 2)[:16])


def test_every_stratum_of_a_dimension_has_one_point():
    """The first 2**k points of a Sobol sequence form a net."""
    slices = np.sort(np.floor(points("sobol", 7, 3, 64, 4) * 64), axis=0)
    np.testing.assert_array_equal(slices, np.arange(64)[:, None] * np.ones(4))


GRID = {"width": 180.0, "height": 180.0}

SMALL = {"grid": GRID, "terrain": {"dem": "flat"}}

DRAWS = {"visibility": {"uniform": [10, 60]}}

WHOLE = """
grid = { width = 180, height = "0.18 km" }
terrain.dem = "flat"
dataset = { sequence = "random", seed = 3, landscapes = 4, split = { train = 0.75, test = 0.25 } }

[draw]
visibility = { log-uniform = ["5 km", 60] }
"ground.arp" = { uniform = [0.05, 0.2] }

[draw.ground]
leaf.chlorophyll = { normal = [40, 10], within = [10, 80] }
distribution = { choice = ["burned-grazed", "mine.csv"] }
"""


@pytest.fixture
def path(tmp_path):
    (tmp_path / "mine.csv").write_text("lai\n" + "\n".join(str(0.1 * k) for k in range(1, 9)))
    (tmp_path / "study.toml").write_text(WHOLE)
    return tmp_path / "study.toml"


def test_study_file_lists_the_drawn_parameters(path):
    study = read_study(path)
    assert (study.sequence, study.seed, study.landscapes) == ("random", 3, 4)
    assert study.split == {"train": 0.75, "test": 0.25}
    assert {key.name: one.table for key, one in study.drawn.items()} == {
        "atmosphere.visibility": {"log-uniform": [5.0, 60.0]},
        "ground.arp": {"uniform": [0.05, 0.2]},
        "ground.leaf.chlorophyll": {"normal": [40.0, 10.0], "within": [10.0, 80.0]},
        "ground.distribution": {"choice": ["burned-grazed", str(path.parent / "mine.csv")]},
    }
    # The study that is written and read again is the same.
    again = path.parent / "elsewhere" / "again.toml"
    again.parent.mkdir()
    again.write_text(study.to_toml())
    assert read_study(again) == study and read_study(again).to_toml() == study.to_toml()
    path.write_text(WHOLE.replace("sequence =", "sequnce ="))
    with pytest.raises(ValueError, match=r"unknown key dataset\.sequnce: did you mean 'sequence'"):
        read_study(path)
    page = Path(__file__).parents[2] / "docs" / "howto" / "training_set.md"
    (block,) = re.findall(r"^```toml\n(.*?)^```", page.read_text("utf-8"), re.S | re.M)
    path.write_text(block)
    assert len(read_study(path).drawn) == 7 and read_study(path).landscapes == 50


def test_chips_share_sun_and_atmosphere_of_the_study():
    """The paper's overpass belongs to its site, but chips lie elsewhere."""
    study = Study(parse_scenario(SMALL), DRAWS)
    far = study.scenario_with({("grid", "west"): 600_000.0, ("grid", "north"): 4_200_000.0})
    assert far.sun_and_view() == study.scenario.sun_and_view()
    assert far.model_atmosphere() == study.scenario.model_atmosphere()
    # The angles are stored, so no chip computes the sun position again.
    assert study.values["geometry"]["sza"] == study.scenario.sun_and_view().sza
    dates = Study(parse_scenario(SMALL), {"time": {"choice": ["1987-06-06T16:35Z", "1987-10-06T16:35Z"]}})
    drawn = {("geometry", "time"): "1987-10-06T16:35Z"}
    here = dates.scenario_with(drawn)
    far = dates.scenario_with(drawn | {("grid", "west"): 600_000.0})
    assert here.sun_and_view() == far.sun_and_view() != study.scenario.sun_and_view()
    band = Study(parse_scenario(SMALL), {"ground.background.TM3": {"uniform": [0.05, 0.2]}})
    found = band.scenario_with({("ground", "background", "TM3"): 0.07}).ground.background
    assert found["TM3"] == 0.07 and found["TM4"] == band.scenario.complete().ground.background["TM4"]


def test_every_part_has_its_share_and_at_least_one_landscape():
    parts, halves = {"train": 0.8, "validation": 0.1, "test": 0.1}, {"a": 0.5, "b": 0.5}
    found = ((50, parts, [40, 5, 5]), (3, parts, [1, 1, 1]), (11, parts, [9, 1, 1]), (7, halves, [4, 3]))
    for landscapes, split, quotas in found:
        study = Study(parse_scenario(SMALL), DRAWS, landscapes=landscapes, split=split)
        assert list(study.quotas().values()) == quotas


def make_study(sections=(), **plan):
    arp, grass = {"uniform": [0.05, 0.2]}, {"choice": ["burned-grazed", "burned-ungrazed"]}
    draws = DRAWS | {"ground.arp": arp, "distribution": grass}
    return Study(parse_scenario(SMALL | dict(sections)), draws, **{"landscapes": 8} | plan)


@pytest.fixture(scope="module")
def chips():
    return chips_of(make_study(), 320)


@pytest.mark.parametrize("sequence", ["sobol", "random"])
def test_chips_do_not_depend_on_their_number(sequence):
    few, many = (chips_of(make_study(sequence=sequence), count).table() for count in (13, 200))
    assert few.equals(many.isel(chip=slice(13)))
    other = chips_of(make_study(sequence=sequence, seed=1), 200).table()
    assert (other["atmosphere.visibility"] != many["atmosphere.visibility"]).all()
    assert (other.landscape != many.landscape).any()


def test_each_landscape_has_one_part_one_seed_one_arp_and_the_range_of_chip_parameters(chips):
    """Points of a Sobol sequence that are eight apart lie within an eighth of the first dimension."""
    table = chips.table()
    parts = [set(chips.landscape[chips.split == name].tolist()) for name in ("train", "validation", "test")]
    assert [len(each) for each in parts] == [6, 1, 1] and set.union(*parts) == set(range(8))
    for name in ("ground.seed", "ground.arp"):
        assert len(np.unique(table[name])) == 8
        assert all(len(np.unique(each[name])) == 1 for _, each in table.groupby("landscape"))
    assert table["ground.seed"].values.min() == chips.study.scenario.ground.seed
    for _, each in table.groupby("landscape"):
        assert np.ptp(each["atmosphere.visibility"].values) > 35
        assert len(set(each["ground.distribution"].values.tolist())) == 2


def test_first_chips_lie_in_the_tile_of_the_scenario(chips):
    """The eight landscapes start at the same upper left corner, in the scenario's tile of 1008 cells."""
    table, grid = chips.table(), chips.study.scenario.geobox()
    cell, side = grid.resolution.x, FIELD_TILE * grid.resolution.x
    first = table.isel(chip=slice(8))
    assert len({(float(west), float(north)) for west, north in zip(first.west, first.north, strict=True)}) == 1
    column, row = float(first.west[0]) / cell, -float(first.north[0]) / cell
    assert column == pytest.approx(round(column), abs=1e-6) and row == pytest.approx(round(row), abs=1e-6)
    for corner, own in ((float(first.west[0]), grid.affine.c), (-float(first.north[0]), -grid.affine.f)):
        assert own // side == corner // side == (corner + 180.0 - 1e-6) // side


def test_scenario_of_a_chip_matches_its_row_of_the_table(chips):
    table = chips.table()
    for chip in (0, 17, 299):
        scenario, row = chips.scenario(chip), table.isel(chip=chip)
        box = scenario.geobox()
        assert (box.affine.c, box.affine.f) == pytest.approx((float(row.west), float(row.north)), abs=1e-6)
        assert box.shape == (54, 54)
        assert scenario.atmosphere.visibility == float(row["atmosphere.visibility"])
        assert scenario.ground.arp == float(row["ground.arp"])
        assert scenario.ground.distribution == str(row["ground.distribution"].values)


def test_hills_and_noise_have_separate_seeds():
    sections = {"terrain": {"dem": "flint-hills", "seed": 100}, "sensor": {"instrument": "MSI", "noise": ["shot"]}}
    table = chips_of(make_study(sections), 24).table()
    np.testing.assert_array_equal(table["terrain.seed"], 100 + table.landscape)
    np.testing.assert_array_equal(table["sensor.seed"], np.arange(24))
    assert "terrain.seed" not in chips_of(make_study(), 2).table()


@pytest.mark.parametrize("size", [(4, 5), (3, 5), (10, 3), (13, 4)])
@pytest.mark.parametrize("corner", [(0, 0), (-17, 23)])
def test_no_two_chips_share_a_cell(size, corner):
    cells = set()
    for number in range(60):
        row, column = first_cell_of_chip(number, size, corner, 10)
        own = set(itertools.product(range(row, row + size[0]), range(column, column + size[1])))
        assert not own & cells
        cells |= own
    # Chips larger than a tile lie in rings that start up their right side, with north above south.
    assert [first_cell_of_chip(number, (13, 14), (0, 0), 10) for number in (0, 1, 2)] == [(0, 0), (0, 14), (-13, 14)]


@pytest.mark.parametrize(("margin", "places"), [((0, 0), 9), ((24, 24), 4)])
def test_chips_with_their_margins_fill_one_tile_before_the_next(margin, places):
    """A tile of 1008 cells holds three chips of 333 cells along each side, but only two with a margin of 24 cells."""
    numbers = range(2 * places)
    found = [first_cell_of_chip(each, (333, 333), (211491, 5000), 1008, margin) for each in numbers]
    tiles = [(row // 1008, column // 1008) for row, column in found]
    assert [len(set(tiles[first : first + places])) for first in (0, places)] == [1, 1]
    assert len(set(tiles)) == 2 and tiles[0] == (209, 4)
    for row, column in found:
        for first in (row, column):
            assert (first - margin[0]) // 1008 == (first + 332 + margin[0]) // 1008


def test_chips_beside_the_site_have_the_vegetation_of_their_study():
    """Landscapes of a study on the site begin west of it; a study elsewhere asks for its leaves."""
    keys = {"grid": {"width": 600.0, "height": 600.0}, "terrain": {"dem": "flat"}, "landscape": {"cover": "pastures"}}
    chip = chips_of(Study(parse_scenario(keys), DRAWS, landscapes=3), 6).scenario(4)
    assert not on_fife_site(chip.geobox())
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        warn_of_canopy(chip)
    keys["grid"] |= {"west": 600000.0, "north": 4300000.0}
    keys |= {"geometry": {"sza": 30.0, "saa": 150.0}, "atmosphere": {"altitude": 0.3}}
    with pytest.warns(UserWarning, match="vegetation of the scene is unknown"):
        warn_of_canopy(chips_of(Study(parse_scenario(keys), DRAWS, landscapes=3), 6).scenario(4))


@pytest.fixture(scope="module")
def small():
    """A flat scene of 20 x 20 pixels."""
    return parse_scenario({"grid": {"width": 600, "height": 600}, "terrain": {"dem": "flat"}})


@pytest.fixture(scope="module")
def fit(small):
    with no_compute():
        lazy = fifesim.scenario.sweep(small, {"arp": [0.05, 0.24], "visibility": np.array([10.0, 45.0])})
    assert lazy.r2.chunks is not None
    return lazy.compute()


def test_each_point_equals_its_scenario_run_alone(small, fit):
    run = fifesim.simulate(small.replace(arp=0.24, visibility=10.0))
    for variable in ("lai", "fpar"):
        alone = fifesim.regress(run["truth"][variable], run["image"]["ndvi"])
        point = fit.sel(arp=0.24, visibility=10.0, variable=variable)
        assert (alone.r2, alone.slope, alone.n) == (float(point.r2), float(point.slope), int(point.n))
    assert dict(fit.r2.sizes) == {"arp": 2, "visibility": 2, "variable": 2}
    # Patches larger than a pixel are better resolved in any atmosphere.
    assert (fit.r2.sel(arp=0.24) > fit.r2.sel(arp=0.05)).all()
    (line,) = fit.r2.sel(arp=0.24, variable="lai").plot()
    assert line.axes.get_xlabel() == "meteorological range [km]"


def test_selection_runs_only_the_selected_points(small):
    runs = []
    measures = {"seen": lambda run: runs.append(run["truth"]["lai"].attrs["arp"]) or runs[-1]}
    lazy = fifesim.scenario.sweep(small, {"arp": [0.05, 0.15, 0.24], "visibility": [10.0, 45.0]}, measures)
    np.testing.assert_array_equal(lazy.seen.sel(arp=0.15), [0.15, 0.15])
    assert runs == [0.15, 0.15]


def test_axis_may_be_a_function(small):
    """Use the correlation length as axis; 8.3 m corresponds to an arp of 0.15."""
    axis = [8.3, 32.0], lambda scenario, length: scenario.replace(arp=arp_for_length(length, scenario.grid.cell))
    measures = {"deviation": lambda run: run["truth"]["lai"].std(), "arp": lambda run: run["truth"]["lai"].attrs["arp"]}
    found = fifesim.scenario.sweep(small, {"correlation_length": axis, "pixel": [30.0, 60.0]}, measures).compute()
    assert dict(found.sizes) == {"correlation_length": 2, "pixel": 2}
    np.testing.assert_allclose(found.arp.sel(pixel=30.0), [0.15, 0.24], atol=0.002)
    assert (found.deviation.diff("correlation_length") > 0).all() and (found.deviation.diff("pixel") < 0).all()


def test_values_of_an_axis_may_be_lists_or_of_a_class(small):
    scenario = small.replace(instrument="L4TM", bands=["TM3", "TM4"])
    offsets = np.array([[0.0, 0.0], [0.3, 0.0]])
    found = fifesim.scenario.sweep(scenario, {"offset": offsets, "noise": [[], ["all"]]})
    assert found["offset"].values.tolist() == ["0.0, 0.0", "0.3, 0.0"]
    assert found["noise"].values.tolist() == ["none", "all"]
    r2 = found.r2.sel(variable="lai", noise="none")
    assert float(r2.sel(offset="0.3, 0.0")) < float(r2.sel(offset="0.0, 0.0"))
    sections = small.model_dump(exclude_unset=True) | {"landscape": {"cover": "voronoi"}, "classes": {"grass": {}}}
    patches, values = parse_scenario(sections), ["burned-grazed", "unburned-ungrazed"]
    of_class, of_ground = (
        fifesim.scenario.sweep(patches, {f"{section}.distribution": values}).compute()["slope"]
        for section in ("classes.grass", "ground")
    )
    np.testing.assert_array_equal(of_class, of_ground)
    assert len(np.unique(of_class.sel(variable="lai"))) == 2


def test_sweep_of_pixel_sizes_warns_once_that_the_blur_stays(small):
    with pytest.warns(UserWarning, match="pixels of .* have the blur of") as caught:
        fifesim.scenario.sweep(small, {"pixel": [15, 25, 30, 37, 60]}, {"n": lambda run: 1.0}).compute()
    (text,) = [str(each.message) for each in caught if "have the blur" in str(each.message)]
    assert text.startswith("pixels of 15, 60 m have the blur of TM, made for pixels of 30 m")
    assert "replace(gsd=...)" in text
    with pytest.warns(UserWarning, match="pixels of 60 m have the blur of TM"):
        fifesim.Study(small.replace(pixel=60), {"visibility": {"uniform": [5, 60]}})


@pytest.mark.parametrize(("stage", "values", "said"), mistakes("distribution", "study", "sweep"), ids=str)
def test_invalid_distributions_studies_and_sweeps_are_rejected(small, stage, values, said):
    with pytest.raises(ValueError) as caught:
        if stage == "distribution":
            distribution_of(values)
        elif stage == "sweep":
            fifesim.scenario.sweep(small, values)
        else:
            scenario = parse_scenario(SMALL | values.get("sections", {}))
            Study(scenario, values.get("draws", DRAWS), **values.get("plan", {}))
    check_message(str(caught.value), said)
