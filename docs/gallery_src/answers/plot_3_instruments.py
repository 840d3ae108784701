"""
What each instrument loses
==========================

The same ground, burned and grazed prairie on level land, through every instrument: how much of the variance of leaf
area a line on NDVI leaves unexplained, and which stage takes it. Cells are 3.33 m; truth is the mean over a pixel. Each
instrument has the blur, the noise and the error of its product's place that a source states. **Where nobody states one
(named below the instrument), its image is better than it.** Means over 20 realisations, whiskers are standard errors;
``python docs/make_instruments.py`` computes the table, and ``fifesim budget --sensor MSI`` one of its rows.

Two things are to be kept in mind. This ground is one homogeneous grass: nothing in it is larger than some ten metres,
so that coarse pixels hold hardly any variance to explain, and what counts and air add weighs more in them. And a
product's place counts against the truth of the same pixel: a map of another instrument has an error of its own.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

table = pd.read_csv(
    next(
        path
        for path in map(Path, ("../../instruments.csv", "docs/instruments.csv"))
        if path.exists()
    )
)
table = table[table["variable"] == "lai"]

STAGES = {
    "point spread": "#0072B2",
    "registration": "#E69F00",
    "noise": "#CC79A7",
    "quantisation": "#999999",
    "atmosphere": "#56B4E9",
}

names = list(dict.fromkeys(table.sort_values("pixel", kind="stable")["instrument"]))
arps = sorted(table["arp"].unique())
figure, axes = plt.subplots(
    1, 3, figsize=(9.5, 0.42 * len(names) + 1.6), sharey=True, layout="constrained"
)
for axis, arp in zip(axes, arps, strict=True):
    of_ground = table[table["arp"] == arp].set_index(["instrument", "stage"])
    left = np.zeros(len(names))
    for stage, color in STAGES.items():
        rows = [of_ground.loc[(name, stage)] for name in names]
        share = np.array([max(row["share"], 0.0) for row in rows])
        axis.barh(names, share, left=left, color=color, height=0.72, label=stage)
        left += share
    totals = [of_ground.loc[(name, "total")] for name in names]
    rest = np.array([row["share"] for row in totals]) - left
    axis.barh(
        names,
        np.maximum(rest, 0),
        left=left,
        color="#dddddd",
        height=0.72,
        label="the relation itself",
    )
    error = [row["share_error"] for row in totals]
    axis.errorbar(
        [row["share"] for row in totals],
        names,
        xerr=error,
        fmt="none",
        ecolor="#222222",
        elinewidth=1,
    )
    axis.set(title=f"arp {arp:g}", xlim=(0, 1.05), xticks=[0, 0.5, 1])
    axis.spines[["top", "right"]].set_visible(False)
axes[0].set_ylim(len(names) - 0.4, -0.6)
known = table.drop_duplicates("instrument").set_index("instrument")
labels = []
for name in names:
    unknown = [what for what in ("blur", "noise", "place") if not known.loc[name, what]]
    labels.append(
        f"{name}, {known.loc[name, 'pixel']:g} m"
        + (f"\n(no {', '.join(unknown)})" if unknown else "")
    )
axes[0].set_yticks(range(len(names)), labels, fontsize=8)
axes[1].set_xlabel("share of the variance of leaf area left")
figure.legend(
    *axes[0].get_legend_handles_labels(),
    loc="outside lower center",
    ncols=6,
    frameon=False,
    fontsize=9,
)

# %%
# The same as numbers: R² of leaf area on NDVI.

totals = table[table["stage"] == "total"]
r2 = 1 - totals.pivot(index="instrument", columns="arp", values="share").loc[names]
error = totals.pivot(index="instrument", columns="arp", values="share_error").loc[names]
text = r2.map("{:.2f}".format) + " ± " + error.map("{:.3f}".format)
print(text.to_string())

# %%
# What the table says; the shares below are of those instruments whose error is stated. **Place first**: where the
# agency states the error of its product's place, that error alone takes most of what is lost, because the ground varies
# within some ten metres and truth is read where the map says. **Then blur**, wherever it is known; an instrument
# without a known blur looks flawless beside one whose blur was measured. **Noise and counts** matter where a pixel
# holds little variance: six bits, ten bits over a kilometre, the finest bands of MODIS. **Air that is the same
# everywhere** takes next to nothing from R²: it turns the line, which is another error.

shares = table.pivot(index=["arp", "instrument"], columns="stage", values="share")
known["all"] = True
for stage, quantity in (
    ("registration", "place"),
    ("point spread", "blur"),
    ("noise", "noise"),
    ("atmosphere", "all"),
):
    print(stage)
    for arp in arps:
        found = shares.loc[arp, stage][known[quantity]]
        least, most = found.idxmin(), found.idxmax()
        print(f"    arp {arp:.2f}: {found[least]:.2f} ({least}) to {found[most]:.2f} ({most})")
plt.show()
