"""
What each instrument loses
==========================

The same ground, burned and grazed prairie on level land, through every instrument: which share of the variance of leaf
area a line on NDVI leaves unexplained, by stage. Cells are 3.33 m; truth is the mean over a pixel. An instrument has
the point spread function, the noise and the geolocation error that a source states. **Hatched cells are unknown, not
zero.** An instrument with an unknown term has no total, and its other shares are computed without that term. Shares are
means over 20 realisations; ``python docs/make_instruments.py`` computes the table, and ``fifesim budget --sensor MSI``
one of its rows.

The ground is one homogeneous grass: nothing in it is larger than some ten metres. Coarse pixels therefore hold little
variance to explain, and quantisation and atmosphere weigh more in them. The geolocation error of a product counts
against the truth of the same pixel.
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
table = table[table["variable"] == "lai"]
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
    [f"{name}, {pixel:g} m" for name, pixel in zip(names, sizes["pixel"], strict=True)],
    fontsize=8,
)
figure.suptitle("Share of the variance of leaf area that a line on NDVI leaves unexplained")
figure.legend(
    handles=[Patch(facecolor="white", edgecolor="0.6", hatch="////")],
    labels=["Hatched cells are unknown, not zero."],
    loc="outside lower center",
    frameon=False,
)

# %%
# R² of leaf area on NDVI, for the instruments whose terms are all known:

totals = table[table["stage"] == "total"].dropna(subset="share")
r2 = 1 - totals.pivot(index="instrument", columns="arp", values="share")
error = totals.pivot(index="instrument", columns="arp", values="share_error")
text = r2.map("{:.2f}".format) + " ± " + error.map("{:.3f}".format)
print(text.loc[[name for name in names if name in text.index]].to_string())

# %%
# Smallest and largest share of each term among the instruments where it is known. **Registration** takes most wherever
# the agency states the geolocation error of its product: the ground varies within some ten metres, and truth is read
# where the map says. **Noise and quantisation** matter where a pixel holds little variance: six bits, ten bits over a
# kilometre, the finest bands of MODIS. A **uniform atmosphere** takes little from R²: it changes the slope and the
# intercept of the line.

for stage in columns[:5]:
    print(stage)
    for arp in arps:
        found = shares.loc[arp, stage].dropna()
        least, most = found.idxmin(), found.idxmax()
        print(f"    arp {arp:.2f}: {found[least]:.2f} ({least}) to {found[most]:.2f} ({most})")
plt.show()
