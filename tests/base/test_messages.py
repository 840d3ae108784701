"""Messages: misspelt names, pydantic errors, warnings at the user's line, and the logger."""

import inspect
import logging
import pickle
import warnings
from dataclasses import dataclass
from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, Field, TypeAdapter, ValidationError

import fifesim
from fifesim.base.messages import LOG, in_own_words, is_quiet, nearest, quiet, spelled, unknown_argument, warn


def test_nearest_name_is_suggested_if_it_is_similar():
    assert nearest("sens", ["sense", "slope"]) == "did you mean 'sense'? "
    assert nearest("zzz", ["sense", "slope"]) == ""


def test_only_unknown_arguments_give_a_message():
    signature = inspect.signature(lambda toa, offset=0: None)
    assert unknown_argument("sense", signature, {"toa": 1, "offset": 2}) == ""
    said = "sense has no argument 'ofset': did you mean 'offset'? There are toa, offset"
    assert unknown_argument("sense", signature, {"toa": 1, "ofset": 2}) == said


@dataclass(frozen=True)
class Plain:
    visibility: float = 45.0


def test_class_keeps_its_signature_and_names_misspelt_arguments():
    before = inspect.signature(Plain)
    assert spelled(Plain) is Plain and inspect.signature(Plain) == before
    assert Plain(23.0) == Plain(visibility=23.0) == pickle.loads(pickle.dumps(Plain(23.0)))
    with pytest.raises(TypeError, match=r"^Plain has no argument 'visibilty': did you mean 'visibility'\? There are v"):
        Plain(visibilty=23.0)


FOREIGN = {
    fifesim.Leaf: {
        "cab": "chlorophyll", "car": "carotenoids", "ant": "anthocyanins", "cbrown": "brown", "cw": "water",
        "cm": "dry_matter", "n": "structure", "N": "structure",
    },
    fifesim.Canopy: {"lidfa": "leaf_angles", "LIDF_a": "leaf_angles", "hspot": "hotspot", "psoil": "moisture"},
    fifesim.Atmosphere: {"vis": "visibility", "aod550": "aot", "water_vapour": "h2o", "ozone": "o3"},
    fifesim.models.Weather: {"rh": "humidity"},
}  # fmt: skip


def test_misspelt_names_give_a_suggestion(lai):
    typed = [
        (lambda: lai.fifesim.sens, AttributeError, "no method 'sens' of an xarray.DataArray: did you mean 'sense'"),
        (lambda: lai.fifesim.fife_site, AttributeError, "fife_site is no method of a raster.* fifesim.fife_site is"),
        (lambda: lai.fifesim.fpar(leaf_angles="spherical"), TypeError, r"type canopy=.*\.Canopy\(leaf_angles=...\)"),
        (lambda: fifesim.Atmosphere(visibilty=23), TypeError, "Atmosphere has no .* did you mean 'visibility'"),
        # Names of PROSAIL and 6S.
        *(
            (lambda kind=kind, name=name: kind(**{name: 1.0}), TypeError, f"has no argument {name!r}: .*'{own}'")
            for kind, names in FOREIGN.items()
            for name, own in names.items()
        ),
        (lambda: lai.fifesim.fpar(hspot=0.1), TypeError, r"type canopy=fifesim\.Canopy\(hotspot=...\)"),
        (
            lambda: fifesim.ground.canopy_spectra({"cab": 40}),
            ValueError,
            "derivatives: did you mean 'leaf_chlorophyll'. There",
        ),
    ]
    for call, kind, said in typed:
        with pytest.raises(kind, match=said) as caught:
            call()
        assert len(str(caught.value)) <= 500


def test_method_of_another_container_names_that_container(lai):
    (name,) = [name for name, public in fifesim.accessor.PUBLIC.items() if public.methods_of == ("DataTree",)][:1]
    with pytest.raises(AttributeError, match=f"{name} is a method of an xarray.DataTree, this is an xarray.DataArray"):
        getattr(lai.fifesim, name)


class Table(BaseModel):
    number: float = 1.0


@pytest.mark.parametrize(
    ("kind", "value", "said"),
    [
        (bool, "x", "must be true or false"),
        (Table, 3, "must be a table of keys"),
        (Annotated[float, Field(allow_inf_nan=False)], float("nan"), "must be a finite number"),
        (float, "x", "must be a number"),
        (Annotated[float, Field(gt=0.25)], 0.25, "must be above 0.25"),
        (Annotated[float, Field(ge=5)], 4, "must be at least 5"),
        (Annotated[float, Field(lt=0.25)], 0.25, "must be below 0.25"),
        (Annotated[float, Field(le=100)], 101, "must be at most 100"),
        (int, 1.5, "must be a whole number"),
        (list[str], True, "must be a list, in brackets"),
        (Literal["streaming", "periodic"], "quick", "must be 'streaming' or 'periodic'"),
        (str, 3, "must be text, in quotes"),
        (Annotated[str, Field(max_length=2)], "abc", "must have at most 2 characters"),
        (Annotated[str, Field(min_length=2)], "a", "must have at least 2 characters"),
        (Annotated[list[float], Field(min_length=2)], [1.0], "needs 2 of them or more"),
        (Annotated[list[float], Field(max_length=1)], [1.0, 2.0], "takes 1 of them at most"),
    ],
)
def test_validation_errors_state_the_allowed_values(kind, value, said):
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(kind).validate_python(value)
    assert in_own_words(caught.value.errors()[0]) == said


def test_warning_points_outside_the_package():
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        warn("careful")
    assert [(str(each.message), each.filename) for each in said] == [("careful", __file__)]


def test_the_logger_is_called_fifesim_and_has_no_handlers():
    assert LOG is logging.getLogger("fifesim") and not LOG.handlers


def test_quiet_ends_with_its_context():
    with quiet():
        assert is_quiet()
        with quiet(False):
            assert not is_quiet()
        assert is_quiet()
    assert not is_quiet()
