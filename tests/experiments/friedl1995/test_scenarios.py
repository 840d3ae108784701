"""The reproduction is nine scenarios: each gives the same bits by itself."""

import numpy as np
import pytest
import rasterio
from scipy import stats

from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import scenarios
from fifesim.experiments.friedl1995.case import case_of
from fifesim.experiments.friedl1995.pixels import ground_of, scene_image
from fifesim.output.run.folder import simulate_to_folder
from fifesim.scenario.scenario import read_scenario
from fifesim.scenario.simulation import simulate


def read(path):
    with rasterio.open(path) as opened:
        return opened.read()


def test_nine_scenarios_give_the_images_of_the_experiment_to_the_bit(tmp_path):
    scenarios.write_scenarios(case_of(cells=90), tmp_path / "nine", 11, scenes=True)
    images = []
    for treatment, arp in friedl1995.scenes():
        folder = tmp_path / "nine" / f"{treatment}-{arp:g}"
        run = simulate(read_scenario(folder / "scenario.toml"))
        images.append(read(folder / "image.tif"))
        np.testing.assert_array_equal(run["image"]["dn"].values, images[-1])
        truth = np.stack([run["truth"][name].values for name in ("lai", "fpar")]).astype(np.float32)
        np.testing.assert_array_equal(truth, read(folder / "truth.tif"))
        cells = read(folder / "scene.tif")
        np.testing.assert_array_equal(run["scene"]["lai"].values.astype(np.float32), cells[0])
        np.testing.assert_array_equal(run["scene"]["surface_reflectance"].values.astype(np.float32), cells[2:])
    assert len(images) == 9 and len({image.tobytes() for image in images}) == 9
    # The last one by the command itself.
    simulate_to_folder(read_scenario(folder / "scenario.toml"), tmp_path / "run")
    for name in ("image.tif", "truth.tif"):
        np.testing.assert_array_equal(read(tmp_path / "run" / name), read(folder / name), err_msg=name)


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
    (place / "scenario.toml").write_text(scenarios.scenario_text(case, place, *scene), encoding="utf-8")
    image = scene_image(case, ground_of(case, *scene, case.land()))
    moved = place.rename(tmp_path / "elsewhere")
    run = simulate(read_scenario(moved / "scenario.toml"))
    np.testing.assert_array_equal(run["image"]["dn"].values, image.values)


def test_density_without_a_file_has_no_scenario():
    densities = {name: stats.uniform(0.5, 1.0) for name in friedl1995.treatments()}
    with pytest.raises(ValueError, match="that of burned-grazed is no file"):
        scenarios.check_named(case_of(densities=densities, cells=90))
