"""
Canopy reflectance, leaf area and view angle
============================================

SAIL for one row of cells whose leaf area index grows from 0 to 6.
"""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from odc.geo.xr import wrap_xr

import fifesim

grid = fifesim.grid_at(
    "EPSG:26914", west=705000, north=4334000, width=121 * 10, height=10, cell=10
)
leaf_area = np.linspace(0, 6, 121)
lai = wrap_xr(leaf_area[None], grid)
sun, air = fifesim.fife_geometry(), fifesim.Atmosphere()  # the paper's case
grass = fifesim.Canopy(
    leaf_optics=fifesim.Leaf(), background={"soil_dry": 0.475, "shade": 0.525}
)

# %%
# Red light falls and near infrared light rises with leaf area, until more leaves change nothing. Flat (planophile)
# leaves saturate first. NDVI saturates before either FPAR or the near infrared.

figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
for leaves, style in (("planophile", "--"), ("spherical", "-"), ("erectophile", ":")):
    rho = lai.fifesim.surface_reflectance(
        "TM",
        bands=["TM3", "TM4"],
        geometry=sun,
        atmosphere=air,
        canopy=grass.replace(leaf_angles=leaves),
    )
    for band, color in (("TM3", "#b2182b"), ("TM4", "#542788")):
        axes[0].plot(
            leaf_area,
            rho.sel(band=band).squeeze(),
            style,
            color=color,
            label=f"{band}, {leaves}",
        )
    axes[1].plot(
        leaf_area, rho.fifesim.ndvi().squeeze(), style, color="#1b7837", label=f"NDVI, {leaves}"
    )
axes[1].plot(
    leaf_area, lai.fifesim.fpar(geometry=sun).squeeze(), color="0.4", label="FPAR, spherical"
)
axes[0].set(
    ylabel="reflectance factor", title="Surface reflectance, sun at 28.5°, nadir", ylim=(0, 0.6)
)
axes[1].set(ylabel="NDVI at the surface, FPAR", title="NDVI and FPAR", ylim=(0, 1))
for axis in axes:
    axis.set(xlabel="leaf area index [m² m⁻²]", xlim=(0, 6))
    axis.legend(
        frameon=False,
        ncols=2,
        fontsize=8,
        loc="upper right" if axis is axes[0] else "lower right",
    )

# %%
# The same leaves seen across the principal plane. The view zenith has a sign here; it is positive toward the sun: the
# hot spot is at +``sza``. The paper's SAIL has no hot spot (section Surface Reflectance); ``hotspot``, leaf size over
# canopy height, gives it one. Angles may be rasters, so one row of cells holds all views.

views = np.union1d(np.arange(-70, 71), sun.sza)
strip = fifesim.grid_at(
    "EPSG:26914", west=705000, north=4334000, width=views.size * 10, height=10, cell=10
)
two = wrap_xr(np.full((1, views.size), 2.0), strip)  # LAI 2
side = np.where(views >= 0, sun.saa, sun.saa + 180)  # azimuth toward the sensor
angles = {"vza": wrap_xr(abs(views)[None], strip), "vaa": wrap_xr(side[None], strip)}
geometry = xr.Dataset({"sza": sun.sza, "saa": sun.saa, **angles})
figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
for hotspot, style in ((0.0, "-"), (0.05, "--"), (0.2, ":")):
    case = {"geometry": geometry, "atmosphere": air, "canopy": grass.replace(hotspot=hotspot)}
    rho = two.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], **case)
    for axis, band in zip(axes, rho.values[:, 0], strict=True):
        axis.plot(views, band, style, color="black", label=f"hotspot {hotspot:g}")
for axis, band in zip(axes, ("TM3, red, LAI 2", "TM4, near infrared, LAI 2"), strict=True):
    axis.axvline(sun.sza, color="#e08214", linewidth=1, label="the sun")
    axis.set(
        xlabel="view zenith [degree], positive toward the sun",
        ylabel="reflectance factor",
        title=band,
    )
    axis.legend(frameon=False)
