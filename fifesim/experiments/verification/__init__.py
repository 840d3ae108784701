"""Checks of an installation against results that others found, or that follow from theory."""
