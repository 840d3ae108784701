"""Atmosphere: gases, scattering and their coupling with the surface."""

from importlib import import_module

__all__ = ["spectrum"]


def __getattr__(name):
    if name != "spectrum":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module("fifesim.atmosphere.labels").spectrum
