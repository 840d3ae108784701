from odc.geo.xr import xr_coords

from fifesim.grids import sites
from fifesim.grids.grid import reference_of


def test_a_reference_is_that_of_its_grid_and_nobody_else_s():
    grids = sites.fife_site(30.0), sites.fife_site(30.0)[5:, 7:]
    for grid in grids:
        assert reference_of(grid).identical(xr_coords(grid)["spatial_ref"])
    reference_of(grids[0]).attrs.clear()
    assert reference_of(grids[0]).attrs == xr_coords(grids[0])["spatial_ref"].attrs
