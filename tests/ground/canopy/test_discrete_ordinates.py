"""Tests of discrete ordinates against doubling with many directions, of energy and reciprocity, and in a Canopy."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from verification import tables
from verification.benchmarks import (
    RAMI_AEROSOL,
    RAMI_GROUND,
    RAMI_MOLECULES,
    RAMI_SZA,
    _rami_air,
    hom45,
)

import fifesim
from fifesim.ground.canopy.layers import extinction_coefficient
from fifesim.ground.canopy.leaf_transfer import discrete_ordinates
from fifesim.ground.canopy.sail_model import sail, with_background

TABLE = pd.read_csv(Path(__file__).parents[2] / "data" / "canopy_hemispherical.csv", comment="#")
BRF = tables.table("canopy_transfer.csv")
GREEN = 0.45, 0.42


def test_reflectance_agrees_with_the_doubling_table():
    keys = ["sza", "vza", "raa", "leaf_reflectance", "leaf_transmittance", "background"]
    for (sza, vza, raa, rho, tau, soil), rows in BRF.groupby(keys):
        canopy = discrete_ordinates(rows["lai"].to_numpy(), rho, tau, sza=sza, vza=vza, raa=raa)
        np.testing.assert_allclose(with_background(canopy, soil).rso, rows["reflectance"], rtol=0, atol=1e-4)


def test_fluxes_agree_with_the_doubling_table():
    optics = BRF.groupby("band")[["leaf_reflectance", "leaf_transmittance", "background"]].first()
    for (band, sza), rows in TABLE.groupby(["band", "sza"]):
        rho, tau, soil = optics.loc[band]
        canopy = discrete_ordinates(rows["lai"].to_numpy(), rho, tau, sza=sza)
        surface = with_background(canopy, soil)
        found = (surface.rsd, surface.rdd, canopy.tss + canopy.tsd, canopy.tdd, canopy.rdd)
        for name, values in zip(("dhr", "bhr", "tdir_total", "tdd", "rdd"), found, strict=True):
            np.testing.assert_allclose(values, rows[f"{name}_exact"], rtol=0, atol=1e-4, err_msg=name)


@pytest.mark.parametrize("leaf_angles", ["spherical", "planophile", "0: 1", "90: 1"])
def test_leaves_without_absorption_conserve_energy(leaf_angles):
    canopy = discrete_ordinates([0.0, 0.1, 1.0, 8.0], 0.6, 0.4, sza=60, vza=20, raa=30, leaf_angles=leaf_angles)
    np.testing.assert_allclose(canopy.rsd + canopy.tsd + canopy.tss, 1, rtol=0, atol=1e-8)
    np.testing.assert_allclose(canopy.rdd + canopy.tdd, 1, rtol=0, atol=1e-8)


def test_discrete_ordinates_are_reciprocal():
    there, back = (
        discrete_ordinates(2.0, *GREEN, sza=sza, vza=vza, raa=50, hotspot=0.1) for sza, vza in ((20, 55), (55, 20))
    )
    assert there.rso == pytest.approx(back.rso, abs=1e-10)
    assert there.rdo == pytest.approx(back.rsd, abs=1e-10) and there.tdo == pytest.approx(back.tsd, abs=1e-10)


def test_dark_leaves_scatter_once_as_in_sail():
    angles = {"sza": 30.0, "vza": 30.0, "raa": 0.0, "hotspot": 0.1, "leaf_angles": "uniform"}
    exact, four = (model(3.0, 1e-4, 5e-5, **angles).rso for model in (discrete_ordinates, sail))
    assert exact == pytest.approx(four, rel=2e-4)


def test_rami_hom45():
    """RAMI case of discs with radius 0.025 of the canopy height under an isotropic sky, without fitted parameters."""
    table, _ = hom45()
    _, down, _, _ = _rami_air(table, RAMI_AEROSOL)
    sunlight = np.exp(-(RAMI_MOLECULES + RAMI_AEROSOL) / np.cos(np.radians(RAMI_SZA))) / down
    found = []
    for row in table.itertuples():
        angles = {"sza": RAMI_SZA, "vza": abs(row.vza), "raa": row.raa, "leaf_angles": "uniform"}
        extinction = sum(extinction_coefficient(angles[name], "uniform") for name in ("sza", "vza"))
        angles["hotspot"] = 0.025 * 2 / extinction
        surface = with_background(discrete_ordinates(3.0, 0.05653, 0.01692, **angles), RAMI_GROUND["lambert"])
        found.append(float(sunlight * surface.rso + (1 - sunlight) * surface.rdo))
    away = 100 * (np.array(found) / table["reflectance"].to_numpy() - 1)
    assert abs(away.mean()) < 0.5
    assert abs(away[table["vza"] == RAMI_SZA]).max() < 1.0
    assert abs(away[abs(table["vza"]) <= 60]).max() < 3.0


def test_canopy_uses_the_model():
    lai = fifesim.lai_scene(fifesim.fife_site(30 / 9, window=((0, 40), (0, 50))), seed=7)
    given = {"bands": ["TM3", "TM4"], "geometry": fifesim.Geometry(sza=28.5, saa=117.0)}
    optics = {"leaf_optics": {"TM3": (0.11, 0.07), "TM4": GREEN}, "background": {"TM3": 0.1, "TM4": 0.16}}
    four, exact = (
        lai.fifesim.surface_reflectance("TM", canopy=fifesim.Canopy(model=model, **optics), **given)
        for model in ("sail", "discrete-ordinates")
    )
    assert "discrete ordinates" in exact.history and "SAIL" in four.history
    ratio = (exact / four).mean(["y", "x"])
    assert abs(float(ratio.sel(band="TM3")) - 1) < 0.01 < float(ratio.sel(band="TM4")) - 1 < 0.03
    canopy = fifesim.Canopy(model="discrete-ordinates", **optics)
    lazy = lai.chunk(y=11).fifesim.surface_reflectance("TM", canopy=canopy, **given)
    np.testing.assert_array_equal(lazy.compute(), exact)
    brown = canopy.replace(brown=0.3, dissociation=0.5)
    with pytest.raises(ValueError, match="without dissociation"):
        lai.fifesim.surface_reflectance("TM", canopy=brown, **given)
    with pytest.raises(ValueError, match="model must be"):
        fifesim.Canopy(model="exact")
