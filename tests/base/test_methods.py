"""Methods whose functions lie elsewhere."""

import fifesim
from fifesim.analysis.regression import Regression
from fifesim.base.arguments import Method


def test_a_method_is_the_public_function_and_its_object_comes_first():
    line = Regression(2.0, 1.0, 0.9, 10, 0.1, 0.5, 1.0)
    assert line.plot.__func__ is fifesim.plot_fit and line.plot.__self__ is line
    assert Regression.plot is fifesim.plot_fit
    assert isinstance(vars(Regression)["plot"], Method)
