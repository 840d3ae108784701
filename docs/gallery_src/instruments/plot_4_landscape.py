"""
One landscape through five instruments
======================================

The figure shows the default landscape of ``fifesim simulate`` as seen by five instruments with pixels from 10 m to 1.1
km. The hills are synthetic. Leaf area was learned from Konza Prairie: dense in valleys and along streams, in bands that
follow contours, and thin on steep slopes. ``fifesim scenario`` prints all parameters.
"""

import matplotlib.pyplot as plt

import fifesim

default = fifesim.scenario.default_scenario().model_dump(exclude_unset=True)
pixels = {"MSI": 10, "TM": 30, "MODIS": 250, "VIIRS": 375, "AVHRR": 1100}  # m


def seen_by(instrument):
    """True leaf area and NDVI of the image of an instrument."""
    side = 6600 // pixels[instrument] * pixels[instrument]  # whole pixels
    grid = {"width": side, "height": side}
    scenario = fifesim.Scenario(
        **default | {"grid": grid, "sensor": {"instrument": instrument}}
    )
    run = fifesim.simulate(scenario)
    return run["truth"]["lai"].compute(), run["image"]["ndvi"].compute()


runs = {name: seen_by(name) for name in pixels}

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(2, 3, figsize=(11, 7.4), layout="constrained")
truth = runs["TM"][0]
extent = (0, 6.6, 0, 6.6)
shown = axes[0, 0].imshow(truth, cmap="YlGn", vmin=0, vmax=4, extent=extent)
axes[0, 0].set_title("true leaf area, 30 m")
figure.colorbar(shown, ax=axes[0, 0], shrink=0.8, label="leaf area index [m² m⁻²]")
for axis, (name, (_, ndvi)) in zip(axes.flat[1:], runs.items(), strict=True):
    pixel = float(abs(ndvi["x"][1] - ndvi["x"][0]))
    axis.set(title=f"{name}, {pixel:g} m", facecolor="#eeeeee", xlim=(0, 6.6), ylim=(0, 6.6))
    width, height = (ndvi.sizes[side] * pixel / 1000 for side in ("x", "y"))
    shown = axis.imshow(
        ndvi, cmap="viridis", vmin=0.3, vmax=0.75, extent=(0, width, 6.6 - height, 6.6)
    )
figure.colorbar(shown, ax=axes[:, 2], label="NDVI at the top of the atmosphere", shrink=0.7)
for axis in axes.flat:
    axis.set(xticks=[0, 2, 4, 6], yticks=[0, 2, 4, 6])
for axis in axes[1]:
    axis.set_xlabel("easting [km]")
for axis in axes[:, 0]:
    axis.set_ylabel("northing [km]")
# sphinx_gallery_end_ignore

# %%
# Valleys remain visible up to pixels of several hundred metres. The regression of leaf area on NDVI by pixel size:

for name, (lai, ndvi) in runs.items():
    fit = fifesim.regress(lai, ndvi, pair="index")
    print(f"{name:6} {fit.n:7} pixels, R² = {fit.r2:.2f}")

# %%
# With few large pixels, R² is uncertain. See :doc:`/why_scatter` for the sources of the scatter.
