"""Where the public name of this folder lives, for editors and type checkers."""

from .schemes.raster import spectrum as spectrum
