"""
A landscape of classes
======================

The three treatments of the FIFE site in fenced pastures, on hills, and what Landsat 5 would have seen of them. The
fences are made up: rectangles of 144 ha on average, as large as ranches of the Flint Hills have them.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from scipy import stats

import fifesim

grid = fifesim.fife_site(cell=5)
dem = fifesim.flint_hills(grid, seed=7)
land = fifesim.landscape(grid, arp=0.2, seed=7)
rho = land.fifesim.surface_reflectance("TM", bands=["TM3", "TM4", "TM5"], dem=dem)
image = rho.fifesim.to_toa().fifesim.sense("TM")
ndvi = image.fifesim.ndvi()


def draw(axis, raster, title, **style):
    """A raster on kilometres from the corner of the site."""
    axis.set(title=title, xlabel="easting [km]", xticks=range(0, 16, 5), yticks=range(0, 16, 5))
    return axis.imshow(raster, extent=(0, 15, 0, 15), interpolation="antialiased", **style)


light = (
    dem.coarsen(y=4, x=4)
    .mean()
    .fifesim.illumination(geometry=fifesim.Geometry(sza=60, saa=315, vza=0, vaa=0))
)
colours = ListedColormap(["#e2c48d", "#4e8a6b", "#a9c08a"])
figure, axes = plt.subplots(1, 3, figsize=(11, 4.8), layout="compressed", sharey=True)
classes = draw(axes[0], land.cover[::3, ::3], "treatments", cmap=colours, vmin=0.5, vmax=3.5)
draw(axes[0], light, "treatments", cmap="gray", alpha=0.4)
draw(
    axes[1],
    image.fifesim.rgb(("TM5", "TM4", "TM3"), stretch=(0.1, 99.9)),
    "TM: bands 5, 4 and 3",
)
seen = draw(axes[2], ndvi, "TM: NDVI", cmap="YlGn", vmin=0.15, vmax=0.65)
axes[0].set(ylabel="northing [km]")
below = {"orientation": "horizontal", "pad": 0.02}
legend = figure.colorbar(classes, ax=axes[0], ticks=[1, 2, 3], **below)
names = land.cover.attrs["flag_meanings"].replace("-", "-\n").split(" ")
legend.ax.set_xticklabels(names)
figure.colorbar(seen, ax=axes[2], **below)

# %%
# Leaf area of all classes comes of one noise, so that the field goes on beyond a fence: its density changes, and where
# it is dense does not. Right the same ground without the fence.

corner = fifesim.fife_site(cell=30 / 9, window=((3450, 3600), (2250, 2400)))
fenced = fifesim.landscape(corner, arp=0.24, seed=7)
alone = fifesim.landscape(
    corner, classes=fifesim.fife_classes()["burned-grazed"], arp=0.24, seed=7
)
figure, axes = plt.subplots(1, 2, figsize=(11, 4.8), layout="constrained", sharey=True)
for axis, scene, title in zip(
    axes, (fenced, alone), ("treatments and their fences", "burned and grazed"), strict=True
):
    shown = axis.imshow(
        scene.lai, extent=(0, 500, 0, 500), cmap="YlGn", vmin=0, vmax=3, interpolation="nearest"
    )
    axis.set(title=title, xlabel="easting [m]")
axes[0].set(ylabel="northing [m]")
figure.colorbar(shown, ax=axes, shrink=0.8, pad=0.02, label="leaf area index [m² m⁻²]")

# %%
# Classes lie as cells about random points, as zones between contours of a smooth field, or as pastures, with the shares
# and the size that are asked for; or as your own map says. Here woods, meadows, fields and ponds in their own colours.

table = {
    "wood": fifesim.CoverClass(
        lai=stats.gamma(60, scale=0.07),
        arp=0.2,
        canopy=fifesim.Canopy(background={"dead_grass": 0.5, "shade": 0.5}),
    ),
    "meadow": fifesim.CoverClass(lai="burned-ungrazed", arp=0.2),
    "field": fifesim.CoverClass(
        lai=stats.gamma(6, scale=0.08),
        canopy=fifesim.Canopy(background={"soil_dry": 0.7, "shade": 0.3}),
    ),
    "pond": fifesim.CoverClass(
        lai=0.0, canopy=fifesim.Canopy(background={"OLI2": 0.05, "OLI3": 0.045, "OLI4": 0.03})
    ),
}
shares = {"wood": 0.3, "meadow": 0.4, "field": 0.25, "pond": 0.05}
small = fifesim.fife_site(cell=10, window=((0, 400), (0, 400)))
figure, axes = plt.subplots(1, 3, figsize=(10, 3.8), layout="constrained", sharey=True)
for axis, pattern in zip(axes, ("voronoi", "levels", "pastures"), strict=True):
    land = fifesim.landscape(
        small, cover=fifesim.Patches(pattern, 400, shares), classes=table, seed=3
    )
    rho = land.fifesim.surface_reflectance("OLI", bands=["OLI4", "OLI3", "OLI2"])
    axis.imshow(np.sqrt(rho / 0.2).clip(0, 1).transpose("y", "x", "band"), extent=(0, 4, 0, 4))
    axis.set(title=pattern, xlabel="easting [km]")
axes[0].set(ylabel="northing [km]")
