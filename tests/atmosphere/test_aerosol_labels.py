"""Aerosols from Datasets and files, with the variable names of several codes."""

from pathlib import Path

import netCDF4
import numpy as np
import pandas as pd
import pytest
import xarray as xr

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
    at = aerosol, cosine, wavelength
    return [
        *aerosols.aerosol_optics(aerosol, wavelength),
        aerosols.aerosol_phase(*at),
        aerosols.aerosol_polarization(*at),
    ]


@pytest.mark.parametrize(("unit", "micrometre"), [("m", 1e-6), ("um", 1.0), ("micrometre", 1.0), ("nanometer", 1e3)])
def test_wavelength_units_are_converted(totals, unit, micrometre):
    other = totals.assign_coords(w=("w", totals["w"].values / 1000 * micrometre, {"units": unit}))
    np.testing.assert_allclose(read_aerosol(other).wavelength, [0.44, 0.55, 0.67, 0.87, 1.02], rtol=1e-12)


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
    assert aerosols.wavelength_limits(read_aerosol(totals)) == pytest.approx((0.44, 1.02))


def test_libradtran_moments(totals):
    """Moments without a wavelength axis apply to all wavelengths. Henyey-Greenstein moments are powers of g."""
    moments = 0.6 ** np.arange(60)
    given = totals.drop_vars(["phase", "mu"]).rename(sigma_t="ext", albedo="ssa").assign(pmom=("nmom", moments))
    mine, cosine = read_aerosol(given), np.array([-0.9, 0.0, 0.9])
    expected = (1 - 0.6**2) / (1 + 0.6**2 - 1.2 * cosine) ** 1.5
    np.testing.assert_allclose(aerosols.aerosol_phase(mine, cosine, 0.8), expected, rtol=1e-5)
    np.testing.assert_allclose(aerosols.phase_moments(mine, 0.8, 40)[0], moments[:40], atol=1e-5)
    with pytest.raises(ValueError, match="first of the moments must be 1, got 2: divide them"):
        read_aerosol(given.assign(pmom=("nmom", 2 * moments)))


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
    pd.DataFrame([row, row]).to_csv(tmp_path / "two.csv", index=False)
    with pytest.raises(ValueError, match="aerosol two: AERONET's columns must have one row, got 2"):
        read_aerosol(tmp_path / "two.csv")


def test_vertical_distribution_is_an_argument_or_an_attribute(tables):
    assert read_aerosol(tables).vertical == 2.0
    assert read_aerosol(tables.assign_attrs(scale_height=3.0)).vertical == 3.0
    assert read_aerosol(tables.assign_attrs(bottom=1.0, top=2.5)).vertical == (1.0, 2.5)
    assert read_aerosol(tables.assign_attrs(top=2.5), scale_height=1.0).vertical == 1.0
    assert read_aerosol(tables, layer=(3, 5)).vertical == (3.0, 5.0)


def test_aerosol_height_affects_successive_orders_but_not_5s(tables):
    """Absorbing particles above the molecules attenuate the Rayleigh reflectance on both paths."""
    dark = tables.assign(single_scattering_albedo=0 * tables["single_scattering_albedo"] + 0.2)
    at = np.array([0.66]), 40.0, np.zeros(1), np.zeros(1)
    path = {}
    for engine in ("5S", "successive-orders"):
        layers = (read_aerosol(dark, layer=layer) for layer in ((0, 1), (20, 30)))
        airs = [fifesim.Atmosphere(aerosol=each, aot=0.5, engine=engine) for each in layers]
        path[engine] = [scattering(air, *at).reflectance.item() for air in airs]
    assert path["5S"][0] == path["5S"][1]
    below, above = path["successive-orders"]
    assert above < 0.8 * below


def test_bands_outside_the_tables_raise(totals):
    air = fifesim.Atmosphere(aerosol=read_aerosol(totals), aot=0.2)
    assert np.isfinite(band_terms(air, TM[2:4], 30.0, 0.0, 0.0)).all()
    with pytest.raises(ValueError, match=r"band TM5 must lie within .* 0.44 to 1.02 um, got 1.501 to 1.889 um: add"):
        band_terms(air, TM[4:], 30.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="the spectrum must lie within the wavelengths of the aerosol"):
        fifesim.atmosphere.spectrum(air)


def test_unreadable_aerosol_raises(totals, tables, tmp_path):
    for wrong, message in (
        (totals.drop_vars("albedo"), "there must be wavelength, extinction, single_scattering_albedo"),
        (totals.drop_vars("phase"), "one of phase and moments, got"),
        (totals.rename(w="x"), "there must be wavelength"),
        (tables.rename(component="time"), "phase must have the dims angle, wavelength, .* got time, angle, wavelength"),
        (totals.assign_coords(w=totals["w"].assign_attrs(units="cm-1")), "um, nm or m, got 'cm-1': convert it"),
        (totals.assign_coords(w=totals["w"].drop_attrs()), "from 0.1 to 50 um, got 1020: divide nanometres by 1000"),
        (totals.assign(phase=totals["phase"].drop_attrs(deep=False)), "got 0.07958 at .* um: divide"),
        (tmp_path / "none.nc", "there is no such file"),
        (tmp_path / "mine.txt", "a file .nc or .csv"),
    ):
        with pytest.raises(ValueError, match=message):
            read_aerosol(wrong)
    for text, message in (
        ("wavelength,angle,phase\n0.5,0,1\n0.5,0,1\n", "rows that are there twice"),
        ("wavelength,angle,phase,extinction,ssa\n0.5,0,1,1,1\n0.5,180,1,2,1\n", "extinction must be one at each"),
    ):
        Path(tmp_path / "bad.csv").write_text(text)
        with pytest.raises(ValueError, match=f"aerosol bad: .*{message}"):
            read_aerosol(tmp_path / "bad.csv")


def test_user_aerosol_passes_through_the_chain(tables):
    """Also with elevation by cell, where a lookup table is interpolated and single scattering is added."""
    lai = fifesim.lai_scene(fifesim.fife_site(30, window=((0, 4), (0, 5))), arp=0.1, seed=1)
    air = fifesim.Atmosphere(aerosol=read_aerosol(tables), aot=0.3)
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], atmosphere=air)
    same = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], atmosphere=fifesim.Atmosphere(aot=0.3))
    found = rho.fifesim.to_toa()
    np.testing.assert_allclose(found, same.fifesim.to_toa(), rtol=1e-10)
    np.testing.assert_allclose(found.fifesim.to_surface(), rho, rtol=1e-10)
    assert "aerosol=continental#" in found.attrs["atmosphere"]
    ground = (100 + 50 * lai).rename("dem").drop_attrs(deep=False).assign_attrs(units="m")
    np.testing.assert_allclose(*(each.fifesim.to_toa(elevation=ground) for each in (rho, same)), rtol=1e-10)


def test_damaged_tables_and_declared_sizes_are_found_in_a_file(tmp_path):
    """The flipped bit would give another, plausible phase function."""
    fifesim.atmosphere.aerosol_tables("urban").to_netcdf(tmp_path / "mine.nc")
    whole = (tmp_path / "mine.nc").read_bytes()
    numbers = fifesim.atmosphere.aerosol_tables("urban").phase.values.tobytes()[800:824]
    at = whole.index(numbers)
    (tmp_path / "damaged.nc").write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
    with netCDF4.Dataset(tmp_path / "large.nc", "w") as file:
        file.createDimension("wavelength", 10**9)
        file.createVariable("extinction", "f8", ("wavelength",), chunksizes=(10**6,))
    for name, said in (("damaged", "HDF error"), ("large", "declares 8000000000 bytes")):
        with pytest.raises(ValueError, match=rf"cannot read the aerosol .*{name}\.nc: .*{said}"):
            fifesim.atmosphere.read_aerosol(tmp_path / f"{name}.nc")
