"""Maps of production, evapotranspiration and albedo: labels, weather, sums over a day, and error messages."""

from functools import partial

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function, in_chunks
from scipy.interpolate import PchipInterpolator

import fifesim
from fifesim.chain.absorbed_light import PAR_BANDS, par_at_ground, sunlit_kernel
from fifesim.chain.landscapes import Land, canopies_of
from fifesim.models import evaporation, production
from fifesim.models.daylight import Suns, declination
from fifesim.models.radiation import two_stream

WEATHER = fifesim.models.fife_weather()


def field(lai, low, high):
    values = np.random.default_rng(2).uniform(low, high, lai.shape)
    return lai.copy(data=values).drop_attrs().rename("field")


@pytest.mark.parametrize("verb", ["light-use", "photosynthesis", "farquhar", "penman-monteith", "pt-jpl", "albedo"])
def test_models_are_raster_functions(lai, verb):
    """Weather by cell."""
    warm = {"weather": WEATHER.replace(temperature=field(lai, 290, 300)), "model": verb}
    name = "evapotranspiration" if verb in ("penman-monteith", "pt-jpl") else "gpp"
    function = fifesim.albedo if verb == "albedo" else partial(getattr(fifesim, name), **warm)
    check_raster_function(function, lai, quantity="albedo" if verb == "albedo" else name)


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


def test_albedo_equals_the_two_stream_model_of_each_band(lai):
    leaf, ground = (0.3, 0.2), 0.15
    made = lai.fifesim.albedo(canopy=fifesim.Canopy(leaf_optics=leaf, background=ground), chi=0.2)
    found = two_stream(*leaf, 0.2, float(fifesim.fife_geometry().sza), lai.values, ground)
    low, high = np.minimum(found.albedo_beam, found.albedo_diffuse), np.maximum(found.albedo_beam, found.albedo_diffuse)
    # All bands have the same optics, so albedo lies between both values, closer to the value for the beam.
    assert ((made >= low - 1e-6) & (made <= high + 1e-6)).all()
    assert (abs(made - found.albedo_beam) <= abs(made - found.albedo_diffuse) + 2e-6).all()


def test_weather_by_cell_is_checked_when_it_is_computed(lai):
    chunks = {"y": 9, "x": 9}
    celsius = xr.full_like(lai, 25.0).drop_attrs()
    with pytest.raises(ValueError, match=r"temperature must be in \[150, 350\] K, got 25: degC was given for K"):
        WEATHER.replace(temperature=celsius)
    cold = WEATHER.replace(temperature=field(lai, 280, 300))
    messages = {"temperature must be in": WEATHER.replace(temperature=in_chunks(celsius, chunks))}
    messages["temperature_min must not exceed temperature, got 289 and 28"] = cold
    for message, weather in messages.items():
        lazy = in_chunks(lai, chunks).fifesim.evapotranspiration(weather)
        with pytest.raises(ValueError, match=message):
            lazy.compute()
    with pytest.raises(ValueError, match="humidity must be finite"):
        WEATHER.replace(humidity=field(lai, 0, 1).where(lai > lai.min()))
    # FPAR of bare and almost bare ground is also a valid fraction.
    assert all((area.fifesim.gpp() >= 0).all() for area in (0 * lai, 0 * lai + 1e-9))
    # Only light-use and Penman-Monteith need the minimum temperature.
    assert np.isfinite(lai.fifesim.gpp(cold, model="farquhar")).all()


AREAS = np.array([0.1, 0.25, 0.5, 0.74, 1.0, 1.41, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0])
AIR = fifesim.Atmosphere()
CANOPY = fifesim.Canopy(leaf_optics=fifesim.Leaf(), background=0.2)
NOON = {"2022-03-20": 0.0, "2022-06-21": 23.44, "2022-10-15": -8.5, "2022-12-21": -23.44}
FLUXES = {
    "light-use": ("gpp", {}),
    "photosynthesis": ("gpp", {}),
    "C3": ("gpp", {"model": "farquhar", "pathway": "C3"}),
    "C4": ("gpp", {"model": "farquhar", "pathway": "C4"}),
    "penman-monteith": ("evapotranspiration", {}),
    "pt-jpl": ("evapotranspiration", {}),
}


def raster(latitude, values=AREAS):
    """Leaf area in UTM zone 33 at a latitude, and this latitude."""
    grid = fifesim.grid_at("EPSG:32633", 500000, 110900.0 * latitude, 30 * len(values), 30, 30)
    lai = fifesim.lai_scene(grid, seed=7).copy(data=np.reshape(values, (1, -1)))
    return lai, float(fifesim.grids.projection.middle(grid)[1])


@pytest.fixture(scope="module")
def absorbed():
    """FPAR of the leaf areas, and photon flux and its diffuse fraction, by zenith angle of the sun."""
    angles = np.array([*range(0, 76, 5), *np.arange(77, 90, 2.0), 89.9])
    stand = canopies_of(Land(None), PAR_BANDS, CANOPY)[None]
    kernel, rasters = sunlit_kernel(None, stand, AIR, tuple(angles.tolist()), "green")
    fpar = PchipInterpolator(angles, kernel(AREAS, *(each.values for each in rasters)))
    light = [(flux.sum(), flux @ sky / flux.sum()) for flux, sky in (par_at_ground(AIR, each) for each in angles)]
    return fpar, PchipInterpolator(angles, light)


def fluxes(lai, fpar, sza, weather, light, sky):
    """Production [g m-2 s-1] and evapotranspiration [kg m-2 s-1] at one sun, by the formulas."""
    mean, photons = 0.45 * weather.shortwave * light, 4.57 * 0.45 * weather.shortwave * light
    deficit = evaporation.saturation_pressure(weather.temperature)[0] * (1 - weather.humidity)
    heat = evaporation.latent_heat(weather.temperature)
    air = weather.temperature, 100 * weather.humidity, weather.pressure
    net, soil = light * weather.net_radiation, light * weather.ground_heat
    carbon, light_and_heat = production.CARBON, (lai, photons, sky, sza, weather.temperature)
    return {
        "light-use": production.light_use_gpp(weather.temperature_min - 273.15, deficit, fpar, 1e-6 * mean),
        "photosynthesis": carbon
        * production.canopy_photosynthesis(lai, 0.5 / np.cos(np.radians(sza)), photons, 0.05, 30.0),
        "C3": carbon * production.farquhar_canopy(*light_and_heat),
        "C4": carbon * production.c4_canopy(*light_and_heat, pressure_pa=weather.pressure),
        "penman-monteith": evaporation.penman_monteith(*air, lai, fpar, net, weather.temperature_min).le / heat,
        "pt-jpl": evaporation.pt_jpl(*air, 0.8 * fpar + 0.17, 0.94, lai, net, soil).le / heat,
    }


@pytest.mark.slow
@pytest.mark.parametrize("date", NOON)
@pytest.mark.parametrize("latitude", [0.5, 39.0, 60.0])
def test_day_equals_the_sum_over_144_steps(absorbed, latitude, date):
    lai, north = raster(latitude)
    phi, delta = np.radians([north, NOON[date]])
    sunset = np.arccos(-np.tan(phi) * np.tan(delta))
    angle = sunset * (2 * (np.arange(144) + 0.5) / 144 - 1)
    sza = np.degrees(np.arccos(np.sin(phi) * np.sin(delta) + np.cos(phi) * np.cos(delta) * np.cos(angle)))
    weather = WEATHER.replace(day_length=24 / np.pi * sunset)
    (flux, sky), fpar = absorbed[1](sza).T, absorbed[0](sza)
    flux = flux * np.cos(np.radians(sza))
    light, sky = flux / flux.mean(), weather.diffuse_fraction * sky * flux.sum() / (sky @ flux)
    steps = [fluxes(AREAS, *each[:2], weather, *each[2:]) for each in zip(fpar, sza, light, sky, strict=True)]
    noon = fifesim.Geometry(abs(north - NOON[date]), 180.0 if north > NOON[date] else 0.0)
    for name, (verb, options) in FLUXES.items():
        given = {"model": name, "canopy": CANOPY, "atmosphere": AIR, "geometry": noon} | options
        day = getattr(lai.fifesim, verb)(weather, **given)
        total = 3600 * weather.day_length * np.mean([each[name] for each in steps], axis=0)
        np.testing.assert_allclose(day.values[0], total, rtol=5e-3, err_msg=name)


def test_instant_is_a_flux_and_a_date_is_a_day(absorbed):
    lai, _ = raster(39.0)
    given = {"canopy": CANOPY, "atmosphere": AIR, "weather": WEATHER}
    day = lai.assign_coords(time=np.datetime64("2022-06-21")).fifesim.gpp(**given)
    times = [f"2022-06-21T{hour:02d}:30Z" for hour in range(4, 18)]
    instants = [lai.fifesim.gpp(**given, time=time) for time in times]
    assert day.attrs["units"] == "g m-2 d-1" and instants[0].attrs["units"] == "g m-2 s-1"
    np.testing.assert_allclose(3600 * sum(each.values for each in instants), day.values, rtol=0.01)
    # Weather by cell leads to the same sum without a table.
    cells = given["weather"].replace(temperature=(0 * lai + 300.0).drop_attrs().rename("temperature"))
    by_cell = lai.assign_coords(time=np.datetime64("2022-06-21")).fifesim.gpp(**given | {"weather": cells})
    np.testing.assert_allclose(by_cell, day, rtol=1e-4)


def test_polar_night_is_zero_and_polar_day_has_24_hours():
    lai, _ = raster(75.0, [np.nan, 0.5, 3.0])
    given = {"canopy": CANOPY, "atmosphere": AIR, "weather": WEATHER.replace(day_length=24.0)}
    with pytest.warns(UserWarning, match="does not rise on this day: gpp is 0"):
        night = lai.assign_coords(time=np.datetime64("2022-12-21T12:00")).fifesim.gpp(**given)
    np.testing.assert_array_equal(night.values[0], [np.nan, 0.0, 0.0])
    with pytest.warns(UserWarning, match="below the horizon, sza 112.4"):
        assert (lai.fifesim.evapotranspiration(**given, time="2022-03-01T00:00Z").values[0, 1:] == 0).all()
    summer = lai.assign_coords(time=np.datetime64("2022-06-21T12:00")).fifesim.gpp(**given)
    assert "24.00 h" in summer.history and summer.values[0, 2] > summer.values[0, 1] > 0
    with pytest.warns(UserWarning, match="day_length 14.9 h, but the sun is over .* for 24.0 h"):
        lai.fifesim.gpp(**given | {"weather": WEATHER}, time="2022-06-21T12:00Z")


def test_declination_follows_from_the_sun_of_any_time():
    for time in ("2022-06-21T09:14Z", "2022-10-15T14:00Z"):
        sun = fifesim.sun_position(time, 45.0, 10.0)
        assert declination(sun.sza, sun.saa, 45.0) == pytest.approx(23.44 if "06" in time else -8.6, abs=0.1)
    with pytest.warns(UserWarning, match="never stands at sza 10 and saa 0 over latitude 39"):
        assert declination(10.0, 0.0, 39.0) == 23.45


def test_diffuse_fraction_keeps_the_mean_of_the_day():
    day = Suns((20.0, 70.0), (0.6, 0.4), (1.3, 0.55), (0.1, 0.4), 0.6 * 1.3 * 0.1 + 0.4 * 0.55 * 0.4, 12.0)
    for given in (0.0, 0.1, 0.5, 1.0):
        assert day.weighted([day.diffuse_fraction(n, given) for n in (0, 1)]) == pytest.approx(given, rel=1e-12)
