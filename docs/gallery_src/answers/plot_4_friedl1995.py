"""
Table 2 and Figures 3 to 9 of the paper
=======================================

This page compares ``fifesim.reproduce`` with the published results of Friedl et al. (1995) and shows its figures. The
ground is level. Leaf area, leaf optics and soil are fitted to Table 2, because the paper does not list them. *Native*
pixels have the sampling interval of Table 1 and drift from the ground blocks; *aligned* pixels coincide with them, as
the text of the paper suggests. :doc:`/paper` states which agreement is found, fitted or assumed.
"""

# sphinx_gallery_thumbnail_number = 1
import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import paper_figures
from matplotlib.backends.backend_agg import FigureCanvasAgg

import fifesim

found = fifesim.reproduce(realisations=3)

# %%
# **Table 2.** Means over three realisations, compared with the published values.

# sphinx_gallery_start_ignore
MARKERS = {
    "native": ("o", "#0072B2"),
    "aligned": ("x", "#D55E00"),
    "blur-48.6": ("^", "#009E73"),
}
PAPER = {
    "marker": "s",
    "color": "#222222",
    "markerfacecolor": "none",
    "linestyle": "none",
    "markersize": 7,
}
rows = [
    (name, float(arp)) for name in found["distribution"].values for arp in found["arp"].values
]
labels = [f"{name.replace('-', ', ')}, {arp:g}" for name, arp in rows]

figure, axes = plt.subplots(2, 3, figsize=(9.5, 6.6), layout="constrained", sharey=True)
for line, variable in zip(axes, ("lai", "fpar"), strict=True):
    for axis, name in zip(line, ("intercept", "slope", "r2"), strict=True):
        one = found.sel(variable=variable)
        published = [
            float(one[f"paper_{name}"].sel(distribution=where, arp=arp)) for where, arp in rows
        ]
        axis.plot(published, range(9), label="the paper", **PAPER)
        for reading in found["reading"].values:
            marker, color = MARKERS[str(reading)]
            mean = one[name].sel(reading=reading).mean("realisation")
            values = [float(mean.sel(distribution=where, arp=arp)) for where, arp in rows]
            axis.plot(values, range(9), marker, color=color, markersize=5, label=str(reading))
        axis.set(title=f"{variable.upper()}: {'R²' if name == 'r2' else name}")
        axis.grid(axis="y", color="0.92")
        axis.spines[["top", "right"]].set_visible(False)
for axis in axes[:, 0]:
    axis.set_yticks(range(9), labels, fontsize=8)
axes[0, 0].invert_yaxis()
figure.legend(
    *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False
)
# sphinx_gallery_end_ignore

# %%
# Native pixels reproduce R². Aligned pixels have a higher R² than published.
#
# **Other interpretations of Table 1, and terrain.** Regressions of LAI on NDVI, with the numbers of :doc:`/paper`.
# Stronger blur also lowers R², but increases the slopes.

folders = (Path("../.."), Path("docs"))
numbers = json.loads(
    next(at / "paper.json" for at in folders if (at / "paper.json").exists()).read_text("utf-8")
)

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(
    2, 2, figsize=(9.5, 6.6), layout="constrained", sharex="col", sharey=True
)
for line, dem, words in zip(
    axes, ("flat", "flint-hills"), ("level ground", "synthetic hills"), strict=True
):
    shown = [one for one in numbers["readings"] if one["dem"] == dem and one["name"] in MARKERS]
    for axis, name in zip(line, ("r2", "slope"), strict=True):
        published = [shown[0][f"paper_{name} {where} {arp:g}"] for where, arp in rows]
        axis.plot(published, range(9), label="the paper", **PAPER)
        for one in shown:
            marker, color = MARKERS[one["name"]]
            values = [one[f"{name} {where} {arp:g}"] for where, arp in rows]
            axis.plot(values, range(9), marker, color=color, markersize=5, label=one["name"])
        axis.set(title=f"{'R²' if name == 'r2' else 'slope'}, {words}")
        axis.grid(axis="y", color="0.92")
        axis.spines[["top", "right"]].set_visible(False)
for axis in axes[:, 0]:
    axis.set_yticks(range(9), labels, fontsize=8)
axes[0, 0].invert_yaxis()
figure.legend(
    *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False
)
# sphinx_gallery_end_ignore

# %%
# **Sensitivity.** Changes of the nine LAI regressions for small changes of the inputs. Slopes and intercepts depend on
# soil and leaf area. R² hardly depends on any input.

changes = numbers["sensitivity"]
names = [f"{one['name']}: {one['before']} → {one['after']}" for one in changes]
panels = {
    "lai_r2": ("R²", 1),
    "lai_slope": ("slope [%]", 100),
    "lai_intercept": ("intercept", 1),
}
# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 3, figsize=(9.5, 4.2), layout="constrained", sharey=True)
for axis, (key, (title, scale)) in zip(axes, panels.items(), strict=True):
    axis.barh(names, [scale * one[key] for one in changes], color="#0072B2")
    axis.axvline(0, color="#222222", linewidth=0.8)
    axis.set(title=f"change of {title}", xlim=(-0.12, 0.12) if scale == 1 else None)
    axis.spines[["top", "right", "left"]].set_visible(False)
    axis.tick_params(axis="y", labelsize=8, length=0)
axes[0].invert_yaxis()
# sphinx_gallery_end_ignore

# %%
# **Figures 3 to 9** for the first realisation, from the variables ``density``, ``cell_...`` and ``pixel_...`` of the
# result. ``docs/paper_figures.py`` draws them. Figure 3 shows the leaf area distributions.

# sphinx_gallery_start_ignore


def show(number, reading="native"):
    """Show a figure in the gallery."""
    canvas = FigureCanvasAgg(paper_figures.plot(number, found, reading))
    canvas.figure.set_dpi(100)
    canvas.draw()
    plt.figure(figsize=canvas.figure.get_size_inches(), dpi=100).figimage(
        np.asarray(canvas.buffer_rgba())
    )


# sphinx_gallery_end_ignore
show(3)

# %%
# Figure 4: leaf area of the burned, grazed ground at three correlation lengths.

show(4)

# %%
# Figure 5: leaf area and FPAR against NDVI of the ground and of the image.

show(5)

# %%
# Figure 6: densities of cells and of 200 pixels.

show(6)

# %%
# Figure 7: relative equivalent noise.

show(7)

# %%
# Figure 8: NDVI of the mean reflectance against the mean NDVI.

show(8)

# %%
# Figure 9: reflectance at the top of the atmosphere against surface reflectance, for native pixels.

show(9)

# %%
# Figure 9 for aligned pixels. Most of the scatter is caused by the drift of native pixels.

show(9, "aligned")
