"""
Simulate a swath and map it
===========================

The first figure shows pixels of a simulated AVHRR scan at nadir and at the edge of the swath. The second shows the same
pixels on a map grid of 2 km. Reflectance is computed for the view direction of each pixel.
"""

import matplotlib.pyplot as plt

import fifesim

# Cells of 500 m, from the track to a distance of 1000 km.
grid = fifesim.grid_at("EPSG:26914", 100e3, 4440e3, 1000e3, 60e3, 500.0)
away = {"nadir_offset": 500e3, "heading": 0.0}
lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.248, seed=7)
view = fifesim.sensor.scan_geometry("AVHRR", grid, **away).assign(sza=40.0, saa=150.0)
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
# Two windows of 60 km. At 55°, a footprint is 2.8 times as wide and 1.6 times as long as at nadir, so that scan lines
# overlap.

ends = (110, 1030)

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 2, figsize=(12, 4.6), layout="constrained")
for axis, west in zip(axes, ends, strict=True):
    ndvi.fifesim.plot(axes=axis, limits=(0.1, 0.6))
    axis.set(xlim=(west, west + 60), ylim=(4385, 4435))
    near = ndvi["vza"].where(abs(ndvi["x"] / 1000 - west - 30) < 30)
    axis.set_title(
        f"NDVI, lines and samples, view at {float(near.mean()):.0f}°", fontsize="medium"
    )
# sphinx_gallery_end_ignore

# %%
# `grid_swath` takes the nearest pixel of each cell, or the area-weighted mean of the pixels in a cell. The figure shows
# 24 km x 24 km near nadir.

around = fifesim.grid_at("EPSG:26914", 100e3, 4436e3, 1000e3, 50e3, 2000.0)
maps = {method: ndvi.fifesim.grid_swath(around, method) for method in ("nearest", "mean")}
# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 3, figsize=(12, 3.9), layout="constrained")
near = {"x": slice(130e3, 154e3), "y": slice(4424e3, 4400e3)}
nearest, mean = (each.sel(near).values for each in maps.values())
extent = (0, 24, 0, 24)
for axis, values, title in (
    (axes[0], nearest, "nearest pixel"),
    (axes[1], mean, "mean of pixels"),
):
    drawn = axis.imshow(values, extent=extent, vmin=0.1, vmax=0.6)
    axis.set_title(f"NDVI, {title}")
figure.colorbar(drawn, ax=axes[:2], label="NDVI")
drawn = axes[2].imshow(mean - nearest, extent=extent, cmap="RdBu_r", vmin=-0.05, vmax=0.05)
axes[2].set_title("mean minus nearest")
figure.colorbar(drawn, ax=axes[2], label="difference of NDVI")
for axis in axes:
    axis.set(xlabel="km", xticks=[0, 12, 24], yticks=[0, 12, 24])
spread = [f"{method} {float(each.sel(near).std()):.3f}" for method, each in maps.items()]
# sphinx_gallery_end_ignore
print("standard deviation of NDVI:", ", ".join(spread))

# %%
# Near nadir, the mean is smoother than the nearest pixel, because a cell has several pixels. At the edge of the swath
# both are similar. The view angles are mapped too, so that later steps such as the atmospheric correction use them:

surface = image.fifesim.grid_swath(around).fifesim.to_surface()
print(surface["vza"].isel(y=10, x=slice(None, None, 100)).round(1).values, "degrees")
