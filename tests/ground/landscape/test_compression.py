"""Cells by their class."""

import numpy as np
import pytest

from fifesim.grids.classes import cells_by_class, check_codes, numbers_of

TABLE = (40, 0, 32764)


@pytest.fixture(scope="module")
def codes():
    return np.random.default_rng(1).choice([-1, *TABLE], 1000).astype(np.int16)


def test_cells_of_each_class_are_its_own_in_order(codes):
    for code, cells in zip(TABLE, cells_by_class(codes, TABLE), strict=True):
        np.testing.assert_array_equal(cells, np.flatnonzero(codes == code))


def test_class_without_cells_has_none():
    assert [cells.tolist() for cells in cells_by_class(np.array([2, -1], np.int16), (1, 2, 3))] == [[], [0], []]


@pytest.mark.parametrize("dtype", [np.int16, np.int64, float, np.uint16])
def test_codes_of_the_table_pass_in_any_numbers(codes, dtype):
    known = codes[codes >= 0]
    np.testing.assert_array_equal(check_codes(known.astype(dtype), TABLE), known)
    assert check_codes(known.astype(dtype), TABLE).dtype == np.int16


def test_missing_is_no_class():
    assert check_codes(np.array([np.nan, 40.0, -1.0]), TABLE).tolist() == [-1, 40, -1]


@pytest.mark.parametrize("dtype", [np.int16, np.int32, float])
@pytest.mark.parametrize("wrong", [-5, 7, 32765])
def test_other_codes_are_named(dtype, wrong):
    """-5 is 32764 to an index that counts from the end."""
    with pytest.raises(ValueError, match=rf"codes without a class: {wrong}, in 2 of 3 cells. Classes are 40, 0, 32764"):
        check_codes(np.array([wrong, 40, wrong], dtype), TABLE)


def test_fractions_and_many_codes_are_told_in_a_line():
    with pytest.raises(ValueError, match=r"codes without a class: 1\.5, in 1 of 1"):
        check_codes(np.array([1.5]), (1, 2))
    with pytest.raises(ValueError, match=r"1, 2, 3, 4, 5, 6, 7, 8, \.\.\., in") as told:
        check_codes(np.arange(1, 1001), tuple(range(2000, 3000)))
    assert len(str(told.value)) < 500


def test_of_many_other_codes_those_of_most_cells_are_named():
    codes = np.repeat(np.arange(1, 11), np.arange(1, 11))
    with pytest.raises(ValueError, match=r"without a class: 3, 4, 5, 6, 7, 8, 9, 10, \.\.\., in 55 of 55 cells"):
        check_codes(codes, (40,))


def test_numbers_are_places_in_the_table():
    codes = np.random.default_rng(1).choice([-1, 3, 9, 700], (30, 40)).astype(np.int16)
    numbers, present = numbers_of(codes, (9, 5, 3))
    assert (np.array([9, 5, 3, -2])[numbers] == np.where(np.isin(codes, [3, 9]), codes, -2)).all()
    assert present.tolist() == [True, False, True, True]
