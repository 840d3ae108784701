"""Optimal estimation of leaves and canopies computed with prosail."""

from pathlib import Path

import numpy as np
import pandas as pd
import prosail
import pytest
from prosail.FourSAIL import campbell

from fifesim.ground.canopy import sail_model
from fifesim.ground.canopy.leaf_angles import LeafAngles
from fifesim.ground.canopy.prospect import leaf_band_means
from fifesim.ground.canopy.sail_model import sail, with_background
from fifesim.retrieval.inversion import optimal_estimation

TABLE = pd.read_csv(Path(__file__).parents[1] / "data" / "prosail_inversion.csv", comment="#")
CASES = [rows for _, rows in TABLE.groupby("case")]
NANOMETRES = CASES[0].wavelength_nm.to_numpy()
STEP = 1e-30
SOILS = prosail.spectral_library.get_spectra().soil
# The 18 classes of prosail, whose fractions differ from exact ones by up to 0.001.
ANGLES = LeafAngles((np.arange(18) + 0.5) * 5, campbell(57.3, 18))


def slope_of(function, states):
    """Values, shape (n, m), and their complex-step derivatives, shape (n, m, k)."""
    steps = np.eye(states.shape[1]) * 1j * STEP
    return function(states), np.stack([function(states + step).imag / STEP for step in steps], axis=-1)


def gap_in_twenty_steps(lai, ks, ko, alpha):
    """Gap fraction of both beams and the leaf area visible in both, by the quadrature of prosail (Verhoef 1998)."""
    share = np.arange(20)[:, None] / 20
    depth = np.vstack([-np.log1p(share * np.expm1(-alpha)) / alpha, [[1.0]]])
    exponent = -(ks + ko) * lai * depth - np.sqrt(ks * ko) * lai * np.expm1(-alpha * depth) / alpha
    gap = np.exp(exponent)
    gaps, depths, exponents = (np.diff(each, axis=0) for each in (gap, depth, exponent))
    return gap[-1], lai * (gaps * depths / exponents).sum(axis=0)


def canopy(rows, lai):
    """Reflectance of canopies with the leaves, soil and directions of a case, shape (n, m)."""
    own = rows.iloc[0]
    dry, wet = SOILS.rsoil1[NANOMETRES - 400], SOILS.rsoil2[NANOMETRES - 400]
    ground = own.soil_brightness * (own.soil_moisture * dry + (1 - own.soil_moisture) * wet)
    leaf = rows.leaf_reflectance.to_numpy()[:, None], rows.leaf_transmittance.to_numpy()[:, None]
    directions = {"sza": own.sza, "vza": own.vza, "raa": own.raa}
    found = sail(lai[:, 0], *leaf, **directions, leaf_angles=ANGLES, hotspot=own.hotspot)
    return with_background(found, ground[:, None]).rso.T


def test_lai_is_retrieved_with_known_leaves_and_soil(monkeypatch):
    """Uses the approximate hot spot of prosail; otherwise reflectance differs by 3e-4 and LAI by up to 0.011."""
    monkeypatch.setattr(sail_model, "bidirectional_gap", gap_in_twenty_steps)
    for rows in [each for each in CASES if each.lai.iloc[0] <= 4]:
        found = optimal_estimation(
            rows.canopy_reflectance.to_numpy()[None],
            lambda states, pixels, rows=rows: slope_of(lambda lai: canopy(rows, lai), states),
            np.array([2.0]), np.array([[4.0]]), 1e-12 * np.eye(len(NANOMETRES)),
            limits=(np.array([0.0]), np.array([10.0])),
        )  # fmt: skip
        assert found.converged[0]
        assert found.state[0, 0] == pytest.approx(rows.lai.iloc[0], abs=1e-3)


CONTENTS = ["structure", "chlorophyll", "carotenoids", "brown", "water", "dry_matter"]
TYPICAL = np.array([1.5, 40.0, 8.0, 0.1, 0.012, 0.006])


def leaves(states):
    """Leaf reflectance and transmittance from contents relative to typical ones, shape (n, 18)."""
    structure, chlorophyll, carotenoids, brown, water, dry_matter = (states * TYPICAL).T
    weights = np.zeros((2101, len(NANOMETRES)))
    weights[NANOMETRES - 400, np.arange(len(NANOMETRES))] = 1
    contents = structure, chlorophyll, carotenoids, 0 * structure, brown, water, dry_matter
    return leaf_band_means(contents, weights).reshape(2 * len(NANOMETRES), -1).T


def test_leaf_contents_are_retrieved_from_reflectance_and_transmittance():
    measured = np.array([np.concatenate([rows.leaf_reflectance, rows.leaf_transmittance]) for rows in CASES])
    true = np.array([rows.iloc[0][CONTENTS].astype(float) for rows in CASES])
    found = optimal_estimation(
        measured,
        lambda states, pixels: slope_of(leaves, states),
        np.ones(6), 4 * np.eye(6), 1e-14 * np.eye(18),
        limits=(np.array([1 / 1.5, 0, 0, 0, 0, 0]), np.full(6, 20.0)), iterations=60,
    )  # fmt: skip
    assert found.converged.all()
    # Half of the leaves have no brown pigments.
    assert found.state * TYPICAL == pytest.approx(true, rel=0.01, abs=1e-4)
