"""Light is seen from where it was computed for, or it is refused."""

import dask.array as da
import numpy as np
import pytest
import xarray as xr
from lazy import no_compute

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.sensor.scan_labels import at_pixels, seen_alike

AWAY = {"nadir_offset": -60e3, "heading": 193.6}


def light(site, geometry):
    lai = xr.DataArray(np.full(site.shape, 2.0), dims=("y", "x")).odc.assign_crs(site.crs)
    lai = lai.assign_coords(fifesim.grids.grid.coordinates(site))
    air = fifesim.Atmosphere()
    return lai.fifesim.surface_reflectance("TM", bands=["TM3"], geometry=geometry, atmosphere=air).fifesim.to_toa()


def test_light_at_nadir_is_not_seen_from_the_side(site):
    toa = light(site, Geometry(30.0, 120.0))
    with pytest.raises(ValueError, match=r"another view, vza 0.0, than the scan, vza 5.4: up to 5.4 degrees"):
        toa.fifesim.sense_swath("TM", **AWAY)
    seen = toa.fifesim.sense_swath("TM", **AWAY, view_tolerance=180)
    assert float(seen["vza"].min()) > 5.3
    assert float(toa.fifesim.sense_swath("TM")["vza"].max()) < 0.02


def test_the_message_says_what_makes_it_right(site):
    """Typed as it stands, with the sun, it gives light that the scan takes."""
    with pytest.raises(ValueError) as refused:
        light(site, Geometry(30.0, 120.0)).fifesim.sense_swath("TM", **AWAY)
    said = str(refused.value)
    assert len(said) <= 500 and "\n" not in said
    typed = said[said.index("fifesim.scan_geometry(") : said.index(".assign(")]
    view = eval(typed, {"fifesim": fifesim, "grid": site})
    image = light(site, view.assign(sza=30.0, saa=120.0)).fifesim.sense_swath("TM", **AWAY, view_tolerance=0.01)
    assert float(image["vza"].mean()) == pytest.approx(float(view["vza"].mean()), abs=1e-3)


def test_light_from_the_other_side_is_refused(site):
    """Its zenith angle is right, and its azimuth is not."""
    west = fifesim.scan_geometry("TM", site, **AWAY)
    wrong = Geometry(30.0, 120.0, float(west["vza"].mean()), (float(west["vaa"].mean()) + 180) % 360)
    with pytest.raises(ValueError, match=r"10\.[78] degrees apart"):
        light(site, wrong).fifesim.sense_swath("TM", **AWAY)


def test_lazy_angles_are_looked_at_when_it_computes(site):
    view = fifesim.scan_geometry("TM", site, **AWAY, chunks=20).assign(sza=30.0, saa=120.0)
    with no_compute():
        right = light(site, view).fifesim.sense_swath("TM", **AWAY)
        wrong = light(site, view).fifesim.sense_swath("TM", nadir_offset=60e3, heading=193.6)
    eager = light(site, view.compute()).fifesim.sense_swath("TM", **AWAY)
    xr.testing.assert_identical(right.compute(), eager)
    with pytest.raises(ValueError, match="another view"):
        wrong.compute()


def test_pixels_have_the_angles_of_the_cells_in_which_they_lie():
    values = np.arange(12.0).reshape(3, 4)
    row, column = np.array([[-0.2, 0.9], [2.0, 3.7]]), np.array([[0.0, 1.5], [3.99, 9.0]])
    for data in (values, da.from_array(values, chunks=(2, 3))):
        geometry = xr.Dataset(
            {"sza": (("x", "y"), data.T), "saa": 120.0, "vza": 0.0, "vaa": 0.0, "earth_sun_distance": 1.0}
        )
        found = at_pixels(geometry, row, column)
        np.testing.assert_array_equal(found["sza"], [[0, 1], [11, 11]])
        assert found["sza"].dims == ("line", "sample") and float(found["saa"]) == 120
    assert at_pixels(Geometry(30.0, 120.0), row, column) == Geometry(30.0, 120.0)


def test_no_data_are_seen_from_anywhere():
    """Light of cells that the scan does not see has no view."""
    means = xr.DataArray([[[np.nan, 1.0]]], dims=("band", "line", "sample"))
    vza = xr.DataArray(da.from_array([[np.nan, 3.0]]), dims=("line", "sample"))
    geometry = xr.Dataset({"sza": 30.0, "saa": 120.0, "vza": vza, "vaa": 0.0})
    view = np.array([[50.0, 3.5]]), np.zeros((1, 2))
    assert seen_alike(means, geometry, view, 1.0, "").equals(means)
    with pytest.raises(ValueError, match="view_tolerance must be"):
        seen_alike(means, geometry, view, -1.0, "")
