"""Misspelt names."""

import inspect
import pickle
from dataclasses import dataclass

import pytest

import fifesim
from fifesim.base.messages import nearest, spelled, unknown_argument


def test_the_nearest_is_named_and_none_where_none_is_near():
    assert nearest("sens", ["sense", "slope"]) == "did you mean 'sense'? "
    assert nearest("zzz", ["sense", "slope"]) == ""


def test_known_arguments_are_nothing_wrong():
    signature = inspect.signature(lambda toa, offset=0: None)
    assert unknown_argument("sense", signature, {"toa": 1, "offset": 2}) == ""
    said = "sense has no argument 'ofset': did you mean 'offset'? There are toa, offset"
    assert unknown_argument("sense", signature, {"toa": 1, "ofset": 2}) == said


@dataclass(frozen=True)
class Plain:
    visibility: float = 45.0


def test_a_class_keeps_its_signature_and_says_which_argument_is_misspelt():
    before = inspect.signature(Plain)
    assert spelled(Plain) is Plain and inspect.signature(Plain) == before
    assert Plain(23.0) == Plain(visibility=23.0) == pickle.loads(pickle.dumps(Plain(23.0)))
    with pytest.raises(TypeError, match=r"^Plain has no argument 'visibilty': did you mean 'visibility'\? There are v"):
        Plain(visibilty=23.0)


def test_what_a_user_misspells(lai):
    typed = [
        (lambda: fifesim.sens, AttributeError, "no attribute 'sens': did you mean 'sense'"),
        (lambda: lai.fifesim.sens, AttributeError, "no method 'sens' of an xarray.DataArray: did you mean 'sense'"),
        (lambda: lai.fifesim.fife_site, AttributeError, "fife_site is no method of a raster.* fifesim.fife_site is"),
        (lambda: lai.fifesim.fpar(canpoy=fifesim.Canopy()), TypeError, "fpar has no .* did you mean 'canopy'"),
        (lambda: fifesim.Canopy(leaf_angels="spherical"), TypeError, "Canopy has no .* did you mean 'leaf_angles'"),
        (
            lambda: lai.fifesim.fpar(leaf_angles="spherical"),
            TypeError,
            r"type canopy=fifesim.Canopy\(leaf_angles=...\)",
        ),
        (lambda: fifesim.Atmosphere(visibilty=23), TypeError, "Atmosphere has no .* did you mean 'visibility'"),
    ]
    for call, kind, said in typed:
        with pytest.raises(kind, match=said) as caught:
            call()
        assert len(str(caught.value)) <= 500


def test_a_method_of_another_kind_of_raster_is_told(lai):
    (name,) = [name for name, public in fifesim.accessor.PUBLIC.items() if public.methods_of == ("DataTree",)][:1]
    with pytest.raises(AttributeError, match=f"{name} is a method of an xarray.DataTree, this is an xarray.DataArray"):
        getattr(lai.fifesim, name)
