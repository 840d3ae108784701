"""
Make prospect_d.csv, the coefficients of PROSPECT-D, and three tables of spectra of soil and litter.

Needs prosail, which distributes the coefficients and two soils as text, and earthlib 1.1.0, which distributes the
other spectra. Run it in this folder.
"""

import re
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pandas as pd
import prosail

WAVELENGTH = np.arange(400, 2501) / 1000
STEP = 0.01  # of the dead grass as distributed [um]
DEAD_GRASS = {"dead_grass": "deadgras", "golden_grass": "goldgras"}
# Spectra of the library of `fifesim.ground.canopy.spectra`, and spectra to check it with.
SOILS, LITTER, HELD_OUT = 60, 12, 40
SEED = 5


def write(name, header, table):
    """A CSV file with header comments."""
    lines = "".join(f"# {line}\n" for line in header)
    Path(name).write_text(lines + table.to_csv(index=False, float_format="%.6g"), encoding="utf-8")


def coefficients():
    """Refractive index and specific absorption, as distributed."""
    spectra = prosail.spectral_library.get_spectra().prospectd
    columns = {
        "refractive_index": spectra.nr,
        "chlorophyll": spectra.kab,
        "carotenoids": spectra.kcar,
        "anthocyanins": spectra.kant,
        "brown": spectra.kbrown,
        "water": spectra.kw,
        "dry_matter": spectra.km,
    }
    return pd.DataFrame({"wavelength": WAVELENGTH} | columns)


def earthlib_spectra():
    """Wavelengths, spectra and table of the spectra that earthlib distributes; row k of the table is spectrum k."""
    folder = Path(distribution("earthlib").locate_file("earthlib/data"))
    header = (folder / "spectra.sli.hdr").read_text()
    listed = {key: re.search(key + r" = \{(.*?)\}", header, re.DOTALL)[1] for key in ("wavelength", "spectra names")}
    wavelength = np.array(listed["wavelength"].split(","), float)
    names = [name.strip() for name in listed["spectra names"].split(",")]
    values = np.frombuffer((folder / "spectra.sli").read_bytes(), "<f4").reshape(len(names), wavelength.size)
    return wavelength, values.astype(float), pd.read_csv(folder / "spectra.csv").assign(NAME=names)


def drawn(table, spectra):
    """Rows of the soils and litter of the library, and of the soils that are held out: random, one soil per site."""
    random = np.random.default_rng(SEED)
    # One of the spectra of marsh is above 1, and 0 in places.
    table = table[np.all((spectra > 0) & (spectra < 1), axis=1)]
    soils = table[(table["LEVEL_3"] == "soil") & (table["SOURCE"] == "icraf-isric-soil-database")]
    sites = random.permutation(soils.drop_duplicates(["LAT", "LON"]).index)
    # The dead grass of ground_spectra.csv is in a separate table and stays unknown to the library.
    dead = table[(table["LEVEL_2"] == "npv") & table["LEVEL_3"].isin(["litter", "npv"])]
    others = dead[~dead["NAME"].isin(DEAD_GRASS.values())].drop_duplicates("NAME")
    litter = random.permutation(others.index)
    return [*sites[:SOILS], *litter[:LITTER]], sites[SOILS : SOILS + HELD_OUT]


def main():
    header = [
        "Refractive index of leaf material and specific absorption of what leaves contain, PROSPECT-D.",
        "Source: Feret, Gitelson, Noble & Jacquemoud (2017), doi:10.1016/j.rse.2017.03.004; the authors' table of 2017",
        "  as distributed with prosail 2.0.5 (dataSpec_PDB, 16 January 2017).",
        "  Brown pigments: F. Baret (INRA), in the same table.",
        "Columns: wavelength [um]; refractive_index [1]; chlorophyll a and b, carotenoids, anthocyanins [cm2 ug-1];",
        "  brown [1]; water [cm-1]; dry_matter [cm2 g-1]. Written by make_ground_spectra.py.",
    ]
    write("prospect_d.csv", header, coefficients())

    wavelength, spectra, listed = earthlib_spectra()
    grass = {name: spectra[listed["NAME"].tolist().index(code)] for name, code in DEAD_GRASS.items()}
    soil = prosail.spectral_library.get_spectra().soil
    here = np.searchsorted(WAVELENGTH, wavelength - STEP / 100)
    table = pd.DataFrame(
        {"wavelength": wavelength, "soil_dry": soil.rsoil1[here], "soil_wet": soil.rsoil2[here]} | grass
    )
    header = [
        "Reflectance of what lies below a canopy, to be mixed.",
        "Source of soil_dry and soil_wet: the generic soils of PROSAIL 5B, as distributed with prosail 2.0.5; where",
        "  they were measured is not said there.",
        "Source of dead_grass and golden_grass: Joint Fire Science Program, field spectra of burned and unburned",
        "  ground (deadgras, goldgras), as distributed with earthlib 1.1.0 (MIT); without 1.36 to 1.45 and 1.80 to",
        "  1.95 um, where the air is opaque.",
        "Columns: wavelength [um]; reflectance of each [1]. Written by make_ground_spectra.py.",
    ]
    write("ground_spectra.csv", header, table.round(5))

    for name, rows, purpose in zip(
        ("library_ground.csv", "../tests/data/verification/held_out_soils.csv"),
        drawn(listed, spectra),
        ("below the canopies of the library of land spectra", "that the library of land spectra does not have"),
        strict=True,
    ):
        header = [
            f"Reflectance of measured ground {purpose}.",
            "Source: ICRAF-ISRIC soil VNIR spectral library (FS...), soils of the world, one a site, drawn at",
            "  random; other columns are litter and dead plants. As distributed with earthlib 1.1.0 (MIT), whose names",
            "  the columns have; without 1.36 to 1.45 and 1.80 to 1.95 um, where the air is opaque.",
            "Columns: wavelength [um]; reflectance of each [1]. Written by make_ground_spectra.py.",
        ]
        columns = {listed["NAME"][row]: spectra[row] for row in rows}
        write(name, header, pd.DataFrame({"wavelength": wavelength} | columns).round(4))


if __name__ == "__main__":
    main()
