"""What is taken for an elevation model, and what is refused."""

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.ground.terrain.rasters.dem import source_resolution


@pytest.mark.parametrize("units", ["ft", "US survey foot", "km"])
def test_other_units_are_refused(dem, units):
    dem.attrs["units"] = units
    with pytest.raises(ValueError, match=f"units '{units}', dem needs 'm'"):
        fifesim.slope(dem)


def test_units_may_be_spelled_out(dem):
    xr.testing.assert_identical(fifesim.slope(dem.assign_attrs(units="metre")), fifesim.slope(dem))


def test_geographic_and_unplaced_elevation_are_refused(dem):
    degrees = dem.drop_vars("spatial_ref").assign_coords(y=39 - 1e-4 * np.arange(45), x=-96 + 1e-4 * np.arange(54))
    with pytest.raises(ValueError, match="geographic CRS"):
        fifesim.sky_view(degrees.rio.write_crs("EPSG:4326"))
    with pytest.raises(ValueError, match="no CRS"):
        fifesim.slope(dem.drop_vars("spatial_ref"))
    with pytest.raises(ValueError, match="north up"):
        fifesim.slope(dem.isel(y=slice(None, None, -1)))


def test_a_dem_of_integers_is_an_elevation_and_an_undeclared_mark_is_not(dem):
    whole = dem.round().astype("int16").assign_attrs(dem.attrs)
    np.testing.assert_array_equal(fifesim.slope(whole), fifesim.slope(whole.astype(float).assign_attrs(dem.attrs)))
    with pytest.raises(ValueError, match="masked=True"):
        fifesim.slope(dem.rio.write_nodata(-9999.0))
    with pytest.raises(TypeError, match=r"dem must be an xarray.DataArray .* fine_dem"):
        fifesim.slope("hill.tif")


def test_resolution_of_the_source_is_given_or_carried_or_thirty_metres(dem):
    assert source_resolution(dem) == 30.0
    assert source_resolution(dem.assign_attrs(source_resolution=10.0)) == 10.0
    assert source_resolution(dem.assign_attrs(source_resolution=10.0), 12.5) == 12.5
    for wrong in (0.0, -3.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="must be positive metres"):
            source_resolution(dem, wrong)
