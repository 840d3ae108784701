"""Hyperspectral images and field spectra converted to bands of an instrument, and wavelength units."""

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim
from fifesim.grids import grid as grids
from fifesim.ground.canopy.prospect import Leaf, leaf_spectrum
from fifesim.sensor.band_labels import spectral_axis
from fifesim.sensor.response.spectral import band_weights, covered_steps


@pytest.fixture(scope="module")
def leaf():
    """Reflectance and transmittance of a leaf as two field spectra."""
    wavelength, reflectance, transmittance = leaf_spectrum(Leaf())
    values = np.stack([reflectance, transmittance])
    return xr.DataArray(values, dims=("sample", "wavelength"), coords={"wavelength": wavelength})


@pytest.fixture(scope="module")
def cube(site):
    """Leaf spectrum in steps of 20 nm, with a different brightness in each cell."""
    wavelength, reflectance, _ = leaf_spectrum(Leaf())
    brightness = np.random.Generator(np.random.Philox(5)).uniform(0.2, 1, site.shape)
    values = reflectance[::20, None, None] * brightness
    coords = {"wavelength": ("band", wavelength[::20] * 1000, {"units": "nm"}), "sza": 30.0, "saa": 120.0}
    return grids.place(xr.DataArray(values, dims=("band", "y", "x"), coords=coords), site)


def test_cube_becomes_bands_lazily(cube):
    image = check_raster_function(lambda each: each.fifesim.to_bands("OLI"), cube, quantity="surface_reflectance")
    assert image["band"].values.tolist() == [band.name for band in fifesim.instrument("OLI").bands]
    assert image.attrs["instrument"] == "OLI" and float(image["sza"]) == 30
    assert image.attrs["history"] == "to_bands: OLI, 106 wavelengths weighted by response and sun"
    toa = cube.assign_attrs(standard_name="toa_bidirectional_reflectance")
    assert toa.fifesim.to_bands("OLI").name == "toa_reflectance"
    toa = image.sel(band=["OLI4", "OLI5"]).fifesim.to_toa()
    seen = toa.fifesim.sense(fifesim.instrument("OLI", response="detector"))
    assert seen.dtype == np.uint16 and np.isfinite(seen.fifesim.ndvi()).all()


def test_bands_are_weighted_sums_of_samples(leaf):
    image = leaf.fifesim.to_bands("TM", bands=["TM4", "TM2"])
    back = leaf.isel(wavelength=slice(None, None, -1)).fifesim.to_bands("TM", bands=["TM4", "TM2"])
    np.testing.assert_allclose(back, image, rtol=1e-13)
    wavelength = leaf["wavelength"].values
    for name in ("TM4", "TM2"):
        (band,) = fifesim.instrument("TM").select(name)
        weights = band_weights(band.response, wavelength, covered_steps(wavelength)).weights
        np.testing.assert_allclose(image.sel(band=name), leaf.values @ weights, rtol=1e-9)
    assert image.dims == ("sample", "band") and image["band"].values.tolist() == ["TM4", "TM2"]


def test_missing_sample_affects_only_its_bands_and_cell(cube):
    cube = cube.copy(deep=True)
    cube[{"band": int(np.argmin(abs(cube["wavelength"].values - 865))), "y": 3, "x": 4}] = np.nan
    image = cube.fifesim.to_bands("OLI")
    missing = np.argwhere(np.isnan(image.values))
    assert [image["band"].values[band] for band, *_ in missing] == ["OLI5"]
    assert missing[0, 1:].tolist() == [3, 4]


def test_radiance_is_weighted_by_the_response_only():
    wavelength = np.linspace(0.4, 1.0, 121)
    radiance = xr.DataArray(100 * wavelength, dims="wavelength", coords={"wavelength": wavelength})
    radiance.attrs["units"] = "W m-2 sr-1 um-1"
    found = radiance.fifesim.to_bands("OLI", bands=["OLI4"])
    assert found.name == "toa_radiance" and found.attrs["units"] == "W m-2 sr-1 um-1"
    # The mean wavelength over the response is the band centre.
    assert float(found[0]) == pytest.approx(100 * fifesim.instrument("OLI").select("OLI4")[0].wavelength, rel=1e-5)
    assert "solar_irradiance" in found.coords
    reflectance = radiance.drop_attrs() / 100
    assert float(reflectance.fifesim.to_bands("OLI", bands=["OLI4"])[0]) < float(found[0]) / 100 - 1e-5


def without(leaf, low, high):
    return leaf.isel(wavelength=(leaf["wavelength"].values < low) | (leaf["wavelength"].values > high))


def test_fwhm_determines_gaps(leaf):
    """An accepted gap has no weight, and a flat spectrum keeps its mean."""
    flat = without(xr.full_like(leaf, 0.3), 1.58, 1.61).fifesim.to_bands("OLI", bands="OLI6", min_coverage=0.5)
    np.testing.assert_allclose(flat, 0.3, rtol=0, atol=1e-12)
    sparse = leaf.isel(wavelength=slice(None, None, 20))
    assert sparse.fifesim.to_bands("OLI", bands="OLI6").notnull().all()
    narrow = sparse.assign_coords(fwhm=("wavelength", np.full(sparse.sizes["wavelength"], 0.005)))
    with pytest.raises(ValueError, match="hold nothing of OLI6"):
        narrow.fifesim.to_bands("OLI", bands="OLI6")
    with pytest.raises(ValueError, match="min_coverage must be in"):
        leaf.fifesim.to_bands("OLI", min_coverage=99)


def test_packed_cubes_are_unpacked_and_checked(leaf):
    whole = (leaf * 10000).round().fillna(-1).astype("int16").drop_attrs(deep=False)
    packed = whole.assign_attrs(scale_factor=1e-4, _FillValue=-1).assign_coords(wavelength=leaf["wavelength"])
    unpacked = (whole * 1e-4).drop_attrs(deep=False).assign_coords(wavelength=leaf["wavelength"])
    found, known = (each.fifesim.to_bands("OLI", bands="OLI4") for each in (packed, unpacked))
    np.testing.assert_allclose(found, known, rtol=1e-12)
    with pytest.raises(ValueError, match="it is a fraction"):
        (unpacked * 100).fifesim.to_bands("OLI", bands="OLI4")


# ------------------------------------------------------------------------------------------ wavelengths


def spectra(wavelength, units=None, dim="band", **coords):
    attrs = {} if units is None else {"units": units}
    found = xr.DataArray(np.zeros((2, len(wavelength))), dims=("sample", dim))
    return found.assign_coords(wavelength=(dim, wavelength, attrs), **coords)


def test_wavelengths_and_widths_default_to_micrometres():
    for units in ("nm", "Nanometers", "nanometre"):
        np.testing.assert_allclose(spectral_axis(spectra([500.0, 600.0], units)).wavelength, [0.5, 0.6], rtol=1e-15)
    for units in (None, "um", "µm", "micrometers"):
        axis = spectral_axis(spectra([0.5, 0.6], units, dim="wavelength"))
        assert (axis.dim, axis.wavelength.tolist(), axis.fwhm) == ("wavelength", [0.5, 0.6], None)
    widths = {"units": "nm"}
    for cube in (
        spectra([500.0, 600.0], "nm", fwhm=("band", [5.0, 6.0])),
        spectra([500.0, 600.0], "nm", fwhm=("band", [5.0, 6.0], widths)),
        spectra([0.5, 0.6], fwhm=("band", [5.0, 6.0], widths)),
    ):
        np.testing.assert_allclose(spectral_axis(cube).fwhm, [0.005, 0.006])


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda leaf: without(leaf, 1.58, 1.61), r"OLI6 [\d.]+%, without 1\.579 to 1\.611 um: pick others with band"),
        (lambda leaf: without(leaf, 2.2, 9.0), r"to 2\.199 um, and cover less than 0\.99 of OLI7 \d"),
        (lambda leaf: without(leaf, 1.0, 9.0), r"hold nothing of OLI6, OLI7, OLI9 of OLI: pick bands, .*'OLI8'\]"),
        (lambda leaf: (leaf * 1e4).astype(np.int16), "whole numbers"),
        (lambda leaf: leaf.assign_attrs(units="%"), "units '%'"),
        (lambda leaf: spectra([400.0, 2500.0]), "in um, got 2500: .*'nm'"),
        (lambda leaf: spectra([400.0, 2500.0], "um"), "in um, got 2500: .*'nm'"),
        (lambda leaf: spectra([0.4, 2.5], "nm"), "in um, got 0.0025: .* correct their unit"),
        (lambda leaf: spectra([400.0, 2500.0], "cm-1"), "are in 'cm-1': convert them to 'um' or 'nm'"),
        (lambda leaf: spectra([0.5, np.nan]), "positive throughout, got nan"),
        (lambda leaf: spectra([0.5, 0.5]), "each once, got 2, of which 1 differ"),
        (lambda leaf: spectra([0.5]), "two different wavelengths"),
        (lambda leaf: spectra([0.5, 0.6]).drop_vars("wavelength"), "need a coordinate 'wavelength'"),
        (lambda leaf: spectra([0.5, 0.6], fwhm=("band", [0.01, -0.01])), "fwhm must be positive"),
    ],
)
def test_unusable_spectra_raise(leaf, make, said):
    with pytest.raises(ValueError, match=said) as error:
        make(leaf).fifesim.to_bands("OLI")
    assert len(str(error.value)) <= 500
