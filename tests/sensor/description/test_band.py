"""One band: response, irradiance, gain states."""

import dataclasses

import numpy as np
import pytest

from fifesim.base.bands import solar_irradiance
from fifesim.sensor.description.instruments import instrument

# Nominal limits of the reflective TM bands [um].
NOMINAL = {
    "TM1": (0.45, 0.52),
    "TM2": (0.52, 0.60),
    "TM3": (0.63, 0.69),
    "TM4": (0.76, 0.90),
    "TM5": (1.55, 1.75),
    "TM7": (2.08, 2.35),
}


@pytest.mark.parametrize("name", NOMINAL)
def test_response_lies_in_the_nominal_band(name):
    """Half of the maximum is reached within 0.04 um of the nominal limits, as built (TM5 is the furthest off)."""
    (band,) = instrument("TM").select(name)
    low, high = NOMINAL[name]
    assert band.response.name == name
    assert abs(band.wavelength - (low + high) / 2) < 0.15 * (high - low)
    half = [w for w, r in zip(band.response.wavelength, band.response.response, strict=True) if r > 0.5]
    np.testing.assert_allclose([half[0], half[-1]], [low, high], atol=0.04)


@pytest.mark.parametrize("name", NOMINAL)
def test_solar_irradiance_agrees_with_another_spectrum(name):
    """The agency integrates another solar spectrum than ASTM G173; spectra differ by up to 4 % in TM7."""
    (band,) = instrument("TM").select(name)
    np.testing.assert_allclose(band.solar_irradiance, solar_irradiance(band.response), rtol=0.05)


@pytest.mark.parametrize(
    ("replacements", "message"),
    [
        (
            ('name = "TM1"', 'name = "TM1"\ngains.nominal = { full_scale_radiance = 1.0, min_radiance = 0.0 }'),
            "own gain",
        ),
    ],
)
def test_mistakes_in_gains_name_key_and_remedy(changed, replacements, message):
    with pytest.raises(ValueError, match=f"mine.toml: .*{message}"):
        changed(*replacements)


def test_gain_states_change_places():
    (own,) = instrument("ETM+").select("ETM3")
    low = own.with_gain("low")
    assert own.with_gain("high") is own
    assert (low.gain, set(low.gains)) == ("low", {"high"})
    assert low.full_scale_radiance == own.gains["low"].full_scale_radiance > own.full_scale_radiance
    assert low.with_gain("high") == own
    with pytest.raises(ValueError, match="ETM3 has no gain state 'medium': it has low, high"):
        low.with_gain("medium")


def test_limits_the_wrong_way_round_are_refused():
    (red,) = instrument("TM").select("TM3")
    with pytest.raises(ValueError, match="limits: the first must be below the second"):
        dataclasses.replace(red, limits=(0.69, 0.63))


def test_band_is_told_by_what_it_has():
    said = repr(instrument("TM").bands[2])
    assert said.startswith("InstrumentBand(name='TM3', srf=") and "None" not in said and len(said) < 240
