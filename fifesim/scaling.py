"""Scaling: variograms, bias between scales, and corrections of images."""

from fifesim.accessor import namespace_of

__getattr__, __dir__ = namespace_of("scaling")
