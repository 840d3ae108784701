"""Atmosphere: gases, scattering and their coupling with the surface."""

from importlib import import_module

from fifesim.base.arguments import Range

ENGINES = ("5S", "successive-orders")
"""Schemes of radiative transfer by name, in the order of messages. Importing the list loads no physics."""

RANGES = {
    "visibility": Range("km", 5, 100, others={"m": 1e-3}, note="an optical thickness is aot="),
    "altitude": Range("km", 0, 4, others={"m": 1e-3, "feet": 3.048e-4}),
    "aot": Range("1", 0, 2, others={"percent": 0.01}, note="a visibility in km is visibility="),
    # From Antarctica to the wettest tropics, and from an ozone hole to the thickest layer.
    "h2o": Range("g cm-2", 0, 10, (0.03, 7.5), {"mm or kg m-2": 0.1, "m": 100.0}),
    "o3": Range("cm-atm", 0, 1, (0.08, 0.6), {"Dobson units": 1e-3}),
}
"""Numbers of `fifesim.Atmosphere`, from which the keys of a scenario follow."""

__all__ = ["spectrum"]


def __getattr__(name):
    if name != "spectrum":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module("fifesim.atmosphere.labels").spectrum
