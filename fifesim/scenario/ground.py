"""The section of a scenario on leaf area, leaves and what lies below them."""

from dataclasses import asdict, fields
from difflib import get_close_matches
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from fifesim.ground.canopy import optics
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.spectra import Background, spectrum_names
from fifesim.ground.landscape.autoregression import LARGEST_STREAMING_ARP
from fifesim.ground.landscape.distribution import lai_distribution
from fifesim.scenario.section import Section, number, text

_BY_BAND = ("leaf_reflectance", "leaf_transmittance")


class Ground(Section):
    """Leaf area, leaves and what lies below them."""

    distribution: str = text("burned-grazed", "LAI distribution: a treatment, or a .csv of LAI samples")
    arp: float = number(0.15, "1", "autoregressive parameter; larger is smoother", ge=0, lt=0.25)
    seed: Annotated[int, Field(ge=0, lt=2**63, strict=True)] = Field(
        7, description="of the random field, a whole number"
    )
    method: Literal["streaming", "periodic"] = text("streaming", "streaming, or the paper's periodic (in memory)")
    lai_file: str | None = text(None, "a LAI map to use instead of a random field")
    leaf_angles: str = text("spherical", "leaf angle distribution")
    hotspot: float = number(0.0, "1", "leaf size over canopy height", ge=0)
    fpar_inf: float = number(0.94, "1", "FPAR of an infinitely thick canopy", gt=0, le=1)
    leaf_reflectance: dict[str, float] = Field({}, description="by band [1]; all bands or none")
    leaf_transmittance: dict[str, float] = Field({}, description="by band [1]; all bands or none")
    background: dict[str, float] = Field({}, description="reflectance below the canopy by band [1]; all bands or none")
    leaf: dict[str, float] = Field(
        {},
        description="instead of leaf optics by band: structure [1], chlorophyll, carotenoids, anthocyanins [ug cm-2], "
        "brown [1], water [cm], dry_matter [g cm-2]",
    )
    background_spectra: dict[str, float] = Field(
        {},
        description="instead of background by band: shares of soil_dry, soil_wet, dead_grass, golden_grass, shade",
    )

    @field_validator("distribution")
    @classmethod
    def _known_distribution(cls, value):
        if not value.lower().endswith(".csv"):
            lai_distribution(value)
        return value

    @field_validator("leaf_angles")
    @classmethod
    def _known_leaf_angles(cls, value):
        leaf_angle_classes(value)
        return value

    @field_validator("leaf")
    @classmethod
    def _known_leaf(cls, value):
        known = [each.name for each in fields(Leaf)]
        for name in value:
            if name not in known:
                near = get_close_matches(name, known, n=1)
                hint = f"did you mean {near[0]!r}? " if near else ""
                raise ValueError(f"unknown key {name!r}: {hint}allowed are {', '.join(known)}")
        Leaf(**value)
        return value

    @field_validator("background_spectra")
    @classmethod
    def _known_spectra(cls, value):
        for name in value:
            if name not in spectrum_names():
                raise ValueError(f"unknown spectrum {name!r}: allowed are {', '.join(spectrum_names())}")
        return Background(value).fractions if value else value

    @model_validator(mode="after")
    def _one_description(self):
        for spectra, by_band in (("leaf", "leaf_reflectance"), ("background_spectra", "background")):
            if getattr(self, spectra) and getattr(self, by_band):
                raise ValueError(f"ground.{spectra} and ground.{by_band} are both given: drop one of them")
        return self

    @model_validator(mode="after")
    def _streaming_limit(self):
        if self.method == "streaming" and self.arp > LARGEST_STREAMING_ARP:
            raise ValueError(
                f'arp = {self.arp:g}: at most {LARGEST_STREAMING_ARP} when streaming; or method = "periodic"'
            )
        return self

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
            raise ValueError("ground.leaf_reflectance and ground.leaf_transmittance must name the same bands")
        return {band: (value, self.leaf_transmittance[band]) for band, value in self.leaf_reflectance.items()} or None

    def below_canopy(self):
        """Background by band or as a mixture of spectra, a dict or `Background`; None for the default."""
        return Background(self.background_spectra) if self.background_spectra else self.background or None

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


def _by_band(names, values):
    return {name: float(value) for name, value in zip(names, values, strict=True)}
