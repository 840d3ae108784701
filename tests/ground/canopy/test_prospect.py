"""PROSPECT-D against another implementation, Fresnel's and Stokes' limits, and what leaves look like."""

import numpy as np
import prosail
import pytest
from prosail.prospect_d import calctav
from scipy.integrate import quad

import fifesim
from fifesim.ground.canopy import prospect

LARGEST = {
    "structure": 3.5, "chlorophyll": 100, "carotenoids": 25, "anthocyanins": 10, "brown": 1, "water": 0.05,
    "dry_matter": 0.03,
}  # fmt: skip


@pytest.mark.parametrize("seed", range(20))
def test_drawn_leaves_agree_with_another_implementation(seed):
    """Both sum the same terms in double precision, and 1 - R - T loses no digits: 1e-12."""
    rng = np.random.default_rng(seed)
    leaf = fifesim.Leaf(**{name: rng.uniform(name == "structure", high) for name, high in LARGEST.items()})
    wavelength, *ours = prospect.leaf_spectrum(leaf)
    nanometres, *theirs = prosail.run_prospect(
        leaf.structure, leaf.chlorophyll, leaf.carotenoids, leaf.brown, leaf.water, leaf.dry_matter,
        ant=leaf.anthocyanins, prospect_version="D",
    )  # fmt: skip
    np.testing.assert_allclose(wavelength, nanometres / 1000, rtol=1e-14)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12)


@pytest.mark.parametrize("angle", [10.0, 40.0, 59.0, 90.0])
def test_interface_has_the_closed_form_of_stern_and_allen(angle):
    index = np.linspace(1.2, 1.6, 9)
    ours = prospect.interface_transmissivity(index, angle)
    np.testing.assert_allclose(ours, calctav(angle, index), rtol=1e-11)


@pytest.mark.parametrize("k", [1e-6, 0.01, 0.3, 2.0, 20.0])
def test_layer_is_the_mean_of_slanting_paths(k):
    """Isotropic light under the angle theta passes exp(-k / cos theta)."""
    expected, _ = quad(lambda mu: 2 * mu * np.exp(-k / mu), 0, 1, epsabs=1e-13, epsrel=1e-11, limit=200)
    assert prospect.layer_transmissivity(k) == pytest.approx(expected, rel=1e-8, abs=1e-14)


@pytest.mark.parametrize("structure", [1.0, 1.7, 3.2, 10.0])
def test_nothing_is_lost_without_absorption(structure):
    leaf = fifesim.Leaf(structure, *[0.0] * 6)
    _, reflectance, transmittance = prospect.leaf_spectrum(leaf)
    np.testing.assert_allclose(reflectance + transmittance, 1, rtol=1e-13)


@pytest.mark.parametrize("k", [1e-12, 1e-9, 1e-7, 1e-5, 1e-3])
@pytest.mark.parametrize("layers", [2, 5])
def test_pile_is_its_layers_added_one_by_one(k, layers):
    """Also where absorption all but vanishes and Stokes' solution becomes 0 / 0: the layers lose at least k."""
    entering = float(prospect.interface_transmissivity(1.4, 90.0))
    surfaces = entering, entering / 1.4**2
    r, t = prospect.plate(*surfaces, prospect.layer_transmissivity(k))
    reflectance, transmittance = r, t
    for _ in range(layers - 1):
        multiple = 1 - reflectance * r
        reflectance, transmittance = reflectance + transmittance**2 * r / multiple, transmittance * t / multiple
    np.testing.assert_allclose(prospect.pile(r, t, layers), (reflectance, transmittance), rtol=1e-9)


def test_a_pile_without_end_lets_nothing_through_and_reflects_what_one_more_layer_leaves():
    """R of an infinite pile does not change under another layer: R = r + t^2 R / (1 - r R)."""
    r, t = 0.3, 0.6
    reflectance, transmittance = prospect.pile(r, t, 1000.0)
    assert transmittance == pytest.approx(0, abs=1e-100)
    assert reflectance == pytest.approx(r + t**2 * reflectance / (1 - r * reflectance), rel=1e-13)


def test_opaque_layer_reflects_and_lets_nothing_through():
    np.testing.assert_allclose(prospect.pile(0.1, 0.0, 2.5), (0.1, 0.0), rtol=1e-14)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"structure": 0.9}, r"structure must be in \[1, 10\], got 0.9"),
        ({"chlorophyll": -1}, r"chlorophyll must be in \[0, 200\] ug cm-2, got -1"),
        ({"dry_matter": 90}, r"dry_matter must be in \[0, 0.1\] g cm-2, got 90: check its unit"),
        ({"water": float("nan")}, r"water must be in .* got nan"),
    ],
)
def test_impossible_leaf_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.Leaf(**options)
