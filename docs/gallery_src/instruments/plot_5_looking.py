"""
Looking at an image
===================

One word draws what a raster is: an image in colours, a quantity in its own, a regression with its pixels, one scene
through many instruments. Titles say what is seen, by whom, when and where; both axes have the same scale. A scene of
60 km is thinned before it is drawn, and so never loaded whole.
"""

import matplotlib.pyplot as plt

import fifesim

site = fifesim.fife_site(30 / 9, window=((0, 1500), (0, 1800)))
dem = fifesim.flint_hills(site, seed=7)
land = fifesim.landscape(site, arp=0.2, seed=7)
bands = ["MSI2", "MSI3", "MSI4", "MSI8"]
image = (
    land.fifesim.surface_reflectance("MSI", bands=bands, dem=dem)
    .fifesim.to_toa()
    .fifesim.sense("MSI")
)

image.fifesim.plot()

# %%
# ``composite="natural colour"`` or three bands by name are other colours, ``band="MSI8"`` is one band alone.
# ``image.fifesim.rgb()`` gives the colours themselves, a DataArray (y, x, rgb).

figure, axes = plt.subplots(2, 2, figsize=(12, 9), layout="constrained")
image.fifesim.plot(composite="natural colour", axes=axes[0, 0])
image.fifesim.plot(band="MSI8", axes=axes[0, 1])
dem.fifesim.plot(axes=axes[1, 0])
image.fifesim.to_surface().fifesim.index("EVI2").fifesim.plot(axes=axes[1, 1])

# %%
# A regression draws its line and what new pixels are to be expected in; with the rasters, the pixels too.

lai = land["lai"]
truth, ndvi = lai.fifesim.aggregate(10), image.fifesim.ndvi()
fit = fifesim.regress(truth, ndvi)
print(fit)
fit.plot(truth, ndvi)

# %%
# One scene through four instruments, as a table and side by side. MODIS sees the pastures, and nothing
# of what varies within them.

setup = fifesim.Setup(dem=dem)
images = fifesim.compare(lai, ["MSI", "OLI", "TM", "MODIS"], setup)
print(
    images.fifesim.comparison_table(truth=lai)
    .drop(columns=["rows", "columns", "bands"])
    .round(3)
    .to_string()
)
images.fifesim.plot_comparison()
