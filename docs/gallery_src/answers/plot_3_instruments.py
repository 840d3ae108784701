"""
Information lost by each instrument
===================================

The figure shows which part of the variance of leaf area a line on NDVI does not explain, by instrument and stage. Each
instrument has its blur, noise and geolocation error, from the best known source. The ground is level, burned and grazed
prairie, and the truth is the mean over a pixel. `budget` computes one instrument in about a second without simulation,
as a mean over all realisations.
"""

import matplotlib.pyplot as plt

import fifesim

names = ("MSI", "HRV", "TM", "ETM+", "OLI", "EnMAP", "PRISMA", "MODIS", "OLCI", "VIIRS")


def losses(name, response=None):
    """Budget of leaf area for level prairie, displaced along both axes by the geolocation error."""
    own = fifesim.instrument(name)
    pixel = own.pixel(own.red_and_near_infrared()[0])
    across = round(pixel / (10 / 3))  # cells
    sensor = {"instrument": name, "noise": ["all"], "offset": [own.geolocation / pixel] * 2}
    scenario = fifesim.Scenario(
        grid={"cell": pixel / across},
        ground={"arp": 0.15},
        terrain={"dem": "flat"},
        sensor=sensor | ({"response": response} if response else {}),
    )
    budget = fifesim.budget(scenario, method="analytic", cells=max(333, 12 * across))
    return budget.isel(realisation=0).sel(variable="lai").assign_attrs(pixel=pixel)


budgets = {name: losses(name) for name in names}

# sphinx_gallery_start_ignore
groups = {
    "registration": (["registration"], "#D55E00"),
    "blur": (["point spread"], "#0072B2"),
    "noise and digital numbers": (["noise", "quantisation"], "#999999"),
    "atmosphere": (["atmosphere"], "#56B4E9"),
    "curved relation": (["non-linearity", "NDVI scaling"], "#E69F00"),
}
figure, axis = plt.subplots(figsize=(8, 5), layout="constrained")
for row, name in enumerate(names):
    found, left = budgets[name], 0.0
    for label, (stages, color) in groups.items():
        share = float(found["share"].sel(stage=stages).sum())
        share += float(found["curvature"]) if label == "curved relation" else 0.0
        axis.barh(row, 100 * share, left=100 * left, color=color, label=None if row else label)
        left += share
    axis.text(
        100 * left + 1, row, f"{100 * float(found['total']):.0f} %", va="center", fontsize=9
    )
sizes = [found.pixel for found in budgets.values()]
axis.set_yticks(
    range(len(names)), [f"{name}, {size:g} m" for name, size in zip(names, sizes, strict=True)]
)
axis.invert_yaxis()
axis.set(xlim=(0, 110), xlabel="variance of leaf area that a line on NDVI does not explain [%]")
axis.spines[["top", "right"]].set_visible(False)
figure.legend(loc="outside upper center", ncols=5, frameon=False, fontsize=9, handlelength=1)
# sphinx_gallery_end_ignore

# %%
# **Registration** has the largest share wherever the geolocation error is a large part of a pixel, because the ground
# varies over short distances. PRISMA is displaced by three pixels, the error that is required without control points.
# Large pixels have little variance, so that **noise and digital numbers** weigh more. The **atmosphere** is uniform and
# has little effect on R², because it mainly changes slope and intercept. EMIT and Landsat MSS are missing: their
# geolocation error, and blur and noise of MSS, are unknown. AVHRR is missing because `method="analytic"` does not hold
# for its coarse digital numbers. ``python docs/make_instruments.py`` simulates 19 instruments.
#
# The blur of few instruments was measured in flight. Two instruments differ only if the ranges of R², at both ends of
# the uncertainty of the blur, do not overlap:

for name in ("TM", "OLI", "MSI"):
    ends = sorted(1 - float(losses(name, end).total) for end in ("softest", "sharpest"))
    found = budgets[name]
    origin = found.origin.sel(stage="point spread").item()
    print(
        f"{name:4} R² {1 - float(found.total):.2f} ({ends[0]:.2f} to {ends[1]:.2f}), blur {origin}"
    )
