"""Shared fixtures for tests of labelled elevation."""

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
    """Elevation that extends 60 cells beyond `site` on all sides."""
    return labelled(fifesim.fife_site(30 / 9, window=((30, 195), (120, 294))))
