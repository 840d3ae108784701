"""Experiments: a question, its runs and its answer."""
