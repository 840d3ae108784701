"""
Files edited by other programs open with the right bands and values, or are rejected.

To draw a thousand edits: ``FIFESIM_DRAWS=1000 pytest -m slow tests/properties/test_edited_files.py``
"""

import os
import tempfile
from collections import Counter
from copy import deepcopy
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import rasterio
import rasterio.warp
import rioxarray
import xarray as xr
from edits import Copy
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import fifesim
from fifesim.grids.grid import place

COUNT = int(os.environ.get("FIFESIM_DRAWS", 110))
GRID = fifesim.grid_at("EPSG:26914", 708000.0, 4332000.0, 900.0, 720.0, 30.0)


def cells(seed, bands, low, high):
    """Bands of similar values, so that swapped bands look plausible."""
    return np.random.default_rng(seed).uniform(low, high, (bands, *GRID.shape))


def digital_numbers(instrument, names, dtype, largest, **scale):
    values = np.rint(cells(1, len(names), 1, largest)).astype(dtype)
    values[:, :2, 3:9] = 0
    dn = place(xr.DataArray(values, dims=("band", "y", "x"), coords={"band": names}), GRID)
    return fifesim.calibrate(dn, instrument, geometry=fifesim.Geometry(sza=30.0, saa=120.0), **scale)


def variables():
    lai, fpar, moisture = (
        place(xr.DataArray(each, dims=("y", "x"), attrs={"units": "1"}), GRID) for each in cells(2, 3, 0.1, 0.9)
    )
    lai[4:6, 7:12] = np.nan
    return xr.Dataset({"lai": lai, "fpar": fpar, "moisture": moisture})


KINDS = {
    "TM": lambda: digital_numbers("TM", ["TM2", "TM3", "TM4"], np.uint8, 255),
    "MSI": lambda: digital_numbers(
        "MSI", ["MSI3", "MSI4", "MSI8"], np.uint16, 4000, gain=[0.05, 0.041, 0.028], offset=[-49.5, -41.0, -28.3]
    ),
    "truth": variables,
    "reflectance": lambda: digital_numbers("TM", ["TM1", "TM3", "TM4"], np.uint8, 90).fifesim.to_reflectance(),
    "lai": lambda: variables()["lai"],
}


@cache
def written(kind):
    """Copy of a file of one kind, with the physical values and the wavelengths of its bands by name."""
    raster = KINDS[kind]()
    with tempfile.TemporaryDirectory() as folder:
        path = raster.fifesim.to_geotiff(Path(folder) / "written.tif")
        copy, opened = Copy(path), fifesim.open_image(path)
    physical = fifesim.sensor.to_radiance(raster) if "gain" in opened.coords else opened
    centres = opened["wavelength"].values if "wavelength" in opened.coords else []
    wavelengths = dict(zip(copy.descriptions, centres, strict=False))
    return copy, np.atleast_3d(physical.values.astype(float)).reshape(copy.values.shape), wavelengths


class Edited:
    """An edited copy of a file, with the true names and values of its bands."""

    def __init__(self, kind):
        self.copy, self.physical, self.wavelengths = deepcopy(written(kind))
        self.names = list(self.copy.descriptions)
        self.counted = kind in ("TM", "MSI")
        # Whether a scale that the file can have converts the stored values to the physical values.
        self.sound = True

    def rename(self, bands):
        self.names, self.physical = [self.names[band] for band in bands], self.physical[bands]


def select(edited, number):
    bands = [[2, 1, 0], [1, 2, 0], [1, 0, 2], [0, 2, 1], [0], [1], [0, 1], [1, 0], [2], [2, 0]][number % 10]
    bands = [band for band in bands if band < len(edited.names)] or [0]
    edited.copy.select(bands)
    edited.rename(bands)


def reorder_values(edited, number):
    """Reorder values only: rioxarray keeps the old descriptions and scales, and drops units."""
    bands = list(range(len(edited.names)))[::-1]
    edited.copy.values = edited.copy.values[bands]
    edited.copy.units = [None] * len(bands)
    edited.rename(bands)


def crop(edited, number):
    _, height, width = edited.copy.values.shape
    top, left = number % max(1, height // 3), number % max(1, width // 4)
    rows, columns = slice(top, top + 6 + number % 5), slice(left, left + 8)
    edited.copy.crop(rows, columns)
    edited.physical = edited.physical[:, rows, columns]


def widen(edited, number):
    dtypes = [np.uint16, np.int32, np.float32, np.float64] if edited.copy.values.dtype.kind in "iu" else [np.float64]
    edited.copy.convert(dtypes[number % len(dtypes)])


def reproject(edited, number):
    """Resample by nearest neighbour to another zone or to shifted cells."""
    copy, nodata, (_, height, width) = edited.copy, edited.copy.nodata, edited.copy.values.shape
    crs, transform = copy.crs, copy.transform @ copy.transform.translation(0.25 + number % 3 / 4, 0.4)
    if number % 2:
        crs, bounds = rasterio.crs.CRS.from_epsg(32615), rasterio.transform.array_bounds(height, width, copy.transform)
        transform, width, height = rasterio.warp.calculate_default_transform(copy.crs, crs, width, height, *bounds)
    missing = nodata if nodata is not None else np.nan if copy.values.dtype.kind == "f" else 0
    how = {"src_crs": copy.crs, "src_transform": copy.transform, "dst_crs": crs, "dst_transform": transform}
    found = []
    for values, fill in ((copy.values, missing), (edited.physical, np.nan)):
        out = np.full((len(values), height, width), fill, values.dtype)
        found.append(rasterio.warp.reproject(values, out, src_nodata=fill, dst_nodata=fill, **how)[0])
    (copy.values, edited.physical), copy.crs, copy.transform = found, crs, transform


def other_nodata(edited, number):
    copy = edited.copy
    copy.nodata = 200 if copy.values.dtype == np.uint8 else 999
    edited.physical[copy.values == copy.nodata] = np.nan


def arithmetic(edited, number):
    values = edited.copy.values
    edited.copy.values = [values * 0.5, values + 1.0, values * (100 / 255), values // 2][number % 4]
    edited.copy.convert([np.float32, values.dtype, np.uint8][number % 3])
    edited.sound = False


def drop(edited, number):
    """Drop the tag, the descriptions, or scales and units."""
    copy, count = edited.copy, len(edited.names)
    if number % 3 == 0:
        copy.tags.pop("FIFESIM", None)
    elif number % 3 == 1:
        copy.descriptions = [None] * count
    else:
        copy.scales, copy.offsets, copy.units = [1.0] * count, [0.0] * count, [None] * count


HARMLESS = [select, crop, widen, reproject]
OTHERS = [reorder_values, other_nodata, arithmetic, drop]
EDIT = st.tuples(st.sampled_from(HARMLESS + OTHERS), st.integers(0, 59))


def leave_evidence(drawn):
    """Whether the edits leave metadata that can contradict descriptions and values."""
    edits, untagged = {edit for edit, _ in drawn}, (drop in dict(drawn) and dict(drawn)[drop] % 3 == 0)
    return not ((untagged and edits & {reorder_values, other_nodata, arithmetic}) or {arithmetic, reproject} <= edits)


EDITS = st.lists(EDIT, min_size=1, max_size=3, unique_by=lambda drawn: drawn[0]).filter(leave_evidence)


def check_values(found, edited, tagged):
    """Check names, wavelengths and physical values of an opened file."""
    found = found if "band" in found.dims else found.expand_dims(band=[found.name])
    names = found["band"].values.tolist()
    nameless = not tagged and names == [f"band{number}" for number in range(1, len(names) + 1)]
    assert nameless or names == edited.names
    if "wavelength" in found.coords:
        expected = [edited.wavelengths[name] for name in edited.names]
        np.testing.assert_allclose(found["wavelength"], expected, rtol=1e-8)
    calibrated = "gain" in found.coords
    radiance = fifesim.sensor.to_radiance(found) if calibrated else found
    units = found.attrs.get("units")
    claimed = calibrated or (units == "W m-2 sr-1 um-1" if edited.counted else tagged or units is not None)
    if not claimed:
        assert not tagged
        return "plain"
    # Values may become missing, which is not a wrong number.
    assert edited.sound or np.isnan(radiance).all(), "values that stand for nothing were read as physical ones"
    np.testing.assert_allclose(radiance, edited.physical if edited.sound else np.nan, rtol=3e-7, atol=1e-9)
    return "right"


def outcome(kind, edits):
    """Outcome for an edited file: ``right``, ``plain`` without a claim, or ``refused``."""
    edited = Edited(kind)
    for edit, number in edits:
        edit(edited, number)
    with tempfile.TemporaryDirectory() as folder:
        path = edited.copy.write(Path(folder) / "edited.tif")
        chunks = {"y": 7, "x": 11} if edits[0][1] % 2 else None
        try:
            found = fifesim.open_image(path, chunks=chunks).compute()
        except ValueError as error:
            assert "edited.tif" in str(error), error
            return "refused"
    return check_values(found, edited, "FIFESIM" in edited.copy.tags)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_edited_files_open_correctly_or_are_rejected():
    outcomes, kept = Counter(), Counter()

    @settings(max_examples=COUNT, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(kind=st.sampled_from(sorted(KINDS)), edits=EDITS)
    def draw(kind, edits):
        came = outcome(kind, edits)
        outcomes[came] += 1
        names = {edit for edit, _ in edits}
        # GDAL drops the units when cropping, and resampled cells are recognised by units only.
        if names <= set(HARMLESS) and not (crop in names and reproject in names):
            kept[came] += 1
            assert came == "right", "an ordinary edit was refused"

    draw()
    assert outcomes.total() >= 100
    assert outcomes["right"] > outcomes.total() / 4 and outcomes["refused"] > outcomes.total() / 8
    assert kept["right"] > outcomes.total() / 8


@pytest.mark.parametrize("masked", [True, False], ids=["masked", "stored"])
@pytest.mark.parametrize("change", ["none", "crop", "reorder", "half"])
@pytest.mark.parametrize("kind", ["TM", "truth"])
@pytest.mark.filterwarnings("ignore")
def test_files_written_by_rioxarray_open_correctly_or_are_rejected(tmp_path, kind, change, masked):
    """rioxarray writes descriptions and scales of other bands than the values, and unscales silently."""
    edited = Edited(kind)
    opened = rioxarray.open_rasterio(edited.copy.write(tmp_path / "written.tif"), mask_and_scale=masked)
    changed = {
        "none": opened,
        "crop": opened.isel(x=slice(3, 17), y=slice(2, 20)),
        "reorder": opened.isel(band=[2, 1, 0]),
        "half": opened * 0.5,
    }[change]
    path = tmp_path / "edited.tif"
    changed.rio.to_raster(path)
    if change in ("none", "crop") and (kind == "truth" or not masked):
        edited.physical = edited.physical[:, 2:20, 3:17] if change == "crop" else edited.physical
        assert check_values(fifesim.open_image(path), edited, True) == "right"
    else:
        with pytest.raises(ValueError, match=r"edited\.tif"):
            fifesim.open_image(path)
