"""Tables of independent results."""

from pathlib import Path

import pandas as pd

FOLDER = Path(__file__).parents[1] / "data" / "verification"


def table(name):
    """Table of a name in ``tests/data/verification``."""
    return pd.read_csv(FOLDER / name, comment="#")
