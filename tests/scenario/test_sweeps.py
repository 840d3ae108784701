"""Sweeps: lazy, labelled, and identical to each scenario run alone."""

import numpy as np
import pytest
from lazy import no_compute
from mistakes import check_message, mistakes

import fifesim
from fifesim.scenario.scenario import parse_scenario


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
    one = parse_scenario(
        small.model_dump(exclude_unset=True) | {"ground": {"arp": 0.24}, "atmosphere": {"visibility": 10.0}}
    )
    run = fifesim.simulate(one)
    for variable in ("lai", "fpar"):
        alone = fifesim.regress(run["truth"][variable], run["image"]["ndvi"])
        point = fit.sel(arp=0.24, visibility=10.0, variable=variable)
        assert (alone.r2, alone.slope, alone.n) == (float(point.r2), float(point.slope), int(point.n))


def test_coordinates_select_and_plot(fit):
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

    def change(scenario, length):
        arp = fifesim.ground.arp_for_length(length, scenario.grid.cell)
        return parse_scenario(scenario.model_dump(exclude_unset=True) | {"ground": {"arp": arp}})

    axis = [8.3, 32.0], change
    measures = {"deviation": lambda run: run["truth"]["lai"].std(), "arp": lambda run: run["truth"]["lai"].attrs["arp"]}
    found = fifesim.scenario.sweep(small, {"correlation_length": axis, "pixel": [30.0, 60.0]}, measures).compute()
    assert dict(found.sizes) == {"correlation_length": 2, "pixel": 2}
    np.testing.assert_allclose(found.arp.sel(pixel=30.0), [0.15, 0.24], atol=0.002)
    assert (found.deviation.diff("correlation_length") > 0).all() and (found.deviation.diff("pixel") < 0).all()


@pytest.mark.parametrize("offsets", [[[0.0, 0.0], [0.3, 0.0]], np.array([[0.0, 0.0], [0.3, 0.0]])])
def test_values_of_an_axis_may_be_lists(small, offsets):
    sensor = {"sensor": {"instrument": "L4TM", "bands": ["TM3", "TM4"]}}
    scenario = parse_scenario(small.model_dump(exclude_unset=True) | sensor)
    found = fifesim.scenario.sweep(scenario, {"offset": offsets, "noise": [[], ["all"]]})
    assert found["offset"].values.tolist() == ["0.0, 0.0", "0.3, 0.0"]
    assert found["noise"].values.tolist() == ["none", "all"]
    r2 = found.r2.sel(variable="lai", noise="none")
    assert float(r2.sel(offset="0.3, 0.0")) < float(r2.sel(offset="0.0, 0.0"))


def test_key_of_a_class_can_be_an_axis(small):
    sections = small.model_dump(exclude_unset=True) | {"landscape": {"cover": "voronoi"}, "classes": {"grass": {}}}
    patches, values = parse_scenario(sections), ["burned-grazed", "unburned-ungrazed"]
    fit = fifesim.scenario.sweep(patches, {"classes.grass.distribution": values}).compute()
    np.testing.assert_array_equal(
        fit["slope"], fifesim.scenario.sweep(patches, {"ground.distribution": values})["slope"]
    )
    assert len(np.unique(fit["slope"].sel(variable="lai"))) == 2


@pytest.mark.parametrize(("stage", "axes", "said"), mistakes("sweep"), ids=str)
def test_invalid_axes_are_rejected(small, stage, axes, said):
    with pytest.raises(ValueError) as caught:
        fifesim.scenario.sweep(small, axes)
    check_message(str(caught.value), said)


def test_sweep_of_pixel_sizes_warns_once_that_the_blur_stays(small):
    with pytest.warns(UserWarning, match="pixels of .* have the blur of") as caught:
        fifesim.scenario.sweep(small, {"pixel": [15, 25, 30, 37, 60]}, {"n": lambda run: 1.0}).compute()
    (text,) = [str(each.message) for each in caught if "have the blur" in str(each.message)]
    assert text.startswith("pixels of 15, 60 m have the blur of TM, made for pixels of 30 m")
    assert "replace(gsd=...)" in text
    with pytest.warns(UserWarning, match="pixels of 60 m have the blur of TM"):
        fifesim.Study(small.replace(pixel=60), {"visibility": {"uniform": [5, 60]}})
