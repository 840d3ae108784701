"""Tests of LAI scenes and maps: the random field, distributions of leaf area, labels, chunks, and fill values."""

import numpy as np
import pandas as pd
import pytest
import rioxarray
import xarray as xr
from elevations import write
from lazy import ODD_CHUNKS, check_place, no_compute
from scipy import integrate, stats

import fifesim
from fifesim.base import files
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.ground.landscape.autoregression import (
    FIELD_TILE,
    LARGEST_STREAMING_ARP,
    autocorrelation,
    field_seed,
    margin,
    periodic_field,
    streaming_field,
    white_noise,
    window_field,
)
from fifesim.ground.landscape.distribution import (
    QUANTILE_NODES,
    kernel_density,
    lai_distribution,
    quantile_map,
    quantile_map_of_classes,
    quantile_table,
)


def test_correlation_length_has_a_correlation_of_5_percent_and_inverts_arp_for_length():
    """Correlation lengths of whole numbers of cells need no interpolation."""
    for cells in (1, 2, 5, 9, 20):
        assert autocorrelation(fifesim.ground.arp_for_length(cells), cells) == pytest.approx(0.05, abs=1e-9)
    arps = np.array([0.001, 0.05, 0.15, 0.24, 0.249, LARGEST_STREAMING_ARP])
    for cell in (1.0, 10 / 3):
        lengths = [fifesim.ground.correlation_length(arp, cell) for arp in arps]
        assert np.all(np.diff(lengths) > 0)
        found = [fifesim.ground.arp_for_length(length, cell) for length in lengths]
        np.testing.assert_allclose(found, arps, rtol=1e-9)
    assert fifesim.ground.correlation_length(0.0) == fifesim.ground.arp_for_length(0.0) == 0.0


def test_response_has_decayed_at_the_margin():
    """Response to a unit impulse along a row at frequency zero of the other axis, by an inverse FFT."""
    for arp in (0.05, 0.15, 0.24):
        cells = margin(arp)
        impulse = np.fft.ifft(1 / (1 - 2 * arp * (1 + np.cos(2 * np.pi * np.fft.fftfreq(4096))))).real
        assert impulse[cells] < 2e-8 * impulse[0]


@pytest.mark.parametrize("column", [-9, 0, 3, 2**33])
def test_noise_windows_equal_slices_at_any_column(column):
    whole = white_noise(2**63, -2, column, (6, 21))
    for skip in range(5):
        np.testing.assert_array_equal(white_noise(2**63, 0, column + skip, (3, 8)), whole[2:5, skip : skip + 8])


@pytest.mark.parametrize("arp", [0.0, 0.15, LARGEST_STREAMING_ARP])
def test_field_windows_equal_slices(arp):
    """Across the corner of four tiles, on both sides of the lattice's origin; also in one window without tiles."""
    whole = streaming_field(7, arp, -40, FIELD_TILE - 60, (100, 130))
    for row, column, height, width in [(39, 59, 3, 3), (40, 60, 1, 1), (99, 0, 1, 130), (7, 11, 60, 90)]:
        part = streaming_field(7, arp, row - 40, column + FIELD_TILE - 60, (height, width))
        np.testing.assert_array_equal(part, whole[row : row + height, column : column + width])
    if arp < 0.24:
        found = window_field(7, arp, -40, FIELD_TILE - 60, (100, 130))
        np.testing.assert_allclose(found, whole, rtol=0, atol=1e-5)


def test_seeds_and_names_give_uncorrelated_fields():
    """The last three seeds are equal if rounded to double precision."""
    seeds = (0, 1, 2**63 - 3, 2**63 - 2, 2**63 - 1)
    for fields in (
        [streaming_field(seed, 0.0, 0, 0, (400, 400)) for seed in seeds],
        [periodic_field(seed, 0.0, (400, 400)) for seed in seeds],
    ):
        correlations = np.corrcoef([field.ravel() for field in fields])
        np.testing.assert_allclose(correlations, np.eye(5), rtol=0, atol=4 / 400)
    seeds = {field_seed(seed, name) for seed in (0, 1) for name in ("lai", "soil", "moisture", "brown")}
    assert len(seeds) == 8
    assert field_seed(2**63 - 1, "lai") == 2**63 - 1


SAMPLES = np.random.default_rng(4).gamma(2.0, 0.5, 60)
ROWS = [pytest.param(row, id=row.treatment) for row in files.table("lai_distributions.csv").itertuples()]


@pytest.mark.parametrize("row", ROWS)
def test_treatments_have_the_tabulated_moments(row):
    """By quadrature of the density, to the digits of the table."""
    distribution = lai_distribution(row.treatment)

    def moment(function):
        return integrate.quad(lambda x: function(x) * distribution.pdf(x), row.lower, row.upper, epsabs=1e-12)[0]

    assert moment(lambda x: 1.0) == pytest.approx(1, abs=1e-10)
    mean = moment(lambda x: x)
    assert mean == pytest.approx(row.mean, abs=1e-8)
    assert np.sqrt(moment(lambda x: (x - mean) ** 2)) == pytest.approx(row.standard_deviation, abs=1e-8)


def test_kernel_density_agrees_with_scipy_reflected_at_zero():
    """Errors of quantiles from nodes at 1/8192 of the support: slope of the density times half the squared step."""
    x = np.linspace(0, 5, 50)
    plain, distribution = stats.gaussian_kde(SAMPLES), kernel_density(SAMPLES)
    np.testing.assert_allclose(distribution.pdf(x), plain(x) + plain(-x), rtol=1e-12)
    assert distribution.cdf(0.0) == distribution.cdf(-1.0) == distribution.pdf(-0.01) == 0
    assert integrate.quad(distribution.pdf, 0, distribution.support()[1], limit=200)[0] == pytest.approx(1, abs=1e-9)
    for at in (0.1, 1.0, 2.0):
        assert distribution.cdf(at) == pytest.approx(integrate.quad(distribution.pdf, 0, at)[0], abs=1e-10)
    q = np.array([1e-9, 1e-4, 0.1, 0.5, 0.9, 0.9999, 1 - 1e-9])
    np.testing.assert_allclose(distribution.cdf(distribution.ppf(q)), q, rtol=0, atol=1e-6)
    np.testing.assert_allclose(distribution.sf(distribution.isf(1 - q)), 1 - q, rtol=0, atol=1e-6)


def test_samples_are_read_from_csv_files_and_kept_by_content(tmp_path):
    """Equal samples share one distribution, by which tables are cached, whatever the file; a changed file does not."""
    several, one, gaps, bare = (tmp_path / name for name in ("several.csv", "one.CSV", "gaps.csv", "bare.csv"))
    pd.DataFrame({"plot": range(60), "lai": SAMPLES}).to_csv(several, index=False)
    pd.DataFrame({"anything": SAMPLES}).to_csv(one, index=False)
    gaps.write_text(several.read_text() + "60,\n61,NA\n")
    for path in (several, str(several), one, gaps):
        assert lai_distribution(path).pdf(0.7) == pytest.approx(kernel_density(SAMPLES).pdf(0.7), rel=1e-9)
    first = lai_distribution(one)
    assert quantile_table(lai_distribution(several)) is quantile_table(first)
    bare.write_text(several.read_text() + "60,0.0\n")
    assert lai_distribution(bare).pdf(0.7) == pytest.approx(kernel_density([*SAMPLES, 0.0]).pdf(0.7), rel=1e-9)
    one.write_text("lai\n1\n2\n3\n4\n15.5\n")
    assert lai_distribution(one).support()[1] > first.support()[1]


def test_quantile_maps_keep_nan_and_the_ends_of_the_support():
    """The map of classes equals the map of each class."""
    rng = np.random.default_rng(2)
    field, numbers = rng.normal(size=(60, 70)), rng.integers(0, 3, (60, 70)).astype(np.int16)
    field[::7, ::5] = np.nan
    density = lai_distribution("burned-grazed")
    tables = np.stack([quantile_table(density), np.full(QUANTILE_NODES, 1.1), quantile_table(stats.uniform())])
    found = quantile_map_of_classes(field, numbers, tables)
    for number in (0, 2):
        cells = numbers == number
        np.testing.assert_array_equal(found[cells], quantile_map(field[cells], tables[number]))
    assert (found[numbers == 1] == 1.1).all()
    mapped = quantile_map(field, tables[2])
    np.testing.assert_array_equal(np.isnan(mapped), np.isnan(field))
    assert quantile_map(field, tables[2], out=field) is field
    np.testing.assert_array_equal(field, mapped)
    ends = quantile_map(np.array([[-40.0, -8.5, 8.5, 40.0]]), tables[0])[0]
    # Quantiles by scipy near the end of the support are accurate to a few units in the last place.
    assert (np.diff(ends) >= 0).all() and ends[0] >= 0 and ends[-1] <= density.support()[1] * (1 + 4e-15)


def test_scene_is_the_field_mapped_to_the_distribution_with_labels_and_georeferencing(site, lai):
    field = streaming_field(7, 0.15, *grids.lattice_position(site), tuple(site.shape))
    np.testing.assert_array_equal(lai, quantile_map(field, quantile_table(lai_distribution("burned-grazed"))))
    check_place(lai, site.crs)
    assert lai.name == "lai" and cf.attributes("lai").items() <= lai.attrs.items()
    assert lai.attrs["arp"] == 0.15 and lai.attrs["rng_seed"] == "7"
    assert lai.attrs["lai_distribution"] == "burned-grazed" and lai.attrs["method"] == "streaming"
    assert grids.same_grid(grids.geobox(lai), site)


@pytest.mark.parametrize("chunks", [ODD_CHUNKS, 20, "auto", {"y": -1}])
def test_scene_has_the_same_bits_in_any_chunks_and_windows(site, lai, chunks):
    with no_compute():
        lazy = fifesim.lai_scene(site, "burned-grazed", arp=0.15, seed=7, chunks=chunks)
    assert lazy.chunks is not None
    xr.testing.assert_identical(lazy.compute(), lai)
    whole = fifesim.lai_scene(site, method="periodic", seed=3)
    xr.testing.assert_identical(fifesim.lai_scene(site, method="periodic", seed=3, chunks=chunks).compute(), whole)
    larger = fifesim.lai_scene(fifesim.fife_site(30 / 9, window=((80, 140), (170, 240))), arp=0.15, seed=7)
    xr.testing.assert_identical(larger[10:55, 10:64].assign_coords(spatial_ref=lai["spatial_ref"]), lai)


def test_map_has_labels_and_its_range_is_checked(tmp_path, site):
    values = np.random.default_rng(1).uniform(0, 4, site.shape)
    values[3, 4] = np.nan
    path = write(tmp_path / "lai.tif", values, site.affine)
    lai, opened = fifesim.open_lai(path, site), rioxarray.open_rasterio(path, masked=True)
    check_place(lai, site.crs)
    assert (lai.name, lai.attrs["lai_distribution"]) == ("lai", "lai.tif")
    np.testing.assert_array_equal(lai, values)
    xr.testing.assert_equal(fifesim.open_lai(opened, site), lai)
    modis = xr.full_like(opened, 35, dtype=np.uint8).assign_attrs({"scale_factor": 0.1, "_FillValue": 255})
    modis[0, 0, 0] = 255
    scaled = fifesim.open_lai(modis, site)
    assert np.isnan(scaled[0, 0]) and np.allclose(scaled[1:], 3.5, rtol=1e-15, atol=0)
    with no_compute():
        lazy = fifesim.open_lai(write(tmp_path / "negative.tif", values - 2.5, site.affine), site, chunks=50)
    with pytest.raises(ValueError, match="negative"):
        lazy.compute()


@pytest.mark.filterwarnings("error::UserWarning")
@pytest.mark.parametrize("name", ["lai", "Lai_500m", "Leaf area index", "b1", "MOD15A2H Fpar and Lai", None])
def test_map_with_a_name_of_leaf_area_or_none_is_accepted(name, site, lai):
    named = lai.drop_attrs(deep=False).assign_attrs(long_name=str(name), units="m2 m-2").rename(name)
    np.testing.assert_array_equal(fifesim.open_lai(named, site), lai)
