"""Atmosphere, bands and directions that a raster carries in its attrs and coordinates, or that must be given."""

import dataclasses
import warnings

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim
from fifesim.atmosphere import coupling, engines
from fifesim.base.geometry import Geometry
from fifesim.grids import directions
from fifesim.grids import grid as grids
from fifesim.sensor.description.instruments import instrument

TM34 = ["TM3", "TM4"]
AIR = fifesim.Atmosphere()


def narrow_terms(atmosphere):
    """Terms of narrow bands in red and near infrared, under the sun of FIFE."""
    bands = (fifesim.sensor.Band("narrow", (at - 0.0025, at, at + 0.0025), (0.0, 1.0, 0.0)) for at in (0.665, 0.842))
    return engines.band_terms(atmosphere, tuple(bands), fifesim.fife_geometry().sza, 0.0, 0.0)


def test_different_atmosphere_raises(whole):
    for function, name in ((fifesim.to_toa, "rho"), (fifesim.to_surface, "toa")):
        with pytest.raises(ValueError, match=r"made for another atmosphere.*surface_reflectance\(atmosphere=\.\.\.\)"):
            function(whole[name], fifesim.Atmosphere(visibility=23.0))
        xr.testing.assert_identical(function(whole[name], AIR), function(whole[name]))


def user_raster(site, wavelengths):
    values = np.random.default_rng(1).uniform(0.05, 0.4, (len(wavelengths), *site.shape))
    array = xr.DataArray(values, dims=("band", "y", "x"), coords={"wavelength": ("band", wavelengths)}, name="mine")
    return grids.place(array, site)


def test_user_raster_needs_only_wavelengths(site):
    """Without band names and instrument, bands are narrow, and the image has the nearest bands of the instrument."""
    mine = directions.with_geometry(user_raster(site, [0.665, 0.842]), fifesim.fife_geometry())
    toa = check_raster_function(fifesim.to_toa, mine, quantity="toa_reflectance")
    factors = {name: each[:, None, None] for name, each in narrow_terms(AIR).uniform.items()}
    np.testing.assert_array_equal(toa, coupling.apparent_reflectance(mine.values, **factors))
    image = fifesim.sense(toa, instrument("TM", "paper"))
    assert image["band"].values.tolist() == TM34
    assert np.isfinite(image.fifesim.ndvi()).all()
    np.testing.assert_allclose(toa.fifesim.to_surface(), mine, rtol=0, atol=1e-12)


@pytest.mark.parametrize("names", [[3, 4], ["B03", "B04"], ["red", "nir"], ["tm_3", "TM 4"]])
def test_common_band_names_are_recognised(site, names):
    """Bands get the names and wavelengths of the instrument."""
    mine = directions.with_geometry(user_raster(site, [0.66, 0.83]).drop_vars("wavelength"), fifesim.fife_geometry())
    toa = fifesim.to_toa(mine.assign_coords(band=names), AIR, instrument="Landsat 5")
    assert toa["band"].values.tolist() == TM34
    centres = [band.wavelength for band in instrument("TM").select(TM34)]
    np.testing.assert_array_equal(toa["wavelength"], centres)
    np.testing.assert_array_equal(toa, fifesim.to_toa(mine.assign_coords(band=TM34), AIR, instrument="TM"))
    image = toa.fifesim.sense()
    assert image.attrs["instrument"] == "TM" and np.isfinite(image.fifesim.ndvi()[1:-1, 1:-1]).all()


def test_assumed_atmosphere_of_a_user_raster_is_a_warning(site, lai):
    mine = directions.with_geometry(user_raster(site, [0.66, 0.83]), fifesim.fife_geometry())
    with pytest.warns(
        UserWarning, match=r"the atmosphere over mine is unknown: .*altitude=0\.4 km.*give atmosphere="
    ) as said:
        fifesim.to_toa(mine)
    assert {each.filename for each in said if each.category is UserWarning} == {__file__}
    with warnings.catch_warnings(action="error", category=UserWarning):
        rho = lai.fifesim.surface_reflectance()
        assert rho.attrs["site"] == "FIFE" and rho.attrs["instrument"] == "TM"
        rho.fifesim.to_toa()
        fifesim.to_toa(mine, AIR).fifesim.to_surface()
    theirs = lai.drop_attrs(deep=False)
    with pytest.warns(UserWarning, match="the atmosphere over") as said:
        theirs.fifesim.surface_reflectance("TM", time="1987-06-06T16:35Z")
    assert __file__ in {each.filename for each in said}
    with pytest.raises(ValueError, match=r"the instrument of .* is unknown"):
        theirs.fifesim.surface_reflectance(time="1987-06-06T16:35Z", atmosphere=AIR)
    with pytest.raises(ValueError, match="position of the sun over"):
        theirs.fifesim.surface_reflectance("TM", atmosphere=AIR)


def test_geometry_is_kept_along_the_chain(lai):
    sun = Geometry(50.0, 140.0, 8.0, 20.0, 1.01)
    image = lai.fifesim.surface_reflectance("TM", bands=TM34, geometry=sun).fifesim.to_toa().fifesim.sense("TM")
    assert directions.geometry_of(image) == sun
    assert directions.geometry_of(image.fifesim.ndvi()) == sun


def own_instrument(name, tm3):
    """The Thematic Mapper with another name, or with the response of another band in TM3."""
    tm = instrument("TM", "paper")
    bands = tuple(
        dataclasses.replace(band, srf=tm.select(tm3)[0].srf) if band.name == "TM3" else band for band in tm.bands
    )
    return dataclasses.replace(tm, name=name, bands=bands)


@pytest.mark.parametrize("mine", [own_instrument("MINE", "TM3"), own_instrument("TM", "TM1")])
def test_user_instrument_is_kept_along_the_chain(lai, mine, tmp_path):
    rho = fifesim.surface_reflectance(lai, mine, bands=TM34)
    toa = fifesim.to_toa(rho)
    np.testing.assert_array_equal(toa, fifesim.to_toa(rho, instrument=mine))
    image = toa.fifesim.sense()
    np.testing.assert_array_equal(image, toa.fifesim.sense(mine))
    again = fifesim.open_image(image.fifesim.to_geotiff(tmp_path / "mine.tif"))
    np.testing.assert_array_equal(again.fifesim.to_surface(), image.fifesim.to_surface(instrument=mine))
    as_tm = fifesim.to_surface(again.drop_vars("wavelength"), instrument="TM")
    assert np.array_equal(as_tm, again.fifesim.to_surface()) == (mine.name == "MINE"), "its TM3 is TM1"


def test_instrument_of_the_raster_is_the_default(lai):
    toa = fifesim.surface_reflectance(lai, "MSI", bands=["MSI4", "MSI8"]).fifesim.to_toa()
    assert toa.fifesim.sense().attrs["instrument"] == "MSI"
    assert toa.fifesim.sense("TM").attrs["instrument"] == "TM"
    with pytest.raises(ValueError, match=r"the instrument of .* is unknown"):
        toa.drop_attrs(deep=False).fifesim.sense()


@pytest.fixture(scope="module")
def hazy(site):
    """Images of uniform black ground and of a canopy through haze."""
    dark = directions.with_geometry(user_raster(site, [0.665, 0.842]) * 0, fifesim.fife_geometry())
    canopy = dark + xr.DataArray([0.05, 0.4], dims="band")
    return {name: fifesim.to_toa(rho, fifesim.Atmosphere(visibility=10.0)) for name, rho in
            (("dark", dark), ("canopy", canopy))}  # fmt: skip


class TestAssumedAir:
    """A hazy image corrected with a clear atmosphere, and vice versa."""

    def test_must_be_requested(self, hazy):
        clear = fifesim.Atmosphere(visibility=40.0)
        with pytest.raises(ValueError, match=r"made for another atmosphere.*to_surface\(\.\.\., assume=True\)"):
            hazy["dark"].fifesim.to_surface(clear)
        with pytest.raises(ValueError, match="assume=True needs the atmosphere to assume"):
            hazy["dark"].fifesim.to_surface(assume=True)

    def test_leaves_uncorrected_path_reflectance(self, hazy):
        """
        Over black ground, the result is the difference of the two path reflectances, divided by the clear
        transmittance.
        """
        clear = fifesim.Atmosphere(visibility=40.0)
        found = check_raster_function(
            lambda toa: toa.fifesim.to_surface(clear, assume=True), hazy["dark"], quantity="surface_reflectance"
        )
        true, assumed = (narrow_terms(air) for air in (fifesim.Atmosphere(visibility=10.0), clear))
        path = true.path_reflectance * true.gas_transmittance / assumed.gas_transmittance - assumed.path_reflectance
        left = path / (assumed.transmittance_down * assumed.transmittance_up)
        assert np.all(left > 0.005)
        expected = left / (1 + assumed.spherical_albedo * left)
        np.testing.assert_allclose(found[:, 0, 0], expected, rtol=1e-12)
        assert found.attrs["atmosphere"] == clear.text

    def test_uncorrected_haze_lowers_ndvi_and_overcorrection_raises_it(self, hazy):
        """Path reflectance is larger in the red, where a canopy is dark."""
        ndvi = {
            visibility: float(
                hazy["canopy"].fifesim.to_surface(fifesim.Atmosphere(visibility=visibility), assume=True)
                .fifesim.ndvi().mean()
            )
            for visibility in (40.0, 10.0, 7.0)
        }  # fmt: skip
        assert ndvi[10.0] == pytest.approx(0.35 / 0.45, abs=1e-12)
        assert ndvi[40.0] < ndvi[10.0] - 0.02 and ndvi[7.0] > ndvi[10.0] + 0.02

    def test_same_atmosphere_changes_nothing(self, hazy):
        same = hazy["canopy"].fifesim.to_surface(fifesim.Atmosphere(visibility=10.0), assume=True)
        xr.testing.assert_identical(same, hazy["canopy"].fifesim.to_surface())
