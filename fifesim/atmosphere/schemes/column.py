"""An atmosphere of molecules and aerosol cut in layers of even composition, and light that goes through them."""

from typing import NamedTuple

import numpy as np
from scipy.special import exprel

from fifesim.atmosphere.air.molecules import DEPOLARIZATION
from fifesim.atmosphere.air.own_aerosol import SCALE_HEIGHT
from fifesim.atmosphere.schemes.phase_expansion import rayleigh_expansion, truncated_expansion

MOLECULES_HEIGHT = 8.0  # scale height [km]

_LEAST_DEPTH = 1e-12  # optical depth that stands for none [1]


class Column(NamedTuple):
    """An atmosphere cut in layers of equal optical depth, from the top down."""

    depth: float  # of one layer [1]
    molecules: np.ndarray  # scattering over extinction, shape (layers,) [1]
    aerosol: np.ndarray  # the same, without the forward peak [1]
    aerosol_once: np.ndarray  # the same, of all that is scattered [1]
    molecules_expansion: np.ndarray  # shape (count, 4) [1]
    aerosol_expansion: np.ndarray

    @property
    def terms(self):
        """Number of terms of the expansions."""
        return len(self.molecules_expansion)

    def polarizes(self, mode):
        """
        Whether Q and U of a Fourier mode are anything but 0.

        Parameters
        ----------
        mode : int

        Returns
        -------
        answer : bool
        """
        return mode < 3 or bool(self.aerosol_expansion[:, 1:].any())

    def mixing(self, mode, components):
        """
        Scattering matrix of each layer in the basis of `phase_expansion.stokes_basis`.

        Parameters
        ----------
        mode, components : int

        Returns
        -------
        mixing : array, shape (layers, degrees, components, components)
            [1]
        """
        pure = np.stack([self.molecules_expansion[mode:], self.aerosol_expansion[mode:]])
        beta, alpha, zeta, gamma = np.einsum("ak,alc->ckl", np.stack([self.molecules, self.aerosol]), pure)
        if components == 1:
            return np.ascontiguousarray(beta[..., None, None])
        none = np.zeros_like(beta)
        matrix = np.array([[beta, gamma, none], [gamma, alpha, none], [none, none, zeta]])
        return np.ascontiguousarray(np.moveaxis(matrix, (0, 1), (2, 3)))

    def steps(self, cosine):
        """
        What one layer does to light.

        Parameters
        ----------
        cosine : array, shape (directions,)
            Of the angle from the vertical. [1]

        Returns
        -------
        through, averaged : array, shape (directions,)
            What it lets through, and the mean over the layer of what enters it. [1]
        """
        slant = self.depth / cosine
        return np.exp(-slant), -np.expm1(-slant) / slant

    def layer_mean(self, cosine):
        """
        Mean over each layer of light 1 that enters at the top.

        Parameters
        ----------
        cosine : array, shape (directions,)
            [1]

        Returns
        -------
        light : array, shape (layers, directions)
            [1]
        """
        _, averaged = self.steps(cosine)
        return self._from_top(cosine) * averaged

    def escape(self, cosine):
        """
        Light that leaves the top for a source of 1 in each layer.

        Parameters
        ----------
        cosine : array, shape (directions,)
            [1]

        Returns
        -------
        light : array, shape (directions, layers)
            [1]
        """
        through, _ = self.steps(cosine)
        return (self._from_top(cosine) * (1 - through)).T

    def both_ways(self, mu_s, mu_v, at_ground=False):
        """
        Integral over each layer of the sunlight that reaches it and is not scattered again on its way out.

        Parameters
        ----------
        mu_s : float
        mu_v : array, shape (views,)
            Cosines of the angles from the vertical of the sun and of the way out. [1]
        at_ground : bool, optional
            Out at the ground instead of at the top.

        Returns
        -------
        light : array, shape (layers, views)
            [1]
        """
        if not at_ground:
            return self.layer_mean(1 / (1 / mu_s + 1 / mu_v)) * self.depth
        layer = np.arange(len(self.molecules))[:, None]
        reached = np.exp(-self.depth * (layer / mu_s + (layer[::-1] + 1) / mu_v))
        return reached * self.depth * exprel(self.depth * (1 / mu_v - 1 / mu_s))

    def _from_top(self, cosine):
        """Transmittance from the top to each layer, shape (layers, directions)."""
        return np.exp(-np.arange(len(self.molecules))[:, None] * self.depth / cosine)


def mixed_column(
    tau_molecules,
    tau_aerosol,
    single_scattering_albedo,
    moments,
    count,
    layers,
    *,
    vertical=SCALE_HEIGHT,
    depolarization=DEPOLARIZATION,
):
    """
    Molecules whose density falls off exponentially, with a scale height of 8 km, and aerosol among them.

    Parameters
    ----------
    tau_molecules, tau_aerosol, single_scattering_albedo : float
    moments : array, shape (terms,) or (terms, 4)
        As in `successive_orders.path_reflectance`. [1]
    count, layers : int
        Terms of the expansions, and number of layers.
    vertical : float or pair of float
        Scale height of the aerosol, or bottom and top of its even layer. [km]
    depolarization : float, optional
        Of the molecules. [1]

    Returns
    -------
    column : Column
        The forward peak of the aerosol counts as not scattered.

    References
    ----------
    [Wiscombe1977]_, forward peak

    Examples
    --------
    >>> column = mixed_column(0.2, 0.0, 1.0, [1.0], 4, 10)
    >>> round(float(column.depth), 12), column.molecules.round(9).tolist() == [1.0] * 10
    (0.02, True)
    """
    expansion, peak = truncated_expansion(moments, count)
    thinned = tau_aerosol * (1 - single_scattering_albedo * peak)
    tau_molecules = np.maximum(tau_molecules, _LEAST_DEPTH)
    depth = (tau_molecules + thinned) / layers
    air_edges, particle_edges = _edges(tau_molecules, thinned, layers, vertical)
    air = tau_molecules * np.diff(air_edges) / depth
    particles = np.diff(particle_edges) / depth
    scattered = tau_aerosol * single_scattering_albedo * particles
    return Column(depth, air, scattered * (1 - peak), scattered, rayleigh_expansion(count, depolarization), expansion)


def _edges(tau_molecules, tau_aerosol, layers, vertical):
    """Shares of molecules and aerosol above the edges of layers of equal optical depth."""
    above = (tau_molecules + tau_aerosol) * np.arange(1, layers) / layers
    inside = _exponential if np.ndim(vertical) == 0 else _even
    share, particles = inside(tau_molecules, tau_aerosol, above, vertical)
    return np.concatenate([[0.0], share, [1.0]]), np.concatenate([[0.0], particles, [1.0]])


def _exponential(tau_molecules, tau_aerosol, above, scale_height):
    """Shares above some optical depths where the aerosol falls off exponentially, by Newton's method."""
    # The aerosol above an altitude is a power of the molecules above it.
    ratio = MOLECULES_HEIGHT / scale_height
    share = np.ones(above.size)
    # The depth above is a convex function of the share: from 1 the steps go down to the root and never beyond.
    for _ in range(60):
        excess = tau_molecules * share + tau_aerosol * share**ratio - above
        share = share - excess / (tau_molecules + ratio * tau_aerosol * share ** (ratio - 1))
    return share, share**ratio


def _even(tau_molecules, tau_aerosol, above, layer):
    """Shares above some optical depths where the aerosol fills a layer evenly."""
    bottom, top = layer
    # Every 10 m, so that the molecules between two altitudes lie on a line, and at the layer's edges. [km]
    altitude = np.union1d(np.linspace(0, 80, 8001), layer)[::-1]
    molecules = np.exp(-altitude / MOLECULES_HEIGHT)
    particles = np.clip((top - altitude) / (top - bottom), 0, 1)
    depth = tau_molecules * molecules + tau_aerosol * particles
    share = np.interp(above, depth, molecules)
    return share, np.interp(above, depth, particles)
