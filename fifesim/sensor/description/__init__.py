"""Descriptions of instruments from files."""
