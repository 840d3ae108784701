"""
Soil and NDVI
=============

The first figure shows how brightness and moisture of the soil change red and near infrared reflectance. The second
shows how variable soil brightness increases the scatter between NDVI and leaf area.
"""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import fifesim

bands = ["TM3", "TM4"]
colors = plt.get_cmap("YlGn")(np.linspace(0.3, 1, 6))

# %%
# Each coloured line has a constant leaf area and a varying soil. The lowest line is bare ground (the soil line). Grey
# lines have constant NDVI.

grid = fifesim.fife_site(cell=30, window=((0, 6), (0, 41)))
lai = fifesim.lai_scene(grid, seed=7).drop_attrs(deep=False)
lai = xr.zeros_like(lai) + xr.DataArray(
    [0.0, 0.5, 1.0, 2.0, 3.0, 5.0], dims="y", coords={"y": lai.y}
)
across = xr.zeros_like(lai) + xr.DataArray(np.linspace(0, 1, 41), dims="x", coords={"x": lai.x})
case = {"bands": bands, "geometry": fifesim.fife_geometry(), "atmosphere": fifesim.Atmosphere()}
changes = {
    "Brightness −0.1 to 0.15": fifesim.Canopy(soil=0.25 * across - 0.1),
    "Moisture 0 to 1, brightness 0.15": fifesim.Canopy(soil=0.15, moisture=across),
}

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(
    1, 2, figsize=(11, 4.6), layout="constrained", sharex=True, sharey=True
)
for axis, (title, canopy) in zip(axes, changes.items(), strict=True):
    rho = fifesim.surface_reflectance(lai, "TM", canopy=canopy, **case)
    for ndvi in (0.2, 0.4, 0.6, 0.8):
        slope = (1 + ndvi) / (1 - ndvi)
        axis.plot([0, 0.5], [0, 0.5 * slope], color="0.8", linewidth=0.8, zorder=0)
        x = min(0.33, 0.5 / slope)
        axis.annotate(f"NDVI {ndvi:g}", (x, x * slope), color="0.5", fontsize=8, ha="right")
    for row, color in zip(range(lai.sizes["y"]), colors, strict=True):
        red, near_infrared = rho.isel(y=row)
        axis.plot(red, near_infrared, color=color, linewidth=2, label=f"{float(lai[row, 0]):g}")
        axis.plot(red[-1], near_infrared[-1], "o", color=color, markersize=5)
    axis.set(title=title, xlabel="red reflectance (TM3)", xlim=(0, 0.35), ylim=(0, 0.55))
axes[0].set_ylabel("near infrared reflectance (TM4)")
axes[0].legend(title="leaf area index", frameon=False, loc="lower right", ncols=2)
axes[1].annotate("dots: brightest or wettest soil", (0.2, 0.04), fontsize=9)
# sphinx_gallery_end_ignore

# %%
# Lines of constant leaf area do not pass through the origin, unlike lines of constant NDVI. A brighter soil therefore
# lowers NDVI at low and medium leaf area. Moisture darkens the soil and therefore raises NDVI.
#
# The next figure shows simulated TM pixels of the sparsest FIFE treatment, with increasing standard deviation of soil
# brightness. The soil varies over the same distances as leaf area.

grid = fifesim.fife_site(cell=30 / 9, window=((0, 900), (0, 900)))
lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.24, seed=7)
score = fifesim.landscape(
    grid, lai=lai, soil=fifesim.ground.Field(sd=1.0, arp=0.24), seed=7
).soil
truth = lai.fifesim.aggregate(30)


def ndvi_over(deviation):
    """NDVI of a TM image over soil with a standard deviation of brightness."""
    soil = deviation * score if deviation else None
    return (
        lai.fifesim.surface_reflectance("TM", bands=bands, canopy=fifesim.Canopy(soil=soil))
        .fifesim.to_toa()
        .fifesim.sense("TM")
        .fifesim.ndvi()
    )


images = {deviation: ndvi_over(deviation) for deviation in (0.0, 0.02, 0.04, 0.06)}
soil = (0.04 * score).fifesim.aggregate(30)

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(
    1, 4, figsize=(10.5, 3.2), layout="constrained", sharex=True, sharey=True
)
for axis, (deviation, ndvi) in zip(axes, images.items(), strict=True):
    fit = fifesim.regress(truth, ndvi)
    points = axis.scatter(
        ndvi, truth, c=soil * deviation / 0.04, s=2, cmap="cividis", vmin=-0.08, vmax=0.08
    )
    line = np.array([float(ndvi.min()), float(ndvi.max())])
    axis.plot(line, fit.intercept + fit.slope * line, color="black", linewidth=1)
    axis.set(title=f"soil sd {deviation:g}: R² = {fit.r2:.3f}", xlabel="NDVI")
axes[0].set_ylabel("leaf area index, 30 m")
figure.colorbar(points, ax=axes, label="soil brightness")
# sphinx_gallery_end_ignore

# %%
# R² decreases as the soil becomes more variable. Pixels with bright soil (yellow) have a low NDVI for their leaf area,
# as if they had fewer leaves.
