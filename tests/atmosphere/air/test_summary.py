"""What an atmosphere says of itself."""

import numpy as np
import pytest

import fifesim
from fifesim.atmosphere.models import atmosphere_in_words


def rows(atmosphere):
    """Numbers of each row, by its name."""
    lines = atmosphere_in_words(atmosphere).splitlines()[4:]
    return {line[:31].strip(): np.array(line[31:].split(), float) for line in lines}


def test_atmosphere_prints_columns_depths_and_transmittances():
    text = str(fifesim.Atmosphere())
    assert "water vapour 2.4" in text
    assert "optical depth, molecules" in text
    assert "transmittance, ozone" in text


@pytest.mark.parametrize("aerosol", ["continental", "none"])
def test_rows_agree_with_each_other(aerosol):
    """Four digits are printed, and means over a band of products are not products of means."""
    found = rows(fifesim.Atmosphere(aerosol=aerosol))
    depth = found["optical depth, molecules"] + found["optical depth, aerosol"]
    np.testing.assert_allclose(found["transmittance, direct"], np.exp(-depth), atol=2e-3)
    assert np.all(found["transmittance, with skylight"] > found["transmittance, direct"])
    parts = np.minimum(found["transmittance, water vapour"], found["transmittance, ozone"])
    assert np.all(found["transmittance, all gases"] <= parts)
    assert np.all(found["optical depth, aerosol"] > 0) == (aerosol != "none")
