"""
What terrain does to an image
=============================

Synthetic Flint Hills, the light on their slopes (Eq. 4), and the same leaf area seen with and without them.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LightSource

import fifesim

grid = fifesim.fife_site(cell=10.0, window=((0, 600), (0, 600)))
dem = fifesim.flint_hills(grid, seed=7)
lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7)
level = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
hilly = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], dem=dem)
kt = level.fifesim.kt(dem).sel(band="TM4")
extent = (0, 6, 0, 6)

# %%
# Shaded relief, slope and the share of the sky that a slope sees.
figure, axes = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
relief = LightSource(azdeg=315, altdeg=45).hillshade(dem.values, vert_exag=2, dx=10, dy=10)
axes[0].imshow(relief, cmap="gray", extent=extent)
axes[0].set_title("Shaded relief")
for axis, raster, title, cmap in (
    (axes[1], dem.fifesim.slope(), "Slope [degrees]", "YlOrBr"),
    (axes[2], dem.fifesim.sky_view(), "Sky view factor Vd", "Greys_r"),
):
    drawn = axis.imshow(raster, cmap=cmap, extent=extent)
    figure.colorbar(drawn, ax=axis, shrink=0.8)
    axis.set_title(title)
for axis in axes:
    axis.set(xlabel="easting [km]", ylabel="northing [km]")

# %%
# The topographic correction factor, and the near infrared image on level ground and on slopes.
figure, axes = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
drawn = axes[0].imshow(kt, cmap="RdBu_r", vmin=0.8, vmax=1.2, extent=extent)
figure.colorbar(drawn, ax=axes[0], shrink=0.8)
axes[0].set_title("Kt in TM4")
images = [reflectance.fifesim.to_toa().fifesim.sense("TM") for reflectance in (level, hilly)]
for axis, image, title in zip(
    axes[1:], images, ("TM4 on level ground", "TM4 on slopes"), strict=True
):
    axis.imshow(image.sel(band="TM4"), cmap="gray", vmin=60, vmax=85, extent=extent)
    axis.set_title(title)
for axis in axes:
    axis.set(xlabel="easting [km]", ylabel="northing [km]")

# %%
# NDVI is a ratio and keeps most of its information, but not all: skylight has another colour than the sun.
truth = lai.fifesim.aggregate(30)
for image, name in zip(images, ("level ground", "slopes"), strict=True):
    print(f"{name}: R2 of LAI on NDVI {fifesim.regress(truth, image.fifesim.ndvi()).r2:.3f}")
print(f"Kt of the pixels: {float(np.nanmin(kt)):.2f} to {float(np.nanmax(kt)):.2f}")

plt.show()
