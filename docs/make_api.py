"""Write the page of the public names, by group, from the table of the package."""

from pathlib import Path

from fifesim.accessor import PUBLIC

PAGE = Path(__file__).parent / "api" / "functions.rst"

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
    found = {}
    for name, public in PUBLIC.items():
        found.setdefault(public.group, []).append(name)
    return found


def functions():
    """
    Page of the public names.

    Returns
    -------
    page : str
    """
    return _HEAD + "".join(_group(group, names) for group, names in groups().items())


def _group(group, names):
    listed = "\n".join(f"   {PUBLIC[name].path.removeprefix('fifesim.')}" for name in names)
    parts = [f"\n{group}\n{'-' * len(group)}\n", _SUMMARY.format(names=listed)]
    for kind, called in (
        ("DataArray", "a raster"),
        ("DataTree", "a DataTree, as from ``compare`` or ``sense``"),
    ):
        if methods := [f"``{name}``" for name in names if kind in PUBLIC[name].methods_of]:
            parts.append(f"\nMethods of {called}: {', '.join(methods)}.\n")
    return "".join(parts)


def write():
    """Write the page, and remove pages of names that are no longer public."""
    PAGE.parent.mkdir(exist_ok=True)
    names = {public.path for public in PUBLIC.values()}
    for page in PAGE.parent.rglob("*.rst"):
        if page.stem not in names:
            page.unlink()
    PAGE.write_text(functions(), encoding="utf-8")
