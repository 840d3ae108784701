"""
Brown and green, and gaps between crowns
========================================

Dead leaves among green ones or below them, and the same leaves in crowns: what an image sees of either.
"""

import matplotlib.pyplot as plt
import numpy as np
from odc.geo.xr import wrap_xr

import fifesim

grid = fifesim.grid_at(
    "EPSG:26914", west=705000, north=4334000, width=101 * 10, height=10, cell=10
)
share = wrap_xr(np.linspace(0, 1, 101)[None], grid)
lai = wrap_xr(np.full((1, 101), 2.0), grid)
case = {
    "geometry": fifesim.fife_geometry(),
    "atmosphere": fifesim.Atmosphere(),
}  # the paper's case
grass = fifesim.Canopy(
    leaf_optics=fifesim.Leaf(),
    background={"soil_dry": 0.475, "shade": 0.525},
    brown_leaf=fifesim.Leaf(chlorophyll=0.0, carotenoids=0.0, brown=1.0, water=0.001),
)  # green and dead tallgrass
bands = ["TM3", "TM4"]

# %%
# Leaf area index 2, of which more and more is dead. Mixed, the dead leaves shade the green ones and brighten the red.
# Below them they are a background that the green leaves hide: at first NDVI falls less than half as fast.

places = {0.0: ("-", "mixed"), 0.5: ("--", "half below"), 1.0: (":", "below the green")}
figure, axes = plt.subplots(1, 3, figsize=(13, 4.2), layout="constrained")
for dissociation, (style, where) in places.items():
    dying = grass.replace(brown=share, dissociation=dissociation)
    rho = lai.fifesim.surface_reflectance("TM", bands=bands, canopy=dying, **case)
    for band, color in zip(bands, ("#b2182b", "#542788"), strict=True):
        axes[0].plot(
            share.squeeze(),
            rho.sel(band=band).squeeze(),
            style,
            color=color,
            label=f"{band}, {where}",
        )
    axes[1].plot(
        share.squeeze(),
        rho.fifesim.ndvi().squeeze(),
        style,
        color="#1b7837",
        label=f"NDVI, {where}",
    )
    green = lai.fifesim.fpar(canopy=dying, leaves="green", geometry=case["geometry"])
    axes[2].plot(
        share.squeeze(), green.squeeze(), style, color="#8c510a", label=f"green leaves, {where}"
    )
total = lai.fifesim.fpar(geometry=case["geometry"])
axes[2].plot(share.squeeze(), total.squeeze(), color="0.5", linewidth=1, label="all leaves")
axes[0].set(ylabel="reflectance factor", ylim=(0, 0.52), title="Surface reflectance, LAI 2")
axes[1].set(ylabel="NDVI at the surface", ylim=(0, 0.9), title="NDVI")
axes[2].set(ylabel="FPAR", ylim=(0, 0.9), title="Light that leaves absorb")
for axis in axes:
    axis.set(xlabel="dead share of the leaf area", xlim=(0, 1))
    axis.legend(frameon=False, fontsize=8, ncols=2 if axis is axes[0] else 1)

# %%
# So FPAR of all leaves and NDVI part ways as a canopy dies: the same light is absorbed, by leaves that can no longer
# use it. Green FPAR goes down with NDVI.
#
# The same leaf area in crowns: gaps show the ground, and the crowns, fuller of leaves, hide less of it than the same
# leaves would if they were spread.

figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
cover = share.where(share >= 0.1)
for leaf_area, style in ((1.0, ":"), (2.0, "--"), (4.0, "-")):
    rho = (lai / 2 * leaf_area).fifesim.surface_reflectance(
        "TM", bands=bands, canopy=grass.replace(crown_cover=cover), **case
    )
    for band, color in zip(bands, ("#b2182b", "#542788"), strict=True):
        axes[0].plot(
            share.squeeze(),
            rho.sel(band=band).squeeze(),
            style,
            color=color,
            label=f"{band}, LAI {leaf_area:g}",
        )
    axes[1].plot(
        share.squeeze(),
        rho.fifesim.ndvi().squeeze(),
        style,
        color="#1b7837",
        label=f"LAI {leaf_area:g}",
    )
axes[0].set(
    ylabel="reflectance factor", ylim=(0, 0.6), title="Round crowns, sun at 28.5°, nadir"
)
axes[1].set(ylabel="NDVI at the surface", ylim=(0, 1), title="NDVI")
for axis in axes:
    axis.set(xlabel="share of the ground below crowns", xlim=(0, 1))
    axis.legend(frameon=False, fontsize=8, ncols=2 if axis is axes[0] else 1, loc="upper left")
