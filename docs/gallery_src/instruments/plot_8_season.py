"""
Maximum value composite of a season
===================================

The figures show ten simulated dates of grassland with a wheat field in a corner, each with its sun and clouds, and
their maximum value composite (Holben 1986). The composite takes the date with the largest NDVI for each pixel.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr

import fifesim

grid = fifesim.fife_site(cell=30 / 9, window=((0, 900), (0, 900)))
lai = fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7)
dates = pd.date_range("1987-04-16T16:35", periods=10, freq="18D")
share = xr.DataArray(np.linspace(0, 1, 10), coords={"time": dates}, dims="time")
field = (lai.y > lai.y.mean()) & (lai.x > lai.x.mean())
wheat = 4 * np.exp(-(((share - 0.3) / 0.2) ** 2))
grass = 1.3 * np.exp(-(((share - 0.5) / 0.3) ** 2))
leaves = (lai * grass).where(~field, wheat).transpose("time", "y", "x").assign_attrs(lai.attrs)
rho = leaves.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
sky = fifesim.cloud_field(
    grid, cover=0.25, length=900, height=1000, seed=2, time=list(dates), margin=1200
)
image = rho.fifesim.to_toa(clouds=sky).fifesim.sense()
ndvi = image.fifesim.ndvi()
clear = image.fifesim.to_reflectance().fifesim.composite()
cloudless = rho.fifesim.to_toa().fifesim.sense().fifesim.ndvi()

# %%
# Four dates, the composite, and the date that it takes for each pixel (3 km x 3 km).

# sphinx_gallery_start_ignore

figure, axes = plt.subplots(
    2, 3, figsize=(10.5, 7), layout="constrained", sharex=True, sharey=True
)
maps = {f"{date:%d %B}": ndvi.sel(time=date) for date in dates[[1, 3, 5, 8]]} | {
    "Composite": clear.fifesim.ndvi()
}
for axis, (title, values) in zip(axes.flat, maps.items(), strict=False):
    shown = axis.imshow(values, cmap="viridis", vmin=0, vmax=0.8)
    axis.set(title=title, xticks=[], yticks=[])
figure.colorbar(shown, ax=axes[:, :2], label="NDVI", location="bottom", shrink=0.6)
days = clear["date"].dt.dayofyear
shown = axes[1, 2].imshow(days, cmap="cividis")
axes[1, 2].set(title="Selected date", xticks=[], yticks=[])
figure.colorbar(shown, ax=axes[:, 2], label="day of the year", location="bottom", shrink=0.8)
# sphinx_gallery_end_ignore

# %%
# The composite is almost free of clouds, but it combines different dates: wheat and grass are greenest at different
# times. The next figure shows mean NDVI of both covers, by date and in the composite.

in_field = field.coarsen(y=9, x=9).mean().values > 0.5
# sphinx_gallery_start_ignore
figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
for name, of_cover, color in (("wheat", in_field, "#b8860b"), ("grass", ~in_field, "#2e7d32")):
    for series, style, label in ((cloudless, "o-", "no clouds"), (ndvi, "o:", "with clouds")):
        means = [float(each.where(of_cover).mean()) for each in series]
        face = color if style == "o-" else "white"
        axis.plot(
            dates, means, style, color=color, markerfacecolor=face, label=f"{name}, {label}"
        )
    level = float(clear.fifesim.ndvi().where(of_cover).mean())
    axis.axhline(level, color=color, linewidth=3, alpha=0.35, label=f"{name}, composite")
axis.set(ylabel="mean NDVI", ylim=(0, 1.05))
axis.legend(frameon=False, ncols=2, fontsize=8, loc="upper right")
figure.autofmt_xdate()
# sphinx_gallery_end_ignore

# %%
# The composite is close to the largest mean without clouds, and above all means with clouds. See
# :doc:`/howto/season` for the size of this bias.
