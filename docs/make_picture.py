"""
The picture of the README and the first page, docs/_static/scene_and_image.png, with its numbers in the metadata.

    python docs/make_picture.py    # five minutes of processor time; run it after a change that moves the numbers
"""

import io
import json
from pathlib import Path
from typing import NamedTuple

import make_why_scatter
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.patches import ConnectionPatch, Rectangle
from PIL import Image, PngImagePlugin

import fifesim

FILE = Path(__file__).parent / "_static" / "scene_and_image.png"

# Cells of the front scene in the default landscape, and the enlarged part: first row, first column and size. [1, pixel]
WINDOW = (1800, 3600), (2700, 4500)
TOP, LEFT, SIDE = 92, 150, 16
RATIO = 9  # cells along a pixel

# Realisations and cells of `fifesim budget`.
REALISATIONS, CELLS = 20, 333


class Front(NamedTuple):
    """The front scene: the same steps as in the README and in Ten minutes, with the bands of a true colour picture."""

    land: xr.Dataset
    dem: xr.DataArray
    toa: xr.DataArray
    image: xr.DataArray
    truth: xr.DataArray

    def fit(self, image=None):
        """Regression of true LAI on the NDVI of an image."""
        return fifesim.regress(
            self.truth, (self.image if image is None else image).fifesim.ndvi()
        )


def front(window=WINDOW):
    """Simulate the front scene."""
    grid = fifesim.fife_site(cell=30 / RATIO, window=window)
    dem = fifesim.flint_hills(grid, seed=7)
    land = fifesim.landscape(grid, dem=dem, seed=7)
    bands = ["TM1", "TM2", "TM3", "TM4"]
    toa = land.fifesim.surface_reflectance("TM", bands=bands, dem=dem).fifesim.to_toa()
    return Front(land, dem, toa, toa.fifesim.sense("TM"), land.lai.fifesim.aggregate(30))


def changes(scene):
    """R² of the front scene, and with a change of one property."""
    moved = 2 * (fifesim.instrument("TM").geolocation / 30,)
    haze = fifesim.Atmosphere(visibility=10)
    light = scene.land.fifesim.surface_reflectance(
        "TM", bands=["TM3", "TM4"], dem=scene.dem, atmosphere=haze
    )
    hazy = light.fifesim.to_toa().fifesim.sense("TM")
    fine = fifesim.compare(scene.land, ["MSI"], fifesim.Setup(bands=None, dem=scene.dem))
    r2 = {
        "front": scene.fit().r2,
        "registration": scene.fit(scene.toa.fifesim.sense("TM", offset=moved)).r2,
        "noise": scene.fit(scene.toa.fifesim.sense("TM", noise=["all"])).r2,
        "registration and noise": scene.fit(
            scene.toa.fifesim.sense("TM", offset=moved, noise=["all"])
        ).r2,
        "haze": scene.fit(hazy).r2,
        "MSI": float(fine.fifesim.comparison_table(truth=scene.land.lai)["r2"]["MSI"]),
    }
    ndvi = float((hazy.fifesim.ndvi() - scene.image.fifesim.ndvi()).mean())
    return r2 | {"change of NDVI in haze": ndvi}


def default_run(scenario=None):
    """R² of `fifesim simulate`."""
    tree = fifesim.simulate(scenario or fifesim.scenario.default_scenario())
    return fifesim.regress(tree["truth/lai"], tree["image/ndvi"]).r2


def panel():
    """R² of the last panel of the page on scatter."""
    return make_why_scatter.panels(make_why_scatter.scenario())[-1].r2


def budgets(count=REALISATIONS):
    """R² of the first realisations of `fifesim budget`."""
    found = fifesim.budget(
        fifesim.scenario.default_scenario(),
        realisations=REALISATIONS,
        cells=CELLS,
        each=lambda cases: cases[:count],
    )
    return (1 - found["total"].sel(variable="lai")).values.tolist()


def numbers():
    """Numbers in the metadata of the picture."""
    with Image.open(FILE) as picture:
        return json.loads(picture.text["fifesim"])


def draw(scene, fit):
    """The image in true colour, its NDVI, cells and pixels of a part of it, and leaf area by NDVI."""
    figure = plt.figure(figsize=(15, 4.75))
    colour, green, cells, pixels, scatter = (
        figure.add_axes(place)
        for place in (
            (0.006, 0.085, 0.2667, 0.842),
            (0.284, 0.085, 0.2667, 0.842),
            (0.574, 0.553, 0.1185, 0.374),
            (0.574, 0.085, 0.1185, 0.374),
            (0.782, 0.155, 0.212, 0.772),
        )
    )
    ndvi, sharp = scene.image.fifesim.ndvi(), {"interpolation": "nearest"}
    shades = {"cmap": "YlGn", "vmin": 0.35, "vmax": 0.75, **sharp}
    colour.imshow(scene.image.fifesim.rgb("natural colour"), **sharp)
    green.imshow(ndvi, **shades)
    drawn = cells.imshow(_part(scene.land.lai, RATIO), cmap="YlGn", vmin=0, vmax=4, **sharp)
    _key(figure, drawn, 0.553, [0, 2, 4])
    _key(figure, pixels.imshow(_part(ndvi), **shades), 0.085, [0.4, 0.5, 0.6, 0.7])
    for axis, title in (
        (colour, "The image in true colour"),
        (green, "Its NDVI"),
        (cells, "LAI of 3.33 m cells"),
        (pixels, "NDVI of 30 m pixels"),
    ):
        axis.set_title(title, loc="left", fontsize=13.5)
        axis.set(xticks=[], yticks=[])
        axis.spines[:].set_visible(False)
    _scale(colour)
    _zoom(green, ((cells, 1), (pixels, 0)))
    _scatter(scatter, ndvi, scene.truth, fit)
    return figure


def _part(raster, cells=1):
    """The enlarged part of a raster with so many cells along a pixel."""
    rows, columns = (slice(start * cells, (start + SIDE) * cells) for start in (TOP, LEFT))
    return raster.isel(y=rows, x=columns)


def _key(figure, drawn, bottom, ticks):
    axis = figure.add_axes((0.696, bottom, 0.006, 0.374))
    figure.colorbar(drawn, cax=axis, ticks=ticks).ax.tick_params(labelsize=11, length=0)


def _scale(axis, length=2000):
    """A scale bar in the lower left corner. [m]"""
    height = axis.get_ylim()[0] - 8
    axis.plot([8, 8 + length / 30], [height] * 2, color="white", linewidth=3)
    middle = 8 + length / 60, height - 3
    axis.text(
        *middle, f"{length // 1000} km", color="white", ha="center", fontsize=13, weight="bold"
    )


def _zoom(axis, parts):
    """The frame of the enlarged part, with lines to a corner of each of its maps."""
    corner = LEFT - 0.5, TOP - 0.5
    axis.add_patch(Rectangle(corner, SIDE, SIDE, fill=False, edgecolor="black", linewidth=2))
    for part, height in parts:
        start = corner[0] + SIDE, corner[1] + (1 - height) * SIDE
        where = {"coordsA": axis.transData, "coordsB": part.transAxes}
        line = ConnectionPatch(start, (0, height), **where, color="#555555", linewidth=1)
        axis.get_figure().add_artist(line)


def _scatter(axis, ndvi, lai, fit):
    values = ndvi.values.ravel(), lai.values.ravel()
    cells = {"gridsize": 60, "mincnt": 1, "bins": "log", "cmap": "Greens", "linewidths": 0.1}
    axis.hexbin(*values, **cells, vmin=0.4)
    line = np.array([max(float(ndvi.min()), -fit.intercept / fit.slope), float(ndvi.max())])
    axis.plot(line, fit.predict(line), color="#b2182b", linewidth=2.5)
    axis.set_title(f"LAI by NDVI: R² = {fit.r2:.2f}", loc="left", fontsize=13.5)
    axis.set_xlabel("NDVI of a pixel", fontsize=12)
    axis.set_ylabel("its true LAI [m² m⁻²]", fontsize=12)
    axis.set_ylim(0, None)
    axis.tick_params(labelsize=11)
    axis.spines[["top", "right"]].set_visible(False)


def save(figure, found, file=FILE):
    """Write a picture with 256 colours, and its numbers."""
    buffer, text = io.BytesIO(), PngImagePlugin.PngInfo()
    figure.savefig(buffer, dpi=110)
    text.add_text("fifesim", json.dumps(found))
    picture = Image.open(buffer).convert("RGB")
    picture = picture.quantize(256, method=Image.Quantize.MAXCOVERAGE)
    picture.save(file, optimize=True, pnginfo=text)


if __name__ == "__main__":
    scene = front()
    found = changes(scene) | {"run": default_run(), "panel": panel(), "budget": budgets()}
    save(draw(scene, scene.fit()), found)
