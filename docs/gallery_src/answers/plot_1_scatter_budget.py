"""
Where the scatter comes from
============================

A budget of what a line on NDVI leaves of the variance of LAI: each stage switched to its ideal, in every combination
and with the same random numbers. Landsat-4's Thematic Mapper has published noise, so that every stage is at work.
"""

import matplotlib.pyplot as plt
import numpy as np

import fifesim

arps = (0.05, 0.15, 0.24)
sensor = {"instrument": "L4TM", "interval": "native", "noise": ["all"]}
budgets = {
    arp: fifesim.budget(
        fifesim.Scenario(ground={"arp": arp}, sensor=sensor), realisations=3, cells=333
    )
    for arp in arps
}

# %%
# Shares add up to 1 − R². Smoother landscapes (a larger arp) lose less to the place of the pixels and to what the point
# spread weighs: neighbouring cells are alike. Their pixels vary more, and so noise and digital numbers count for less.

figure, axis = plt.subplots(figsize=(9, 5), layout="constrained")
stages = budgets[arps[0]]["stage"].values
used = [
    any(
        abs(each["share"].sel(stage=stage, variable="lai")).max() > 0
        for each in budgets.values()
    )
    for stage in stages
]  # this ground is one stand: no other cover, no dead leaves
stages = stages[used]
colors, hatches = ("#0072B2", "#E69F00", "#009E73"), ("", "////", "....")
for k, (arp, color, hatch) in enumerate(zip(arps, colors, hatches, strict=True)):
    one = budgets[arp].sel(variable="lai", stage=stages)
    share, error = (
        100 * one["share"].mean("realisation"),
        100 * one["share"].std("realisation", ddof=1) / np.sqrt(3),
    )
    label = f"arp {arp:g}: {100 * float(one['total'].mean()):.0f} % in all"
    style = {"color": color, "hatch": hatch, "edgecolor": "white", "linewidth": 0}
    axis.barh(
        np.arange(len(stages)) + 0.26 * (k - 1),
        share,
        0.25,
        xerr=error,
        capsize=2,
        label=label,
        **style,
    )
axis.set_yticks(np.arange(len(stages)), stages)
axis.invert_yaxis()
axis.axvline(0, color="0.2", linewidth=0.8)
axis.set_xlabel("share of the variance of LAI that a line on NDVI does not explain [%]")
axis.legend(frameon=False, loc="lower right")

# %%
# The paper's discussion names three mechanisms: the non-linearity of NDVI against LAI, the scaling of NDVI itself, and
# regularization by the sensor. It does not name the place of the pixels, which drift from their blocks here.

print("% of the variance of LAI")
print(" arp  non-linearity and curvature  NDVI scaling  point spread  registration  total")
for arp, found in budgets.items():
    mean = 100 * found.sel(variable="lai").mean("realisation")
    share = mean["share"].to_series()
    first = share["non-linearity"] + float(mean["curvature"])
    scaling, spread, place = share["NDVI scaling"], share["point spread"], share["registration"]
    print(
        f"{arp:.2f} {first:28.1f} {scaling:13.1f} {spread:13.1f} {place:13.1f}"
        f" {float(mean['total']):6.1f}"
    )
