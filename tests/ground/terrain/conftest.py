"""What tests of labelled elevation share."""

import pytest
from elevations import labelled, model, write

import fifesim


@pytest.fixture
def path(tmp_path):
    return write(tmp_path / "hills.tif", *model())


@pytest.fixture
def dem(site):
    return labelled(site)


@pytest.fixture
def around():
    """Elevation 60 cells further than `site` on all sides."""
    return labelled(fifesim.fife_site(30 / 9, window=((30, 195), (120, 294))))
