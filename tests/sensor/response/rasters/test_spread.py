"""Point spread and modulation transfer as rasters."""

from dataclasses import replace

import numpy as np
import pytest

import fifesim
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.spatial_response import BoxcarResponse, CosineResponse, TwoAxesResponse

TM = instrument("TM", "paper")


def test_psf_holds_the_whole_response():
    spread = fifesim.psf(TM, "TM4")
    step = float(spread["x"][1] - spread["x"][0])
    assert float(spread.sum()) * step**2 == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(spread, spread.T, rtol=1e-12)
    # The paper's cosine: half at the ends, both of its axes at the centre.
    peak = (2 * np.pi / (3 * TM.line_spread.width) / np.sqrt(3)) ** 2
    assert float(spread.sel(x=0, y=0)) == pytest.approx(peak, rel=1e-3)
    assert spread["x"].attrs["units"] == "m" and spread.attrs["units"] == "m-2" and spread["band"] == "TM4"


def test_axes_stand_where_they_belong():
    axes = TwoAxesResponse(
        along=BoxcarResponse("boxcar", width=90 / 705e3), across=CosineResponse("cosine", step=4.778e-6, count=9)
    )
    spread = fifesim.psf(replace(TM, lsf=axes), spacing=1.0)
    assert (spread.sum("x") > 1e-9).sum() == 91
    assert (spread.sum("y") > 1e-9).sum() == 31
    transfer = fifesim.mtf(replace(TM, lsf=axes), "TM3", frequency=[0.0, 1 / 90])[0]
    np.testing.assert_allclose(transfer.sel(direction="along"), [1.0, 0.0], rtol=0, atol=1e-12)
    assert transfer.sel(direction="across")[1] > 0.8


def test_mtf_reaches_to_the_frequency_of_the_samples():
    transfer = fifesim.mtf("TM", "TM3")
    assert transfer.dims == ("band", "direction", "frequency")
    assert float(transfer["frequency"][-1]) == pytest.approx(1 / 30.315)
    assert float(transfer["nyquist"].sel(band="TM3", direction="along")) == pytest.approx(0.5 / 30.315)
    np.testing.assert_allclose(transfer.sel(frequency=0), 1.0, rtol=1e-12)


def test_each_band_has_its_own_nyquist_frequency_and_the_products():
    transfer = fifesim.mtf("MSI")
    assert transfer["band"].values.tolist() == [band.name for band in instrument("MSI").bands]
    assert float(transfer["nyquist"].sel(band="MSI1", direction="across")) == pytest.approx(0.5 / 60, rel=1e-3)
    assert float(transfer["product_nyquist"].sel(band="MSI11")) == 0.5 / 20
    # A detector passes sinc(1/2) at half a sample per width; sampled more closely than it is wide, less.
    modis = fifesim.mtf(fifesim.instrument("MODIS", response="detector"), ["MODIS1"])
    along = modis.sel(direction="along")
    width = instrument("MODIS").ground_fields(instrument("MODIS").bands[0]).along
    np.testing.assert_allclose(along["at_product_nyquist"], np.sinc(width * along["product_nyquist"]), rtol=1e-12)


# Modulation transfer at the Nyquist frequency in flight, along and across the track: ESA's point spread functions of
# 2025, band 1 first, without band 10.
BANDS = [f"MSI{number}" for number in (1, 2, 3, 4, 5, 6, 7, 8, "8A", 9, 11, 12)]
MEASURED = {
    ("MSI", "along"): [0.36, 0.34, 0.30, 0.24, 0.30, 0.30, 0.30, 0.21, 0.29, 0.36, 0.18, 0.17],
    ("MSI", "across"): [0.28, 0.36, 0.37, 0.31, 0.41, 0.39, 0.40, 0.26, 0.35, 0.26, 0.17, 0.22],
    ("MSI-B", "along"): [0.39, 0.30, 0.27, 0.24, 0.31, 0.31, 0.30, 0.21, 0.30, 0.36, 0.19, 0.18],
    ("MSI-B", "across"): [0.28, 0.37, 0.34, 0.30, 0.37, 0.38, 0.39, 0.26, 0.34, 0.35, 0.21, 0.20],
}


@pytest.mark.parametrize(("name", "direction"), MEASURED)
def test_sentinel_2_blurs_as_it_was_measured(name, direction):
    """The transfer of what `sense` weights with, by brute force: the cosine transform of the response itself."""
    description = instrument(name)
    for band, measured in zip(description.select(BANDS), MEASURED[name, direction], strict=True):
        spread = getattr(description.line_spreads(band), direction)
        edges = np.linspace(-spread.half_width, spread.half_width, 4001)
        middle, weight = (edges[1:] + edges[:-1]) / 2, np.diff(spread.cumulative(edges))
        interval = getattr(description.ground_intervals(band), direction)
        assert weight @ np.cos(np.pi * middle / interval) == pytest.approx(measured, abs=0.005)
    at = fifesim.mtf(name, BANDS)["at_nyquist"].sel(direction=direction)
    np.testing.assert_allclose(at, MEASURED[name, direction], rtol=0, atol=0.01)


def test_what_no_source_has_is_the_detector():
    assert fifesim.mtf("SuperDove", "PS6")["at_nyquist"].values == pytest.approx(2 / np.pi, rel=1e-6)
    sharp = fifesim.instrument("MSI", response="detector")
    np.testing.assert_allclose(fifesim.mtf(sharp)["at_nyquist"], 2 / np.pi, rtol=1e-6)


def test_what_cannot_be_plotted_is_refused():
    with pytest.raises(ValueError, match="TM9"):
        fifesim.mtf("TM", "TM9")
    with pytest.raises(ValueError, match="spacing"):
        fifesim.psf("TM", spacing=0)
