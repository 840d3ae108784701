"""The API pages: public names by group, from the table of the package, and every module of physics."""

from itertools import groupby
from pathlib import Path

import fifesim
from fifesim.accessor import PUBLIC

PAGES = Path(__file__).parent / "api"
PACKAGE = Path(fifesim.__file__).parent
PHYSICS = ("base", "ground", "atmosphere", "sensor", "analysis")

# Modules of the lowest folder that have no formula.
_MACHINERY = {
    f"base.{name}"
    for name in ("annotations", "arguments", "caches", "files", "messages", "times")
}

# Functions of a module of the API that is public as a whole.
_BESIDE = {"Atmosphere": ["atmosphere.spectrum"]}

_TITLE = "{title}\n{line}\n\n{text}\n\n.. currentmodule:: fifesim\n"
_SUMMARY = "\n.. autosummary::\n   :toctree: names\n{options}   :nosignatures:\n\n{names}\n"


def groups():
    """
    Public names by group.

    Returns
    -------
    groups : dict of str to list of str
    """
    return {
        group: list(dict(members))
        for group, members in groupby(PUBLIC.items(), key=lambda item: item[1].group)
    }


def functions():
    """
    Pages of the public names, one for each group and one that leads to them.

    Returns
    -------
    pages : dict of str to str
        By file name.
    """
    text = (
        "Functions of a raster are methods of the ``.fifesim`` accessor too: ``fifesim.ndvi(image)`` is "
        "``image.fifesim.ndvi()``. ``fifesim.__version__`` is the version."
    )
    pages = {_file(group): _group(group, names) for group, names in groups().items()}
    listed = "".join(f"   {Path(name).stem}\n" for name in pages)
    return {
        "functions.rst": _heading("Functions and classes", text)
        + f"\n.. toctree::\n   :maxdepth: 2\n\n{listed}"
    } | pages


def _file(group):
    return group.lower().replace(" ", "_").replace("'", "") + ".rst"


def _group(group, names):
    parts = [_heading(group, ""), _summary(names + _BESIDE.get(group, []))]
    for kind, called in (("DataArray", "a raster"), ("DataTree", "what ``compare`` returns")):
        if methods := [f"``{name}``" for name in names if kind in PUBLIC[name].methods_of]:
            parts.append(f"\nMethods of {called}: {', '.join(methods)}.\n")
    return "".join(parts)


def modules():
    """
    Names of the modules of physics.

    Returns
    -------
    names : list of str
    """
    paths = (
        path for folder in PHYSICS for path in sorted((PACKAGE / folder).rglob("[a-z]*.py"))
    )
    dotted = [".".join(path.relative_to(PACKAGE).with_suffix("").parts) for path in paths]
    return [
        name
        for name in dotted
        if not name.endswith((".labels", "_labels")) and name not in _MACHINERY
    ]


def physics():
    """
    Page of the modules of physics.

    Returns
    -------
    page : str
    """
    text = "Functions of numpy arrays, for those who need a single equation. They may change between versions."
    options = "   :template: module.rst\n"
    parts = [_heading("Physics", text)]
    for folder, names in groupby(modules(), key=lambda name: name.rpartition(".")[0]):
        parts.append(
            f"\n.. rubric:: {folder.replace('.', ', ')}\n"
            + _summary([f"~{name}" for name in names], options)
        )
    return "".join(parts)


def write():
    """Write the pages."""
    PAGES.mkdir(exist_ok=True)
    for name, page in functions().items():
        (PAGES / name).write_text(page, encoding="utf-8")
    (PAGES / "physics.rst").write_text(physics(), encoding="utf-8")


def _heading(title, text):
    return _TITLE.format(title=title, line="=" * len(title), text=text)


def _summary(names, options=""):
    return _SUMMARY.format(options=options, names="\n".join(f"   {name}" for name in names))
