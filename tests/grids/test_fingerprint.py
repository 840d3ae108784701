"""A few cells of a file tell whether its values are those that were written."""

import numpy as np
import pytest
import rasterio
from pydantic import ValidationError

from fifesim.grids.tags import Fingerprint, changed_cell, fingerprint_cells, fingerprint_of

PROFILE = {"driver": "GTiff", "count": 2, "crs": "EPSG:26914"}
TRANSFORM = rasterio.transform.from_origin(705000, 4334100, 30, 30)


@pytest.fixture
def values():
    return np.random.default_rng(1).integers(1, 200, (2, 20, 30)).astype(np.uint8)


def write(path, values, transform=TRANSFORM):
    _, height, width = values.shape
    with rasterio.open(
        path, "w", **PROFILE, height=height, width=width, dtype=values.dtype, transform=transform
    ) as sink:
        sink.write(values)
    return rasterio.open(path)


@pytest.fixture
def fingerprint(tmp_path, values):
    with write(tmp_path / "written.tif", values) as source:
        return Fingerprint.model_validate(fingerprint_of(source))


def test_the_same_cells_are_found(tmp_path, values, fingerprint):
    with write(tmp_path / "same.tif", values) as source:
        cells = fingerprint_cells(fingerprint, [0, 1], source)
    assert cells.values.shape == (2, 8, 8)
    np.testing.assert_array_equal(cells.values, values[:, cells.rows][:, :, cells.columns])
    assert changed_cell(cells, values, (0, 0, 0), []) is None


def test_a_crop_has_some_of_the_cells(tmp_path, values, fingerprint):
    crop = values[:, 5:15, 3:20]
    with write(tmp_path / "crop.tif", crop, TRANSFORM @ rasterio.Affine.translation(3, 5)) as source:
        cells = fingerprint_cells(fingerprint, [0, 1], source)
    assert 0 < cells.values.size < 128
    assert changed_cell(cells, crop, (0, 0, 0), []) is None
    assert changed_cell(cells, crop + 1, (0, 0, 0), []) is not None


@pytest.mark.parametrize(("dx", "cell"), [(15.0, 30.0), (0.5, 30.0), (0.0, 60.0)])
def test_other_cells_are_not_compared(tmp_path, values, fingerprint, dx, cell):
    transform = rasterio.transform.from_origin(705000 + dx, 4334100, cell, cell)
    with write(tmp_path / "other.tif", values, transform) as source:
        assert fingerprint_cells(fingerprint, [0, 1], source) is None


def test_exchanged_bands_are_found_in_every_block(tmp_path, values, fingerprint):
    with write(tmp_path / "exchanged.tif", values[::-1]) as source:
        cells, told = (fingerprint_cells(fingerprint, order, source) for order in ([0, 1], [1, 0]))
    for top in (0, 10):
        block = values[::-1][:, top : top + 10]
        band, found, written = changed_cell(cells, block, (0, top, 0), [])
        assert (band, found == written) == (0, False)
        assert changed_cell(told, block, (0, top, 0), []) is None


def test_a_block_of_one_band_is_compared_with_that_band(tmp_path, values, fingerprint):
    with write(tmp_path / "same.tif", values) as source:
        cells = fingerprint_cells(fingerprint, [0, 1], source)
    assert changed_cell(cells, values[1:], (1, 0, 0), []) is None
    assert changed_cell(cells, values[1:], (0, 0, 0), [])[0] == 0
    assert changed_cell(cells, values[:1], (1, 0, 0), [])[0] == 1


def test_data_may_be_masked_but_not_made(tmp_path, values, fingerprint):
    with write(tmp_path / "same.tif", values) as source:
        cells = fingerprint_cells(fingerprint, [0, 1], source)
    masked = np.full_like(values, 255)
    assert changed_cell(cells, masked, (0, 0, 0), [255]) is None
    assert changed_cell(cells, masked, (0, 0, 0), []) == (0, 255, cells.values[0, 0, 0])


def test_nan_is_kept_as_such(tmp_path, values):
    fractions = np.where(values > 100, np.nan, values / 7)
    with write(tmp_path / "fractions.tif", fractions) as source:
        cells = fingerprint_cells(Fingerprint.model_validate(fingerprint_of(source)), [0, 1], source)
    assert np.isnan(cells.values).any()
    assert changed_cell(cells, fractions, (0, 0, 0), []) is None
    assert changed_cell(cells, fractions.astype(np.float32), (0, 0, 0), []) is None
    assert changed_cell(cells, fractions * (1 + 1e-12), (0, 0, 0), []) is not None
    assert changed_cell(cells, np.nan_to_num(fractions), (0, 0, 0), [])[1] == 0


def test_values_of_other_rows_are_refused(fingerprint):
    changed = fingerprint.model_dump()
    changed["values"][0] = changed["values"][0][1:]
    with pytest.raises(ValidationError, match="values of other rows"):
        Fingerprint.model_validate(changed)


def test_a_raster_smaller_than_the_fingerprint_is_kept_whole(tmp_path):
    with write(tmp_path / "small.tif", np.arange(12, dtype=np.uint8).reshape(2, 2, 3)) as source:
        assert fingerprint_of(source)["values"] == [[[0, 1, 2], [3, 4, 5]], [[6, 7, 8], [9, 10, 11]]]
