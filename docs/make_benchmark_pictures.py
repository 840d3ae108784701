"""Pictures of the page on benchmarks, made when the pages are built."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from verification import benchmarks

FOLDER = Path(__file__).parent / "tables"

COLORS = {"I": "#1b1b1b", "Q": "#2166ac", "U": "#b2182b"}


def band(axis, noise, label):
    """Mark the noise around zero."""
    axis.axhspan(-noise, noise, color="#fdae61", alpha=0.35, linewidth=0, label=label)
    axis.axhline(0, color="0.5", linewidth=0.8)


def iprt():
    """Differences of fifesim and MYSTIC in units of the noise of MYSTIC, IPRT cases."""
    cases = ("A1a", "A1b", "A1c", "A2", "A3", "B1")
    figure, axes = plt.subplots(
        2, 3, figsize=(11, 5.4), layout="constrained", sharex=True, sharey=True
    )
    for axis, case in zip(axes.flat, cases, strict=True):
        table, found = benchmarks.iprt(case)
        band(axis, 3, "3 x noise")
        at_ground = (table["level"] == "ground").to_numpy()
        for number, (name, values) in enumerate(zip("IQU", found, strict=True)):
            away = ((values - table[name]) / table[f"sd_{name}"]).to_numpy()
            for rows, style in ((~at_ground, "o"), (at_ground, "x")):
                label = f"{name}, {'ground' if style == 'x' else 'top'}"
                place = table["vza"].to_numpy()[rows] + 2.4 * (number - 1)
                axis.plot(
                    place, away[rows], style, color=COLORS[name], markersize=3.5, label=label
                )
        axis.set(title=case, ylim=(-4.5, 4.5), xticks=[0, 15, 30, 60, 75])
    axes[1, 1].set_xlabel("view zenith angle [degree]")
    for axis in axes[:, 0]:
        axis.set_ylabel("(fifesim − MYSTIC) / noise")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=7,
        frameon=False,
        fontsize=8,
    )
    return figure


def sky():
    """I, Q and U of the sky for molecules with an optical depth of 0.5."""
    table, found = benchmarks.iprt("A1b")
    rows = ((table["level"] == "ground") & (table["vza"] == 60)).to_numpy()
    order = np.argsort(-table["raa"].to_numpy()[rows])
    figure, axis = plt.subplots(figsize=(6.5, 3.9), layout="constrained")
    for name, values in zip("IQU", found, strict=True):
        azimuth, seen = (
            -table["raa"].to_numpy()[rows][order],
            table[name].to_numpy()[rows][order],
        )
        axis.plot(
            azimuth, values[rows][order], "-", color=COLORS[name], label=f"{name}, fifesim"
        )
        axis.plot(
            azimuth,
            seen,
            "o",
            color=COLORS[name],
            markerfacecolor="none",
            label=f"{name}, MYSTIC",
        )
    axis.set(
        xlabel="azimuth from the sun [degree]",
        ylabel="π L / (E₀ cos sza)",
        xticks=[0, 45, 90, 135, 180],
    )
    axis.set_title("Sky at 60° from the zenith, IPRT A1b (noise: 3 × 10⁻⁵)")
    axis.legend(
        frameon=False, ncols=3, fontsize=8, loc="center right", bbox_to_anchor=(1, 0.62)
    )
    return figure


def molecules():
    """Differences from the tables of Natraj et al. (2009), which have seven digits."""
    table, found, converged = benchmarks.molecules()
    figure, axes = plt.subplots(1, 2, figsize=(11, 3.9), layout="constrained")
    tau = table["tau"].to_numpy() * np.exp(np.linspace(-0.12, 0.12, len(table)))
    for axis, values, scale in ((axes[0], found, 1e2), (axes[1], converged, 1e7)):
        for name, each in zip("IQU", values, strict=True):
            away = each - table[name].to_numpy()
            shown = scale * (away / table["I"].to_numpy() if scale == 1e2 else away)
            axis.plot(tau, shown, ".", color=COLORS[name], markersize=4, label=name)
        axis.set(
            xscale="log",
            xlabel="optical depth",
            xticks=[0.05, 0.1, 0.25, 0.5, 1],
            xticklabels=["0.05", "0.1", "0.25", "0.5", "1"],
        )
        axis.minorticks_off()
    band(axes[0], 0.01, "bound")
    axes[0].set(title="Default: 60 layers, 16 directions", ylabel="(fifesim − Natraj) / I [%]")
    band(axes[1], 1, "last digit of the table")
    axes[1].set(
        title="Many layers and directions", ylabel="fifesim − Natraj [10⁻⁷]", ylim=(-1.5, 1.5)
    )
    for axis in axes:
        axis.legend(frameon=False, ncols=4, fontsize=8, loc="upper left")
    return figure


def surfaces():
    """White ground below molecules, and dark ground below aerosol and gases, RAMI4ATM."""
    figure, axes = plt.subplots(
        2, 2, figsize=(11, 5.6), layout="constrained", sharex=True, height_ratios=(3, 2)
    )
    titles = {
        "white": "White ground, molecules",
        "lambert": "Ground of 0.028, continental aerosol, gases",
    }
    for (upper, lower), case in zip(axes.T, titles, strict=True):
        table, found = benchmarks.rami(case)
        vza, expected = table["vza"], table["reflectance"]
        noise = 300 * 1.2 * table["sd"] / expected
        order = np.argsort(vza.to_numpy())
        upper.plot(
            vza,
            expected,
            "o",
            color="#b2182b",
            markersize=3,
            markerfacecolor="none",
            label="Eradiate",
        )
        upper.plot(
            vza.to_numpy()[order],
            found[order],
            "-",
            color="black",
            linewidth=1,
            label="fifesim",
        )
        upper.set(title=titles[case], ylabel="reflectance at the top")
        upper.legend(frameon=False)
        shade = {
            "color": "#fdae61",
            "alpha": 0.35,
            "linewidth": 0,
            "label": "3 x noise",
        }
        lower.fill_between(
            vza.to_numpy()[order], -noise.to_numpy()[order], noise.to_numpy()[order], **shade
        )
        lower.plot(vza, 100 * (found / expected - 1), ".", color="black", markersize=3)
        lower.axhline(0, color="0.5", linewidth=0.8)
        lower.set(
            xlabel="view zenith [degree], positive toward the sun",
            ylabel="fifesim − Eradiate [%]",
        )
        lower.legend(frameon=False, fontsize=8, loc="lower right")
    return figure


def discs():
    """SAIL with three sizes of the hot spot, and canopies of discs."""
    figure, axes = plt.subplots(
        2, 2, figsize=(11, 6), layout="constrained", sharex=True, height_ratios=(3, 2)
    )
    sizes = {0.0: ":", 0.025: "--", 0.03: "-"}
    for hotspot, style in sizes.items():
        table, found = benchmarks.hom45(hotspot)
        order = np.argsort(table["vza"].to_numpy())
        vza, expected = table["vza"].to_numpy()[order], table["reflectance"].to_numpy()[order]
        axes[0, 0].plot(
            vza,
            found[order],
            style,
            color="black",
            linewidth=1,
            label=f"SAIL, hotspot {hotspot:g}",
        )
        axes[1, 0].plot(
            vza, 100 * (found[order] / expected - 1), style, color="black", linewidth=1
        )
    axes[0, 0].plot(
        vza,
        expected,
        "o",
        color="#b2182b",
        markersize=3.5,
        markerfacecolor="none",
        label="Eradiate, discs",
    )
    axes[0, 0].set(
        title="HOM45: radius 0.025 of the height, random inclination", ylabel="reflectance, red"
    )
    vza = np.concatenate([np.arange(-75, 25), np.linspace(25, 35, 81), np.arange(36, 76)])
    angles = {"sza": 30.0, "vza": np.abs(vza), "raa": np.where(vza < 0, 180.0, 0.0)}
    expected = benchmarks.flat_discs(0.025, 3.0, vza)
    for hotspot, style in {0.0: ":", 0.021: "--", 0.025: "-"}.items():
        found = (
            benchmarks.sail(3.0, 1e-6, 0.0, **angles, leaf_angles="0: 1", hotspot=hotspot).rso
            / 1e-6
        )
        axes[0, 1].plot(
            vza, found, style, color="black", linewidth=1, label=f"SAIL, hotspot {hotspot:g}"
        )
        axes[1, 1].plot(vza, 100 * (found / expected - 1), style, color="black", linewidth=1)
    axes[0, 1].plot(
        vza, expected, color="#b2182b", linewidth=3, alpha=0.4, zorder=0, label="circles, exact"
    )
    axes[0, 1].set(
        title="Flat discs of the same size", ylabel="single scattering / leaf reflectance"
    )
    for axis in axes[1]:
        axis.axhline(0, color="0.5", linewidth=0.8)
        axis.set(
            ylim=(-10, 10),
            xlabel="view zenith [degree], positive toward the sun",
            ylabel="difference [%]",
        )
    for axis in axes[0]:
        axis.legend(frameon=False, fontsize=8, loc="upper left")
    return figure


PICTURES = {
    "iprt": iprt,
    "sky": sky,
    "molecules": molecules,
    "surfaces": surfaces,
    "discs": discs,
}


def write():
    """Draw the pictures into ``docs/tables``."""
    FOLDER.mkdir(exist_ok=True)
    for name, draw in PICTURES.items():
        figure = draw()
        figure.savefig(FOLDER / f"benchmark_{name}.png", dpi=100)
        plt.close(figure)


if __name__ == "__main__":
    write()
