"""Comparisons of the package with published results, other codes and theory, run by `test_checks.py`."""
