"""Gross primary production, evapotranspiration and albedo of vegetation: formulas on arrays, and maps by `labels`."""

from fifesim.accessor import namespace_of

__getattr__, __dir__ = namespace_of("models")
