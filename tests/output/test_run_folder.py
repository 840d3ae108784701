"""A run folder: its rasters, its report, resuming it, and its blocks."""

import html
import json
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
import rasterio
import rioxarray  # noqa: F401  registers .rio
import xarray as xr
from elevations import write

import fifesim
from fifesim.output import products, report, run_folder
from fifesim.output.folders import UNFINISHED
from fifesim.output.run_folder import FILES, estimate, estimate_in_words, simulate_to_folder
from fifesim.scenario.scenario import parse_scenario

FLAT = {"dem": "flat"}

SMALL = {"grid": {"width": 900, "height": 600}, "ground": {"arp": 0.24, "seed": 3}, "terrain": FLAT}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "small"
    simulate_to_folder(parse_scenario(SMALL), folder)
    return folder


def page_of(folder):
    return html.unescape((folder / "report.html").read_text(encoding="utf-8"))


def test_report_is_self_contained_and_names_every_parameter_with_its_unit(folder):
    page = page_of(folder)
    (title,), (tag,) = re.findall(r"<h1>(.*?)</h1>", page), re.findall(r"<title>(.*?)</title>", page)
    assert title == tag == json.loads((folder / "item.json").read_text(encoding="utf-8"))["properties"]["title"]
    assert f"burned-grazed, arp 0.24. {parse_scenario(SMALL).provenance()}" in page
    assert not re.findall(r'src="(?!data:)', page)
    *local, doi = re.findall(r'href="([^"]*)"', page)
    assert doi.startswith("https://doi.org/") and all((folder / name).is_file() for name in local)
    assert {"image.tif", "truth.tif", "scenario.toml"} <= set(local)
    # Pictures of the image, the cells, two regressions, three maps and three histograms.
    assert len(re.findall("data:image/(?:png|webp);base64,", page)) == 11
    for key, unit in (("visibility", "km"), ("cell", "m"), ("vza", "degree"), ("arp", "1")):
        assert re.search(rf"<code>{key}</code>.*?<td>{unit}</td>", page)


def test_single_band_has_a_report_without_ndvi(tmp_path):
    """The MTF of a detector as wide as the sampling interval is 2 / pi at the Nyquist frequency."""
    scenario = parse_scenario(SMALL | {"sensor": {"bands": ["TM5"], "response": "detector"}})
    simulate_to_folder(scenario, tmp_path / "one")
    page = page_of(tmp_path / "one")
    assert "Leaf area and FPAR from NDVI" not in page
    said = "0.64; only the detector of TM5 is known, so the image is too sharp"
    assert f'<th>Blur</th><td class="number">modulation transfer at the Nyquist frequency {said}' in page


HILLS = {"grid": {"width": 3600, "height": 3510}, "ground": {"seed": 3}, "terrain": {"horizon_reach": 600}}


@pytest.fixture(scope="module")
def hills(tmp_path_factory, run_without_pictures):
    """A multi-chunk scene on terrain with its cells, written without pictures."""
    folder = tmp_path_factory.mktemp("hills") / "out"
    run_without_pictures(parse_scenario(HILLS), folder, scene=True, threads=2)
    return folder


def test_run_equals_the_chain_under_other_chunks(hills):
    assert sorted(path.name for path in hills.iterdir()) == sorted([*FILES, "scene.zarr"])
    assert "north 0.6 km, east 0.6 km, south 0.6 km, west 0.6 km" in page_of(hills)
    tree = fifesim.simulate(parse_scenario(HILLS).complete(), chunks={"y": 333, "x": 1170})
    np.testing.assert_array_equal(fifesim.open_image(hills / "image.tif").values, tree["image"]["dn"].values)
    truth = fifesim.open_image(hills / "truth.tif")
    for name in ("lai", "fpar"):
        np.testing.assert_array_equal(truth.sel(band=name), tree["truth"][name].values.astype(np.float32))
    with xr.open_zarr(hills / "scene.zarr", decode_coords="all") as scene:
        for name in ("lai", "dem", "surface_reflectance"):
            np.testing.assert_array_equal(scene[name].values, tree["scene"][name].values)
            assert scene[name].encoding["chunks"][-2:] == (1008, 1008)
            assert scene[name].attrs["units"] == tree["scene"][name].attrs["units"]
        assert scene.rio.crs.to_epsg() == 26914
        np.testing.assert_array_equal(scene["x"], tree["scene"]["x"])


def write_lai_map(path, values):
    place = rasterio.transform.from_origin(704970, 4334220, 30, 30)
    return {"ground": {"lai_file": str(write(path, np.full((20, 30), values), place))}}


@pytest.mark.parametrize(("values", "offset"), [(2.0, [9.5, 0.0]), (np.nan, [0.0, 0.0])])
def test_image_without_valid_pixels_is_an_error_with_the_reason(tmp_path, values, offset):
    sections = {"grid": {"width": 300, "height": 300}, "sensor": {"offset": offset}}
    with pytest.raises(ValueError, match=r"no pixel of the image has 0\.98.*sensor\.offset"):
        simulate_to_folder(parse_scenario(sections | write_lai_map(tmp_path / "lai.tif", values)), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_input_that_changes_during_or_after_a_run_is_an_error(tmp_path, monkeypatch, run_without_pictures):
    scenario, write_files = parse_scenario(write_lai_map(tmp_path / "lai.tif", 2.0)), run_folder._write_files

    def while_another_writes(*given):
        write_files(*given)
        write_lai_map(tmp_path / "lai.tif", 3.0)

    with monkeypatch.context() as patch, pytest.raises(ValueError, match=r"lai\.tif changed while it was read"):
        patch.setattr(run_folder, "_write_files", while_another_writes)
        run_without_pictures(scenario, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    write_lai_map(tmp_path / "lai.tif", 2.0)
    run_without_pictures(scenario, tmp_path / "out")
    assert re.search("R² of .*none, all", page_of(tmp_path / "out"), re.DOTALL), "NDVI is uniform"
    write_lai_map(tmp_path / "lai.tif", 3.0)
    with pytest.raises(ValueError, match=r"older than its input .*lai\.tif.*--overwrite"):
        run_without_pictures(scenario, tmp_path / "out", resume=True)


def test_overwriting_removes_the_cells_of_an_earlier_run(tmp_path, run_without_pictures):
    run_without_pictures(parse_scenario(SMALL), tmp_path / "out", scene=True)
    (tmp_path / "out" / "notes.txt").touch()
    run_without_pictures(parse_scenario(SMALL | {"ground": {"arp": 0.15, "seed": 4}}), tmp_path / "out", overwrite=True)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {*FILES, "notes.txt"}


def test_resuming_a_finished_run_computes_nothing(folder, tmp_path, monkeypatch):
    shutil.copytree(folder, tmp_path / "out")
    monkeypatch.setattr(run_folder, "simulate", None)
    files = [tmp_path / "out" / name for name in FILES]
    assert simulate_to_folder(parse_scenario(SMALL), tmp_path / "out", resume=True) == (files, True)
    other = parse_scenario({**SMALL, "ground": {"arp": 0.15}})
    with pytest.raises(ValueError, match=r"of another scenario, with arp = 0\.24, seed = 3: name another.*--overwrite"):
        simulate_to_folder(other, tmp_path / "out", resume=True)
    with pytest.raises(ValueError, match="nothing to resume"):
        simulate_to_folder(parse_scenario(SMALL), tmp_path / "out", resume=True, scene=True)


def test_changed_files_of_a_finished_run_are_made_again(tmp_path, run_without_pictures):
    """Lost by a power cut, replaced, or one bit of them changed; also a file of the store of cells."""
    scenario, out = parse_scenario(SMALL), tmp_path / "out"

    def run(**options):
        return run_without_pictures(scenario, out, scene=True, **options)

    def contents():
        return {path.relative_to(out): path.read_bytes() for path in out.rglob("*") if path.is_file()}

    run()
    before, item, cells = contents(), out / "item.json", out / "scene.zarr" / "lai" / "0.0"
    for name, path, content in (
        ("image.tif", out / "image.tif", b""),
        ("truth.qml", out / "truth.qml", (out / "truth.qml").read_bytes().replace(b"<", b"(", 1)),
        ("scene.zarr", cells, cells.read_bytes()[:-1] + bytes([cells.read_bytes()[-1] ^ 1])),
        ("item.json", item, item.read_bytes().replace(b'"gsd": 30.0', b'"gsd": 30.1')),
        ("item.json", item, b"[1"),
    ):
        path.write_bytes(content)
        with pytest.warns(UserWarning, match=rf"^{name} of the finished run changed.*made again"):
            assert not run(resume=True)[1]
        assert contents() == before
    assert run(resume=True)[1]
    other = item.read_text().replace('"numba": "', '"numba": "9')
    for path, text, said in (
        (item, other, r"other package versions, numba 9\d.*--overwrite"),
        (out / "scenario.toml", (out / "scenario.toml").read_text().replace("seed = 3", "seed = 4"), "run is unknown"),
    ):
        path.write_text(text)
        with pytest.raises(ValueError, match=said):
            run(resume=True)


def test_unfinished_run_refuses_another_scenario_and_recomputes_a_changed_chunk(
    tmp_path, monkeypatch, run_without_pictures
):
    def full(*given):
        raise OSError("disk full")

    out, scenario = tmp_path / "out", parse_scenario(SMALL)
    with monkeypatch.context() as broken, pytest.raises(OSError, match=r"disk full.*--resume"):
        broken.setattr(run_folder, "_write_files", full)
        run_without_pictures(scenario, out, scene=True)
    with pytest.raises(ValueError, match=r"the unfinished run has another scenario, with arp = 0\.24, seed = 3"):
        run_without_pictures(
            parse_scenario({**SMALL, "ground": {"arp": 0.15, "seed": 4}}), out, scene=True, resume=True
        )
    block = out / UNFINISHED / "blocks" / "scene-lai" / "c" / "0" / "0"
    block.write_bytes(block.read_bytes()[:-1] + bytes([block.read_bytes()[-1] ^ 1]))
    (out / UNFINISHED / "blocks" / "scene-lai" / "zarr.json").write_bytes(b"{}")
    # Left by a run that was killed while it wrote the files.
    (out / UNFINISHED / "scene.zarr" / "lai").mkdir(parents=True)
    (out / UNFINISHED / "scene.zarr" / "lai" / "0.1").write_bytes(b"half")
    for name in ("out", "whole"):
        run_without_pictures(scenario, tmp_path / name, scene=True, resume=name == "out")
    xr.testing.assert_identical(*(xr.open_zarr(tmp_path / name / "scene.zarr").load() for name in ("out", "whole")))


def test_estimate_counts_cells_and_pixels_of_the_scenario(monkeypatch):
    monkeypatch.setattr(report, "png", lambda figure, dpi: b"")
    scenario = parse_scenario({"grid": {"width": 300, "height": 300}, "terrain": {"dem": "flat"}})
    found, with_scene = estimate(scenario, threads=1), estimate(scenario, threads=1, scene=True)
    assert found["cells"] == 90 * 90 and found["pixels"] == 100
    assert with_scene["disk"] - found["disk"] >= found["cells"] * 8
    assert found["threads"] == 1 and found["seconds"] > 0 and found["memory"] > 0


def test_timed_piece_lies_in_the_middle_of_the_scene():
    """It consists of whole pixels and is no larger than a tile."""
    scenario = parse_scenario({"grid": {"width": 24000, "height": 300}, "terrain": FLAT}).complete()
    box, whole = run_folder._piece(scenario).geobox(), scenario.geobox()
    assert box.shape.y == whole.shape.y and 1900 < box.shape.x <= run_folder._PIECE
    assert np.hypot(*np.subtract(box.center_pixel.boundingbox[:2], whole.center_pixel.boundingbox[:2])) <= 30
    assert (box.affine.c - whole.affine.c) % 30 == pytest.approx(0, abs=1e-6)


PEAK = """
import json, sys
from fifesim.cli import app
try:
    app(sys.argv[1:])
finally:
    # ru_maxrss of a child begins with the memory of its parent, VmHWM does not. [byte]
    (peak,) = [line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")]
    print(json.dumps(int(peak) * 1024))
"""


def run_json(folder, *arguments, line=-1):
    command = [sys.executable, "-c", PEAK, "simulate", "scenario.toml", "--threads", "2", "--json", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[line])


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured in kB on Linux alone")
@pytest.mark.parametrize(("size", "dem"), [(300, "flat"), (15_000, "flat"), (15_000, "flint-hills")])
def test_estimated_memory_suffices(tmp_path, size, dem):
    """The estimate exceeds the memory of a run by at most 50 %; the first estimate compiles the kernels."""
    text = f'[grid]\nwidth = {size}\nheight = {size}\n[terrain]\ndem = "{dem}"\n'
    (tmp_path / "scenario.toml").write_text(text)
    estimate(parse_scenario(SMALL), threads=2)
    promised, taken = run_json(tmp_path, "--dry-run", line=-2)["memory"], run_json(tmp_path, "-o", "out")
    assert taken <= promised <= 1.5 * taken


def test_estimate_in_words_has_units_and_json_keeps_the_values():
    numbers = {"cells": 72900, "pixels": 900, "tasks": 12, "threads": 2, "memory": 2**30, "disk": 2**20, "seconds": 90}
    text = estimate_in_words(numbers)
    assert "0.1 million" in text and "1.00 GiB with 2 threads" in text and "1.00 MiB" in text
    assert json.loads(estimate_in_words(numbers, as_json=True)) == {"event": "estimate", **numbers}


@pytest.fixture(scope="module")
def simulated_tree():
    scenario = parse_scenario({"grid": {"width": 900, "height": 600}, "terrain": FLAT})
    return fifesim.simulate(scenario.complete(), chunks={"y": 90, "x": 135})


def test_each_block_is_listed_once_with_all_bands(simulated_tree):
    """Chunks of Zarr are of one size; only the last may be smaller."""
    found, lai = products.products_of(simulated_tree, scene=True), simulated_tree["scene"]["lai"]
    wanted = products.wanted_blocks(found, lai)
    assert len(wanted) == len(set(wanted)) == sum(raster.data.npartitions for raster in found.values())
    names = {"image", "lai", "fpar", "green_fpar", "soil", "brown", "moisture", "detail"}
    cells = {f"scene-{name}" for name in simulated_tree["scene"].data_vars}
    assert {name for name, _ in wanted} == set(found) == names | cells
    for raster in found.values():
        *bands, rows, columns = raster.chunks
        assert all(len(each) == 1 for each in bands)
        assert all(set(sizes[:-1]) <= {sizes[0]} and sizes[-1] <= sizes[0] for sizes in (rows, columns))
    detail = found["detail"]
    assert detail.shape == (144, 144) and abs(float(detail["x"].mean() - lai["x"].mean())) <= 15
