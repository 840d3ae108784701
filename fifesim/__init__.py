"""Simulate what a satellite would have seen."""
