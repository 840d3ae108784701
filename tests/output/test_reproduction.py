"""A file recomputed from its tags has the same bits, and differences are reported."""

import json
import shutil

import numpy as np
import pytest
import rasterio
from elevations import write

import fifesim
from fifesim.output.identity import VERSIONS
from fifesim.output.reproduction import Rerun, outcome_in_words, rerun
from fifesim.scenario.scenario import parse_scenario


def test_image_alone_is_reproduced_to_the_byte(small_run, tmp_path):
    alone = shutil.copy(small_run / "image.tif", tmp_path / "sent.tif")
    found = rerun(alone, tmp_path / "again.tif")
    assert found == Rerun(3 * 20 * 30, 0, 0.0, {})
    assert (tmp_path / "again.tif").read_bytes() == (small_run / "image.tif").read_bytes()
    assert outcome_in_words("sent.tif", found) == "sent.tif made again: the same bits in all of 1800 values"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again.tif", "sent.tif"]


def test_differences_are_counted_and_versions_named(small_run, tmp_path):
    path = shutil.copy(small_run / "truth.tif", tmp_path / "truth.tif")
    with rasterio.open(path, "r+", IGNORE_COG_LAYOUT_BREAK="YES") as sink:
        values = sink.read()
        values[1, 4, 5] += 0.25
        values[0, 0, 0] = np.nan
        sink.write(values)
        sink.update_tags(**{VERSIONS: json.dumps(json.loads(sink.tags()[VERSIONS]) | {"numpy": "1.0"})})
    found = rerun(path)
    assert (found.cells, found.differing, found.versions) == (1200, 2, {"numpy": ("1.0", np.__version__)})
    assert found.largest == pytest.approx(0.25, rel=1e-6)
    said = outcome_in_words("truth.tif", found)
    assert "2 of 1200 values differ, by 0.25 at most; it was made with numpy 1.0, here" in said
    assert [each.name for each in tmp_path.iterdir()] == ["truth.tif"]


def test_inputs_may_be_moved_together_with_the_file(tmp_path, run_without_pictures):
    (tmp_path / "one").mkdir()
    place = rasterio.transform.from_origin(704970, 4334220, 30, 30)
    write(tmp_path / "one" / "lai.tif", np.random.default_rng(1).uniform(1, 3, (12, 12)), place)
    scenario = {"ground": {"lai_file": str(tmp_path / "one" / "lai.tif")}, "terrain": {"dem": "flat"}}
    run_without_pictures(parse_scenario(scenario), tmp_path / "one" / "out")
    moved = (tmp_path / "one").rename(tmp_path / "two")
    assert rerun(moved / "out" / "image.tif").differing == 0
    (moved / "lai.tif").unlink()
    with pytest.raises(ValueError, match=r"ground\.lai_file = .*lai\.tif.*does not exist"):
        rerun(moved / "out" / "image.tif")


def test_file_without_tags_is_rejected_with_a_remedy(small_run, tmp_path):
    other = fifesim.to_geotiff(fifesim.open_image(small_run / "image.tif"), tmp_path / "other.tif")
    with pytest.raises(ValueError, match=r"has no provenance.*scenario\.toml"):
        rerun(other)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"FIFESIM_PRODUCT": "report.html"}, "a product that no run has"),
        ({VERSIONS: "[1]"}, "no versions"),
        ({"FIFESIM_SCENARIO": "[ground"}, "fifesim did not write"),
        (
            {"FIFESIM_SCENARIO": "[ground]\nmood = 1\n", VERSIONS: '{"fifesim": "9.9"}'},
            r"made by fifesim 9\.9, here is .*unknown key ground\.mood",
        ),
    ],
)
def test_invalid_tags_are_rejected(small_run, tmp_path, changes, said):
    with rasterio.open(small_run / "image.tif") as source:
        tags = {name: value for name, value in source.tags().items() if name.startswith("FIFESIM_")}
    image = fifesim.open_image(small_run / "image.tif")
    path = fifesim.to_geotiff(image, tmp_path / "image.tif", tags=tags | changes)
    with pytest.raises(ValueError, match=said):
        rerun(path)


def test_existing_file_is_kept(small_run, tmp_path):
    (tmp_path / "mine.tif").write_text("mine")
    with pytest.raises(ValueError, match="--overwrite"):
        rerun(small_run / "image.tif", tmp_path / "mine.tif")
    assert (tmp_path / "mine.tif").read_text() == "mine"
