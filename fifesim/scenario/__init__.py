"""Scenarios: every number of a run with its unit, and what it simulates."""
