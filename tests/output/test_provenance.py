"""Versions are those that are installed."""

import platform

import numpy as np

import fifesim
from fifesim.output.folders import versions


def test_versions_are_those_of_the_packages_that_run():
    found = versions()
    assert (found["python"], found["numpy"]) == (platform.python_version(), np.__version__)
    assert found["fifesim"] == fifesim.__version__


def test_who_changes_versions_changes_a_copy():
    versions().clear()
    assert versions()["numpy"] == np.__version__
