"""Clouds: their field, their light and their shadows."""

from fifesim.base.arguments import Range

COVER = Range("1", 0, 1)
THICKNESS = Range("1", 0, 100, ends="(]")
LENGTH = Range("m", 100, 20_000)
HEIGHT = Range("m", 0, 20_000, note="it is above the ground")
