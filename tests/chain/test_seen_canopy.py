"""Canopy and atmosphere in one pass equal two passes to the bit; one pass is used if cells differ only in leaf area."""

import dask
import numpy as np
import pytest
import xarray as xr
from lazy import no_compute

import fifesim
from fifesim.chain.landscapes import seen_reflectance, seen_through_air
from fifesim.grids.windows import origin_of

GRID = fifesim.fife_site(30 / 9, window=((0, 90), (0, 72)))
BANDS = ["TM2", "TM3", "TM4"]


def scene(chunks=None):
    lai = fifesim.lai_scene(GRID, arp=0.15, seed=7, chunks=chunks)
    return lai.copy(data=xr.where(lai.data < 1.9, lai.data, np.nan) if chunks is None else lai.data)


def chains(lai, exact=False, **canopy):
    reflectance = lai.fifesim.surface_reflectance("TM", bands=BANDS, canopy=fifesim.Canopy(**canopy), exact=exact)
    return reflectance, reflectance.fifesim.to_toa()


@pytest.mark.parametrize("canopy", [{}, {"hotspot": 0.1, "soil": 0.05}], ids=["plain", "hot spot, bright soil"])
def test_one_pass_equals_two_passes_to_the_bit(canopy):
    with no_compute():
        reflectance, lazy = chains(scene({"y": 31, "x": 29}), **canopy)
        assert seen_through_air(reflectance) is not None
    assert not any(name in lazy.data.dask.layers for name in reflectance.data.dask.layers if "call" in name)
    xr.testing.assert_identical(lazy.compute(), chains(scene({"y": 31, "x": 29}).compute(), **canopy)[1])


@pytest.mark.parametrize("canopy", [{"brown": 0.2}, {"crown_cover": 0.7}, {"exact": True}], ids=lambda each: str(each))
def test_other_canopies_use_two_passes(canopy):
    reflectance, lazy = chains(scene({"y": 90, "x": 40}), **canopy)
    assert seen_through_air(reflectance) is None
    xr.testing.assert_identical(lazy.compute(), chains(scene({"y": 90, "x": 40}).compute(), **canopy)[1])


def test_changed_reflectance_is_not_recomputed():
    reflectance, _ = chains(scene({"y": 90, "x": 40}))
    halved = (0.5 * reflectance).assign_attrs(reflectance.attrs)
    assert seen_through_air(halved) is None and seen_through_air(reflectance.compute()) is None
    half = halved.fifesim.to_toa().compute()
    assert float(half.mean()) < 0.9 * float(reflectance.fifesim.to_toa().mean())


def test_missing_cells_are_missing():
    lai = np.array([[0.0, np.nan, 2.5]])
    canopy = origin_of(chains(scene({"y": 90, "x": 40}))[0])
    names = ("path_reflectance", "transmittance_down", "transmittance_up", "spherical_albedo", "gas_transmittance")
    clear = dict(zip(names, np.repeat([[0.0], [1.0], [1.0], [0.0], [1.0]], 3, axis=1), strict=True))
    found = seen_reflectance(lai, background=canopy.background, scene=canopy.scene, terms=clear)
    assert np.isnan(found[:, 0, 1]).all()
    # Without atmosphere, bare ground has the reflectance of the background.
    np.testing.assert_allclose(found[:, 0, 0], canopy.background, rtol=1e-9)


@pytest.mark.parametrize(("lai", "message"), [(-1.0, "negative"), (35.0, "at most 20")])
def test_invalid_leaf_area_is_rejected(lai, message):
    cells = scene({"y": 90, "x": 40})
    toa = chains(cells.copy(data=cells.data * 0 + lai))[1]
    with pytest.raises(ValueError, match=message):
        toa.compute()


def test_image_and_index_are_the_same_together_and_alone():
    """Computed together and with the truth, they are identical to the bit to separate computations."""
    lai = scene({"y": 45, "x": 36})
    toa = chains(lai)[1]
    image = toa.fifesim.sense("TM")
    ndvi, truth = image.fifesim.ndvi(), lai.fifesim.aggregate(30)
    whole = xr.Dataset({"dn": image, "ndvi": ndvi})
    *together, dataset = dask.compute(image, ndvi, truth, whole)
    for one, alone in zip([*together, dataset["dn"], dataset["ndvi"]], (image, ndvi, truth, image, ndvi), strict=True):
        np.testing.assert_array_equal(one, alone.compute())


def test_image_and_index_together_compute_the_scene_once():
    made = []

    def counted(block):
        made.append(block.shape)
        return block

    lai = scene({"y": 45, "x": 36})
    lai = lai.copy(data=lai.data.map_blocks(counted, dtype=float, meta=np.empty((0, 0))))
    image = chains(lai)[1].fifesim.sense("TM")
    dask.compute(image, image.fifesim.ndvi(), lai.fifesim.aggregate(30), scheduler="synchronous")
    assert len(made) == lai.data.npartitions
