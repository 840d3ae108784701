"""The reproduction is nine scenarios: each gives the same bits by itself."""

import json

import numpy as np
import pytest
import rasterio
from scipy import stats

from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import reproduction
from fifesim.experiments.friedl1995.case import case_of
from fifesim.experiments.friedl1995.table import ground_of, scene_image
from fifesim.output.run.folder import simulate_to_folder
from fifesim.scenario.scenario import read_scenario
from fifesim.scenario.simulation import simulate


def read(path):
    with rasterio.open(path) as opened:
        return opened.read()


def test_nine_scenarios_give_the_images_of_the_experiment_to_the_bit(tmp_path):
    case, images = case_of(cells=90), []
    reproduction.write_scenarios(case, tmp_path, 11)
    for treatment, arp in friedl1995.scenes():
        run = simulate(read_scenario(tmp_path / f"{treatment}-{arp:g}" / "scenario.toml"))
        images.append(scene_image(case, ground_of(case, treatment, arp, 11)).values)
        np.testing.assert_array_equal(run["image"]["dn"].values, images[-1])
    assert len(images) == 9 and len({image.tobytes() for image in images}) == 9


@pytest.fixture
def one_of_nine(tmp_path, monkeypatch):
    """Folder of one of the nine with its rasters."""
    monkeypatch.setattr(friedl1995, "scenes", lambda: [("burned-ungrazed", 0.24)])
    reproduction.write_scenarios(case_of(cells=90), tmp_path / "nine", 11, scenes=True)
    return tmp_path / "nine" / "burned-ungrazed-0.24"


def test_files_of_a_scene_hold_what_its_scenario_gives(one_of_nine):
    run, cells = simulate(read_scenario(one_of_nine / "scenario.toml")), read(one_of_nine / "scene.tif")
    np.testing.assert_array_equal(run["image"]["dn"].values, read(one_of_nine / "image.tif"))
    truth = np.stack([run["truth"][name].values for name in ("lai", "fpar")])
    np.testing.assert_array_equal(truth.astype(np.float32), read(one_of_nine / "truth.tif"))
    np.testing.assert_array_equal(run["scene"]["lai"].values.astype(np.float32), cells[0])
    np.testing.assert_array_equal(run["scene"]["surface_reflectance"].values.astype(np.float32), cells[2:])


def test_scenes_are_a_collection(one_of_nine):
    """The item of each lies beside its rasters, those of the image with bands, and the collection leads to it."""
    found = json.loads((one_of_nine.parent / "collection.json").read_text(encoding="utf-8"))
    (path,) = [link["href"] for link in found["links"] if link["rel"] == "item"]
    item = json.loads((one_of_nine.parent / path).read_text(encoding="utf-8"))
    assert item["collection"] == found["id"] and found["extent"]["spatial"]["bbox"] == [item["bbox"]]
    assert set(item["assets"]) == {"image", "truth", "scene", "scenario"}
    assert [band["eo:common_name"] for band in item["assets"]["image"]["bands"]] == ["red", "nir"]
    assert [band["name"] for band in item["assets"]["scene"]["bands"]] == ["lai", "fpar", "TM3", "TM4"]
    assert "singlebandpseudocolor" in (one_of_nine / "truth.qml").read_text(encoding="utf-8")


@pytest.mark.slow
def test_command_gives_the_same_files(one_of_nine, tmp_path):
    simulate_to_folder(read_scenario(one_of_nine / "scenario.toml"), tmp_path / "run")
    for name in ("image.tif", "truth.tif"):
        np.testing.assert_array_equal(read(tmp_path / "run" / name), read(one_of_nine / name), err_msg=name)


@pytest.mark.parametrize(
    "options", [{"reading": "blur-48.6", "dem": "flint-hills"}, {"reading": "offset"}, {"sensor": "OLI"}], ids=str
)
def test_inputs_and_readings_are_in_the_scenario(tmp_path, folders, options):
    """On hills, with another response from a file beside the scenario, and with a reader's own ground."""
    if "sensor" not in options:
        options = options | folders
    case = case_of(cells=90, **options)
    place = tmp_path / "one"
    place.mkdir()
    scene = ("burned-ungrazed", 0.24, 11)
    (place / "scenario.toml").write_text(reproduction.scenario_text(case, place, *scene), encoding="utf-8")
    image = scene_image(case, ground_of(case, *scene, case.land()))
    moved = place.rename(tmp_path / "elsewhere")
    run = simulate(read_scenario(moved / "scenario.toml"))
    np.testing.assert_array_equal(run["image"]["dn"].values, image.values)


def test_density_without_a_file_has_no_scenario():
    densities = {name: stats.uniform(0.5, 1.0) for name in friedl1995.treatments()}
    with pytest.raises(ValueError, match="the density of burned-grazed is not a file"):
        reproduction.check_named(case_of(densities=densities, cells=90))
