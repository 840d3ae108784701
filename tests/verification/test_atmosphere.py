"""Checks of the atmosphere detect and name errors."""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from broken import exceeded

from fifesim.atmosphere import engines, lookup
from fifesim.atmosphere.engines import mixed_scattering
from verification import atmosphere, tables

DATA = Path(__file__).parents[1] / "data"


@pytest.mark.slow
def test_successive_orders_without_polarization_agree_with_scalar_6s(monkeypatch):
    """Scalar 6S is not always self-consistent, so its table has fewer cases."""
    scalar, table = pd.read_csv(DATA / "sixs_scalar.csv", comment="#"), tables.table
    monkeypatch.setitem(engines.SCATTERING, "successive-orders", partial(mixed_scattering, polarized=False))
    monkeypatch.setattr(engines, "_band_terms", engines._band_terms.__wrapped__)
    monkeypatch.setattr(tables, "table", lambda name: scalar if name == "sixs_grid.csv" else table(name))
    assert len(list(atmosphere._successive_orders())) == 8
    assert exceeded(atmosphere._successive_orders) == []


def test_tighter_bound_is_exceeded(monkeypatch):
    """The closed forms of 5S are less accurate than 0.01 %."""
    monkeypatch.setattr(atmosphere, "_FIFE_BOUNDS", (0.007, 0.004, 1e-5, 0.002, 0.001, 0.001))
    assert exceeded(atmosphere._five_s_at_fife) == ["5S, FIFE case, TM3"]


@pytest.mark.parametrize(
    "name, what",
    [("corrected_reflectance", "reflectance there and back"), ("target_reflectance", "target there and back")],
)
def test_inexact_inverse_is_detected(monkeypatch, name, what):
    right = getattr(atmosphere, name)
    monkeypatch.setattr(atmosphere, name, lambda *given, **terms: right(*given, **terms) + 1e-9)
    assert exceeded(atmosphere._there_and_back) == [what]


def test_wrong_optical_depth_of_the_direct_beam_is_detected(monkeypatch):
    """In the mixed atmosphere the beam is attenuated by molecules and aerosol together."""
    right = atmosphere.scattering

    def wrong(air, wavelength, *angles):
        light = right(air, wavelength, *angles)
        aerosol = air.aerosol_optical_depth(wavelength) / np.cos(np.radians(50.0))
        return light._replace(direct_transmittance_down=light.direct_transmittance_down * np.exp(2 * aerosol))

    monkeypatch.setattr(atmosphere, "scattering", wrong)
    assert exceeded(atmosphere._sunbeam) == ["5S, sunbeam", "successive-orders, sunbeam"]


@pytest.mark.parametrize("wrong", [-1.0, 1.001, np.nan])
def test_wrong_kernel_of_the_tables_is_detected(monkeypatch, wrong):
    right = lookup._through

    def through(*given):
        right(*given)
        given[-1][...] *= wrong

    monkeypatch.setattr(lookup, "_through", through)
    assert "geometry by cell" in exceeded(atmosphere._varying)
