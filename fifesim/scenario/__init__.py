"""Scenarios: all parameters of a run with their units, and its simulation."""

from fifesim.accessor import namespace_of

__getattr__, __dir__ = namespace_of("scenario")
