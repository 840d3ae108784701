"""The sensor's section of a scenario."""

import math
from typing import Annotated

from pydantic import Field, field_validator, model_validator

from fifesim.scenario.section import Section, number, text
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response.noise import check_kinds

INTERVALS = ("product", "native")


class Sensor(Section):
    """The instrument."""

    instrument: str = text("TM", "see: fifesim sensors")
    bands: list[str] = Field(["TM3", "TM4"], description="names of bands")
    pixel: float | None = number(
        None,
        "m",
        "size of a pixel; by default the instrument's gridded product; the footprint stays the instrument's",
        gt=0,
    )
    interval: str | float = Field(
        "product",
        description="between pixels: product, that of their size; native, the instrument's own; or metres",
        json_schema_extra={"unit": "m"},
    )
    offset: list[float] = Field(
        [0.0, 0.0],
        description="registration error southward and eastward: pixels see the ground beside them",
        json_schema_extra={"unit": "pixel"},
        min_length=2,
        max_length=2,
    )
    noise: list[str] = Field([], description="of the detectors: shot, thermal, fixed-pattern")
    seed: Annotated[int, Field(ge=0, lt=2**63, strict=True)] = Field(0, description="of the noise")
    min_valid: float = number(0.98, "1", "share of its footprint that a pixel needs on valid cells", ge=0, le=1)

    @field_validator("bands")
    @classmethod
    def _some_bands(cls, value):
        if not value:
            raise ValueError("name at least one band")
        return value

    @field_validator("interval")
    @classmethod
    def _known_interval(cls, value):
        if value in INTERVALS or (not isinstance(value, str) and 0 < value < math.inf):
            return value
        raise ValueError(f"must be {' or '.join(INTERVALS)}, or metres above 0 between pixels")

    @field_validator("offset")
    @classmethod
    def _finite_offset(cls, value):
        if not all(map(math.isfinite, value)):
            raise ValueError("must be two finite numbers of pixels")
        return value

    @field_validator("noise")
    @classmethod
    def _known_noise(cls, value):
        return list(check_kinds(value))

    @model_validator(mode="after")
    def _known_bands(self):
        description = instrument(self.instrument)
        for band in description.select(self.bands):
            if self.noise:
                description.noise_model(band)
        return self
