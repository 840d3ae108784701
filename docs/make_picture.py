"""The picture of the README: docs/_static/scene_and_image.png. Run it after a change that moves the numbers."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fifesim

grid = fifesim.fife_site(cell=30 / 9, window=((0, 900), (0, 900)))
lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.24, seed=7)
image = (
    lai.fifesim.surface_reflectance("TM", bands=["TM4", "TM3", "TM2"])
    .fifesim.to_toa()
    .fifesim.sense("TM")
)
ndvi, truth = image.fifesim.ndvi(), lai.fifesim.aggregate(30)

# Colour infrared: near infrared, red and green as red, green and blue, from dark to bright reflectance.
reflectance = image.fifesim.to_reflectance().values
low, high = np.array([0.12, 0.0, 0.0]), np.array([0.27, 0.19, 0.19])
color = np.clip((reflectance.transpose(1, 2, 0) - low) / (high - low), 0, 1)

figure, axes = plt.subplots(1, 3, figsize=(12.6, 4.1), layout="constrained")
drawn = axes[0].imshow(
    lai[:144, :144],
    cmap="YlGn",
    vmin=0,
    vmax=2.2,
    extent=(0, 480, 0, 480),
    interpolation="nearest",
)
figure.colorbar(drawn, ax=axes[0], fraction=0.046, pad=0.03, label="leaf area index [m² m⁻²]")
axes[0].set_title("Scene: cells of 3.33 m")
axes[1].imshow(color[:16, :16], extent=(0, 480, 0, 480), interpolation="nearest")
axes[1].set_title("TM image: pixels of 30 m")
for axis in axes[:2]:
    axis.set(
        xlabel="easting [m]",
        ylabel="northing [m]",
        xticks=range(0, 481, 120),
        yticks=range(0, 481, 120),
    )
fit = fifesim.regress(truth, ndvi)
line = np.linspace(float(ndvi.min()), float(ndvi.max()), 50)
axes[2].plot(
    ndvi.values.ravel(),
    truth.values.ravel(),
    ".",
    color="#1a9850",
    markersize=1.5,
    rasterized=True,
)
axes[2].plot(line, fit.predict(line), color="#b2182b", linewidth=2)
axes[2].set(
    xlabel="NDVI of the image",
    ylabel="true leaf area index [m² m⁻²]",
    title=f"What NDVI tells: R² = {fit.r2:.2f}",
)
axes[2].set_box_aspect(1)
figure.savefig(
    Path(__file__).parent / "_static" / "scene_and_image.png",
    dpi=110,
    metadata={"Software": None},
)
