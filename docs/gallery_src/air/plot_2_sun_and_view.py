"""
Visibility, sun and view in NDVI
================================

The same leaves under other atmospheres. Every cell of a strip has its own sun or its own view: angles may be rasters.
The ground itself is held fixed, so all that changes is the air.
"""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from odc.geo.xr import wrap_xr

import fifesim

BANDS = ["TM3", "TM4"]
strip = fifesim.grid_at(
    "EPSG:26914", west=705000, north=4334000, width=71 * 30, height=30, cell=30
)
case = {
    "geometry": fifesim.fife_geometry(),
    "atmosphere": fifesim.Atmosphere(),
    "canopy": fifesim.Canopy(
        leaf_optics=fifesim.Leaf(), background={"soil_dry": 0.475, "shade": 0.525}
    ),
}  # of the ground; the air differs below
ground = wrap_xr(np.full((1, 71), 2.0), strip).fifesim.surface_reflectance(
    "TM", bands=BANDS, **case
)
ground = ground.drop_attrs(deep=False)


def ndvi(atmosphere, **angles):
    sun = {"sza": 30.0, "saa": 0.0, "vza": 0.0, "vaa": 0.0} | angles
    return (
        ground.fifesim.to_toa(atmosphere, geometry=xr.Dataset(sun), instrument="TM")
        .fifesim.ndvi()
        .values[0]
    )


def raster(values):
    return wrap_xr(np.asarray(values, float)[None], strip)


zenith = np.linspace(0, 70, 71)
view = np.linspace(-70, 70, 71)
azimuth = np.where(view < 0, 180.0, 0.0)
colors = {8: "#8c510a", 23: "#35978f", 80: "#003c30"}

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4), sharey=True, layout="constrained")
for visibility, color in colors.items():
    air = fifesim.Atmosphere(visibility=visibility)
    left.plot(zenith, ndvi(air, sza=raster(zenith)), color=color, label=f"{visibility} km")
    right.plot(
        view, ndvi(air, sza=45.0, vza=raster(abs(view)), vaa=raster(azimuth)), color=color
    )
    exact = fifesim.Atmosphere(visibility=visibility, engine="successive-orders")
    for angle in range(0, 71, 14):
        left.plot(angle, ndvi(exact, sza=float(angle))[0], "o", color=color, markersize=4)
    right.plot(
        view[::5],
        ndvi(exact, sza=45.0, vza=raster(abs(view)), vaa=raster(azimuth))[::5],
        "o",
        color=color,
        ms=4,
    )
below = float(ground.fifesim.ndvi()[0, 0])
for axis in (left, right):
    axis.axhline(below, color="0.5", linestyle=":")
left.text(1, below + 0.01, "at the ground", color="0.4", fontsize=9)
left.set(
    xlabel="solar zenith angle [°], view at nadir",
    ylabel="NDVI at the top of the atmosphere, LAI 2",
    ylim=(0, 0.85),
)
right.set(xlabel="view zenith angle [°], positive toward the sun; sun at 45°")
left.legend(
    frameon=False,
    title="visibility; lines 5S, dots successive orders",
    loc="lower left",
    ncols=3,
)

# %%
# Low suns and slant views look through more air. The view zenith in the right panel has a sign; it is positive toward
# the sun: the hot spot is at +``sza``, 45°. At negative angles the sensor looks against the light: aerosol scatters
# forward into the view, and NDVI falls most. The closed forms of 5S keep NDVI 0.01 too high in clear air and up to 0.05
# in haze against the light: they miss what molecules and aerosol scatter in turn, and polarization.
#
# What an atmosphere does, wavelength by wavelength:

figure, (gases, scattering) = plt.subplots(
    2, 1, figsize=(11, 5.6), sharex=True, layout="constrained", height_ratios=[2, 3]
)
spectrum = fifesim.atmosphere.spectrum(
    fifesim.Atmosphere("tropical", "maritime", 23), fifesim.Geometry(45, 0, 30, 90)
)
micrometres = spectrum["wavelength"]
gases.fill_between(micrometres, spectrum["gas_transmittance"], color="#bcd4e6", linewidth=0)
gases.set(
    ylabel="let pass by gases",
    ylim=(0, 1),
    title="Tropical air, maritime aerosol, 23 km; sun at 45°, view at 30°",
)
for name, label, color in (
    ("transmittance_down", "reaches the ground, in all", "#2166ac"),
    ("direct_transmittance_down", "reaches the ground, straight from the sun", "#67a9cf"),
    ("spherical_albedo", "comes back from the ground to the ground", "#b2182b"),
    ("path_reflectance", "reaches the sensor without the ground", "#ef8a62"),
):
    scattering.plot(micrometres, spectrum[name], color=color, linewidth=1.8, label=label)
scattering.set(
    xlim=(0.4, 2.5), ylim=(0, 1), xlabel="wavelength [µm]", ylabel="share of the light"
)
scattering.legend(loc="center right", framealpha=1, edgecolor="0.85")
