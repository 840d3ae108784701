"""The picture of the first page: docs/_static/six.jpg. Run it after a change that moves the numbers."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import fifesim

DOCS = Path(__file__).parent
BANDS = ["TM4", "TM3", "TM2"]

grid = fifesim.fife_site(cell=30 / 9, window=((1800, 2520), (900, 1620)))  # 2.4 km x 2.4 km
dem = fifesim.flint_hills(grid, seed=7)
land = fifesim.landscape(
    grid,
    soil=fifesim.Field(sd=0.03, arp=0.24),
    brown=fifesim.Field(mean=0.15, sd=0.06, arp=0.24),
    covary={"wetness": 0.6, "soil": -0.3},
    dem=dem,
    seed=7,
)
haze = fifesim.Atmosphere(visibility=12)
ground = land.fifesim.surface_reflectance("TM", bands=BANDS, dem=dem, atmosphere=haze)
top = ground.fifesim.to_toa()
image = top.fifesim.sense("TM")
truth, ndvi = land.fifesim.aggregate(30).lai, image.fifesim.ndvi()
fit = fifesim.regress(truth, ndvi)

reach = np.array([0.42, 0.22, 0.22])  # reflectance that is shown as white, of BANDS


def drawn(axis, raster):
    """False colours, all with the same stretch, so that haze is seen as haze."""
    colours = np.clip(raster.transpose("y", "x", "band").values / reach, 0, 1) ** 0.8
    axis.imshow(colours, interpolation="nearest")


figure = plt.figure(figsize=(12, 8.6))
# Squares of 3.9 inches below their titles; the two with scales leave room for them.
places = [(0.005 + 0.335 * (k % 3), 0.508 if k < 3 else 0.005, 0.325, 0.4535) for k in range(6)]
corners = [(left, bottom + height + 0.012) for left, bottom, _, height in places]
places[4:] = [(0.392, 0.075, 0.263, 0.38), (0.765, 0.075, 0.22, 0.38)]
axes = [figure.add_axes(place) for place in places]
axes[0].imshow(land.lai, cmap="YlGn", vmin=0, vmax=2.4, interpolation="nearest")
drawn(axes[1], ground)
drawn(axes[2], top)
drawn(axes[3], image.fifesim.to_reflectance())
titles = [
    "Ground: leaf area, 3.3 m",
    "Light: what leaves the slopes",
    "Air: through haze",
    "Image: Thematic Mapper, 30 m",
]
titles += [f"Scatter: R² = {fit.r2:.2f}", "Budget: where it comes from"]
for number, (axis, title) in enumerate(zip(axes, titles, strict=True), 1):
    figure.text(*corners[number - 1], f"{number}  {title}", fontsize=12, fontweight="bold")
    if number < 5:
        axis.set_axis_off()

line = np.linspace(float(ndvi.min()), float(ndvi.max()), 2)
axes[4].plot(
    ndvi.values.ravel(), truth.values.ravel(), ".", color="#1a9850", markersize=2, alpha=0.5
)
axes[4].plot(line, fit.predict(line), color="#b2182b", linewidth=2)
axes[4].set(xlabel="NDVI of the image", ylabel="true leaf area index", ylim=(0, None))

budget = pd.read_csv(DOCS / "landscape_budget.csv")
budget = budget[(budget.instrument == "TM") & (budget.variable == "lai")].set_index("stage")
stages = {
    "registration": "place",
    "dead leaves": "dead leaves",
    "soil": "soil",
    "cover": "cover",
    "point spread": "blur",
}
shares = 100 * budget.loc[list(stages), "share"]
errors = 100 * budget.loc[list(stages), "share_error"]
colours = ["#0072B2", "#8c6d31", "#8c6d31", "#8c6d31", "#0072B2"]
axes[5].barh(
    list(stages.values()),
    shares,
    color=colours,
    xerr=errors,
    error_kw={"elinewidth": 1, "capsize": 2},
)
axes[5].invert_yaxis()
axes[5].set_xlabel("share of the variance of leaf area [%]")
for axis in axes[4:]:
    axis.spines[["top", "right"]].set_visible(False)
figure.savefig(DOCS / "_static" / "six.jpg", dpi=100, pil_kwargs={"quality": 82})
