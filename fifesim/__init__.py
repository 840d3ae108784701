"""
Simulate what a satellite would have seen.

Ground scene, canopy reflectance, atmosphere and sensor on georeferenced rasters, after Friedl, Davis, Michaelsen and
Moritz (1995). Importing this package registers the ``.fifesim`` accessor of xarray. The public names, and where they
live, are the lines of ``__init__.pyi``.
"""

from importlib import import_module
from importlib.metadata import version
from warnings import warn

from fifesim.accessor import NAMESPACES, PUBLIC, REMOVED, find
from fifesim.base.messages import nearest

__version__ = version("fifesim")

__all__ = ["__version__", *NAMESPACES, *sorted(name for name, public in PUBLIC.items() if not public.namespace)]


def __getattr__(name):
    if name in NAMESPACES:
        return import_module(f"fifesim.{name}")
    if name in REMOVED:
        raise AttributeError(f"fifesim.{name} was removed: {REMOVED[name]}")
    if name not in PUBLIC:
        raise AttributeError(f"module 'fifesim' has no attribute {name!r}: {nearest(name, PUBLIC)}dir(fifesim) has all")
    if PUBLIC[name].namespace:
        warn(f"fifesim.{name} is now {PUBLIC[name].path}: the next version removes the old name", FutureWarning, 2)
        return find(name)
    globals()[name] = find(name)
    return globals()[name]


def __dir__():
    return __all__
