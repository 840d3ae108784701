"""
Leaf area densities (Fig. 3)
============================

The three grassland treatments of FIFE in early June 1987. Their means and deviations are inferred from the paper's
Table 2, because the measurements behind Fig. 3 were not found: see :doc:`/physics`.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy import stats

import fifesim

x = np.linspace(0, 4.2, 4201)
colors = {
    "burned-grazed": "#1b9e77",
    "burned-ungrazed": "#d95f02",
    "unburned-ungrazed": "#7570b3",
}

figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
for name in fifesim.treatments():
    density = fifesim.lai_distribution(name)
    label = f"{name}: {density.mean():.2f} ± {density.std():.2f}"
    axes[0].plot(x, density.pdf(x), color=colors[name], linewidth=2, label=label)
axes[0].set(title="Densities, mean ± standard deviation", xlim=(0, 3.6))

# A scene follows its density whatever the arrangement; means over pixels do not.
lai = fifesim.lai_scene(
    fifesim.fife_site(30 / 9, window=((0, 1800), (0, 1800))), "burned-grazed", arp=0.15, seed=7
)
bins = np.linspace(0, 2.4, 61)
axes[1].hist(lai.values.ravel(), bins, density=True, color="#a6d8c7", label="cells of 3.33 m")
axes[1].hist(
    lai.fifesim.aggregate(30).values.ravel(),
    bins,
    density=True,
    color="#1b9e77",
    alpha=0.8,
    label="30 m means",
)
axes[1].plot(
    x,
    fifesim.lai_distribution("burned-grazed").pdf(x),
    color="black",
    linewidth=1.5,
    label="density",
)
axes[1].set(title="A burned-grazed scene at arp 0.15", xlim=(0, 2.4))
for axis in axes:
    axis.set(
        xlabel="leaf area index [m² m⁻²]",
        ylabel="probability density",
        ylim=(0, 1.2 * axis.get_ylim()[1]),
    )
    axis.legend(frameon=False)

# %%
# Own samples become a kernel density, reflected at zero; any frozen distribution of scipy serves too.

samples = stats.gamma(4, scale=0.4).rvs(60, random_state=1)
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "own_samples.csv"
    np.savetxt(path, samples, header="lai", comments="")
    density = fifesim.lai_distribution(path)
own = {
    "60 own samples": density,
    "gamma, as drawn from": fifesim.lai_distribution(stats.gamma(4, scale=0.4)),
}

figure, axis = plt.subplots(figsize=(6.5, 4), layout="constrained")
for (name, density), style in zip(own.items(), ("-", "--"), strict=True):
    axis.plot(x, density.pdf(x), style, color="black", label=name)
axis.plot(samples, np.full(60, 0.01), "|", color="0.4", markersize=12)
axis.set(
    xlabel="leaf area index [m² m⁻²]",
    ylabel="probability density",
    ylim=(0, None),
    title="Own samples",
)
axis.legend(frameon=False)
