"""SL2P against its published cases and the definition of its domain, and the training of quantiles."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fifesim.base import files
from fifesim.retrieval import networks

CASES = pd.read_csv(Path(__file__).parents[1] / "data" / "sl2p_cases.csv", comment="#")
ANGLES = ("cos_vza", "cos_sza", "cos_raa")


@pytest.mark.parametrize(("quantity", "bound"), [("LAI", 3e-4), ("FAPAR", 2e-5), ("FCOVER", 1e-6)])
def test_sl2p_gives_the_published_values(quantity, bound):
    cases = CASES[(CASES.variable == quantity) & CASES.expected.notna()]
    found, _ = networks.sl2p(
        cases[list(networks.SL2P_BANDS)].to_numpy(), *(cases[name].to_numpy() for name in ANGLES), quantity
    )
    assert len(cases) >= 25
    assert np.abs(found - cases.expected).max() < bound


def domain_by_the_rule(spectrum, ranges, cells):
    """Whether bands are within their ranges and their decile cell is in the list."""
    text = ""
    for name, value in zip(networks.SL2P_BANDS, spectrum, strict=True):
        low, high = ranges.loc[name, "domain_min"], ranges.loc[name, "domain_max"]
        if not low <= value <= high:
            return False
        text += "123456789A"[min(int(10 * (value - low) / (high - low)), 9)]
    return text in cells


def test_domain_of_sl2p_follows_its_definition():
    ranges = files.table("sl2p/ranges.csv")
    ranges = ranges[ranges.variable == "LAI"].set_index("quantity")
    cells = set(files.table("sl2p/domain_cells.csv").cell.astype(str))
    inside = CASES[CASES.variable == "LAI"][list(networks.SL2P_BANDS)].to_numpy()
    rng = np.random.default_rng(3)
    spectra = np.concatenate([inside, inside * rng.uniform(0.6, 1.5, inside.shape), rng.uniform(0, 0.5, (300, 8))])
    expected = np.array([domain_by_the_rule(each, ranges, cells) for each in spectra])
    assert 50 < expected.sum() < len(spectra) - 50
    domain = ranges.loc[list(networks.SL2P_BANDS), ["domain_min", "domain_max"]].to_numpy().T
    assert np.array_equal(networks._in_domain(spectra, domain), expected)
    _, outside = networks.sl2p(spectra, *np.full((3, len(spectra)), 0.95), "LAI")
    assert (outside >= ~expected).all()


def test_values_beyond_the_range_by_less_than_the_tolerance_are_clipped():
    """One published case of FAPAR is clipped at 0; raw outputs of some spectra are above 0.94."""
    cases = CASES[CASES.variable == "FAPAR"]
    found, outside = networks.sl2p(
        cases[list(networks.SL2P_BANDS)].to_numpy(), *(cases[name].to_numpy() for name in ANGLES), "FAPAR"
    )
    assert found.min() == 0 and found.max() == 0.94
    rng = np.random.default_rng(0)
    spectra = rng.uniform(0, 0.6, (5000, 8))
    value, outside = networks.sl2p(spectra, *np.full((3, 5000), 0.95), "LAI")
    beyond = (value < 0) | (value > 8)
    assert beyond.any() and outside[beyond].all()
    assert (np.maximum(-value, value - 8)[beyond] > 0.2).all()


def test_trained_quantiles_agree_with_a_known_distribution():
    """The target is normal with mean 2 x and standard deviation 0.2 + 0.3 |x|."""
    rng = np.random.default_rng(5)
    x = rng.uniform(-1, 1, (20_000, 1))
    y = 2 * x + (0.2 + 0.3 * np.abs(x)) * rng.normal(size=x.shape)
    probabilities = np.array([0.1, 0.5, 0.9])
    layers = networks.train_quantiles(x, y, probabilities, seed=1, epochs=20)
    at = np.linspace(-0.9, 0.9, 7)[:, None]
    expected = 2 * at + (0.2 + 0.3 * np.abs(at)) * np.array([-1.2816, 0, 1.2816])
    assert np.abs(networks.network(at, layers) - expected).max() < 0.06


def test_gradients_agree_with_finite_differences():
    rng = np.random.default_rng(2)
    found = [rng.normal(size=shape) for shape in ((3, 4), (4, 4), (4, 2), (4,), (4,), (2,))]
    inputs, targets = rng.normal(size=(50, 3)), rng.normal(size=(50, 2))
    wanted = np.array([0.2, 0.7])

    def loss(values):
        outputs = networks.network(inputs, networks.Network(tuple(values[:3]), tuple(values[3:])))
        error = targets - outputs
        return (np.maximum(wanted * error, (wanted - 1) * error).sum(1)).mean()

    slopes = networks._slopes(found, inputs, targets, wanted)
    for at, place in ((0, (1, 2)), (1, (3, 0)), (2, (0, 1)), (3, (2,)), (4, (1,)), (5, (0,))):
        step = 1e-6
        moved = [each.copy() for each in found]
        moved[at][place] += step
        assert (loss(moved) - loss(found)) / step == pytest.approx(slopes[at][place], abs=1e-4)
