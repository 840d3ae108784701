"""Physical meaning of the values of a section."""

import numpy as np
import pytest

import fifesim
from fifesim.scenario.sections import Ground, Sensor
from fifesim.sensor.description.instruments import instrument


def test_optics_by_band_need_reflectance_and_transmittance():
    assert Ground().leaf_optics() is None and Ground().below_canopy() is None
    both = Ground(leaf_reflectance={"TM3": 0.1}, leaf_transmittance={"TM3": 0.05})
    assert both.leaf_optics() == {"TM3": (0.1, 0.05)}
    with pytest.raises(ValueError, match="must name the same bands"):
        Ground(leaf_reflectance={"TM3": 0.1}).leaf_optics()


def test_complete_optics_are_passed_to_the_chain():
    bands = [band.response for band in instrument("TM").select(["TM3", "TM4"])]
    keys = Ground().complete_optics(bands)
    rho = fifesim.ground.canopy.optics.band_leaf_optics(bands)[0]
    np.testing.assert_array_equal(list(keys["leaf_reflectance"].values()), rho)
    assert Ground(**keys).complete_optics(bands) == keys


def test_aerosol_file_is_found_next_to_the_scenario(tmp_path, monkeypatch):
    """An aerosol file needs an optical thickness, and a completed scenario holds its full path."""
    fifesim.atmosphere.aerosol_tables("urban").to_netcdf(tmp_path / "mine.nc")
    (tmp_path / "mine.toml").write_text('[atmosphere]\naerosol = "mine.nc"\naot = 0.3\n')
    scenario = fifesim.scenario.read_scenario(tmp_path / "mine.toml")
    air = scenario.model_atmosphere()
    assert (air.aerosol.name, air.aot, air.visibility) == ("mine", 0.3, None)
    assert scenario.files["atmosphere", "aerosol"] == str(tmp_path / "mine.nc")
    monkeypatch.chdir(tmp_path)
    inside = fifesim.Scenario(atmosphere={"aerosol": "mine.nc", "aot": 0.3})
    assert inside.complete().atmosphere.aerosol == str(tmp_path / "mine.nc")
    for wrong, message in (
        ({"aerosol": "mine.nc"}, "must be given as aot"),
        ({"aerosol": "mine.nc", "visibility": 23}, "must be given as aot, from 0 to 2, got visibility=23"),
        ({"aerosol": "other.nc", "aot": 0.3}, "other.nc: there is no such file"),
    ):
        with pytest.raises(ValueError, match=message):
            fifesim.Scenario(atmosphere=wrong)


def test_default_pixel_size_is_taken_from_the_bands():
    """`sense` without `onto` uses the same size."""
    for name, bands, size in (
        ("TM", ["TM3", "TM4"], 30),
        ("MSI", ["MSI4", "MSI8"], 10),
        ("MODIS", ["MODIS1", "MODIS2"], 250),
    ):
        sensor = Sensor(instrument=name)
        assert (sensor.bands, sensor.size) == (bands, size)
    assert Sensor(pixel=50.0).size == 50.0
    assert Sensor(instrument="MSI", bands=["MSI11"]).size == 20
    assert Sensor(instrument="MSI", bands=["MSI4", "MSI11"], pixel=20).size == 20
    with pytest.raises(
        ValueError, match=r"bands of MSI have different grids \(10 m: MSI4; 20 m: MSI11\): name bands of one"
    ):
        Sensor(instrument="MSI", bands=["MSI4", "MSI11"])


def test_response_key_equals_the_python_argument():
    sharp = Sensor(response="detector").description
    assert sharp == fifesim.instrument("TM", response="detector") != Sensor().description
    assert Sensor(response="system").description == Sensor().description
    assert Sensor(response="paper").description == fifesim.instrument("TM", response="paper")
    for name, response, said in (
        ("TM", "sharp", "response must be one of system, detector, paper, sharpest, softest, got 'sharp'"),
        ("MSI", "paper", "MSI has no 'paper' response: type response='detector'"),
    ):
        with pytest.raises(ValueError, match=said):
            Sensor(instrument=name, response=response)


def test_noise_key_equals_the_python_argument():
    given = {"thermal": 0.4, "shot": 0.005, "detectors": 16, "gain_spread": 0.005}
    assert Sensor(noise=["shot"], noise_model=given).given_noise() == fifesim.NoiseModel(**given)
    assert Sensor(instrument="OLI", noise=["thermal"], noise_model={"thermal": 1}).given_noise().along == "columns"
    assert Sensor().given_noise() is None
    for values, said in (
        ({"thermall": 1.0}, "did you mean 'thermal'"),
        ({"shot": -1.0}, "shot must be at least 0"),
        ({"detectors": 1.5}, "whole number"),
    ):
        with pytest.raises(ValueError, match=said):
            Sensor(noise_model=values)
