"""
Convert a Sentinel-2 image to Landsat 5
=======================================

`as_seen_by` simulates the image of another instrument from surface reflectance. This page converts a simulated
Sentinel-2 scene to Landsat 5, and compares the result with a Landsat 5 image simulated directly from the ground.
"""

import matplotlib.pyplot as plt
import numpy as np

import fifesim

site = fifesim.fife_site(10 / 3, window=((0, 540), (0, 540)))
lai = 1.5 * fifesim.lai_scene(site, "burned-ungrazed", arp=0.24, seed=7)
grass = fifesim.Canopy(
    leaf_optics=fifesim.Leaf(
        structure=1.4, chlorophyll=42, brown=0.1, water=0.009, dry_matter=0.006
    ),
    background=fifesim.Background({"soil_wet": 0.6, "golden_grass": 0.4}),
    leaf_angles="campbell(63)",
)
fine = {name: lai.fifesim.surface_reflectance(name, canopy=grass) for name in ("MSI", "TM")}

# %%
# As a Sentinel-2 product, use means of the surface reflectance over 10 m.

sentinel = fine["MSI"].fifesim.aggregate(10)
air = fifesim.Atmosphere(visibility=45)  # as in the simulation of the ground
landsat = sentinel.fifesim.as_seen_by("TM", atmosphere=air)
truth = fine["TM"].fifesim.to_toa().fifesim.sense("TM")

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 3, figsize=(12, 4), layout="constrained")
images = {
    "Sentinel-2, surface": sentinel,
    "Landsat 5 from Sentinel-2": landsat,
    "Landsat 5 from the ground": truth,
}
for axis, (title, image) in zip(axes, images.items(), strict=True):
    part = image.fifesim.ndvi().sel(x=slice(705000, 705900), y=slice(4334100, 4333200))
    drawn = axis.imshow(part - part.mean(), cmap="BrBG", vmin=-0.06, vmax=0.06)
    axis.set(title=f"{title}, mean {float(part.mean()):.3f}", xticks=[], yticks=[])
figure.colorbar(drawn, ax=axes, label="NDVI minus its mean", shrink=0.8)
figure.supxlabel("900 m x 900 m", fontsize=9)
# sphinx_gallery_end_ignore

# %%
# Mean NDVI of Landsat 5 is lower, because these images are at the top of the atmosphere. The two Landsat images agree.
#
# **Errors by band.** The next figure compares `adjust_bands`, which uses all bands, with the nearest band. The leaves,
# leaf angles and soils of this scene are not part of the spectral library.

nearest = {
    "TM1": "MSI2",
    "TM2": "MSI3",
    "TM3": "MSI4",
    "TM4": "MSI8",
    "TM5": "MSI11",
    "TM7": "MSI12",
}
estimate = fine["MSI"].fifesim.adjust_bands("TM")
as_it_is = fine["MSI"].sel(band=list(nearest.values())).assign_coords(band=list(nearest))


def rms(errors):
    return 1000 * np.sqrt((errors**2).mean(("y", "x")))


# sphinx_gallery_start_ignore
figure, axis = plt.subplots(figsize=(7, 3.8), layout="constrained")
place = np.arange(len(nearest))
axis.bar(
    place - 0.2,
    rms(as_it_is.drop_vars("wavelength") - fine["TM"]),
    0.4,
    label="nearest band",
    color="0.75",
)
axis.bar(place + 0.2, rms(estimate - fine["TM"]), 0.4, label="adjust_bands", color="tab:green")
axis.plot(
    place + 0.2,
    1000 * estimate["adjustment_error"],
    "k_",
    markersize=14,
    label="stated error of adjust_bands",
)
axis.set(ylabel="error of reflectance [0.001]", title="MSI bands as TM bands")
axis.set_xticks(place, [f"{band}\nfrom {near}" for band, near in nearest.items()])
axis.legend(frameon=False)
# sphinx_gallery_end_ignore

# %%
# The errors of `adjust_bands` are smaller, and below their stated standard error.
#
# **Linear adjustment.** Published tables give one line per band pair. The last figure compares lines from the spectral
# library with NASA's.

lines = fifesim.sensor.spectral_adjustment(
    "MSI", "OLI", bands=[f"OLI{number}" for number in range(1, 8)]
)
reflectance = 0.15
ours = lines["slope"] * reflectance + lines["offset"] - reflectance
theirs = lines["published_slope"] * reflectance + lines["published_offset"] - reflectance
# sphinx_gallery_start_ignore
figure, axis = plt.subplots(figsize=(7, 3.8), layout="constrained")
place = np.arange(lines.sizes["band"])
axis.errorbar(
    place - 0.1,
    1000 * ours,
    1000 * lines["error"],
    fmt="o",
    color="tab:green",
    label="spectral_adjustment",
)
axis.plot(place + 0.1, 1000 * theirs, "s", color="tab:orange", label="NASA's HLS")
axis.axhline(0, color="0.7", linewidth=1)
axis.set(
    ylabel="OLI minus MSI at 0.15 [0.001]",
    title="MSI to OLI, one line for each band",
)
axis.set_xticks(
    place,
    [
        f"{near}\nto {band}"
        for near, band in zip(lines["source_band"].values, lines["band"].values, strict=True)
    ],
)
axis.legend(frameon=False, loc="lower right")
# sphinx_gallery_end_ignore

# %%
# Error bars are the standard deviation over the library. A line is an average over all surfaces; use `adjust_bands` for
# images with several bands. See :doc:`/howto/another_sensor`.
