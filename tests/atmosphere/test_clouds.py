"""Radiative transfer in cloud layers, and positions of clouds, their images and their shadows."""

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks, no_compute
from scipy.interpolate import BSpline

import fifesim
from fifesim.atmosphere.clouds import field
from fifesim.atmosphere.clouds.field import PERIOD, CloudCover, cloud_displacement, cloud_thickness
from fifesim.atmosphere.clouds.layer import clouded_reflectance, drops_at, layer_light, two_stream_reflectance
from fifesim.grids import grid as grids

SLANT = fifesim.Geometry(50, 130, 30, 280)
DATA = Path(__file__).parents[1] / "data" / "clouds"


def table(name):
    return pd.read_csv(DATA / name, comment="#")


def test_positions_and_albedos_agree_with_the_tables():
    """Printed digits: 1e-6 m, and 1e-10 of the two-stream formula."""
    known = table("cloud_geometry.csv")
    found = cloud_displacement(*(known[name] for name in ("height", "sza", "saa", "vza", "vaa")))
    expected = known[["shadow_east", "shadow_north", "image_east", "image_north"]].to_numpy().T
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)
    known = table("cloud_two_stream.csv")
    cloud = known["optical_depth"], known["asymmetry"]
    np.testing.assert_allclose(two_stream_reflectance(*cloud), known["cloud_reflectance"], rtol=1e-10)
    np.testing.assert_allclose(two_stream_reflectance(*cloud, known["ground"]), known["over_ground"], rtol=1e-10)


def test_overcast_and_shadow_formulas():
    """By hand: a uniform overcast dims path reflectance and skylight equally; a shadow keeps part of the skylight."""
    clear, path, diffuse, reflected, through, up, albedo = 0.3, 0.06, 0.2, 0.35, 0.6, 0.7, 0.4
    found = clouded_reflectance(clear, path, diffuse, reflected, through, through, through, up, albedo)
    assert found == pytest.approx(reflected + up * through * clear / (1 - clear * albedo), rel=1e-12)
    # 90 % of the sunlight and half of the skylight are blocked; the path reflectance is unchanged.
    found = clouded_reflectance(clear, path, diffuse, 0.0, 1.0, 0.1, 0.5, 1.0, 0.0)
    assert found == pytest.approx(path + (clear - path) * (0.8 * 0.1 + 0.2 * 0.5), rel=1e-12)


def test_drops_agree_with_an_independent_mie_code():
    """1 %, between the wavelengths and angles of the table; only absorption damps the narrow resonances of drops."""
    for wavelength, known in table("cloud_drops.csv").groupby("wavelength"):
        drops = drops_at(wavelength)
        np.testing.assert_allclose(drops.phase(known["angle"]), known["phase"], rtol=0.01)
        # Two digits are kept, and 0 is used below 1e-5.
        assert drops.co_albedo == pytest.approx(known["co_albedo"].iloc[0], rel=0.05, abs=1e-5)


LAYERS = list(table("cloud_layers.csv").groupby(["thickness", "wavelength", "sza", "raa", "ground"]))


@pytest.mark.parametrize(("case", "known"), LAYERS, ids=range(len(LAYERS)))
def test_layer_agrees_with_discrete_ordinates(case, known):
    """
    3 % up to thickness 2 and 2 % above, for all views up to 70 degrees; transmittance to 0.005 if it is shared.

    Over Lambertian ground, 0.5 % for views up to 53 degrees; the sun of the FIFE image has its rainbow near nadir.
    """
    thickness, wavelength, sza, raa, ground = case
    for row in known.query("mu_v > 0.342").itertuples():
        light = layer_light(np.array([thickness]), drops_at(wavelength), sza, np.degrees(np.arccos(row.mu_v)), raa)
        reflected, down, up, albedo, sky = (each.item() for each in light)
        if ground == 0:
            assert reflected == pytest.approx(row.reflectance, rel=0.03 if thickness <= 2 else 0.02)
            assert down == pytest.approx(row.transmittance, abs=5e-3 if wavelength < 0.75 else 1e-3)
        elif row.mu_v > 0.6:
            found = clouded_reflectance(ground, 0.0, 0.0, reflected, down, down, sky, up, albedo)
            assert found == pytest.approx(row.reflectance, rel=5e-3)


def test_white_ground_and_conservative_clouds_return_all_light():
    """The albedo and the transmittance of isotropic light are computed independently."""
    thickness = np.array([0.3, 3.0, 30.0, 60.0, 100.0])
    for sza in (0.0, 70.0):
        light = layer_light(thickness, drops_at(0.66), sza, 0.0, 0.0)
        sent = light.transmittance_down * light.diffuse_transmittance / (1 - light.spherical_albedo)
        np.testing.assert_allclose(1 - light.transmittance_down + sent, 1, atol=1e-6)


@pytest.fixture(scope="module")
def site():
    return fifesim.fife_site(30, window=((0, 60), (0, 60)))


@pytest.fixture(scope="module")
def reflectance(site):
    lai = fifesim.lai_scene(site, seed=7)
    return lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])


def clouds_of(thickness, grid, height=1500.0):
    cells = grids.place(xr.DataArray(np.asarray(thickness, float), dims=("y", "x")), grid)
    return xr.Dataset({"optical_thickness": cells, "base": height, "top": height})


@pytest.fixture(scope="module")
def level(reflectance):
    """Reflectance without directions."""
    return reflectance.drop_vars(["sza", "saa", "vza", "vaa"])


@pytest.mark.filterwarnings("ignore:the clouds end")
def test_clouds_brighten_and_shadows_darken_only_their_cells(site, reflectance, level):
    """A cloud of n cells has a shadow of n cells on level ground; unknown clouds and their shadows are missing."""
    thickness = np.zeros(site.shape)
    clear = level.fifesim.to_toa(geometry=SLANT)
    none = level.fifesim.to_toa(clouds=clouds_of(thickness, site), geometry=SLANT)
    np.testing.assert_array_equal(none.values, clear.values)
    thickness[20:25, 30:37] = 20.0
    cells = level.fifesim.cast_clouds(clouds_of(thickness, site, 500.0), geometry=SLANT)
    assert int(cells.cloud.sum()) == int(cells.shadow.sum()) == 35
    both = level.fifesim.to_toa(clouds=cells, geometry=SLANT)
    seen, shaded = cells.cloud > 0, (cells.shadow > 0) & (cells.cloud == 0)
    assert bool((both > clear).where(seen, True).all()) and bool((both < clear).where(shaded, True).all())
    untouched = ~seen & ~shaded & (cells.overhead_thickness == 0)
    np.testing.assert_array_equal(both.where(untouched).values, clear.where(untouched).values)
    thickness[30, 20] = np.nan
    assert np.isnan(reflectance.fifesim.to_toa(clouds=clouds_of(thickness, site, 50.0)).values).sum() == 4


@pytest.mark.filterwarnings("ignore:the clouds end")
def test_clouds_of_two_heights_equal_the_sum_of_both(site, level):
    rng = np.random.default_rng(4)
    thickness = np.where(rng.random(site.shape) < 0.2, 5.0, 0.0)
    high = rng.random(site.shape) < 0.5
    options = {"geometry": SLANT}
    both = clouds_of(thickness, site)
    for name, rise in (("base", 0.0), ("top", 200.0)):
        both[name] = both.optical_thickness.copy(data=np.where(high, 1500.0, 600.0) + rise).drop_attrs()
    found = level.fifesim.cast_clouds(both, **options)
    lower, upper = (
        level.fifesim.cast_clouds(clouds_of(np.where(part, thickness, 0), site, height), **options)
        for part, height in ((~high, 700.0), (high, 1600.0))
    )
    for name in ("optical_thickness", "shadow_thickness", "overhead_thickness"):
        # 900 m are divided into layers of 30 m / tan(50) = 25 m, so the upper height is accurate to half a layer.
        assert (found[name] == lower[name] + upper[name]).mean() > (0.99 if name == "overhead_thickness" else 0.6)
        assert float(found[name].sum()) == pytest.approx(float((lower[name] + upper[name]).sum()), rel=0.05)
    unknown = both.assign(top=both.top.where(both.optical_thickness == 0))
    cells = level.fifesim.cast_clouds(unknown, **options)
    assert int(cells.overhead_thickness.isnull().sum()) == int((thickness > 0).sum())
    with pytest.raises(ValueError, match="base of clouds must not be above their top, but is by up to 200 m"):
        level.fifesim.cast_clouds(both.rename(base="top", top="base"), **options)


@pytest.mark.filterwarnings("ignore:the clouds end")
@pytest.mark.parametrize("name", ["shadow_thickness", "optical_thickness"])
def test_shadow_and_image_on_relief_agree_with_ray_marching(site, level, name):
    """Brute force: from each cell toward sun or sensor in steps of 1 m up to the cloud height."""
    thickness = np.where(np.random.default_rng(3).random(site.shape) < 0.2, 5.0, 0.0)
    y, x = np.mgrid[:60, :60]
    dem = grids.place(xr.DataArray(500 + 300 * np.sin(x / 9) * np.cos(y / 7), dims=("y", "x")), site)
    clouds = clouds_of(thickness, site, 1000.0)
    found = level.fifesim.cast_clouds(clouds, dem=dem, geometry=SLANT)[name].values
    zenith, azimuth = (SLANT.sza, SLANT.saa) if name == "shadow_thickness" else (SLANT.vza, SLANT.vaa)
    turned = np.radians(azimuth - grids.projection.convergence(site))
    step = np.arange(0.0, 2000.0, 1.0)
    expected, nearby = np.zeros(site.shape), np.zeros(site.shape, bool)
    for i, j in np.ndindex(*site.shape):
        rise = 400 + 1000 - dem.values[i, j]  # from the ground to the clouds, above 0.4 km
        along = step[np.argmax(step / np.tan(np.radians(zenith)) >= rise)]
        row, column = i - along * np.cos(turned) / 30, j + along * np.sin(turned) / 30
        at = int(np.rint(row)), int(np.rint(column))
        inside = 0 <= at[0] < 60 and 0 <= at[1] < 60
        expected[i, j] = thickness[at] if inside else 0.0
        # Within 2 m of a cell edge, the steps are too coarse.
        nearby[i, j] = max(abs(row - at[0]), abs(column - at[1])) > 0.5 - 2 / 30
    np.testing.assert_array_equal(found[~nearby], expected[~nearby])
    assert (~nearby).mean() > 0.6


@pytest.mark.parametrize("relief", [False, True])
def test_warning_of_a_small_field_names_the_margin_that_suffices(site, level, relief):
    """Relief at 0 m lies 0.4 km below the altitude of the atmosphere, which lengthens the shadows."""
    dem = (0 * level[0].drop_vars(["band", "wavelength"])).rename("elevation").assign_attrs(units="m")
    options = {"dem": dem if relief else None, "geometry": fifesim.Geometry(50, 150, 20, 280)}
    turned = np.radians(150 - grids.projection.convergence(site))
    needed = 30 * round(-(1400 if relief else 1000) * np.tan(np.radians(50)) * np.cos(turned) / 30)
    sky = {"height": 1000, "length": 800, "seed": 3}
    with pytest.warns(UserWarning, match=f"end {needed - 300} m too early.*margin={needed}"):
        level.fifesim.cast_clouds(fifesim.cloud_field(site, **sky, margin=300), **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        level.fifesim.cast_clouds(fifesim.cloud_field(site, **sky, margin=needed), **options)


def test_cover_is_exact_over_100_km_and_thickness_is_lognormal():
    """Cover to 0.5 percentage points; mean and standard deviation to 5 %, since the outermost 0.1 % are cut."""
    place = np.arange(0, PERIOD, PERIOD // 1000) + 77_777_777
    for cover, length in ((0.1, 500.0), (0.4, 2000.0), (0.85, 15_000.0)):
        thickness = cloud_thickness(CloudCover(cover, (8.0, 6.0), length, 5), place, place)
        assert abs((thickness > 0).mean() - cover) < 0.005
        inside = thickness[thickness > 0]
        assert abs(inside.mean() / 8 - 1) < 0.05 and abs(inside.std() / 6 - 1) < 0.05
        logarithm = np.log(inside)
        assert abs(((logarithm - logarithm.mean()) ** 3).mean() / logarithm.std() ** 3) < 0.05
    # The smallest covers have at most one cloud.
    place = np.arange(0, PERIOD, PERIOD // 400)
    assert 0 <= (cloud_thickness(CloudCover(1e-7, (8.0, 6.0), 2000.0, 5), place, place) > 0).mean() < 1e-4


def test_correlation_is_5_percent_at_the_correlation_length():
    """The sign of a normal field has the correlation 2 / pi arcsin(0.05); 0.03 is the sampling error."""
    place = np.arange(0, PERIOD, PERIOD // 1000)
    sign = np.sign(cloud_thickness(CloudCover(0.5, (8.0, 6.0), 2000.0, 5), place, place) - 1e-9)
    found = np.mean(sign * np.roll(sign, 20, axis=0)), np.mean(sign * np.roll(sign, 20, axis=1))
    np.testing.assert_allclose(found, 2 / np.pi * np.arcsin(0.05), atol=0.03)


def test_weights_of_lattice_nodes_are_cubic_b_splines():
    """The basis function of scipy, scaled so that the squares sum to one."""
    place = np.arange(0, PERIOD, PERIOD // 64)
    node, weights = field._spline(place, 4)
    basis = BSpline.basis_element(np.arange(-2.0, 3.0), extrapolate=False)
    expected = np.nan_to_num(basis(place * 4 / PERIOD + 1 - node - np.arange(4)[:, None]))
    np.testing.assert_allclose(weights, expected / np.sqrt((expected**2).sum(axis=0)), rtol=0, atol=1e-12)


def test_clouds_do_not_depend_on_window_chunks_or_cell_size_and_drift(site):
    sky = {"cover": 0.5, "seed": 11, "length": 800.0}
    whole = fifesim.cloud_field(site, **sky).optical_thickness
    window = fifesim.cloud_field(fifesim.fife_site(30, window=((13, 40), (7, 50))), **sky).optical_thickness
    np.testing.assert_array_equal(window.values, whole.values[13:40, 7:50])
    with no_compute():
        lazy = fifesim.cloud_field(site, **sky, chunks={"y": 17, "x": 23})
    np.testing.assert_array_equal(lazy.optical_thickness.values, whole.values)
    # The middle of 3 x 3 small cells has the centre of the large cell.
    fine = fifesim.cloud_field(fifesim.fife_site(10, window=((0, 180), (0, 180))), **sky).optical_thickness
    np.testing.assert_array_equal(fine.values[1::3, 1::3], whole.values)
    # 6 m/s eastward and 3 m/s southward for 100 s are 20 and 10 cells.
    later = fifesim.cloud_field(site, **sky, drift=(6.0, -3.0), time=100.0).optical_thickness
    np.testing.assert_array_equal(later.values[10:, 20:], whole.values[:-10, :-20])
    several = fifesim.cloud_field(site, **sky, drift=(6.0, -3.0), time=[0.0, 100.0]).optical_thickness
    np.testing.assert_array_equal(several.sel(time=100.0).values, later.values)


def test_lazy_scene_is_bitwise_equal_to_the_scene_in_memory(site, reflectance):
    sky = fifesim.cloud_field(site, 0.5, seed=11, length=800.0, margin=1200)
    whole = reflectance.fifesim.to_toa(clouds=sky)
    with no_compute():
        lazy = in_chunks(reflectance, ODD_CHUNKS).fifesim.to_toa(clouds=sky.chunk({"y": 31, "x": 19}))
    xr.testing.assert_identical(lazy.compute(), whole)
    cells = reflectance.fifesim.cast_clouds(sky)
    xr.testing.assert_identical(reflectance.fifesim.to_toa(clouds=cells), whole)
    before = sky.copy(deep=True)
    cells["overhead_thickness"] += 1
    xr.testing.assert_identical(sky, before)


def test_each_date_has_a_separate_sun_and_cloud_field(site):
    dates = pd.to_datetime(["1987-05-01T16:35", "1987-06-06T16:35"])
    lai = fifesim.lai_scene(site, seed=7) * xr.DataArray([1.0, 1.0], coords={"time": dates}, dims="time")
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    sky = fifesim.cloud_field(site, 0.4, seed=3, time=list(dates), margin=1500)
    assert not np.array_equal(*(sky.optical_thickness.values > 0))
    both = rho.fifesim.to_toa(clouds=sky)
    last = rho.isel(time=1).fifesim.to_toa(clouds=sky.isel(time=1))
    np.testing.assert_array_equal(both.isel(time=1).values, last.values)
