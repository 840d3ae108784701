"""
Effect of the atmosphere on NDVI
================================

The figures show NDVI at the top of the atmosphere for different visibilities, sun and view angles, over the same
ground. In the first figure, each cell of a row has its own sun or view, because angles can be rasters.
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
}  # for the ground; the atmosphere is varied below
ground = wrap_xr(np.full((1, 71), 2.0), strip).fifesim.surface_reflectance(
    "TM", bands=BANDS, **case
)
ground = ground.drop_attrs(deep=False)


def ndvi(atmosphere, **angles):
    """NDVI at the top of the atmosphere over the same ground."""
    sun = {"sza": 30.0, "saa": 0.0, "vza": 0.0, "vaa": 0.0} | angles
    return (
        ground.fifesim.to_toa(atmosphere, geometry=xr.Dataset(sun), instrument="TM")
        .fifesim.ndvi()
        .values[0]
    )


def raster(values):
    """Raster of one row of cells."""
    return wrap_xr(np.asarray(values, float)[None], strip)


zenith = np.linspace(0, 70, 71)
view = np.linspace(-70, 70, 71)
azimuth = np.where(view < 0, 180.0, 0.0)
colors = {8: "#8c510a", 23: "#35978f", 80: "#003c30"}

# sphinx_gallery_start_ignore
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4), sharey=True, layout="constrained")
for visibility, color in colors.items():
    air = fifesim.Atmosphere(visibility=visibility)
    line = ndvi(air, sza=raster(zenith))
    left.plot(zenith, line, color=color)
    left.text(71.5, line[-1] - 0.01, f"{visibility} km", color=color, fontsize=9)
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
left.text(1, below + 0.01, "surface", color="0.4", fontsize=9)
left.set(
    xlabel="solar zenith angle [°], view at nadir",
    ylabel="NDVI at the top of the atmosphere, LAI 2",
    xlim=(-3, 82),
    ylim=(0, 0.85),
)
right.set(xlabel="view zenith angle [°], positive toward the sun; sun at 45°")
left.text(1, 0.05, "lines: 5S, dots: successive orders", fontsize=9)
# sphinx_gallery_end_ignore

# %%
# The atmosphere lowers NDVI. The effect increases with haze, for a low sun and for oblique views, because the path
# through the atmosphere is longer. The view zenith in the right panel has a sign; it is positive toward the sun: the
# hot spot is at ``sza``, 45°. At negative angles, aerosol scatters forward into the line of sight, and NDVI is lowest.
# The closed forms of 5S (lines) overestimate NDVI by 0.01 in clear air and by up to 0.05 in haze at negative angles,
# compared with successive orders of scattering (dots).
#
# **Visibility.** The next figure shows four leaf area indices.

visibilities = np.array([5, 7, 10, 15, 23, 30, 45, 60, 80, 100])
areas = (0.5, 1, 2, 4)
lai = wrap_xr(
    np.array([areas], float),
    fifesim.grid_at("EPSG:26914", west=705000, north=4334000, width=120, height=30, cell=30),
)
ndvi_by_area = []
for visibility in visibilities:
    air = fifesim.Atmosphere(visibility=visibility)
    rho = lai.fifesim.surface_reflectance(
        "TM",
        bands=["TM3", "TM4"],
        geometry=case["geometry"],
        atmosphere=air,
        canopy=case["canopy"],
    )
    ndvi_by_area.append(rho.fifesim.to_toa().fifesim.ndvi().values[0])
below = lai.fifesim.surface_reflectance("TM", bands=BANDS, **case).fifesim.ndvi().values[0]


# sphinx_gallery_start_ignore
figure, axis = plt.subplots(figsize=(7, 4.4), layout="constrained")
for index, (area, color) in enumerate(
    zip(areas, plt.get_cmap("YlGn")([0.35, 0.55, 0.75, 0.95]), strict=True)
):
    axis.plot(
        visibilities,
        np.array(ndvi_by_area)[:, index],
        "o-",
        color=color,
        markersize=4,
    )
    axis.plot(112, below[index], "s", color=color, markersize=8)
    axis.text(
        101, np.array(ndvi_by_area)[-1, index] - 0.045, f"LAI {area:g}", color=color, fontsize=9
    )
axis.axvline(45, color="0.6", linewidth=1, linestyle=":")
axis.text(46, 0.04, "45 km, as in the paper", color="0.4", fontsize=9)
axis.set(
    xlabel="visibility [km]",
    ylabel="NDVI",
    title="NDVI at the top of the atmosphere (lines) and at the surface (squares)",
    ylim=(0, 1),
)
# sphinx_gallery_end_ignore

# %%
# Aerosol increases red and decreases near infrared reflectance over vegetation. Even in clear air, molecules and water
# vapour keep NDVI below its surface value.
#
# **Spectral terms.** The last figure shows the quantities that describe an atmosphere, by wavelength.

spectrum = fifesim.atmosphere.spectrum(
    fifesim.Atmosphere("tropical", "maritime", 23), fifesim.Geometry(45, 0, 30, 90)
)

# sphinx_gallery_start_ignore
figure, (gases, scattering) = plt.subplots(
    2, 1, figsize=(11, 5.6), sharex=True, layout="constrained", height_ratios=[2, 3]
)
micrometres = spectrum["wavelength"]
gases.fill_between(micrometres, spectrum["gas_transmittance"], color="#bcd4e6", linewidth=0)
gases.set(
    ylabel="gas transmittance",
    ylim=(0, 1),
    title="Tropical air, maritime aerosol, 23 km; sun at 45°, view at 30°",
)
for name, label, color in (
    ("transmittance_down", "transmittance to the ground, total", "#2166ac"),
    ("direct_transmittance_down", "transmittance to the ground, direct", "#67a9cf"),
    ("spherical_albedo", "spherical albedo", "#b2182b"),
    ("path_reflectance", "path reflectance", "#ef8a62"),
):
    scattering.plot(micrometres, spectrum[name], color=color, linewidth=1.8, label=label)
scattering.set(
    xlim=(0.4, 2.5), ylim=(0, 1), xlabel="wavelength [µm]", ylabel="fraction of the light"
)
scattering.legend(loc="center right", framealpha=1, edgecolor="0.85")
# sphinx_gallery_end_ignore

# %%
# Scattering adds light mainly at short wavelengths. Gas absorption is strong in some bands, which the Thematic Mapper
# avoids. See :doc:`/howto/haze` for atmospheric correction.
