import numpy as np
import pytest

from fifesim.atmosphere import ENGINES, mixtures, models
from fifesim.atmosphere.models import Atmosphere


def test_columns_are_the_published_ones():
    """McClatchey et al. (1972): 2.93 g cm-2 and .319 cm-atm, last digit."""
    atmosphere = Atmosphere(altitude=0)
    assert atmosphere.water_vapour == pytest.approx(2.93, abs=0.005)
    assert atmosphere.ozone == pytest.approx(0.319, abs=0.0006)
    assert atmosphere.pressure == pytest.approx(1013, abs=1e-9)


def test_columns_at_the_site_agree_with_6s():
    """6SV1.1 raises the profile to .40 km: 967.05 hPa, 2.418 g cm-2, .3178 cm-atm; 0.2 % for its other constants."""
    atmosphere = Atmosphere(altitude=0.4)
    assert atmosphere.pressure == pytest.approx(967.05, abs=0.01)
    assert atmosphere.water_vapour == pytest.approx(2.418, rel=2e-3)
    assert atmosphere.ozone == pytest.approx(0.3178, rel=2e-3)


@pytest.mark.parametrize(
    "visibility, aot", [(5, 0.77998), (8, 0.51913), (10, 0.43208), (15, 0.31584), (23, 0.23472), (45, 0.15974)]
)
def test_visibility_gives_the_optical_thickness_of_6s(visibility, aot):
    """The same number profiles: to the last digit."""
    assert Atmosphere(visibility=visibility).aot == pytest.approx(aot, abs=5e-6)


@pytest.mark.parametrize(
    ("given", "cure"), [({"altitude": 400}, "altitude=0.4"), ({"visibility": 23e3}, "visibility=23")]
)
def test_metres_are_told_in_kilometres(given, cure):
    with pytest.raises(ValueError, match=f"where that is metres, type {cure}$"):
        Atmosphere(**given)


def test_aerosol_does_not_depend_on_altitude():
    assert Atmosphere(altitude=0).aot == Atmosphere(altitude=3).aot


@pytest.mark.parametrize(
    "altitude, wavelength, tau",
    [(0, 0.4, 0.361932), (0, 0.55, 0.097761), (0, 0.633, 0.0551951), (0.4, 0.55, 0.0933447), (1, 0.443, 0.2112818)],
)
def test_rayleigh_optical_depth_agrees_with_6s(altitude, wavelength, tau):
    """0.3 % less: 6S closes its profile by a layer from 100 to 99999 km that holds 0.26 % of the molecules."""
    assert Atmosphere(altitude=altitude).rayleigh_optical_depth(wavelength) == pytest.approx(tau, rel=3.2e-3)


def test_aerosol_optical_depth_falls_from_blue_to_infrared():
    depths = Atmosphere().aerosol_optical_depth(np.linspace(0.4, 2.5, 50))
    assert np.all(np.diff(depths) < 0)


@pytest.mark.parametrize("visibility", [5.0, 23.0, 45, 1 / 3 + 10])
@pytest.mark.parametrize("altitude", [0.0, 0.4, 1e-9, np.pi])
def test_text_survives_a_round_trip(visibility, altitude):
    atmosphere = Atmosphere(visibility=visibility, altitude=altitude)
    assert Atmosphere.parse(atmosphere.text) == atmosphere


def test_text_reads_well():
    assert Atmosphere().text == "profile=midlatitude-summer aerosol=continental visibility=45 km altitude=0.4 km"


@pytest.mark.parametrize(
    "arguments, message",
    [
        (
            {"profile": "midlat_summer"},
            r"profile must be one of .*, got 'midlat_summer': type profile='midlatitude-sum",
        ),
        ({"aerosol": "continentl"}, r"aerosol must be one of .*, got 'continentl': type aerosol='continental'"),
        ({"visibility": 3}, r"visibility must be from 5 to 100 km, got 3"),
        ({"visibility": float("nan")}, r"visibility must be from 5 to 100 km, got nan"),
        ({"altitude": 5}, r"altitude must be from 0 to 4 km, got 5"),
    ],
)
def test_a_mistake_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Atmosphere(**arguments)


def test_a_number_as_text_is_refused():
    with pytest.raises(TypeError, match=r"visibility must be a number from 5 to 100 \[km\], got '45'"):
        Atmosphere(visibility="45")


def test_text_of_another_form_is_refused():
    with pytest.raises(ValueError, match="atmosphere must read like 'profile=midlatitude-summer"):
        Atmosphere.parse("midlatitude summer, 45 km")


def test_columns_of_the_user_scale_the_profile():
    dry, own = Atmosphere(), Atmosphere(h2o=1.2, o3=0.4)
    assert (own.water_vapour, own.ozone) == pytest.approx((1.2, 0.4), rel=1e-12)
    ratio = own.levels.h2o / dry.levels.h2o
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-12)


def test_amount_by_optical_thickness():
    assert Atmosphere(aot=0.3).visibility is None
    assert Atmosphere(aot=0.3).aerosol_optical_depth(np.array([0.55]))[0] == pytest.approx(0.3, rel=1e-6)
    assert Atmosphere(aerosol="none").aot == 0
    with pytest.raises(ValueError, match=r"give visibility or aot, not both: 23 km is an aot of 0\.2347, got 0\.1"):
        Atmosphere(visibility=23, aot=0.1)
    with pytest.raises(ValueError, match=r"aot must be 0 without aerosol, got 0\.1"):
        Atmosphere(aerosol="none", aot=0.1)


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"h2o": -1}, "h2o must be from 0 to 10 g cm-2, got -1"),
        ({"o3": 300}, "o3 must be from 0 to 1 cm-atm, got 300"),
        ({"aot": -0.1}, "aot must be from 0 to 2 optical thickness at 0.55 um, got -0.1"),
        ({"engine": "6s"}, "engine must be one of 5S, successive-orders, .*, got '6s': type engine='6S'"),
    ],
)
def test_amounts_out_of_range_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Atmosphere(**arguments)


@pytest.mark.parametrize(
    "arguments", [{"aot": 0.25, "h2o": 2.5}, {"o3": 0.3, "engine": "successive-orders"}, {"aerosol": "none"}]
)
def test_text_tells_everything(arguments):
    atmosphere = Atmosphere(**arguments)
    assert Atmosphere.parse(atmosphere.text) == atmosphere


def test_documentation_names_all_that_may_be_asked_for():
    said = Atmosphere.__doc__
    names = (*models.PROFILES, *mixtures.MODELS, *mixtures.COMPONENTS, *ENGINES)
    assert [name for name in names if name not in said] == []


def test_no_name_and_no_number_is_suggested_for_what_is_far_off():
    with pytest.raises(ValueError, match=r"profile must be one of tropical, .*, us-1962, got 'standard'$"):
        Atmosphere(profile="standard")
    with pytest.raises(ValueError, match=r"visibility must be from 5 to 100 km, got 2$"):
        Atmosphere(visibility=2)
