"""Public names of ``fifesim.terrain``, as in ``fifesim/__init__.pyi``."""

# Terrain
from .ground.terrain.elevation_labels import source_dem as source_dem
from .ground.terrain.labels import aspect as aspect  # method
from .ground.terrain.labels import illumination as illumination  # method
from .ground.terrain.labels import shadow as shadow  # method
from .ground.terrain.labels import sky_view as sky_view  # method
from .ground.terrain.labels import slope as slope  # method
from .ground.terrain.labels import terrain_view as terrain_view  # method
from .ground.terrain.labels import wetness as wetness  # method
