"""A canopy and the light on it: all that the reflectance of cells depends on besides their leaf area and background."""

from typing import NamedTuple

import numpy as np

from fifesim.ground.canopy.absorption import extinction_coefficient
from fifesim.ground.canopy.background import reflectance_factor, with_background
from fifesim.ground.canopy.crowns import SHAPE, check_crowns, clumped, crown_shares, lai_in_crowns
from fifesim.ground.canopy.layers import two_layers
from fifesim.ground.canopy.leaf_angles import LeafAngles
from fifesim.ground.canopy.leaf_area import check_lai
from fifesim.ground.canopy.optics import check_background
from fifesim.ground.canopy.ranges import check_share
from fifesim.ground.canopy.sail_model import sail

_BLOCK = 2**15  # cells evaluated at a time, to bound memory


class Scene(NamedTuple):
    """
    Leaves, their order, and directions; numbers, or arrays whose last axis are cells.

    Optics and the sky's share are tuples over bands, or arrays of shape (band, 1) or (band, n).
    """

    leaf_reflectance: tuple | np.ndarray
    leaf_transmittance: tuple | np.ndarray
    sky: tuple | np.ndarray
    sza: float | np.ndarray
    vza: float | np.ndarray
    raa: float | np.ndarray
    leaf_angles: LeafAngles
    hotspot: float
    brown_reflectance: tuple | np.ndarray | None = None
    brown_transmittance: tuple | np.ndarray | None = None
    brown: float | np.ndarray = 0.0
    dissociation: float | np.ndarray = 0.0
    crown_cover: float | np.ndarray = 1.0
    crown_shape: float = SHAPE

    def varies(self):
        """
        Whether leaves or crowns differ from cell to cell.

        Returns
        -------
        answer : bool
        """
        return any(isinstance(each, np.ndarray) for each in (self.brown, self.dissociation, self.crown_cover))

    def part(self, cells):
        """
        The same for some of the cells: of arrays that vary, whose last axis they are.

        Parameters
        ----------
        cells : slice or array of int

        Returns
        -------
        scene : Scene
        """
        by_cell = {name: v for name, v in self._asdict().items() if isinstance(v, np.ndarray) and v.shape[-1:] > (1,)}
        return self._replace(**{name: values[..., cells] for name, values in by_cell.items()})


def canopy_of(lai, scene):
    """
    Reflectances and transmittances of the canopy of cells.

    Parameters
    ----------
    lai : array, shape (n,)
        Of the ground. [m2 m-2]
    scene : Scene

    Returns
    -------
    canopy : Canopy
        Fields broadcast to shape (band, n). [1]
    """
    if _is(scene.crown_cover, 1):
        return leaves_of(lai, scene)
    shares = crown_shares(scene.crown_cover, scene.crown_shape, scene.sza, scene.vza, scene.raa)
    return clumped(leaves_of(lai_in_crowns(lai, scene.crown_cover), scene), shares)


def leaves_of(lai, scene):
    """
    The same without gaps between crowns.

    Parameters
    ----------
    lai : array, shape (n,)
        Within the crowns. [m2 m-2]
    scene : Scene

    Returns
    -------
    canopy : Canopy
        [1]
    """
    names = "sza", "vza", "raa", "leaf_angles", "hotspot"
    given = {name: getattr(scene, name) for name in names}
    leaf = _by_band(scene.leaf_reflectance), _by_band(scene.leaf_transmittance)
    if _is(scene.brown, 0):
        return sail(lai, *leaf, **given)
    dead = _by_band(scene.brown_reflectance), _by_band(scene.brown_transmittance)
    return two_layers(lai, *leaf, *dead, brown=scene.brown, dissociation=scene.dissociation, **given)


def sky_of(scene):
    """
    Share of skylight.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    sky : array, shape (band, 1) or (band, n)
        [1]
    """
    return _by_band(scene.sky)


def reflectance_of(lai, background, scene):
    """
    Reflectance factor of cells, by the models themselves.

    Parameters
    ----------
    lai : array, shape (n,)
        [m2 m-2]
    background : array, shape (band, n) or (band, 1)
        [1]
    scene : Scene

    Returns
    -------
    reflectance : array, shape (band, n)
        [1]
    """
    surface = with_background(canopy_of(lai, scene), background)
    return reflectance_factor(surface.rso, surface.rdo, sky_of(scene))


def cell_by_cell(lai, background, scene):
    """
    The same, a block of cells at a time.

    Parameters
    ----------
    lai : array, shape (n,)
        [m2 m-2]
    background : array, shape (band, n) or (band, 1)
        [1]
    scene : Scene

    Returns
    -------
    reflectance : array, shape (band, n)
        [1]
    """
    background = np.broadcast_to(background, (len(background), lai.size))
    out = np.empty(background.shape)
    for start in range(0, lai.size, _BLOCK):
        block = slice(start, start + _BLOCK)
        out[:, block] = reflectance_of(lai[block], background[:, block], scene.part(block))
    return out


def check_cells(lai, background, scene):
    """
    Refuse cells that no canopy has; NaN passes.

    Parameters
    ----------
    lai : array, shape (n,)
        [m2 m-2]
    background : array, shape (...)
        [1]
    scene : Scene

    Raises
    ------
    ValueError
        If leaf area index, background, dead share or crown cover are outside their range.
    """
    check_lai(lai)
    check_background(background)
    check_share("brown", scene.brown)
    if not _is(scene.crown_cover, 1):
        check_crowns(lai, scene.crown_cover)


def decay(scene):
    """
    Fastest decay with leaf area: sunbeam and view together, or diffuse light.

    Parameters
    ----------
    scene : Scene
        Of numbers.

    Returns
    -------
    rate : float
        Per leaf area within crowns. [1]
    """
    down, up = (extinction_coefficient(angle, scene.leaf_angles) for angle in (scene.sza, scene.vza))
    return max(1.0, down + up)


def _is(value, number):
    return not isinstance(value, np.ndarray) and value == number


def _by_band(values):
    """Shape (band, 1) or (band, n)."""
    return np.reshape(values, (len(values), -1))
