"""Files of a product on one grid."""

import numpy as np
import products
import pytest
from lazy import check_place

from fifesim.sensor.products import labels as products_labels
from fifesim.sensor.response.calibration import ProductBand

PLACE = {"crs": "EPSG:32609", "corner": (339300.0, 7392900.0), "pixel": 30.0}


def written(folder, name="a.tif", shape=(6, 9), **place):
    values = np.arange(np.prod(shape), dtype=np.uint16).reshape(shape)
    return products.write(folder / name, values, **(PLACE | place))


@pytest.mark.parametrize("chunks", [None, {"y": 4, "x": 5}, 3])
def test_a_layer_is_as_it_is_stored(tmp_path, chunks):
    values = written(tmp_path)
    layer = products_labels.open_layer(tmp_path, "a.tif", chunks, "")
    assert (layer.chunks is None) == (chunks is None)
    np.testing.assert_array_equal(layer, values)
    assert layer.dtype == np.uint16
    check_place(layer, "EPSG:32609")


def test_automatic_chunks_are_blocks_of_files():
    assert products_labels.layer_chunk_sizes("auto") == {"y": 2048, "x": 2048}
    assert products_labels.layer_chunk_sizes(None) is None
    assert products_labels.layer_chunk_sizes({"y": 5}) == {"y": 5}


def test_what_is_no_layer_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"a\.tif is missing in .*: fetch it"):
        products_labels.open_layer(tmp_path, "a.tif", None, "fetch it")
    (tmp_path / "a.tif").write_text("<html>")
    with pytest.raises(ValueError, match=r"cannot read .*a\.tif as a raster"):
        products_labels.open_layer(tmp_path, "a.tif", None, "")
    products.write(tmp_path / "b.tif", np.ones((6, 9), np.float32), **PLACE)
    with pytest.raises(ValueError, match=r"b\.tif has 1 bands of float32, where a product has 1 of whole numbers"):
        products_labels.open_layer(tmp_path, "b.tif", None, "")


def test_layers_of_different_grids_do_not_stack(tmp_path):
    written(tmp_path)
    written(tmp_path, "b.tif", corner=(339315.0, 7392900.0))
    one, two = (products_labels.open_layer(tmp_path, name, None, "") for name in ("a.tif", "b.tif"))
    bands = [ProductBand(name, "a.tif", 1e-3, 0.0, 255, None) for name in ("TM3", "TM4")]
    assert products_labels.reflectance([one, one], bands).dims == ("band", "y", "x")
    with pytest.raises(ValueError, match=r"^b\.tif and a\.tif have different grids, .*bands="):
        products_labels.reflectance([one, two], bands)
