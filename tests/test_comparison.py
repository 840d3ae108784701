"""One scene through many instruments."""

from dataclasses import replace

import dask
import numpy as np
import pytest
import xarray as xr
from lazy import in_chunks, no_compute

import fifesim
from fifesim import grid as grids
from fifesim.ground.optics import background

NAMES = ["TM", "OLI", "MSI"]


def test_each_image_is_that_of_the_chain(lai):
    images = fifesim.compare(lai, ["TM", "OLI"])
    assert isinstance(images, xr.DataTree) and list(images.children) == ["TM", "OLI"]
    rho = fifesim.surface_reflectance(lai, "TM", bands=["TM3", "TM4"])
    xr.testing.assert_identical(images["TM"]["dn"], rho.fifesim.to_toa().fifesim.sense("TM"))
    oli = images["OLI"]["dn"]
    names = ["OLI4", "OLI5"]
    assert oli.dtype == np.uint16 and oli["band"].values.tolist() == names
    leaves = dict(zip(names, [(0.07, 0.04), (0.45, 0.42)], strict=True))
    soil = dict(zip(names, background(["TM3", "TM4"]).tolist(), strict=True))
    rho = fifesim.surface_reflectance(lai, "OLI", bands=names, leaf_optics=leaves, background=soil)
    xr.testing.assert_identical(oli, rho.fifesim.to_toa().fifesim.sense("OLI"))


def test_each_has_its_own_grid_and_red_and_near_infrared(lai):
    images = fifesim.compare(lai, NAMES)
    assert {name: grids.cell_size(grids.geobox(images[name]["dn"]))[0] for name in NAMES} == {
        "TM": 30.0,
        "OLI": 30.0,
        "MSI": 10.0,
    }
    for name in NAMES:
        red, nir = images[name]["dn"]["wavelength"].values
        assert 0.6 < red < 0.7 and 0.75 < nir < 1.0
        ndvi = fifesim.ndvi(images[name]["dn"])
        assert 0.2 < float(ndvi.mean()) < 0.7


def test_one_pass_makes_them_all(lai):
    """Lazy until asked, the same bits, and each chunk of the scene is read once."""
    reads = []

    def read(block):
        reads.append(block.shape)
        return block

    with no_compute():
        scene = in_chunks(lai, {"y": 23, "x": 27})
        scene = scene.copy(data=scene.data.map_blocks(read, meta=np.empty((0, 0))))
        images = fifesim.compare(scene, NAMES)
    arrays = dask.compute(*(images[name]["dn"] for name in NAMES), scheduler="synchronous")
    assert len(reads) == 4
    for name, array in zip(NAMES, arrays, strict=True):
        xr.testing.assert_identical(array, fifesim.compare(lai, [name])[name]["dn"])


def test_bands_and_options_reach_the_instruments(lai):
    images = fifesim.compare(
        lai, ["TM", "OLI"], bands={"TM": ["TM2", "TM5"]}, interval=(20.0, 25.0), quantise=False, background=0.2,
        leaf_optics={"TM2": (0.16, 0.12), "TM5": (0.28, 0.31)} | dict.fromkeys(("OLI4", "OLI5"), (0.3, 0.3)),
    )  # fmt: skip
    assert images["TM"]["toa_radiance"]["band"].values.tolist() == ["TM2", "TM5"]
    for name in ("TM", "OLI"):
        assert grids.cell_size(grids.geobox(images[name]["toa_radiance"])) == (20.0, 25.0)


@pytest.mark.parametrize(
    ("instruments", "options", "message"),
    [
        (["TM", "tm"], {}, "each once"),
        ([], {}, "at least one"),
        (["TM"], {"bands": {"OLI": ["B4"]}}, "OLI, which is not compared"),
        (["TM", "MT"], {}, "MT"),
    ],
)
def test_what_cannot_be_compared_is_refused(lai, instruments, options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.compare(lai, instruments, **options)


def test_a_band_without_optics_is_named(lai):
    tm = fifesim.instrument("TM")
    odd = replace(tm.bands[0], name="odd", srf=fifesim.instrument("MODIS").bands[4].srf)
    with pytest.raises(ValueError, match=r"no leaf optics near odd at 1\.2.*give leaf_optics="):
        fifesim.compare(lai, [replace(tm, bands=(*tm.bands, odd))], bands={"TM": ["odd"]})
