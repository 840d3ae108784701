"""Where the public name of this folder lives, for editors and type checkers."""

from fifesim.base.arguments import Range

from .labels import spectrum as spectrum

ENGINES: tuple[str, ...]
RANGES: dict[str, Range]
