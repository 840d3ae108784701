"""Shared fixtures for tests of rasters."""

import os

# One BLAS thread, as commands use by default; set before numpy is imported. Threads for small matrices mostly wait for
# each other, and more so where several workers run tests.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from lazy import CHUNKS, ODD_CHUNKS, in_chunks

import fifesim

# Examples are the same in each run. With FIFESIM_DRAWS, the scheduled job draws that many new examples, and prints how
# to reproduce a failure.
_COMMON = {"deadline": None, "database": None, "print_blob": True, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("fixed", derandomize=True, **_COMMON)
settings.register_profile("random", derandomize=False, **_COMMON)
settings.load_profile("random" if "FIFESIM_DRAWS" in os.environ else "fixed")


@pytest.fixture(params=[None, CHUNKS, ODD_CHUNKS], ids=["numpy", "chunked", "odd-chunks"])
def array_type(request):
    """Function that returns a raster in memory, in chunks, or in odd chunks."""
    return lambda raster: raster if request.param is None else in_chunks(raster, request.param)


@pytest.fixture(scope="session")
def site():
    """45 x 54 cells inside the FIFE site: 5 x 6 pixels of 30 m."""
    return fifesim.fife_site(30 / 9, window=((90, 135), (180, 234)))


@pytest.fixture(scope="session")
def lai_values(site):
    """LAI of the streaming scene on `site`, computed once; tests use copies."""
    return fifesim.lai_scene(site, "burned-grazed", arp=0.15, seed=7)


@pytest.fixture
def lai(lai_values):
    return lai_values.copy(deep=True)


@pytest.fixture
def lai_with_hole(lai):
    lai[20:24, 30:33] = np.nan
    return lai


def contract_of(site, **chunks):
    lai = fifesim.lai_scene(site, "burned-grazed", arp=0.15, seed=7, **chunks)
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], dem=None)
    toa = rho.fifesim.to_toa()
    image = toa.fifesim.sense("TM")
    ndvi = image.fifesim.ndvi()
    truth = lai.fifesim.aggregate(30)
    return {"lai": lai, "rho": rho, "toa": toa, "image": image, "ndvi": ndvi, "truth": truth}


@pytest.fixture(scope="session")
def contract():
    """Function that runs the basic chain, from LAI to NDVI."""
    return contract_of


@pytest.fixture(scope="session")
def whole(site):
    """Results of the basic chain in memory."""
    return contract_of(site)
