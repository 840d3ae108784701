"""Point spread and modulation transfer of an instrument, to plot."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fifesim.base.annotations import Names, NumberOrList
from fifesim.sensor.description.annotations import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument

# Samples of a point spread over the full width of its support, when no spacing is given.
_SAMPLES = 121


def psf(instrument: InstrumentLike = "TM", band: str | None = None, *, spacing: float | None = None) -> xr.DataArray:
    r"""
    Point spread function of an instrument on the ground at nadir.

    .. math:: p(x, y) = w_\mathrm{along}(y) \, w_\mathrm{across}(x)

    Parameters
    ----------
    instrument : str or fifesim.sensor.description.instruments.Instrument, optional
    band : str, optional
        Name of a band; the first by default.
    spacing : float, optional
        Between samples; by default the response is 121 samples wide. [m]

    Returns
    -------
    psf : xarray.DataArray, dims (y, x)
        Mean of the response over each sample, so that the sum times the squared spacing is 1. ``x`` and ``y`` count
        from the pixel's centre, across and along the track. [m-2]

    Raises
    ------
    ValueError
        If there is no such instrument or band, or the spacing is not positive.

    See Also
    --------
    fifesim.sensor.response.spatial, fifesim.sensor.response.transfer

    Examples
    --------
    >>> import fifesim
    >>> response = fifesim.psf("TM", "TM3", spacing=3.0)
    >>> round(float(response.sum()) * 3.0**2, 6)
    1.0
    """
    description = find_instrument(instrument)
    band = description.bands[0] if band is None else description.select(band)[0]
    along, across = description.line_spreads(band)
    if spacing is None:
        spacing = 2 * max(along.half_width, across.half_width) / _SAMPLES
    if not 0 < spacing < np.inf:
        raise ValueError(f"spacing must be a positive number of metres, got {spacing}")
    y, rows = _line(along, spacing)
    x, columns = _line(across, spacing)
    return xr.DataArray(
        np.outer(rows, columns),
        dims=("y", "x"),
        coords={
            "y": ("y", y, {"long_name": "distance along the track, from the pixel's centre", "units": "m"}),
            "x": ("x", x, {"long_name": "distance across the track, from the pixel's centre", "units": "m"}),
            "band": band.name,
        },
        name="psf",
        attrs={"long_name": "point spread function", "units": "m-2", "instrument": description.name},
    )


def mtf(
    instrument: InstrumentLike = "TM", bands: Names | None = None, *, frequency: NumberOrList | None = None
) -> xr.DataArray:
    """
    Modulation transfer function of an instrument on the ground at nadir.

    Parameters
    ----------
    instrument : str or fifesim.sensor.description.instruments.Instrument, optional
    bands : str or sequence of str, optional
        Names of bands; all by default.
    frequency : array, optional
        Spatial frequencies; by default from 0 to that of the closest samples, twice the Nyquist frequency.
        [cycles m-1]

    Returns
    -------
    mtf : xarray.DataArray, dims (band, direction, frequency)
        ``direction`` is "along" or "across" the track. Negative where bright and dark change places. Coordinates along
        band and direction are the Nyquist frequency of the band's own interval, ``nyquist``, and the transfer there,
        ``at_nyquist``; those of the pixels of the gridded product are ``product_nyquist`` and ``at_product_nyquist``.
        [1]

    Raises
    ------
    ValueError
        If there is no such instrument or band.

    See Also
    --------
    fifesim.sensor.response.spatial, fifesim.sensor.response.transfer

    Examples
    --------
    >>> import fifesim
    >>> transfer = fifesim.mtf("TM", ["TM3"], frequency=[0.0, 1 / 60])
    >>> transfer.sel(direction="across").round(2).values
    array([[1.  , 0.69]])
    """
    description = find_instrument(instrument)
    selected = description.select(bands)
    spreads = [description.line_spreads(band) for band in selected]
    own = np.array([[0.5 / interval for interval in description.ground_intervals(band)] for band in selected])
    product = np.array([0.5 / description.pixel(band) for band in selected])
    frequency = np.linspace(0, 2 * own.max(), 201) if frequency is None else np.atleast_1d(frequency).astype(float)
    both, units = ("band", "direction"), {"units": "cycles m-1"}
    return xr.DataArray(
        np.array([[spread.mtf(frequency) for spread in pair] for pair in spreads]),
        dims=(*both, "frequency"),
        coords={
            "band": [band.name for band in selected],
            "direction": ["along", "across"],
            "frequency": ("frequency", frequency, {"long_name": "spatial frequency"} | units),
            "nyquist": (both, own, {"long_name": "Nyquist frequency of the own interval"} | units),
            "at_nyquist": (both, _at(spreads, own), {"long_name": "transfer at the Nyquist frequency", "units": "1"}),
            "product_nyquist": ("band", product, {"long_name": "Nyquist frequency of the gridded product"} | units),
            "at_product_nyquist": (
                both,
                _at(spreads, np.stack([product, product], axis=1)),
                {"long_name": "transfer at the Nyquist frequency of the gridded product", "units": "1"},
            ),
        },
        name="mtf",
        attrs={"long_name": "modulation transfer function", "units": "1", "instrument": description.name},
    )


def _at(spreads, frequencies):
    """Transfer of each band along and across at frequencies of its own, shape (band, direction)."""
    pairs = zip(spreads, frequencies, strict=True)
    return np.array([[float(one.mtf(at)) for one, at in zip(spread, own, strict=True)] for spread, own in pairs])


def _line(spread, spacing):
    """Centres of samples around a line spread's own, and its mean over each [m-1]."""
    half = int(np.ceil(spread.half_width / spacing - 0.5))
    centers = np.arange(-half, half + 1) * spacing
    edges = np.append(centers - spacing / 2, centers[-1] + spacing / 2)
    return centers, np.diff(spread.cumulative(edges)) / spacing
