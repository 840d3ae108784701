"""Public names of ``fifesim.models``, as in ``fifesim/__init__.pyi``."""

# Models of the land surface
from .labels import albedo as albedo  # method, of a Dataset too
from .weather import Weather as Weather
from .weather import fife_weather as fife_weather
