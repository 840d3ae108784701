"""Leaf and background optics of bands, and the ranges that SAIL accepts."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from fifesim.base import datasets
from fifesim.base.bands import Band
from fifesim.base.kinds import is_path
from fifesim.ground.canopy.prospect import Leaf, leaf_spectrum
from fifesim.ground.canopy.ranges import check_fraction, within
from fifesim.ground.canopy.spectra import Background, background_means, band_means, did_you_mean, is_mixture
from fifesim.ground.canopy.spectrum import LeafSpectrum, Spectrum, read_spectrum

DEAD_LEAF = Leaf(chlorophyll=0.0, carotenoids=0.0, brown=1.0, water=0.001)
"""Dead tallgrass: the default leaf without green pigments and with little water; see ``data/README.md``."""

# What the tables of the TM bands were modelled with; see data/README.md.
_DEFAULT_BACKGROUND = {"soil_dry": 0.475, "shade": 0.525}


def leaf_optics(bands, given=None):
    """
    Leaf reflectance and transmittance of bands.

    Parameters
    ----------
    bands : sequence of str or fifesim.base.bands.Band
        Names, such as ``["TM3", "TM4"]``, or responses, which spectra need.
    given : Leaf, LeafSpectrum, str, path, mapping, or pair of arrays, optional
        The contents of a leaf; its spectra, or the path of their CSV file; ``{band: (reflectance, transmittance)}``;
        or both as arrays of shape (band,). The default is the green tallgrass of ``data/leaf_optics.csv``, and
        ``Leaf()`` for bands that are not in it.

    Returns
    -------
    leaf_reflectance, leaf_transmittance : array, shape (band,)
        [1]

    Raises
    ------
    ValueError
        If a band has no optics, they are outside their range, or the file holds no leaf spectra.

    Examples
    --------
    Leaves absorb red light and scatter near infrared:

    >>> reflectance, transmittance = leaf_optics(["TM3", "TM4"])
    >>> (reflectance + transmittance).round(2).tolist()
    [0.11, 0.87]
    """
    if given is None:
        given = _default_leaves()
        given = given | _leaf_means(_lacking(given, bands), Leaf())
    elif is_path(given):
        given = read_spectrum(_csv(given), LeafSpectrum)
    if isinstance(given, LeafSpectrum):
        given = band_means(_responses(bands, "LeafSpectrum"), given.wavelength, given.values())
    elif isinstance(given, Leaf):
        given = _leaf_means(_responses(bands, "Leaf"), given)
    if isinstance(given, Mapping):
        given = np.reshape([of_band(given, band, "leaf optics") for band in _names(bands)], (-1, 2)).T
    reflectance, transmittance = (_for_bands(values, bands, "leaf optics") for values in given)
    check_leaf_optics(reflectance, transmittance)
    return reflectance, transmittance


def background(bands, given=None):
    """
    Background reflectance of bands.

    Parameters
    ----------
    bands : sequence of str or fifesim.base.bands.Band
        As in `leaf_optics`.
    given : Background, Spectrum, str, mapping, float or array, optional
        Spectra that are mixed, also as ``{spectrum: fraction}``; one spectrum, or the path of its CSV file;
        ``{band: reflectance}``; one number; or an array of shape (band,). The default is the soil and litter of
        ``data/background.csv``, for bands that are not in it the dark soil that it was modelled with.

    Returns
    -------
    background : array, shape (band,)
        [1]

    Raises
    ------
    ValueError
        If a band has no reflectance, or it is outside its range.

    Examples
    --------
    >>> background(["TM3", "TM4"], 0.2).tolist()
    [0.2, 0.2]
    """
    if is_path(given):
        given = Background({str(given): 1.0})
    elif is_mixture(given) and not set(given) <= set(_names(bands)):
        given = Background(given)
    if given is None:
        given = _default_background()
        given = given | _background_means(_lacking(given, bands), Background(_DEFAULT_BACKGROUND))
    elif isinstance(given, Background | Spectrum):
        given = _background_means(_responses(bands, type(given).__name__), given)
    if isinstance(given, Mapping):
        given = [of_band(given, band, "background") for band in _names(bands)]
    reflectance = _for_bands(given, bands, "background")
    check_background(reflectance)
    return reflectance


def _csv(path):
    if not str(path).lower().endswith(".csv"):
        raise ValueError(
            f"leaf_optics={str(path)!r} is not the path of a .csv file: give one with the columns wavelength [um], "
            "reflectance and transmittance [1], or a fifesim.Leaf"
        )
    return path


@lru_cache(maxsize=1)
def _default_leaves():
    return datasets.table("leaf_optics.csv").set_index("band").T.to_dict("list")


@lru_cache(maxsize=1)
def _default_background():
    return datasets.table("background.csv").set_index("band")["background"].to_dict()


def _names(bands):
    return [band.name if isinstance(band, Band) else band for band in bands]


def _lacking(given, bands):
    """Bands whose response is known, and which are not given."""
    return [band for band in bands if isinstance(band, Band) and band.name not in given]


def _responses(bands, needed_by):
    """The bands, if the responses of all are known."""
    if not all(isinstance(band, Band) for band in bands):
        raise TypeError(f"a {needed_by} is a spectrum, it needs the bands' responses: give Band objects, not names")
    return bands


def _leaf_means(bands, leaf):
    """Leaf optics by band."""
    if not bands:
        return {}
    means = _means_of_numbers(tuple(bands), leaf) if not leaf.varying() else _means_of(bands, leaf)
    return {band.name: tuple(pair) for band, pair in zip(bands, means.T.tolist(), strict=True)}


def _means_of(bands, leaf):
    wavelength, *spectra = leaf_spectrum(leaf)
    return band_means(bands, wavelength, spectra)


# Dead leaves stay the same where green ones vary.
_means_of_numbers = lru_cache(maxsize=64)(_means_of)


def _background_means(bands, mixture):
    """Background by band."""
    if not bands:
        return {}
    return dict(zip(_names(bands), background_means(bands, mixture).tolist(), strict=True))


def _for_bands(values, bands, what):
    values = np.asarray(values, float)
    if values.shape not in ((), (1,), (len(bands),)):
        raise ValueError(f"{what} of shape {values.shape} for {len(bands)} bands: give one value for each band")
    return np.broadcast_to(values, len(bands)).copy()


def of_band(given, band, what):
    """
    What a mapping has for a band.

    Parameters
    ----------
    given : mapping
    band : str
    what : str
        "leaf optics" or "background".

    Returns
    -------
    value : object

    Raises
    ------
    ValueError
        If it has nothing.
    """
    if band in given:
        return given[band]
    typed = "(reflectance, transmittance)" if what == "leaf optics" else "reflectance"
    raise ValueError(
        f"no {what} for band {band!r}{did_you_mean(band, given)} There are {', '.join(map(str, given))}; "
        f"for another band pass its own as {{{band!r}: {typed}, ...}}"
    )


def check_leaf_optics(reflectance, transmittance):
    """
    Refuse leaf optics that no leaf can have; there may be none.

    Parameters
    ----------
    reflectance, transmittance : array
        [1]

    Raises
    ------
    ValueError
        If one is outside 0 to 1, or they add up to more than 1.

    Examples
    --------
    >>> check_leaf_optics(0.45, 0.42)
    """
    for name, values in (("reflectance", reflectance), ("transmittance", transmittance)):
        check_fraction(f"leaf {name}", values)
    total = np.max(np.add(reflectance, transmittance), initial=0.0)
    # Decimal fractions that add up to 1 may exceed it by rounding.
    if not total <= 1 + 1e-12:
        raise ValueError(
            f"leaf reflectance and transmittance must not add up to more than 1, got {total:g}: "
            "what a leaf does not reflect or transmit it absorbs; lower one of them"
        )


def check_background(reflectance):
    """
    Refuse a background reflectance outside 0 to 1; NaN passes.

    Parameters
    ----------
    reflectance : array
        [1]

    Raises
    ------
    ValueError
        If one is outside 0 to 1.

    Examples
    --------
    >>> check_background(0.15)
    """
    values = np.asarray(reflectance, float)
    if not within(values, 0.0, 1.0):
        check_fraction("background reflectance", values[~np.isnan(values)])
