"""What a file of a run was made of, as tags of the file itself."""

import json
import os
from pathlib import Path

from fifesim.output.provenance import versions
from fifesim.scenario.toml import write_scenario

SCENARIO, PRODUCT, VERSIONS = "FIFESIM_SCENARIO", "FIFESIM_PRODUCT", "FIFESIM_VERSIONS"


def origin_tags(scenario, product, folder):
    """
    Tags from which a file of a run can be made again.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
        Complete.
    product : str
        Name of the file in the folder of a run.
    folder : str or path
        Where the file is to lie. Files of the scenario are named relative to it, so that the tags tell nothing of the
        machine, and hold where both are moved.

    Returns
    -------
    tags : dict of str to str
    """
    home = os.path.abspath(folder)
    text = write_scenario(scenario.with_paths(lambda path: _beside(path, home)))
    return {SCENARIO: text, PRODUCT: product, VERSIONS: json.dumps(versions())}


def _beside(path, home):
    """A path relative to a folder; of GDAL's virtual files, and on another drive, as it is."""
    if not os.path.isfile(path):
        return path
    try:
        return Path(os.path.relpath(path, home)).as_posix()
    except ValueError:
        return path
