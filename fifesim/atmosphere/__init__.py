"""Atmosphere: gases, scattering and their coupling with the surface."""

from importlib import import_module

ENGINES = ("5S", "successive-orders", "6S")
"""Schemes of radiative transfer by name, in the order of messages. Importing the list loads no physics."""


__all__ = ["spectrum"]


def __getattr__(name):
    if name != "spectrum":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module("fifesim.atmosphere.labels").spectrum
