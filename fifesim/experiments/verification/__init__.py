"""Checks of an installation against published results and theory."""
