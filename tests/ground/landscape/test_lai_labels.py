"""Tests of leaf area rasters: labels, laziness, values of the kernels, and maps of other quantities or scales."""

import warnings

import numpy as np
import pytest
import rasterio
import rioxarray
import xarray as xr
from elevations import write
from lazy import ODD_CHUNKS, check_place, no_compute

import fifesim
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.ground.landscape.autoregression import streaming_field
from fifesim.ground.landscape.distribution import lai_distribution, quantile_map, quantile_table


def test_scene_is_the_field_mapped_to_the_distribution_with_labels_and_georeferencing(site, lai):
    field = streaming_field(7, 0.15, *grids.lattice_position(site), tuple(site.shape))
    for name in ("burned-grazed", "unburned-ungrazed"):
        scene = fifesim.lai_scene(site, name, arp=0.15, seed=7)
        np.testing.assert_array_equal(scene, quantile_map(field, quantile_table(lai_distribution(name))))
    check_place(lai, site.crs)
    assert lai.name == "lai" and cf.attributes("lai").items() <= lai.attrs.items()
    assert lai.attrs["arp"] == 0.15 and lai.attrs["rng_seed"] == "7"
    assert lai.attrs["lai_distribution"] == "burned-grazed" and lai.attrs["method"] == "streaming"
    assert grids.same_grid(grids.geobox(lai), site)


@pytest.mark.parametrize("chunks", [ODD_CHUNKS, 20, "auto", {"y": -1}])
def test_scene_has_the_same_bits_in_any_chunks(site, lai, chunks):
    with no_compute():
        lazy = fifesim.lai_scene(site, "burned-grazed", arp=0.15, seed=7, chunks=chunks)
    assert lazy.chunks is not None
    xr.testing.assert_identical(lazy.compute(), lai)
    whole = fifesim.lai_scene(site, method="periodic", seed=3)
    xr.testing.assert_identical(fifesim.lai_scene(site, method="periodic", seed=3, chunks=chunks).compute(), whole)


def test_window_of_the_site_equals_a_slice(lai):
    larger = fifesim.lai_scene(fifesim.fife_site(30 / 9, window=((80, 140), (170, 240))), arp=0.15, seed=7)
    xr.testing.assert_identical(larger[10:55, 10:64].assign_coords(spatial_ref=lai["spatial_ref"]), lai)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"method": "fft"}, "method must be 'streaming' or 'periodic', got 'fft'"),
        ({"arp": 0.24999, "chunks": 10}, "arp of the streaming field must be in"),
        ({"chunks": {"band": 1}}, "y and x"),
    ],
)
def test_impossible_lai_scenes_are_refused(site, options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.lai_scene(site, **options)


def test_scene_too_large_for_memory_names_the_streaming_method():
    grid = fifesim.grid_at("EPSG:26914", 3e5, 5e6, 4e5, 4e5, 0.1)
    with pytest.raises(ValueError, match=r"needs .* GB of memory.*method=\"streaming\""):
        fifesim.lai_scene(grid, method="periodic")


def test_map_has_labels_and_its_range_is_checked(tmp_path, site):
    values = np.random.default_rng(1).uniform(0, 4, site.shape)
    values[3, 4] = np.nan
    lai = fifesim.open_lai(write(tmp_path / "lai.tif", values, site.affine), site)
    check_place(lai, site.crs)
    assert (lai.name, lai.attrs["lai_distribution"]) == ("lai", "lai.tif")
    np.testing.assert_array_equal(lai, values)
    negative = write(tmp_path / "negative.tif", values - 2.5, site.affine)
    with pytest.raises(ValueError, match="negative"):
        fifesim.open_lai(negative, site)
    with no_compute():
        lazy = fifesim.open_lai(negative, site, chunks=50)
    with pytest.raises(ValueError, match="negative"):
        lazy.compute()


def test_map_with_another_scale_or_without_data_is_refused_with_the_remedy(tmp_path, site):
    values = np.full(site.shape, 35.0)
    with pytest.raises(ValueError, match=r"up to 35, canopies have at most 20: .* type lai \* 0.1, or gdal_edit"):
        fifesim.open_lai(write(tmp_path / "modis.tif", values, site.affine), site)
    with pytest.raises(ValueError, match=r"none.tif has no data on the grid.*nodata"):
        fifesim.open_lai(write(tmp_path / "none.tif", np.full(site.shape, np.nan), site.affine), site)


def test_open_raster_equals_its_file(tmp_path, site):
    path = write(tmp_path / "lai.tif", np.random.default_rng(1).uniform(0, 4, site.shape), site.affine)
    opened = rioxarray.open_rasterio(path, masked=True)
    xr.testing.assert_equal(fifesim.open_lai(opened, site), fifesim.open_lai(path, site))
    modis = xr.full_like(opened, 35, dtype=np.uint8).assign_attrs({"scale_factor": 0.1, "_FillValue": 255})
    modis[0, 0, 0] = 255
    lai = fifesim.open_lai(modis, site)
    assert np.isnan(lai[0, 0]) and np.allclose(lai[1:], 3.5, rtol=1e-15, atol=0)
    with pytest.raises(ValueError, match="has 2 bands, and not exactly one"):
        fifesim.open_lai(xr.concat([opened, opened], "band"), site)


MAP = fifesim.fife_site(10, window=((0, 60), (0, 60)))
WEST = fifesim.fife_site(5, window=((0, 120), (0, 60)))


def map_of(values=2.0, **attrs):
    cells = np.broadcast_to(np.asarray(values), MAP.shape).copy()
    return grids.place(xr.DataArray(cells, dims=("y", "x"), attrs=attrs), MAP)


@pytest.mark.parametrize("fill", [-1.0, -9999.0, 255.0, 32767.0])
@pytest.mark.parametrize("form", ["file", "array", "lazy"])
def test_undeclared_fill_values_next_to_the_grid_are_refused(tmp_path, fill, form):
    """If -1 was interpolated with 2, the first column outside would give 1.25 at the edge of the grid."""
    values = np.full(MAP.shape, 2.0)
    values[20:25, 30:] = fill
    path = write(tmp_path / "map.tif", values, MAP.affine, nodata=None)
    given = path if form == "file" else map_of(values)
    chunks = 25 if form == "lazy" else None
    with pytest.raises(ValueError, match=rf"on the grid or next to it: .*got {fill:g} |up to {fill:g}, .*-a_nodata"):
        fifesim.open_lai(given, WEST, chunks=chunks).compute()
    declared = map_of(values).rio.write_nodata(fill)
    assert float(abs(fifesim.open_lai(declared, WEST, chunks=chunks) - 2.0).max()) == 0
    values[20:25, 30:40] = 2.0
    assert float(abs(fifesim.open_lai(map_of(values), WEST, chunks=chunks) - 2.0).max()) == 0


@pytest.mark.parametrize(
    ("name", "attrs", "message"),
    [
        ("ndvi", {}, "ndvi is (named 'ndvi'|normalized .* by its name), where leaf area index is needed"),
        ("NDVI_2020", {}, "NDVI_2020 is (named 'NDVI_2020'|normalized .* by its name), where"),
        (None, {"long_name": "MOD15A2H Fpar_500m"}, "named 'MOD15A2H Fpar_500m'"),
        ("b1", {"standard_name": "surface_altitude"}, "named 'surface_altitude'"),
        ("b1", {"long_name": "Surface reflectance band 4"}, "named 'Surface reflectance band 4'"),
        ("FparLai_QC", {"long_name": "quality flags of LAI"}, "named 'FparLai_QC'|named 'quality flags of LAI'"),
        ("b1", {"units": "%"}, "has units '%', where leaf area index is needed, in '1'"),
    ],
)
def test_map_with_the_name_of_another_quantity_is_refused(tmp_path, name, attrs, message):
    given = map_of(**attrs).rename(name)
    with pytest.raises(ValueError, match=message):
        fifesim.open_lai(given, WEST)
    if "units" not in attrs and "standard_name" not in attrs:
        with pytest.raises(ValueError, match=message):
            given.fifesim.fpar(geometry=fifesim.Geometry(30, 120))
        path = write(tmp_path / "map.tif", given.values, MAP.affine)
        with rasterio.open(path, "r+") as file:
            file.set_band_description(1, attrs.get("long_name", name))
        with pytest.raises(ValueError, match=r"map\.tif is named"):
            fifesim.open_lai(path, WEST)


@pytest.mark.parametrize("name", ["lai", "Lai_500m", "Leaf area index", "b1", "MOD15A2H Fpar and Lai", None])
def test_map_with_a_name_of_leaf_area_or_none_is_accepted(name):
    with warnings.catch_warnings(action="error", category=UserWarning):
        found = fifesim.open_lai(map_of(long_name=str(name), units="m2 m-2").rename(name), WEST)
    assert found.name == "lai" and found.notnull().any()


def test_integers_without_a_scale_cause_a_warning(tmp_path):
    counts = map_of(np.full(MAP.shape, 4, np.int16))
    path = tmp_path / "counts.tif"
    counts.rio.to_raster(path)
    for given, name in ((counts, "the raster"), (path, "counts.tif")):
        with pytest.warns(UserWarning, match=f"{name} holds integers without a scale.*scale_factor=0.1.*-a_scale 0.1"):
            fifesim.open_lai(given, WEST)
    with warnings.catch_warnings(action="error", category=UserWarning):
        assert float(fifesim.open_lai(counts.assign_attrs(scale_factor=0.5), WEST).mean()) == 2


def test_leaf_area_in_tenths_causes_a_warning():
    """Also for lazy maps, when they are computed."""
    tenths = map_of(np.linspace(0, 18, 3600).reshape(MAP.shape))
    known = {"geometry": fifesim.Geometry(30, 120)}
    lazy = fifesim.open_lai(tenths, MAP, chunks=60)
    for function in (lambda: fifesim.open_lai(tenths, MAP), lazy.compute, lambda: tenths.fifesim.fpar(**known)):
        with pytest.warns(UserWarning, match=r"mean leaf area index is 9, dense.*such as lai \* 0\.1"):
            function()
    with warnings.catch_warnings(action="error", category=UserWarning):
        fifesim.open_lai(tenths * 0.1, MAP)
        (tenths * 0.1).fifesim.fpar(**known)
