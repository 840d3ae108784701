"""Write the page with sliders, `_static/explore.html`, for the first link of the documentation."""

from pathlib import Path

import fifesim

PAGE = Path(__file__).parent / "_static" / "explore.html"
PACKAGE = Path(fifesim.__file__).parent


def write():
    """Write the page unless it is newer than the package, because its 432 simulations take a minute."""
    newest = max(path.stat().st_mtime for path in PACKAGE.rglob("*") if path.suffix != ".pyc")
    if not PAGE.exists() or PAGE.stat().st_mtime < newest:
        fifesim.experiments.explore(path=PAGE, overwrite=True)
