"""Terrain: slopes, directions, sky and shadow."""

from fifesim.accessor import namespace_of

__getattr__, __dir__ = namespace_of("terrain")
