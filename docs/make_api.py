"""Write the page of the public names, by group, from the table of the package."""

from itertools import groupby
from pathlib import Path

from fifesim.accessor import PUBLIC

PAGE = Path(__file__).parent / "api" / "functions.rst"

# Functions of a module of the API that is public as a whole.
_BESIDE = {"Atmosphere": ["atmosphere.spectrum"]}

_HEAD = """Functions and classes
=====================

All public names by group. A function of a raster is also a method of the ``.fifesim`` accessor:
``fifesim.ndvi(image)`` is ``image.fifesim.ndvi()``. ``fifesim.__version__`` is the version.

.. currentmodule:: fifesim
"""
_SUMMARY = "\n.. autosummary::\n   :toctree: names\n   :nosignatures:\n\n{names}\n"


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
    Page of the public names.

    Returns
    -------
    page : str
    """
    return _HEAD + "".join(_group(group, names) for group, names in groups().items())


def _group(group, names):
    listed = "\n".join(f"   {name}" for name in names + _BESIDE.get(group, []))
    parts = [f"\n{group}\n{'-' * len(group)}\n", _SUMMARY.format(names=listed)]
    for kind, called in (("DataArray", "a raster"), ("DataTree", "the result of ``compare``")):
        if methods := [f"``{name}``" for name in names if kind in PUBLIC[name].methods_of]:
            parts.append(f"\nMethods of {called}: {', '.join(methods)}.\n")
    return "".join(parts)


def write():
    """Write the page, and remove pages of names that are no longer public."""
    PAGE.parent.mkdir(exist_ok=True)
    names = [
        name for group, listed in groups().items() for name in listed + _BESIDE.get(group, [])
    ]
    for page in PAGE.parent.rglob("*.rst"):
        if page.stem.removeprefix("fifesim.") not in names:
            page.unlink()
    PAGE.write_text(functions(), encoding="utf-8")
