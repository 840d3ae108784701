"""The process of a command: memory that it frees, and Ctrl-C at moments that cannot be interrupted."""

import ctypes
import os
import signal
import sys
import threading
from contextlib import contextmanager

# What mallopt calls them: so much free memory at the end of a heap goes back, blocks of such a size always do, and how
# many heaps there are: one, as those of threads go back when they are empty.
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8

# More than a run frees at once, and what mallopt takes as a whole number. [byte]
_KEPT = 2**30


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
        mallopt(_ARENA_MAX, 1)


@contextmanager
def interrupts_blocked():
    """
    A context within which Ctrl-C waits: KeyboardInterrupt is raised at its end.

    An import that is interrupted fails in ways of its own, and processes that are started within the context never get
    the Ctrl-C of their terminal.

    Raises
    ------
    KeyboardInterrupt
        At the end, if Ctrl-C was pressed.
    """
    handler = signal.getsignal(signal.SIGINT)
    if not hasattr(signal, "pthread_sigmask") or handler is not signal.default_int_handler:
        # On Windows, and where Ctrl-C is ignored or somebody else handles it.
        yield
        return
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    # The mask is for processes that are started. In this one, another thread may take the signal.
    pressed = []
    signal.signal(signal.SIGINT, lambda number, frame: pressed.append(number))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        signal.signal(signal.SIGINT, handler)
    if pressed:
        raise KeyboardInterrupt
