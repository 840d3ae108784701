"""What is taken for an elevation model, and what is refused."""

import warnings
from contextlib import nullcontext

import numpy as np
import pytest
import xarray as xr
from lazy import no_compute

import fifesim
from fifesim.grids import grid as grids
from fifesim.ground.terrain.source_labels import beside_altitude, source_resolution


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


@pytest.mark.parametrize(
    ("low", "high", "altitude", "said"),
    [
        (
            1239,
            1393,
            0.4,
            r"1239 to 1393 m beside .* of 0.4 km: where they are feet, take dem .*Atmosphere.altitude=1.3",
        ),
        (656, 700, 0.2, "feet"),
        (2500, 3100, 1.5, "1.5 km: give fifesim.Atmosphere.altitude=2.8"),
        (0, 100, 2.0, "2 km: give fifesim.Atmosphere.altitude=0.1"),
        (320, 440, 0.4, None),
        (300, 2000, 0.4, None),
        (-50, 120, 0.0, None),
    ],
)
def test_elevations_of_another_place_than_the_air_are_told(site, low, high, altitude, said):
    """At once, or when lazy ones compute; by their mean, their height may also be right."""
    cells = np.linspace(low, high, site.shape.y * site.shape.x).reshape(site.shape)
    cells[0, 0] = np.nan
    dem = grids.place(xr.DataArray(cells, dims=("y", "x")), site)
    expected = pytest.warns(UserWarning, match=said) if said else nullcontext()
    with warnings.catch_warnings():
        warnings.simplefilter("error" if said is None else "always")
        with expected:
            assert beside_altitude(dem, altitude) is dem
        with no_compute():
            lazy = beside_altitude(dem.chunk(), altitude)
        with expected:
            np.testing.assert_array_equal(lazy.compute(scheduler="synchronous"), cells)


def test_masked_elevation_is_refused_in_a_line(dem):
    with pytest.raises(TypeError, match=r"^dem must be an xarray\.DataArray over \(y, x\), got a masked numpy array"):
        fifesim.slope(np.ma.masked_less(dem.values, 0))
    with pytest.raises(ValueError, match=r"^the dem marks missing cells as -9999, .*masked=True"):
        fifesim.slope(dem.assign_attrs(_FillValue=-9999.0))
