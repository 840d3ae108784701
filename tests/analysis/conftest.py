"""Pairs of rasters for the tests of regression."""

import numpy as np
import pytest

import fifesim

CELL = 30 / 9


@pytest.fixture(scope="session")
def scattered():
    """LAI from 0.2 to 2.2, and NDVI on a line with noise of known standard deviation."""
    grid = fifesim.fife_site(CELL, window=((0, 300), (0, 300)))
    lai = fifesim.lai_scene(grid, arp=0.0, seed=2)
    rng = np.random.default_rng(8)
    lai = lai.copy(data=rng.uniform(0.2, 2.2, lai.shape))
    ndvi = (0.1 + 0.3 * lai + rng.normal(0, 0.03, lai.shape)).rename("ndvi")
    return lai, ndvi


@pytest.fixture
def pair(lai):
    """LAI as a linear function of itself, with a little noise."""
    x = lai.rename("ndvi")
    noise = np.random.default_rng(5).normal(0, 0.1, lai.shape)
    return (2 * lai + 1 + noise).rename("lai"), x
