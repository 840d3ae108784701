"""Clouds: their field, their light and their shadows."""
