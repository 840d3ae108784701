"""Leaf and background optics in bands, with the ranges that SAIL accepts."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from fifesim.base import files
from fifesim.base.arguments import is_path
from fifesim.base.arrays import distinct_columns, read_only
from fifesim.base.bands import Band
from fifesim.base.caches import cached
from fifesim.ground.canopy.interpolation import refined
from fifesim.ground.canopy.leaf_area import check_fraction, check_share
from fifesim.ground.canopy.measured_spectra import LeafSpectrum, Spectrum, read_spectrum
from fifesim.ground.canopy.prospect import LEAF_RANGES, Leaf, leaf_band_means, leaf_spectrum
from fifesim.ground.canopy.spectra import (
    Background,
    background_means,
    band_means,
    did_you_mean,
    is_file,
    is_mixture,
)

# Dead tallgrass: the default leaf without green pigments and with little water; see ``data/README.md``.
DEAD_LEAF = Leaf(chlorophyll=0.0, carotenoids=0.0, brown=1.0, water=0.001)

# Mixture from which the tables of the TM bands were modelled; see data/README.md.
_DEFAULT_BACKGROUND = {"soil_dry": 0.475, "shade": 0.525}


@cached(64, "leaf optics in bands")
def optics_of_leaf(bands, leaf):
    """Reflectance and transmittance of a leaf, by default green tallgrass, shape (band,), read-only. [1]"""
    if leaf is None:
        known = files.table("leaf_optics.csv").set_index("band").T.to_dict("list")
        found = band_leaf_optics(bands, known | _leaf_means(_lacking(known, bands), Leaf()))
    else:
        found = band_leaf_optics(bands, _leaf_means(_responses(bands, "Leaf"), leaf))
    return tuple(map(read_only, found))


@cached(64, "default background in bands")
def default_background(bands):
    """Reflectance of soil and litter of tallgrass, shape (band,), read-only. [1]"""
    known = files.table("background.csv").set_index("band")["background"].to_dict()
    mixed = _background_means(_lacking(known, bands), Background(_DEFAULT_BACKGROUND))
    return read_only(band_background(bands, known | mixed))


def band_leaf_optics(bands, given=None):
    """Leaf reflectance and transmittance of bands, shape (band,). [1]"""
    if given is None or (isinstance(given, Leaf) and not given.varying()):
        return tuple(each.copy() for each in optics_of_leaf(tuple(bands), given))
    if is_path(given):
        given = read_spectrum(_path(given), LeafSpectrum)
    elif isinstance(given, Leaf):
        given = _leaf_means(_responses(bands, "Leaf"), given)
    if isinstance(given, LeafSpectrum):
        given.check_gaps(bands)
        given = band_means(_responses(bands, "LeafSpectrum"), given.wavelength, given.values())
    if isinstance(given, Mapping):
        given = np.reshape([of_band(given, band, "leaf optics") for band in _names(bands)], (-1, 2)).T
    reflectance, transmittance = (_for_bands(values, bands, "leaf optics") for values in given)
    check_leaf_optics(reflectance, transmittance)
    return reflectance, transmittance


def band_background(bands, given=None):
    """Background reflectance of bands, shape (band,). [1]"""
    if given is None:
        return default_background(tuple(bands)).copy()
    if is_path(given):
        given = Background({str(given): 1.0})
    elif is_mixture(given) and not set(given) <= set(_names(bands)):
        given = Background(given)
    if isinstance(given, Background | Spectrum):
        given = _background_means(_responses(bands, type(given).__name__), given)
    if isinstance(given, Mapping):
        given = [of_band(given, band, "background") for band in _names(bands)]
    reflectance = _for_bands(given, bands, "background")
    check_background(reflectance)
    return reflectance


def _path(path):
    if not is_file(path):
        raise ValueError(
            f"leaf_optics={str(path)!r} is not the path of a .csv or .txt file: give one with the columns wavelength "
            "[um], reflectance and transmittance [1], or a fifesim.Leaf"
        )
    return path


def _names(bands):
    return [band.name if isinstance(band, Band) else band for band in bands]


def _lacking(given, bands):
    """Bands with a known response that are not given."""
    return [band for band in bands if isinstance(band, Band) and band.name not in given]


def _responses(bands, needed_by):
    """Check that the responses of all bands are known."""
    if not all(isinstance(band, Band) for band in bands):
        raise TypeError(f"a {needed_by} is a spectrum, it needs the bands' responses: give Band objects, not names")
    return bands


def _leaf_means(bands, leaf):
    """Leaf optics by band."""
    if not bands:
        return {}
    wavelength, *spectra = leaf_spectrum(leaf)
    means = band_means(bands, wavelength, spectra)
    return {band.name: tuple(pair) for band, pair in zip(bands, means.T.tolist(), strict=True)}


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
    """Value of a mapping for a band."""
    if band in given:
        return given[band]
    typed = "(reflectance, transmittance)" if what == "leaf optics" else "reflectance"
    raise ValueError(
        f"no {what} for band {band!r}{did_you_mean(band, given)} There are {', '.join(map(str, given))}; "
        f"for another band pass its own as {{{band!r}: {typed}, ...}}"
    )


def check_leaf_optics(reflectance, transmittance):
    """Raise ValueError for impossible leaf optics; the arrays may be empty."""
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
    """Raise ValueError if a background reflectance is outside 0 to 1; NaN passes."""
    check_share("background reflectance", reflectance)


LEAF_TOLERANCE = 1e-8  # of leaf reflectance and transmittance from a table [1]

_COARSEST, _FINEST = 64, 2**12


def leaf_means(bands, leaf, exact=False):
    """Reflectance and transmittance in bands of leaves that differ, shape (2, band, ...). [1]"""
    # Within TOLERANCE where a single content varies, else exact.
    bands, varying = tuple(bands), leaf.varying()
    names, arrays = list(varying), np.broadcast_arrays(*(np.asarray(v, float) for v in varying.values()))
    cells = np.stack([each.reshape(-1) for each in arrays])
    if len(names) == 1 and not exact:
        low, high = _range(names[0])
        table = _table(bands, names[0], replace(leaf, **{names[0]: low}))
        means = table(np.cbrt((cells[0] - low) / (high - low))).T.reshape(2, len(bands), -1)
        # By the error of the table leaves without absorption could give more than they get.
        means[1] = np.minimum(means[1], 1 - means[0])
    else:
        means = _each_kind(bands, leaf, names, cells)
    return means.reshape(2, len(bands), *arrays[0].shape)


def _each_kind(bands, leaf, names, cells):
    """Band means of leaves, shape (2, band, n), from the varying contents, shape (name, n), once per kind of leaf."""
    means = np.full((2, len(bands), cells.shape[1]), np.nan)
    known = ~np.isnan(cells).any(axis=0)
    first, kind = distinct_columns(cells[:, known])
    kinds = dict(zip(names, cells[:, known][:, first], strict=True))
    means[..., known] = np.moveaxis(_means(bands, replace(leaf, **kinds)), -1, 1)[..., kind]
    return means


def _means(bands, leaf):
    """Reflectance and transmittance of each leaf in each band, shape (2, n, band)."""
    return np.moveaxis(leaf_band_means(leaf.contents(), leaf_weights(tuple(bands))), 1, -1)


_ROWS = 256  # wavelengths at a time, to bound memory


@cached(32, "weights of wavelengths in bands")
def leaf_weights(bands):
    """Weights of the wavelengths of leaves in the mean of each band, shape (2101, band)."""
    wavelength, *_ = leaf_spectrum(Leaf(), (0.0, np.inf))
    rows = range(0, wavelength.size, _ROWS)
    weights = [band_means(bands, wavelength, np.eye(_ROWS, wavelength.size, row)) for row in rows]
    return np.concatenate(weights)[: wavelength.size]


@cached(32, "splines of leaf optics")
def _table(bands, name, leaf):
    """Cubic spline of reflectance and transmittance in each band over the cube root of one content."""
    # Transmittance falls steeply with the first pigment, and k^2 E1(k) has no third derivative at 0; both are smooth in
    # the cube root.
    low, high = _range(name)

    def exact(position):
        means = _means(bands, replace(leaf, **{name: np.minimum(low + (high - low) * position**3, high)}))
        return np.moveaxis(means, 1, 0).reshape(len(position), -1)

    values = refined(exact, _COARSEST, _FINEST, LEAF_TOLERANCE, 0, nodes="leaves")
    return CubicSpline(np.linspace(0, 1, len(values)), values)


def _range(name):
    """Smallest and largest value of a content of a leaf."""
    return LEAF_RANGES[name].lowest, LEAF_RANGES[name].highest
