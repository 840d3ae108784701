"""
Simulate what a satellite would have seen.

Ground scene, canopy reflectance, atmosphere and sensor on georeferenced rasters, after Friedl, Davis, Michaelsen and
Moritz (1995). Importing this package registers the ``.fifesim`` accessor of xarray. The public names, and where they
live, are the lines of ``__init__.pyi``.
"""

from importlib import import_module
from importlib.metadata import version

from fifesim.accessor import PUBLIC, REMOVED, find
from fifesim.base.messages import nearest

__version__ = version("fifesim")

__all__ = ["__version__", *sorted(PUBLIC)]


def __getattr__(name):
    if name == "atmosphere":
        return import_module("fifesim.atmosphere")
    if name in REMOVED:
        raise AttributeError(f"fifesim.{name} was removed: {REMOVED[name]}")
    if name not in PUBLIC:
        raise AttributeError(f"module 'fifesim' has no attribute {name!r}: {nearest(name, PUBLIC)}dir(fifesim) has all")
    globals()[name] = find(name)
    return globals()[name]


def __dir__():
    return __all__
