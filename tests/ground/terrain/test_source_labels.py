"""Tests of elevation models of any unit, orientation and CRS, and of their spline interpolation and filled gaps."""

import re
import warnings

import numpy as np
import pyproj
import pytest
import rasterio
import rioxarray
import xarray as xr
from affine import Affine
from elevations import AMPLITUDE, CRS, NORTH, WEST, grid, model, surface, tilted, truth, write
from lazy import check_place, no_compute
from scipy import ndimage

import fifesim
from fifesim.grids import cf, projection
from fifesim.grids import grid as grids
from fifesim.grids.opening import RasterFile
from fifesim.ground.terrain import spline
from fifesim.ground.terrain.elevation_labels import source_dem
from fifesim.ground.terrain.source_labels import beside_altitude, source_resolution


def test_spline_agrees_with_scipy():
    values = np.random.default_rng(0).standard_normal((70, 60))
    coefficients = spline.spline_coefficients(values)
    y, x = np.linspace(10, 50, 31), np.linspace(20, 40, 17)
    points = np.meshgrid(y, x, indexing="ij")
    expected = ndimage.map_coordinates(values, points, order=5, mode="mirror")
    np.testing.assert_allclose(spline.spline_grid(coefficients, y, x), expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(spline.spline_points(coefficients, *points), spline.spline_grid(coefficients, y, x))


def test_values_beyond_the_margin_have_no_effect():
    """They are weighted by 0.431**32 = 2e-12."""
    values = np.random.default_rng(1).standard_normal((200, 200))
    whole = spline.spline_coefficients(values)
    part = spline.spline_coefficients(values[50:150, 50:150])
    inside = slice(spline.SPLINE_MARGIN, -spline.SPLINE_MARGIN)
    np.testing.assert_allclose(part[inside, inside], whole[50:150, 50:150][inside, inside], rtol=0, atol=1e-10)


def test_filled_hole_is_smooth_wherever_it_is():
    """Within 2 % of the amplitude of waves of four holes; also with one known cell between the hole and a border."""
    rows, columns = np.mgrid[:40, :50]
    values = np.sin(rows / 5) + np.cos(columns / 7)
    for row, column in ((1, 20), (36, 20), (18, 1), (18, 46), (18, 20)):
        known = values.copy()
        known[row : row + 3, column : column + 3] = np.nan
        filled = spline.fill_gaps(known, (2, 2))
        np.testing.assert_allclose(filled, values, rtol=0, atol=0.02)
        for axis in (0, 1):
            turned = np.flip(spline.fill_gaps(np.flip(known, axis), (2, 2)), axis)
            np.testing.assert_allclose(turned, filled, rtol=0, atol=1e-9)


def test_only_the_edge_of_large_holes_is_filled():
    known = np.add.outer(-2.0 * np.arange(80), 3.0 * np.arange(90))
    known[20:60, 20:60] = np.nan
    out = spline.fill_gaps(known, (3, 3))
    assert np.isnan(out[23:57, 23:57]).all()
    assert np.isfinite(out[20:23, 20:60]).all()
    assert np.isfinite(spline.extend(known, 2)).all()


@pytest.mark.parametrize("unit", ["ft", "US survey foot", "fathom"])
def test_units_other_than_metres_must_be_given(tmp_path, unit):
    values, affine = model()
    where = write(tmp_path / "feet.tif", values / 0.3048, affine, unit=unit)
    with pytest.raises(ValueError, match=rf"in '{unit}', not in metres: give their units.*vertical_units"):
        fifesim.fine_dem(where, grid())
    dem = fifesim.fine_dem(where, grid(), vertical_units="ft")
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-3 * AMPLITUDE)


def test_vertical_units_of_a_compound_crs(tmp_path):
    """NAD83 / UTM 14N with NAVD88 heights in US survey feet, and in metres."""
    values, affine = model()
    feet = write(tmp_path / "feet.tif", values / (1200 / 3937), affine, "EPSG:26914+6360")
    with pytest.raises(ValueError, match="US survey foot"):
        fifesim.fine_dem(feet, grid())
    same = fifesim.fine_dem(write(tmp_path / "metres.tif", values, affine, "EPSG:26914+5703"), grid())
    np.testing.assert_allclose(fifesim.fine_dem(feet, grid(), vertical_units="us-ft"), same, rtol=0, atol=1e-9)


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
@pytest.mark.parametrize(
    "affine",
    [
        Affine(30, 0, WEST - 600, 0, 30, NORTH - 1500),
        Affine(-30, 0, WEST + 1500, 0, -30, NORTH + 600),
        Affine.translation(WEST - 900, NORTH + 900) @ Affine.rotation(0) @ Affine(30, 2, 0, 1, -30, 0),
    ],
    ids=["south-up", "west-right", "rotated"],
)
def test_source_may_have_any_orientation(tmp_path, affine):
    values, _ = model(affine=affine, shape=(100, 100) if affine.b else (70, 70))
    dem = fifesim.fine_dem(write(tmp_path / "turned.tif", values, affine), grid())
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1.5e-3 * AMPLITUDE)


def test_change_of_datum_from_nad27_to_nad83(path):
    """Equal degrees are 30 m apart in both datums; the reference is the transformation by PROJ."""
    # The transformation is accurate to 11 m. On slopes of 0.36 at most, 1 cm of height is 3 cm of position.
    old = fifesim.grid_at("EPSG:26714", WEST + 30, NORTH - 210, 500, 500, 10.0)
    dem = fifesim.fine_dem(path, old)
    pipeline = projection.operation("EPSG:26714", CRS, projection.degrees(old))
    x, y = projection.carry(pipeline, "EPSG:26714", CRS, *np.meshgrid(dem["x"], dem["y"]))
    np.testing.assert_allclose(dem, surface(x, y), rtol=0, atol=1e-3 * AMPLITUDE)


def test_source_in_degrees(tmp_path):
    """The same surface on a lattice in degrees, with coordinates transformed by PROJ."""
    to_degrees = pyproj.Transformer.from_crs(CRS, "EPSG:4269", always_xy=True)
    back = pyproj.Transformer.from_crs("EPSG:4269", CRS, always_xy=True)
    west, north = to_degrees.transform(WEST - 600, NORTH + 600)
    affine = Affine(3e-4, 0, west, 0, -2.4e-4, north)
    values, _ = model(lambda x, y: surface(*back.transform(x, y)), affine=affine, shape=(90, 90))
    dem = fifesim.fine_dem(write(tmp_path / "degrees.tif", values, affine, "EPSG:4269"), grid())
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-3 * AMPLITUDE)
    assert dem.attrs["source_resolution"] == pytest.approx((3e-4 * 86500 + 2.4e-4 * 111000) / 2, rel=0.01)


def test_only_the_part_of_a_file_near_the_grid_is_read(tmp_path, monkeypatch):
    """A sparse file of 20,000 x 20,000 cells (1.6 GB) with data around the grid."""
    where, corner, count, read = tmp_path / "continent.tif", 9984, 20_000, []
    values, affine = model(margin=1500.0)
    affine = affine @ Affine.translation(-corner, -corner)
    profile = {"driver": "GTiff", "width": count, "height": count, "count": 1, "dtype": "float32", "nodata": -9999.0}
    with rasterio.open(where, "w", crs=CRS, transform=affine, tiled=True, sparse_ok=True, **profile) as file:
        file.write(values.astype("f4"), 1, window=rasterio.windows.Window(corner, corner, *values.shape[::-1]))
    windows = RasterFile.read
    monkeypatch.setattr(RasterFile, "read", lambda *given: read.extend(given[2:]) or windows(*given))
    fifesim.fine_dem(where, grid(), chunks="auto").compute()
    source_dem(where, grid(), 900.0)
    # In cells of the model: tiles of a margin of 30 have 504, and the spline needs 37 on each side.
    first, around = corner + 1500 // 30, 30 + 504 + 37
    assert min(part.start for part in read) > first - around and max(part.stop for part in read) < first + 30 + around


def test_sources_far_finer_than_the_grid_are_refused(path, monkeypatch):
    monkeypatch.setattr("fifesim.grids.source._MOST_CELLS", 100)
    with pytest.raises(ValueError, match=r"far finer than the cells.*gdalwarp -r average"):
        fifesim.fine_dem(path, grid(size=600.0))


def test_finer_source_is_averaged(tmp_path):
    """A wave of two cells of the source is removed, and the mean of the surface is kept."""
    values, affine = model(cell=10.0)
    ripple = 5.0 * (-1.0) ** np.arange(values.shape[1])
    dem = fifesim.fine_dem(write(tmp_path / "fine.tif", values + ripple, affine), grid(40.0, size=880.0))
    assert dem.attrs["source_resolution"] == pytest.approx(40)
    expected = fifesim.fine_dem(write(tmp_path / "smooth.tif", values, affine), grid(40.0, size=880.0))
    np.testing.assert_allclose(dem, expected, rtol=0, atol=1e-9)
    # Means over 40 m have 0.9 of the amplitude of waves of 160 m.
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=0.1 * 2 + 0.05 * 4 + 0.2)


def test_band_limited_surface_is_recovered(path):
    dem = fifesim.fine_dem(path, grid())
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-3 * AMPLITUDE)
    check_place(dem, CRS)
    assert cf.attributes("dem").items() <= dem.attrs.items()
    assert dem.attrs["source_resolution"] == pytest.approx(30)


@pytest.mark.parametrize("cell", [30 / 9, 45.0])
@pytest.mark.parametrize("margin", [0.0, 600.0])
@pytest.mark.parametrize("method", ["lowpass", "linear"])
def test_plane_is_exact(tmp_path, cell, margin, method):
    """Also at the outer edge of the outermost cells of the source, and for sources finer than the grid."""
    where = write(tmp_path / "plane.tif", *model(tilted, margin=margin))
    dem = fifesim.fine_dem(where, grid(cell), method=method)
    np.testing.assert_allclose(dem, truth(dem, tilted), rtol=0, atol=1e-8)


@pytest.mark.parametrize("crs", [CRS, "EPSG:32614"])
def test_linear_interpolation_has_no_overshoot_and_lowpass_at_most_13_percent(tmp_path, crs):
    """A corner of 0, 5 and 10 m, also where rows are not parallel to the grid, and in chunks."""
    values, affine = model()
    values = np.add.outer(*(5.0 * (np.arange(size) > size // 2) for size in values.shape))
    where = write(tmp_path / "step.tif", values, affine, crs)
    lowpass, linear = (
        fifesim.fine_dem(where, grid(), method=method, vertical_units="m") for method in ("lowpass", "linear")
    )
    assert -1.3 < float(lowpass.min()) < -1.1 and 11.1 < float(lowpass.max()) < 11.3
    assert float(linear.min()) >= -1e-14 and float(linear.max()) <= 10 + 1e-14
    assert float(abs(linear - lowpass).mean()) < 0.1
    lazy = fifesim.fine_dem(where, grid(), method="linear", vertical_units="m", chunks={"y": 31, "x": 77})
    xr.testing.assert_identical(lazy.compute(), linear)


@pytest.mark.parametrize("chunks", [{"y": 100, "x": 77}, "auto"])
@pytest.mark.parametrize("options", [None, {}, {"masked": True, "chunks": {"y": 17, "x": 40}}])
def test_fine_dem_has_the_same_bits_in_chunks_and_windows(path, chunks, options):
    """From a file, and from arrays in memory or in chunks, masked or not, with rows in either order."""
    source = path if options is None else rioxarray.open_rasterio(path, **options)
    whole = fifesim.fine_dem(path if options is None else source.compute(), grid())
    with no_compute():
        lazy = fifesim.fine_dem(source, grid(), chunks=chunks)
    assert lazy.chunks is not None
    xr.testing.assert_identical(lazy.compute(), whole)
    xr.testing.assert_equal(fifesim.fine_dem(source, grid()[37:150, 11:112]), whole[37:150, 11:112])
    np.testing.assert_allclose(whole, fifesim.fine_dem(path, grid()), rtol=0, atol=1e-9)
    if options is not None:
        upside_down = fifesim.fine_dem(source.sortby("y").squeeze("band"), grid())
        np.testing.assert_allclose(upside_down, whole, rtol=0, atol=1e-6)


def test_source_dem_has_a_margin_around_the_grid(path):
    """Cells of about the source's size; the corner of the grid is a corner of these cells."""
    dem, reach = source_dem(path, grid(), 450.0)
    assert dem.odc.geobox.affine == Affine(30, 0, WEST - 450, 0, -30, NORTH + 450)
    assert dem.shape == (60, 60)
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=1e-6)
    assert reach == {"north": 450, "east": 450, "south": 450, "west": 450}
    check_place(dem, CRS)
    assert dem.attrs["source_resolution"] == pytest.approx(30)


def test_source_dem_ends_at_the_edge_of_its_data_with_the_same_bits_in_chunks(tmp_path):
    values, affine = model()
    values[:, :15], values[3, 40] = np.nan, np.nan
    for crs, fill, chunks in (("EPSG:32614", None, "auto"), (CRS, 60.0, {"y": 31, "x": 27})):
        where = write(tmp_path / "cut.tif", values, affine, crs)
        whole, reach = source_dem(where, grid(), 6000.0, fill=fill)
        with no_compute():
            lazy, same_reach = source_dem(where, grid(), 6000.0, fill=fill, chunks=chunks)
        assert lazy.chunks is not None and reach == same_reach
        xr.testing.assert_identical(lazy.compute(), whole)
    dem, reach = source_dem(write(tmp_path / "cut.tif", values, affine), grid(), 6000.0)
    assert reach == {"north": 480, "east": 600, "south": 600, "west": 150}
    assert dem.odc.geobox.affine == Affine(30, 0, WEST - 150, 0, -30, NORTH + 600)
    assert dem.shape == (70, 55) and int(dem.isnull().sum()) == 1
    # A hole east of a tall grid, in the eighth column and in the lower rows of the grid.
    values, affine = model()
    values[45, 37] = np.nan
    tall = fifesim.grid_at(CRS, WEST, NORTH, 300.0, 900.0, 30 / 9)
    _, reach = source_dem(write(tmp_path / "hole.tif", values, affine), tall, 600.0)
    assert reach == {"north": 600, "east": 210, "south": 600, "west": 600}


@pytest.mark.filterwarnings("error::UserWarning")
@pytest.mark.parametrize("east", [0, 90e3])
def test_plausible_elevations_cause_no_warning(east):
    """Given units, hills of three times the relief, and a coast, where elevations pass through 0."""
    dem = fifesim.flint_hills(fifesim.fife_site(30, window=((0, 100), (0, 100))), seed=7)
    there = fifesim.grid_at(CRS, WEST + east + 600, NORTH - 600, 300, 300, 10)
    own = fifesim.grid_at(CRS, WEST + east, NORTH, 3000, 3000, 30)
    dem = grids.place(dem.drop_vars(["x", "y", "spatial_ref"]), own).rename("dem")
    fine = fifesim.fine_dem(dem, there)
    for unit, factor in (("ft", 1 / 0.3048), ("dm", 10), ("km", 1e-3)):
        np.testing.assert_allclose(fifesim.fine_dem(factor * dem, there, vertical_units=unit), fine, rtol=1e-9)
    steep = fifesim.fine_dem(dem.mean() + 3 * (dem - dem.mean()), there)
    np.testing.assert_allclose(steep.std(), 3 * fine.std(), rtol=1e-6)
    coast = fifesim.fine_dem(dem - float(dem[25, 25]), there)
    np.testing.assert_allclose(coast, fine - float(dem[25, 25]), rtol=0, atol=1e-9)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("step", ["slope", "aspect", "sky_view", "horizon", "wetness", "terrain_view"])
def test_elevation_may_be_of_integers(dem, step):
    """Cells of 0 m next to the sea; unsigned integers must not wrap around."""
    whole = dem.round().assign_attrs(dem.attrs)
    whole[3:5, 7] = 0.0
    low = (whole - 300).clip(0, 255).assign_attrs(dem.attrs)
    for exact, dtype in ((whole, "int16"), (whole, "uint16"), (low, "uint8"), (whole, "float32")):
        narrow, expected = exact.astype(dtype).assign_attrs(dem.attrs), getattr(exact.fifesim, step)()
        for given in (narrow, narrow.chunk({"y": 17, "x": 20})):
            np.testing.assert_array_equal(getattr(given.fifesim, step)(), expected, dtype)


def test_source_resolution_is_the_argument_or_the_attribute_or_the_cell_size(dem):
    oblong = grids.place(dem[:4, :4], fifesim.grid_at(CRS, 7e5, 4.33e6, 120, 80, (20, 30)))
    assert [source_resolution(oblong), source_resolution(oblong, 12.5)] == [20, 12.5]
    known = oblong.assign_attrs(source_resolution=10.0)
    assert [source_resolution(known), source_resolution(known, 12.5)] == [10, 12.5]
    assert source_resolution(fifesim.flint_hills(fifesim.fife_site(10)[:4, :4])) == 30
    with pytest.raises(ValueError, match="must be positive metres"):
        source_resolution(dem, np.inf)


@pytest.mark.parametrize(
    ("low", "high", "altitude", "message"),
    [
        (1239, 1393, 0.4, r"1239 to 1393 m beside .* of 0.4 km: .* feet, take dem .*Atmosphere.altitude=1.3"),
        (0.31, 0.45, 0.4, r"0.31.* to 0.45 m .* kilometres, take dem \* 1000 "),
        (3100, 4500, 0.4, r"decimetres, take dem \* 0.1 "),
        (0.0, 5.0, 0.4, None),
        (2500, 3100, 1.5, "1.5 km: give fifesim.Atmosphere.altitude=2.8"),
        (0, 100, 2.0, "2 km: give fifesim.Atmosphere.altitude=0.1"),
        (300, 2000, 0.4, None),
        (-50, 120, 0.0, None),
    ],
)
def test_elevation_that_disagrees_with_the_altitude_causes_a_warning(site, low, high, altitude, message):
    """For lazy elevation when it is computed."""
    cells = np.linspace(low, high, site.shape.y * site.shape.x).reshape(site.shape)
    cells[0, 0] = np.nan
    dem = grids.place(xr.DataArray(cells, dims=("y", "x")), site)
    for given in (dem, dem.chunk()):
        with warnings.catch_warnings(record=True, action="always", category=UserWarning) as caught:
            np.testing.assert_array_equal(beside_altitude(given, altitude).compute(scheduler="synchronous"), cells)
        found = [str(each.message) for each in caught]
        assert bool(found) == bool(message) and all(re.search(message, each) for each in found), found


@pytest.mark.parametrize(
    ("east", "south", "lacking"),
    [(700, 900, {"south": 300, "east": 100}), (-700, -800, {"north": 200, "west": 100}), (650, 0, {"east": 50})],
)
def test_message_for_a_model_that_ends_within_the_grid_has_distances_and_the_covered_area(path, east, south, lacking):
    """The model covers the area in the message, but not 30 m more."""
    with pytest.raises(ValueError, match=r"lacks up to .* it covers west=") as error:
        fifesim.fine_dem(path, grid(west=WEST + east, north=NORTH - south))
    found = dict((side, float(metres)) for metres, side in re.findall(r"(\d+) m in the (\w+)", str(error.value)))
    assert found == {side: pytest.approx(metres, abs=20) for side, metres in lacking.items()}
    found = re.search(r"west=(\S+), north=(\S+), width=(\S+), height=(\S+?)(;|$)", str(error.value)).groups()[:4]
    west, north, width, height = map(float, found)
    dem = fifesim.fine_dem(path, fifesim.grid_at("EPSG:26914", west, north, width, height, 30 / 9))
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=0.1 * AMPLITUDE)
    more = west if east > 0 else west - 30
    with pytest.raises(ValueError, match="does not cover"):
        fifesim.fine_dem(path, fifesim.grid_at("EPSG:26914", more, north, width + 30, height, 30 / 9))


def test_terraces_cause_a_warning(tmp_path, path):
    """A plane that rises by 2 m from cell to cell has none."""
    with pytest.warns(UserWarning, match="vertical resolution of 1 m") as caught:
        values, affine = model(lambda x, y: np.rint(tilted(x, y) / 10))
        fifesim.fine_dem(write(tmp_path / "steps.tif", values, affine), grid())
    assert sum("terraces" in str(each.message) for each in caught) == 1
    with warnings.catch_warnings(action="error", category=UserWarning):
        fifesim.fine_dem(path, grid())
        for axis in (0, 1):
            fifesim.fine_dem(write(tmp_path / "plane.tif", 300.0 + 2 * np.indices(values.shape)[axis], affine), grid())
