"""What long work says while it goes on: to the logger ``fifesim``, and by bars unless it is to be quiet."""

import logging
from contextlib import contextmanager
from contextvars import ContextVar

LOG = logging.getLogger("fifesim")
"""Steps of long work are told at INFO, their parts at DEBUG. It has no handlers: those are for who listens."""

_QUIET = ContextVar("fifesim_quiet", default=False)


@contextmanager
def quiet(wanted=True):
    """
    A context within which long work shows no progress.

    Parameters
    ----------
    wanted : bool, optional

    Examples
    --------
    >>> with quiet():
    ...     is_quiet()
    True
    >>> is_quiet()
    False
    """
    token = _QUIET.set(wanted)
    try:
        yield
    finally:
        _QUIET.reset(token)


def is_quiet():
    """
    Whether no progress is to be shown.

    Returns
    -------
    answer : bool
    """
    return _QUIET.get()
