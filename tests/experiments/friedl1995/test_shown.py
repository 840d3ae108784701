"""What the figures show."""

import numpy as np
import pytest

from fifesim.experiments.friedl1995 import reproduction
from fifesim.experiments.friedl1995.case import READINGS, Case
from fifesim.experiments.friedl1995.table import ground_of


def test_relation_at_the_ground_is_tight_and_scaling_has_the_papers_sign(found):
    """Fig. 5: BOA R2 near 1. Fig. 8: NDVI of the mean reflectance is slightly below the mean NDVI. Fig. 9: scatter."""
    for arp in found["arp"].values:
        scene = found.sel(reading="native", arp=arp)
        values = {name: scene[f"pixel_{name}"].dropna("pixel").values for name in ("lai", "fpar", "boa_ndvi")}
        assert np.corrcoef(values["boa_ndvi"], values["fpar"])[0, 1] ** 2 > 0.99
        assert np.corrcoef(values["boa_ndvi"], values["lai"])[0, 1] ** 2 > 0.95
        assert -0.01 < float((scene["pixel_ndvi_of_mean"] - scene["pixel_boa_ndvi"]).mean()) < 0
        red = [scene[f"pixel_{name}_red"].dropna("pixel").values for name in ("boa", "clear", "toa")]
        # The atmosphere alone is a line; the image scatters about it.
        assert np.corrcoef(red[0], red[1])[0, 1] ** 2 > 0.9999
        assert np.corrcoef(red[0], red[2])[0, 1] ** 2 < 0.9


def test_pixels_shown_are_those_of_the_table(found):
    scene = found.sel(reading="aligned", arp=0.15)
    lai, ndvi = (scene[name].dropna("pixel").values for name in ("pixel_lai", "pixel_ndvi"))
    first = found["r2"].sel(reading="aligned", arp=0.15, distribution="burned-grazed", variable="lai")[0]
    assert np.corrcoef(lai, ndvi)[0, 1] ** 2 == pytest.approx(float(first), rel=1e-9)


def test_sample_has_200_pixels_with_data(found):
    assert (found["sampled"].sum("pixel") == 200).all()
    assert np.isfinite(found["pixel_ndvi"].where(found["sampled"] == 1, 0)).all()


def test_digitising_is_all_that_the_analogue_image_lacks(found):
    """Half a count of 8 bits is 1/400 of red and near infrared, so that NDVI is off by a hundredth at most."""
    off = (found["pixel_ndvi"] - found["pixel_analogue_ndvi"]).where(np.isfinite(found["pixel_ndvi"]))
    assert 0.001 < float(abs(off).max()) < 0.02


def test_cells_are_those_of_the_scene():
    case = Case(cells=90, reading=READINGS["offset"])
    out = reproduction.shown_scenes(case, [case.reading], 4)
    np.testing.assert_array_equal(out["cell_lai"].sel(arp=0.15), ground_of(case, "burned-grazed", 0.15, 4).lai)
    assert list(out["reading"].values) == ["offset"]


def test_densities_integrate_to_one_and_end_at_their_bounds(folders):
    own = reproduction.densities(Case())
    for values in own:
        known = values.dropna("leaf_area")
        assert np.trapezoid(known, known["leaf_area"]) == pytest.approx(1, abs=0.005)
    ungrazed = own.sel(distribution="burned-ungrazed").dropna("leaf_area")
    assert float(ungrazed["leaf_area"][0]) == pytest.approx(0.475, abs=0.003)
    files = {str(name): str(folders["densities"] / f"{name}.csv") for name in own["distribution"].values}
    assert reproduction.densities(Case(densities=files)).sizes == own.sizes
