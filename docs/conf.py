"""Sphinx configuration. Build with: sphinx-build -W -b html docs docs/_build/html"""

import multiprocessing
import os
import re
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault(
    "OMP_NUM_THREADS", "1"
)  # before numpy is loaded: its matrices here are small

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.ext import autosummary

import fifesim

sys.path.insert(0, str(Path(__file__).parent))
sys.path.append(str(Path(__file__).parents[1] / "tests"))  # comparisons with benchmarks
import docstrings
import make_api
import make_benchmark_pictures
import make_bounds
import make_explorer
import make_tables
import make_why_scatter
import thumbnails

make_api.write()
make_benchmark_pictures.write()
make_tables.write()

project = "fifesim"
author = "the fifesim developers"
copyright = "the fifesim developers"
version = release = fifesim.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = [
    "_build",
    "bounds.md",
    "developers/*",
    "gallery_src",
    "paper/*",
    "tables/*",
    "gallery/**/*.ipynb",
    "gallery/*.ipynb",
    "**sg_execution_times.rst",
]
templates_path = ["_templates"]
default_role = "py:obj"
# Modules that are not on these pages refer to publications, too.
suppress_warnings = ["ref.citation"]

html_theme = "furo"
html_title = f"fifesim {version}"
html_theme_options = {
    name: {"code-font-size": "75%"} for name in ("light_css_variables", "dark_css_variables")
}
html_static_path = ["_static"]
html_css_files = ["gallery.css"]
html_js_files = ["pictures.js"]
html_copy_source = False
html_domain_indices = False

# Words to search for, and the page that the search lists first.
SEARCH_WORDS = {
    "benchmarks": ["accuracy", "accurate", "how accurate", "validation", "verify"],
    "changes": ["changelog", "release notes", "what changed"],
    "cite": ["citation", "cite", "how to cite", "bibtex", "doi"],
    "howto/aerosol": ["aerosol", "which aerosol", "visibility", "aot", "smoke", "dust"],
    "howto/clouds": ["cloud", "cloud shadow", "shadow"],
    "howto/from_geotiff": ["tutorial", "my data", "geotiff"],
    "howto/gpp": ["gpp", "evapotranspiration"],
    "howto/haze": ["haze"],
    "howto/my_dem": ["my dem", "dem", "elevation"],
    "howto/my_image": ["my image", "landsat", "sentinel-2"],
    "howto/my_map": ["my map", "lai map"],
    "howto/my_sensor": [
        "noise",
        "add noise",
        "add sensor noise",
        "my sensor",
        "my own instrument",
        "registration error",
    ],
    "howto/paper": [
        "reproduce",
        "table 2",
        "reproduce table 2",
        "friedl",
        "notebook",
        "jupyter",
    ],
    "howto/scenario": ["toml"],
    "howto/processor": ["exam", "isofit", "hytools", "envi", "topographic correction"],
    "howto/score": ["score"],
    "install": ["installation", "pip", "conda", "windows"],
    "large_scenes": ["cluster", "slurm", "memory", "resume", "dask"],
    "command_line": ["command", "command line", "cli", "option"],
    "instruments": ["instrument", "which instrument"],
    "scenario_keys": ["key", "scenario key"],
    "why_scatter": [
        "scatter",
        "why scatter",
        "why r2",
        "r2",
        "r²",
        "why is my r2 so low",
        "why is my r2 so high",
    ],
    "limits": ["licence", "license", "help", "bug", "support", "scope", "limits"],
    "nomenclature": ["fpar", "symbols", "units", "arp", "what is arp"],
}

myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_member_order = "bysource"
autodoc_typehints = "none"
numpydoc_show_class_members = False

sphinx_gallery_conf = {
    "examples_dirs": "gallery_src",
    "gallery_dirs": "gallery",
    "subsection_order": [
        "gallery_src/ground",
        "gallery_src/air",
        "gallery_src/instruments",
        "gallery_src/answers",
    ],
    "nested_sections": True,
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "capture_repr": (),
    "show_memory": False,
    "show_signature": False,
    "write_computation_times": False,
    "min_reported_time": 1000,
    "default_thumb_file": None,
    "image_scrapers": ("thumbnails.scrape",),
}

# A summary is a first sentence, and these do not end one.
autosummary.WELL_KNOWN_ABBREVIATIONS += ("Fig.", "Eq.", "Sect.")


def _cite(name, rawtext, text, lineno, inliner, options=None, content=None):
    """A citation from Markdown: {cite}`Tanre1990` does what [Tanre1990]_ does in a docstring."""
    shown = nodes.inline(rawtext, f"[{text}]")
    reference = pending_xref(
        rawtext, shown, refdomain="citation", reftype="ref", reftarget=text, refwarn=True
    )
    return [reference], []


def _skip(app, what, name, obj, skip, options):
    """Leave out what a class has by its making: unexplained tuple fields, a model's configuration."""
    made = name in ("model_config", "model_post_init") or str(
        getattr(obj, "__doc__", "")
    ).startswith("Alias for field number")
    return True if made else None


def _docstring(app, what, name, obj, options, lines):
    """A docstring as a page shows it, with the list of tables in the place of its path in the repository."""
    lines[:] = docstrings.readable(
        [line.replace("``data/README.md``", ":doc:`/data`") for line in lines]
    )


def _thumbnails(app):
    """Small pictures of the gallery: one panel of each page."""
    source = Path(app.srcdir, "gallery_src")
    for script in source.rglob("plot_*.py"):
        folder = Path(app.srcdir, "gallery", script.parent.relative_to(source))
        panel = thumbnails.panel_file(folder, script.stem)
        if panel.exists():
            target = folder / "images" / "thumb" / f"sphx_glr_{script.stem}_thumb.png"
            thumbnails.thumbnail(panel).save(target)


def _link_identifiers(app, docname, source):
    """Identifiers of publications in the list of references lead to them."""
    if docname == "references":
        source[0] = re.sub(
            r"doi:(10\.\S*[^\s.])", r"`doi:\1 <https://doi.org/\1>`__", source[0]
        )


def _index_words(app, docname, source):
    """Entries of the index below the title of a page, which the search lists before all else."""
    if words := SEARCH_WORDS.get(docname):
        entries = ", ".join(f"! {word}" for word in words)
        source[0] = re.sub(
            r"^# .*\n",
            rf"\g<0>\n```{{index}} {entries}\n```\n",
            source[0],
            count=1,
            flags=re.MULTILINE,
        )


def _signature(app, what, name, obj, options, signature, returns):
    """
    Signatures to read: defaults that are made anew and functions as `...`.

    A scenario has its sections by name, for their defaults, all keys with their values, fill a page.
    """
    if name == "fifesim.Scenario":
        return f"(*, {', '.join(obj.model_fields)})", returns
    return signature and re.sub(r"<(factory|built-in function \w+)>", "...", signature), returns


def _compute(app):
    """Compute long tables and pictures in another process, while this one draws the gallery."""
    pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))
    jobs = [pool.submit(each.write) for each in (make_why_scatter, make_explorer, make_bounds)]

    def finish(app):
        for job in jobs:
            job.result()
        pool.shutdown()

    app.connect("builder-inited", finish, priority=950)  # after the gallery is drawn


def setup(app):
    _compute(app)
    app.connect("autodoc-process-signature", _signature)
    app.connect("source-read", _link_identifiers)
    app.connect("source-read", _index_words)
    app.connect(
        "autodoc-process-docstring", _docstring, priority=100
    )  # before numpydoc reads it
    app.connect("builder-inited", _thumbnails, priority=900)  # after the gallery is drawn
    app.add_role("cite", _cite)
    app.connect("autodoc-skip-member", _skip)
