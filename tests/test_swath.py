"""Sun and view angles that vary over the scene, from LAI to digital numbers."""

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim
from fifesim.grids import directions

BANDS = ["TM3", "TM4"]


def ramp(lai, low, high):
    """Raster on the grid of `lai` that increases to the east."""
    values = np.broadcast_to(np.linspace(low, high, lai.sizes["x"]), lai.shape)
    return lai.copy(data=values).drop_attrs(deep=False)


def by_cell(sza, saa, vza, vaa):
    """Geometry with some angles as rasters."""
    return xr.Dataset({"sza": sza, "saa": saa, "vza": vza, "vaa": vaa})


@pytest.fixture
def swath(lai):
    return by_cell(ramp(lai, 25.0, 31.0), 117.0, ramp(lai, 0.0, 50.0), ramp(lai, 350.0, 370.0))


def test_each_cell_uses_its_angles(lai, swath):
    """Compared with single geometries; the skylight fraction is interpolated over sza to 1e-6."""
    rho = lai.fifesim.surface_reflectance("TM", bands=BANDS, geometry=swath)
    for column in (0, 20, lai.sizes["x"] - 1):
        own = fifesim.Geometry(
            *(float(getattr(swath, n)[0, column]) if n != "saa" else 117.0 for n in ("sza", "saa", "vza", "vaa"))
        )
        alone = lai.fifesim.surface_reflectance("TM", bands=BANDS, geometry=own, exact=True)
        np.testing.assert_allclose(rho[..., column], alone[..., column], rtol=0, atol=1e-6)


def test_reflectance_follows_the_raster_rules(lai_with_hole, swath):
    result = check_raster_function(
        lambda array: fifesim.surface_reflectance(array, "TM", bands=BANDS, geometry=swath),
        lai_with_hole,
        quantity="surface_reflectance",
    )
    assert directions.varying(directions.geometry_of(result)) == ("sza", "vza", "vaa")
    np.testing.assert_array_equal(np.isnan(result[0]), np.isnan(lai_with_hole))


def test_background_may_be_a_raster(lai, swath):
    litter = (lai * 0 + 0.2).drop_attrs(deep=False)
    mapped, uniform = (
        lai.fifesim.surface_reflectance("TM", bands=BANDS, geometry=swath, canopy=fifesim.Canopy(background=each))
        for each in (litter, 0.2)
    )
    np.testing.assert_allclose(mapped, uniform, rtol=1e-14)


def test_image_of_a_swath_has_pixel_angles(lai, swath):
    toa = lai.fifesim.surface_reflectance("TM", bands=BANDS, geometry=swath).fifesim.to_toa()
    image = check_raster_function(lambda array: array.fifesim.sense("TM"), toa, quantity="dn")
    there = directions.geometry_of(image)
    assert directions.varying(there) == ("sza", "vza", "vaa")
    middle = toa["sza"].values.reshape(5, 9, 6, 9).mean((1, 3))
    np.testing.assert_allclose(there.sza, middle, rtol=1e-12)
    # The mean of azimuths between 350 and 10 degrees is north; an arithmetic mean would be south.
    assert np.all((there.vaa < 10.1) | (there.vaa > 349.9))


def test_planetary_reflectance_of_a_swath_round_trips(lai, swath):
    """Within half a count: both conversions use the solar angle of the pixel."""
    toa = lai.fifesim.surface_reflectance("TM", bands=BANDS, geometry=swath).fifesim.to_toa()
    paper = fifesim.instrument("TM", response="paper")
    image = toa.fifesim.sense(paper)
    means = toa.drop_vars(["sza", "vza", "vaa"]).fifesim.sense(paper, quantise=False)
    one_sun = means.fifesim.to_reflectance()
    count = (image["gain"] / image["solar_irradiance"]).values[:, None, None] * np.pi * 1.04 / np.cos(np.radians(31))
    assert np.all(np.abs(image.fifesim.to_reflectance() - one_sun).values <= 0.5 * count + 1e-9)


def test_constant_angle_raster_equals_a_single_geometry(lai):
    level = by_cell(28.5, 117.0, ramp(lai, 20.0, 20.0), 200.0)
    one = fifesim.Geometry(28.5, 117.0, 20.0, 200.0)
    images = [
        lai.fifesim.surface_reflectance("TM", bands=BANDS, geometry=g).fifesim.to_toa().fifesim.sense("TM")
        for g in (level, one)
    ]
    assert np.abs(images[0].astype(int) - images[1].astype(int)).max() <= 1


def test_functions_of_one_geometry_and_views_below_the_horizon_raise(lai, swath):
    with pytest.raises(ValueError, match="needs one direction of sun and sensor, got rasters of sza, vza, vaa"):
        lai.fifesim.fpar(geometry=swath)
    with pytest.raises(ValueError, match="needs one direction of sun and sensor, got rasters of sza, vza, vaa"):
        lai.fifesim.surface_reflectance("TM", bands=BANDS, geometry=swath, dem=ramp(lai, 0, 10))
    low = by_cell(28.5, 117.0, ramp(lai, 20.0, 95.0), 200.0)
    with pytest.raises(ValueError, match=r"vza must be in \[0, 90\) degrees in every cell, got"):
        lai.fifesim.surface_reflectance("TM", bands=BANDS, geometry=low)
