"""Rasters that lost their CRS fit where they lie on the cells of one that has it, and nowhere else."""

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks, no_compute

import fifesim
from fifesim.grids import grid as grids
from fifesim.grids.grid import with_crs_of

TM34 = ["TM3", "TM4"]


def lost(raster):
    """What `xr.where` leaves of a raster: the same numbers and places, the CRS gone."""
    out = xr.where(np.isfinite(raster), raster.drop_vars("spatial_ref"), np.nan)
    assert out.odc.crs is None
    return out


def test_gets_the_crs_of_its_cells(lai, site):
    found = with_crs_of(lost(lai), lai)
    assert grids.same_grid(grids.geobox(found), site)
    np.testing.assert_array_equal(found, lai)
    assert with_crs_of(lai, lost(lai)) is lai
    emptied = xr.where(lai > 1.5, 0.1, 0.3)  # the coordinate stays, without what it said
    assert "spatial_ref" in emptied.coords and grids.same_grid(grids.geobox(with_crs_of(emptied, lai)), site)


@pytest.mark.parametrize("change", ["shifted", "smaller", "without coordinates"])
def test_other_cells_stay_without(lai, change):
    other = lost(lai)
    other = {
        "shifted": other.assign_coords(x=other["x"] + 1),
        "smaller": other.isel(x=slice(5)),
        "without coordinates": other.drop_vars(["x", "y"]),
    }[change]
    assert with_crs_of(other, lai) is other
    with pytest.raises(ValueError, match=r"no CRS.*xr\.where drops it"):
        lai.fifesim.surface_reflectance(bands=TM34, canopy=fifesim.Canopy(background=other * 0.01))


def test_every_combination_of_rasters_takes_one(lai):
    """Background, elevation, angles, surroundings and pairs; to the bit as with the CRS."""
    soil, dem = (lai * 0.01).clip(0, 1), lai * 20 + 300
    rho = lai.fifesim.surface_reflectance(bands=TM34)

    def steps(of):
        sza = of(30 + lai.drop_attrs(deep=False))
        yield lai.fifesim.surface_reflectance(bands=TM34, canopy=fifesim.Canopy(background=of(soil)))
        yield lai.fifesim.surface_reflectance(bands=TM34, dem=of(dem.drop_attrs(deep=False)))
        yield lai.fifesim.surface_reflectance(bands=TM34, geometry=xr.Dataset({"sza": sza, "saa": 100.0}))
        yield rho.fifesim.kt(of(dem.drop_attrs(deep=False)))
        yield rho.fifesim.to_toa(elevation=of(dem.drop_attrs(deep=False)))
        yield rho.fifesim.to_toa(adjacency=True, surroundings=of(rho.drop_attrs(deep=False)))
        yield xr.DataArray(fifesim.regress(lai, of(soil)).slope)
        yield xr.DataArray(fifesim.regress(of(soil), lai).slope)

    for kept, without in zip(steps(lambda raster: raster), steps(lost), strict=True):
        xr.testing.assert_equal(without, kept)
        if kept.ndim:
            assert grids.same_grid(grids.geobox(without), grids.geobox(kept))


def test_stays_lazy(lai):
    soil = in_chunks(lost(lai * 0.01), ODD_CHUNKS)
    with no_compute():
        found = in_chunks(lai, ODD_CHUNKS).fifesim.surface_reflectance(
            bands=TM34, canopy=fifesim.Canopy(background=soil)
        )
    whole = lai.fifesim.surface_reflectance(bands=TM34, canopy=fifesim.Canopy(background=lai * 0.01))
    xr.testing.assert_equal(found.compute(), whole)
