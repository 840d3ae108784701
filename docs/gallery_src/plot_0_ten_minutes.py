"""
Ten minutes
===========

This page simulates one scene step by step, from leaf area on the ground to a Landsat image, and then estimates leaf
area from its NDVI. You can run the blocks in sequence. Each result is a georeferenced DataArray.
"""

import matplotlib.pyplot as plt

import fifesim

# %%
# **1. Create the ground.** The scene covers 6 km x 6 km of the FIFE site in Kansas with cells of 3.33 m. Leaf
# area is learned from a map of Konza Prairie and follows synthetic hills; soil, moisture and dead leaves vary with it.
# ``land`` is a Dataset.

grid = fifesim.fife_site(cell=30 / 9, window=((1800, 3600), (2700, 4500)))
dem = fifesim.flint_hills(grid, seed=7)
land = fifesim.landscape(grid, dem=dem, seed=7)
land.lai.fifesim.plot()
print(land)

# %%
# **2. Compute the surface reflectance.** The canopy model SAIL is evaluated for each cell. Slopes change the amount of
# direct and diffuse light. The bands are green, red and near infrared of the Thematic Mapper (TM).

bands = ["TM2", "TM3", "TM4"]
rho = land.fifesim.surface_reflectance("TM", bands=bands, dem=dem)
rho.fifesim.plot()

# %%
# **3. Add the atmosphere.** Molecules and aerosol add path radiance and reduce the contrast. The default is a clear
# day. For a hazy day, pass ``atmosphere=fifesim.Atmosphere(visibility=10)`` to ``surface_reflectance``.

toa = rho.fifesim.to_toa()
change = (toa - rho).mean(["y", "x"])
for band, value in zip(bands, change.values, strict=True):
    print(f"{band}: mean reflectance changes by {value:+.3f}")
toa.sel(band="TM3").fifesim.plot()

# %%
# **4. Simulate the sensor.** The spatial response blurs the scene, which is sampled at 30 m and digitised.

image = toa.fifesim.sense("TM")
image.fifesim.plot()
print(image.dtype, image.shape)

# %%
# **5. Estimate leaf area from NDVI.** The true leaf area of each pixel is known, so the scatter about the regression
# line is known too.

ndvi, truth = image.fifesim.ndvi(), land.fifesim.aggregate(30).lai
fit = fifesim.regress(truth, ndvi)
axes = fit.plot(truth, ndvi)
axes.set_title(f"R² = {fit.r2:.2f}")
print(f"A line on NDVI explains {100 * fit.r2:.0f} % of the variance of leaf area.")

# %%
# This is the R² of the first page of the documentation. :doc:`Why NDVI and LAI scatter </why_scatter>` explains the
# R² of other pages.

# %%
# **6. Compare instruments over the same ground.** A line explains less of the leaf area of the 10 m pixels of MSI,
# although these scatter less about a curve: leaf area varies more between small pixels, and NDVI saturates in dense
# grass.

images = fifesim.compare(land, ["TM", "MSI"], fifesim.Setup(bands=None, dem=dem))
print(images.fifesim.comparison_table(truth=land.lai)[["pixel", "ndvi_mean", "r2"]])

# %%
# **7. Save the results.** GIS software reads position, bands, scale and sun angles from the files.
#
# .. code-block:: python
#
#    image.fifesim.to_geotiff("tm.tif")
#    ndvi.fifesim.to_geotiff("ndvi.tif")
#
# Next, see the :doc:`how-to guides </howto/index>` and the :doc:`gallery </gallery/index>`, or run ``fifesim simulate
# -o fife`` to simulate the whole site with a report.

# sphinx_gallery_start_ignore
plt.close("all")
# sphinx_gallery_end_ignore
