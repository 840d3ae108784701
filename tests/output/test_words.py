"""What pictures say of a raster."""

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.output.colours import long_name, short_name, subject, unit


@pytest.mark.parametrize(
    ("name", "units", "said"),
    [
        ("toa_radiance", "W m-2 sr-1 um-1", "[W m⁻² sr⁻¹ µm⁻¹]"),
        ("dem", "m", "[m]"),
        ("lai", "1", "[m² m⁻²]"),
        ("ndvi", "1", ""),
        ("wavelength", "um", "[µm]"),
        (None, None, ""),
    ],
)
def test_units_are_written_as_in_print(name, units, said):
    assert unit(xr.DataArray(0.0, name=name, attrs={} if units is None else {"units": units})) == said


def test_quantities_have_a_short_and_a_long_name(whole):
    assert short_name(whole["image"]) == "digital number" and short_name(whole["ndvi"]) == "NDVI"
    assert long_name(whole["ndvi"]) == "Normalized difference vegetation index"
    assert long_name(whole["image"].sel(band="TM3")) == "TM3: digital number"
    assert long_name(xr.DataArray(0.0, name="my_field")) == "My field" and long_name(xr.DataArray(0.0)) == "Values"


def test_a_picture_says_whose_it_is(whole):
    said = subject(whole["image"].assign_coords(time=np.datetime64("1987-06-06T16:35", "ns")))
    assert said == "Landsat-5 Thematic Mapper, 6 June 1987, 39.13° N, 96.62° W"
    own = whole["lai"].assign_attrs(instrument="mine").drop_vars("time", errors="ignore")
    assert subject(own) == "mine, 39.13° N, 96.62° W"
    south = fifesim.grid_at("EPSG:32734", 300000.0, 6200000.0, 300.0, 300.0, 30.0)
    assert subject(fifesim.lai_scene(south, "burned-grazed", seed=1)).endswith("34.32° S, 18.83° E")
    assert subject(xr.DataArray(np.zeros(3))) == ""
