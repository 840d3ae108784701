"""Files without the tag of fifesim: what GDAL knows of their bands."""

import numpy as np
import pytest
from edits import Copy

import fifesim


@pytest.fixture
def image(lai_values):
    rho = fifesim.surface_reflectance(lai_values, bands=["TM3", "TM4"])
    return rho.fifesim.to_toa().fifesim.sense("TM")


@pytest.fixture
def copy(image, tmp_path):
    found = Copy(fifesim.to_geotiff(image, tmp_path / "image.tif"))
    del found.tags["FIFESIM"]
    return found


@pytest.mark.parametrize("bands", [[0, 1], [1, 0], [1]])
def test_names_calibration_and_wavelengths_go_with_the_bands(image, copy, tmp_path, bands):
    copy.select(bands)
    found, expected = fifesim.open_image(copy.write(tmp_path / "plain.tif")), image.isel(band=bands)
    np.testing.assert_allclose(fifesim.to_radiance(found), fifesim.to_radiance(expected), rtol=1e-12)
    np.testing.assert_allclose(found["wavelength"], expected["wavelength"], rtol=1e-8)
    assert found["band"].values.tolist() == expected["band"].values.tolist()


def test_fractions_with_a_scale_are_radiance(image, copy, tmp_path):
    copy.convert("float32")
    found = fifesim.open_image(copy.write(tmp_path / "plain.tif"))
    assert found.attrs["units"] == "W m-2 sr-1 um-1" and "gain" not in found.coords
    np.testing.assert_allclose(found, fifesim.to_radiance(image), rtol=1e-6)


def test_digital_numbers_that_lost_their_scale_are_refused(copy, tmp_path):
    copy.scales, copy.offsets = [1.0, 1.0], [0.0, 0.0]
    with pytest.raises(ValueError, match=r"bands of .*plain\.tif have units of radiance and no scale"):
        fifesim.open_image(copy.write(tmp_path / "plain.tif"))
    copy.convert("float32")
    found = fifesim.open_image(copy.write(tmp_path / "fractions.tif"))
    np.testing.assert_array_equal(found.fillna(0), copy.values)


def test_units_are_those_of_all_bands(copy, tmp_path):
    copy.units = ["1", "m"]
    assert "units" not in fifesim.open_image(copy.write(tmp_path / "plain.tif")).attrs
    copy.units = ["m", "m"]
    assert fifesim.open_image(copy.write(tmp_path / "same.tif")).attrs["units"] == "m"
