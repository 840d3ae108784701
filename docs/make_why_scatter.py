"""Pictures and table of the page on the scatter between NDVI and LAI, made when the pages are built."""

from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from make_landscape_budget import TABLE, scenario_of
from matplotlib.patches import Rectangle
from odc.geo.xr import wrap_xr

import fifesim
from fifesim.experiments.scatter.shares import CURVATURE, TOTAL, VARIATION, unexplained
from fifesim.experiments.scatter.stages import pixels
from fifesim.scenario.scenario import Scenario

FOLDER = Path(__file__).parent / "tables"

# Upper left corner of the scene, and its cells along a side. [m, 1]
WEST, NORTH, CELLS = 712000.0, 4329420.0, 450

# Causes in the order in which the panels add them, and the stages of the budget that each consists of.
CAUSES = {
    "uniform pixels, perfect image": (),
    "+ LAI varies within pixels": ("non-linearity", "NDVI scaling"),
    "+ soil, dead leaves, litter vary": (
        "soil",
        "dead leaves",
        "cover",
        "clumping",
    ),
    "+ blur, noise, digital numbers": ("point spread", "noise", "quantisation"),
    "+ geolocation error": ("registration",),
    "+ terrain and atmosphere": ("topography", "atmosphere"),
}

# Rows of the table, and the rows of the budget that each sums.
ROWS = {
    "geolocation error": ("registration",),
    "soil, dead leaves and litter": ("soil", "dead leaves", "cover", "clumping"),
    "blur of the instrument": ("point spread",),
    "noise and digital numbers": ("noise", "quantisation"),
    "variation of LAI within pixels": ("non-linearity", "NDVI scaling"),
    "curved relation between LAI and NDVI": (CURVATURE,),
    "terrain": ("topography",),
    "atmosphere": ("atmosphere",),
}


class Panel(NamedTuple):
    """Pixels with the causes up to one of `CAUSES`."""

    title: str
    ndvi: np.ndarray
    lai: np.ndarray
    r2: float


def scenario(cells=CELLS):
    """The default landscape as the product of the Thematic Mapper shows it."""
    sections = scenario_of("TM").model_dump(exclude_unset=True)
    size = cells * 10 / 3
    sections["grid"] = {"west": WEST, "north": NORTH, "width": size, "height": size}
    return Scenario(**sections)


def panels(case):
    """The same pixels with one cause after another."""
    seen = pixels(case.complete())
    found, active = [], set()
    for title, stages in CAUSES.items():
        active |= set(stages)
        index = tuple(int(stage in active) for stage in seen.stages)
        lai = np.broadcast_to(seen.truth["lai"], seen.ndvi.shape)[index]
        ndvi = seen.ndvi[index]
        found.append(Panel(title, ndvi, lai, 1 - float(unexplained(lai, ndvi))))
    return found


def draw_panels(found):
    """Scatter of true LAI and NDVI, one panel for each cause."""
    figure, axes = plt.subplots(
        2, 3, figsize=(8.6, 6), layout="constrained", sharex=True, sharey=True
    )
    top = max(panel.lai.max() for panel in found)
    for number, (axis, panel) in enumerate(zip(axes.flat, found, strict=True), 1):
        axis.plot(panel.ndvi, panel.lai, ".", color="#1a9850", markersize=2, alpha=0.35)
        slope, intercept = np.polyfit(panel.ndvi, panel.lai, 1)
        line = np.array([panel.ndvi.min(), panel.ndvi.max()])
        axis.plot(line, intercept + slope * line, color="#b2182b", linewidth=1.8)
        axis.set_title(f"{number}  {panel.title}", loc="left", fontsize=10)
        axis.text(0.05, 0.9, f"R² = {panel.r2:.2f}", transform=axis.transAxes, fontsize=12)
        axis.set(ylim=(0, 1.05 * top))
        axis.spines[["top", "right"]].set_visible(False)
    for axis in axes[:, 0]:
        axis.set_ylabel("true LAI of the pixel [m² m⁻²]")
    for axis in axes[1]:
        axis.set_xlabel("NDVI")
    return figure


def mixed_pixel(low=0.3, high=4.0):
    """NDVI by LAI of uniform pixels, and of a pixel that is half `low` and half `high`."""
    area = np.linspace(0, 5, 51)
    values = np.concatenate([area, [low, high, (low + high) / 2]])
    grid = fifesim.grid_at(
        "EPSG:26914", WEST, NORTH, width=30 * len(values), height=30, cell=30
    )
    lai = wrap_xr(values[None], grid)
    canopy = fifesim.Canopy(leaf_optics=fifesim.Leaf(), background={"soil_dry": 1.0})
    rho = lai.fifesim.surface_reflectance(
        "TM",
        bands=["TM3", "TM4"],
        canopy=canopy,
        geometry=fifesim.fife_geometry(),
        atmosphere=fifesim.Atmosphere(),
    )
    ndvi = rho.fifesim.ndvi().values[0]
    red, nir = rho.values[:, 0, -3:-1].mean(axis=1)
    return area, ndvi[:-3], values[-3:], ndvi[-3:], (nir - red) / (nir + red)


def draw_pixel(case):
    """The two ways in which variation within pixels causes scatter."""
    figure, (curve, place) = plt.subplots(1, 2, figsize=(8.6, 3.7), layout="constrained")
    area, ndvi, (low, high, mean), (at_low, at_high, even), mixed = mixed_pixel()
    curve.plot(area, ndvi, color="#1a9850", linewidth=2)
    curve.plot([low, high], [at_low, at_high], "o", color="#1a9850")
    curve.plot(mean, even, "o", color="black")
    curve.plot(mean, mixed, "s", color="#b2182b")
    curve.annotate(
        "uniform pixel", (mean, even), (-8, 7), textcoords="offset points", ha="right"
    )
    text = "half sparse, half dense"
    curve.annotate(
        text, (mean, mixed), (9, -4), textcoords="offset points", color="#b2182b", va="top"
    )
    curve.set(xlabel="mean LAI of the pixel [m² m⁻²]", ylabel="NDVI", xlim=(0, 5))
    curve.set_title("A  Equal mean LAI, different NDVI", loc="left", fontsize=11)
    curve.spines[["top", "right"]].set_visible(False)
    _draw_place(place, case)
    return figure


def _draw_place(axis, case, around=20.0):
    """Cells around a typical pixel, the block of the truth and the displaced pixel."""
    tree = fifesim.simulate(case)
    lai, size = tree["scene"]["lai"].compute(), case.complete().sensor.pixel
    cell = case.grid.cell
    shift = round(case.sensor.offset[0] * size / cell)
    step = round(size / cell)
    truth, seen = _blocks(lai, step, 0), _blocks(lai, step, shift)
    error = np.abs(seen - truth)
    row, column = np.unravel_index(
        np.argmin(abs(error - np.sqrt((error**2).mean()))), error.shape
    )
    top, left, wide = (row + 1) * step, (column + 1) * step, round(around / cell)
    part = lai.values[top - wide : top + step + wide, left - wide : left + step + wide]
    extent = (-around, size + around, -around, size + around)
    drawn = axis.imshow(part, cmap="YlGn", extent=extent, interpolation="nearest")
    axis.figure.colorbar(drawn, ax=axis, label="LAI of cells [m² m⁻²]")
    found = {"truth": (0, truth, "black", "-"), "pixel": (shift * cell, seen, "#b2182b", "--")}
    for name, (at, means, color, style) in found.items():
        label = f"{name}: mean LAI {means[row, column]:.2f}"
        axis.add_patch(
            Rectangle(
                (at, -at),
                size,
                size,
                fill=False,
                edgecolor=color,
                linestyle=style,
                linewidth=2.2,
                label=label,
            )
        )
    axis.legend(loc="upper left", fontsize=9, framealpha=0.9)
    axis.set(xlabel="east [m]", ylabel="north [m]")
    axis.set_title("B  Displaced pixel, different ground", loc="left", fontsize=11)


def _blocks(lai, step, shift):
    """Means of blocks of cells, without those at the edge, displaced by some cells south and east."""
    rows, columns = (count // step - 2 for count in lai.shape)
    start = step + shift
    part = lai.values[start : start + rows * step, start : start + columns * step]
    return part.reshape(rows, step, columns, step).mean(axis=(1, 3))


def shares():
    """Share of each row of `ROWS` in the variance of LAI by instrument, and the rows for the total. [%]"""
    table = pd.read_csv(TABLE).query("variable == 'lai'").set_index(["instrument", "stage"])
    found = {}
    for name in dict.fromkeys(table.index.get_level_values("instrument")):
        own = table.loc[name]
        column = {
            row: 100 * own.loc[list(stages), "share"].sum() for row, stages in ROWS.items()
        }
        column[TOTAL] = 100 * own.loc[TOTAL, "share"]
        column[VARIATION] = 100 * own.loc[VARIATION, "alone"]
        found[name] = column
    return pd.DataFrame(found)


def share_table():
    """`shares` as Markdown."""
    found = shares()
    pixel = {name: f"{fifesim.instrument(name).gsd:g} m" for name in found}
    lines = [f"| cause | {' | '.join(f'{name}, {pixel[name]}' for name in found)} |"]
    lines.append("|---" * (1 + len(found.columns)) + "|")
    words = {
        TOTAL: "**all causes**",
        VARIATION: "*decrease of the sum if each pixel were uniform*",
    }
    for row, values in found.iterrows():
        numbers = [f"{round(value, 1) + 0.0:.1f} %".replace("-", "−") for value in values]
        numbers = [f"**{number}**" for number in numbers] if row == TOTAL else numbers
        lines.append(f"| {words.get(row, row)} | {' | '.join(numbers)} |")
    return "\n".join(lines) + "\n"


def write():
    """Write table and pictures."""
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / "scatter_shares.md").write_text(share_table(), encoding="utf-8")
    case = scenario()
    for name, figure in (
        ("why_pixel", draw_pixel(case)),
        ("why_scatter", draw_panels(panels(case))),
    ):
        figure.savefig(FOLDER / f"{name}.png", dpi=130)
        plt.close(figure)
