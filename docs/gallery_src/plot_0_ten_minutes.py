"""
Ten minutes
===========

One scene, every step seen: from leaf area on the ground to what NDVI tells of it. Each block is a step of the chain,
and each result is a DataArray that lies in the right place; run them one after the other.
"""

import matplotlib.pyplot as plt

import fifesim

# %%
# **1. The ground.** Three kilometres of the FIFE site in Kansas, in cells of 3.33 m: pastures of three treatments, each
# with its own density of leaves, on synthetic hills; leaves are denser in the draws. ``land`` is a Dataset.

grid = fifesim.fife_site(cell=30 / 9, window=((1800, 2700), (900, 1800)))
dem = fifesim.flint_hills(grid, seed=7)
land = fifesim.landscape(
    grid, soil=fifesim.Field(sd=0.03, arp=0.24), covary={"wetness": 0.5}, dem=dem, seed=7
)
land.lai.fifesim.plot()
print(land)

# %%
# **2. The light that leaves it.** SAIL gives the reflectance of each cell, and the slope decides how much sun and sky
# it has. Bands are those of an instrument: here the green, red and near infrared of the Thematic Mapper.

bands = ["TM2", "TM3", "TM4"]
rho = land.fifesim.surface_reflectance("TM", bands=bands, dem=dem)
rho.fifesim.plot()

# %%
# **3. The air.** Molecules and haze scatter light into the view and out of it. A clear day is the default;
# ``fifesim.Atmosphere(visibility=10)``, given to ``surface_reflectance``, makes a hazy one.

toa = rho.fifesim.to_toa()
print(toa.attrs["long_name"], (toa - rho).mean(["y", "x"]).round(3).values)

# %%
# **4. The instrument** blurs, samples and rounds: digital numbers of 30 m, as on the tape.

image = toa.fifesim.sense("TM")
image.fifesim.plot()
print(image.dtype, image.shape)

# %%
# **5. What NDVI tells.** The true leaf area of each pixel is known, so that the scatter about the line is known too.

ndvi, truth = image.fifesim.ndvi(), land.fifesim.aggregate(30).lai
fit = fifesim.regress(truth, ndvi)
fit.plot(truth, ndvi)
print(
    f"R² = {fit.r2:.2f}: {100 * (1 - fit.r2):.0f} % of the variance of leaf area"
    " is not in a line on NDVI"
)

# %%
# **6. The same ground through other eyes.**

images = fifesim.compare(land, ["TM", "OLI", "MSI"], fifesim.Setup(bands=None))
print(images.fifesim.comparison_table(truth=land.lai)[["pixel", "ndvi_mean", "r2"]])

# %%
# **7. Take it along.** A GIS opens the image in the right place, with bands, scale and sun.
#
# .. code-block:: python
#
#    image.fifesim.to_geotiff("tm.tif")
#    ndvi.fifesim.to_geotiff("ndvi.tif")
#
# Next: :doc:`short pages for what you want to do </howto/index>`, :doc:`the other pictures </gallery/index>`, and
# ``fifesim simulate -o fife`` for all of the site with a report.

plt.close("all")
