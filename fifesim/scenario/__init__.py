"""Scenarios: every number of a run with its unit, and its simulation."""
