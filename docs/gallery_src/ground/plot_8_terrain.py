"""
Effect of terrain on an image
=============================

This page compares simulated TM images of the same leaf area on level ground and on synthetic hills. The first figure
shows the terrain, the second the topographic correction factor Kt (Eq. 4) and its effect on the image.
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
# The sky view factor is the fraction of diffuse light received by a slope.

# sphinx_gallery_start_ignore
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
# sphinx_gallery_end_ignore

# %%
# Kt is the ratio of irradiance on a slope to irradiance on level ground. The right panel is the difference of the
# planetary reflectance between the two images.

images = [reflectance.fifesim.to_toa().fifesim.sense("TM") for reflectance in (level, hilly)]

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
drawn = axes[0].imshow(kt, cmap="RdBu_r", vmin=0.8, vmax=1.2, extent=extent)
figure.colorbar(drawn, ax=axes[0], shrink=0.8)
axes[0].set_title("Kt in TM4")
drawn = axes[1].imshow(images[1].sel(band="TM4"), cmap="gray", vmin=60, vmax=85, extent=extent)
figure.colorbar(drawn, ax=axes[1], shrink=0.8, label="digital number")
axes[1].set_title("TM4 on slopes")
flat, slopes = (image.fifesim.to_reflectance().sel(band="TM4") for image in images)
drawn = axes[2].imshow(slopes - flat, cmap="RdBu_r", vmin=-0.05, vmax=0.05, extent=extent)
figure.colorbar(drawn, ax=axes[2], shrink=0.8, label="change of reflectance")
axes[2].set_title("TM4, slopes minus level ground")
for axis in axes:
    axis.set(xlabel="easting [km]", ylabel="northing [km]")
# sphinx_gallery_end_ignore

# %%
# The relation between NDVI and leaf area is affected much less than single bands, because the ratio cancels most of Kt.
# Some effect remains, because skylight differs in colour from direct sunlight.

truth = lai.fifesim.aggregate(30)
for image, name in zip(images, ("level ground", "slopes"), strict=True):
    print(f"{name}: R² of LAI on NDVI {fifesim.regress(truth, image.fifesim.ndvi()).r2:.3f}")
print(f"Kt of the pixels: {float(np.nanmin(kt)):.2f} to {float(np.nanmax(kt)):.2f}")
