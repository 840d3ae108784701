"""Dead leaves and crowns by cell: labels, laziness, and the models at single cells."""

import numpy as np
import pytest
import xarray as xr
from fifesim.ground.canopy.rasters.canopy_shares import in_words, share, with_shares
from lazy import check_raster_function

import fifesim

TM34 = ["TM3", "TM4"]
CELLS = [(0, 0), (10, 20), (44, 53)]


@pytest.fixture(scope="module")
def rasters(lai_values):
    rng = np.random.default_rng(2)
    brown, cover = (
        lai_values.drop_attrs(deep=False).copy(data=rng.uniform(low, 1, lai_values.shape)).rename(None)
        for low in (0.0, 0.3)
    )
    brown[3, 4] = cover[5, 6] = np.nan
    return brown, cover


def reflectance(lai, **options):
    return fifesim.surface_reflectance(lai, bands=TM34, **options)


def test_rasters_of_shares_keep_their_word_and_are_the_models_at_each_cell(lai, rasters):
    found = check_raster_function(
        lambda area, brown, cover: reflectance(area, brown=brown, dissociation=0.6, crown_cover=cover, crown_shape=0.5),
        lai, *rasters, quantity="surface_reflectance",
    )  # fmt: skip
    holes = np.isnan(found)
    assert holes[:, 3, 4].all() and holes[:, 5, 6].all() and int(holes.sum()) == 4
    for cell in CELLS:
        brown, cover = (float(each[cell]) for each in rasters)
        given = {"brown": brown, "dissociation": 0.6, "crown_cover": cover, "crown_shape": 0.5}
        alone = reflectance(lai[cell[0] : cell[0] + 1, cell[1] : cell[1] + 1], exact=True, **given)
        np.testing.assert_allclose(found[(slice(None), *cell)], alone[:, 0, 0], rtol=0, atol=1e-6)
    assert "brown by cell, dissociation 0.6, crown_cover by cell, sza" in found.attrs["history"]


def test_leaves_of_each_cell_go_with_them(lai, rasters):
    brown, cover = rasters
    optics = {"TM3": (0.2 * cover, 0.04), "TM4": (0.45, 0.42)}
    found = check_raster_function(
        lambda area, brown, cover: reflectance(area, brown=brown, crown_cover=cover, brown_leaf=optics),
        lai, brown, cover, quantity="surface_reflectance",
    )  # fmt: skip
    cell = CELLS[1]
    dead = {"TM3": (0.2 * float(cover[cell]), 0.04), "TM4": (0.45, 0.42)}
    one = lai[cell[0] : cell[0] + 1, cell[1] : cell[1] + 1]
    alone = reflectance(one, brown=float(brown[cell]), crown_cover=float(cover[cell]), brown_leaf=dead, exact=True)
    np.testing.assert_allclose(found[(slice(None), *cell)], alone[:, 0, 0], rtol=1e-12)


def test_rows_from_south_to_north_are_turned(lai, rasters):
    brown, _ = rasters
    np.testing.assert_array_equal(reflectance(lai, brown=brown[::-1]), reflectance(lai, brown=brown))


def test_green_leaves_absorb_less_than_all(lai, rasters):
    brown, cover = rasters
    green = check_raster_function(
        lambda area, brown, cover: fifesim.fpar(area, leaves="green", canopy=fifesim.Canopy(brown=brown, crown_cover=cover)),
        lai, brown, cover, quantity="green_fpar",
    )  # fmt: skip
    total = fifesim.fpar(lai, canopy=fifesim.Canopy(crown_cover=cover))
    np.testing.assert_allclose(green, total * (1 - brown), rtol=1e-12)
    np.testing.assert_array_equal(fifesim.fpar(lai, canopy=fifesim.Canopy(brown=brown)), fifesim.fpar(lai))
    whole = fifesim.fpar(lai, canopy=fifesim.Canopy(crown_cover=xr.ones_like(brown).where(brown.notnull())))
    np.testing.assert_allclose(whole, fifesim.fpar(lai).where(brown.notnull()), rtol=1e-14)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"brown": 30}, r"brown must be in \[0, 1\], got 30: give a fraction, not percent"),
        ({"dissociation": float("nan"), "brown": 0.2}, "dissociation must be in .*, got nan: of a raster it is a hole"),
        ({"crown_cover": 0.5, "crown_shape": -1.0}, "crown_shape must be at least 0, got -1"),
        ({"crown_cover": 1e-3}, "within the crowns is lai / crown_cover, at most 100"),
    ],
)
def test_impossible_shares_are_refused(lai, options, message):
    with pytest.raises(ValueError, match=message):
        reflectance(lai, **options)


def test_rasters_of_another_kind_are_refused(lai, rasters):
    brown, _ = rasters
    with pytest.raises(ValueError, match="brown must be a number, or a raster over"):
        reflectance(lai, brown=brown.expand_dims(band=TM34))
    with pytest.raises(ValueError, match="units '%'"):
        reflectance(lai, brown=brown.assign_attrs(units="%"))
    with pytest.raises(ValueError, match="leaves must be 'all' or 'green', got 'dead'"):
        fifesim.fpar(lai, leaves="dead")


def test_numbers_stay_numbers_and_rasters_become_arguments(lai, rasters):
    brown, _ = rasters
    shares = {"brown": share("brown", brown, lai), "dissociation": share("dissociation", 0.25, lai), "crown_cover": 1.0}
    kernel, arguments = with_shares(lambda area, **given: (area, given), shares)
    assert len(arguments) == 1 and set(arguments[0].coords) == {"y", "x", "spatial_ref"}
    area, given = kernel("lai", "values", more=2)
    assert area == "lai"
    assert given == {"brown": "values", "dissociation": 0.25, "crown_cover": 1.0, "more": 2}
    assert in_words(shares) == "brown by cell, dissociation 0.25, "
