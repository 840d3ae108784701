"""Atmosphere: gases, scattering and their coupling with the surface."""

from fifesim.accessor import namespace_of

__getattr__, __dir__ = namespace_of("atmosphere")
