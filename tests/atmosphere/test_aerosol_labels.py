"""Aerosols from Datasets and files, with the variable names of several codes."""

import netCDF4
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from oracles_atmosphere import henyey_greenstein

import fifesim
from fifesim.atmosphere import aerosols
from fifesim.atmosphere.aerosol_labels import aerosol_tables, read_aerosol
from fifesim.atmosphere.engines import band_terms, scattering

TM = tuple(band.response for band in fifesim.instrument("TM").select(["TM1", "TM2", "TM3", "TM4", "TM5", "TM7"]))


@pytest.fixture(scope="module")
def tables():
    return aerosol_tables("continental")


@pytest.fixture
def totals():
    """Continental model, not split into components, in the format of Eradiate."""
    wavelength, angle = np.array([0.44, 0.55, 0.67, 0.87, 1.02]), np.linspace(0, 180, 721)
    mu = np.cos(np.radians(angle[::-1]))
    extinction, albedo, _ = aerosols.aerosol_optics("continental", wavelength)
    phase = aerosols.aerosol_phase("continental", mu[:, None], wavelength)
    f12 = -aerosols.aerosol_polarization("continental", mu[:, None], wavelength) * phase
    matrix = np.moveaxis(np.array([[phase, f12], [f12, phase]]) / (4 * np.pi), (0, 1), (2, 3))
    values = {
        "sigma_t": ("w", extinction, {"units": "km^-1"}),
        "albedo": ("w", albedo),
        "phase": (("mu", "w", "i", "j"), matrix, {"units": "sr^-1"}),
    }
    return xr.Dataset(values, {"w": ("w", 1000 * wavelength, {"units": "nm"}), "mu": mu})


def optics(aerosol, wavelength=0.6, cosine=-0.4):
    """Extinction, albedo, asymmetry, phase function and polarization of an aerosol."""
    by_angle = (aerosols.aerosol_phase, aerosols.aerosol_polarization)
    return [*aerosols.aerosol_optics(aerosol, wavelength), *(each(aerosol, cosine, wavelength) for each in by_angle)]


def test_tables_of_the_continental_model_reproduce_the_model(tables):
    """Band terms of all TM bands and scattering at one wavelength."""
    mine = read_aerosol(tables)
    airs = fifesim.Atmosphere(aerosol=mine, aot=0.3), fifesim.Atmosphere(aot=0.3)
    np.testing.assert_allclose(*(band_terms(air, TM, 50.0, 20.0, 40.0) for air in airs), rtol=1e-10)
    airs = (fifesim.Atmosphere(aerosol=each, aot=0.3, engine="successive-orders") for each in (mine, "continental"))
    views = 50.0, np.array([20.0]), np.array([40.0])
    for found, expected in zip(*(scattering(air, np.array([0.67]), *views) for air in airs), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_tables_round_trip_through_files(tables, tmp_path):
    tables.to_netcdf(tmp_path / "mine.nc")
    tables.to_dataframe().to_csv(tmp_path / "mine.csv")
    for name in ("mine.nc", "mine.csv"):
        mine = read_aerosol(tmp_path / name)
        assert mine.name == "mine"
        np.testing.assert_allclose(optics(mine), optics("continental"), rtol=1e-12)


def test_eradiate_phase_matrix(totals):
    """Input in cosines, nm and sr-1. Between wavelengths 4e-3, since the components are not interpolated separately."""
    mine = read_aerosol(totals)
    np.testing.assert_allclose(optics(mine, 0.67), optics("continental", 0.67), rtol=2e-4)
    np.testing.assert_allclose(optics(mine, 0.6), optics("continental", 0.6), rtol=4e-3)
    assert aerosols.wavelength_limits(mine) == pytest.approx((0.44, 1.02))
    for unit, per_nm in (("m", 1e-9), ("um", 1e-3), ("micrometre", 1e-3), ("nanometer", 1)):
        other = totals.assign_coords(w=("w", totals["w"].values * per_nm, {"units": unit}))
        np.testing.assert_allclose(read_aerosol(other).wavelength, mine.wavelength, rtol=1e-12)


def test_libradtran_moments(totals):
    """Moments without a wavelength axis apply to all wavelengths. Henyey-Greenstein moments are powers of g."""
    moments = 0.6 ** np.arange(60)
    given = totals.drop_vars(["phase", "mu"]).rename(sigma_t="ext", albedo="ssa").assign(pmom=("nmom", moments))
    mine, cosine = read_aerosol(given), np.array([-0.9, 0.0, 0.9])
    np.testing.assert_allclose(aerosols.aerosol_phase(mine, cosine, 0.8), henyey_greenstein(0.6, cosine), rtol=1e-5)
    np.testing.assert_allclose(aerosols.phase_moments(mine, 0.8, 40)[0], moments[:40], atol=1e-5)


def test_aeronet_row(totals, tmp_path):
    """Other columns, such as site and date, are ignored."""
    row = {"Site": "FIFE", "Sphericity_Factor(%)": 99.0, "Absorption_AOD[440nm]": 0.1}
    angle = np.degrees(np.arccos(totals["mu"].values))
    for k, nm in enumerate((440, 550, 670, 870, 1020)):
        row[f"AOD_Extinction-Total[{nm}nm]"] = float(totals["sigma_t"][k])
        row[f"Single_Scattering_Albedo[{nm}nm]"] = float(totals["albedo"][k])
        phase = 4 * np.pi * totals["phase"].values[:, k, 0, 0]
        row |= {f"{each:.6f}[{nm}nm]": value for each, value in zip(angle, phase, strict=True)}
    pd.DataFrame([row]).to_csv(tmp_path / "aeronet.csv", index=False)
    found, expected = optics(read_aerosol(tmp_path / "aeronet.csv")), optics("continental")
    np.testing.assert_allclose(found[:4], expected[:4], rtol=2e-3)


def test_vertical_distribution_is_an_argument_or_an_attribute(tables):
    assert read_aerosol(tables).vertical == 2.0
    assert read_aerosol(tables.assign_attrs(scale_height=3.0)).vertical == 3.0
    assert read_aerosol(tables.assign_attrs(bottom=1.0, top=2.5)).vertical == (1.0, 2.5)
    assert read_aerosol(tables.assign_attrs(top=2.5), scale_height=1.0).vertical == 1.0
    assert read_aerosol(tables, layer=(3, 5)).vertical == (3.0, 5.0)


def test_absorbing_aerosol_above_the_molecules_dims_them():
    """Light crosses a pure absorber twice, exactly at all orders; 0.5 % of the molecules lie above 42 km."""
    table = aerosol_tables("continental")
    soot = table.assign(single_scattering_albedo=0 * table["single_scattering_albedo"] + 1e-9)
    at = np.array([0.55]), 40.0, np.array([25.0]), np.zeros(1)
    mu_s, mu_v = np.cos(np.radians([40.0, 25.0]))
    options = {"altitude": 0.0, "engine": "successive-orders"}
    molecules = scattering(fifesim.Atmosphere(aerosol="none", **options), *at).reflectance.item()
    for layer, depth in (((0, 0.01), 0.0), ((42, 50), 0.3)):
        air = fifesim.Atmosphere(aerosol=read_aerosol(soot, layer=layer), aot=0.3, **options)
        expected = molecules * np.exp(-depth * (1 / mu_s + 1 / mu_v))
        assert scattering(air, *at).reflectance.item() == pytest.approx(expected, rel=4e-3)


def test_user_aerosol_passes_through_the_chain(tables):
    """Also with elevation by cell, where a lookup table is interpolated and single scattering is added."""
    lai = fifesim.lai_scene(fifesim.fife_site(30, window=((0, 4), (0, 5))), arp=0.1, seed=1)
    air = fifesim.Atmosphere(aerosol=read_aerosol(tables), aot=0.3)
    airs = air, fifesim.Atmosphere(aot=0.3)
    rho, same = (lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], atmosphere=each) for each in airs)
    found = rho.fifesim.to_toa()
    np.testing.assert_allclose(found, same.fifesim.to_toa(), rtol=1e-10)
    assert "aerosol=continental#" in found.attrs["atmosphere"]
    ground = (100 + 50 * lai).rename("dem").drop_attrs(deep=False).assign_attrs(units="m")
    np.testing.assert_allclose(*(each.fifesim.to_toa(elevation=ground) for each in (rho, same)), rtol=1e-10)


def test_unreadable_tables_raise(tables, tmp_path):
    """A flipped bit would give another, plausible phase function, and a declared size would fill the memory."""
    tables.to_netcdf(tmp_path / "mine.nc")
    whole = (tmp_path / "mine.nc").read_bytes()
    at = whole.index(tables.phase.values.tobytes()[800:824])
    (tmp_path / "damaged.nc").write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
    with netCDF4.Dataset(tmp_path / "large.nc", "w") as file:
        file.createDimension("wavelength", 10**9)
        file.createVariable("extinction", "f8", ("wavelength",), chunksizes=(10**6,))
    (tmp_path / "twice.csv").write_text("wavelength,angle,phase\n0.5,0,1\n0.5,0,1\n")
    two = "wavelength,angle,phase,extinction,ssa\n0.5,0,1,1,1\n0.5,180,1,2,1\n"
    (tmp_path / "unequal.csv").write_text(two)
    row = "AOD_Extinction-Total[440nm],Single_Scattering_Albedo[440nm],0.0[440nm]\n0.1,0.9,1\n0.1,0.9,1\n"
    (tmp_path / "aeronet.csv").write_text(row)
    for name, message in (
        ("damaged.nc", r"cannot read the aerosol .*damaged\.nc: .*HDF error"),
        ("large.nc", "declares 8000000000 bytes"),
        ("twice.csv", "aerosol twice: .*rows that are there twice"),
        ("unequal.csv", "extinction must be one at each"),
        ("aeronet.csv", "AERONET's columns must have one row, got 2"),
        ("none.nc", "there is no such file"),
        ("mine.txt", "a file .nc or .csv"),
    ):
        with pytest.raises(ValueError, match=message):
            read_aerosol(tmp_path / name)
