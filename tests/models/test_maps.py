"""Maps of production, evapotranspiration and albedo: labels, weather and error messages."""

import warnings
from functools import partial

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function, in_chunks

import fifesim
from fifesim.models import production
from fifesim.models.radiation import two_stream

WEATHER = fifesim.models.fife_weather()


def field(lai, low, high):
    values = np.random.default_rng(2).uniform(low, high, lai.shape)
    return lai.copy(data=values).drop_attrs().rename("field")


@pytest.mark.parametrize("model", ["light-use", "photosynthesis", "farquhar"])
def test_production_is_a_raster_function(lai, model):
    check_raster_function(lambda each: each.fifesim.gpp(model=model), lai, quantity="gpp")


@pytest.mark.parametrize("model", ["penman-monteith", "pt-jpl"])
def test_evapotranspiration_is_a_raster_function(lai, model):
    warm = WEATHER.replace(temperature=field(lai, 290, 300))
    verb = partial(fifesim.evapotranspiration, weather=warm, model=model)
    check_raster_function(verb, lai, quantity="evapotranspiration")


def test_light_use_map_equals_the_formula_at_each_cell(lai):
    temperature, absorbed = field(lai, 285, 305), field(lai, 0, 1)
    weather = WEATHER.replace(temperature=temperature, temperature_min=276.0)
    made = lai.fifesim.gpp(weather, fpar=absorbed)
    celsius = temperature.values - 273.15
    deficit = 0.5 * 610.8 * np.exp(17.27 * celsius / (celsius + 237.3))
    energy = 0.45 * 550 * 14.9 * 0.0036
    expected = production.light_use_gpp(276.0 - 273.15, deficit, absorbed.values, energy)
    np.testing.assert_allclose(made, expected, rtol=1e-12)
    assert made.attrs["units"] == "g m-2 d-1" and "temperature by cell" in made.attrs["history"]


def test_only_green_leaves_produce(lai):
    half = fifesim.Canopy(brown=0.5)
    expected = (0.5 * lai).fifesim.gpp(model="farquhar")
    np.testing.assert_allclose(lai.fifesim.gpp(model="farquhar", canopy=half), expected, rtol=1e-12)
    land = lai.to_dataset(name="lai").assign(brown=xr.full_like(lai, 0.5).drop_attrs())
    np.testing.assert_allclose(land.fifesim.gpp(model="farquhar"), expected, rtol=1e-12)
    at = {"time": "1987-06-06T15:00Z"}
    green = lai.fifesim.fpar(method="energy", leaves="green", canopy=half, **at)
    np.testing.assert_allclose(lai.fifesim.gpp(canopy=half, **at), lai.fifesim.gpp(fpar=green, **at), rtol=1e-3)


def test_pathway_is_c4_for_the_tallgrass_of_fife(lai):
    grass, c3 = lai.fifesim.gpp(model="farquhar"), lai.fifesim.gpp(model="farquhar", pathway="C3")
    np.testing.assert_array_equal(grass, lai.fifesim.gpp(model="farquhar", pathway="C4"))
    assert "C4" in grass.history and "C3" in c3.history and float(grass.mean()) > 1.2 * float(c3.mean())
    with pytest.raises(ValueError, match="pathway has no effect with model='light-use'"):
        lai.fifesim.gpp(pathway="C4")


def test_albedo_equals_the_two_stream_model_of_each_band(lai):
    leaf, ground = (0.3, 0.2), 0.15
    made = lai.fifesim.albedo(canopy=fifesim.Canopy(leaf_optics=leaf, background=ground), chi=0.2)
    found = two_stream(*leaf, 0.2, float(fifesim.fife_geometry().sza), lai.values, ground)
    low, high = np.minimum(found.albedo_beam, found.albedo_diffuse), np.maximum(found.albedo_beam, found.albedo_diffuse)
    # All bands have the same optics, so albedo lies between both values, closer to the value for the beam.
    assert ((made >= low - 1e-6) & (made <= high + 1e-6)).all()
    assert (abs(made - found.albedo_beam) <= abs(made - found.albedo_diffuse) + 2e-6).all()
    check_raster_function(lambda each: each.fifesim.albedo(), lai, quantity="albedo")
    with pytest.raises(ValueError, match="canopies that differ in leaf area only, got crown_cover"):
        lai.fifesim.albedo(canopy=fifesim.Canopy(crown_cover=0.5))


@pytest.mark.parametrize(
    "change, message",
    [
        ({"temperature": 25.0}, r"temperature must be in \[150, 350\] K, got 25: degC was given for K: add 273.15"),
        ({"humidity": 50.0}, "divide percent by 100"),
        ({"pressure": 965.0}, "multiply hPa by 100, kPa by 1000"),
    ],
)
def test_other_units_are_refused(lai, change, message):
    with pytest.raises(ValueError, match=message):
        WEATHER.replace(**change)
    (name, value), *_ = change.items()
    raster = xr.full_like(lai, value).drop_attrs()
    with pytest.raises(ValueError, match=message):
        WEATHER.replace(**{name: raster})
    in_blocks = WEATHER.replace(**{name: in_chunks(raster, {"y": 9, "x": 9})})
    lazy = in_chunks(lai, {"y": 9, "x": 9}).fifesim.evapotranspiration(in_blocks)
    with pytest.raises(ValueError, match=message):
        lazy.compute()


def test_units_of_rasters_and_ranges_of_formulas_are_checked(lai):
    celsius = xr.full_like(lai, 25.0).assign_attrs(units="degC")
    with pytest.raises(ValueError, match="temperature has units 'degC', needs 'K'"):
        WEATHER.replace(temperature=celsius)
    with pytest.warns(UserWarning, match=r"temperature is 340 K.*hold from 228.15 to 333.15"):
        WEATHER.replace(temperature=340.0, temperature_max=345.0)
    with pytest.warns(UserWarning, match=r"shortwave is 29\.5 W m-2, .* not MJ m-2 d-1"):
        WEATHER.replace(shortwave=29.5)
    for name, value in (("shortwave", np.nan), ("day_length", np.inf)):
        with pytest.raises(ValueError, match=f"{name} must be finite"):
            WEATHER.replace(**{name: value})
    with pytest.raises(ValueError, match="humidity must be finite"):
        WEATHER.replace(humidity=field(lai, 0, 1).where(lai > lai.min()))


def test_weather_is_equal_by_value(lai):
    moist, dry = field(lai, 0.5, 1), field(lai, 0, 0.5)
    assert fifesim.models.fife_weather() == WEATHER and hash(fifesim.models.fife_weather()) == hash(WEATHER)
    assert WEATHER.replace(humidity=moist) == WEATHER.replace(humidity=moist.copy())
    assert WEATHER.replace(humidity=moist) != WEATHER.replace(humidity=dry) != WEATHER


def test_contradictory_weather_is_rejected(lai):
    for change in ({"temperature": 288.0}, {"temperature_max": 299.0}):
        with pytest.raises(ValueError, match=r"must not exceed temperature.*, got (289|300) and (288|299) K"):
            WEATHER.replace(**change)
    cold = WEATHER.replace(temperature=field(lai, 280, 300))
    with pytest.raises(ValueError, match="temperature_min must not exceed temperature, got 289 and 28"):
        lai.fifesim.gpp(cold).compute()
    shifted = WEATHER.replace(pressure=field(lai, 96000, 97000).assign_coords(x=lai.x + 30))
    with pytest.raises(ValueError, match="'pressure' have different grids"):
        lai.fifesim.evapotranspiration(shifted)
    # Only light-use and Penman-Monteith need the minimum temperature.
    assert np.isfinite(lai.fifesim.gpp(cold, model="farquhar")).all()


def test_given_fpar_is_a_fraction_and_must_have_an_effect(lai):
    absorbed = field(lai, 0, 1)
    for wrong in (100 * absorbed, -absorbed):
        with pytest.raises(ValueError, match=r"fpar must be in \[0, 1\], got"):
            lai.fifesim.evapotranspiration(fpar=wrong).compute()
    with pytest.raises(ValueError, match="fpar has no effect with model='farquhar'"):
        lai.fifesim.gpp(fpar=absorbed, model="farquhar")
    for what, given in (("canopy", fifesim.Canopy(brown=0.5)), ("atmosphere", fifesim.Atmosphere(visibility=20.0))):
        for verb in (fifesim.gpp, fifesim.evapotranspiration):
            with pytest.raises(ValueError, match=f"{what} has no effect with fpar, .*leave out one of them"):
                verb(lai, fpar=absorbed, **{what: given})
    # FPAR of bare and almost bare ground is also a valid fraction.
    for area in (0 * lai, 0 * lai + 1e-9):
        assert (area.fifesim.gpp() >= 0).all()


def test_weather_and_leaves_of_another_site_are_asked_for():
    """Each argument that is given ends its warning; the energy balance needs the leaves, FPAR of a map does not."""
    grid = fifesim.grid_at("EPSG:32633", 390000, 5820000, width=300, height=300, cell=30)
    lai = fifesim.lai_scene(grid, seed=7)
    sun, air = fifesim.Geometry(sza=40, saa=150), fifesim.Atmosphere(altitude=0.1)
    canopy = fifesim.Canopy(leaf_optics=fifesim.Leaf(), background=0.2)
    verb = partial(lai.fifesim.evapotranspiration, atmosphere=air, geometry=sun)
    with pytest.warns(UserWarning, match=r"weather over lai is unknown.*June.*300 K.*weather=fifesim\.models\.Weather"):
        verb(canopy=canopy)
    for model in ("light-use", "farquhar"):
        with pytest.warns(UserWarning, match=r"weather over lai is unknown"):
            lai.fifesim.gpp(model=model, geometry=sun, canopy=canopy, atmosphere=air)
    for leaves in (verb, lambda **options: lai.fifesim.light(atmosphere=air, geometry=sun)):
        with pytest.warns(UserWarning, match=r"vegetation of lai is unknown.*FIFE's tallgrass.*leaf_optics=") as found:
            leaves(weather=WEATHER)
        assert len(found) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        verb(weather=WEATHER, canopy=canopy)
        lai.fifesim.evapotranspiration(WEATHER, fpar=0.1 * lai.rename("fpar"), geometry=sun)
