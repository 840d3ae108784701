"""
Sources of the scatter between NDVI and LAI
===========================================

The figure shows how much each stage contributes to 1 − R² of leaf area on NDVI: soil, dead leaves and cover, the
instrument, terrain, atmosphere and the non-linear relation itself. Friedl et al. (1995) asked this question at the end
of their paper. The ground is the synthetic default landscape (:ref:`sphx_glr_gallery_instruments_plot_4_landscape.py`),
seen by TM, MSI and MODIS with their known blur, noise and geolocation error. The share of a stage is its contribution
averaged over all orders of adding stages (Shapley value). A negative share means that the stage makes the relation more
linear. Error bars are standard errors over windows of the site. ``python docs/make_landscape_budget.py`` computes the
table.
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
GROUND = ["soil", "dead leaves", "cover"]
SENSOR = ["registration", "point spread", "noise", "quantisation"]
OTHERS = ["topography", "atmosphere", "NDVI scaling", "non-linearity", "curvature"]
stages = [*GROUND, *SENSOR, *OTHERS]

# sphinx_gallery_start_ignore
colors = dict(zip(["TM", "MSI", "MODIS"], ["#0072B2", "#E69F00", "#666666"], strict=True))

figure, axis = plt.subplots(figsize=(8, 6.4), layout="constrained")
for number, instrument in enumerate(instruments):
    rows = table.loc[instrument].loc[stages]
    total = table.loc[(instrument, "total")]
    at = np.arange(len(stages)) + 0.26 * (number - 1)
    label = (
        f"{instrument}, total {100 * total['share']:.0f} ± {100 * total['share_error']:.0f} %"
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
axis.set_xlabel("share of the variance of leaf area not explained by a line on NDVI [%]")
axis.spines[["top", "right", "left"]].set_visible(False)
axis.tick_params(axis="y", length=0)
axis.legend(frameon=False, loc="upper right")
# sphinx_gallery_end_ignore

# %%
# *Curvature* remains with all stages ideal. Pixels of MODIS hold valleys and slopes, so that registration and
# non-linearity have large shares. The values for the ground and the instrument:

for instrument in instruments:
    shares = 100 * table.loc[instrument]["share"]
    errors = 100 * table.loc[instrument]["share_error"]
    ground, sensor = shares[GROUND].sum(), shares[SENSOR].sum()
    shown = shares.round(1) + 0.0  # no -0.0
    listed = ", ".join(f"{stage} {shown[stage]:.1f} ± {errors[stage]:.1f}" for stage in GROUND)
    print(f"{instrument}: {listed} % of the variance.")
    print(
        f"    In total, soil, dead leaves and cover contribute {ground:.1f} %,"
        f" registration, point spread, noise and quantisation {sensor:.1f} %."
    )

# %%
# The result for TM in a form that can be cited:

tm = table.loc["TM"]


def percent(stage):
    """Share with its standard error."""
    return f"{100 * tm.loc[stage, 'share']:.1f} ± {100 * tm.loc[stage, 'share_error']:.1f} %"


side, windows = tm["cells"].iloc[0] / 300, tm["realisations"].iloc[0]
sentences = [
    f"In {windows} windows of {side:g} km of a simulated tallgrass landscape",
    "(fifesim, default scenario), a linear regression of leaf area on the NDVI of the",
    f"Thematic Mapper leaves {percent('total')} of the variance between pixels of 30 m unexplained.",
    f"Soil contributes {percent('soil')}, dead leaves {percent('dead leaves')},",
    f"and treatment-dependent leaves and litter {percent('cover')};",
    f"the stated geolocation error of the product contributes {percent('registration')},",
    f"and the point spread {percent('point spread')}.",
]
print(textwrap.fill(" ".join(sentences), 90))
