"""Ctrl-C waits where it must."""

import os
import signal

import pytest

from fifesim.output.terminal import interrupts_blocked


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals cannot be blocked on Windows")
def test_ctrl_c_waits_for_the_end_of_the_context():
    done, before = [], signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), interrupts_blocked():
            os.kill(os.getpid(), signal.SIGINT)
            done.append("rest")
    finally:
        signal.signal(signal.SIGINT, before)
    assert done == ["rest"] and signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
