"""Memory that is freed stays with the process, and Ctrl-C waits where it must."""

import os
import platform
import signal
import subprocess
import sys

import pytest

from fifesim.output.process import interrupts_blocked

# Pages that some arrays of 4 and 32 MB take, one after the other.
TOUCHED = """
import numpy, resource, sys
from fifesim.output.process import keep_freed

def touched():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(5):
        numpy.ones(2**19), numpy.ones(2**22)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

before = touched()
keep_freed()
touched()
print(touched() < 0.1 * before)
"""


def kept(**variables):
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MALLOC_")}
    call = [sys.executable, "-c", TOUCHED]
    return subprocess.run(call, env=environment | variables, capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the malloc of glibc alone is set")
def test_freed_memory_stays_with_the_process_unless_who_runs_it_says_otherwise():
    assert kept() == "True"
    assert kept(MALLOC_TRIM_THRESHOLD_="131072") == "False"


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
