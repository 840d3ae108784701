"""Where a Zarr group lies, by the conventions that GeoZarr names."""

import json

import pyproj

import fifesim
from fifesim.grids.grid import crs_fields, geozarr_attributes


def test_a_group_says_its_crs_and_its_transform():
    found = geozarr_attributes(fifesim.grid_at("EPSG:32735", 600000, 7200000, 900, 600, (20, 30)))
    assert found["proj:code"] == "EPSG:32735" and "proj:wkt2" not in found
    assert found["spatial:transform"] == [30.0, 0.0, 600000.0, 0.0, -20.0, 7200000.0]
    assert (found["spatial:shape"], found["spatial:dimensions"]) == ([30, 30], ["y", "x"])
    assert found["spatial:bbox"] == [600000.0, 7199400.0, 600900.0, 7200000.0]
    assert json.loads(json.dumps(found)) == found


def test_both_conventions_are_registered():
    """By the identifiers of their README files, which a reader looks for."""
    found = {each["name"]: each["uuid"] for each in geozarr_attributes(fifesim.fife_site(30))["zarr_conventions"]}
    assert found == {
        "proj": "f17cb550-5864-4468-aeb7-f3180cfb622f",
        "spatial": "689b58e2-cf7b-45e0-9fff-9cfc0883d6b4",
    }


def test_a_crs_without_a_code_is_written_out():
    own = pyproj.CRS.from_proj4("+proj=laea +lat_0=39 +lon_0=-96.5 +datum=WGS84 +units=m")
    (name, text), *others = crs_fields(own).items()
    assert name == "proj:wkt2" and not others
    assert pyproj.CRS.from_wkt(text).equals(own)
