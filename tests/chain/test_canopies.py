"""Light budget of canopies, and spectra of uniform canopies with their derivatives."""

import numpy as np
import pvlib
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim
from fifesim.atmosphere.engines import light_at_ground
from fifesim.chain.absorbed_light import PAR_BANDS
from fifesim.chain.spectra import canopy_spectra
from fifesim.ground.canopy import layers, optics
from fifesim.ground.canopy.soil import brightened, soil_line

# ------------------------------------------------------------------------------------------ light budget

SZA = float(fifesim.fife_geometry().sza)
MIXED = fifesim.Canopy(brown=0.3, dissociation=0.4, crown_cover=0.8, leaf_angles="erectophile")


def by_cell(lai, brown=0.0, soil=0.0, crown_cover=1.0, dissociation=0.0, leaf_angles="spherical", leaf=None):
    """Light budget of each cell in each band, shape (4, band, n), and the share of each band."""
    shares, sky = light_at_ground(fifesim.Atmosphere(), PAR_BANDS, SZA)
    green, dead = (optics.band_leaf_optics(PAR_BANDS, each) for each in (leaf, optics.DEAD_LEAF))
    ground = brightened(optics.band_background(PAR_BANDS), np.broadcast_to(soil, lai.shape), soil_line(PAR_BANDS))
    columns = [each[:, None] for each in (*green, *dead)]
    budget = layers.light_budget(
        lai, *columns, ground.T, brown=brown, dissociation=dissociation, sza=SZA, leaf_angles=leaf_angles,
        diffuse_fraction=sky[:, None], crown_cover=crown_cover,
    )  # fmt: skip
    return np.stack(np.broadcast_arrays(*budget)), shares


def varied(lai):
    random = np.random.default_rng(5)
    fields = {"brown": (0, 0.6), "soil": (-0.05, 0.05)}
    return lai.to_dataset(name="lai").assign(
        {name: lai.copy(data=random.uniform(*ends, lai.shape)).drop_attrs() for name, ends in fields.items()}
    )


@pytest.mark.parametrize("leaf_angles", ["planophile", "uniform", "30: 0.5, 75: 0.5"])
def test_black_leaves_absorb_as_in_equation_6(leaf_angles):
    lai = np.array([0, 0.25, 1, 3, 8])
    budget = layers.light_budget(lai, 0, 0, 0, 0, 0, brown=0, sza=SZA, leaf_angles=leaf_angles)
    expected = layers.beer_fpar(lai, layers.extinction_coefficient(SZA, leaf_angles), fpar_inf=1)
    np.testing.assert_allclose(budget.green, expected, rtol=0, atol=1e-9)


def test_photon_shares_agree_with_the_standard_spectrum():
    # ASTM G173 is for an air mass of 1.5, a tilted plane and less aerosol. Weights by energy instead of photons would
    # differ by 25 %.
    spectrum = pvlib.spectrum.get_reference_spectra(standard="ASTM G173-03")["global"]
    photons = spectrum * spectrum.index
    expected = np.array([photons.loc[1000 * band.limits[0] : 1000 * band.limits[1]].mean() for band in PAR_BANDS])
    shares, _ = light_at_ground(fifesim.Atmosphere(), PAR_BANDS, 48.2)
    np.testing.assert_allclose(shares, expected / expected.sum(), rtol=0.1)


def test_light_sums_to_one_and_agrees_with_the_model(lai):
    parts = lai.fifesim.light(canopy=MIXED)
    assert list(parts) == ["green", "dead", "ground", "reflected"]
    np.testing.assert_allclose(sum(parts.values()), 1, rtol=0, atol=1e-9)
    by_band, shares = by_cell(lai.values.ravel(), 0.3, 0.0, 0.8, 0.4, "erectophile")
    np.testing.assert_allclose(by_band.sum(axis=0), 1, rtol=0, atol=1e-12)
    expected = np.einsum("pbn,b->pn", by_band, shares)
    np.testing.assert_allclose(parts.to_array().values.reshape(4, -1), expected, rtol=0, atol=1e-6)
    absorbed = lai.fifesim.fpar(method="energy", canopy=MIXED)
    np.testing.assert_allclose(absorbed, parts.green + parts.dead, rtol=0, atol=1e-9)
    green = lai.fifesim.fpar(method="energy", canopy=MIXED, leaves="green")
    np.testing.assert_allclose(green, parts.green, rtol=0, atol=1e-12)


@pytest.mark.parametrize("leaves", ["all", "green"])
@pytest.mark.parametrize("even", [None, "brown", "soil"])
def test_fpar_of_varying_leaves_and_soil_agrees_with_the_model(lai, leaves, even):
    land = varied(lai)
    if even is not None:
        land[even] = 0.2 if even == "brown" else 0.02
    land["lai"][0, 0] = np.nan
    made = land.fifesim.fpar(method="energy", leaves=leaves).values.ravel()
    parts = land.fifesim.light().to_array().values.reshape(4, -1)
    fields = xr.broadcast(*(land[name] for name in ("lai", "brown", "soil")))
    by_band, shares = by_cell(*(each.values.ravel() for each in fields))
    expected = np.einsum("pbn,b->pn", by_band, shares)
    np.testing.assert_allclose(parts, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(made, expected[0] + expected[1] * (leaves == "all"), rtol=0, atol=1e-6)


def test_classes_absorb_according_to_their_leaves(site):
    pale = fifesim.Canopy(leaf_optics=fifesim.Leaf(chlorophyll=10))
    classes = {"green": fifesim.CoverClass(lai=2.0), "pale": fifesim.CoverClass(lai=2.0, canopy=pale)}
    land = fifesim.landscape(site, cover=fifesim.ground.Patches("voronoi", 30), classes=classes, seed=7)
    made = land.fifesim.fpar(method="energy")
    for code, leaf in ((1, None), (2, pale.leaf_optics)):
        by_band, shares = by_cell(np.array([2.0]), leaf=leaf)
        np.testing.assert_allclose(made.values[land.cover == code], shares @ by_band[0, :, 0], atol=1e-6)


def test_energy_is_lazy_by_date_and_labelled(lai):
    check_raster_function(lambda each: each.fifesim.fpar(method="energy"), lai, quantity="fpar")
    check_raster_function(lambda each: each.fifesim.light().dead.rename("dead_fpar"), lai, quantity="dead_fpar")
    times = np.array(["2022-06-03T17:10", "2022-07-03T17:10"], "M8[ns]")
    dates = xr.concat([lai, 2 * lai], dim="time").assign_coords(time=times)
    made, first = dates.fifesim.light(), lai.fifesim.light(time="2022-06-03T17:10Z")
    np.testing.assert_array_equal(made.green.isel(time=0), first.green)
    assert "energy balance" in first.green.attrs["history"]


def test_absorption_increases_with_lai_and_diffuse_light_as_published():
    """
    Diffuse light enters at more oblique angles, so that more of it is absorbed than of direct light from a high sun.
    """
    given = {"brown": 0, "sza": 28.5}
    lai = np.array([0.25, 0.5, 1, 2, 3])
    budget = layers.light_budget(lai, 0.09, 0.06, 0.09, 0.06, 0.13, diffuse_fraction=0.2, **given)
    np.testing.assert_allclose(budget.green, [0.15, 0.28, 0.47, 0.70, 0.82], atol=0.005)
    overcast, clear = (
        layers.light_budget(lai, 0.09, 0.06, 0.09, 0.06, 0.13, diffuse_fraction=sky, **given).green for sky in (1, 0)
    )
    assert (overcast > clear).all()


# ------------------------------------------------------------------------------------------ spectra

SUN = fifesim.Geometry(30, 120, 20, 60)
BANDS = ["OLI3", "OLI4", "OLI5", "OLI6"]


def drawn(count=12, seed=3):
    """Random values of every quantity, inside the valid ranges."""
    ranges = {
        "lai": (0.1, 6),
        "brown": (0.05, 0.9),
        "dissociation": (0.05, 0.95),
        "crown_cover": (0.4, 0.95),
        "crown_shape": (0.5, 2),
        "hotspot": (0.01, 0.3),
        "soil": (-0.05, 0.05),
        "moisture": (0.01, 0.99),
        "background": (0.1, 0.3),
        "diffuse_fraction": (0.05, 0.9),
        "sza": (10, 60),
        "vza": (5, 50),
        "raa": (10, 350),
        "leaf_structure": (1.2, 2.5),
        "leaf_chlorophyll": (10, 80),
        "leaf_carotenoids": (1, 20),
        "leaf_anthocyanins": (1, 5),
        "leaf_brown": (0.1, 1),
        "leaf_water": (0.005, 0.03),
        "leaf_dry_matter": (0.002, 0.02),
    }
    random = np.random.default_rng(seed)
    return {name: random.uniform(*each, count) for name, each in ranges.items()}


def test_spectra_equal_a_raster_of_the_same_canopies():
    lai = fifesim.lai_scene(fifesim.fife_site(30, window=((0, 8), (0, 8))), seed=1)
    canopy = fifesim.Canopy(brown=0.2, dissociation=0.3, hotspot=0.1, soil=0.02, moisture=0.2, crown_cover=0.8)
    known = {"canopy": canopy, "geometry": fifesim.fife_geometry(), "atmosphere": fifesim.Atmosphere()}
    raster = lai.fifesim.surface_reflectance("TM", exact=True, **known)
    spectra = canopy_spectra({"lai": lai.values.ravel()}, "TM", **known)
    assert spectra.band.values.tolist() == raster.band.values.tolist()
    np.testing.assert_allclose(spectra.reflectance, raster.values.reshape(len(raster.band), -1).T, rtol=1e-13)


def test_spectra_equal_one_canopy_at_a_time():
    values = drawn(5)
    found = canopy_spectra(values, "OLI", bands=BANDS)
    names = ("brown", "dissociation", "crown_cover", "crown_shape", "hotspot", "soil", "moisture")
    for number in range(5):
        own = {name: float(each[number]) for name, each in values.items()}
        leaf = fifesim.Leaf(**{name[5:]: each for name, each in own.items() if name.startswith("leaf_")})
        canopy = fifesim.Canopy(leaf_optics=leaf, background=own["background"], **{name: own[name] for name in names})
        rest = {name: own[name] for name in ("lai", "diffuse_fraction", "sza", "vza", "raa")}
        one = canopy_spectra(rest, "OLI", bands=BANDS, canopy=canopy)
        np.testing.assert_allclose(found.reflectance[number], one.reflectance[0], rtol=1e-12)


@pytest.mark.parametrize("name", drawn(1))
def test_derivatives_agree_with_finite_differences(name):
    """Eighth-order differences, with steps that stay between the kinks of the leaf angle classes."""
    values = drawn()
    angle = name in ("sza", "vza", "raa")
    values |= {each: np.floor(values[each]) + offset for each, offset in (("sza", 0.2), ("vza", 0.3))}
    step = 1e-3 if angle else 2e-3 * np.abs(values[name]).min()

    def at(change):
        return canopy_spectra(values | {name: values[name] + change}, "OLI", bands=BANDS).reflectance.values

    weights = {1: 672 / 840, 2: -168 / 840, 3: 32 / 840, 4: -3 / 840}
    expected = sum(weight * (at(n * step) - at(-n * step)) for n, weight in weights.items()) / step
    found = canopy_spectra(values, "OLI", bands=BANDS, derivatives=[name]).derivative.sel(quantity=name)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


def test_derivatives_at_the_ends_of_the_range_are_one_sided():
    values = {"lai": 1.0, "moisture": [0.0, 1.0], "brown": [0.0, 1.0], "diffuse_fraction": 0.2}
    options, step = {"instrument": "TM", "bands": ["TM3"], "geometry": SUN}, np.array([1e-6, -1e-6])
    found = canopy_spectra(values, derivatives=["moisture", "brown"], **options)
    for name, derivative in zip(("moisture", "brown"), found.derivative.transpose("quantity", ...), strict=True):
        moved = canopy_spectra(values | {name: values[name] + step}, **options).reflectance
        expected = (moved - found.reflectance)[:, 0] / step
        np.testing.assert_allclose(derivative[:, 0], expected, rtol=1e-4)


@pytest.mark.parametrize("name", ["lai", "brown", "sza", "leaf_water", "background", "moisture"])
def test_missing_value_gives_a_missing_spectrum(name):
    values = drawn(3)
    whole = canopy_spectra(values, "OLI", bands=BANDS, derivatives=["lai"])
    values[name][1] = np.nan
    found = canopy_spectra(values, "OLI", bands=BANDS, derivatives=["lai"])
    assert np.isnan(found.reflectance[1]).all() and np.isnan(found.derivative[:, 1]).all()
    np.testing.assert_array_equal(found.reflectance[::2], whole.reflectance[::2])


def test_results_do_not_depend_on_the_number_of_canopies():
    values = drawn(5000)
    whole = canopy_spectra(values, "OLI", bands=BANDS[:2])
    part = canopy_spectra({name: each[4000:4100] for name, each in values.items()}, "OLI", bands=BANDS[:2])
    np.testing.assert_array_equal(whole.reflectance[4000:4100], part.reflectance)


def test_dataset_keeps_its_dimension_and_coordinates():
    lai = xr.DataArray([0.5, 1.0], dims="site", coords={"site": ["a", "b"], "height": ("site", [0.3, 0.6])})
    found = canopy_spectra(xr.Dataset({"lai": lai}), "TM", geometry=SUN)
    assert found.reflectance.dims == ("site", "band") and found.site.values.tolist() == ["a", "b"]
    assert found.height.values.tolist() == [0.3, 0.6]
