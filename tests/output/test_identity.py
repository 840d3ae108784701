"""A run resumes only with the same scenario, versions and inputs, and a file is recomputed from its tags to the bit."""

import json
import os
import shutil
import tomllib
import zipfile

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from elevations import write

import fifesim
from fifesim.base import files
from fifesim.output import identity as run_identity
from fifesim.output.folders import BEGUN
from fifesim.output.identity import VERSIONS
from fifesim.output.reproduction import Rerun, outcome_in_words, rerun
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.toml import write_scenario

SMALL = {"grid": {"width": 90, "height": 90}, "terrain": {"dem": "flat"}}


@pytest.fixture
def lai_file(tmp_path):
    """A VRT and the file that it refers to."""
    place = rasterio.transform.from_origin(704970, 4334220, 30, 30)
    source = write(tmp_path / "source.tif", np.full((9, 9), 2.0), place)
    rasterio.shutil.copy(source, tmp_path / "lai.vrt", driver="VRT")
    return tmp_path / "lai.vrt"


def test_files_named_by_other_files_are_inputs(lai_file, tmp_path):
    """A table of bands holds the bandwidths and noise, like the instrument file."""
    text = files.path("instruments/avhrr9.toml").read_text(encoding="utf-8").replace('"AVHRR"', '"MINE"', 1)
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    (tmp_path / "avhrr_response.csv").write_bytes(files.path("avhrr_response.csv").read_bytes())
    (tmp_path / "samples.csv").write_text("lai\n" + "\n".join(map(str, np.linspace(0.5, 3, 50))), encoding="utf-8")
    (tmp_path / "bands.csv").write_text("name,center,width\nred,0.668,0.010\nnir,0.840,0.040\n")
    (tmp_path / "own.toml").write_text('name = "Own"\naltitude = 7e5\ngsd = 30.0\nbits = 12\nbands = "bands.csv"\n')
    ground = {"lai_file": str(lai_file), "distribution": str(tmp_path / "samples.csv")}
    for sensor, expected in (
        ({"instrument": "mine.toml", "bands": ["AVHRR1"], "pixel": 30}, {"mine.toml", "avhrr_response.csv"}),
        ({"instrument": "own.toml"}, {"own.toml", "bands.csv"}),
    ):
        sensor["instrument"] = str(tmp_path / sensor["instrument"])
        found = run_identity.inputs_of(parse_scenario(SMALL | {"ground": ground, "sensor": sensor}))
        assert {os.path.basename(name) for name in found} == {"lai.vrt", "source.tif", "samples.csv"} | expected


def scenario_with_lai(lai_file):
    return parse_scenario(SMALL | {"ground": {"lai_file": str(lai_file)}}).complete()


def inputs_with_lai(lai_file):
    return run_identity.inputs_of(scenario_with_lai(lai_file))


def make_identity(scenario):
    return run_identity.state_of(run_identity.inputs_of(scenario), write_scenario(scenario), scene=False)


def rewrite_map(path, value):
    """Write new values to a map but keep its size and modification time."""
    status = path.stat()
    copy = path.with_suffix(".new")
    copy.write_bytes(path.read_bytes().replace(np.float64(2.0).tobytes(), np.float64(value).tobytes()))
    os.utime(copy, ns=(status.st_atime_ns, status.st_mtime_ns))
    os.replace(copy, path)
    assert path.stat().st_size == status.st_size and path.stat().st_mtime_ns == status.st_mtime_ns


def test_changed_input_of_the_same_size_and_time_is_found_on_resume_and_at_the_end(lai_file, tmp_path):
    identity = make_identity(scenario_with_lai(lai_file))
    before = json.loads(identity["run.json"])["inputs"]
    run_identity.begin(tmp_path, identity)
    run_identity.check_inputs(before, inputs_with_lai(lai_file))
    rewrite_map(tmp_path / "source.tif", 3.0)
    with pytest.raises(ValueError, match=r"source\.tif changed while it was read"):
        run_identity.check_inputs(before, inputs_with_lai(lai_file))
    with pytest.raises(run_identity.NotThisRun, match=r"an input file that has changed.*--overwrite"):
        run_identity.begin(tmp_path, make_identity(scenario_with_lai(lai_file)))


@pytest.mark.parametrize(("largest", "found"), [(2**30, []), (100, ["source.tif"])])
def test_changed_attributes_count_only_for_files_too_large_to_compare(lai_file, tmp_path, monkeypatch, largest, found):
    """Files above the size limit are compared by their attributes alone. A restored backup has another status time."""
    monkeypatch.setattr(run_identity, "_COMPARED", largest)
    source = tmp_path / "source.tif"
    for change in (
        lambda: source.chmod(0o600),
        lambda: os.link(source, tmp_path / "a"),
        lambda: rewrite_map(source, 2),
    ):
        before = run_identity.with_checksums(inputs_with_lai(lai_file))
        change()
        changed = run_identity.changed_inputs(json.loads(json.dumps(before)), inputs_with_lai(lai_file))
        assert [os.path.basename(path) for path in changed] == found


@pytest.mark.parametrize("form", ["/vsizip/{}/lai.tif", "/vsizip/{{{}}}/lai.tif"])
def test_changed_archive_of_an_input_is_found(lai_file, tmp_path, form):
    archive = tmp_path / "maps.zip"
    with zipfile.ZipFile(archive, "w") as packed:
        packed.write(tmp_path / "source.tif", "lai.tif")
    before = run_identity.with_checksums(inputs_with_lai(form.format(archive)))
    assert list(before) == [str(archive)]
    with zipfile.ZipFile(archive, "a") as packed:
        packed.writestr("more.txt", "more")
    assert run_identity.changed_inputs(before, inputs_with_lai(form.format(archive))) == [str(archive)]


def test_finished_run_must_be_newer_than_its_inputs(tmp_path):
    """Neither the modification time nor the status time of an input may be later."""
    (tmp_path / "scenario.toml").touch()
    written = (tmp_path / "scenario.toml").stat().st_mtime_ns
    run_identity.check_finished(tmp_path / "scenario.toml", "a", "a", {"lai.tif": [9, written, written, 1]})
    for times in ((written + 1, 0), (0, written + 1)):
        with pytest.raises(ValueError, match=r"older than its input lai\.tif:.*--overwrite"):
            run_identity.check_finished(tmp_path / "scenario.toml", "a", "a", {"lai.tif": [9, *times, 1]})


@pytest.fixture
def begun(tmp_path):
    """Identity of a run that has begun in the folder of the test."""
    identity = make_identity(parse_scenario(SMALL).complete())
    run_identity.begin(tmp_path, identity)
    return identity


@pytest.mark.parametrize("text", ["[]", "{}", "{", "1", '{"versions": []}', "[" * 100_000])
def test_invalid_run_state_is_rejected(begun, tmp_path, text):
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(run_identity.NotThisRun, match=r"run\.json is invalid.*--overwrite"):
        run_identity.begin(tmp_path, begun)


@pytest.mark.parametrize(
    ("change", "said"), [({"versions": {}}, "package versions"), ({"scene": True}, "another setting of --scene")]
)
def test_run_with_other_versions_or_options_is_not_resumed(begun, tmp_path, change, said):
    other = begun | {"run.json": json.dumps(json.loads(begun["run.json"]) | change)}
    with pytest.raises(run_identity.NotThisRun, match=said):
        run_identity.begin(tmp_path, other)


def test_comments_of_a_scenario_do_not_prevent_resuming(tmp_path):
    """The wording of the first line may change, but classes in another order have other codes."""
    classes = {name: {"share": 0.5, "distribution": name} for name in ("burned-grazed", "burned-ungrazed")}
    values = SMALL | {"landscape": {"cover": "pastures"}, "classes": classes}
    identity = make_identity(parse_scenario(values).complete())
    run_identity.begin(tmp_path, identity)
    _, rest = identity[BEGUN].split("\n", 1)
    for other in (rest, f"# Other words.\n{rest}"):
        run_identity.begin(tmp_path, identity | {BEGUN: other})
    turned = parse_scenario(values | {"classes": dict(reversed(classes.items()))}).complete()
    with pytest.raises(run_identity.NotThisRun, match="has another scenario"):
        run_identity.begin(tmp_path, make_identity(turned))


def test_changed_scenario_of_an_unfinished_run_is_not_resumed(begun, tmp_path):
    """Without SCENARIO, the requested scenario is read from the changed file and agrees with it."""
    other = make_identity(parse_scenario(SMALL | {"ground": {"seed": 4}}).complete())
    (tmp_path / BEGUN).write_text(other[BEGUN])
    with pytest.raises(run_identity.NotThisRun, match=rf"has a file {BEGUN} that changed.*--overwrite"):
        run_identity.begin(tmp_path, other)


def test_paths_in_tags_are_relative_to_the_image(tmp_path):
    """An image then reveals no folder names, and it can be moved together with its inputs."""
    data, inside = tmp_path / "data" / "hills.tif", "/vsizip/hills.zip/hills.tif"
    data.parent.mkdir()
    data.touch()
    for dem, folder, expected in (
        (str(data), tmp_path / "out", "../data/hills.tif"),
        (str(data), data.parent, "hills.tif"),
        (inside, tmp_path, inside),
    ):
        scenario = parse_scenario({"terrain": {"dem": dem}})
        text = run_identity.origin_tags(scenario, "image.tif", folder)[run_identity.SCENARIO_TAG]
        assert tomllib.loads(text)["terrain"]["dem"] == expected and str(tmp_path) not in text


def test_image_alone_is_reproduced_to_the_byte(small_run, tmp_path):
    alone = shutil.copy(small_run / "image.tif", tmp_path / "sent.tif")
    found = rerun(alone, tmp_path / "again.tif")
    assert found == Rerun(3 * 20 * 30, 0, 0.0, {})
    assert (tmp_path / "again.tif").read_bytes() == (small_run / "image.tif").read_bytes()
    assert outcome_in_words("sent.tif", found) == "sent.tif made again: the same bits in all of 1800 values"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again.tif", "sent.tif"]
    with pytest.raises(ValueError, match="--overwrite"):
        rerun(alone, tmp_path / "again.tif")


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


def test_inputs_may_be_moved_together_with_the_file(tmp_path, lai_file, run_without_pictures):
    (tmp_path / "one").mkdir()
    for name in ("lai.vrt", "source.tif"):
        (tmp_path / name).rename(tmp_path / "one" / name)
    scenario = {"ground": {"lai_file": str(tmp_path / "one" / "source.tif")}, "terrain": {"dem": "flat"}}
    run_without_pictures(parse_scenario(scenario), tmp_path / "one" / "out")
    moved = (tmp_path / "one").rename(tmp_path / "two")
    assert rerun(moved / "out" / "image.tif").differing == 0
    (moved / "source.tif").unlink()
    with pytest.raises(ValueError, match=r"ground\.lai_file = .*source\.tif.*does not exist"):
        rerun(moved / "out" / "image.tif")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (None, r"has no provenance.*scenario\.toml"),
        ({"FIFESIM_PRODUCT": "report.html"}, "a product that no run has"),
        ({VERSIONS: "[1]"}, "no versions"),
        ({"FIFESIM_SCENARIO": "[ground"}, "fifesim did not write"),
        ({"FIFESIM_SCENARIO": "ground.mood = 1", VERSIONS: '{"fifesim": "9.9"}'}, r"by fifesim 9\.9, .*ground\.mood"),
    ],
)
def test_file_without_valid_tags_is_rejected(small_run, tmp_path, changes, said):
    with rasterio.open(small_run / "image.tif") as source:
        tags = {name: value for name, value in source.tags().items() if name.startswith("FIFESIM_")}
    image = fifesim.open_image(small_run / "image.tif")
    path = fifesim.to_geotiff(image, tmp_path / "image.tif", tags=None if changes is None else tags | changes)
    with pytest.raises(ValueError, match=said):
        rerun(path)
