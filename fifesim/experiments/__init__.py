"""Experiments: reproduction of the paper, scatter budgets, the interactive page, and verification."""

from fifesim.accessor import namespace_of

__getattr__, __dir__ = namespace_of("experiments")
