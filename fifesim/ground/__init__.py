"""The ground scene: leaf area, its reflectance, and the light on slopes."""

from fifesim.accessor import namespace_of

__getattr__, __dir__ = namespace_of("ground")
