"""Spectra of uniform canopies compared with a raster, and their derivatives compared with finite differences."""

import numpy as np
import pytest
import xarray as xr

import fifesim

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
    spectra = fifesim.ground.canopy_spectra({"lai": lai.values.ravel()}, "TM", **known)
    assert spectra.band.values.tolist() == raster.band.values.tolist()
    np.testing.assert_allclose(spectra.reflectance, raster.values.reshape(len(raster.band), -1).T, rtol=1e-13)


def test_spectra_equal_one_canopy_at_a_time():
    values = drawn(5)
    found = fifesim.ground.canopy_spectra(values, "OLI", bands=BANDS)
    names = ("brown", "dissociation", "crown_cover", "crown_shape", "hotspot", "soil", "moisture")
    for number in range(5):
        own = {name: float(each[number]) for name, each in values.items()}
        leaf = fifesim.Leaf(**{name[5:]: each for name, each in own.items() if name.startswith("leaf_")})
        canopy = fifesim.Canopy(leaf_optics=leaf, background=own["background"], **{name: own[name] for name in names})
        rest = {name: own[name] for name in ("lai", "diffuse_fraction", "sza", "vza", "raa")}
        one = fifesim.ground.canopy_spectra(rest, "OLI", bands=BANDS, canopy=canopy)
        np.testing.assert_allclose(found.reflectance[number], one.reflectance[0], rtol=1e-12)


@pytest.mark.parametrize("name", drawn(1))
def test_derivatives_agree_with_finite_differences(name):
    """Eighth-order differences, with steps that stay between the kinks of the leaf angle classes."""
    values = drawn()
    angle = name in ("sza", "vza", "raa")
    values |= {each: np.floor(values[each]) + offset for each, offset in (("sza", 0.2), ("vza", 0.3))}
    step = 1e-3 if angle else 2e-3 * np.abs(values[name]).min()

    def at(change):
        return fifesim.ground.canopy_spectra(
            values | {name: values[name] + change}, "OLI", bands=BANDS
        ).reflectance.values

    weights = {1: 672 / 840, 2: -168 / 840, 3: 32 / 840, 4: -3 / 840}
    expected = sum(weight * (at(n * step) - at(-n * step)) for n, weight in weights.items()) / step
    found = fifesim.ground.canopy_spectra(values, "OLI", bands=BANDS, derivatives=[name]).derivative.sel(quantity=name)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


def test_derivatives_at_the_ends_of_the_range_are_one_sided():
    values = {"lai": 1.0, "moisture": [0.0, 1.0], "brown": [0.0, 1.0], "diffuse_fraction": 0.2}
    names = ["moisture", "brown"]
    found = fifesim.ground.canopy_spectra(values, "TM", bands=["TM3"], geometry=SUN, derivatives=names).derivative
    for name in names:
        step = np.array([1e-6, -1e-6])
        ends = np.array(values[name])
        moved = fifesim.ground.canopy_spectra(
            values | {name: ends + step}, "TM", bands=["TM3"], geometry=SUN
        ).reflectance
        own = fifesim.ground.canopy_spectra(values, "TM", bands=["TM3"], geometry=SUN).reflectance
        np.testing.assert_allclose(found.sel(quantity=name)[:, 0], (moved - own)[:, 0] / step, rtol=1e-4)


@pytest.mark.parametrize("name", ["lai", "brown", "sza", "leaf_water", "background", "moisture"])
def test_missing_value_gives_a_missing_spectrum(name):
    values = drawn(3)
    whole = fifesim.ground.canopy_spectra(values, "OLI", bands=BANDS, derivatives=["lai"])
    values[name][1] = np.nan
    found = fifesim.ground.canopy_spectra(values, "OLI", bands=BANDS, derivatives=["lai"])
    assert np.isnan(found.reflectance[1]).all() and np.isnan(found.derivative[:, 1]).all()
    np.testing.assert_array_equal(found.reflectance[::2], whole.reflectance[::2])


def test_results_do_not_depend_on_the_number_of_canopies():
    values = drawn(5000)
    whole = fifesim.ground.canopy_spectra(values, "OLI", bands=BANDS[:2])
    part = fifesim.ground.canopy_spectra(
        {name: each[4000:4100] for name, each in values.items()}, "OLI", bands=BANDS[:2]
    )
    np.testing.assert_array_equal(whole.reflectance[4000:4100], part.reflectance)


def test_dataset_keeps_its_dimension_and_coordinates():
    lai = xr.DataArray([0.5, 1.0], dims="site", coords={"site": ["a", "b"], "height": ("site", [0.3, 0.6])})
    found = fifesim.ground.canopy_spectra(xr.Dataset({"lai": lai}), "TM", geometry=SUN)
    assert found.reflectance.dims == ("site", "band") and found.site.values.tolist() == ["a", "b"]
    assert found.height.values.tolist() == [0.3, 0.6]


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        ({"lai": 1.0}, {}, "position of the sun is unknown"),
        ({"brown": 0.1}, {"geometry": SUN}, "no leaf area index"),
        ({"lai": 1.0, "bown": 0.1}, {"geometry": SUN}, "did you mean 'brown'"),
        ({"lai": -1.0}, {"geometry": SUN}, "must not be negative"),
        ({"lai": 1.0, "sza": 90.0}, {}, r"sza must be in \[0, 90\)"),
        ({"lai": 1.0, "brown": 20.0}, {"geometry": SUN}, r"brown must be in \[0, 1\], got 20"),
        ({"lai": 1.0, "leaf_water": 12.0}, {"geometry": SUN}, "water must be in"),
        ({"lai": [1.0, 2.0], "brown": [0.1] * 3}, {"geometry": SUN}, "equal numbers of values"),
        ({"lai": 1.0, "background": [[0.1] * 5]}, {"geometry": SUN}, "background must be of shape"),
        ({"lai": 1.0, "sza": [10.0, 20.0]}, {"atmosphere": fifesim.Atmosphere()}, "diffuse fraction for one sun"),
        ({"lai": 1.0}, {"geometry": SUN, "derivatives": ["water"]}, "'water' is no quantity of canopies"),
    ],
)
def test_invalid_canopy_values_are_rejected(values, options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.ground.canopy_spectra(values, "TM", bands=["TM3"], **options)
