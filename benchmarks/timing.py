"""
Processor time of calls, which other work on a machine changes less than time on the clock, and memory.

xarray keeps accessors in their rasters, which leaves these to the garbage collector: it comes between calls here, else
one would pay for what another left.
"""

import gc
import resource
import time
from pathlib import Path

import numpy as np


def processor_time():
    """Processor time of this process and of the programs that it has waited for. [s]"""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def seconds(call, times=3):
    """Processor time of the fastest of some calls, once tables are made and kernels compiled."""
    return both_times(call, times)[0]


def both_times(call, times=3):
    """The same, and time on the clock."""
    call()
    spent = []
    for _ in range(times):
        gc.collect()
        start, clock = processor_time(), time.perf_counter()
        call()
        spent.append((processor_time() - start, time.perf_counter() - clock))
    return np.min(spent, axis=0)


def in_turn(calls, rounds=3):
    """Processor time of several calls that take turns, so that other work on the machine slows all of them."""
    spent = dict.fromkeys(calls, np.inf)
    for call in calls.values():
        call()
    for _ in range(rounds):
        for name, call in calls.items():
            gc.collect()
            start = processor_time()
            call()
            spent[name] = min(spent[name], processor_time() - start)
    return spent


def own_peak():
    """Peak resident memory of this process [GB]."""
    status = Path("/proc/self/status")
    if status.exists():
        # ru_maxrss of a child starts at its parent's: Linux counts this one afresh for each program.
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return int(line.split()[1]) / 1e6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
