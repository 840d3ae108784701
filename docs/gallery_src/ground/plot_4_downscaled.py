"""
Downscale a map of leaf area
============================

A leaf area map with 10 m pixels, for example from Sentinel-2, has no variation within its pixels. `downscale` adds
random variation in cells of 3.33 m and preserves the mean of each pixel. This page tests it with a known ground, which
is averaged to 10 m and then downscaled.
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
    "largest change of a pixel mean:",
    f"{float(abs(fine.fifesim.aggregate(10) - lai_10m).max()):.0e}",
)

# %%
# The square on the left is shown in detail (200 m x 200 m). The downscaled cells differ from the true cells, which
# cannot be recovered from the map, but have the same statistics. Pixel borders are not visible.

# sphinx_gallery_start_ignore
# thumbnail_panel = 3
figure, axes = plt.subplots(1, 4, figsize=(12, 3.6), layout="constrained")
style = {"cmap": "YlGn", "vmin": 0, "vmax": 3.5, "interpolation": "nearest"}
axes[0].imshow(lai_10m, extent=(0, 3000, 0, 3000), **style)
axes[0].add_patch(plt.Rectangle((900, 1900), 200, 200, fill=False, edgecolor="black"))
axes[0].set_title("map, 3 km x 3 km")
views = {"true ground": ground, "map, 10 m": lai_10m, "downscaled map": fine}
for axis, (title, lai) in zip(axes[1:], views.items(), strict=True):
    down, across = lai["y"][0] - lai["y"], lai["x"] - lai["x"][0]
    part = lai[(down >= 900) & (down < 1100)][:, (across >= 900) & (across < 1100)]
    drawn = axis.imshow(part, extent=(0, 200, 0, 200), **style)
    axis.set_title(title)
axes[1].plot([10, 60], [8, 8], color="black", linewidth=2)
axes[1].text(35, 11, "50 m", ha="center", va="bottom", fontsize=9)
for axis in axes:
    axis.set(xticks=[], yticks=[])
figure.colorbar(drawn, ax=axes, shrink=0.75, label="leaf area index [m² m⁻²]")
# sphinx_gallery_end_ignore

# %%
# **Effect on a simulated image.** The relation between NDVI and leaf area is curved, so uneven grass has a lower NDVI
# than uniform grass with the same mean. The left panel compares TM images simulated from the map with the image of the
# true ground. The right panel shows the semivariance of leaf area.

laid = ground.copy(data=np.kron(lai_10m, np.ones((3, 3))))
scenes = {
    "ground": (ground, "0.6"),
    "map, not downscaled": (laid, "tab:orange"),
    "downscaled map": (fine, "tab:green"),
}

# sphinx_gallery_start_ignore
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
    width = 5 if name == "ground" else 1.5
    right.plot(along["lag"], along, color=color, linewidth=width, label=name)
left.axline((0.4, 0.4), slope=1, color="black", linewidth=1, zorder=3)
left.set(xlabel="NDVI, from the true ground", ylabel="NDVI, from the map")
left.legend(frameon=False, markerscale=8)
right.set(xlabel="lag [m]", ylabel="semivariance of leaf area index")
right.legend(frameon=False)
# sphinx_gallery_end_ignore

# %%
# Without downscaling, NDVI is too high on average and the semivariance at short lags is too small. Downscaling corrects
# most of both errors. See :doc:`/howto/my_map` for its options.
