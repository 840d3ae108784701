"""Spectra of leaves and backgrounds from files and Datasets, and which of them are refused."""

import os
import urllib.request

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.ground.canopy import optics

TM = [band.response for band in fifesim.instrument("TM").bands]


def written(tmp_path, text):
    path = tmp_path / "mine.csv"
    path.write_text(text, encoding="utf-8")
    return str(path)


LEAF = "Wavelength,Reflectance, Transmittance\n0.4,0.05,0.01\n0.7,0.1,0.05\n0.8,0.5,0.4\n2.5,0.2,0.1\n"


def leaf_dataset(wavelength=(0.4, 0.7, 0.8, 2.5), units=None, transmittance=(0.01, 0.05, 0.4, 0.1)):
    axis = xr.Variable("wavelength", np.array(wavelength), {} if units is None else {"units": units})
    values = {
        "reflectance": ("wavelength", [0.05, 0.1, 0.5, 0.2]),
        "transmittance": ("wavelength", list(transmittance)),
    }
    return xr.Dataset(values, {"wavelength": axis})


def test_leaf_spectra_are_a_file_or_a_dataset(tmp_path, lai):
    """Headers may be in capitals, and nanometres are converted where the unit says so."""
    path = written(tmp_path, LEAF)
    given = path, tmp_path / "mine.csv", leaf_dataset(), leaf_dataset((400, 700, 800, 2500), "nm")
    for name in ("leaf_optics", "brown_leaf"):
        made = [
            fifesim.surface_reflectance(
                lai, "TM", bands=["TM3", "TM4"], canopy=fifesim.Canopy(**{name: each}, brown=0.5)
            )
            for each in given
        ]
        for other in made[1:]:
            xr.testing.assert_allclose(made[0], other, rtol=1e-12)
    reflectance, transmittance = optics.band_leaf_optics(TM[2:4], path)
    # The spectra are straight lines within the red band: the means are values inside the band.
    assert 0.05 + 0.05 * (0.63 - 0.4) / 0.3 < reflectance[0] < 0.05 + 0.05 * (0.69 - 0.4) / 0.3
    assert 0.01 + 0.04 * (0.63 - 0.4) / 0.3 < transmittance[0] < 0.01 + 0.04 * (0.69 - 0.4) / 0.3
    numbers = {"TM3": (reflectance[0], transmittance[0]), "TM4": (reflectance[1], transmittance[1])}
    by_band = fifesim.surface_reflectance(lai, "TM", bands=["TM3", "TM4"], canopy=fifesim.Canopy(leaf_optics=numbers))
    made = fifesim.surface_reflectance(lai, "TM", bands=["TM3", "TM4"], canopy=fifesim.Canopy(leaf_optics=path))
    xr.testing.assert_allclose(made, by_band, rtol=1e-12)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (leaf_dataset((400, 700, 800, 2500)), "leaf_optics: wavelength reaches 2500 um: if these are nanometres"),
        (leaf_dataset((4e-7, 7e-7, 8e-7, 2.5e-6)), "leaf_optics: wavelengths are in um, the largest is 2.5e-06"),
        (leaf_dataset(units="m"), "leaf_optics: wavelength has units 'm'"),
        (leaf_dataset(transmittance=(0.01, 0.05, 0.6, 0.1)), r"leaf_optics: .*add up to 1\.1 at 0\.8 um"),
        (leaf_dataset(transmittance=(1, 5, 40, 10)), "leaf_optics: the transmittance .* got 5 at 0.7 um: give a fract"),
        (leaf_dataset().drop_vars("transmittance"), "leaf_optics: the Dataset has no transmittance"),
        ("leaf.txt", r"leaf_optics='leaf.txt' is not the path of a \.csv file"),
    ],
)
def test_unusable_leaf_spectra_are_refused(lai, given, message):
    with pytest.raises(ValueError, match=message):
        fifesim.surface_reflectance(lai, "TM", canopy=fifesim.Canopy(leaf_optics=given))


@pytest.mark.parametrize("name", ["leaf_optics", "background"])
def test_a_spectrum_is_read_from_a_regular_file_only(tmp_path, lai, name, monkeypatch):
    """An address would be fetched, and reading a pipe or a device waits for ever."""
    monkeypatch.setattr(urllib.request, "urlopen", lambda *_: pytest.fail("an address was opened"))
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "device.csv").symlink_to("/dev/zero")
    wrong = {
        "http://127.0.0.1:9/x.csv": "it is an address; download the file",
        "s3://bucket/x.csv": "it is an address",
        tmp_path / "pipe.csv": "pipe.csv is a pipe: name a file",
        tmp_path / "folder.csv": "folder.csv is a folder",
        tmp_path / "device.csv": "device.csv is a device",
    }
    for path, message in wrong.items():
        with pytest.raises(ValueError, match=message):
            fifesim.surface_reflectance(lai, "TM", canopy=fifesim.Canopy(**{name: path}))
    if name == "background":
        with pytest.raises(ValueError, match="it is an address"):
            mixture = fifesim.Background({"http://127.0.0.1:9/x.csv": 1})
            fifesim.surface_reflectance(lai, "TM", canopy=fifesim.Canopy(background=mixture))


@pytest.mark.parametrize(
    "content", [b"", "wavelength,reflectance\n0.4,0.1\n".encode("utf-16"), b'a,b\n"1,2\n', b"a\n1,2\n1,2,3,4\n"]
)
def test_errors_of_csv_files_name_the_file(tmp_path, lai, content):
    path = tmp_path / "mine.csv"
    path.write_bytes(content)
    readers = {
        "spectrum": lambda: fifesim.surface_reflectance(lai, "TM", canopy=fifesim.Canopy(background=str(path))),
        "aerosol": lambda: fifesim.read_aerosol(path),
        "LAI samples": lambda: fifesim.lai_distribution(path),
    }
    for what, read in readers.items():
        with pytest.raises(ValueError, match=f"cannot read the {what} .*mine.csv: .*CSV in UTF-8"):
            read()
