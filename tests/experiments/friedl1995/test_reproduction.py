"""`fifesim.reproduce` and the scenario files of its scenes."""

import builtins
import json

import numpy as np
import pytest
import rasterio
import xarray as xr
from mistakes import mistakes

import fifesim
from fifesim.chain.driver import Driver
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import reproduction
from fifesim.experiments.friedl1995.case import ALIGNED, NATIVE, case_of
from fifesim.experiments.friedl1995.table import cells_of, realise_scenes
from fifesim.scenario.scenario import read_scenario
from fifesim.scenario.simulation import simulate


def test_dataset_has_54_numbers_by_realisation_and_the_published_ones(found):
    assert list(found["reading"].values) == ["native", "aligned"]
    assert sum(found[name].isel(reading=0, realisation=0).size for name in ("intercept", "slope", "r2")) == 54
    assert sum(found[f"paper_{name}"].size for name in ("intercept", "slope", "r2")) == 54
    place = {"variable": "fpar", "distribution": "unburned-ungrazed", "arp": 0.24}
    assert float(found["paper_intercept"].sel(place)) == -0.02 and float(found["paper_r2"].sel(place)) == 0.72
    assert float(found["paper_ren"].sel(variable="fpar", arp=0.15)) == 0.11
    assert np.isnan(found["paper_range_kept"].sel(quantity="lai", arp=0.15))
    assert found.attrs["drift"] == pytest.approx(11.025) and "30.315 m" in str(found["text"].values[0])


def slopes(**options):
    """Slopes of one scene in two readings."""
    case = case_of(cells=90, **options)
    return realise_scenes(case, [1995], [NATIVE, ALIGNED], ["unburned-ungrazed"], [0.15])["slope"].values


@pytest.mark.parametrize("name", ["densities", "optics", "background"])
def test_every_user_input_changes_the_numbers(name, folders):
    assert (slopes(**{name: folders[name]}) != slopes()).all()


def test_relief_another_sensor_and_another_seed_change_the_numbers(small):
    same = small["slope"].sel(distribution=["unburned-ungrazed"], arp=[0.15]).values
    np.testing.assert_array_equal(slopes(), same)
    assert (slopes(dem="flint-hills") != same).all() and (slopes(sensor="OLI") != same).all()
    assert case_of(sensor="OLI").drift < 0.1 < case_of().drift


@pytest.mark.parametrize(("error", "options", "said"), mistakes("ValueError", "TypeError", name="experiment_mistakes"))
def test_mistake_is_named(error, options, said):
    with pytest.raises(getattr(builtins, error), match=said):
        fifesim.reproduce(**options)


def read(path):
    with rasterio.open(path) as opened:
        return opened.read()


def seen(case, *scene):
    """Digital numbers of a scene from plain arrays, as for the tables."""
    cells, driver = cells_of(case, *scene, case.light()), Driver(case.setup)
    return driver.image(driver.toa(cells.reflectance), case.grid)


def test_nine_scenarios_reproduce_the_images_to_the_bit(tmp_path):
    case, images = case_of(cells=90), []
    reproduction.write_scenarios(case, tmp_path, 11)
    for treatment, arp in friedl1995.scenes():
        run = simulate(read_scenario(tmp_path / f"{treatment}-{arp:g}" / "scenario.toml"))
        images.append(seen(case, treatment, arp, 11))
        np.testing.assert_array_equal(run["image"]["dn"].values, images[-1])
    assert len(images) == 9 and len({image.tobytes() for image in images}) == 9


@pytest.fixture
def one_of_nine(tmp_path, monkeypatch):
    """Folder of one of the nine scenes with its rasters."""
    monkeypatch.setattr(friedl1995, "scenes", lambda: [("burned-ungrazed", 0.24)])
    reproduction.write_scenarios(case_of(cells=90), tmp_path / "nine", 11, scenes=True)
    return tmp_path / "nine" / "burned-ungrazed-0.24"


def test_files_of_a_scene_equal_plain_arrays(one_of_nine):
    np.testing.assert_array_equal(seen(case_of(cells=90), "burned-ungrazed", 0.24, 11), read(one_of_nine / "image.tif"))
    expected = cells_of(case_of(cells=90), "burned-ungrazed", 0.24, 11)
    with xr.open_zarr(one_of_nine / "scene.zarr") as cells:
        np.testing.assert_array_equal(cells["lai"], expected.lai)
        np.testing.assert_array_equal(cells["surface_reflectance"], expected.reflectance)


def test_scenes_are_a_stac_collection(one_of_nine):
    """Each item is stored next to its rasters, image assets list bands, and the collection links to the item."""
    found = json.loads((one_of_nine.parent / "collection.json").read_text(encoding="utf-8"))
    (path,) = [link["href"] for link in found["links"] if link["rel"] == "item"]
    item = json.loads((one_of_nine.parent / path).read_text(encoding="utf-8"))
    assert item["collection"] == found["id"] and found["extent"]["spatial"]["bbox"] == [item["bbox"]]
    assert {"image", "image-style", "truth", "truth-style", "scene", "scenario"} <= set(item["assets"])
    assert [band["eo:common_name"] for band in item["assets"]["image"]["bands"]] == ["red", "nir"]
    assert "singlebandpseudocolor" in (one_of_nine / "truth.qml").read_text(encoding="utf-8")


@pytest.mark.parametrize("options", [{"reading": "aligned", "dem": "flint-hills"}, {"sensor": "OLI"}], ids=str)
def test_scenario_file_contains_inputs_and_reading(tmp_path, folders, options):
    """Cases on hills, with another sensor, and with user inputs."""
    if "sensor" not in options:
        options = options | folders
    case, scene = case_of(cells=90, **options), ("burned-ungrazed", 0.24)
    reproduction.write_scenarios(case, tmp_path, 11)
    run = simulate(read_scenario(tmp_path / "burned-ungrazed-0.24" / "scenario.toml"))
    np.testing.assert_array_equal(run["image"]["dn"].values, seen(case, *scene, 11))
