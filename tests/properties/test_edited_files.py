"""
Files edited by other programs open with the right bands and values, or are rejected.

To draw two thousand edits: ``FIFESIM_EDITS=2000 pytest tests/properties/test_edited_files.py``
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

COUNT = int(os.environ.get("FIFESIM_EDITS", "150"))
GRID = fifesim.grid_at("EPSG:26914", 708000.0, 4332000.0, 900.0, 720.0, 30.0)
SUN = fifesim.Geometry(sza=30.0, saa=120.0)
RADIANCE = "W m-2 sr-1 um-1"


def cells(seed, bands, low, high):
    """Bands of similar values, so that swapped bands look plausible."""
    return np.random.default_rng(seed).uniform(low, high, (bands, *GRID.shape))


def digital_numbers(instrument, names, dtype, largest, **scale):
    values = np.rint(cells(1, len(names), 1, largest)).astype(dtype)
    values[:, :2, 3:9] = 0
    dn = place(xr.DataArray(values, dims=("band", "y", "x"), coords={"band": names}), GRID)
    return fifesim.calibrate(dn, instrument, geometry=SUN, **scale)


def variables():
    lai, fpar, moisture = (
        place(xr.DataArray(each, dims=("y", "x"), attrs={"units": "1"}), GRID) for each in cells(2, 3, 0.1, 0.9)
    )
    lai[4:6, 7:12] = np.nan
    return xr.Dataset({"lai": lai, "fpar": fpar, "moisture": moisture})


@cache
def written(kind):
    """Copy of a file of one kind, with the physical values and the names of its bands."""
    raster = {
        "TM": lambda: digital_numbers("TM", ["TM2", "TM3", "TM4"], np.uint8, 255),
        "MSI": lambda: digital_numbers(
            "MSI", ["MSI3", "MSI4", "MSI8"], np.uint16, 4000, gain=[0.05, 0.041, 0.028], offset=[-49.5, -41.0, -28.3]
        ),
        "MSS": lambda: digital_numbers("MSS", ["MSS4", "MSS5", "MSS6"], np.uint8, 63),
        "truth": variables,
        "reflectance": lambda: digital_numbers("TM", ["TM1", "TM3", "TM4"], np.uint8, 90).fifesim.to_reflectance(),
        "lai": lambda: variables()["lai"],
    }[kind]()
    with tempfile.TemporaryDirectory() as folder:
        path = raster.fifesim.to_geotiff(Path(folder) / "written.tif")
        copy, opened = Copy(path), fifesim.open_image(path)
    physical = fifesim.sensor.to_radiance(raster) if "gain" in opened.coords else opened
    wavelengths = {}
    if "wavelength" in opened.coords:
        wavelengths = dict(zip(copy.descriptions, opened["wavelength"].values, strict=True))
    return copy, np.atleast_3d(physical.values.astype(float)).reshape(copy.values.shape), wavelengths


class Edited:
    """An edited copy of a file, with the true names and values of its bands."""

    def __init__(self, kind):
        self.copy, self.physical, self.wavelengths = deepcopy(written(kind))
        self.names = list(self.copy.descriptions)
        self.counted = kind in ("TM", "MSI", "MSS")
        # Whether a scale that the file can have converts the stored values to the physical values.
        self.sound = True

    def select(self, bands):
        """Select and reorder bands in the file."""
        bands = [band for band in bands if band < len(self.names)] or [0]
        self.copy.select(bands)
        self.rename(bands)

    def rename(self, bands):
        self.names, self.physical = [self.names[band] for band in bands], self.physical[bands]

    def resample(self, crs, transform, shape):
        """Resample to another grid by nearest neighbour."""
        copy, nodata = self.copy, self.copy.nodata
        missing = nodata if nodata is not None else np.nan if copy.values.dtype.kind == "f" else 0
        missing = 0 if nodata is None and self.counted else missing
        how = {"src_crs": copy.crs, "src_transform": copy.transform, "dst_crs": crs, "dst_transform": transform}
        found = []
        for values, fill in ((copy.values, missing), (self.physical, np.nan)):
            out = np.full((len(values), *shape), fill, values.dtype)
            found.append(rasterio.warp.reproject(values, out, src_nodata=fill, dst_nodata=fill, **how)[0])
        (copy.values, self.physical), copy.crs, copy.transform = found, crs, transform


def reorder(edited, number):
    edited.select([[2, 1, 0], [1, 2, 0], [1, 0, 2], [0, 2, 1]][number % 4])


def subset(edited, number):
    edited.select([[0], [1], [0, 1], [1, 0], [2], [2, 0]][number % 6])


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


def unscale(edited, number):
    copy = edited.copy
    scale, offset = (np.array(each)[:, None, None] for each in (copy.scales, copy.offsets))
    copy.values = (copy.values * scale + offset).astype([np.float32, np.float64, copy.values.dtype][number % 3])
    copy.units = [None] * len(copy.units)
    # In one case of three the scales remain, as with rioxarray.
    if number % 3 < 2:
        drop_scales(edited, number)


def rescale(edited, number):
    """Rescale like ``gdal_translate -scale``, which keeps scales and drops units."""
    copy = edited.copy
    factor = [1 / 255, 100 / 255, 2.0, 0.5, 1000.0][number % 5]
    copy.values = copy.values.astype(float) * factor
    copy.convert([np.float32, np.uint8, np.uint16][number % 3])
    copy.units = [None] * len(copy.units)
    edited.sound = False


def widen(edited, number):
    dtypes = [np.uint16, np.int32, np.float32, np.float64] if edited.copy.values.dtype.kind in "iu" else [np.float64]
    edited.copy.convert(dtypes[number % len(dtypes)])


def change_type(edited, number):
    edited.copy.convert([np.uint8, np.int16, np.uint16, np.float32][number % 4])


def reproject(edited, number):
    copy, crs = edited.copy, rasterio.crs.CRS.from_epsg(32615)
    _, height, width = copy.values.shape
    bounds = rasterio.transform.array_bounds(height, width, copy.transform)
    transform, width, height = rasterio.warp.calculate_default_transform(copy.crs, crs, width, height, *bounds)
    edited.resample(crs, transform, (height, width))


def coarsen(edited, number):
    copy = edited.copy
    _, height, width = copy.values.shape
    transform = copy.transform @ copy.transform.scale(2.0 + number % 2)
    edited.resample(copy.crs, transform, (max(2, height // 3), max(2, width // 3)))


def shift(edited, number):
    copy = edited.copy
    transform = copy.transform @ copy.transform.translation(0.25 + number % 3 / 4, 0.4)
    edited.resample(copy.crs, transform, copy.values.shape[1:])


def other_nodata(edited, number):
    copy = edited.copy
    copy.nodata = 200 if copy.values.dtype == np.uint8 else 999
    edited.physical[copy.values == copy.nodata] = np.nan


def arithmetic(edited, number):
    copy = edited.copy
    kept = copy.values.dtype
    values = [copy.values * 0.5, copy.values + 1.0, copy.values * -1.0, copy.values // 2][number % 4]
    copy.values = values if number % 3 else values.astype(kept)
    edited.sound = False


def drop_tag(edited, number):
    edited.copy.tags.pop("FIFESIM", None)


def drop_descriptions(edited, number):
    edited.copy.descriptions = [None] * len(edited.names)


def drop_scales(edited, number):
    copy = edited.copy
    copy.scales, copy.offsets = [1.0] * len(copy.scales), [0.0] * len(copy.scales)
    copy.units = [None] * len(copy.units)


def drop_nodata(edited, number):
    edited.copy.nodata = None


HARMLESS = [reorder, subset, crop, widen, reproject, coarsen, shift, drop_nodata]
OTHERS = [
    reorder_values, unscale, rescale, change_type, other_nodata, arithmetic, drop_tag, drop_descriptions, drop_scales,
]  # fmt: skip
RESAMPLED = {reproject, coarsen, shift}


def leave_no_evidence(edits):
    """Whether the edits remove all metadata that could contradict descriptions and values."""
    resampled = bool(edits & RESAMPLED)
    return (
        {other_nodata, drop_nodata} <= edits
        or (drop_tag in edits and bool(edits & {reorder_values, other_nodata, drop_nodata}))
        or (arithmetic in edits and (resampled or drop_tag in edits))
        or (change_type in edits and (drop_tag in edits or (widen in edits and resampled)))
    )


EDIT = st.tuples(st.sampled_from(HARMLESS + OTHERS), st.integers(0, 59))
EDITS = st.lists(EDIT, min_size=1, max_size=3, unique_by=lambda drawn: drawn[0]).filter(
    lambda drawn: not leave_no_evidence({edit for edit, _ in drawn})
)


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
    claimed = calibrated or (units == RADIANCE if edited.counted else tagged or units is not None)
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


@pytest.mark.filterwarnings("ignore")
def test_edited_files_open_correctly_or_are_rejected():
    outcomes, kept = Counter(), Counter()

    @settings(
        max_examples=COUNT, derandomize=True, database=None, deadline=None, suppress_health_check=list(HealthCheck)
    )
    @given(kind=st.sampled_from(["TM", "MSI", "MSS", "truth", "reflectance", "lai"]), edits=EDITS)
    def draw(kind, edits):
        came = outcome(kind, edits)
        outcomes[came] += 1
        names = {edit for edit, _ in edits}
        # GDAL drops the units when cropping, and resampled cells are recognised by units only.
        if names <= set(HARMLESS) and not (crop in names and names & RESAMPLED):
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
