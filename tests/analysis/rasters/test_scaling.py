"""Scale invariance of rasters: predicted beside simulated, and densities in any chunks."""

import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, check_raster_function, in_chunks, no_compute
from scipy import integrate

import fifesim
from fifesim.analysis import scaling
from fifesim.grids import grid as grids
from fifesim.ground.canopy import layers

CELL = 30 / 9


def cube(lai, spread=1.0):
    """Reflectances that vary with LAI, red down and near infrared up."""
    bands = [0.12 - spread * 0.04 * (lai - 0.7), 0.25 + spread * 0.08 * (lai - 0.7)]
    out = grids.place(xr.concat(bands, "band").transpose("band", "y", "x"), grids.geobox(lai))
    out = out.assign_coords(wavelength=("band", [0.66, 0.83]))
    out.attrs = {"units": "1"}
    return out.rename("surface_reflectance")


def test_bias_of_a_linear_algorithm_is_zero(lai_with_hole):
    with no_compute():
        lazy = fifesim.scale_bias(lambda array: 3 * array + 1, in_chunks(lai_with_hole, ODD_CHUNKS))
    assert float(np.abs(lazy["bias"]).max()) < 1e-14
    assert lazy.sizes == {"y": 5, "x": 6}


def test_predicted_bias_of_ndvi_is_the_simulated_one(lai):
    """Coefficients of variation of a tenth: the third order is that much less."""
    reflectance = cube(lai, 0.5)
    simulated = fifesim.scale_bias(fifesim.ndvi, reflectance)["bias"]
    predicted = check_raster_function(fifesim.ndvi_bias, reflectance, quantity="ndvi_bias")
    np.testing.assert_allclose(predicted, simulated, rtol=0.25)
    assert float(np.abs(predicted - simulated).mean() / np.abs(simulated).mean()) < 0.08


def test_predicted_bias_of_fpar_is_the_simulated_one(lai):
    """The third order is K times the skewness and deviation of LAI, a tenth."""
    extinction = float(layers.extinction_coefficient(fifesim.fife_geometry().sza))
    simulated = fifesim.scale_bias(fifesim.fpar, lai)["bias"]
    predicted = check_raster_function(lambda lai: fifesim.fpar_bias(lai, extinction), lai, quantity="fpar_bias")
    assert (predicted < 0).all() and (simulated < 0).all()
    np.testing.assert_allclose(predicted, simulated, rtol=0.2)


def test_bias_of_fpar_is_that_of_the_same_asymptote_as_fpar(lai):
    """A canopy of LAI 20, of which one part in 1e5 is not in its depth, absorbs what an infinite one does in both."""
    dense = fifesim.fpar(lai.copy(data=np.full(lai.shape, 20.0)), geometry=fifesim.fife_geometry())
    ratio = fifesim.fpar_bias(lai, 0.5) / fifesim.fpar_bias(lai, 0.5, fpar_inf=1.0)
    np.testing.assert_allclose(ratio, float(dense[0, 0]), rtol=3e-5)


def test_white_noise_keeps_a_ninth_of_its_deviation():
    """Of 9 x 9 cells; 900 means, whose variance is known to sqrt(2 / 900) = 5 %, four of it."""
    grid = fifesim.fife_site(CELL, window=((0, 270), (0, 270)))
    cells = fifesim.lai_scene(grid, arp=0.0, seed=1)
    kept = fifesim.share_kept(fifesim.aggregate(cells), cells)
    assert float(kept["variance"]) == pytest.approx(1 / 81, rel=0.2)
    assert 0 < float(kept["range"]) < 0.35
    assert scaling.pixel_shares(fifesim.aggregate(cells), cells) == pytest.approx(
        (float(kept["range"]), float(kept["variance"])), rel=1e-12
    )


def test_share_kept_stays_lazy(lai_with_hole):
    with no_compute():
        lazy = fifesim.share_kept(fifesim.aggregate(in_chunks(lai_with_hole, CHUNKS)), in_chunks(lai_with_hole, CHUNKS))
    assert lazy["range"].chunks is not None
    assert 0 < float(lazy["range"]) < 1


def test_density_of_a_raster_integrates_to_one_and_ignores_chunks(lai_with_hole):
    """The kernel reaches past the range of the values, where a few hundredths of the mass lie."""
    whole = fifesim.density(lai_with_hole, points=400)
    assert 0.95 < integrate.trapezoid(whole, whole["value"]) <= 1
    xr.testing.assert_identical(fifesim.density(in_chunks(lai_with_hole, ODD_CHUNKS), points=400), whole)
    values = lai_with_hole.values[np.isfinite(lai_with_hole)]
    exact = scaling.gaussian_density(values, whole["value"].values, whole.attrs["bandwidth"], reflect=True)
    # Bins of 1/2000 of the range beside a bandwidth of a tenth of it: (bin / bandwidth)^2 / 24 of the curvature.
    np.testing.assert_allclose(whole, exact, rtol=1e-3)


def test_density_of_leaf_area_is_that_of_its_distribution_down_to_zero():
    """Exact ranks of burned, grazed ground, whose density is .85 where it is cut off; a difference may be negative."""
    site = fifesim.fife_site(30 / 9, window=((0, 333), (0, 333)))
    lai = fifesim.lai_scene(site, arp=0.24, seed=1, method="periodic")
    known = fifesim.lai_distribution("burned-grazed").pdf(0.0)
    assert known == pytest.approx(0.853, abs=0.01)
    assert float(fifesim.density(lai)[0]) == pytest.approx(known, rel=0.06)
    assert float(fifesim.density(lai, reflect=False)[0]) == pytest.approx(known / 2, rel=0.1)
    about = lai - 0.74
    assert about.name == "lai" and float(fifesim.density(about)["value"][0]) < 0
    with pytest.raises(ValueError, match="at least 0 to be reflected"):
        fifesim.density(about, reflect=True)


def test_values_that_do_not_vary_have_no_density(lai):
    with pytest.raises(ValueError, match="needs values that vary"):
        fifesim.density(lai * 0)


def test_cells_that_lack_one_band_count_in_neither(lai):
    """A gap in red alone changes the prediction as a gap in both bands does."""
    one = cube(lai).copy(deep=True)
    both = one.copy(deep=True)
    one[0, 0, 0] = both[:, 0, 0] = np.nan
    xr.testing.assert_equal(fifesim.ndvi_bias(one), fifesim.ndvi_bias(both))
    assert np.isfinite(fifesim.ndvi_bias(one)[0, 0])


def test_bias_has_the_units_of_its_algorithm(lai):
    def squared(array):
        return (array**2).assign_attrs(units="m4 m-4")

    assert fifesim.scale_bias(squared, lai)["bias"].attrs["units"] == "m4 m-4"


@pytest.mark.parametrize(
    ("numbers", "message"),
    [((-0.57, 0.94), "extinction must be positive"), ((0.57, 94), r"fpar_inf must be in \(0, 1\]")],
)
def test_impossible_beer_laws_are_refused(lai, numbers, message):
    with pytest.raises(ValueError, match=message):
        fifesim.fpar_bias(lai, *numbers)


def test_density_takes_any_dimensions(lai):
    """Counts do not know how the values are laid out."""
    whole = fifesim.density(lai, points=50)
    line = lai.stack(cell=("y", "x")).drop_vars(["cell", "y", "x", "spatial_ref"])
    for array in (line, line.chunk(cell=1000), lai.expand_dims(band=1).chunk(y=7), lai.T):
        np.testing.assert_allclose(fifesim.density(array, points=50), whole, rtol=1e-12)


def test_linearity_of_rasters_is_that_of_their_values(lai):
    red, nir = cube(lai).values
    for chunks in ({}, ODD_CHUNKS):
        found = fifesim.ndvi_linearity(in_chunks(cube(lai), chunks))
        assert found == pytest.approx(scaling.linearity_correlation(red, nir), rel=1e-9)
