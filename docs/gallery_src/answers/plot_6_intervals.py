"""
Coverage of intervals of retrieved leaf area
============================================

The figure shows how often intervals of retrieved leaf area contain the true value, on 40 landscapes that were not used
for training. Soil, dead leaves, chlorophyll, moisture, texture and haze vary. The images have noise, blur and a
registration error of 0.2 pixel. ``python docs/make_intervals.py`` computes the table, and :doc:`/howto/train` shows how
to train a retrieval.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

name = "intervals.csv"
table = pd.read_csv(
    next(path for path in (Path("../..") / name, Path("docs") / name) if path.exists())
)
levels = np.array([50, 80, 95])
dense = "LAI of cells uniform from 0 to 4"
oli = table[(table.instrument == "OLI") & (table.level == "toa")]
alike = oli[(oli.images == "as in the training") & (oli.pixels == "chain")]
images_are_dense = oli[(oli.images == dense) & (oli.method == "quantiles")]

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 2, figsize=(8.6, 4.2), sharey=True, layout="constrained")
colors = ["#0072B2", "#E69F00", "#009E73", "#666666"]
parts = [(row, row.method) for row in alike.itertuples()]
prior = {"landscapes": "trained on LAI of 0.3 to 1.3", dense: "trained on LAI of 0 to 4"}
both = [parts, [(row, prior[row.prior]) for row in images_are_dense.itertuples()]]
titles = ["images as in the training", "images with LAI of 0 to 4, unflagged pixels"]
for axis, own, title in zip(axes, both, titles, strict=True):
    axis.plot([40, 100], [40, 100], color="#222222", linewidth=0.8)
    for number, (row, label) in enumerate(own):
        coverage = [getattr(row, f"coverage_{level}") for level in levels]
        error = [getattr(row, f"error_{level}") for level in levels]
        at = levels + 0.8 * (number - (len(own) - 1) / 2)
        axis.errorbar(
            at, coverage, error, fmt="o", color=colors[number], label=label, capsize=2
        )
    axis.set_title(title, fontsize=10)
    axis.set_xticks(levels)
    axis.set_xlabel("level of the interval [%]")
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(frameon=False, loc="upper left")
axes[0].set_ylabel("true values in the interval [%]")
axes[0].set_ylim(0, 100)
# sphinx_gallery_end_ignore

# %%
# Points on the line are calibrated; bars are standard errors over landscapes. If the training covers the leaf area of
# the images, intervals hold. If it does not, most pixels are flagged, and the intervals of the others are too narrow.
#
# The table has all runs. A method is fitted to pixels of the whole chain, or to pixels of uniform ground. Coverage of
# the 50, 80 and 95 % intervals and flagged pixels are in per cent:

for (instrument, level), rows in table.groupby(["instrument", "level"], sort=False):
    print(f"{instrument}, {'top of the atmosphere' if level == 'toa' else 'surface'}")
    for row in rows.itertuples():
        held = " / ".join(f"{getattr(row, f'coverage_{level}'):.0f}" for level in levels)
        print(f"  {row.method}, {row.pixels} pixels; prior: {row.prior}; images: {row.images}")
        print(
            f"    RMSE {row.rmse:.2f}, width of 95 % {row.width_95:.2f}, coverage {held}, flagged {row.flagged:.0f}"
        )
