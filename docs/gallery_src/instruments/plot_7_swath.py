"""
A swath, and what becomes of it on a map
========================================

The AVHRR turns from side to side, and one sample after the other sees the ground at a larger angle. Light is computed
in the directions of the scan; its image has lines and samples instead of rows and columns, and is then put onto a map.
"""

import matplotlib.pyplot as plt

import fifesim

# Cells of 500 m, from below the track to 1000 km beside it.
grid = fifesim.grid_at("EPSG:26914", 100e3, 4440e3, 1000e3, 60e3, 500.0)
away = {"nadir_offset": 500e3, "heading": 0.0}
lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.248, seed=7)
view = fifesim.scan_geometry("AVHRR", grid, **away).assign(sza=40.0, saa=150.0)
rho = lai.fifesim.surface_reflectance(
    "AVHRR",
    geometry=view,
    atmosphere=fifesim.Atmosphere(visibility=30),
    canopy=fifesim.Canopy(
        leaf_optics=fifesim.Leaf(), background={"soil_dry": 0.475, "shade": 0.525}
    ),
)
image = rho.fifesim.to_toa().fifesim.sense_swath("AVHRR", **away)
ndvi = image.fifesim.ndvi()

# %%
# **Pixels where they lie**, in two parts of 60 km. At 55° a footprint is 2.8 times as wide as at nadir, and 1.6 times
# as long: lines, which follow each other as at nadir, overlap.

ends = (110, 1030)
figure, axes = plt.subplots(1, 2, figsize=(12, 4.6), layout="constrained")
for axis, west in zip(axes, ends, strict=True):
    ndvi.fifesim.plot(axes=axis, limits=(0.1, 0.6))
    axis.set(xlim=(west, west + 60), ylim=(4385, 4435))
    near = ndvi["vza"].where(abs(ndvi["x"] / 1000 - west - 30) < 30)
    axis.set_title(
        f"NDVI by lines and samples, seen at {float(near.mean()):.0f}°", fontsize="medium"
    )

# %%
# **On a map of 2 km**: the nearest pixel to each cell, or the mean of the pixels that lie on it, by area. Near the
# track a cell is the mean of several pixels, at the end of one or two.

around = fifesim.grid_at("EPSG:26914", 100e3, 4436e3, 1000e3, 50e3, 2000.0)
figure, axes = plt.subplots(2, 2, figsize=(12, 8), layout="constrained")
for row, method in zip(axes, ("nearest", "mean"), strict=True):
    on_map = ndvi.fifesim.grid_swath(around, method)
    for axis, west in zip(row, ends, strict=True):
        on_map.fifesim.plot(axes=axis, limits=(0.1, 0.6))
        axis.set(xlim=(west, west + 60), ylim=(4387, 4435))
        axis.set_title(f"grid_swath(grid, {method!r})", fontsize="medium")

# %%
# The view goes onto the map with the pixels, so that all that follows knows it.

surface = image.fifesim.grid_swath(around).fifesim.to_surface()
print(surface["vza"].isel(y=10, x=slice(None, None, 100)).round(1).values, "degrees")
