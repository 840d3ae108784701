"""Arrays as text, and back."""

import base64
import zlib

import numpy as np
import pytest

from fifesim.experiments.explorer.page import packed, stepped

ARRAYS = {
    "a": np.arange(5, dtype=np.uint8),
    "b": np.array([[1, 256], [65535, 0]], np.uint16),
    "c": np.array([0.1, np.nan], np.float32),
    "d": np.array([[np.pi]]),
}


def test_arrays_come_back():
    text, places = packed(ARRAYS)
    whole = zlib.decompress(base64.b64decode(text))
    for name, array in ARRAYS.items():
        place = places[name]
        assert place["start"] % 8 == 0 and tuple(place["shape"]) == array.shape
        part = np.frombuffer(whole[place["start"] :][: array.nbytes], np.uint8)
        if place["kind"] == "u2":
            found = part[: array.size] + 256 * part[array.size :].astype(np.uint16)
        else:
            found = np.frombuffer(part.tobytes(), f"<{place['kind']}")
        np.testing.assert_array_equal(found.reshape(array.shape), array)


def test_other_types_are_refused():
    with pytest.raises(ValueError, match="x is of type int64: packed takes uint8"):
        packed({"x": np.arange(3)})


@pytest.mark.parametrize(("kind", "levels"), [("u1", 254), ("u2", 65534)])
def test_steps_are_half_a_step_wrong_at_most(kind, levels):
    values = np.random.default_rng(5).normal(size=500)
    values[3] = np.nan
    codes, low, step = stepped(values, kind)
    assert codes.dtype == kind and codes[3] == 0 and codes.max() == levels + 1
    found = np.where(codes, low + (codes - 1.0) * step, np.nan)
    np.testing.assert_allclose(found, values, atol=step / 2 * (1 + 1e-9))
    assert step == pytest.approx(np.ptp(values[np.isfinite(values)]) / levels)


def test_one_value_is_one_step():
    codes, low, _ = stepped(np.full(3, 2.5), "u1")
    assert codes.tolist() == [1, 1, 1] and low == 2.5
