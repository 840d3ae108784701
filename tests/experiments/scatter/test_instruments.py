"""The same ground through every instrument."""

import numpy as np
import pytest

import fifesim
from fifesim.experiments.scatter.instruments import compare_instruments, instrument_scenario, window_cells


def test_an_instrument_is_flown_with_all_that_is_known_of_it():
    msi = instrument_scenario("Sentinel-2", arp=0.24)
    assert msi.sensor.bands == ["MSI4", "MSI8"] and msi.sensor.size == 10.0 and msi.ground.arp == 0.24
    assert msi.sensor.offset == pytest.approx([0.33, 0.33]) and msi.sensor.noise == ["all"]
    hrv = instrument_scenario("HRV")
    assert hrv.sensor.offset == [0.0, 0.0] and hrv.sensor.noise == [] and hrv.terrain.dem == "flat"


def test_windows_hold_twelve_pixels():
    assert window_cells(instrument_scenario("TM")) == 333
    assert window_cells(instrument_scenario("MODIS")) == 12 * 250 * 3 / 10


def test_blur_and_place_take_the_most_from_sentinel_2():
    """At 10 m over burned-grazed ground, beside counts of twelve bits and the noise that they have."""
    found = compare_instruments(["MSI"], arps=(0.15,), realisations=2)
    assert set(found["instrument"]) == {"MSI"} and found["blur"].all() and found["noise"].all() and found["place"].all()
    shares = found[found["variable"] == "lai"].set_index("stage")["share"]
    parts = shares.drop(["total", "sub-pixel variation"], errors="ignore")
    assert parts.sum() == pytest.approx(shares["total"], abs=1e-9)
    assert min(shares["point spread"], shares["registration"]) > 5 * max(shares["quantisation"], shares["noise"])
    sharp = fifesim.instrument("OLI")
    assert not np.isnan(shares["total"]) and sharp.geolocation == 8.5


def test_a_budget_of_an_instrument_from_the_command_line(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    from fifesim.cli import app

    monkeypatch.chdir(tmp_path)
    made = CliRunner().invoke(app, ["budget", "--sensor", "HRV", "-o", "out", "--realisations", "1"])
    assert made.exit_code == 0, made.output
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "of XS2, XS3 the detector alone is known" in page
    both = CliRunner().invoke(app, ["budget", "x.toml", "--sensor", "HRV"])
    assert both.exit_code == 2
