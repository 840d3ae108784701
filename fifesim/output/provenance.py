"""With what results were made."""

import importlib.metadata
import platform
from functools import cache

_PACKAGES = (
    "fifesim", "numpy", "scipy", "xarray", "dask", "numba", "rasterio", "odc-geo", "pvlib", "pyrsr", "matplotlib",
)  # fmt: skip

# Each asks for a file to be parsed, and a run says them five times.
_version = cache(importlib.metadata.version)


def versions():
    """
    Versions of Python and of the packages that numbers and pictures come from.

    Returns
    -------
    versions : dict of str to str
    """
    return {"python": platform.python_version()} | {name: _version(name) for name in _PACKAGES}
