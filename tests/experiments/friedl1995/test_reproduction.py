"""The experiment as one call."""

import numpy as np
import pytest

import fifesim
from fifesim.experiments.friedl1995.case import ALIGNED, NATIVE, case_of
from fifesim.experiments.friedl1995.table import realise_scenes


def test_dataset_holds_54_numbers_by_realisation_beside_the_papers(found):
    assert list(found["reading"].values) == ["native", "aligned"]
    assert sum(found[name].isel(reading=0, realisation=0).size for name in ("intercept", "slope", "r2")) == 54
    assert sum(found[f"paper_{name}"].size for name in ("intercept", "slope", "r2")) == 54
    place = {"variable": "fpar", "distribution": "unburned-ungrazed", "arp": 0.24}
    assert float(found["paper_intercept"].sel(place)) == -0.02 and float(found["paper_r2"].sel(place)) == 0.72
    assert float(found["paper_ren"].sel(variable="fpar", arp=0.15)) == 0.11
    assert np.isnan(found["paper_range_kept"].sel(quantity="lai", arp=0.15))
    assert found.attrs["drift"] == pytest.approx(11.025) and "30.315 m" in str(found["text"].values[0])


def slopes(**options):
    """Of one scene, in two readings."""
    case = case_of(cells=90, **options)
    return realise_scenes(case, [1995], [NATIVE, ALIGNED], ["unburned-ungrazed"], [0.15])["slope"].values


@pytest.mark.parametrize("name", ["densities", "optics", "background"])
def test_every_input_of_a_readers_own_changes_the_numbers(name, folders):
    assert (slopes(**{name: folders[name]}) != slopes()).all()


def test_relief_another_sensor_and_another_seed_change_the_numbers(small):
    same = small["slope"].sel(distribution=["unburned-ungrazed"], arp=[0.15]).values
    np.testing.assert_array_equal(slopes(), same)
    assert (slopes(dem="flint-hills") != same).all() and (slopes(sensor="OLI") != same).all()
    assert case_of(sensor="OLI").drift < 0.1 < case_of().drift


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"realisations": 0}, ValueError, "realisations must be at least 1"),
        ({"seed": -1}, ValueError, "seed must be"),
        ({"dem": 3}, TypeError, "dem must be 'flat', 'flint-hills'"),
        ({"densities": 4}, TypeError, "densities must be a folder"),
        ({"optics": {"TM3": (0.07, 0.04)}}, ValueError, "no line for band TM4"),
        ({"reading": "mine"}, ValueError, "reading must be one of native"),
    ],
)
def test_mistake_is_told_by_its_name(options, error, said):
    with pytest.raises(error, match=said):
        fifesim.reproduce(**options)
