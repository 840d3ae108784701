"""Methods whose functions lie above their class in the package: they are found when they are first called."""

from types import MethodType


class Method:
    """
    Method that is a public function of the package, with its object as first argument.

    A bound method keeps the function's name, signature and documentation.

    Parameters
    ----------
    name : str
        Of the function, as ``fifesim`` has it.
    """

    # Finds a public function by its name: the front door of the package puts it here.
    find = None

    def __init__(self, name):
        self._name = name

    def __get__(self, instance, owner=None):
        function = Method.find(self._name)
        return function if instance is None else MethodType(function, instance)
