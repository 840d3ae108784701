"""A run resumes only with the same scenario and versions and with unchanged input files."""

import json
import os
import tomllib
import zipfile

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from elevations import write

from fifesim.base import files
from fifesim.output import identity as run_identity
from fifesim.output.folders import BEGUN
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
    text = files.path("instruments/avhrr9.toml").read_text(encoding="utf-8").replace('"AVHRR"', '"MINE"', 1)
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    (tmp_path / "avhrr_response.csv").write_bytes(files.path("avhrr_response.csv").read_bytes())
    (tmp_path / "samples.csv").write_text("lai\n" + "\n".join(map(str, np.linspace(0.5, 3, 50))), encoding="utf-8")
    ground = {"lai_file": str(lai_file), "distribution": str(tmp_path / "samples.csv")}
    sensor = {"instrument": str(tmp_path / "mine.toml"), "bands": ["AVHRR1"], "pixel": 30}
    found = run_identity.inputs_of(parse_scenario(SMALL | {"ground": ground, "sensor": sensor}))
    names = {os.path.basename(name) for name in found}
    assert names == {"lai.vrt", "source.tif", "mine.toml", "avhrr_response.csv", "samples.csv"}


def test_band_table_is_an_input(tmp_path):
    """It holds the bandwidths and noise, like the instrument file."""
    (tmp_path / "bands.csv").write_text("name,center,width\nred,0.668,0.010\nnir,0.840,0.040\n")
    (tmp_path / "mine.toml").write_text('name = "Mine"\naltitude = 7e5\ngsd = 30.0\nbits = 12\nbands = "bands.csv"\n')
    found = run_identity.inputs_of(parse_scenario(SMALL | {"sensor": {"instrument": str(tmp_path / "mine.toml")}}))
    assert {os.path.basename(name) for name in found} == {"mine.toml", "bands.csv"}


def scenario_with_lai(lai_file):
    return parse_scenario(SMALL | {"ground": {"lai_file": str(lai_file)}}).complete()


def inputs_with_lai(lai_file):
    return run_identity.inputs_of(scenario_with_lai(lai_file))


def make_identity(scenario):
    return run_identity.state_of(run_identity.inputs_of(scenario), write_scenario(scenario), scene=False)


def rewrite_map(path, value, way):
    """Write new values to a map but keep its size and modification time."""
    status = path.stat()
    target = path if way == "in place" else path.with_suffix(".new")
    content = path.read_bytes()
    target.write_bytes(content.replace(np.float64(2.0).tobytes(), np.float64(value).tobytes()))
    os.utime(target, ns=(status.st_atime_ns, status.st_mtime_ns))
    os.replace(target, path)
    assert path.stat().st_size == status.st_size and path.stat().st_mtime_ns == status.st_mtime_ns


@pytest.mark.parametrize("way", ["in place", "by a copy"])
def test_changed_input_of_the_same_size_and_time_is_found_on_resume_and_at_the_end(lai_file, tmp_path, way):
    identity = make_identity(scenario_with_lai(lai_file))
    before = json.loads(identity["run.json"])["inputs"]
    run_identity.begin(tmp_path, identity)
    run_identity.check_inputs(before, inputs_with_lai(lai_file))
    rewrite_map(tmp_path / "source.tif", 3.0, way)
    with pytest.raises(ValueError, match=r"source\.tif changed while it was read"):
        run_identity.check_inputs(before, inputs_with_lai(lai_file))
    with pytest.raises(run_identity.NotThisRun, match=r"an input file that has changed.*--overwrite"):
        run_identity.begin(tmp_path, make_identity(scenario_with_lai(lai_file)))


CHANGES = {
    "permissions": lambda path: path.chmod(0o600),
    "a link": lambda path: os.link(path, path.with_suffix(".link")),
    # A restored backup has another status time.
    "moved away and back": lambda path: rewrite_map(path, 2.0, "by a copy"),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize(("largest", "found"), [(2**30, []), (100, ["source.tif"])])
def test_changed_attributes_count_only_for_files_too_large_to_compare(
    lai_file, tmp_path, monkeypatch, change, largest, found
):
    """Files above the size limit are compared by their attributes alone."""
    monkeypatch.setattr(run_identity, "_COMPARED", largest)
    before = run_identity.with_checksums(inputs_with_lai(lai_file))
    CHANGES[change](tmp_path / "source.tif")
    changed = run_identity.changed_inputs(json.loads(json.dumps(before)), inputs_with_lai(lai_file))
    assert [os.path.basename(path) for path in changed] == found


@pytest.mark.parametrize("braces", [False, True])
def test_changed_archive_of_an_input_is_found(lai_file, tmp_path, braces):
    archive = tmp_path / "maps.zip"
    with zipfile.ZipFile(archive, "w") as packed:
        packed.write(tmp_path / "source.tif", "lai.tif")
    inside = f"/vsizip/{{{archive}}}/lai.tif" if braces else f"/vsizip/{archive}/lai.tif"
    before = run_identity.with_checksums(inputs_with_lai(inside))
    assert list(before) == [str(archive)]
    with zipfile.ZipFile(archive, "a") as packed:
        packed.writestr("more.txt", "more")
    assert run_identity.changed_inputs(before, inputs_with_lai(inside)) == [str(archive)]


def test_finished_run_must_be_newer_than_its_inputs(tmp_path):
    """Neither the modification time nor the status time of an input may be later."""
    (tmp_path / "scenario.toml").touch()
    written = (tmp_path / "scenario.toml").stat().st_mtime_ns
    run_identity.check_finished(tmp_path / "scenario.toml", "a", "a", {"lai.tif": [9, written, written, 1]})
    for times in ((written + 1, 0), (0, written + 1)):
        with pytest.raises(ValueError, match=r"older than its input lai\.tif:.*--overwrite"):
            run_identity.check_finished(tmp_path / "scenario.toml", "a", "a", {"lai.tif": [9, *times, 1]})


def test_scenario_to_resume_is_read_from_the_folder(tmp_path):
    assert run_identity.scenario_to_resume(tmp_path) is None
    (tmp_path / "scenario.toml").write_text("[ground]\nseed = 3\n")
    assert run_identity.scenario_to_resume(tmp_path).ground.seed == 3


@pytest.mark.parametrize("text", ["[]", "{}", "{", "1", '{"versions": []}', "[" * 100_000])
def test_invalid_run_state_is_rejected(tmp_path, text):
    identity = make_identity(parse_scenario(SMALL).complete())
    run_identity.begin(tmp_path, identity)
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(run_identity.NotThisRun, match=r"run\.json is invalid.*--overwrite"):
        run_identity.begin(tmp_path, identity)


@pytest.mark.parametrize(("key", "said"), [("versions", "package versions"), ("scene", "another setting of --scene")])
def test_run_with_other_versions_or_options_is_not_resumed(tmp_path, key, said):
    identity = make_identity(parse_scenario(SMALL).complete())
    run_identity.begin(tmp_path, identity)
    state = json.loads(identity["run.json"])
    other = identity | {"run.json": json.dumps(state | {key: {} if key == "versions" else True})}
    with pytest.raises(run_identity.NotThisRun, match=said):
        run_identity.begin(tmp_path, other)


def test_comments_of_a_scenario_do_not_prevent_resuming(tmp_path):
    """The wording of the first line may change, but classes in another order have other codes."""
    classes = {name: {"share": 0.5, "distribution": name} for name in ("burned-grazed", "burned-ungrazed")}
    values = SMALL | {"landscape": {"cover": "pastures"}, "classes": classes}
    identity = make_identity(parse_scenario(values).complete())
    run_identity.begin(tmp_path, identity)
    heading, rest = identity[BEGUN].split("\n", 1)
    assert heading.startswith("# Synthetic landscape: fields are synthetic; the ground is level")
    run_identity.begin(tmp_path, identity | {BEGUN: rest})
    run_identity.begin(tmp_path, identity | {BEGUN: f"# Other words.\n{rest}"})
    turned = parse_scenario(values | {"classes": dict(reversed(classes.items()))}).complete()
    with pytest.raises(run_identity.NotThisRun, match="has another scenario"):
        run_identity.begin(tmp_path, make_identity(turned))


def test_changed_scenario_of_an_unfinished_run_is_not_resumed(tmp_path):
    """Without SCENARIO, the requested scenario is read from the changed file and agrees with it."""
    run_identity.begin(tmp_path, make_identity(parse_scenario(SMALL).complete()))
    other = make_identity(parse_scenario(SMALL | {"ground": {"seed": 4}}).complete())
    (tmp_path / BEGUN).write_text(other[BEGUN])
    with pytest.raises(run_identity.NotThisRun, match=rf"has a file {BEGUN} that changed.*--overwrite"):
        run_identity.begin(tmp_path, other)


def test_paths_in_tags_are_relative_to_the_image(tmp_path):
    """An image then reveals no folder names, and it can be moved together with its inputs."""
    data = tmp_path / "data" / "hills.tif"
    data.parent.mkdir()
    data.touch()
    scenario = parse_scenario({"terrain": {"dem": str(data)}})
    for folder, expected in ((tmp_path / "out", "../data/hills.tif"), (data.parent, "hills.tif")):
        text = run_identity.origin_tags(scenario, "image.tif", folder)[run_identity.SCENARIO_TAG]
        assert tomllib.loads(text)["terrain"]["dem"] == expected
        assert str(tmp_path) not in text
    virtual = parse_scenario({"terrain": {"dem": "/vsizip/hills.zip/hills.tif"}})
    assert (
        "/vsizip/hills.zip/hills.tif"
        in run_identity.origin_tags(virtual, "image.tif", tmp_path)[run_identity.SCENARIO_TAG]
    )
