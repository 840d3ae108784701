"""Files and rasters of users: safe formats, locations, bands, units and scales; names and provenance of results."""

import os
import re
import socket
import threading
import tomllib
import warnings
import zipfile
from pathlib import Path

import dask.array as da
import numpy as np
import pandas as pd
import pyproj
import pytest
import rasterio
import rasterio.shutil
import rasterio.vrt
import rioxarray
import xarray as xr
from affine import Affine
from lazy import no_compute
from rasterio.control import GroundControlPoint
from rasterio.enums import ColorInterp

import fifesim
from fifesim.grids import cf, opening
from fifesim.grids import grid as grids
from fifesim.grids.inputs import check_reflectance, in_micrometres, incoming, opened, unpacked
from fifesim.grids.opening import covering_grid

DATA = Path(__file__).parents[1] / "data"
FOREIGN = tomllib.loads((DATA / "foreign_rasters.toml").read_text(encoding="utf-8"))
GRID = fifesim.grid_at("EPSG:26914", 708000.0, 4332000.0, 240.0, 200.0, 10.0)
PLACED = Affine(10, 0, 707900, 0, -10, 4332100)
DOORS = [
    fifesim.open_image,
    lambda path, **options: fifesim.open_lai(path, GRID, **options),
    lambda path, **options: fifesim.fine_dem(path, GRID, **options),
]


def write(path, values=(3,), *, names=(), scales=1.0, offset=0.0, gcps=(), units=(), colours=None, **other):
    """Write a raster around the grid, of bands with one value each."""
    profile = {"driver": "GTiff", "width": 60, "height": 60, "dtype": "float32", "crs": "EPSG:26914"}
    profile |= {"transform": PLACED} | other
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(path, "w", count=len(values), **profile) as sink:
            if colours:
                sink.colorinterp = colours
            cells = np.broadcast_to(np.reshape(values, (-1, 1, 1)), (len(values), 60, 60))
            sink.write(cells.astype(profile["dtype"]))
            sink.scales, sink.offsets = (np.broadcast_to(each, len(values)).tolist() for each in (scales, offset))
            sink.descriptions, sink.units = names or [None] * len(values), units or [""] * len(values)
            if gcps:
                points = [GroundControlPoint(*each) for each in gcps]
                sink.gcps = points, rasterio.crs.CRS.from_epsg(26914)
    return path


def check_refused_everywhere(path, reason):
    """Check that each function that opens a raster rejects it in one line."""
    for door in DOORS:
        with pytest.raises(ValueError, match=reason) as said:
            door(path)
        assert len(str(said.value)) <= 500 and str(said.value).isprintable()


def write_mosaic(path, source, relative="0"):
    path.write_text(FOREIGN["templates"]["mosaic"].replace("SOURCE", source).replace("RELATIVE", relative))
    return str(path)


@pytest.fixture
def server():
    """An address and the list of requests received there."""
    asked = []
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def answer():
            while True:
                try:
                    caller, _ = listening.accept()
                except OSError:
                    return
                with caller:
                    asked.append(caller.recv(1000))
                    caller.send(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")

        threading.Thread(target=answer, daemon=True).start()
        yield f"http://127.0.0.1:{listening.getsockname()[1]}/x.tif", asked


def test_no_request_is_sent_unless_allowed(tmp_path, server):
    address, asked = server
    tms = FOREIGN["templates"]["server"].replace("ADDRESS", address)
    (tmp_path / "tms.tif").write_text(tms)
    beside = write(tmp_path / "beside.tif")
    (tmp_path / "beside.tif.msk").write_text(tms)
    mosaics = [
        write_mosaic(tmp_path / "curl.vrt", f"/vsicurl/{address}"),
        write_mosaic(tmp_path / "tms.vrt", "tms.tif", relative="1"),
        write_mosaic(tmp_path / "nested.vrt", "curl.vrt", relative="1"),
    ]
    virtual = [f"/vsicurl/{address}", f"/vsizip//vsicurl/{address}/a.tif", "/vsis3/bucket/a.tif"]
    for path in (address, tms, str(tmp_path / "tms.tif"), beside, *virtual, *mosaics):
        check_refused_everywhere(path, "allow_remote=True")
    assert not asked
    for number, door in enumerate(DOORS):
        with pytest.raises(ValueError, match="404"):
            door(address.replace("x.tif", f"{number}.tif"), allow_remote=True)
        assert len(asked) > number
    with opening.remote_allowed(), pytest.raises(ValueError, match="404"):
        opening.raster_file(address.replace("x.tif", "context.tif"))
    assert len(asked) > len(DOORS)
    with pytest.raises(ValueError, match="--allow-remote"):
        opening.raster_file(address)


def test_lazy_tasks_keep_the_permission(tmp_path):
    """Threads and workers do not see the context manager."""
    path = tmp_path / "warped.vrt"
    with rasterio.open(write(tmp_path / "a.tif")) as source, rasterio.vrt.WarpedVRT(source, crs="EPSG:26914") as warped:
        rasterio.shutil.copy(warped, path, driver="VRT")
    with pytest.raises(ValueError, match=r"warped\.vrt is a mosaic with 'VRTWarpedDataset', and is not opened"):
        fifesim.open_lai(path, GRID)
    with opening.remote_allowed():
        lazy = fifesim.open_lai(path, GRID, chunks=7), fifesim.open_image(path, chunks=7)
    assert all((each.compute(scheduler="threads") == 3).all() for each in lazy)


def test_local_mosaics_and_archives_are_opened(tmp_path):
    path = write(tmp_path / "a.tif")
    plain, packed = write_mosaic(tmp_path / "a.vrt", "a.tif", relative="1"), tmp_path / "a.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        archive.write(path, "a.tif")
    for each in (plain, write_mosaic(tmp_path / "b.vrt", plain), f"/vsizip/{packed}/a.tif"):
        assert (fifesim.open_lai(each, GRID) == 3).all() and (fifesim.open_image(each) == 3).all()


def test_mosaics_that_may_refer_elsewhere_are_rejected(tmp_path):
    (tmp_path / "a.tif").touch()
    for text in FOREIGN["mosaics"]["refused"]:
        (tmp_path / "a.vrt").write_text(text)
        assert opening.is_mosaic(tmp_path / "a.vrt")
        with pytest.raises(ValueError, match=r"^(with|of|whose) "):
            opening.mosaic_sources(tmp_path / "a.vrt")


def test_paths_that_are_no_regular_file_are_rejected_without_waiting(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    os.symlink(tmp_path / "loop", tmp_path / "loop")
    refused = {"pipe": "is a pipe: name a file", "loop": "symbolic links", "x" * 5000: "too long", "a\0.tif": "null"}
    refused |= {"": "is a folder", "/dev/zero": "is a device", "\x1b[2J.tif": r"\\x1b\[2J\.tif as a raster: no raster"}
    for path, reason in refused.items():
        check_refused_everywhere(tmp_path / path, reason)
    check_refused_everywhere(f"/vsizip/{tmp_path}/pipe/a.tif", "is a pipe")


def test_rasters_without_numbers_or_location_are_rejected(tmp_path):
    for number, given in enumerate(FOREIGN["odd"]):
        profile = {key: value for key, value in given.items() if key not in ("said", "none")}
        profile |= {"transform": Affine(*given["transform"])} if "transform" in given else {}
        profile |= dict.fromkeys(given.get("none", []))
        check_refused_everywhere(write(tmp_path / f"{number}.tif", **profile), rf"{number}\.tif.*{given['said']}")
    for angle in (90, 180, 20):
        turned = Affine.translation(708000, 4332000) @ Affine.rotation(angle) @ Affine.scale(10, -10)
        with pytest.raises(ValueError, match=r"turned\.tif is rotated or not north up.*gdalwarp"):
            fifesim.open_image(write(tmp_path / "turned.tif", transform=turned))


def test_vertical_crs_and_nodata_value_outside_the_dtype_are_ignored(tmp_path):
    """GDAL passes on the nodata value of a mosaic even if no cell can hold it."""
    image = fifesim.open_image(write(tmp_path / "compound.tif", crs="EPSG:26914+5703"))
    assert image.rio.crs == "EPSG:26914" and image.equals(fifesim.open_image(write(tmp_path / "plain.tif")))
    assert (fifesim.open_lai(tmp_path / "compound.tif", GRID) == 3).all()
    write(tmp_path / "cells.tif", dtype="uint8")
    rasterio.shutil.copy(tmp_path / "cells.tif", tmp_path / "marked.vrt", driver="VRT")
    text = (tmp_path / "marked.vrt").read_text()
    band = re.search("<VRTRasterBand[^>]*>", text)[0]
    (tmp_path / "marked.vrt").write_text(text.replace(band, f"{band}<NoDataValue>-9999</NoDataValue>"))
    assert (fifesim.open_image(tmp_path / "marked.vrt") == 3).all()


def test_covering_grid_covers_the_file_in_whole_pixels(tmp_path):
    for case in FOREIGN["covering"]:
        affine = Affine(*case["transform"])
        path = write(tmp_path / "lai.tif", transform=affine, crs=case["crs"])
        grid = covering_grid(path, 10 / 3, 30.0, case.get("asked"))
        a, box = grid.affine, grid.boundingbox
        assert grid.crs.epsg == case["epsg"]
        assert a.c % 30 == 0 and a.f % 30 == 0 and grid.shape.x % 9 == 0 and grid.shape.y % 9 == 0
        corners = np.array([affine * corner for corner in [(0, 0), (60, 0), (0, 60), (60, 60)]])
        x, y = pyproj.Transformer.from_crs(case["crs"], case["epsg"], always_xy=True).transform(*corners.T)
        assert box.left <= x.min() < box.left + 31 and box.right - 31 < x.max() <= box.right
        assert box.bottom <= y.min() < box.bottom + 31 and box.top - 31 < y.max() <= box.top
    for crs, said in (("EPSG:4326", "must be projected"), ("EPSG:2193", "EPSG:2193"), ("EPSG:3857", "the scale of")):
        with pytest.raises(ValueError, match=said):
            covering_grid(path, 10.0, 30.0, crs)


# Numbers in a band, and the function that opens a file or an array of them.
CLASSES = {"a": fifesim.CoverClass(code=2, lai=2.0), "b": fifesim.CoverClass(code=3, lai=3.0)}
BY_BAND = {
    "lai": lambda given: fifesim.open_lai(given, GRID),
    "elevation": lambda given: fifesim.fine_dem(given, GRID),
    "cover": lambda given: fifesim.landscape(GRID, cover=given, classes=CLASSES).cover,
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", BY_BAND)
def test_band_is_the_only_one_that_names_the_quantity(tmp_path, name):
    found, values = BY_BAND[name], [3.0, 2.0]
    path = write(tmp_path / "two.tif", values, names=["quality", name])
    for given in (path, rioxarray.open_rasterio(path)):
        np.testing.assert_allclose(found(given), 2.0, rtol=1e-6)


def test_scale_and_unit_are_of_the_band_of_the_quantity(tmp_path):
    """A band of transparency is no band of data."""
    scaled, path = {"dtype": "int16", "scales": [1.0, 0.1], "offset": [5.0, 0.0]}, tmp_path / "map.tif"
    write(path, [7, 25], names=["Lai_QC", "Lai_500m"], units=["%", "m2/m2"], **scaled)
    np.testing.assert_allclose(fifesim.open_lai(path, GRID), 2.5, rtol=1e-6)
    write(path, [1, 4000], names=["NDVI", "elevation"], units=["1", "m"], **scaled)
    np.testing.assert_allclose(fifesim.fine_dem(path, GRID), 400.0, rtol=1e-6)
    write(path, [400, 255], colours=[ColorInterp.gray, ColorInterp.alpha], dtype="int16")
    np.testing.assert_allclose(fifesim.fine_dem(path, GRID), 400.0, rtol=1e-6)


@pytest.mark.parametrize("driver", ["AAIGrid", "PNG", "EHdr", "ENVI"])
@pytest.mark.parametrize("header", ["EHdr", "ENVI"])
def test_header_of_another_file_does_not_make_a_raster_raw_bytes(tmp_path, driver, header):
    twin = write(tmp_path / "lai.bil", driver=header)
    kept = tmp_path / ("lai.bil" if driver == header else {"AAIGrid": "lai.asc", "PNG": "lai.png"}.get(driver, "x.bil"))
    if kept != twin:
        source = write(tmp_path / "source.tif", dtype="uint8" if driver == "PNG" else "float32")
        rasterio.shutil.copy(source, kept, driver=driver, **({"WORLDFILE": "YES"} if driver == "PNG" else {}))
    assert (tmp_path / "lai.hdr").exists()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        np.testing.assert_array_equal(fifesim.open_lai(kept, GRID), 3.0)


@pytest.mark.parametrize("bring", [fifesim.open_lai, fifesim.fine_dem])
def test_changed_file_is_another_array_for_dask(tmp_path, bring):
    path = write(tmp_path / "map.tif", [1])
    one, same = (bring(path, GRID, chunks=20).data.name for _ in "ab")
    other = bring(write(path, [2]), GRID, chunks=20)
    assert one == same != other.data.name and float(other.mean()) == pytest.approx(2.0)


AIR, TIME = fifesim.Atmosphere(), "2022-06-03T17:10Z"


def own(site, values, dtype, **attrs):
    """Raster of one value from another program."""
    cells = xr.DataArray(np.full(site.shape, values, dtype), dims=("y", "x"), name="mine")
    return grids.place(cells, site).assign_attrs(attrs)


@pytest.fixture
def fractions(site):
    values = np.round(np.random.default_rng(2).uniform(0.02, 0.5, (2, *site.shape)), 4)
    cells = xr.DataArray(values, dims=("band", "y", "x"), coords={"band": ["B04", "B08"]}, name="mine")
    return grids.place(cells, site)


def as_stored(fractions, **attrs):
    """The raster as agencies store it: integers, with one cell without data."""
    whole = np.round(fractions * 10000).astype("int16")
    whole[:, 3, 4] = -9999
    return whole.drop_attrs(deep=False).assign_attrs(attrs)


def by_variable(raster):
    return xr.Dataset({name: raster.sel(band=band, drop=True) for name, band in (("red", "B04"), ("nir", "B08"))})


@pytest.fixture
def with_hole(fractions):
    return fractions.where((fractions.x != fractions.x[4]) | (fractions.y != fractions.y[3]))


@pytest.fixture
def toa(with_hole):
    return with_hole.fifesim.to_toa(AIR, time=TIME, instrument="MSI")


def test_integers_are_scaled_to_reflectance(fractions, with_hole, toa, array_type):
    """Band names of Sentinel-2 are recognised."""
    for no_data in ("_FillValue", "nodata", "missing_value"):
        mine = array_type(as_stored(fractions, scale_factor=1e-4, add_offset=0.0, **{no_data: -9999}))
        np.testing.assert_allclose(incoming(opened(mine), "surface_reflectance"), with_hole, rtol=0, atol=1e-12)
    found = mine.fifesim.to_toa(AIR, time=TIME, instrument="Sentinel-2")
    np.testing.assert_allclose(found, toa, rtol=0, atol=1e-12)
    assert found["band"].values.tolist() == ["MSI4", "MSI8"]


def test_offset_is_added_and_undeclared_nodata_gives_a_warning(site):
    """Landsat Collection 2 surface reflectance: 7273 is 0 and 43636 is 1, so 0 would be read as -0.2."""
    mine = own(site, 10909, "uint16", scale_factor=2.75e-5, add_offset=-0.2)
    with pytest.warns(UserWarning, match=r"no value for no data.*_FillValue=0"):
        found = incoming(opened(mine), "surface_reflectance")
    np.testing.assert_allclose(found, 0.0999975, rtol=0, atol=1e-9)


def test_impossible_reflectance_is_refused_and_bright_or_dark_ground_is_not():
    """Snow, a glint, white slopes toward a low sun and dark water give no warning."""
    edge, cells = np.array([-0.5, 5.0, np.nan]), np.arange(100).reshape(1, 10, 10)
    assert check_reflectance(edge) is edge
    for wrong in (-0.51, 5.01, np.inf):
        with pytest.raises(ValueError, match=r"-0\.5 to 5 is allowed"):
            check_reflectance(np.array([0.2, wrong]))
    glint, slopes = np.where(cells < 60, 0.03, 2.0), np.where(cells % 5 < 2, 2.4, 0.5)
    flat = np.append(np.full(60, 0.2), np.full(40, 1.2)), np.array([-0.2, -0.2, 0.1, 0.1]), np.asarray(0.4)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for values in (np.full((2, 6, 6), 0.95), slopes, glint, np.full((1, 6, 6), -0.004), *flat):
            check_reflectance(values)


def test_dataset_with_a_variable_per_band_and_dates(fractions, with_hole, toa):
    """odc.stac.load returns a Dataset with one variable over (time, y, x) per band."""
    found = by_variable(with_hole).fifesim.to_toa(AIR, time=TIME, instrument="MSI")
    np.testing.assert_array_equal(found, toa)
    whole = by_variable(as_stored(fractions)).assign_attrs(scale_factor=1e-4, nodata=-9999)
    np.testing.assert_allclose(incoming(opened(whole), "surface_reflectance"), with_hole, rtol=0, atol=1e-12)
    stored = as_stored(fractions, scale_factor=1e-4, nodata=-9999)
    mixed = by_variable(stored).assign(nir=fractions[1].drop_vars("band"))
    np.testing.assert_allclose(incoming(opened(mixed), "surface_reflectance")[1], fractions[1])
    times = np.array(["2022-05-01T17:10", "2022-06-03T17:10"], "M8[ns]")
    dates = by_variable(xr.concat([stored, stored], dim=xr.DataArray(times, dims="time", name="time")))
    both = dates.fifesim.to_toa(AIR, instrument="MSI")
    assert both.dims == ("time", "band", "y", "x") and both["sza"].dims == ("time",)
    np.testing.assert_array_equal(both[1], stored.fifesim.to_toa(AIR, time=times[1], instrument="MSI"))


def test_file_opened_with_rioxarray(fractions, toa, tmp_path):
    """rioxarray numbers bands from 1 and stores their names in long_name."""
    path = tmp_path / "mine.tif"
    as_stored(fractions).rio.write_nodata(-9999).rio.to_raster(path)
    with rasterio.open(path, "r+") as file:
        file.descriptions, file.scales = ("red", "nir"), (1e-4, 1e-4)
    for options in ({}, {"chunks": {"y": 20}}, {"mask_and_scale": True}):
        with rioxarray.open_rasterio(path, **options) as mine:
            found = mine.fifesim.to_toa(AIR, time=TIME, instrument="Sentinel-2")
            np.testing.assert_allclose(found, toa, rtol=0, atol=1e-7)
            assert found["band"].values.tolist() == ["MSI4", "MSI8"]


def test_band_names_follow_the_band_numbers(fractions, tmp_path):
    """A band selection keeps the band numbers, but long_name still lists all names of the file."""
    path, names = tmp_path / "six.tif", ("B02", "B03", "B04", "B08", "B11", "B12")
    xr.concat([fractions] * 3, "band").drop_vars("band").rio.to_raster(path)
    with rasterio.open(path, "r+") as file:
        file.descriptions = names
    with rioxarray.open_rasterio(path) as mine:
        for chosen in ([2, 3], [5, 4, 3], [0]):
            taken = incoming(mine.isel(band=chosen), "surface_reflectance")
            assert taken["band"].values.tolist() == [names[number] for number in chosen]
        assert incoming(mine.sel(band=3), "surface_reflectance")["band"].item() == "B04"
    with rioxarray.open_rasterio(path, band_as_variable=True) as mine:
        assert incoming(opened(mine), "surface_reflectance")["band"].values.tolist() == list(names)


def test_wavelengths_are_converted_to_micrometres(fractions):
    for unit in ("nm", "Nanometers"):
        there = fractions.drop_vars("band").assign_coords(wavelength=("band", [665.0, 833.0], {"units": unit}))
        np.testing.assert_allclose(in_micrometres(there)["wavelength"], [0.665, 0.833], rtol=1e-12)
    single = there.astype("float32")
    assert single.fifesim.to_toa(AIR, time=TIME).dtype == incoming(single, "surface_reflectance").dtype == np.float32


def test_scale_offset_and_fill_value_are_applied_and_removed():
    packed = xr.DataArray(np.array([[0, 35], [255, 100]], np.uint8), dims=("y", "x"), name="Lai_500m")
    packed.attrs = {"scale_factor": 0.1, "add_offset": 1.0, "_FillValue": 255, "units": "m2/m2"}
    found = unpacked(packed)
    np.testing.assert_allclose(found, [[1.0, 4.5], [np.nan, 11.0]], rtol=1e-15)
    assert (found.attrs, found.name, packed.attrs["scale_factor"]) == ({"units": "m2/m2"}, "Lai_500m", 0.1)
    with no_compute():
        lazy = unpacked(packed.chunk())
    assert isinstance(lazy.data, da.Array)
    np.testing.assert_array_equal(lazy, found)
    plain = packed.astype(np.float32).assign_attrs(_FillValue=np.nan, scale_factor=1, add_offset=0)
    assert unpacked(plain) is plain


def test_scales_by_band_follow_the_numbers_of_the_bands(fractions, with_hole):
    """rioxarray has `scales` and `offsets` for all bands of the file, also after a selection."""
    stored = as_stored(fractions, scales=(1e-4, 2e-4), offsets=(0.0, 0.1), _FillValue=-9999)
    stored = stored.assign_coords(band=[1, 2])
    expected = with_hole.values * [[[1]], [[2]]] + [[[0]], [[0.1]]]
    np.testing.assert_allclose(opened(stored), expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(opened(stored.sel(band=2)), expected[1], rtol=0, atol=1e-12)
    with pytest.raises(ValueError, match=r"scale_factor \(0\.0001, 0\.0002\).*one for each numbered band"):
        opened(stored.assign_coords(band=["red", "nir"]))


def test_numbers_beyond_the_valid_range_are_no_data(site):
    """LAI of MODIS: 249 to 254 stand for water, cities and the like, and CF takes them as missing."""
    whole = own(site, 25, "uint8")
    whole[2, 3], whole[4, 5] = 253, 255
    expected = whole.where(whole == 25) * 0.1
    for attrs in ({"valid_range": (0, 100)}, {"valid_min": 0, "valid_max": np.uint8(100)}, {"valid_max": 100}):
        lai = opened(whole.assign_attrs(scale_factor=0.1, _FillValue=255, **attrs))
        np.testing.assert_allclose(lai, expected, rtol=1e-15)
        assert not {"valid_range", "valid_min", "valid_max", "scale_factor"} & set(lai.attrs)
        # In fractions, the attributes may still refer to the stored numbers.
        np.testing.assert_array_equal(opened((expected * 1000).assign_attrs(attrs)), expected * 1000)


def test_codes_and_digital_numbers_stay_whole_numbers(site):
    codes = own(site, 0, "int16", _FillValue=-1, flag_values=[0, 1])
    counts = own(site, 0, "int16", _FillValue=0).assign_coords(gain=0.8, offset=-1.2)
    assert opened(codes) is codes and opened(counts) is counts


def test_written_file_has_the_scale_of_its_whole_numbers(site, tmp_path):
    stored = own(site, 8, "int16").rename("lai")
    stored[1, 1] = -1
    packing = {"scale_factor": 0.1, "add_offset": 0.5, "_FillValue": -1}
    encoded = stored.copy()
    encoded.encoding |= packing
    for mine in (stored.assign_attrs(packing), encoded):
        path = mine.fifesim.to_geotiff(tmp_path / "lai.tif", overwrite=True)
        with rasterio.open(path) as file:
            assert (file.scales, file.offsets, file.nodata, file.dtypes) == ((0.1,), (0.5,), -1, ("int16",))
        again = fifesim.open_image(path)
        np.testing.assert_array_equal(again, mine)
        np.testing.assert_allclose(opened(again)[:2, :2], [[1.3, 1.3], [1.3, np.nan]], rtol=1e-12)
        np.testing.assert_allclose(fifesim.open_lai(path, site), opened(mine), rtol=1e-12)


def test_quantities_have_names_and_units_of_the_cf_table():
    table = pd.read_csv(DATA / "cf_standard_names.csv", comment="#", dtype=str)
    units = dict(zip(table["standard_name"], table["units"], strict=True))
    for name, quantity in cf.QUANTITIES.items():
        if quantity.standard_name:
            assert quantity.units == units[quantity.standard_name.removesuffix(" standard_error")], name
        assert quantity.units in {*units.values(), "astronomical_unit"} and all(cf.attributes(name).values()), name


def test_label_replaces_attributes_and_keeps_provenance_and_history(site):
    before = own(site, 1.0, float, units="percent", valid_range="0 100", history="mine")
    after = cf.label(before, "ndvi", history="ndvi")
    assert after.name == "ndvi" and after.attrs == cf.attributes("ndvi") | {"history": "ndvi"}
    assert before.name == "mine" and before.attrs["units"] == "percent"
    source = own(site, 1.0, float, history="one", arp=0.15, references="Friedl", units="1", something="else")
    after = cf.label(before, "fpar", source=source, history="two", references="Tanre", arp=0.2)
    assert (after.attrs["history"], after.attrs["references"], after.attrs["arp"]) == ("one\ntwo", "Friedl; Tanre", 0.2)
    again = cf.label(before, "toa_reflectance", source=after, history="to_toa", references="Tanre")
    assert again.attrs["references"] == "Friedl; Tanre" and "something" not in after.attrs


def test_units_have_several_spellings(site):
    for units in ("1", "", "m2 m-2", " 1 ", "dimensionless"):
        cf.check_units(own(site, 1.0, float, units=units), "lai")
    # rioxarray gives the units of bands as a tuple.
    radiance = own(site, 1.0, float, units=("W m-2 sr-1 um-1",) * 3)
    cf.check_units(radiance, "toa_radiance")
