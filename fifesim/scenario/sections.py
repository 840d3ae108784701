"""What the values of a scenario mean, section by section, and what physics refuses of them."""

import os
from dataclasses import asdict, fields

from pydantic import field_validator, model_validator

from fifesim.atmosphere.air import ENGINES, mixtures, models
from fifesim.atmosphere.air.raster import read_aerosol
from fifesim.base.foreign import shown
from fifesim.base.spelling import nearest
from fifesim.ground.canopy import optics
from fifesim.ground.canopy.description import Canopy
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.spectra import Background, spectrum_names
from fifesim.ground.landscape.autoregression import LARGEST_STREAMING_ARP
from fifesim.ground.landscape.classes import CoverClass
from fifesim.ground.landscape.distribution import lai_distribution
from fifesim.ground.terrain.units import metres_per_unit
from fifesim.scenario.ground_keys import KEYS, ClassKeys, GroundKeys, StandKeys
from fifesim.scenario.keys import AirKeys, SensorKeys, TerrainKeys
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response.noise import NoiseModel, check_kinds
from fifesim.sensor.response.rasters.noise import noise_models

_BY_BAND = ("leaf_reflectance", "leaf_transmittance")


class Stand(StandKeys):
    """Leaf area, leaves and what lies below them, of a stand of plants."""

    @field_validator("distribution")
    @classmethod
    def _known_distribution(cls, value):
        if not cls.names_a_file("distribution", value):
            lai_distribution(value)
        return value

    @field_validator(*KEYS)
    @classmethod
    def _possible_canopy(cls, value, info):
        Canopy(**{info.field_name: value})
        return value

    @field_validator("leaf", "brown_leaf")
    @classmethod
    def _known_leaf(cls, value):
        known = [each.name for each in fields(Leaf)]
        for name in value:
            if name not in known:
                raise ValueError(f"unknown key {name!r}: {nearest(name, known)}allowed are {', '.join(known)}")
        Leaf(**value)
        return value

    @field_validator("background_spectra")
    @classmethod
    def _known_spectra(cls, value):
        for name in value:
            if name not in spectrum_names():
                raise ValueError(f"unknown spectrum {name!r}: allowed are {', '.join(spectrum_names())}")
        return Background(value).fractions if value else value

    def leaf_optics(self):
        """
        Leaf optics, by band or of a leaf.

        Returns
        -------
        optics : dict of str to (float, float), Leaf, or None
            Reflectance and transmittance by band, or what a leaf is made of; None for the default. [1]

        Raises
        ------
        ValueError
            If only one of the two is given for a band.
        """
        if self.leaf:
            return Leaf(**self.leaf)
        if set(self.leaf_reflectance) != set(self.leaf_transmittance):
            raise ValueError("leaf_reflectance and leaf_transmittance must name the same bands")
        return {band: (value, self.leaf_transmittance[band]) for band, value in self.leaf_reflectance.items()} or None

    def below_canopy(self):
        """Background by band or as a mixture of spectra, a dict or `Background`; None for the default."""
        return Background(self.background_spectra) if self.background_spectra else self.background or None

    def canopy(self, keys=KEYS):
        """Canopy of these keys, a `Canopy`; optics are given where the table has them."""
        return Canopy(
            leaf_optics=self.leaf_optics(),
            brown_leaf=Leaf(**self.brown_leaf) if self.brown_leaf else None,
            background=self.below_canopy(),
            **{key: getattr(self, key) for key in keys},
        )


class Ground(Stand, GroundKeys):
    """Leaf area, leaves and what lies below them."""

    @model_validator(mode="after")
    def _streaming_limit(self):
        if self.method == "streaming" and self.arp > LARGEST_STREAMING_ARP:
            raise ValueError(
                f'arp = {self.arp:g}: at most {LARGEST_STREAMING_ARP} when streaming; or method = "periodic"'
            )
        return self

    def complete_optics(self, bands):
        """
        Keys of leaf and background with what they leave to defaults.

        Parameters
        ----------
        bands : sequence of fifesim.base.bands.Band

        Returns
        -------
        keys : dict

        Raises
        ------
        ValueError
            If a band has no optics.
        """
        names = [band.name for band in bands]
        leaf = optics.leaf_optics(bands, self.leaf_optics())
        background = optics.background(bands, self.below_canopy())
        keys = {"leaf": asdict(Leaf(**self.leaf))} if self.leaf else {}
        if not self.leaf:
            keys |= {key: _by_band(names, each) for key, each in zip(_BY_BAND, leaf, strict=True)}
        return keys if self.background_spectra else keys | {"background": _by_band(names, background)}


class CoverStand(Stand, ClassKeys):
    """A class of cover; what it leaves out is that of [ground]."""

    @field_validator("arp")
    @classmethod
    def _streaming_arp(cls, value):
        if value > LARGEST_STREAMING_ARP:
            raise ValueError(f"must be at most {LARGEST_STREAMING_ARP} in a landscape")
        return value

    def cover_class(self, name, ground):
        """
        The class; what it leaves out of its canopy is said by the call of `surface_reflectance`.

        Parameters
        ----------
        name : str
        ground : Ground
            Whose leaf area it has where it says none.

        Returns
        -------
        cover_class : fifesim.ground.landscape.classes.CoverClass
        """
        given = self.model_fields_set
        lai = (self if "distribution" in given else ground).distribution
        canopy = self.canopy([key for key in KEYS if key in given])
        return CoverClass(name, lai=lai, arp=self.arp if "arp" in given else None, canopy=canopy, code=self.code)


def _by_band(names, values):
    return {name: float(value) for name, value in zip(names, values, strict=True)}


class Terrain(TerrainKeys):
    """Elevation, and the light on slopes."""

    @field_validator("vertical_units")
    @classmethod
    def _known_unit(cls, value):
        if value is not None:
            metres_per_unit(value)
        return value


class Air(AirKeys):
    """The atmosphere."""

    @field_validator("profile", "engine")
    @classmethod
    def _known_name(cls, value, info):
        allowed = {"profile": models.PROFILES, "engine": ENGINES}[info.field_name]
        if value not in allowed:
            raise ValueError(f"must be one of {', '.join(allowed)}, got {value!r}")
        return value

    @field_validator("aerosol")
    @classmethod
    def _known_aerosol(cls, value):
        return value if value == "none" or cls.names_a_file("aerosol", value) else mixtures.canonical(value)

    @model_validator(mode="after")
    def _possible(self):
        self.model()
        return self

    def model(self):
        """The atmosphere that these keys describe, a `fifesim.atmosphere.air.models.Atmosphere`."""
        keys = self.model_dump(exclude={"adjacency"})
        if "aerosol" in self.files:
            keys["aerosol"] = read_aerosol(self.aerosol)
        return models.Atmosphere(**keys)


class Sensor(SensorKeys):
    """The instrument."""

    @model_validator(mode="before")
    @classmethod
    def _own_bands(cls, values):
        """Without names the red and near infrared band are meant, which scenes of vegetation are seen in."""
        if not isinstance(values, dict) or "bands" in values or not isinstance(values.get("instrument"), str):
            return values
        if cls.names_a_file("instrument", values["instrument"]) and not os.path.isfile(values["instrument"]):
            return values
        bands = instrument(values["instrument"]).red_and_near_infrared()
        return values | {"bands": [band.name for band in bands]}

    @field_validator("noise")
    @classmethod
    def _known_noise(cls, value):
        return list(check_kinds(value))

    @model_validator(mode="after")
    def _known_bands(self):
        bands = self.description.select(self.bands)
        if self.noise:
            noise_models(self.description, bands, self.noise, self.given_noise())
        if self.pixel is None:
            _shared_pixel(self.description, self.bands)
        return self

    @field_validator("noise_model")
    @classmethod
    def _known_noise_model(cls, value):
        known = [each.name for each in fields(NoiseModel) if each.name != "along"]
        for name in value:
            if name not in known:
                raise ValueError(f"unknown key {name!r}: {nearest(name, known)}allowed are {', '.join(known)}")
        if value:
            NoiseModel(**{"thermal": 0.0, "shot": 0.0} | value)
        if value.get("detectors", 1) % 1:
            raise ValueError(f"detectors must be a whole number, got {value['detectors']:g}")
        return value

    def given_noise(self):
        """The noise that the keys describe, a `fifesim.sensor.response.noise.NoiseModel`; None for the instrument's."""
        if not self.noise_model:
            return None
        scan = self.description.scan
        keys = {"thermal": 0.0, "shot": 0.0, "along": "columns" if scan and scan.kind == "pushbroom" else "rows"}
        keys |= self.noise_model
        return NoiseModel(**keys | {"detectors": int(keys.get("detectors", 1))})

    @property
    def description(self):
        """
        The instrument, a `fifesim.sensor.description.instruments.Instrument`.

        Raises
        ------
        ValueError
            If there is no such instrument, or its file is not right.
        """
        try:
            return instrument(self.instrument, self.response)
        except OSError as error:
            raise ValueError(f"instrument = {shown(self.instrument)}: {error.strerror or error}") from None

    @property
    def size(self):
        """Size of a pixel: as given, else that of the bands' gridded product. [m]"""
        return self.pixel or _shared_pixel(self.description, self.bands)


def _shared_pixel(description, names):
    """Pixel of the gridded product of some bands, which must share one. [m]"""
    sizes = {}
    for band in description.select(names):
        sizes.setdefault(description.pixel(band), []).append(band.name)
    if len(sizes) > 1:
        groups = "; ".join(f"{size:g} m: {', '.join(each)}" for size, each in sizes.items())
        raise ValueError(
            f"bands of {description.name} lie on different grids ({groups}): name those of one, or give pixel"
        )
    return next(iter(sizes))
