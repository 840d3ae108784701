"""Checks of what scatters light notice a sign that is turned, or a percent."""

import numpy as np
import pytest
from broken import exceeded

from fifesim.atmosphere import column, successive_orders
from fifesim.experiments.verification import scattering


@pytest.mark.parametrize("check", scattering.CHECKS)
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize("turned", [(1, 0), (0, 2), (2, -2)])
def test_turned_wigner_functions_are_noticed(monkeypatch, turned):
    right = column.wigner

    def wigner(order, spin, cosine, count):
        return right(order, spin, cosine, count) * (-1 if (order, spin) == turned else 1)

    monkeypatch.setattr(column, "wigner", wigner)
    assert "Wigner functions" in exceeded(scattering._wigner_functions)


@pytest.mark.parametrize(
    "name, what",
    [
        ("rayleigh_expansion", "series of the scattering matrix of molecules"),
        ("matrix_moments", "moments of the scattering matrix of molecules"),
    ],
)
def test_turned_polarization_is_noticed(monkeypatch, name, what):
    """The last column is that of F12."""
    right = getattr(column, name)
    monkeypatch.setattr(column, name, lambda *given: right(*given) * [1, 1, 1, -1])
    assert what in exceeded(scattering._expansions)


@pytest.mark.parametrize(
    "owner, kernel",
    [
        (successive_orders, "_scattered"),
        (successive_orders, "_sum_orders"),
        (successive_orders, "_rescattered"),
        (successive_orders, "leaving_light"),
        (successive_orders, "once_scattered"),
    ],
)
def test_wrong_orders_are_noticed(monkeypatch, owner, kernel):
    """By a percent."""
    right = getattr(owner, kernel)

    def wrong(*given, **options):
        found = right(*given, **options)
        return (1.01 * found[0], found[1]) if isinstance(found, tuple) else 1.01 * found

    monkeypatch.setattr(owner, kernel, wrong)
    assert exceeded(scattering._polarized)


@pytest.mark.parametrize("wrong", [-1.0, 1.01, np.nan])
def test_wrong_single_scattering_is_noticed(monkeypatch, wrong):
    right = scattering.once_on_nodes
    monkeypatch.setattr(scattering, "once_on_nodes", lambda *given: wrong * right(*given))
    assert exceeded(scattering._once) == ["light that the aerosol scatters once"]
