"""Point spread and modulation transfer as rasters."""

from dataclasses import replace

import numpy as np
import pytest

import fifesim
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.spatial_response import BoxcarResponse, CosineResponse, TwoAxesResponse

TM = instrument("TM")


def test_psf_holds_the_whole_response():
    spread = fifesim.psf("TM", "TM4")
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
    transfer = fifesim.mtf(replace(TM, lsf=axes), frequency=[0.0, 1 / 90])
    np.testing.assert_allclose(transfer.sel(direction="along"), [1.0, 0.0], rtol=0, atol=1e-12)
    assert transfer.sel(direction="across")[1] > 0.8


def test_mtf_reaches_to_the_frequency_of_the_samples():
    transfer = fifesim.mtf("TM")
    assert transfer.dims == ("direction", "frequency")
    assert float(transfer["frequency"][-1]) == pytest.approx(1 / 30.315)
    assert float(transfer["nyquist"][0]) == pytest.approx(0.5 / 30.315)
    np.testing.assert_allclose(transfer.sel(frequency=0), 1.0, rtol=1e-12)


def test_what_cannot_be_plotted_is_refused():
    with pytest.raises(ValueError, match="TM9"):
        fifesim.mtf("TM", "TM9")
    with pytest.raises(ValueError, match="spacing"):
        fifesim.psf("TM", spacing=0)
