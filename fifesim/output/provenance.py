"""With what results were made."""

import importlib.metadata
import platform

_PACKAGES = (
    "fifesim", "numpy", "scipy", "xarray", "dask", "numba", "rasterio", "odc-geo", "pvlib", "pyrsr", "matplotlib",
)  # fmt: skip


def versions():
    """
    Versions of Python and of the packages that numbers and pictures come from.

    Returns
    -------
    versions : dict of str to str
    """
    return {"python": platform.python_version()} | {name: importlib.metadata.version(name) for name in _PACKAGES}
