"""Instruments as files describe them."""
