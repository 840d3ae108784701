"""Public names of ``fifesim.atmosphere``, as in ``fifesim/__init__.pyi``."""

# Atmosphere
from ..chain.comparison import compare_engines as compare_engines
from .aerosol_labels import aerosol_tables as aerosol_tables
from .aerosol_labels import read_aerosol as read_aerosol
from .clouds.labels import cast_clouds as cast_clouds  # method
from .labels import spectrum as spectrum
