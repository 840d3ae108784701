"""Where the public name of this folder lives, for editors and type checkers."""

from .labels import spectrum as spectrum
