"""The picture of the README: docs/_static/scene_and_image.png. Run it after a change that moves the numbers."""

import io
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import ConnectionPatch, Rectangle
from PIL import Image

import fifesim
from fifesim.output.maps import image_map, stretch_of

# Extent of the picture on the ground of the default run, and the enlarged part. [m]
WEST, NORTH, WIDTH, HEIGHT = 706500.0, 4331220.0, 12000.0, 8100.0
LEFT, TOP, SIDE = 9780.0, 5700.0, 480.0

_FILE = Path(__file__).parent / "_static" / "scene_and_image.png"


def run():
    """Image, its NDVI and the truth of a part of the ground of the default run, and the cells of a part of that."""
    whole = fifesim.scenario.default_scenario()
    grid = {"west": WEST, "north": NORTH, "width": WIDTH, "height": HEIGHT}
    tree = fifesim.simulate(
        whole.model_copy(update={"grid": whole.grid.model_copy(update=grid)})
    )
    image = tree["image"].to_dataset().compute()
    return (
        image["dn"],
        image["ndvi"],
        tree["truth"]["lai"].compute(),
        _part(tree["scene"]["lai"]).compute(),
    )


def _part(raster):
    """Enlarged part."""
    size = abs(float(raster["x"][1] - raster["x"][0]))
    starts = {"y": TOP, "x": LEFT}
    return raster.isel(
        {
            axis: slice(round(at / size), round((at + SIDE) / size))
            for axis, at in starts.items()
        }
    )


def draw(dn, ndvi, truth, cells_shown):
    """Landscape, cells and pixels of a part of it, and what NDVI tells."""
    pixel, cell = (abs(float(each["x"][1] - each["x"][0])) for each in (dn, cells_shown))
    stretch = stretch_of(dn)
    figure = plt.figure(figsize=(16.8, 6.1))
    land, cells, pixels, plot = (
        figure.add_axes(place)
        for place in (
            (0.006, 0.085, 0.482, 0.84),
            (0.508, 0.545, 0.138, 0.38),
            (0.508, 0.085, 0.138, 0.38),
            (0.71, 0.13, 0.28, 0.795),
        )
    )
    extent = (0, WIDTH / 1000, 0, HEIGHT / 1000)
    # The western half in false colour, the eastern half as NDVI.
    colours, half = image_map(dn, "", stretch).pixels, dn.sizes["x"] // 2
    land.imshow(
        colours[:, :half],
        extent=(0, extent[1] / 2, *extent[2:]),
        interpolation="nearest",
        aspect="auto",
    )
    land.imshow(
        ndvi[:, half:],
        extent=(extent[1] / 2, *extent[1:]),
        cmap="YlGn",
        vmin=0.35,
        vmax=0.75,
        interpolation="nearest",
        aspect="auto",
    )
    land.axvline(extent[1] / 2, color="white", linewidth=2)
    land.set(xlim=extent[:2], ylim=extent[2:])
    corner = LEFT / 1000, (HEIGHT - TOP - SIDE) / 1000
    land.add_patch(
        Rectangle(
            corner, SIDE / 1000, SIDE / 1000, fill=False, edgecolor="black", linewidth=2.2
        )
    )
    land.plot([0.5, 2.5], [0.42, 0.42], color="white", linewidth=3)
    land.text(1.5, 0.55, "2 km", color="white", ha="center", fontsize=13, weight="bold")
    drawn = cells.imshow(cells_shown, cmap="YlGn", vmin=0, vmax=4, interpolation="nearest")
    pixels.imshow(image_map(_part(dn), "", stretch).pixels, interpolation="nearest")
    _titles(
        land,
        cells,
        pixels,
        f"Cells of {cell:.2f} m: leaf area",
        f"Landsat pixels of {pixel:g} m",
    )
    beside = figure.add_axes((0.65, 0.545, 0.006, 0.38))
    figure.colorbar(drawn, cax=beside, ticks=[0, 2, 4]).ax.tick_params(labelsize=11, length=0)
    for side, (axis, height) in zip((1, 0), ((cells, 1), (pixels, 0)), strict=True):
        start = corner[0] + SIDE / 1000, corner[1] + side * SIDE / 1000
        line = {
            "coordsA": land.transData,
            "coordsB": axis.transAxes,
            "color": "#555555",
            "linewidth": 1,
        }
        figure.add_artist(ConnectionPatch(start, (0, height), **line))
    _scatter(plot, ndvi, truth)
    return figure


def _titles(land, cells, pixels, cells_title, pixels_title):
    land.set_title(
        "What Landsat 5 would have seen: near infrared, red, green", loc="left", fontsize=15
    )
    land.set_title("NDVI, in green", loc="right", fontsize=15)
    cells.set_title(cells_title, loc="left", fontsize=13)
    pixels.set_title(pixels_title, loc="left", fontsize=13)
    for axis in (land, cells, pixels):
        axis.set(xticks=[], yticks=[])
        axis.spines[:].set_visible(False)


def _scatter(axis, ndvi, lai):
    fit = fifesim.regress(lai, ndvi)
    axis.hexbin(
        ndvi.values.ravel(),
        lai.values.ravel(),
        gridsize=75,
        mincnt=1,
        bins="log",
        cmap="Greens",
        linewidths=0.1,
        vmin=0.4,
    )
    line = np.linspace(float(ndvi.min()), float(ndvi.max()), 50)
    axis.plot(line, fit.predict(line), color="#b2182b", linewidth=2.5)
    axis.set_title(f"What its NDVI tells: R² = {fit.r2:.2f}", loc="left", fontsize=15)
    axis.set_xlabel("NDVI of the image", fontsize=13)
    axis.set_ylabel("true leaf area index [m² m⁻²]", fontsize=13)
    axis.tick_params(labelsize=11)
    axis.spines[["top", "right"]].set_visible(False)


if __name__ == "__main__":
    buffer = io.BytesIO()
    draw(*run()).savefig(buffer, dpi=100, metadata={"Software": None})
    Image.open(buffer).convert("RGB").quantize(256, method=Image.Quantize.MAXCOVERAGE).save(
        _FILE, optimize=True
    )
