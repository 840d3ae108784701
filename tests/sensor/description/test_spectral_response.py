"""Spectral responses of instrument files: written out, in a table, in pyrsr."""

import os

import numpy as np
import pytest
from pyrsr.rsr import RSR_reader

from fifesim.base.bands import Band
from fifesim.sensor.description.spectral_response import PyrsrResponse, ResponseList, half_peak

LIMITS = ('bits = "Friedl1995"', 'bits = "Friedl1995"\nlimits = "NASA2013"')
PYRSR = '{ satellite = "Landsat-5", sensor = "TM", band = "3" }'


@pytest.mark.parametrize(
    ("srf", "message"),
    [
        ("{ wavelength = [620, 630, 690, 700], response = [0, 1, 1, 0] }", "wavelengths are in um.*nm: divide by 1000"),
        (
            "{ wavelength = [0.62, 0.63, 0.69], response = [0, 1, 0.9] }",
            "does not cover the band: at 0.69 um, where its",
        ),
        ("{ wavelength = [0.64, 0.65, 0.66], response = [0, 1, 0] }", "does not cover the band from 0.63 to 0.69 um"),
        ("{ wavelength = [0.62, 0.61, 0.69], response = [0, 1, 0] }", "wavelengths must increase"),
        ("{ wavelength = [0.62, 0.69], response = [0, -1] }", "must not be negative"),
        ('{ table = "none.csv", satellite = "A", band = "1" }', "srf.table = 'none.csv': no such file beside"),
        ('{ table = "avhrr_response.csv", satellite = "NOAA-9", band = "3" }', "has no NOAA-9 3: it has .*NOAA-11 2"),
    ],
)
def test_a_response_that_does_not_do_is_named_with_its_remedy(changed, srf, message):
    with pytest.raises(ValueError, match=f"mine.toml: bands.3.*{message}"):
        changed(f"srf = {PYRSR}", f"srf = {srf}\nlimits = [0.63, 0.69]", *LIMITS)


@pytest.mark.parametrize("missing", ["wavelength", "response"])
def test_a_missing_key_of_a_response_is_named(changed, missing):
    lists = {"wavelength": "[0.6, 0.65, 0.7]", "response": "[0, 1, 0]"}
    left = ", ".join(f"{key} = {value}" for key, value in lists.items() if key != missing)
    with pytest.raises(ValueError, match=f"mine.toml: the key bands.3.srf.{missing} is missing"):
        changed(f"srf = {PYRSR}", f"srf = {{ {left} }}")


def test_a_response_written_out_or_in_a_table_beside_the_file_is_read(changed, tmp_path):
    rows = "wavelength = [0.60, 0.63, 0.69, 0.72], response = [0.0, 1.0, 1.0, 0.0]"
    mine = changed(f"srf = {PYRSR}", f"srf = {{ {rows} }}")
    # A trapezoid is centred on its middle.
    np.testing.assert_allclose(mine.select("TM3")[0].wavelength, 0.66, rtol=1e-12)
    table = "satellite,band,wavelength,response\nX,1,0.60,0\nX,1,0.63,1\nX,1,0.69,1\nX,1,0.72,0\n"
    (tmp_path / "own.csv").write_text("# columns\n" + table, encoding="utf-8")
    other = changed(f"srf = {PYRSR}", 'srf = { table = "own.csv", satellite = "X", band = "1" }')
    assert other.select("TM3")[0].response == mine.select("TM3")[0].response


def test_response_of_pyrsr_is_in_micrometres_and_not_negative():
    """It holds TM in nanometres or micrometres; noise below zero is none."""
    found = PyrsrResponse("Landsat-5", "TM", "3").read("TM3")
    theirs = RSR_reader("Landsat-5", "TM", LayerBandsAssignment=["3"])["3"]
    assert 0.5 < found.wavelength[0] < 0.66 < found.wavelength[-1] < 0.8 and min(found.response) >= 0
    np.testing.assert_allclose(found.response, np.maximum(theirs[:, 1], 0))


def test_limits_lie_at_half_of_the_maximum():
    found = ResponseList((0.5, 0.6, 0.7, 0.8, 0.9), (0.0, 1.0, 2.0, 1.0, 0.9)).read("a")
    assert found == Band("a", (0.5, 0.6, 0.7, 0.8, 0.9), (0.0, 1.0, 2.0, 1.0, 0.9))
    assert half_peak(found) == (0.6, 0.8)


@pytest.mark.parametrize("table", ["pipe.csv", "folder.csv", "/dev/zero", "a" * 5000, "loop.csv"])
def test_a_table_that_is_no_file_is_refused_at_once(changed, tmp_path, table):
    """A pipe would be waited for."""
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "loop.csv").symlink_to("loop.csv")
    table = str(tmp_path / table) if table == "pipe.csv" else table
    with pytest.raises(ValueError, match="srf"):
        changed(f"srf = {PYRSR}", f'srf = {{ table = "{table}", satellite = "X", band = "1" }}')
