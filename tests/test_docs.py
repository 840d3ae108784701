"""Documentation: code runs, links resolve, and the reference and the metadata of the project are complete."""

import json
import re
import tomllib
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import make_api
import make_benchmark_pictures
import numpy as np
import pytest
import rasterio
import yaml
from affine import Affine
from pyproj import Transformer

import fifesim
from fifesim.accessor import PUBLIC, find

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"

# Python block and, optionally, its printed output.
_BLOCK = re.compile(r"^```python\n(.*?)^```$(?:\n+```text\n(.*?)^```$)?", re.DOTALL | re.MULTILINE)
_CITED = re.compile(r"\[([A-Za-z]+\d{4})\]_")


def python_blocks(path):
    """Python blocks of a page, except blocks marked ``no-run``."""
    return [block for block, _ in _BLOCK.findall(path.read_text(encoding="utf-8"))]


def write_modis_lai(path):
    """Write LAI in the form of MCD15A3H around the FIFE site, with water and a strip of fill values."""
    cell = 1111950.519766523 / 2400
    rows, columns = np.indices((80, 100))
    counts = 25 + 10 * np.sin(rows / 5) + 8 * np.cos(columns / 7)
    counts[38:42, 45:50], counts[:5] = 254, 255
    place = Affine(cell, 0, -20015109.355798 + 25160 * cell, 0, -cell, 10007554.677899 - 12190 * cell)
    profile = {"driver": "GTiff", "width": 100, "height": 80, "count": 1, "dtype": "uint8", "nodata": 255}
    with rasterio.open(path, "w", crs="+proj=sinu +R=6371007.181 +units=m", transform=place, **profile) as sink:
        sink.write(counts.astype(np.uint8), 1)
        sink.scales, sink.descriptions = [0.1], ["Lai_500m"]


# Files that a reader of a page has.
FILES = {"docs/howto/my_map.md": ("lai_500m.tif", write_modis_lai)}

PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md")), *sorted((DOCS / "howto").glob("*.md"))]


# Pages, apart from the README, whose code takes more than 2 s of processor time.
LONG = ("budget", "elsewhere", "from_geotiff", "gpp", "landscape", "my_map", "processor", "score", "swath", "train")
CODE = [str(page.relative_to(ROOT)) for page in PAGES if python_blocks(page)]


@pytest.mark.parametrize(
    "page", [pytest.param(each, marks=[pytest.mark.slow] * (Path(each).stem in LONG)) for each in CODE]
)
def test_code_of_a_page_runs(page, tmp_path, monkeypatch):
    """Blocks run in order in one namespace."""
    monkeypatch.chdir(tmp_path)
    names = {}
    if page in FILES:
        name, write = FILES[page]
        write(name)
    for block, printed in _BLOCK.findall((ROOT / page).read_text(encoding="utf-8")):
        told = StringIO()
        with redirect_stdout(told):
            exec(compile(block, page, "exec"), names)
        # The output shown on the page is the printed output.
        assert not printed or told.getvalue().split() == printed.split()


def test_page_of_modis_masks_fill_values_and_finds_the_place(tmp_path, monkeypatch):
    """Latitude on the sphere is geodetic: the value is read at y = R latitude, x = R longitude cos(latitude)."""
    monkeypatch.chdir(tmp_path)
    write_modis_lai("lai_500m.tif")
    names = {}
    blocks = python_blocks(DOCS / "howto" / "my_map.md")
    for block in [blocks[0], *(block for block in blocks if "modis" in block)]:
        exec(compile(block, "my_map.md", "exec"), names)
    smooth, image = names["smooth"], names["image"]
    assert float(smooth.max()) < 4.31 and 0.001 < float(smooth.isnull().mean()) < 0.05
    assert float(abs(names["fine"].fifesim.aggregate(480) - names["pixels"]).max()) < 1e-12
    assert image.dims == ("band", "y", "x") and int((image > 0).sum()) > 5000
    with rasterio.open("lai_500m.tif") as source:
        affine, counts = source.transform, source.read(1)
    row, column = 250, 100
    place = float(smooth.x[column]), float(smooth.y[row])
    longitude, latitude = np.radians(Transformer.from_crs(26914, 4326, always_xy=True).transform(*place))
    u, v = ~affine * (6371007.181 * longitude * np.cos(latitude), 6371007.181 * latitude)
    left, top = int(u - 0.5), int(v - 0.5)
    corners = 0.1 * counts[top : top + 2, left : left + 2]
    a, b = u - 0.5 - left, v - 0.5 - top
    expected = np.array([1 - b, b]) @ corners @ np.array([1 - a, a])
    # LAI changes by 0.2 per cell of the map, and GDAL smooths sheared maps as if they moved by 0.02 cells.
    assert float(smooth[row, column]) == pytest.approx(expected, abs=5e-3)


@pytest.mark.slow
def test_notebook_of_table_2_prints_what_it_shows():
    notebook = json.loads((DOCS / "notebooks" / "table2.ipynb").read_text(encoding="utf-8"))
    (cell,) = (cell for cell in notebook["cells"] if cell["cell_type"] == "code")
    told = StringIO()
    with redirect_stdout(told):
        exec(compile("".join(cell["source"]), "table2.ipynb", "exec"), {})
    assert "".join(cell["outputs"][0]["text"]) == told.getvalue()
    lai = [line.split() for line in told.getvalue().splitlines() if " lai " in line]
    found, published = np.array([line[-2:] for line in lai], float).T
    assert len(lai) == 9 and np.sqrt(np.mean((found - published) ** 2)) == pytest.approx(0.05, abs=0.005)


def test_scenario_and_instrument_of_the_pages_are_valid(tmp_path):
    def shown(page):
        return re.findall(r"^```toml\n(.*?)^```", (DOCS / "howto" / page).read_text("utf-8"), re.S | re.M)

    (instrument,), (scenario,) = shown("my_sensor.md"), shown("scenario.md")
    for name, block in (("camera.toml", instrument), ("scenario.toml", scenario)):
        (tmp_path / name).write_text(block)
    assert [band.name for band in fifesim.sensor.read_instrument(tmp_path / "camera.toml").bands] == ["red", "nir"]
    assert fifesim.scenario.read_scenario(tmp_path / "scenario.toml").atmosphere.visibility == 23


def test_every_reference_is_in_the_bibliography():
    defined = set(re.findall(r"^\.\. \[([A-Za-z]+\d{4})\]", (DOCS / "references.rst").read_text("utf-8"), re.MULTILINE))
    cited = {key for path in (ROOT / "fifesim").rglob("*.py") for key in _CITED.findall(path.read_text("utf-8"))}
    cited |= {key for path in PAGES for key in re.findall(r"\{cite\}`(\w+)`", path.read_text("utf-8"))}
    assert cited == defined


def test_reference_has_exactly_the_public_names():
    listed = re.findall(r"^   (\w[\w.]*)$", make_api.functions(), re.MULTILINE)
    assert sorted(listed) == sorted(public.path.removeprefix("fifesim.") for public in PUBLIC.values())


def test_every_public_name_has_an_example():
    assert [name for name in PUBLIC if "Examples\n" not in (find(name).__doc__ or "")] == []


def test_code_of_pages_fits_their_width():
    code = re.compile(r"^```\S+(?: python\n:class: no-run)?\n(.*?)^```", re.S | re.M)
    blocks = {page.name: "".join(code.findall(page.read_text("utf-8"))) for page in PAGES[1:]}
    assert [(page, line) for page, text in blocks.items() for line in text.splitlines() if len(line) > 96] == []


def test_links_between_pages_resolve():
    pages = [*PAGES, ROOT / "data" / "README.md"]
    link_of = re.compile(r"\]\((?!https?:)([^)#:\s]+)")
    links = [(page, link) for page in pages for link in link_of.findall(page.read_text("utf-8"))]
    # The build generates the gallery and its pictures, and the reference.
    scripts = (DOCS / "gallery_src").rglob("plot_*.py")
    drawn = {path.relative_to(DOCS / "gallery_src").with_suffix("").as_posix() for path in scripts}
    reference = ("api/functions", "api/functions.rst")
    made = ["tables/why_scatter.png", "tables/why_pixel.png"]
    made += [f"tables/benchmark_{name}.png" for name in make_benchmark_pictures.PICTURES]
    built = {"gallery/index", *reference, *made, *(f"gallery/{name}" for name in drawn)}
    absent = ((page, link) for page, link in links if not (page.parent / link).exists())
    missing = [(page.name, link) for page, link in absent if link.removeprefix("../") not in built]
    pictures = [re.sub(r"^(?:\.\./)?gallery/(.*)images/sphx_glr_(\w+)_\d+\.png$", r"\1\2", link) for _, link in missing]
    assert [each for each, picture in zip(missing, pictures, strict=True) if picture not in drawn] == []


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_citation_agrees_with_pyproject():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0" and citation["message"] and citation["type"] == "software"
    assert citation["title"].startswith(PROJECT["name"]) and citation["license"] == PROJECT["license"]
    assert citation["authors"] == PROJECT["authors"] and citation["version"] == PROJECT["version"]
    doi = citation["references"][0]["doi"]
    assert doi in (ROOT / "docs" / "references.rst").read_text(encoding="utf-8")


def test_bibliography_of_the_paper_is_complete():
    text, bibliography = ((ROOT / "docs" / "paper" / f"paper.{kind}").read_text("utf-8") for kind in ("md", "bib"))
    cited = set(re.findall(r"@([A-Za-z]+\d{4}|Eradiate|prosail)\b", text))
    assert cited == set(re.findall(r"^@\w+\{(\w+),", bibliography, re.MULTILINE))


def test_workflow_runs_the_test_command_of_the_readme():
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8"))
    commands = [step.get("run", "") for step in workflow["jobs"]["tests"]["steps"]]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (options,) = re.findall(r"bin/pytest (.*)", readme)
    assert f"python -m pytest {options}" in commands


def test_tested_python_versions_agree_with_classifiers():
    classifiers = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["classifiers"]
    stated = {each.rpartition(" ")[2] for each in classifiers if re.fullmatch(r".*Python :: 3\.\d+", each)}
    page = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    tested = re.search(r"\*\*Tested on Linux with Python (.+?)\*\*", page)[1]
    assert set(re.findall(r"3\.\d+", tested)) == stated == {"3.11", "3.12", "3.13"}
