"""
Landscapes with several classes
===============================

The first figure shows the three grassland treatments of FIFE as fenced pastures on synthetic hills, with a simulated
Landsat-5 TM image and its NDVI. The pastures are synthetic: rectangles of 144 ha on average, a typical size for ranches
in the Flint Hills.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch
from scipy import stats

import fifesim

grid = fifesim.fife_site(cell=5)
dem = fifesim.flint_hills(grid, seed=7)
land = fifesim.landscape(grid, arp=0.2, seed=7)
rho = land.fifesim.surface_reflectance("TM", bands=["TM2", "TM3", "TM4"], dem=dem)
image = rho.fifesim.to_toa().fifesim.sense("TM")
ndvi = image.fifesim.ndvi()

# sphinx_gallery_start_ignore


def draw(axis, raster, title, **style):
    """Draw a raster with kilometres from the corner of the site."""
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
draw(axes[1], image.fifesim.rgb(), "TM image, false colour")
seen = draw(axes[2], ndvi, "NDVI of the image", cmap="viridis", vmin=0.15, vmax=0.65)
axes[0].set(ylabel="northing [km]")
below = {"orientation": "horizontal", "pad": 0.02}
legend = figure.colorbar(classes, ax=axes[0], ticks=[1, 2, 3], **below)
names = land.cover.attrs["flag_meanings"].replace("-", "-\n").split(" ")
legend.ax.set_xticklabels(names)
figure.colorbar(seen, ax=axes[2], **below)
# sphinx_gallery_end_ignore

# %%
# The pastures are visible in NDVI because the treatments differ in leaf area. Slopes that face the sun are brighter,
# but have a similar NDVI.
#
# All classes share one random field. A fence therefore changes the distribution of leaf area, but not the pattern. The
# next figure shows a corner of the scene with and without fences.

corner = fifesim.fife_site(cell=30 / 9, window=((3450, 3600), (2250, 2400)))
fenced = fifesim.landscape(corner, arp=0.24, seed=7)
alone = fifesim.landscape(
    corner, classes=fifesim.ground.fife_classes()["burned-grazed"], arp=0.24, seed=7
)

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 2, figsize=(11, 4.8), layout="constrained", sharey=True)
for axis, scene, title in zip(
    axes, (fenced, alone), ("three treatments", "burned, grazed only"), strict=True
):
    shown = axis.imshow(
        scene.lai, extent=(0, 500, 0, 500), cmap="YlGn", vmin=0, vmax=3, interpolation="nearest"
    )
    axis.set(title=title, xlabel="easting [m]")
axes[0].set(ylabel="northing [m]")
figure.colorbar(shown, ax=axes, shrink=0.8, pad=0.02, label="leaf area index [m² m⁻²]")
# sphinx_gallery_end_ignore

# %%
# Random classes can form Voronoi cells, zones between contours of a smooth field, or pastures, with given area
# fractions and size. Alternatively, use a land cover map. The last figure shows four classes in natural colour.

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

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 3, figsize=(10, 4.4), layout="constrained", sharey=True)
for axis, pattern in zip(axes, ("voronoi", "levels", "pastures"), strict=True):
    land = fifesim.landscape(
        small, cover=fifesim.ground.Patches(pattern, 400, shares), classes=table, seed=3
    )
    rho = land.fifesim.surface_reflectance("OLI", bands=["OLI4", "OLI3", "OLI2"])
    axis.imshow(np.sqrt(rho / 0.2).clip(0, 1).transpose("y", "x", "band"), extent=(0, 4, 0, 4))
    axis.set(title=pattern, xlabel="easting [km]")
axes[0].set(ylabel="northing [km]")
dots = {"wood": "#509446", "meadow": "#8aaa73", "field": "#d9d3b7", "pond": "#627885"}
handles = [Patch(color=colour, label=name) for name, colour in dots.items()]
figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
# sphinx_gallery_end_ignore

# %%
# Each class has its own leaf area, pattern and background. To define classes, see :doc:`/howto/landscape`.
