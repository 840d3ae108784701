"""
What soil, dead leaves and cover add
====================================

The last question of Friedl et al. (1995): how much scatter do soil, land cover and dead leaves add beside the
instrument? Here it is for the default landscape, which is made up
(:ref:`sphx_glr_gallery_instruments_plot_4_landscape.py` shows it), through TM, MSI and MODIS with all that is known
of each: blur, noise, and the error of the product's place. Bars are the parts of 1 − R² of leaf area on NDVI that
each stage adds, the mean over all orders in which the stages can come (Shapley); below zero a stage makes the
relation straighter. Whiskers are standard errors over the windows of the site. ``python
docs/make_landscape_budget.py`` computes the table.
"""

import textwrap
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

name = "landscape_budget.csv"
table = pd.read_csv(
    next(path for path in (Path("../..") / name, Path("docs") / name) if path.exists())
)
table = table[table["variable"] == "lai"].set_index(["instrument", "stage"])
instruments = list(dict.fromkeys(table.index.get_level_values("instrument")))
GROUND = ["soil", "dead leaves", "cover", "covariance"]
SENSOR = ["registration", "point spread", "noise", "quantisation"]
OTHERS = ["topography", "atmosphere", "NDVI scaling", "non-linearity", "curvature"]
stages = [*GROUND, *SENSOR, *OTHERS]
colors = dict(zip(["TM", "MSI", "MODIS"], ["#0072B2", "#E69F00", "#666666"], strict=True))

figure, axis = plt.subplots(figsize=(8, 6.4), layout="constrained")
for number, instrument in enumerate(instruments):
    rows = table.loc[instrument].loc[stages]
    total = table.loc[(instrument, "total")]
    at = np.arange(len(stages)) + 0.26 * (number - 1)
    label = (
        f"{instrument}, in all {100 * total['share']:.0f} ± {100 * total['share_error']:.0f} %"
    )
    error = 100 * rows["share_error"]
    axis.barh(at, 100 * rows["share"], 0.24, color=colors[instrument], label=label)
    axis.errorbar(
        100 * rows["share"],
        at,
        xerr=error,
        fmt="none",
        ecolor="#222222",
        elinewidth=0.9,
        capsize=2,
    )
for group, color in ((GROUND, "#f3ede2"), (SENSOR, "#e8eef4")):
    first, last = stages.index(group[0]), stages.index(group[-1])
    axis.axhspan(first - 0.5, last + 0.5, color=color, zorder=0)
axis.axvline(0, color="#222222", linewidth=0.8)
axis.set_yticks(range(len(stages)), stages)
axis.invert_yaxis()
axis.set_xlabel("share of the variance of leaf area that a line on NDVI does not explain [%]")
axis.spines[["top", "right", "left"]].set_visible(False)
axis.tick_params(axis="y", length=0)
axis.legend(frameon=False, loc="lower right")

# %%
# In words, with the table's own figures:

for instrument in instruments:
    shares = 100 * table.loc[instrument]["share"]
    errors = 100 * table.loc[instrument]["share_error"]
    ground, sensor = shares[GROUND[:3]].sum(), shares[SENSOR].sum()
    shown = shares.round(1) + 0.0  # no -0.0
    said = ", ".join(f"{stage} {shown[stage]:.1f} ± {errors[stage]:.1f}" for stage in GROUND)
    print(f"{instrument}: {said} % of the variance.")
    print(
        f"    Soil, dead leaves and cover add {ground:.1f} % together,"
        f" place, blur, noise and counts {sensor:.1f} %."
    )

# %%
# To cite:

tm = table.loc["TM"]


def percent(stage):
    """A share with its standard error."""
    return f"{100 * tm.loc[stage, 'share']:.1f} ± {100 * tm.loc[stage, 'share_error']:.1f} %"


side, windows = tm["cells"].iloc[0] / 300, tm["realisations"].iloc[0]
sentences = [
    f"In {windows} windows of {side:g} km of a simulated tallgrass landscape",
    "(fifesim, default scenario), a line of leaf area on the NDVI of the Thematic Mapper",
    f"leaves {percent('total')} of the variance between pixels of 30 m.",
    f"Soil adds {percent('soil')}, dead leaves {percent('dead leaves')},",
    f"leaves and litter that differ by treatment {percent('cover')};",
    f"pixels displaced by the product's stated error add {percent('registration')},",
    f"blur {percent('point spread')}.",
    "That grass is denser where it is wet and the soil dark changes this by",
    f"{percent('covariance')}: leaf area then varies more between pixels,",
    "and the same disturbances count for less.",
]
print(textwrap.fill(" ".join(sentences), 90))
plt.show()
