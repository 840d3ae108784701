"""Landscapes and canopies through the chain: classes, light budgets, and spectra with their derivatives."""

import warnings

import numpy as np
import pvlib
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, check_raster_function, in_chunks, no_compute
from oracles_canopy import fpar_of_green_leaves

import fifesim
from fifesim.atmosphere.engines import light_at_ground
from fifesim.chain.absorbed_light import PAR_BANDS
from fifesim.chain.spectra import canopy_spectra
from fifesim.grids import grid as grids
from fifesim.ground.canopy import layers, optics
from fifesim.ground.canopy.soil import brightened, soil_line

# ------------------------------------------------------------------------------------------ classes

TM34 = ["TM3", "TM4"]
GRASS = fifesim.Canopy(leaf_angles="erectophile", background={"dead_grass": 1.0}, hotspot=0.1)
WOOD = fifesim.Canopy(leaf_optics=fifesim.Leaf(chlorophyll=50), background={"TM3": 0.05, "TM4": 0.1})
BARE = fifesim.Canopy(background=0.2)
CLASSES = {
    "grass": fifesim.CoverClass(lai="burned-grazed", canopy=GRASS),
    "wood": fifesim.CoverClass(lai="unburned-ungrazed", canopy=WOOD),
    "bare": fifesim.CoverClass(lai=0.0, canopy=BARE),
}


def landscape_of(grid, grass=CLASSES["grass"], **variables):
    cover = fifesim.ground.Patches("voronoi", 30)
    return fifesim.landscape(grid, cover=cover, classes=CLASSES | {"grass": grass}, seed=7, **variables)


def seen(scene, canopy=None, **options):
    return scene.fifesim.surface_reflectance("TM", bands=TM34, canopy=canopy or fifesim.Canopy(), **options)


def check_grass(land, made, alone, others):
    """Check that the first class has the values of one raster, and the other classes have the values of another."""
    grass = (land.cover == 1).values
    np.testing.assert_array_equal(made.values[:, grass], alone.values[:, grass])
    np.testing.assert_array_equal(made.values[:, ~grass], others.values[:, ~grass])


@pytest.fixture(scope="module")
def land(site):
    return landscape_of(site)


@pytest.fixture(scope="module")
def rho(land):
    return seen(land)


def test_class_is_identical_to_a_scene_of_this_class(land, rho):
    for code, canopy in enumerate((GRASS, WOOD, BARE), 1):
        alone = seen(land.lai, canopy)
        of_class = (land.cover == code).values
        assert 400 < of_class.sum() < 1600
        np.testing.assert_array_equal(rho.values[:, of_class], alone.values[:, of_class])


@pytest.mark.parametrize("chunks", [CHUNKS, ODD_CHUNKS], ids=["chunked", "odd-chunks"])
@pytest.mark.parametrize("exact", [False, True])
def test_reflectance_is_lazy_and_identical_in_chunks(land, rho, chunks, exact):
    lazy = xr.Dataset({name: in_chunks(each, chunks) for name, each in land.data_vars.items()})
    with no_compute():
        made = seen(lazy, exact=exact)
    assert made.chunks is not None
    expected = seen(land, exact=True) if exact else rho
    xr.testing.assert_identical(made.compute(), expected)


def test_arguments_apply_to_classes_that_do_not_set_them(land, rho, lai):
    """Arguments can be rasters, here the background of the only class that sets none."""
    scene = landscape_of(grids.geobox(land.lai), fifesim.CoverClass(lai="burned-grazed"))
    litter = fifesim.Canopy(background=(0.1 + lai / 20).rename("litter").drop_attrs(deep=False))
    check_grass(land, seen(scene, litter), seen(scene.lai, litter), rho)


def test_varying_directions_are_combined_with_classes(land):
    """Where directions vary, SAIL is evaluated at every cell with the canopy of its class."""
    sza = (xr.zeros_like(land.lai) + 30 + 0.01 * np.arange(land.sizes["x"])).rename("sza").drop_attrs(deep=False)
    sun = xr.Dataset({"sza": sza, "saa": 120.0, "vza": 10.0, "vaa": 90.0, "earth_sun_distance": 1.0})
    made, alone = seen(land, geometry=sun), seen(land.lai, WOOD, geometry=sun)
    wood = (land.cover == 2).values
    np.testing.assert_array_equal(made.values[:, wood], alone.values[:, wood])


def test_cells_without_class_or_leaf_area_have_no_reflectance(land, rho):
    holes = land.copy(deep=True)
    holes.cover[3:5, 4] = -1
    holes.lai[10, 10:12] = np.nan
    made = seen(holes)
    missing = np.zeros(land.lai.shape, bool)
    missing[3:5, 4] = missing[10, 10:12] = True
    assert np.isnan(made.values[:, missing]).all()
    np.testing.assert_array_equal(made.values[:, ~missing], rho.values[:, ~missing])


def test_means_of_a_landscape_are_means_of_its_variables(land):
    brown = (land.lai / 4).clip(max=1).rename("brown")
    of_all = land.assign(brown=brown, crown_cover=0.7).fifesim.aggregate(30)
    assert set(of_all.data_vars) == {"lai", "brown", "crown_cover", "class_share"}
    xr.testing.assert_identical(of_all.lai, land.lai.fifesim.aggregate(30))
    assert of_all.crown_cover == 0.7
    dead = (land.lai * brown).fifesim.aggregate(30) / land.lai.fifesim.aggregate(30)
    np.testing.assert_allclose(of_all.brown, dead.where(of_all.lai > 0, 0), rtol=1e-14)
    assert np.abs(of_all.brown - brown.fifesim.aggregate(30)).max() > 0.01


def test_class_codes_are_counted_not_averaged(land):
    shares = land.fifesim.aggregate(30).class_share
    assert shares.dims == ("class", "y", "x") and shares["class"].values.tolist() == ["grass", "wood", "bare"]
    blocks = land.cover.values.reshape(5, 9, 6, 9).swapaxes(1, 2).reshape(5, 6, 81)
    counted = np.stack([np.mean(blocks == code, axis=-1) for code in (1, 2, 3)])
    np.testing.assert_allclose(shares, counted, rtol=0, atol=1e-12)
    holes = land.copy(deep=True)
    holes.cover[:9, :5] = -1
    assert np.isnan(holes.fifesim.aggregate(30).class_share[:, 0, 0]).all()
    lazy = xr.Dataset({name: in_chunks(each, ODD_CHUNKS) for name, each in land.data_vars.items()})
    with no_compute():
        made = lazy.fifesim.aggregate(30)
    xr.testing.assert_allclose(made.compute(), land.fifesim.aggregate(30), rtol=1e-14)


def test_fpar_depends_on_the_leaf_angles_of_the_class(land):
    fpar = land.fifesim.fpar()
    for code, angles in ((1, "erectophile"), (2, "spherical"), (3, "spherical")):
        alone = land.lai.fifesim.fpar(canopy=fifesim.Canopy(leaf_angles=angles))
        np.testing.assert_array_equal(fpar.values[land.cover == code], alone.values[land.cover == code])
    planophile = land.fifesim.fpar(canopy=fifesim.Canopy(leaf_angles="planophile"))
    grass = (land.cover == 1).values
    assert (planophile.values[grass] == fpar.values[grass]).all() and (planophile != fpar).any()
    assert fpar.name == "fpar"
    xr.testing.assert_identical(land[["lai"]].fifesim.fpar(), land.lai.fifesim.fpar())


def test_dead_leaves_and_crowns_can_be_set_by_class(site, land, rho):
    """The class is identical to a scene of this class alone, and other classes are unchanged."""
    canopy = fifesim.Canopy(
        brown=0.4, dissociation=0.5, crown_cover=0.7, crown_shape=0.5, brown_leaf={"TM3": (0.3, 0.1), "TM4": (0.4, 0.3)}
    )
    scene = landscape_of(site, fifesim.CoverClass(lai="burned-grazed", canopy=canopy))
    check_grass(land, seen(scene), seen(scene.lai, canopy), rho)
    expected = fpar_of_green_leaves(scene.lai.values, fifesim.fife_geometry().sza, 0.4, 0.5, 0.7, 0.94)
    grass = (land.cover == 1).values
    np.testing.assert_allclose(scene.fifesim.fpar(leaves="green").values[grass], expected[grass], rtol=1e-12)


def test_variables_of_a_landscape_override_its_classes(site, land):
    brown = (land.lai / 5).drop_attrs(deep=False).rename("brown")
    scene = landscape_of(site, fifesim.CoverClass(lai="burned-grazed", canopy=fifesim.Canopy(brown=0.9)), brown=brown)
    made, grass = seen(scene), (land.cover == 1).values
    alone = seen(scene.lai, fifesim.Canopy(brown=scene.brown))
    np.testing.assert_array_equal(made.values[:, grass], alone.values[:, grass])
    number = seen(fifesim.landscape(site, lai=land.lai, brown=0.3))
    xr.testing.assert_equal(number, seen(land.lai, fifesim.Canopy(brown=0.3)))


def test_landscape_of_several_dates_is_computed_by_date(land, rho):
    days = xr.Variable("time", np.array(["1987-06-06T16:35", "1987-07-06T16:35"], "M8[ns]"))
    season = land.assign(lai=xr.concat([land.lai, 1.2 * land.lai], dim=days, combine_attrs="override"))
    made = seen(season)
    assert made.dims[0] == "time" and made.sza.dims == ("time",)
    np.testing.assert_array_equal(made[1], seen(season.isel(time=1)))
    means = season.fifesim.aggregate(30)
    assert means.lai.dims == ("time", "y", "x") and means.class_share.dims == ("class", "y", "x")


@pytest.mark.parametrize("verb", ["surface_reflectance", "compare", "fpar", "light", "gpp", "evapotranspiration"])
def test_leaf_area_of_a_landscape_alone_warns_once_of_the_rest(site, verb):
    def call(scene):
        return getattr(scene.fifesim, verb)(*{"surface_reflectance": ["TM"], "compare": [["TM"]]}.get(verb, []))

    land = fifesim.landscape(site, cover="pastures", soil=0.1, brown=0.2, seed=7)
    with pytest.warns(UserWarning, match=r"landscape with brown, soil, which.*land\.fifesim\.surface") as found:
        call(land.lai)
    assert sum("landscape with" in str(each.message) for each in found) == 1
    with warnings.catch_warnings(action="error", category=UserWarning):
        call(land)
        call(land.lai.assign_attrs(landscape=""))
        # The paper's treatments differ in leaf area only.
        call(fifesim.landscape(site, cover="pastures", seed=7).lai)


# ------------------------------------------------------------------------------------------ stands

SITE = fifesim.fife_site(30, window=((0, 12), (0, 12)))
ELSEWHERE = fifesim.grid_at("EPSG:32633", 390000, 5820000, 360, 360, 30)
KNOWN = {"atmosphere": fifesim.Atmosphere(altitude=0.1), "geometry": fifesim.Geometry(40.0, 150.0)}
DRY_SOIL = {"background": {"soil_dry": 1.0}}
GREEN_LEAF = {"leaf_optics": fifesim.Leaf()}


def own_map():
    return fifesim.open_lai(fifesim.lai_scene(SITE, seed=7), SITE)


@pytest.mark.parametrize("given", [{}, DRY_SOIL, GREEN_LEAF, GREEN_LEAF | DRY_SOIL | {"brown": 0.2}])
def test_assumed_tallgrass_on_a_user_map_is_one_warning(given):
    """Of the line that called the function."""
    lai, canopy = own_map(), fifesim.Canopy(**given)
    for function in (
        lambda: lai.fifesim.surface_reflectance("TM", **KNOWN, canopy=canopy),
        lambda: fifesim.compare(lai, ["TM"], fifesim.Setup(**KNOWN, canopy=canopy)),
    ):
        with pytest.warns(UserWarning, match="the vegetation of lai is unknown: using FIFE's tallgrass for ") as said:
            function()
        assert len([each for each in said if "vegetation" in str(each.message)]) == 1
        assert {each.filename for each in said if each.category is UserWarning} == {__file__}


def test_given_canopy_is_no_warning():
    canopy = fifesim.Canopy(**GREEN_LEAF, **DRY_SOIL)
    dead = canopy.replace(brown=0.2, brown_leaf=fifesim.Leaf(chlorophyll=0, brown=1))
    with warnings.catch_warnings(action="error", category=UserWarning):
        made = [own_map().fifesim.surface_reflectance("TM", **KNOWN, canopy=each) for each in (canopy, dead)]
    assert made[0].notnull().all() and (made[0] != made[1]).any()


def test_classes_with_leaves_need_optics():
    """Water needs no leaves, and arguments of the call fill the gaps of a class."""
    water = fifesim.CoverClass(lai=0, canopy=fifesim.Canopy(background=0.03))
    forest = fifesim.CoverClass(lai=4.0, canopy=fifesim.Canopy(leaf_optics=fifesim.Leaf(chlorophyll=50)))
    patches = fifesim.ground.Patches("voronoi", 100)
    land = fifesim.landscape(ELSEWHERE, cover=patches, classes={"water": water, "forest": forest}, seed=7)
    with pytest.warns(UserWarning, match="using FIFE's tallgrass for soil and litter; give background"):
        land.fifesim.surface_reflectance("TM", **KNOWN)
    with warnings.catch_warnings(action="error", category=UserWarning):
        land.fifesim.surface_reflectance("TM", **KNOWN, canopy=fifesim.Canopy(background=0.1))


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


def test_dataset_keeps_its_dimension_and_coordinates():
    lai = xr.DataArray([0.5, 1.0], dims="site", coords={"site": ["a", "b"], "height": ("site", [0.3, 0.6])})
    found = canopy_spectra(xr.Dataset({"lai": lai}), "TM", geometry=SUN)
    assert found.reflectance.dims == ("site", "band") and found.site.values.tolist() == ["a", "b"]
    assert found.height.values.tolist() == [0.3, 0.6]
