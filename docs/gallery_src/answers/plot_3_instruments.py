"""
Information lost by each instrument
===================================

The figure shows which fraction of the variance of leaf area is not explained by a line on NDVI, by stage and
instrument. The ground is level burned, grazed prairie in cells of 3.33 m, and the truth is the mean over a pixel. Point
spread, noise and geolocation error of each instrument come from the best source: measured in flight, measured before
launch, required, or assumed; the labels state the origin of the blur. **Hatched cells are unknown, not zero.** An
instrument with an unknown term has no total, and its other shares are computed without that term. Shares are means over
8 realisations.

The table is computed by ``python docs/make_instruments.py``, and a single row by ``fifesim budget --sensor MSI``. The
ground is homogeneous grass that varies over some ten metres at most. Large pixels therefore have little variance, and
quantisation and atmosphere have larger shares.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.patches import Patch, Rectangle

table = pd.read_csv(
    next(
        path
        for path in map(Path, ("../../instruments.csv", "docs/instruments.csv"))
        if path.exists()
    )
)
every = table[table["variable"] == "lai"]
# The best known blur; the table has the ends of its uncertainty too.
table = every[every["response"] == "system"]
sizes = table.sort_values("pixel", kind="stable").drop_duplicates("instrument")
names, arps = list(sizes["instrument"]), sorted(table["arp"].unique())
shares = table.pivot(index=["arp", "instrument"], columns="stage", values="share")
# Curvature of the relation, within and between pixels: no property of an instrument.
shares["relation"] = shares[["non-linearity", "NDVI scaling", "curvature"]].sum(axis=1)
columns = (
    "point spread",
    "registration",
    "noise",
    "quantisation",
    "atmosphere",
    "relation",
    "total",
)

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(
    1, 3, figsize=(11, 0.3 * len(names) + 2), sharey=True, layout="constrained"
)
for axis, arp in zip(axes, arps, strict=True):
    cells = shares.loc[arp].loc[names, list(columns)].to_numpy()
    axis.imshow(np.ma.masked_invalid(cells), cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for (row, column), share in np.ndenumerate(cells):
        if np.isnan(share):
            corner = (column - 0.5, row - 0.5)
            axis.add_patch(
                Rectangle(corner, 1, 1, fill=False, hatch="////", edgecolor="0.6", linewidth=0)
            )
        else:
            color = "white" if share > 0.55 else "black"
            text = f"{share:.2f}".replace("-0.00", "0.00")
            axis.text(column, row, text, ha="center", va="center", fontsize=7, color=color)
    axis.axvline(len(columns) - 1.5, color="black", linewidth=1)
    axis.set_xticks(range(len(columns)), columns, rotation=45, ha="right", fontsize=8)
    axis.set(title=f"arp {arp:g}")
axes[0].set_yticks(
    range(len(names)),
    [
        f"{name}, {pixel:g} m, {origin}"
        for name, pixel, origin in zip(names, sizes["pixel"], sizes["blur origin"], strict=True)
    ],
    fontsize=8,
)
figure.suptitle("Fraction of the variance of leaf area not explained by a line on NDVI")
figure.legend(
    handles=[Patch(facecolor="white", edgecolor="0.6", hatch="////")],
    labels=["Hatched cells are unknown, not zero."],
    loc="outside lower center",
    frameon=False,
)
# sphinx_gallery_end_ignore

# %%
# R² of leaf area on NDVI for instruments with complete information, with its range at the ends of the uncertainty of
# the blur, and the origins of blur, noise and geolocation. Two instruments differ only if their ranges do not overlap:

totals = table[table["stage"] == "total"].dropna(subset="share")
r2 = 1 - totals.pivot(index="instrument", columns="arp", values="share")
error = totals.pivot(index="instrument", columns="arp", values="share_error")
ends = every[(every["stage"] == "total")].groupby(["instrument", "arp"])["share"]
low, high = (1 - each.unstack().loc[r2.index] for each in (ends.max(), ends.min()))
text = r2.map("{:.2f}".format) + " ± " + error.map("{:.3f}".format)
text += " (" + low.map("{:.2f}".format) + " to " + high.map("{:.2f}".format) + ")"
origins = sizes.set_index("instrument")[["blur origin", "noise origin", "geolocation origin"]]
print(text.join(origins).loc[[name for name in names if name in text.index]].to_string())

# %%
# Ranks by R² at arp 0.15, from the best, and the best and worst rank that the ranges allow:

middle = pd.DataFrame({"r2": r2[0.15], "low": low[0.15], "high": high[0.15]}).sort_values(
    "r2", ascending=False
)
for rank, (name, row) in enumerate(middle.iterrows(), 1):
    best = 1 + (middle["low"] > row["high"]).sum()
    worst = (middle["high"] >= row["low"]).sum()
    print(f"{rank:>2} ({best} to {worst})  {name}")

# %%
# The smallest and largest share of each term are listed below. **Registration** has the largest share wherever a
# geolocation error is published, because the ground varies over short distances. PRISMA is displaced by three pixels,
# the error that is required without control points, and AVHRR by one. **Noise and quantisation** matter if
# pixels have little variance: instruments with 6 bits, 1 km pixels with 10 bits, and the finest bands of MODIS. A
# **uniform atmosphere** has little effect on R², because it mainly changes slope and intercept.

for stage in columns[:5]:
    print(stage)
    for arp in arps:
        found = shares.loc[arp, stage].dropna()
        least, most = found.idxmin(), found.idxmax()
        print(f"    arp {arp:.2f}: {found[least]:.2f} ({least}) to {found[most]:.2f} ({most})")
