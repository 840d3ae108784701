"""Experiments: reproduction of the paper, scatter budgets, the interactive page, and verification."""
