"""Built documentation: search results, sidebar, and the interactive page."""

import asyncio
import json
import os
import re
from pathlib import Path

import pytest
from browser import CHROMIUM, opened

from fifesim.accessor import PUBLIC

DOCS = Path(__file__).parents[1] / "docs"
HTML = Path(os.environ.get("FIFESIM_HTML", DOCS / "_build" / "html"))

pytestmark = pytest.mark.skipif(not (HTML / "searchindex.js").exists(), reason=f"no documentation is built in {HTML}")

# Search queries and the page that should be found first, among them the questions of a newcomer.
ANSWERS = {
    "add sensor noise": "howto/my_sensor",
    "my own instrument": "howto/my_sensor",
    "registration error": "howto/my_sensor",
    "DEM": "howto/my_dem",
    "Landsat": "howto/my_image",
    "Sentinel-2": "howto/my_image",
    "tutorial": "howto/from_geotiff",
    "cloud shadow": "howto/clouds",
    "GPP": "howto/gpp",
    "changelog": "changes",
    "memory": "large_scenes",
    "dask": "large_scenes",
    "jupyter": "howto/paper",
    "what is arp": "nomenclature",
    "why is my R2 so low": "why_scatter",
    "licence": "limits",
    "license": "limits",
    "help": "limits",
    "bug": "limits",
    "noise": "howto/my_sensor",
    "my DEM": "howto/my_dem",
    "accuracy": "benchmarks",
    "how accurate": "benchmarks",
    "citation": "cite",
    "cite": "cite",
    "aerosol": "howto/aerosol",
    "which aerosol": "howto/aerosol",
    "cluster": "large_scenes",
    "Table 2": "howto/paper",
    "what changed": "changes",
    "scenario key": "scenario_keys",
    "command line": "command_line",
    "instruments": "instruments",
    "score": "howto/score",
    "why scatter": "why_scatter",
    "R2": "why_scatter",
    "FPAR": "nomenclature",
    "regress": "api/names/fifesim.regress",
}


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_search_finds_the_right_page_first(tmp_path):
    ready = "typeof Search !== 'undefined' && Search._index !== null"
    query = "Search._performSearch(...Search._parseQuery({})).pop()[0]"

    async def search():
        async with opened(HTML / "search.html", tmp_path) as page:
            await page.until(ready)
            return {words: await page.evaluate(query.format(json.dumps(words))) for words in ANSWERS}

    assert asyncio.run(search()) == ANSWERS


def test_reference_has_only_public_names():
    index = (HTML / "searchindex.js").read_text(encoding="utf-8")
    pages = json.loads(index.removeprefix("Search.setIndex(").removesuffix(")"))["docnames"]
    names = {page.removeprefix("api/names/fifesim.") for page in pages if page.startswith("api/")}
    assert names == {*(public.path.removeprefix("fifesim.") for public in PUBLIC.values()), "api/functions"}


def test_see_also_leads_somewhere():
    entries = []
    for page in (HTML / "api" / "names").glob("*.html"):
        text = page.read_text(encoding="utf-8")
        for section in re.findall(r'<div class="admonition seealso">.*?</div>', text, re.DOTALL):
            found = re.findall(r'(<a [^>]*>)?<code class="xref[^>]*>(.*?)</code>', section, re.DOTALL)
            entries += [(page.name, re.sub("<[^>]+>", "", name), bool(link)) for link, name in found]
    assert len(entries) > 100 and [(page, name) for page, name, linked in entries if not linked] == []


def test_sidebar_has_at_most_40_links():
    numbers = {}
    for page in HTML.rglob("*.html"):
        tree = re.search(r'<div class="sidebar-tree">(.*?)</div>', page.read_text(encoding="utf-8"), re.DOTALL)
        if tree:
            numbers[page.relative_to(HTML).as_posix()] = tree[1].count("<a ")
    assert numbers["index.html"] > 5 and {page: n for page, n in numbers.items() if n > 40} == {}


def test_first_link_of_the_index_is_the_interactive_page():
    text = (HTML / "index.html").read_text(encoding="utf-8")
    article = text[text.index("<article") :]
    links = [link for link in re.findall(r'href="([^"#]+)"', article) if not link.startswith("#")]
    assert links[0] == "_static/explore.html"
    assert "<title>" in (HTML / links[0]).read_text(encoding="utf-8")


def test_search_words_belong_to_existing_pages():
    source = (DOCS / "conf.py").read_text(encoding="utf-8")
    pages = re.findall(
        r'^    "([\w/]+)": \["', source[source.index("SEARCH_WORDS") :].partition("}\n")[0], re.MULTILINE
    )
    assert pages and [page for page in pages if not (DOCS / f"{page}.md").exists()] == []
