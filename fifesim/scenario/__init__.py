"""Scenarios: all parameters of a run with their units, and its simulation."""
