"""
A map of leaf area made a ground scene
======================================

A map at 10 m, as of Sentinel-2, says nothing of what lies below its pixels. `downscale` draws cells of 3.33 m that vary
as the autoregressive model says, while the mean of each pixel stays the map's. Here the ground is known, hills of leaf
area with uneven grass on them, and the map holds its means over 10 m.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy import stats

import fifesim

grid = fifesim.fife_site(10 / 3, window=((0, 900), (0, 900)))  # 3 km x 3 km
grass = fifesim.lai_scene(grid, stats.lognorm(0.5), arp=0.15, seed=1)
south, east = (grass["y"][0] - grass["y"]) / 3000, (grass["x"] - grass["x"][0]) / 3000
hills = 1.0 + 0.6 * np.cos(7 * south - 2 * east) * np.sin(5 * east + 2 * np.sin(6 * south))
ground = (hills * grass).transpose("y", "x").rename("lai").assign_attrs(grass.attrs)

lai_10m = ground.fifesim.aggregate(10)
fine = lai_10m.fifesim.downscale(grid, arp=0.15, cv=0.43, seed=2)
print(
    "largest difference of means over pixels:",
    f"{float(abs(fine.fifesim.aggregate(10) - lai_10m).max()):.0e}",
)

# %%
# **Three looks**, below each the square in it. The cells are not those of the ground, which nobody can know from its
# map, but of their kind, and one does not see where pixels end.

figure, axes = plt.subplots(2, 3, figsize=(10, 6.2), layout="constrained")
views = {"the ground": ground, "its map at 10 m": lai_10m, "the map downscaled": fine}
for column, (title, lai) in zip(axes.T, views.items(), strict=True):
    for axis, first, last in zip(column, (0, 900), (1500, 1100), strict=True):
        part = lai[(lai["y"][0] - lai["y"] < last) & (lai["y"][0] - lai["y"] >= first)]
        part = part[:, (lai["x"] - lai["x"][0] < last) & (lai["x"] - lai["x"][0] >= first)]
        drawn = axis.imshow(
            part,
            cmap="YlGn",
            vmin=0,
            vmax=3.5,
            extent=(first, last, last, first),
            interpolation="nearest",
        )
        axis.set(xticks=(first, last), yticks=(first, last))
    column[0].set_title(title)
    column[0].add_patch(plt.Rectangle((900, 900), 200, 200, fill=False, edgecolor="black"))
axes[1, 0].set(xlabel="[m]", ylabel="[m]")
figure.colorbar(drawn, ax=axes, shrink=0.6, label="leaf area index [m² m⁻²]")

# %%
# **What an image sees.** NDVI bends: uneven grass has a lower one than even grass of the same leaf area. Where the
# pixels of the map are laid on the ground as they are, that is lost below 10 m; with cells in them it is there again.
# So is the semivariance of the ground, within pixels and beyond.

laid = ground.copy(data=np.kron(lai_10m, np.ones((3, 3))))
scenes = {
    "ground": (ground, "black"),
    "map as it is": (laid, "tab:orange"),
    "map downscaled": (fine, "tab:green"),
}

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
seen = {}
for name, (lai, color) in scenes.items():
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    seen[name] = rho.fifesim.to_toa().fifesim.sense("TM").fifesim.ndvi()
    if name != "ground":
        bias = float((seen[name] - seen["ground"]).mean())
        label = f"{name}: {bias:+.4f} on average"
        left.plot(
            seen["ground"].values.ravel(),
            seen[name].values.ravel(),
            ".",
            color=color,
            markersize=1,
            label=label,
        )
    along = lai.fifesim.variogram(reach=60)["semivariance"].mean("direction")
    right.plot(along["lag"], along, color=color, marker="o", markersize=3, label=name)
left.axline((0.4, 0.4), slope=1, color="black", linewidth=1)
left.set(xlabel="NDVI of the ground, TM", ylabel="NDVI of the map, TM")
left.legend(frameon=False, markerscale=8)
right.set(xlabel="lag [m]", ylabel="semivariance of leaf area index")
right.legend(frameon=False)
