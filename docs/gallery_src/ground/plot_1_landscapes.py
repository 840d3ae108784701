"""
Landscapes of leaf area (Fig. 4)
================================

The same distribution of leaf area index at three values of the autoregressive parameter, ``arp``. The values of the
cells are alike; only their arrangement differs. The square is one pixel of 30 m.
"""

import matplotlib.pyplot as plt
from matplotlib.patches import Rectangle

import fifesim

# 480 m x 480 m in cells of 3.33 m, a corner of the FIFE site
grid = fifesim.fife_site(cell=30 / 9, window=((0, 144), (0, 144)))

figure, axes = plt.subplots(1, 3, figsize=(11, 3.9), layout="constrained", sharey=True)
for axis, arp in zip(axes, (0.05, 0.15, 0.24), strict=True):
    lai = fifesim.lai_scene(grid, "burned-grazed", arp=arp, seed=7)
    length = fifesim.correlation_length(arp, cell=30 / 9)
    drawn = axis.imshow(
        lai, cmap="YlGn", vmin=0, vmax=2.2, extent=(0, 480, 0, 480), interpolation="nearest"
    )
    axis.add_patch(Rectangle((30, 420), 30, 30, fill=False, edgecolor="black", linewidth=1.5))
    axis.set(
        title=f"arp {arp}: correlated over {length:.0f} m",
        xlabel="easting [m]",
        xticks=range(0, 480, 120),
    )
axes[0].set(ylabel="northing [m]", yticks=range(0, 481, 120))
figure.colorbar(drawn, ax=axes, shrink=0.8, pad=0.02, label="leaf area index [m² m⁻²]")

# %%
# How far the cells are alike decides how much of their variance the mean over a pixel keeps. The length above is where
# the correlation along a row falls to 0.05.

for arp in (0.05, 0.15, 0.24):
    lai = fifesim.lai_scene(
        fifesim.fife_site(30 / 9, window=((0, 900), (0, 900))), arp=arp, seed=7
    )
    cells, pixels = float(lai.std()), float(lai.fifesim.aggregate(30).std())
    print(
        f"arp {arp:.2f}: deviation {cells:.2f} of the cells, {pixels:.2f} of 30 m means,"
        f" {pixels / cells:.0%} kept"
    )
