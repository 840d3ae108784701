"""Memory that a command frees stays with it."""

import ctypes
import os
import sys

# What mallopt calls them: the free memory at whose end it is given back, and the smallest block that is always.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3

# Some blocks of a scene. [byte]
_KEPT = 2**28


def keep_freed():
    """
    Have glibc's malloc, where it is that, keep what is freed; who has set its variables keeps them.

    Arrays of a scene are of some MB. As malloc comes, each goes back to the kernel, which clears its pages before the
    next one has them: a twentieth of a run's processor time.
    """
    if sys.platform != "linux" or any(name.startswith("MALLOC_") for name in os.environ):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt:
        mallopt(_TRIM_THRESHOLD, _KEPT)
        mallopt(_MMAP_THRESHOLD, _KEPT)
