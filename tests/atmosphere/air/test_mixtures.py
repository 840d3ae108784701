"""An aerosol has one name, and a mistake in it is said."""

import pytest

from fifesim.atmosphere.mixtures import MODELS, canonical, mixture


@pytest.mark.parametrize(
    "aerosol, name",
    [
        ("urban", "urban"),
        ({"soot": 0.01, "dust": 0.7, "water_soluble": 0.29}, "continental"),
        ("oceanic:0.95+water_soluble:0.05", "maritime"),
        ({"water_soluble": 0.5, "dust": 0.5, "soot": 0}, "dust:0.5+water_soluble:0.5"),
        (" soot : 0.25 + dust:0.75", "dust:0.75+soot:0.25"),
        ({"oceanic": 1}, "oceanic:1"),
    ],
)
def test_an_aerosol_has_one_name(aerosol, name):
    assert canonical(aerosol) == name
    assert canonical(canonical(aerosol)) == name
    assert mixture(canonical(aerosol)) == mixture(aerosol)


@pytest.mark.parametrize(
    "aerosol, message",
    [
        ("continentl", "aerosol must be one of .*, got 'continentl': type aerosol='continental'"),
        ({"dusk": 1.0}, "component must be one of .*, got 'dusk' .*: type 'dust'"),
        ("dust:1.5+soot:-0.5", "fraction of soot must be from 0 to 1, got -0.5"),
        ({"dust": float("nan"), "soot": 1}, "fraction of dust must be from 0 to 1, got nan"),
        ("dust:2+soot:2", "must add up to 1, got 4 .*: type aerosol='dust:0.5[+]soot:0.5'"),
        ({}, "must add up to 1, got 0"),
        ("dust:half", "a number after a colon, got 'dust:half'"),
        ("dust:0.5+dust:0.5", "each component once, got 'dust' twice"),
    ],
)
def test_a_mistake_in_a_mixture_is_named(aerosol, message):
    with pytest.raises(ValueError, match=message):
        mixture(aerosol)


@pytest.mark.parametrize("aerosol", [3.0, None, {"dust": "1"}, {"dust": True}])
def test_an_aerosol_of_the_wrong_kind_is_refused(aerosol):
    with pytest.raises(TypeError, match="aerosol"):
        canonical(aerosol)


def test_giving_a_mapping_leaves_it_untouched():
    given = {"soot": 0.0, "dust": 1.0}
    mixture(given)["dust"] = 7
    mixture("urban")["dust"] = 7
    assert given == {"soot": 0.0, "dust": 1.0} and MODELS["urban"]["dust"] == 0.17


def test_a_name_is_suggested_only_where_the_spelling_is_close():
    for given, said in (("dust", "type aerosol='dust:1'"), ("maritme", "type aerosol='maritime'")):
        with pytest.raises(ValueError, match=f"such as dust:1 or .*{said}"):
            mixture(given)
    with pytest.raises(ValueError, match=r"a mixture of dust, water_soluble, oceanic, soot.*got 'sulphate'$"):
        mixture("sulphate")
    with pytest.raises(ValueError, match=r"got 'sand' in 'sand:1'$"):
        mixture("sand:1")
