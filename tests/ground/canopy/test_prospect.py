"""Tests of PROSPECT-D against another implementation and against limits of Fresnel's and Stokes' equations."""

import numpy as np
import prosail
import pytest
from scipy.integrate import quad

import fifesim
from fifesim.ground.canopy import prospect

LARGEST = {
    "structure": 3.5, "chlorophyll": 100, "carotenoids": 25, "anthocyanins": 10, "brown": 1, "water": 0.05,
    "dry_matter": 0.03,
}  # fmt: skip


@pytest.mark.parametrize("seed", range(20))
def test_random_leaves_agree_with_prosail(seed):
    """Both sum the same terms in double precision without cancellation, hence 1e-12."""
    rng = np.random.default_rng(seed)
    leaf = fifesim.Leaf(**{name: rng.uniform(name == "structure", high) for name, high in LARGEST.items()})
    wavelength, *ours = prospect.leaf_spectrum(leaf)
    nanometres, *theirs = prosail.run_prospect(
        leaf.structure, leaf.chlorophyll, leaf.carotenoids, leaf.brown, leaf.water, leaf.dry_matter,
        ant=leaf.anthocyanins, prospect_version="D",
    )  # fmt: skip
    np.testing.assert_allclose(wavelength, nanometres / 1000, rtol=1e-14)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12)


@pytest.mark.parametrize("k", [1e-6, 0.01, 0.3, 2.0, 20.0])
def test_layer_transmissivity_is_the_mean_over_isotropic_paths(k):
    """Quadrature over directions: light at the zenith angle theta is attenuated by exp(-k / cos theta)."""
    expected, _ = quad(lambda mu: 2 * mu * np.exp(-k / mu), 0, 1, epsabs=1e-13, epsrel=1e-11, limit=200)
    assert prospect.layer_transmissivity(k) == pytest.approx(expected, rel=1e-8, abs=1e-14)


@pytest.mark.parametrize("structure", [1.0, 1.7, 3.2, 10.0])
def test_leaf_without_absorption_conserves_energy(structure):
    leaf = fifesim.Leaf(structure, *[0.0] * 6)
    _, reflectance, transmittance = prospect.leaf_spectrum(leaf)
    np.testing.assert_allclose(reflectance + transmittance, 1, rtol=1e-13)


@pytest.mark.parametrize("k", [1e-12, 1e-9, 1e-7, 1e-5, 1e-3])
@pytest.mark.parametrize("layers", [2, 5])
def test_pile_equals_layers_added_one_by_one(k, layers):
    """Also for nearly no absorption, where Stokes' solution becomes 0 / 0."""
    entering = float(prospect.interface_transmissivity(1.4, 90.0))
    surfaces = entering, entering / 1.4**2
    r, t = prospect.plate(*surfaces, prospect.layer_transmissivity(k))
    reflectance, transmittance = r, t
    for _ in range(layers - 1):
        multiple = 1 - reflectance * r
        reflectance, transmittance = reflectance + transmittance**2 * r / multiple, transmittance * t / multiple
    np.testing.assert_allclose(prospect.pile(r, t, layers), (reflectance, transmittance), rtol=1e-9)


def test_pile_of_infinitely_many_or_opaque_layers_transmits_nothing():
    """Another layer does not change an infinite pile, R = r + t^2 R / (1 - r R); an opaque pile is its first layer."""
    r, t = 0.3, 0.6
    reflectance, transmittance = prospect.pile(r, t, 1000.0)
    assert transmittance == pytest.approx(0, abs=1e-100)
    assert reflectance == pytest.approx(r + t**2 * reflectance / (1 - r * reflectance), rel=1e-13)
    np.testing.assert_allclose(prospect.pile(0.1, 0.0, 2.5), (0.1, 0.0), rtol=1e-14)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"structure": 0.9}, r"structure must be in \[1, 10\], got 0.9"),
        ({"chlorophyll": -1}, r"chlorophyll must be in \[0, 200\] ug cm-2, got -1"),
        (
            {"dry_matter": 90},
            r"dry_matter must be in \[0, 0.1\] g cm-2, got 90: if it is in g m-2, .*=0.009",
        ),
        ({"water": float("nan")}, r"water must be in .* got nan"),
    ],
)
def test_impossible_leaves_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.Leaf(**options)
