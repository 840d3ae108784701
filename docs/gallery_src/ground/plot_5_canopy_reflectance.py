"""
Reflectance of canopies
=======================

The figures show how reflectance, NDVI and FPAR depend on leaf area, view angle, dead leaves and crown cover, simulated
with SAIL. Each curve is one row of cells in which a property varies.
"""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from odc.geo.xr import wrap_xr

import fifesim

sun, air = fifesim.fife_geometry(), fifesim.Atmosphere()  # as in the paper
case = {"geometry": sun, "atmosphere": air}
bands = ["TM3", "TM4"]
grass = fifesim.Canopy(
    leaf_optics=fifesim.Leaf(),
    background={"soil_dry": 0.475, "shade": 0.525},
    brown_leaf=fifesim.Leaf(chlorophyll=0.0, carotenoids=0.0, brown=1.0, water=0.001),
)


def row(values):
    """Raster of one row of cells."""
    grid = fifesim.grid_at("EPSG:26914", 705000, 4334000, 10 * len(values), 10, cell=10)
    return wrap_xr(np.asarray(values, float)[None], grid)


# sphinx_gallery_start_ignore
RED, INFRARED, GREEN = "#b2182b", "#542788", "#1b7837"


def label(axis, x, y, text, color, **style):
    """Label a line directly."""
    axis.annotate(text, (x, y), color=color, fontsize=8, **style)


# sphinx_gallery_end_ignore

# %%
# **Leaf area.** Compare three leaf angle distributions.

leaf_area = np.linspace(0, 6, 121)
lai = row(leaf_area)
angles = ("planophile", "spherical", "erectophile")
rho = {
    name: lai.fifesim.surface_reflectance(
        "TM", bands=bands, canopy=grass.replace(leaf_angles=name), **case
    )
    for name in angles
}
fpar = lai.fifesim.fpar(geometry=sun)

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
for name, style in zip(angles, ("--", "-", ":"), strict=True):
    red, infrared = rho[name].squeeze().values
    axes[0].plot(leaf_area, red, style, color=RED)
    axes[0].plot(leaf_area, infrared, style, color=INFRARED, label=name)
    axes[1].plot(leaf_area, rho[name].fifesim.ndvi().squeeze(), style, color=GREEN, label=name)
axes[1].plot(leaf_area, fpar.squeeze(), color="0.4")
label(axes[0], 4.2, 0.05, "red (TM3)", RED)
label(axes[0], 4.2, 0.46, "near infrared (TM4)", INFRARED)
label(axes[1], 0.3, 0.72, "NDVI", GREEN)
label(axes[1], 2.2, 0.6, "FPAR, spherical leaves", "0.4")
axes[0].set(
    ylabel="reflectance factor", title="Reflectance, sun at 28.5°, nadir", ylim=(0, 0.6)
)
axes[1].set(ylabel="NDVI at the surface, FPAR", title="NDVI and FPAR", ylim=(0, 1))
for axis in axes:
    axis.set(xlabel="leaf area index [m² m⁻²]", xlim=(0, 6))
    axis.legend(
        frameon=False, fontsize=8, loc="upper left" if axis is axes[0] else "center right"
    )
# sphinx_gallery_end_ignore

# %%
# Red reflectance decreases and near infrared reflectance increases with leaf area, and both saturate. NDVI saturates
# before FPAR, first for horizontal (planophile) leaves.
#
# **View angle.** The next figure shows an LAI of 2 in the principal plane. The hot spot is in the direction of the sun.
# The paper uses SAIL without hot spot; ``hotspot`` is leaf size relative to canopy height.

views = np.union1d(np.arange(-70, 71), sun.sza)
side = np.where(views >= 0, sun.saa, sun.saa + 180)  # azimuth toward the sensor
geometry = xr.Dataset(
    {"sza": sun.sza, "saa": sun.saa, "vza": row(abs(views)), "vaa": row(side)}
)
two = row(np.full(views.size, 2.0))
seen = {
    size: two.fifesim.surface_reflectance(
        "TM", bands=bands, geometry=geometry, atmosphere=air, canopy=grass.replace(hotspot=size)
    )
    for size in (0.0, 0.05, 0.2)
}

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
for (size, rho), style in zip(seen.items(), ("-", "--", ":"), strict=True):
    for axis, band in zip(axes, rho.values[:, 0], strict=True):
        axis.plot(views, band, style, color="black", label=f"hotspot {size:g}")
for axis, band in zip(axes, ("TM3, red, LAI 2", "TM4, near infrared, LAI 2"), strict=True):
    axis.axvline(sun.sza, color="#e08214", linewidth=1, label="sun")
    axis.set(
        xlabel="view zenith [degree], positive toward the sun",
        ylabel="reflectance factor",
        title=band,
    )
    axis.legend(frameon=False)
# sphinx_gallery_end_ignore

# %%
# Without hot spot, reflectance toward the sun is too low. The width of the peak increases with leaf size.
#
# **Dead leaves.** An LAI of 2 with an increasing dead fraction. With ``dissociation`` 0, dead leaves are mixed with
# green leaves. With 1, they are below them.

fraction = np.linspace(0, 1, 101)
share, lai = row(fraction), row(np.full(101, 2.0))
layers = {"mixed": 0.0, "half below": 0.5, "below green leaves": 1.0}
dying = {name: grass.replace(brown=share, dissociation=value) for name, value in layers.items()}
rho = {
    name: lai.fifesim.surface_reflectance("TM", bands=bands, canopy=canopy, **case)
    for name, canopy in dying.items()
}
green = {
    name: lai.fifesim.fpar(canopy=canopy, leaves="green", geometry=sun)
    for name, canopy in dying.items()
}

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 3, figsize=(12, 4.2), layout="constrained")
for name, style in zip(layers, ("-", "--", ":"), strict=True):
    red, infrared = rho[name].squeeze().values
    axes[0].plot(fraction, red, style, color=RED)
    axes[0].plot(fraction, infrared, style, color=INFRARED, label=name)
    axes[1].plot(fraction, rho[name].fifesim.ndvi().squeeze(), style, color=GREEN, label=name)
    axes[2].plot(fraction, green[name].squeeze(), style, color="#8c510a", label=name)
axes[2].plot(fraction, lai.fifesim.fpar(geometry=sun).squeeze(), color="0.5", linewidth=1)
label(axes[0], 0.05, 0.08, "red (TM3)", RED)
label(axes[0], 0.05, 0.31, "near infrared (TM4)", INFRARED)
label(axes[2], 0.6, 0.66, "all leaves", "0.4")
label(axes[2], 0.3, 0.3, "green leaves", "#8c510a")
axes[0].set(ylabel="reflectance factor", ylim=(0, 0.52), title="Reflectance, LAI 2")
axes[1].set(ylabel="NDVI at the surface", ylim=(0, 0.9), title="NDVI")
axes[2].set(ylabel="FPAR", ylim=(0, 0.9), title="FPAR")
for axis in axes:
    axis.set(xlabel="dead fraction of the leaf area", xlim=(0, 1))
    axis.legend(
        frameon=False, fontsize=8, loc="lower left" if axis is not axes[0] else "upper right"
    )
# sphinx_gallery_end_ignore

# %%
# NDVI follows the FPAR of green leaves, not the FPAR of all leaves, which stays constant. Dead leaves below green ones
# have a weaker effect on NDVI, because they are partly hidden.
#
# **Crowns.** The same leaf area concentrated in crowns, with gaps between them.

cover = share.where(share >= 0.1)
areas = (1.0, 2.0, 4.0)
rho = {
    area: (lai / 2 * area).fifesim.surface_reflectance(
        "TM", bands=bands, canopy=grass.replace(crown_cover=cover), **case
    )
    for area in areas
}

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
for area, style in zip(areas, (":", "--", "-"), strict=True):
    red, infrared = rho[area].squeeze().values
    axes[0].plot(fraction, red, style, color=RED)
    axes[0].plot(fraction, infrared, style, color=INFRARED, label=f"LAI {area:g}")
    axes[1].plot(
        fraction, rho[area].fifesim.ndvi().squeeze(), style, color=GREEN, label=f"LAI {area:g}"
    )
label(axes[0], 0.75, 0.1, "red (TM3)", RED)
label(axes[0], 0.7, 0.36, "near infrared (TM4)", INFRARED)
axes[0].set(
    ylabel="reflectance factor", ylim=(0, 0.6), title="Round crowns, sun at 28.5°, nadir"
)
axes[1].set(ylabel="NDVI at the surface", ylim=(0, 1), title="NDVI")
for axis in axes:
    axis.set(xlabel="crown cover", xlim=(0, 1))
    axis.legend(frameon=False, fontsize=8, loc="upper left")
# sphinx_gallery_end_ignore

# %%
# At low crown cover, NDVI depends mainly on the cover and little on leaf area, because gaps show the ground and leaves
# within crowns shade each other. To set these properties, see :doc:`/howto/canopy`.
