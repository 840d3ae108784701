"""
Pixel size, blur and noise
==========================

The left figure shows which part of an instrument limits the relation of NDVI and LAI, by pixel size: blur and sampling
interval change with the pixel, and pixels are 4 m from their ground along both axes. The right figure shows R² of 100
designs by the light that they need. See {doc}`/howto/designs`.
"""

import matplotlib.pyplot as plt

import fifesim

sizes = [10, 15, 20, 30, 45, 60]
by_size = fifesim.trade("OLI", {"pixel": sizes, "registration": [4.0]})
share = by_size.share.sel(variable="lai", registration=4.0)

designs = fifesim.trade(
    "OLI",
    {
        "pixel": [10, 20, 30, 60],
        "mtf": [0.1, 0.2, 0.3, 0.4, 0.5],
        "registration": [4],
        "snr": [25, 50, 100, 200, 400],
    },
)
light = (designs.snr**2 / designs.pixel**2).assign_attrs(long_name="SNR² per pixel area [m⁻²]")

# sphinx_gallery_start_ignore
figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
colours = {
    "ground": "#b35806",
    "point spread": "#4393c3",
    "registration": "#2166ac",
    "noise": "0.7",
}
for stage, colour in colours.items():
    axes[0].plot(sizes, share.sel(stage=stage), "o-", color=colour, markersize=4, label=stage)
axes[0].plot(sizes, share.sum("stage"), color="black", label="total")
axes[0].set(xlabel="pixel [m]", ylabel="share in 1 − R² of LAI on NDVI", ylim=(-0.02, None))
axes[0].legend(frameon=False, fontsize="small")
fifesim.output.plot_trade(designs, light, axes=axes[1])
# sphinx_gallery_end_ignore
