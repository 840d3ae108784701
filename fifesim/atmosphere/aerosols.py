"""Amount, optics and height of the aerosol, including aerosols given by the user."""

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fifesim.atmosphere import mixtures
from fifesim.atmosphere.mixtures import Component, mixture, normalized_log_phase, phase_on_sphere, sphere
from fifesim.base import files
from fifesim.base.arguments import Range, check_number
from fifesim.base.caches import cached

SCALE_HEIGHT = 2.0  # of the aerosol above the ground [km]
REFERENCE_WAVELENGTH = 0.55  # at which the amount is given [um]
WAVELENGTH_RANGE = (0.35, 3.75)  # of the built-in tables and of all computations [um]

_MEAN_WITHIN = 0.02  # of the mean of the phase function from 1, for tables between whose angles it bends [1]
_LEAST_SCATTERING = 1e-12  # share of the extinction, so that its logarithm is finite [1]
_HIGHEST = 50.0  # of scale height and layer [km]

# Angles at which a series of moments is tabulated: fine where particles scatter most. [degree]
_ANGLES = np.concatenate([np.arange(200) * 0.05, np.linspace(10, 180, 681)])

# User-defined aerosols of this session by their text, which is stored with the data instead of the tables.
_KNOWN: dict[str, "Aerosol"] = {}


@dataclass(frozen=True, eq=False)
class Aerosol:
    """
    Aerosol defined by its optics, of one kind of particles or of several components.

    Parameters
    ----------
    wavelength : array, shape (wavelength,)
        Two or more wavelengths, increasing, with a range that includes 0.55. [um]
    extinction : array, shape (wavelength,) or (component, wavelength)
        Extinction above 0, in any unit. The amount is given by ``aot`` of the atmosphere.
    single_scattering_albedo : array, shape as extinction
        From 0 to 1. [1]
    angle : array, shape (angle,)
        Scattering angle, increasing from 0 to 180. [degree]
    phase : array, shape (angle, wavelength) or (component, angle, wavelength)
        Phase function, above 0. Its mean over the sphere must be 1 within 2 %, and is normalized. [1]
    polarization : array, shape as phase, optional
        Degree of linear polarization of natural light scattered once, -F12/F11, from -1 to 1; 0 by default. [1]
    asymmetry : array, shape as extinction, optional
        Mean cosine of the scattering angle; by default from the phase function. [1]
    scale_height : float, optional
        Scale height above the ground. [km]
    layer : pair of float, optional
        Bottom and top of a uniform layer above the ground, instead of ``scale_height``. [km]
    name : str, optional

    Raises
    ------
    ValueError
        If an array has a wrong shape or an invalid value.

    Notes
    -----
    Between wavelengths extinction and scattering follow power laws, and the phase function is linear in the logarithm
    of the wavelength, by component. A band must lie within the wavelengths. Where the interpolation over a band
    needs wavelengths beyond them, the last power law is continued, and albedo and phase function stay constant.

    Examples
    --------
    >>> angle = np.arange(181.0)
    >>> mine = Aerosol([0.4, 2.5], [2.0, 0.3], [0.9, 0.9], angle, np.ones((181, 2)), name="even")
    >>> float(mine.components[0].asymmetry[0].round(6)) + 0
    0.0
    """

    wavelength: np.ndarray
    extinction: np.ndarray
    single_scattering_albedo: np.ndarray
    angle: np.ndarray
    phase: np.ndarray
    polarization: np.ndarray | None = None
    asymmetry: np.ndarray | None = None
    scale_height: float | None = None
    layer: tuple | None = None
    name: str = "own"

    def __post_init__(self):
        values = {name: np.array(getattr(self, name), float) for name in ("wavelength", "angle")}
        shapes = {"extinction": 1, "single_scattering_albedo": 1, "phase": 2, "polarization": 2, "asymmetry": 1}
        for name, axes in shapes.items():
            given = getattr(self, name)
            if given is not None:
                values[name] = np.array(given, float)
                if values[name].ndim == axes:
                    values[name] = values[name][None]
        values["name"] = "_".join(str(self.name).replace("#", "_").split()) or "own"
        for name, value in values.items():
            object.__setattr__(self, name, value)
        _check(self)
        if self.layer is None:
            object.__setattr__(self, "scale_height", float(self.scale_height or SCALE_HEIGHT))
        else:
            object.__setattr__(self, "layer", tuple(map(float, self.layer)))
        _KNOWN[str(self)] = self

    def __eq__(self, other):
        return isinstance(other, Aerosol) and str(self) == str(other)

    def __hash__(self):
        return hash(str(self))

    def __str__(self):
        return f"{self.name}#{self._digest}"

    @cached_property
    def _digest(self):
        arrays = (self.wavelength, self.extinction, self.single_scattering_albedo, self.angle, self.phase)
        optional = (values for values in (self.polarization, self.asymmetry) if values is not None)
        parts = [values.tobytes() for values in (*arrays, *optional)] + [repr(self.vertical).encode()]
        return hashlib.sha256(b"|".join(parts)).hexdigest()[:12]

    @property
    def vertical(self):
        """Scale height, or bottom and top of the layer. [km]"""
        return self.scale_height if self.layer is None else self.layer

    @cached_property
    def components(self):
        """Tables of the components."""
        return tuple(_tables(self, part) for part in range(len(self.extinction)))


def known_aerosol(text):
    """User-defined aerosol of this session by its identifying text."""
    if text not in _KNOWN:
        raise ValueError(
            f"aerosol {text!r} is user-defined, and its tables have not been read in this session: "
            f"read them first with fifesim.atmosphere.read_aerosol({text.partition('#')[0] + '.nc'!r})"
        )
    return _KNOWN[text]


def phase_of_moments(moments):
    r"""
    Phase function of a series of Legendre moments.

    .. math:: P(\mu) = \sum_l (2 l + 1) \chi_l P_l(\mu)

    Parameters
    ----------
    moments : array, shape (..., order)
        :math:`\chi_l`, the first 1. [1]

    Returns
    -------
    angle : array, shape (angle,)
        [degree]
    phase : array, shape (..., angle)
        [1]

    References
    ----------
    [Wiscombe1977]_
    """
    moments = np.asarray(moments, float)
    series = moments * (2 * np.arange(moments.shape[-1]) + 1)
    return _ANGLES, np.polynomial.legendre.legval(np.cos(np.radians(_ANGLES)), np.moveaxis(series, -1, 0))


def _tables(aerosol, part):
    """Tables of one component, extrapolated to the ends of `WAVELENGTH_RANGE`."""
    (low, high), own = WAVELENGTH_RANGE, aerosol.wavelength
    beyond = int(own[0] > low), int(own[-1] < high)
    wavelength = np.concatenate([[low][: beyond[0]], own, [high][: beyond[1]]])
    # Linear in logarithms, and extrapolated beyond the outermost wavelengths.
    at, nodes, values = np.log(wavelength), np.log(own), np.log(aerosol.extinction[part])
    first, last = ((values[b] - values[a]) / (nodes[b] - nodes[a]) for a, b in ((0, 1), (-2, -1)))
    below, above = np.minimum(at - nodes[0], 0), np.maximum(at - nodes[-1], 0)
    log_extinction = np.interp(at, nodes, values) + below * first + above * last
    cosine, weights = sphere(aerosol.angle)
    log_phase = normalized_log_phase(aerosol.angle, np.log(aerosol.phase[part]))
    polarization = np.zeros_like(log_phase) if aerosol.polarization is None else aerosol.polarization[part]
    if aerosol.asymmetry is None:
        asymmetry = (weights * cosine) @ phase_on_sphere(aerosol.angle, log_phase)
    else:
        asymmetry = aerosol.asymmetry[part]
    albedo = np.maximum(aerosol.single_scattering_albedo[part], _LEAST_SCATTERING)
    return Component(
        log_wavelength=at,
        log_extinction=log_extinction,
        log_scattering=log_extinction + np.pad(np.log(albedo), beyond, "edge"),
        asymmetry=np.pad(asymmetry, beyond, "edge"),
        angle=aerosol.angle,
        log_phase=np.pad(log_phase, [(0, 0), beyond], "edge"),
        polarization=np.pad(polarization, [(0, 0), beyond], "edge"),
    )


def _check(aerosol):
    """Raise ValueError if an array of an aerosol has a wrong shape or value."""
    wavelength, angle = aerosol.wavelength, aerosol.angle
    by_wavelength = (len(aerosol.extinction), wavelength.size)
    by_angle = (len(aerosol.extinction), angle.size, wavelength.size)
    _check_axis(aerosol, "wavelength", "um")
    _check_axis(aerosol, "angle", "degrees")
    if wavelength[0] < 0.1 or wavelength[-1] > 50:
        found = wavelength[-1] if wavelength[-1] > 50 else wavelength[0]
        _refuse(aerosol, "wavelength", "from 0.1 to 50 um", f"{found:g}", "divide nanometres by 1000")
    if not wavelength[0] <= REFERENCE_WAVELENGTH <= wavelength[-1]:
        span = f"{wavelength[0]:g} to {wavelength[-1]:g} um"
        _refuse(aerosol, "wavelength", "on both sides of 0.55 um, where aot is", span, "add wavelengths")
    if abs(angle[0]) > 1e-6 or abs(angle[-1] - 180) > 1e-6:
        span = f"{angle[0]:g} to {angle[-1]:g}"
        _refuse(aerosol, "angle", "from 0 to 180 degrees", span, "add the ends; radians are to be made degrees")
    ranges = {
        "extinction": (by_wavelength, 0, np.inf, "above 0", "give it in any one unit"),
        "single_scattering_albedo": (by_wavelength, 0, 1, "from 0 to 1", "give a fraction, not a percentage"),
        "asymmetry": (by_wavelength, -1, 1, "from -1 to 1", "leave it out to compute it from the phase function"),
        "phase": (by_angle, 0, np.inf, "above 0", "give it itself, not its logarithm; or more moments"),
        "polarization": (by_angle, -1, 1, "from -1 to 1", "give -F12/F11"),
    }
    for name, (shape, low, high, allowed, hint) in ranges.items():
        values = getattr(aerosol, name)
        if values is None:
            continue
        if values.shape != shape:
            _refuse(aerosol, name, f"of shape {shape}", values.shape, "one value for each component, angle, wavelength")
        wrong = ~((values >= low) & (values <= high) & np.isfinite(values))
        if low == 0 and high == np.inf:
            wrong |= values == 0
        if wrong.any():
            place = tuple(np.argwhere(wrong)[0])
            _refuse(aerosol, name, allowed, f"{values[place]:g} at {wavelength[place[-1]]:g} um", hint)
    _, weights = sphere(angle)
    for log_phase in np.log(aerosol.phase):
        mean = weights @ phase_on_sphere(angle, log_phase)
        worst = np.argmax(np.abs(mean - 1))
        if abs(mean[worst] - 1) > _MEAN_WITHIN:
            found = f"{mean[worst]:.4g} at {wavelength[worst]:g} um"
            hint = "divide the phase function by that, or write units='sr-1' where it is per steradian"
            _refuse(aerosol, "mean of phase over the sphere", f"1 within {100 * _MEAN_WITHIN:g} %", found, hint)
    _check_vertical(aerosol)


def _check_axis(aerosol, name, unit):
    values, hint = getattr(aerosol, name), f"sort the tables by {name}, and fill or drop what is missing"
    if values.ndim != 1 or values.size < 2:
        _refuse(aerosol, name, "one row of two or more numbers", f"shape {values.shape}", hint)
    wrong = np.flatnonzero(~(np.diff(values) > 0))
    if wrong.size:
        _refuse(aerosol, name, "increasing", f"{values[wrong[0] + 1]:g} {unit} after {values[wrong[0]]:g}", hint)


def _check_vertical(aerosol):
    height, layer = aerosol.scale_height, aerosol.layer
    if layer is None:
        if height is not None and not 0.1 <= height <= 8:
            _refuse(aerosol, "scale_height", "from 0.1 to 8 km", f"{height:g}", "divide metres by 1000, or give layer=")
        return
    if height is not None:
        _refuse(aerosol, "layer", "alone", f"a scale_height of {height:g} km, too", "give one of the two")
    if np.shape(layer) != (2,) or not 0 <= layer[0] < layer[1] <= _HIGHEST:
        allowed = f"bottom and top from 0 to {_HIGHEST:g} km, the top above the bottom"
        _refuse(aerosol, "layer", allowed, layer, "(0, 2), say; divide metres by 1000")


def _refuse(aerosol, what, allowed, got, hint):
    raise ValueError(f"aerosol {aerosol.name}: {what} must be {allowed}, got {got}: {hint}")


# Extinction per particle at 0.55 um with which the number profiles give the visibility at the ground. [km-1 cm3]
_EXTINCTION_PER_PARTICLE = 5.6032e-5


def aerosol_optical_thickness(visibility):
    r"""
    Aerosol optical thickness at 0.55 um of the whole atmosphere.

    .. math::

        \tau = \sigma \sum_i \sqrt{N_i N_{i+1}} \, \Delta z_i, \qquad N(z, V) = \frac{a(z)}{V} + b(z)

    Parameters
    ----------
    visibility : float
        Meteorological range at the ground, :math:`V`. [km]

    Returns
    -------
    aot : float
        [1]

    Notes
    -----
    :math:`a` and :math:`b` make the number profile pass through the two tabulated ones, for 5 and 23 km.
    The column starts at the ground for any altitude.

    References
    ----------
    [McClatchey1972]_, number profiles; [Tanre1990]_

    Examples
    --------
    >>> aerosol_optical_thickness(10.0) > aerosol_optical_thickness(50.0)
    True
    """
    hazy, clear, thickness = _particles()
    slope = (hazy - clear) / (1 / 5 - 1 / 23)
    number = clear + slope * (1 / visibility - 1 / 23)
    layers = np.sqrt(number[1:] * number[:-1]) * thickness
    return float(_EXTINCTION_PER_PARTICLE * layers.sum())


@cached(1, "numbers of aerosol particles by level")
def _particles():
    """Aerosol particle numbers at the levels of the two visibilities, and the layer depths."""
    levels = files.table("aerosol_profile.csv")
    hazy, clear = levels["visibility_5km"].to_numpy(), levels["visibility_23km"].to_numpy()
    return hazy, clear, np.diff(levels["altitude"])


def parts(aerosol):
    """Volume shares of the components of an aerosol, by name or table. [1]"""
    return dict.fromkeys(aerosol.components, 1.0) if isinstance(aerosol, Aerosol) else mixture(aerosol)


def covers(aerosol, low, high):
    """Whether the tables of an aerosol cover a wavelength range."""
    first, last = wavelength_limits(aerosol)
    return bool(first <= low and high <= last)


def wavelength_limits(aerosol):
    """First and last wavelength of the tables of an aerosol. [um]"""
    own = isinstance(aerosol, Aerosol)
    return (float(aerosol.wavelength[0]), float(aerosol.wavelength[-1])) if own else WAVELENGTH_RANGE


def vertical(aerosol):
    """Scale height of an aerosol, or bottom and top of a homogeneous layer. [km]"""
    return aerosol.vertical if isinstance(aerosol, Aerosol) else SCALE_HEIGHT


def aerosol_optics(aerosol, wavelength):
    r"""
    Optical properties of an aerosol.

    .. math::

        \sigma = \sum_j c_j \sigma_j, \qquad \omega = \frac{\sum_j c_j \omega_j \sigma_j}{\sigma}, \qquad
        g = \frac{\sum_j c_j \omega_j \sigma_j g_j}{\sum_j c_j \omega_j \sigma_j}

    Parameters
    ----------
    aerosol : str, mapping or Aerosol
        As in `mixture`; its volume fractions are :math:`c_j`, which are 1 for user-supplied tables.
    wavelength : array, shape (n,)
        0.35 to 3.75. [um]

    Returns
    -------
    extinction : array, shape (n,)
        :math:`\sigma` relative to 0.55 um. [1]
    single_scattering_albedo : array, shape (n,)
        :math:`\omega` [1]
    asymmetry : array, shape (n,)
        Mean cosine of the scattering angle, :math:`g`. [1]

    Notes
    -----
    Cross sections of a component, for a unit of its particles' volume, follow a power law between the tabulated
    wavelengths; its asymmetry is linear in their logarithm.

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory; [Tanre1990]_, mixtures
    """
    wavelength, fractions = _checked_wavelength(wavelength), parts(aerosol)
    extinction, scattering, directed = _cross_sections(fractions, wavelength)
    reference, _, _ = _cross_sections(fractions, REFERENCE_WAVELENGTH)
    return extinction / reference, scattering / extinction, directed / scattering


def aerosol_phase(aerosol, scattering_cosine, wavelength):
    r"""
    Phase function of an aerosol.

    .. math:: P = \frac{\sum_j c_j \omega_j \sigma_j P_j}{\sum_j c_j \omega_j \sigma_j}

    Parameters
    ----------
    aerosol : str, mapping or Aerosol
        As in `mixture`; its volume fractions are :math:`c_j`, which are 1 for user-supplied tables.
    scattering_cosine : array, broadcastable with wavelength
        Cosine of the scattering angle. [1]
    wavelength : array
        0.35 to 3.75. [um]

    Returns
    -------
    phase : array, shape of the broadcast inputs
        Its mean over the sphere is 1. [1]

    Notes
    -----
    The phase function of a component is linear in the logarithm of the wavelength, which preserves its mean. Its
    logarithm is linear in the angle.

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory; [Tanre1990]_, mixtures
    """
    wavelength, fractions = _checked_wavelength(wavelength), parts(aerosol)
    return _weighted_mean(fractions, wavelength, lambda name: mixtures.phase(name, scattering_cosine, wavelength))


def aerosol_polarization(aerosol, scattering_cosine, wavelength):
    r"""
    Degree of linear polarization of natural light that an aerosol scatters once.

    .. math:: q = -\frac{P_{12}}{P_{11}}

    Parameters
    ----------
    aerosol, scattering_cosine, wavelength
        As in `aerosol_phase`.

    Returns
    -------
    polarization : array, shape of the broadcast inputs
        Positive where the light vibrates across the plane of scattering, as in molecular scattering. [1]

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory
    """
    wavelength, fractions = _checked_wavelength(wavelength), parts(aerosol)

    def mean(polarized):
        return _weighted_mean(
            fractions, wavelength, lambda name: mixtures.phase(name, scattering_cosine, wavelength, polarized=polarized)
        )

    return mean(True) / mean(False)


def phase_moments(aerosol, wavelength, count):
    r"""
    Legendre moments of the phase function.

    .. math:: \chi_l = \frac{1}{2} \int_{-1}^{1} P(\mu) P_l(\mu) \, \mathrm{d}\mu, \qquad
        P(\mu) = \sum_l (2 l + 1) \chi_l P_l(\mu)

    Parameters
    ----------
    aerosol : str, mapping or Aerosol
        As in `mixture`, or user-supplied tables.
    wavelength : array, shape (n,)
        0.35 to 3.75. [um]
    count : int
        Number of moments, from :math:`\chi_0 = 1` on; the tables carry a hundred within 1e-3. [1]

    Returns
    -------
    moments : array, shape (n, count)
        Those of `aerosol_phase`. [1]

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory
    """
    at, fractions = np.atleast_1d(_checked_wavelength(wavelength)), parts(aerosol)
    return _weighted_mean(fractions, at[:, None], lambda name: mixtures.component_phase_moments(name, at, count))


def _checked_wavelength(wavelength):
    wavelength = np.asarray(wavelength, float)
    note = "give it in micrometres, inside the aerosol tables"
    check_number("wavelength", np.atleast_1d(wavelength), Range("um", *WAVELENGTH_RANGE, note=note))
    return wavelength


def _cross_sections(fractions, wavelength):
    """Extinction, scattering, and scattering times asymmetry of a mixture. [um-1]"""
    parts = fractions.items()
    return sum(fraction * np.stack(mixtures.cross_sections(component, wavelength)) for component, fraction in parts)


def _weighted_mean(fractions, wavelength, values):
    """Mean over the components, weighted by their scattering."""
    total = amount = 0.0
    for component, fraction in fractions.items():
        _, scattering, _ = mixtures.cross_sections(component, wavelength)
        total, amount = total + fraction * scattering * values(component), amount + fraction * scattering
    return total / amount
