"""
One landscape through five instruments
======================================

What ``fifesim simulate`` makes without a scenario is a landscape: the three treatments of the FIFE site in fenced
pastures on synthetic hills, grass denser in the draws, thin bright soils on the ridges, dead leaves and litter where it
did not burn. It is made up, not measured; ``fifesim scenario`` prints every number of it. The paper's own ground, one
stand everywhere, shows nothing that is larger than some ten metres; here even a pixel of a kilometre sees fences.
"""

import matplotlib.pyplot as plt

import fifesim

default = fifesim.default_scenario().model_dump(exclude_unset=True)
grid = {"width": 6600.0, "height": 6600.0}


def seen_by(instrument):
    """True leaf area, and NDVI of what an instrument records."""
    scenario = fifesim.Scenario(
        **default | {"grid": grid, "sensor": {"instrument": instrument}}
    )
    run = fifesim.simulate(scenario)
    return run["truth"]["lai"].compute(), run["image"]["ndvi"].compute()


runs = {name: seen_by(name) for name in ("MSI", "TM", "MODIS", "VIIRS", "AVHRR")}
figure, axes = plt.subplots(2, 3, figsize=(11, 7.4), layout="constrained")
truth = runs["TM"][0]
extent = (0, 6.6, 0, 6.6)
shown = axes[0, 0].imshow(truth, cmap="YlGn", vmin=0, vmax=3, extent=extent)
axes[0, 0].set_title("leaf area, means over 30 m")
figure.colorbar(shown, ax=axes[0, 0], shrink=0.8)
for axis, (name, (_, ndvi)) in zip(axes.flat[1:], runs.items(), strict=True):
    pixel = float(abs(ndvi["x"][1] - ndvi["x"][0]))
    axis.set(title=f"{name}, {pixel:g} m", facecolor="#eeeeee", xlim=(0, 6.6), ylim=(0, 6.6))
    width, height = (ndvi.sizes[side] * pixel / 1000 for side in ("x", "y"))
    shown = axis.imshow(
        ndvi, cmap="YlGn", vmin=0.15, vmax=0.65, extent=(0, width, 6.6 - height, 6.6)
    )
figure.colorbar(shown, ax=axes[:, 2], label="NDVI of planetary reflectance", shrink=0.7)
for axis in axes.flat:
    axis.set(xticks=[0, 2, 4, 6], yticks=[0, 2, 4, 6])
for axis in axes[1]:
    axis.set_xlabel("km")

# %%
# How well NDVI tells leaf area, on pixels of each size:

for name, (lai, ndvi) in runs.items():
    fit = fifesim.regress(lai, ndvi, pair="index")
    print(f"{name:6} {fit.n:7} pixels, R² {fit.r2:.2f}")
plt.show()
