"""The documentation runs, resolves and is complete."""

import re
from pathlib import Path

import pytest

import fifesim

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"

_CITED = re.compile(r"\[([A-Za-z]+\d{4})\]_")


def python_blocks(path):
    """Blocks that a page shows as Python, but for those marked ``no-run``."""
    return re.findall(r"^```python\n(.*?)^```", path.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("page", ["README.md", "docs/index.md", "docs/guide.md"])
def test_code_of_a_page_runs(page, tmp_path, monkeypatch):
    """Blocks run in order and share their names, as a reader runs them."""
    blocks = python_blocks(ROOT / page)
    assert blocks
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)


@pytest.mark.parametrize(
    "block", re.findall(r"^```toml\n(.*?)^```", (DOCS / "guide.md").read_text("utf-8"), re.S | re.M)
)
def test_scenario_of_the_guide_is_valid(block, tmp_path):
    path = tmp_path / "scenario.toml"
    path.write_text(block)
    assert fifesim.read_scenario(path).atmosphere.visibility == 23


def test_every_reference_is_in_the_bibliography():
    defined = set(re.findall(r"^\.\. \[([A-Za-z]+\d{4})\]", (DOCS / "references.rst").read_text("utf-8"), re.MULTILINE))
    cited = {key for path in (ROOT / "fifesim").rglob("*.py") for key in _CITED.findall(path.read_text("utf-8"))}
    cited |= {key for path in DOCS.glob("*.md") for key in re.findall(r"\{cite\}`(\w+)`", path.read_text("utf-8"))}
    assert cited == defined


def test_every_public_name_is_in_the_api_page():
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    assert [name for name in fifesim.__all__ if not re.search(rf"\b{name}\b", page)] == []


def test_every_physics_module_is_in_the_api_page():
    """The files of the stages but their rasters, which the public functions document, and what prints them."""
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    stages = ("ground", "atmosphere", "sensor", "analysis")
    modules = [f"{stage}.{path.stem}" for stage in stages for path in (ROOT / "fifesim" / stage).glob("[a-z]*.py")]
    wanted = [name for name in modules if not name.endswith(("raster", ".listing"))]
    assert [name for name in wanted if name not in page] == []


def test_links_between_pages_lead_somewhere():
    pages = [*DOCS.glob("*.md"), ROOT / "README.md", ROOT / "data" / "README.md"]
    links = [(page, link) for page in pages for link in re.findall(r"\]\(([^)#:\s]+)", page.read_text("utf-8"))]
    assert [(page.name, link) for page, link in links if not (page.parent / link).exists()] == []
