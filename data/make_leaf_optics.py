"""
Make leaf_optics.csv and background.csv, the default optics of the Landsat TM bands.

TM3 and TM4 are calibrated: with them the simulation meets Table 2 of Friedl et al. (1995). The chemistry of a
PROSPECT-D leaf is fitted to them, and the other bands are band means of that leaf's spectrum. Needs prosail, for its
PROSPECT-D and its generic dry soil. Run it in this folder.
"""

import numpy as np
import prosail
from pyrsr.rsr import RSR_reader
from scipy.optimize import least_squares

from fifesim.base.bands import Band, solar_spectrum

NAMES = ["TM1", "TM2", "TM3", "TM4", "TM5", "TM7"]
CALIBRATED = [2, 3]
LEAF_REFLECTANCE, LEAF_TRANSMITTANCE, BACKGROUND = (0.07, 0.45), (0.04, 0.42), (0.15, 0.19)
WATER = 0.012  # equivalent water thickness [cm], assumed, because TM3 and TM4 do not depend on it
CAROTENOIDS = 0.25  # of the chlorophyll, assumed

WAVELENGTH = np.arange(400, 2501) / 1000


def tm_bands():
    """Landsat-5 TM responses as bands; pyrsr holds them in micrometres."""
    responses = RSR_reader("Landsat-5", "TM", LayerBandsAssignment=[name[2:] for name in NAMES])
    return [Band(f"TM{key}", table[:, 0], np.maximum(table[:, 1], 0)) for key, table in responses.items()]


def band_means(spectrum, bands):
    """Means over the responses, weighted by the extraterrestrial sun."""
    sun = np.interp(WAVELENGTH, *solar_spectrum())
    return np.array([band.mean(spectrum, WAVELENGTH, sun) for band in bands])


def leaf(structure, chlorophyll, dry_matter, bands):
    """Band reflectance and transmittance of a green PROSPECT-D leaf."""
    _, reflectance, transmittance = prosail.run_prospect(
        structure, chlorophyll, CAROTENOIDS * chlorophyll, 0.0, WATER, dry_matter, ant=0.0, prospect_version="D"
    )
    return band_means(reflectance, bands), band_means(transmittance, bands)


def fit_leaf(bands):
    """Structure, chlorophyll [ug cm-2] and dry matter [g cm-2] nearest to the calibrated bands."""

    def misfit(parameters):
        reflectance, transmittance = leaf(*parameters, bands)
        return np.concatenate(
            [reflectance[CALIBRATED] - LEAF_REFLECTANCE, transmittance[CALIBRATED] - LEAF_TRANSMITTANCE]
        )

    return least_squares(misfit, [1.5, 40, 0.005], x_scale=[1, 10, 0.01], bounds=([1, 5, 0.0005], [3, 100, 0.05]))


def write(name, header, columns, rows):
    """A CSV file with header comments."""
    with open(name, "w") as file:
        file.writelines(f"# {line}\n" for line in header)
        file.write(",".join(columns) + "\n")
        file.writelines(",".join([band, *(f"{value:.3g}" for value in values)]) + "\n" for band, *values in rows)


def main():
    bands = tm_bands()
    fit = fit_leaf(bands)
    reflectance, transmittance = leaf(*fit.x, bands)
    reflectance[CALIBRATED], transmittance[CALIBRATED] = LEAF_REFLECTANCE, LEAF_TRANSMITTANCE
    structure, chlorophyll, dry_matter = fit.x
    header = [
        "Leaf reflectance and transmittance of green tallgrass in the Landsat TM bands. Dimensionless, 0 to 1.",
        "Calibrated: TM3 and TM4, so that the simulation meets Table 2 of Friedl et al. (1995).",
        "  FIFE's own were not found (README.md).",
        "  They lie within the values reported for bluestem leaves (red reflectance .07-.09, near infrared .42-.46;",
        "  recalled, not checked against a table).",
        "Modelled: TM1, TM2, TM5, TM7, from PROSPECT-D (Feret et al. 2017) fitted to TM3 and TM4:",
        f"  structure {structure:.3f}, chlorophyll {chlorophyll:.1f} ug cm-2, dry matter {dry_matter:.4f} g cm-2.",
        f"  Assumed: carotenoids {CAROTENOIDS} of chlorophyll, water {WATER} cm, no brown pigment, no anthocyanins.",
        f"  The fitted leaf is within {np.abs(fit.fun).max():.4f} of the calibrated values.",
        "  Band means over the Landsat-5 TM responses of pyrsr, weighted by the extraterrestrial sun of ASTM G173-03.",
        "Columns: band; leaf_reflectance [1]; leaf_transmittance [1]. Made by make_leaf_optics.py.",
    ]
    rows = zip(NAMES, reflectance, transmittance, strict=True)
    write("leaf_optics.csv", header, ["band", "leaf_reflectance", "leaf_transmittance"], rows)

    soil = band_means(prosail.spectral_library.get_spectra().soil.rsoil1, bands)
    scale = np.sum(soil[CALIBRATED]) / np.sum(soil[CALIBRATED] ** 2 / BACKGROUND)
    background = scale * soil
    misfit = np.abs(background[CALIBRATED] - BACKGROUND).max()
    background[CALIBRATED] = BACKGROUND
    header = [
        "Reflectance of the background (soil and litter) below tallgrass in the Landsat TM bands.",
        "Calibrated: TM3 and TM4, so that the simulation meets Table 2 of Friedl et al. (1995). FIFE's own",
        "  soil and litter were not found (README.md).",
        "Modelled: TM1, TM2, TM5, TM7, from the generic dry soil spectrum distributed with prosail,",
        f"  times {scale:.3f}, which is within {misfit:.4f} of the calibrated values.",
        "  Band means over the Landsat-5 TM responses of pyrsr, weighted by the extraterrestrial sun of ASTM G173-03.",
        "Columns: band; background [1]. Made by make_leaf_optics.py.",
    ]
    write("background.csv", header, ["band", "background"], zip(NAMES, background, strict=True))


if __name__ == "__main__":
    main()
