"""The picture of the first page: docs/_static/six.jpg. Run it after a change that moves the numbers."""

from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from make_landscape_budget import scenario_of
from matplotlib.patches import Rectangle

import fifesim
from fifesim.scenario.scenario import Scenario

FILE = Path(__file__).parent / "_static" / "six.jpg"
BANDS = ["TM4", "TM3", "TM2"]

# Upper left corner of the scene, its cells along a side, and the part that is shown larger, in pixels. [m, 1, 1]
WEST, NORTH, CELLS = 708300.0, 4329420.0, 720
TOP, LEFT, SIDE = 38, 42, 16
RATIO = 9  # cells in a pixel


class Run(NamedTuple):
    """One run: cells, pixels, the fit of leaf area on NDVI, and the budget of its scatter."""

    lai: xr.DataArray
    surface: xr.DataArray
    toa: xr.DataArray
    image: xr.DataArray
    ndvi: xr.DataArray
    truth: xr.DataArray
    fit: fifesim.Regression
    shares: xr.DataArray
    total: float


def scenario(cells=CELLS):
    """The default landscape in haze, as the Thematic Mapper's product shows it."""
    sections = scenario_of("TM").model_dump(exclude_unset=True)
    size = cells * 30 / RATIO
    sections["grid"] = {"west": WEST, "north": NORTH, "width": size, "height": size}
    sections["sensor"] |= {"bands": BANDS}
    sections["atmosphere"] = {"visibility": 12}
    return Scenario(**sections)


def run(case):
    """Simulate a scenario, and share the scatter of that very scene among the stages."""
    tree = fifesim.simulate(case)
    surface = tree["scene"]["surface_reflectance"].compute()
    image, ndvi, truth = (
        tree[name].compute() for name in ("image/dn", "image/ndvi", "truth/lai")
    )
    budget = fifesim.budget(case, realisations=1, cells=tree["scene"].sizes["x"])
    budget = budget.isel(realisation=0).sel(variable="lai")
    curvature = budget["curvature"].expand_dims(stage=["curvature"])
    return Run(
        lai=tree["scene"]["lai"].compute(),
        surface=surface,
        toa=surface.fifesim.to_toa(),
        image=image,
        ndvi=ndvi,
        truth=truth,
        fit=fifesim.regress(truth, ndvi),
        shares=xr.concat(
            [budget["share"].drop_vars("origin"), curvature], "stage", coords="minimal"
        ),
        total=float(budget["total"]),
    )


def titles(found):
    """Titles of the last two panels, with the numbers that belong together."""
    return f"Scatter: R² = {found.fit.r2:.3f}", f"Budget: {100 * found.total:.1f} % unexplained"


def draw(found):
    """Six panels, from the scene to single pixels and the budget."""
    figure, axes = plt.subplots(2, 3, figsize=(12, 8.2), layout="constrained")
    ground, light, air, image, scatter, bars = axes.flat
    names = [
        "Ground: leaf area of cells of 3.33 m",
        "Light: reflectance within the square",
        "Air: reflectance along the line",
        "Image: NDVI of 30 m pixels in the square",
        *titles(found),
    ]
    for number, (axis, name) in enumerate(zip(axes.flat, names, strict=True), 1):
        axis.set_title(f"{number}  {name}", loc="left", fontsize=11.5, fontweight="bold")
    _ground(ground, found.lai)
    _light(light, _square(found.surface, RATIO))
    _air(air, _square(found.surface, RATIO), _square(found.toa, RATIO))
    drawn = image.imshow(_square(found.ndvi), cmap="viridis", interpolation="nearest")
    figure.colorbar(drawn, ax=image, shrink=0.8, label="NDVI")
    _scale(image, 100, 30)
    _scatter(scatter, found)
    _bars(bars, found.shares)
    return figure


def _square(raster, cells=1):
    """The part that is shown larger, of a raster with so many cells in a pixel."""
    rows, columns = (slice(start * cells, (start + SIDE) * cells) for start in (TOP, LEFT))
    return raster.isel(y=rows, x=columns)


def _scale(axis, length, cell):
    """A scale bar in the lower left corner, instead of axes. [m]"""
    axis.set(xticks=[], yticks=[])
    left, right = axis.get_xlim()
    bottom, top = axis.get_ylim()
    start, height = left + 0.05 * (right - left), bottom + 0.05 * (top - bottom)
    end = start + length / cell
    axis.plot([start, end], [height, height], color="black", linewidth=6, solid_capstyle="butt")
    axis.plot([start, end], [height, height], color="white", linewidth=3, solid_capstyle="butt")
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5}
    middle = (start + end) / 2, height + 0.03 * (top - bottom)
    axis.text(*middle, f"{length} m", ha="center", va="bottom", bbox=box)


def _ground(axis, lai):
    drawn = axis.imshow(lai, cmap="YlGn", vmin=0, interpolation="nearest")
    corner, side = (LEFT * RATIO, TOP * RATIO), SIDE * RATIO
    axis.add_patch(Rectangle(corner, side, side, fill=False, edgecolor="black", linewidth=2))
    axis.get_figure().colorbar(drawn, ax=axis, shrink=0.8, label="leaf area index [m² m⁻²]")
    _scale(axis, 500, 30 / RATIO)


def _light(axis, surface):
    bands = surface.sel(band=BANDS).transpose("y", "x", "band")
    axis.imshow(
        np.clip(bands / bands.quantile(0.99, ["y", "x"]), 0, 1), interpolation="nearest"
    )
    middle = SIDE * RATIO // 2
    axis.plot([0, SIDE * RATIO - 1], [middle, middle], color="white", linewidth=1.5)
    _scale(axis, 100, 30 / RATIO)
    axis.set_xlabel("near infrared, red, green as red, green, blue")


def _air(axis, surface, toa):
    place = (np.arange(SIDE * RATIO) + 0.5) * 30 / RATIO
    for band, name, color, height in (
        ("TM4", "near infrared", "#b2182b", 0.31),
        ("TM3", "red", "#2166ac", 0.015),
    ):
        for raster, width in ((surface, 0.7), (toa, 1.7)):
            row = raster.sel(band=band).isel(y=SIDE * RATIO // 2)
            axis.plot(place, row, color=color, linewidth=width)
        axis.text(place[2], height, name, color=color)
    for label, width in (("at the ground", 0.7), ("above the atmosphere", 1.7)):
        axis.plot([], [], color="black", linewidth=width, label=label)
    axis.set(xlabel="distance [m]", ylabel="reflectance", xlim=(0, place[-1]), ylim=(0, 0.4))
    axis.legend(frameon=False, loc="upper right")


def _scatter(axis, found):
    ndvi, lai = found.ndvi.values.ravel(), found.truth.values.ravel()
    axis.plot(ndvi, lai, ".", color="#1a9850", markersize=2, alpha=0.5)
    line = np.array([np.nanmin(ndvi), np.nanmax(ndvi)])
    axis.plot(line, found.fit.predict(line), color="#b2182b", linewidth=2)
    axis.set(xlabel="NDVI of the image", ylabel="true leaf area index [m² m⁻²]", ylim=(0, None))


def _bars(axis, shares):
    """Shares of the variance of leaf area, of stages that are not ideal."""
    percent = 100 * shares[shares != 0].to_series().sort_values()
    ground = ("soil", "dead leaves", "cover")
    sensor = ("registration", "point spread", "quantisation")
    for names, color, label in (
        (ground, "#8c6d31", "ground"),
        (sensor, "#0072B2", "instrument"),
        (set(percent.index) - {*ground, *sensor}, "#888888", "other"),
    ):
        chosen = percent.where(percent.index.isin(names), 0)
        axis.barh(percent.index, chosen, color=color, label=label)
    axis.axvline(0, color="black", linewidth=0.8)
    axis.set_xlabel("share of the variance of leaf area [%]")
    axis.legend(frameon=False, loc="lower right")


if __name__ == "__main__":
    draw(run(scenario())).savefig(FILE, dpi=100, pil_kwargs={"quality": 85})
