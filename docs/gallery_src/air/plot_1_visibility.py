"""
What the atmosphere does to reflectance and NDVI
================================================

A raster with a coordinate ``wavelength`` needs no instrument: each band is then as narrow as the gas tables, 2.5 nm.
Here one cell has 839 of them. Grey: the responses of the Thematic Mapper.
"""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from odc.geo.xr import wrap_xr

import fifesim

grid = fifesim.grid_at("EPSG:26914", west=705000, north=4334000, width=30, height=30, cell=30)
wavelength = np.linspace(0.4025, 2.4975, 839)
cell = wrap_xr(np.ones((1, 1)), grid)
sun = fifesim.fife_geometry()  # of the paper's day
grass = fifesim.Canopy(
    leaf_optics=fifesim.Leaf(), background={"soil_dry": 0.475, "shade": 0.525}
)
spectrum = cell * xr.DataArray(
    np.ones(839), dims="band", coords={"wavelength": ("band", wavelength)}
)

figure, axis = plt.subplots(figsize=(11, 4.4), layout="constrained")
for visibility, color in ((5, "#8c510a"), (23, "#35978f"), (100, "#01665e")):
    air = fifesim.Atmosphere(visibility=visibility)
    for reflectance, style in ((0.0, ":"), (0.3, "-")):
        toa = (reflectance * spectrum).fifesim.to_toa(air, geometry=sun)
        label = f"visibility {visibility} km" if reflectance else None
        axis.plot(wavelength, toa.squeeze(), style, color=color, linewidth=1, label=label)
for band in fifesim.instrument("TM").bands:
    response = np.array(band.response.response) / max(band.response.response)
    axis.fill_between(band.response.wavelength, 0.4 * response, color="0.92", linewidth=0)
    axis.text(band.wavelength, 0.37, band.name, ha="center", fontsize=9, color="0.35")
axis.set(
    xlabel="wavelength [µm]",
    ylabel="reflectance, top of the atmosphere",
    title="A black ground (dotted) and one of reflectance 0.3 (solid)",
    xlim=(0.4, 2.5),
    ylim=(0, 0.45),
)
axis.legend(frameon=False, ncols=3, loc="upper right")

# %%
# Scattering adds light in the blue and takes contrast everywhere; gases cut their bands, which the TM bands avoid.
# Aerosol raises the red over leaves and lowers the near infrared: NDVI falls with both. Molecules and water vapour keep
# it below that of the ground even in the clearest air.

visibilities = np.array([5, 7, 10, 15, 23, 30, 45, 60, 80, 100])
areas = (0.5, 1, 2, 4)
lai = wrap_xr(
    np.array([areas], float),
    fifesim.grid_at("EPSG:26914", west=705000, north=4334000, width=120, height=30, cell=30),
)
ndvi = []
for visibility in visibilities:
    air = fifesim.Atmosphere(visibility=visibility)
    rho = lai.fifesim.surface_reflectance(
        "TM", bands=["TM3", "TM4"], geometry=sun, atmosphere=air, canopy=grass
    )
    ndvi.append(rho.fifesim.to_toa().fifesim.ndvi().values[0])
clear = {"geometry": sun, "atmosphere": fifesim.Atmosphere(), "canopy": grass}
below = (
    lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], **clear)
    .fifesim.ndvi()
    .values[0]
)

figure, axis = plt.subplots(figsize=(7, 4.4), layout="constrained")
for index, (area, color) in enumerate(
    zip(areas, plt.get_cmap("YlGn")([0.35, 0.55, 0.75, 0.95]), strict=True)
):
    axis.plot(
        visibilities,
        np.array(ndvi)[:, index],
        "o-",
        color=color,
        markersize=4,
        label=f"LAI {area:g}",
    )
    axis.plot([100, 112], [below[index]] * 2, color=color, linewidth=3)
axis.axvline(45, color="0.6", linewidth=1, linestyle=":")
axis.text(46, 0.07, "the paper's 45 km", color="0.4", fontsize=9)
axis.set(
    xlabel="visibility [km]",
    ylabel="NDVI",
    title="NDVI in space (lines) and at the ground (bars at the right)",
    ylim=(0, 1),
)
axis.legend(frameon=False, ncols=2, loc="upper left")
