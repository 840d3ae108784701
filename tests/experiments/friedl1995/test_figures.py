"""Figures 3 to 9."""

from itertools import product

import numpy as np
import pytest
from matplotlib.figure import Figure

import fifesim
from fifesim.analysis import scaling
from fifesim.experiments.friedl1995 import figures, table


@pytest.mark.parametrize("number", figures.FIGURE_NUMBERS)
def test_figure_is_drawn_of_every_reading(number, small):
    for reading in (None, "aligned"):
        figure = fifesim.plot_reproduction(number, small, reading=reading)
        assert isinstance(figure, Figure) and all(axis.has_data() for axis in figure.axes)


def test_densities_of_figure_6_are_not_halved_at_zero(found):
    """The cells' curve begins at the .853 of the distribution; without reflection at .447."""
    axis = figures.plot_reproduction(6, found).axes[0]
    cells = axis.get_lines()[0].get_ydata()
    known = float(fifesim.lai_distribution("burned-grazed").pdf(0))
    assert cells[0] == pytest.approx(known, rel=0.03)


def test_reading_is_what_is_drawn(found):
    native, aligned = (figures.plot_reproduction(9, found, reading=name).axes[0] for name in ("native", "aligned"))
    points = [axis.collections[0].get_offsets() for axis in (native, aligned)]
    r2 = [np.corrcoef(*each.T)[0, 1] ** 2 for each in points]
    assert r2[0] < 0.6 < 0.8 < r2[1]
    assert f"{r2[0]:.2f}" in native.get_title()


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
def test_axes_are_those_of_the_paper(found, number, panel, points, x, y):
    """Of figure 8 the difference is below; axes are named after what they show."""
    axis = figures.plot_reproduction(number, found, reading="native").axes[panel]
    arp = float(found["arp"][-1 if panel == -1 else 0])
    values = figures.sample(found, "native", arp)
    drawn = axis.collections[points].get_offsets()
    np.testing.assert_allclose(drawn, np.stack([values[x], values[y]], axis=1), rtol=1e-12)


def test_difference_of_figure_8_is_that_of_its_upper_panel(found):
    above, below = (figures.plot_reproduction(8, found).axes[at].collections[0].get_offsets() for at in (0, 3))
    np.testing.assert_allclose(below[:, 1], above[:, 1] - above[:, 0], rtol=1e-12)


def test_sample_is_200_pixels_by_name(found):
    values = figures.sample(found, "native", 0.15)
    assert {"lai", "fpar", "ndvi", "analogue_ndvi", "boa_red", "toa_nir"} <= set(values)
    assert all(each.size == 200 and np.isfinite(each).all() for each in values.values())
    assert scaling.sample_density(values["lai"], values["lai"]).max() > 1


@pytest.mark.parametrize(
    ("number", "options", "said"),
    [
        ("5", {}, "number must be a number"),
        (2, {}, "one of 3, 4, 5, 6, 7, 8, 9"),
        (5, {"reading": "offset"}, "one of native, aligned, which were computed"),
    ],
)
def test_figure_that_there_is_not_is_refused(small, number, options, said):
    with pytest.raises((ValueError, TypeError), match=said):
        fifesim.plot_reproduction(number, small, **options)


def test_what_reproduce_did_not_give_is_refused(small):
    with pytest.raises(TypeError, match=r"found must be an xarray\.Dataset, as fifesim\.reproduce gives it"):
        fifesim.plot_reproduction(5, small[["slope"]])


def test_figure_of_table_2_shows_the_numbers_of_the_table(found):
    tables = {str(name): table.table2(found.sel(reading=name)) for name in found["reading"].values}
    axes = figures.table2_figure(tables).axes
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
