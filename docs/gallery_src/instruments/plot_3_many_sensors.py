"""
One scene through many sensors, and their noise
===============================================

The same pastures, seen in red and near infrared by five instruments, each on its own pixels. Leaves and soil are the
same for all: their spectra, averaged over the response of each band.
"""

import matplotlib.pyplot as plt
import numpy as np
from odc.geo.xr import wrap_xr

import fifesim

site = fifesim.fife_site(30 / 9, window=((0, 1980), (0, 1980)))
land = fifesim.landscape(site, arp=0.24, seed=7, chunks="auto")
names = ["MSI", "TM", "OLI", "MODIS", "AVHRR"]
images = fifesim.compare(land["lai"], names).compute()

ground = site.boundingbox
figure, axes = plt.subplots(1, 5, figsize=(10, 3), layout="constrained")
for axis, name in zip(axes, names, strict=True):
    ndvi = images[name]["dn"].fifesim.ndvi()
    left, bottom, right, top = ndvi.odc.geobox.boundingbox
    spacing = abs(float(ndvi.x[1] - ndvi.x[0]))
    shown = axis.imshow(
        ndvi, extent=(left, right, bottom, top), vmin=0.15, vmax=0.6, cmap="YlGn"
    )
    axis.set_title(
        f"{name}, {spacing:.0f} m\nsd {float(ndvi.std()):.3f}",
        fontsize="medium",
    )
    axis.set(
        xlim=(ground.left, ground.right),
        ylim=(ground.bottom, ground.top),
        xticks=[],
        yticks=[],
        facecolor="0.85",
    )
figure.colorbar(shown, ax=axes, label="NDVI", shrink=0.8, extend="both")
figure.suptitle("NDVI of the same 6.6 km of ground")

# %%
# What each lets pass in the red, across the track. Their own intervals decide the frequency beyond which detail folds
# back.

figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
frequency = np.geomspace(1e-4, 0.1, 300)
for name in names:
    red = str(images[name]["band"].values[0])
    transfer = fifesim.mtf(name, red, frequency=frequency).sel(band=red, direction="across")
    (line,) = axis.semilogx(1000 * frequency, transfer, label=name)
    axis.axvline(
        1000 * float(transfer["nyquist"]), color=line.get_color(), linestyle=":", linewidth=1
    )
axis.set(
    xlabel="spatial frequency [cycles km⁻¹]",
    ylabel="modulation transfer",
    title="Dotted: Nyquist frequency",
)
axis.legend(frameon=False)

# %%
# **Noise and stripes.** A uniform target of 40 W m⁻² sr⁻¹ µm⁻¹ in TM's red band. The TM sweeps 16 lines at once,
# one for each detector: what they differ in comes back every 16 lines. The noise, 0.5 W m⁻² sr⁻¹ µm⁻¹, and the spread
# of the detectors, 0.8 %, are assumed here: no source was found for them.

model = fifesim.NoiseModel(thermal=0.5, shot=0.0, detectors=16, gain_spread=0.008)
target = wrap_xr(
    np.full((900, 900), 40.0), fifesim.fife_site(30 / 9, window=((0, 900), (0, 900)))
)
target = target.expand_dims(band=["TM3"]).assign_attrs(units="W m-2 sr-1 um-1")
figure, axes = plt.subplots(1, 3, figsize=(12, 4.6), layout="constrained")
for axis, kinds in zip(
    axes, (["thermal"], ["fixed-pattern"], ["thermal", "fixed-pattern"]), strict=True
):
    counts = target.fifesim.sense("TM", noise=kinds, seed=2, noise_models=model)[0]
    axis.imshow(counts, cmap="gray", vmin=48, vmax=54, interpolation="nearest")
    axis.set(
        title=f"{' and '.join(kinds)}: {float(counts.std()):.2f} counts",
        xlabel="column",
        ylabel="line",
    )
