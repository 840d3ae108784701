"""A page with sliders as a file."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from fifesim.base.annotations import FilePath
from fifesim.experiments.explorer.outcomes import outcomes_of
from fifesim.experiments.explorer.page import explorer_page
from fifesim.experiments.explorer.settings import sweep_of
from fifesim.output.progress import steps
from fifesim.scenario.scenario import Scenario


def explore(scenario: Scenario | None = None, path: FilePath = "explore.html", *, overwrite: bool = False) -> Path:
    """
    A page to play with: sliders over simulations of a scenario; computes.

    Scene, image, scatter plot and budget of the scatter, for every setting of leaf area's patches, haze, sun,
    instrument and registration error. The page needs nothing but a browser.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario, optional
        Sliders begin at its values, on the ground in the middle of its grid. By default the paper's case with patches
        of 32 m, on level ground.
    path : str or path, optional
        Of the HTML file.
    overwrite : bool, optional
        Replace a file of that name.

    Returns
    -------
    path : pathlib.Path

    Raises
    ------
    ValueError
        If the file exists, or the scenario cannot be shown; nothing is written then.

    See Also
    --------
    fifesim.budget, fifesim.sweep

    Examples
    --------
    Some minutes of simulations:

    >>> import fifesim
    >>> fifesim.explore(fifesim.Scenario(), "mine.html")  # doctest: +SKIP
    """
    if scenario is not None and not isinstance(scenario, Scenario):
        raise TypeError(f"explore takes a Scenario, got {type(scenario).__name__}: see fifesim.read_scenario")
    path = Path(path)
    check_file(path, overwrite)
    sweep = sweep_of(scenario)
    html = explorer_page(sweep, outcomes_of(sweep, lambda settings: steps(settings, "simulating")))
    path.parent.mkdir(parents=True, exist_ok=True)
    # The file appears under its name when it is whole.
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        whole = Path(folder) / path.name
        whole.write_text(html, encoding="utf-8")
        os.replace(whole, path)
    return path


def check_file(path, overwrite):
    """
    Refuse a file of a page that is in the way.

    Parameters
    ----------
    path : pathlib.Path
    overwrite : bool

    Raises
    ------
    ValueError
        If it is a folder, or exists and ``overwrite`` is off.
    """
    if path.is_dir():
        raise ValueError(f"{str(path)!r} is a folder, and explore writes one page: type -o {path}/explore.html")
    if path.exists() and not overwrite:
        raise ValueError(f"the page {str(path)!r} exists: name another with -o, or add --overwrite")
