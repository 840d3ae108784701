"""Keys of what the ground is made of: stands of plants, classes of cover, and what varies over a landscape."""

from typing import Annotated, Literal

from pydantic import Field, create_model, field_validator, model_validator

from fifesim.base.foreign import shown
from fifesim.base.spelling import nearest
from fifesim.ground.canopy.properties import DRAWN, PROPERTIES
from fifesim.scenario.section import Section, file, number, seed, text

COVERS = ("none", "pastures", "voronoi", "levels")
VARYING = tuple(DRAWN)
KEYS = {name: known for name, known in PROPERTIES.items() if known.default is not None}
"""Properties of the canopy that are one key of a scenario."""
COVARIATES = ("elevation", "wetness", "illumination")

# By the name of a band, a spectrum or a part of a leaf.
ByName = dict[str, Annotated[float, Field(strict=True, allow_inf_nan=False)]]
LONGEST_NAME = 60
_LEAF = "structure [1], chlorophyll, carotenoids, anthocyanins [ug cm-2], brown [1], water [cm], dry_matter [g cm-2]"


class _LeafArea(Section):
    """Leaf area of a stand of plants."""

    distribution: str = file("burned-grazed", "LAI distribution: a treatment, or a .csv of LAI samples", suffix=".csv")
    arp: float = number(0.15, "1", "autoregressive parameter; larger is smoother", ge=0, lt=0.25)


def _key(known):
    """Type and field of a key that is a property of the canopy."""
    if not known.unit:
        return str, text(known.default, known.meaning)
    return float, number(known.default, known.unit, known.meaning, ge=known.lowest, le=known.highest)


_Structure = create_model("_Structure", __base__=_LeafArea, **{name: _key(known) for name, known in KEYS.items()})


class StandKeys(_Structure):
    """Leaf area, leaves and what lies below them, of a stand of plants."""

    leaf_reflectance: ByName = text({}, "by band [1]; all bands or none")
    leaf_transmittance: ByName = text({}, "by band [1]; all bands or none")
    background: ByName = text({}, "reflectance below the canopy by band [1]; all bands or none")
    leaf: ByName = text({}, f"instead of leaf optics by band: {_LEAF}")
    brown_leaf: ByName = text({}, f"dead leaves, by default dead tallgrass: {_LEAF}")
    background_spectra: ByName = text(
        {}, "instead of background by band: shares of soil_dry, soil_wet, dead_grass, golden_grass, shade"
    )

    @field_validator("leaf_reflectance", "leaf_transmittance", "background", "leaf", "brown_leaf", "background_spectra")
    @classmethod
    def _names_that_print(cls, value):
        for name in value:
            if len(name) > LONGEST_NAME or not name.isprintable():
                raise ValueError(f"{shown(name)} is no name: names have up to {LONGEST_NAME} characters that print")
        return value

    @model_validator(mode="after")
    def _one_description(self):
        for spectra, by_band in (("leaf", "leaf_reflectance"), ("background_spectra", "background")):
            if getattr(self, spectra) and getattr(self, by_band):
                raise ValueError(f"{spectra} and {by_band} are both given: drop one of them")
        return self


class GroundKeys(StandKeys):
    """Leaf area, leaves and what lies below them."""

    seed: int = seed(7, "of the random fields, a whole number")
    method: Literal["streaming", "periodic"] = text("streaming", "streaming, or the paper's periodic (in memory)")
    lai_file: str | None = file(None, "a LAI map to use instead of a random field")
    fpar_inf: float = number(0.94, "1", "FPAR of an infinitely thick canopy", gt=0, le=1)


class ClassKeys(StandKeys):
    """A class of cover; what it leaves out is that of [ground]."""

    share: float | None = number(None, "1", "of the ground, where cover is drawn; by default that of all", gt=0, le=1)
    code: int | None = text(None, "in the map of cover; by default classes count from 1")

    @property
    def said(self):
        """Keys that differ from the ground's."""
        return {key: known for key, known in super().said.items() if key in self.model_fields_set}


class LandscapeKeys(Section):
    """Classes of cover, and properties of the ground that vary; without them one stand is everywhere."""

    cover: str = file(
        "none",
        "how classes lie: none; pastures, voronoi or levels, which are drawn; or a raster file of their codes",
        names=COVERS,
        suffix="*",
    )
    size: float = number(1200.0, "m", "of a pasture or patch that is drawn, along an edge or across", gt=0)
    deviations: ByName = text(
        {}, f"standard deviations [1] of what varies in fields that are drawn: {', '.join(VARYING)}"
    )
    arps: ByName = text({}, "autoregressive parameters [1] of these fields; by default that of [ground]")
    coarser: int = number(
        1,
        "1",
        "ground cells along a side of a cell of these fields' lattice, which arps count in",
        ge=1,
        le=100,
        strict=True,
    )
    covary: ByName = text({}, f"correlations [1] of leaf area with {', '.join(COVARIATES + VARYING)}")

    def is_one(self):
        """Whether one stand is everywhere, and nothing but its leaf area varies."""
        return self.cover == "none" and not any((*self.deviations.values(), *self.covary.values()))

    @field_validator("cover")
    @classmethod
    def _known_cover(cls, value):
        if value not in COVERS and not cls.names_a_file("cover", value):
            raise ValueError(
                f"{nearest(value, COVERS)}allowed are {', '.join(COVERS)}, or a raster file such as cover.tif"
            )
        return value

    @field_validator("deviations", "arps", "covary")
    @classmethod
    def _known_properties(cls, values, info):
        known = VARYING + (COVARIATES if info.field_name == "covary" else ())
        low, high = {"deviations": (0, 1), "arps": (0, 0.2498), "covary": (-1, 1)}[info.field_name]
        for name, value in values.items():
            if name not in known:
                raise ValueError(f"unknown name {shown(name)}: {nearest(name, known)}allowed are {', '.join(known)}")
            if not low <= value <= high:
                raise ValueError(f"{name} = {value:g}: must be in [{low:g}, {high:g}]")
        return values

    @model_validator(mode="after")
    def _drawn_fields(self):
        for key in ("arps", "covary"):
            for name in getattr(self, key):
                if name in VARYING and name not in self.deviations:
                    raise ValueError(f"{key}.{name} is for a field that is drawn: give deviations.{name} too")
        return self
