"""Atmosphere description: amounts, text form, invalid arguments and summary."""

from typing import get_type_hints

import numpy as np
import pytest

import fifesim
from fifesim.atmosphere import gases, mixtures
from fifesim.atmosphere.models import Atmosphere, atmosphere_in_words
from fifesim.base.arguments import kind_of


def test_columns_agree_with_published_values():
    """McClatchey et al. (1972): 2.93 g cm-2 and 0.319 cm-atm, to the last digit."""
    atmosphere = Atmosphere(altitude=0)
    assert atmosphere.water_vapour == pytest.approx(2.93, abs=0.005)
    assert atmosphere.ozone == pytest.approx(0.319, abs=0.0006)
    assert atmosphere.pressure == pytest.approx(1013, abs=1e-9)


@pytest.mark.parametrize(
    "visibility, aot", [(5, 0.77998), (8, 0.51913), (10, 0.43208), (15, 0.31584), (23, 0.23472), (45, 0.15974)]
)
def test_visibility_gives_the_optical_thickness_of_6s(visibility, aot):
    """Both use the same profiles of particle number: equal to the last digit."""
    assert Atmosphere(visibility=visibility).aot == pytest.approx(aot, abs=5e-6)


def test_text_of_the_default_atmosphere():
    assert Atmosphere().text == "profile=midlatitude-summer aerosol=continental visibility=45 km altitude=0.4 km"


@pytest.mark.parametrize(
    "arguments, message",
    [
        (
            {"profile": "midlat_summer"},
            r"profile must be 'tropical', .*, got 'midlat_summer': did you mean 'midlatitude-sum",
        ),
        ({"aerosol": "continentl"}, r"aerosol must be one of .*, got 'continentl': type aerosol='continental'"),
        ({"visibility": float("nan")}, r"visibility must be in \[5, 100\] km, got nan"),
        ({"altitude": 5}, r"altitude must be in \[0, 4\] km, got 5"),
        ({"h2o": -1}, r"h2o must be in \[0, 10\] g cm-2, got -1"),
        ({"aot": -0.1}, r"aot must be in \[0, 2\], got -0\.1"),
        ({"aerosol": "none", "aot": 0.1}, r"aot must be 0 without aerosol, got 0\.1"),
    ],
)
def test_invalid_argument_raises_a_specific_message(arguments, message):
    with pytest.raises(ValueError, match=message):
        Atmosphere(**arguments)


def test_wrong_text_form_raises():
    with pytest.raises(ValueError, match="atmosphere must read like 'profile=midlatitude-summer"):
        Atmosphere.parse("midlatitude summer, 45 km")


def test_user_columns_scale_the_profile():
    dry, own = Atmosphere(), Atmosphere(h2o=1.2, o3=0.4)
    assert (own.water_vapour, own.ozone) == pytest.approx((1.2, 0.4), rel=1e-12)
    ratio = own.levels.h2o / dry.levels.h2o
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-12)


def test_aot_sets_the_aerosol_amount():
    assert Atmosphere(aot=0.3).visibility is None
    assert Atmosphere(aot=0.3).aerosol_optical_depth(np.array([0.55]))[0] == pytest.approx(0.3, rel=1e-6)
    assert Atmosphere(aerosol="none").aot == 0


@pytest.mark.parametrize(
    "arguments", [{"aot": 0.25, "h2o": 2.5}, {"o3": 0.3, "engine": "successive-orders"}, {"aerosol": "none"}]
)
def test_text_round_trips(arguments):
    atmosphere = Atmosphere(**arguments)
    assert Atmosphere.parse(atmosphere.text) == atmosphere


def test_docstring_names_all_options():
    said = Atmosphere.__doc__
    kinds = [kind_of(hint) for hint in get_type_hints(Atmosphere, include_extras=True).values()]
    ranges = [f", {each.known.lowest} to {each.known.highest}" for each in kinds if each.known]
    names = (*gases.PROFILES, *mixtures.MODELS, *mixtures.COMPONENTS, *kinds[-1].allowed, *ranges)
    assert len(ranges) == 5
    assert [name for name in names if name not in said] == []


# ------------------------------------------------------------------------------------------ summary


def rows(atmosphere):
    """Numbers of each row of the summary, by row name."""
    lines = atmosphere_in_words(atmosphere).splitlines()[4:]
    return {line[:31].strip(): np.array(line[31:].split(), float) for line in lines}


@pytest.mark.parametrize("aerosol", ["continental", "none"])
def test_summary_rows_are_consistent(aerosol):
    """Four digits are printed, and the band mean of a product is not the product of band means."""
    found = rows(fifesim.Atmosphere(aerosol=aerosol))
    assert "  1.55-1.75  2.08-2.35" in atmosphere_in_words(fifesim.Atmosphere(aerosol=aerosol))
    depth = found["optical depth, molecules"] + found["optical depth, aerosol"]
    np.testing.assert_allclose(found["transmittance, direct"], np.exp(-depth), atol=2e-3)
    assert np.all(found["transmittance, with skylight"] > found["transmittance, direct"])
    parts = np.minimum(found["transmittance, water vapour"], found["transmittance, ozone"])
    assert np.all(found["transmittance, all gases"] <= parts)
    assert np.all(found["optical depth, aerosol"] > 0) == (aerosol != "none")
