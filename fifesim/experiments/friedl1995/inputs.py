"""What a reader puts in the place of the inferred inputs: densities, optics, background, elevation, sensor."""

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from fifesim.base.foreign import check_regular, in_a_line, shown
from fifesim.base.kinds import is_path
from fifesim.ground.canopy import optics as canopy_optics
from fifesim.ground.canopy.spectra import Background, spectrum_names
from fifesim.ground.landscape.distribution import lai_distribution, treatments
from fifesim.sensor.description.instruments import instrument

OPTICS = ("leaf_reflectance", "leaf_transmittance")
BACKGROUND = ("background",)


def densities_of(given):
    """
    Distributions of leaf area of the three treatments.

    Parameters
    ----------
    given : str, path, mapping of str or None
        A folder with a CSV file of LAI samples for each treatment, such as ``burned-grazed.csv``; or by treatment what
        `fifesim.lai_distribution` takes; None is fifesim's own.

    Returns
    -------
    densities : dict of str
        By treatment, what `fifesim.lai_distribution` takes.

    Raises
    ------
    ValueError
        If a treatment has no file or no entry, or its samples are no density.
    """
    names = treatments()
    if given is None:
        return {name: name for name in names}
    if is_path(given):
        folder = Path(given)
        if not folder.is_dir():
            raise ValueError(f"densities = {shown(str(given))} is no folder: it holds {_files(names)}, samples of LAI")
        given = {name: str(folder / f"{name}.csv") for name in names if (folder / f"{name}.csv").is_file()}
        where, wanted = f"the folder {in_a_line(str(folder), 150)}", "a file"
    else:
        where, wanted = "densities", "an entry"
    missing = [name for name in names if name not in given]
    other = [str(name) for name in given if name not in names]
    if missing or other:
        lacks = f"lacks {wanted} of {' and '.join(missing)}"
        said = lacks if missing else f"has an unknown treatment {shown(other[0])}"
        raise ValueError(f"{where} {said}: Table 2 needs {_files(names) if wanted == 'a file' else ', '.join(names)}")
    for source in given.values():
        lai_distribution(source)
    return {name: given[name] for name in names}


def by_band(given, bands, columns, what):
    """
    Optics by band, of a file or a mapping.

    Parameters
    ----------
    given : str, path, mapping of str or None
        A CSV file with a column ``band`` and those of the numbers; or by band a number, or a pair of them; None is
        fifesim's own.
    bands : sequence of str
        That must have one.
    columns : sequence of str
        Names of the numbers, `OPTICS` or `BACKGROUND`.
    what : str
        Name of the input, for messages.

    Returns
    -------
    optics : dict of str to tuple of float, or None
        By band. [1]

    Raises
    ------
    ValueError
        If there is no such file, it lacks a column or a band, or a number is none that leaves or soil can have.
    """
    if given is None:
        return None
    found, where = (
        (_table(given, columns, what), f"{what} file {in_a_line(Path(given).name, 100)}")
        if is_path(given)
        else ({str(band): tuple(np.atleast_1d(values).tolist()) for band, values in given.items()}, what)
    )
    missing = [band for band in bands if band not in found]
    if missing:
        raise ValueError(
            f"{where} has no line for band {' and '.join(missing)}: it has {', '.join(found) or 'none'}; add "
            f"{', '.join(('band', *columns))}"
        )
    wrong = next((band for band in bands if len(found[band]) != len(columns)), None)
    if wrong is not None:
        raise ValueError(f"{what}: band {wrong} needs {' and '.join(columns)}, got {shown(found[wrong])}")
    check = canopy_optics.check_leaf_optics if columns == OPTICS else canopy_optics.check_background
    for band in bands:
        check(*found[band])
    return {band: found[band] for band in bands}


def background_of(given, bands):
    """
    Background below the canopy: by band, or as shares of spectra.

    Parameters
    ----------
    given : str, path, mapping of str or None
        As in `by_band`; or shares of spectra, ``"soil_dry:0.475+shade:0.525"`` or a mapping of them.
    bands : sequence of str

    Returns
    -------
    background : dict of str to float, or None
        By band or by spectrum. [1]

    Raises
    ------
    ValueError
        As `by_band`, or if the shares are not right.
    """
    if isinstance(given, str) and ":" in given and not os.path.exists(given):
        return dict(Background(_shares(given)).fractions)
    if isinstance(given, Mapping) and given and set(map(str, given)) <= set(spectrum_names()):
        return dict(Background(given).fractions)
    found = by_band(given, bands, BACKGROUND, "background")
    return found and {band: value for band, (value,) in found.items()}


def sensor_of(name):
    """
    The instrument that looks at the scenes, and its two bands.

    Parameters
    ----------
    name : str or path
        Name of an instrument, or its file.

    Returns
    -------
    description : fifesim.sensor.description.instrument_file.Instrument
    bands : tuple of str
        Its red and its near infrared band.

    Raises
    ------
    ValueError
        If there is no such instrument, or it lacks one of the two.
    """
    description = instrument(name)
    return description, tuple(band.name for band in description.red_and_near_infrared())


def _files(names):
    return ", ".join(f"{name}.csv" for name in names)


def _table(path, columns, what):
    """Numbers by band of a CSV file."""
    name = in_a_line(Path(path).name, 100)
    wanted = ("band", *columns)
    try:
        check_regular(path)
        table = pd.read_csv(path, comment="#", skipinitialspace=True, dtype={"band": str})
    except FileNotFoundError:
        raise ValueError(f"there is no {what} file {in_a_line(str(path), 200)}") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{what} file {name}: {in_a_line(error, 200)}") from None
    lacking = [column for column in wanted if column not in table.columns]
    if lacking:
        raise ValueError(f"{what} file {name} lacks the column {' and '.join(lacking)}: it needs {', '.join(wanted)}")
    numbers = table[list(columns)].apply(pd.to_numeric, errors="coerce")
    if numbers.isna().any(axis=None):
        band = table["band"][numbers.isna().any(axis=1).idxmax()]
        raise ValueError(f"{what} file {name}: band {shown(band)} has no number in {' or '.join(columns)}")
    return dict(zip(table["band"].str.strip(), numbers.itertuples(index=False, name=None), strict=True))


def _shares(text):
    """Shares of spectra of a text such as soil_dry:0.5+shade:0.5."""
    parts = [part.partition(":") for part in text.split("+")]
    try:
        return {name.strip(): float(share) for name, _, share in parts}
    except ValueError:
        raise ValueError(
            f"background = {shown(text)}: type shares such as soil_dry:0.475+shade:0.525, or a CSV file by band"
        ) from None
