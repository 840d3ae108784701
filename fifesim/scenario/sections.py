"""Sections of a scenario as descriptions of canopy, atmosphere and instrument, and their physical limits."""

import os
from dataclasses import asdict, fields

from pydantic import field_validator, model_validator

from fifesim.atmosphere import mixtures
from fifesim.atmosphere.aerosol_labels import read_aerosol
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.files import shown
from fifesim.base.messages import nearest
from fifesim.ground.canopy import optics
from fifesim.ground.canopy.description import Canopy
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.spectra import Background, spectrum_names
from fifesim.ground.landscape.autoregression import LARGEST_STREAMING_ARP
from fifesim.ground.landscape.classes import CoverClass
from fifesim.ground.landscape.distribution import lai_distribution
from fifesim.ground.terrain.slope import metres_per_unit
from fifesim.scenario.keys import KEYS, AirKeys, ClassKeys, GroundKeys, SensorKeys, StandKeys, TerrainKeys
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.labels import noise_models
from fifesim.sensor.response.noise import NoiseModel, check_kinds

_BY_BAND = ("leaf_reflectance", "leaf_transmittance")


def _check_keys(values, kind, without=None):
    """Raise ValueError for keys that are not fields of a dataclass."""
    known = [field.name for field in fields(kind) if field.name != without]
    for name in values:
        if name not in known:
            raise ValueError(f"unknown key {name!r}: {nearest(name, known)}allowed are {', '.join(known)}")


class Stand(StandKeys):
    """Leaf area, leaves and background of a stand."""

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
        _check_keys(value, Leaf)
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
        """Leaf optics by band [1], or a Leaf; None for the default."""
        if self.leaf:
            return Leaf(**self.leaf)
        if set(self.leaf_reflectance) != set(self.leaf_transmittance):
            raise ValueError("leaf_reflectance and leaf_transmittance must name the same bands")
        return {band: (value, self.leaf_transmittance[band]) for band, value in self.leaf_reflectance.items()} or None

    def below_canopy(self):
        """Background by band or as a mixture of spectra; None for the default."""
        return Background(self.background_spectra) if self.background_spectra else self.background or None

    def canopy(self, keys=KEYS):
        """Canopy from the given keys, with optics if the table has them."""
        return Canopy(
            leaf_optics=self.leaf_optics(),
            brown_leaf=Leaf(**self.brown_leaf) if self.brown_leaf else None,
            background=self.below_canopy(),
            **{key: getattr(self, key) for key in keys},
        )


class Ground(Stand, GroundKeys):
    """Leaf area, leaves and background."""

    @model_validator(mode="after")
    def _streaming_limit(self):
        if self.method == "streaming" and self.arp > LARGEST_STREAMING_ARP:
            raise ValueError(
                f'arp = {self.arp:g}: at most {LARGEST_STREAMING_ARP} when streaming; or method = "periodic"'
            )
        return self

    def complete_optics(self, bands):
        """Keys of leaf and background, with defaults."""
        names = [band.name for band in bands]
        leaf = optics.band_leaf_optics(bands, self.leaf_optics())
        background = optics.band_background(bands, self.below_canopy())
        keys = {"leaf": asdict(Leaf(**self.leaf))} if self.leaf else {}
        if not self.leaf:
            keys |= {key: _by_band(names, each) for key, each in zip(_BY_BAND, leaf, strict=True)}
        return keys if self.background_spectra else keys | {"background": _by_band(names, background)}


class CoverStand(Stand, ClassKeys):
    """A land cover class. Missing keys are taken from [ground]."""

    @field_validator("arp")
    @classmethod
    def _streaming_arp(cls, value):
        if value > LARGEST_STREAMING_ARP:
            raise ValueError(f"must be at most {LARGEST_STREAMING_ARP} in a landscape")
        return value

    def lai_source(self, ground):
        """LAI distribution of the class; by default the distribution of [ground]."""
        return (self if "distribution" in self.model_fields_set else ground).distribution

    def cover_class(self, name, ground):
        """Land cover class. Missing canopy properties are set in `surface_reflectance`."""
        given, lai = self.model_fields_set, self.lai_source(ground)
        canopy = self.canopy([key for key in KEYS if key in given])
        return CoverClass(name, lai=lai, arp=self.arp if "arp" in given else None, canopy=canopy, code=self.code)


def _by_band(names, values):
    return {name: float(value) for name, value in zip(names, values, strict=True)}


class Terrain(TerrainKeys):
    """Elevation, and illumination of slopes."""

    @field_validator("vertical_units")
    @classmethod
    def _known_unit(cls, value):
        if value is not None:
            metres_per_unit(value)
        return value


class Air(AirKeys):
    """The atmosphere."""

    @field_validator("aerosol")
    @classmethod
    def _known_aerosol(cls, value):
        return value if value == "none" or cls.names_a_file("aerosol", value) else mixtures.canonical(value)

    @model_validator(mode="after")
    def _possible(self):
        self.model()
        return self

    def model(self):
        """Atmosphere described by the keys."""
        keys = self.model_dump(exclude={"adjacency", "coupling"})
        if "aerosol" in self.files:
            keys["aerosol"] = read_aerosol(self.aerosol)
        return Atmosphere(**keys)


class Sensor(SensorKeys):
    """The instrument."""

    @model_validator(mode="before")
    @classmethod
    def _own_bands(cls, values):
        """Default bands: red and near infrared."""
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
        _check_keys(value, NoiseModel, without="along")
        _noise_model(value, "rows")
        return value

    def given_noise(self):
        """Noise model from the keys; None for the model of the instrument."""
        scan = self.description.scan
        return _noise_model(self.noise_model, "columns" if scan and scan.kind == "pushbroom" else "rows")

    @property
    def description(self):
        """Instrument with the requested spatial response."""
        try:
            return instrument(self.instrument, self.response)
        except OSError as error:
            raise ValueError(f"instrument = {shown(self.instrument)}: {error.strerror or error}") from None

    @property
    def size(self):
        """Pixel size as given; by default the pixel size of the gridded product of the bands. [m]"""
        return self.pixel or _shared_pixel(self.description, self.bands)


def _noise_model(keys, along):
    """Noise model from its keys; None without keys."""
    detectors = keys.get("detectors", 1)
    if detectors % 1:
        raise ValueError(f"detectors must be a whole number, got {detectors:g}")
    given = {"thermal": 0.0, "shot": 0.0} | keys | {"detectors": int(detectors)}
    return NoiseModel(**given, along=along) if keys else None


def _shared_pixel(description, names):
    """Common pixel size of the bands in the gridded product. [m]"""
    sizes = {}
    for band in description.select(names):
        sizes.setdefault(description.pixel(band), []).append(band.name)
    if len(sizes) > 1:
        groups = "; ".join(f"{size:g} m: {', '.join(each)}" for size, each in sizes.items())
        raise ValueError(
            f"bands of {description.name} have different grids ({groups}): name bands of one grid, or give pixel"
        )
    return next(iter(sizes))
