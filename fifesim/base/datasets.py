"""Find and read the tables of the data folder; ``data/README.md`` names the source of each."""

from functools import lru_cache
from pathlib import Path

import pandas as pd

_PACKAGE = Path(__file__).parents[1]


def path(name):
    """
    Path of a file of the data folder, in the wheel or in a checkout.

    Parameters
    ----------
    name : str
        Path relative to the data folder, such as ``"leaf_optics.csv"``.

    Returns
    -------
    path : pathlib.Path

    Raises
    ------
    FileNotFoundError
        If the installation lacks the file.
    """
    for folder in (_PACKAGE / "data", _PACKAGE.parent / "data"):
        if (folder / name).exists():
            return folder / name
    raise FileNotFoundError(f"the data file {name!r} is missing from this installation: reinstall fifesim")


@lru_cache
def _read(name):
    return pd.read_csv(path(name), comment="#")


def table(name):
    """
    A CSV table of the data folder; its header comments give source, units and columns.

    Parameters
    ----------
    name : str
        Path relative to the data folder.

    Returns
    -------
    table : pandas.DataFrame
        A copy, free to change.
    """
    return _read(name).copy()
