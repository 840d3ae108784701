"""Figures 3 to 9."""

from itertools import product

import numpy as np
import paper_figures as figures
import pytest
from matplotlib.figure import Figure

import fifesim
from fifesim.experiments.friedl1995 import report, reproduction, table
from fifesim.experiments.friedl1995.case import Case


@pytest.mark.parametrize("number", figures.FIGURE_NUMBERS)
def test_figure_is_drawn_for_every_reading(number, small):
    for reading in ("native", "aligned"):
        figure = figures.plot(number, small, reading)
        assert isinstance(figure, Figure) and all(axis.has_data() for axis in figure.axes)


def test_curves_of_figure_3_drop_to_zero_at_their_ends(found):
    for line in figures.plot(3, found).axes[0].get_lines():
        at, density = line.get_data()
        assert at[-1] == at[-2] == at.max() and density[-1] == 0 < density[-2]


def test_densities_of_figure_6_are_reflected_at_zero(found):
    """The curve of the cells begins at 0.853, as the distribution; without reflection it begins at 0.447."""
    axis = figures.plot(6, found).axes[0]
    cells = axis.get_lines()[0].get_ydata()
    known = float(fifesim.ground.lai_distribution("burned-grazed").pdf(0))
    assert cells[0] == pytest.approx(known, rel=0.03)


@pytest.mark.parametrize(
    ("number", "panel", "points", "x", "y"),
    [
        (5, 0, 0, "boa_ndvi", "lai"),
        (5, 0, 1, "ndvi", "lai"),
        (5, 1, 1, "ndvi", "fpar"),
        (8, 0, 0, "boa_ndvi", "ndvi_of_mean"),
        (9, 0, 0, "boa_red", "toa_red"),
        (9, -1, 0, "boa_nir", "toa_nir"),
    ],
)
def test_axes_show_the_quantities_of_the_paper(found, number, panel, points, x, y):
    """Figure 8 shows the difference in the lower panels."""
    axis = figures.plot(number, found, reading="native").axes[panel]
    arp = float(found["arp"][-1 if panel == -1 else 0])
    values = figures.sample(found, "native", arp)
    drawn = axis.collections[points].get_offsets()
    assert all(each.size == 200 and np.isfinite(each).all() for each in values.values())
    np.testing.assert_allclose(drawn, np.stack([values[x], values[y]], axis=1), rtol=1e-12)
    if number == 8:
        below = figures.plot(8, found).axes[3].collections[0].get_offsets()
        np.testing.assert_allclose(below[:, 1], drawn[:, 1] - drawn[:, 0], rtol=1e-12)


def test_figure_of_table_2_shows_the_values_of_the_table(found):
    tables = {str(name): table.table2(found.sel(reading=name)) for name in found["reading"].values}
    axes = report.table2_figure(tables).axes
    assert [axis.get_title() for axis in axes] == [
        f"{variable}: {name}" for variable in ("LAI", "FPAR") for name in ("intercept", "slope", "R²")
    ]
    for axis, (variable, name) in zip(axes, product(("lai", "fpar"), ("intercept", "slope", "r2")), strict=True):
        lines = {line.get_label(): line for line in axis.lines}
        drawn = [container[0].get_xdata() for container in axis.containers]
        for values, rows in zip(drawn, tables.values(), strict=True):
            assert np.array_equal(values, rows.loc[rows["variable"] == variable, name])
        first = next(iter(tables.values()))
        assert np.array_equal(lines["paper"].get_xdata(), first.loc[first["variable"] == variable, f"paper_{name}"])
    assert axes[0].yaxis_inverted() and len(axes[0].get_yticks()) == 9


def test_drift_causes_most_of_the_scatter_of_figure_9(found):
    """1 - R2 of reflectance, computed separately in both readings."""
    for arp in found["arp"].values:
        left = {}
        for reading in ("native", "aligned"):
            scene = found.sel(reading=reading, arp=arp)
            boa, toa = (scene[f"pixel_{name}_nir"].dropna("pixel").values for name in ("boa", "toa"))
            left[reading] = 1 - np.corrcoef(boa, toa)[0, 1] ** 2
        assert left["aligned"] < left["native"] / 2


def test_surface_relation_is_tight_and_scaling_has_the_published_sign(found):
    """
    Fig. 5: R2 at the surface is near 1. Fig. 8: NDVI of the mean reflectance is slightly below the mean NDVI. Fig. 9:
    scatter.
    """
    for arp in found["arp"].values:
        scene = found.sel(reading="native", arp=arp)
        values = {name: scene[f"pixel_{name}"].dropna("pixel").values for name in ("lai", "fpar", "boa_ndvi")}
        assert np.corrcoef(values["boa_ndvi"], values["fpar"])[0, 1] ** 2 > 0.99
        assert np.corrcoef(values["boa_ndvi"], values["lai"])[0, 1] ** 2 > 0.95
        assert -0.01 < float((scene["pixel_ndvi_of_mean"] - scene["pixel_boa_ndvi"]).mean()) < 0
        # Table 2 has the same pixels.
        for reading in ("native", "aligned"):
            pixels = found.sel(reading=reading, arp=arp)
            lai, ndvi = (pixels[name].dropna("pixel").values for name in ("pixel_lai", "pixel_ndvi"))
            first = pixels["r2"].sel(distribution="burned-grazed", variable="lai")[0]
            assert np.corrcoef(lai, ndvi)[0, 1] ** 2 == pytest.approx(float(first), rel=1e-9)
        red = [scene[f"pixel_{name}_red"].dropna("pixel").values for name in ("boa", "clear", "toa")]
        # The effect of the atmosphere alone is linear; the image scatters about the line.
        assert np.corrcoef(red[0], red[1])[0, 1] ** 2 > 0.9999
        assert np.corrcoef(red[0], red[2])[0, 1] ** 2 < 0.9


def test_densities_integrate_to_one_and_end_at_their_bounds(folders):
    own = reproduction.densities(Case())
    for values in own:
        known = values.dropna("leaf_area")
        assert np.trapezoid(known, known["leaf_area"]) == pytest.approx(1, abs=0.005)
    ungrazed = own.sel(distribution="burned-ungrazed").dropna("leaf_area")
    assert float(ungrazed["leaf_area"][0]) == pytest.approx(0.475, abs=0.003)
    files = {str(name): str(folders["densities"] / f"{name}.csv") for name in own["distribution"].values}
    assert reproduction.densities(Case(densities=files)).sizes == own.sizes
