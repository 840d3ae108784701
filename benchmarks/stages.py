"""
Cells a second and peak memory of each stage and chain, at several sizes, compared with a floor.

    python benchmarks/stages.py --million 1 4 16 64

Every number is from a separate process. Speeds are cells in a second of processor time, the best of some calls after
one that warms up, because other work on a machine changes the time on the clock more.
"""

import argparse
import json
import subprocess
import sys
import time

import dask
import numpy as np
from chain import chain_on
from timing import own_peak, processor_time
from work import CHAINS, FLOOR, STAGES

KNOWN = {**FLOOR, **STAGES, **CHAINS}


def measure(name, side, threads, repeat):
    """Print processor time, time on the clock and peak memory of a call."""
    dask.config.set(scheduler="threads", num_workers=threads)
    KNOWN[name](min(side, 900))()
    call = KNOWN[name](side)
    found = []
    for _ in range(repeat):
        start, clock = processor_time(), time.perf_counter()
        call()
        found.append((processor_time() - start, time.perf_counter() - clock))
    seconds, clock = (min(column) for column in zip(*found, strict=True))
    print(json.dumps({"name": name, "cells": side**2, "seconds": seconds, "clock": clock, "memory": own_peak()}))


def on_workers(side, workers):
    """Print the time on the clock of the flat chain on processes of a local cluster."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        chain_on(900 * workers).compute()
        client.wait_for_workers(workers)
        start = time.perf_counter()
        chain_on(side).compute()
        print(json.dumps({"name": f"{workers} workers", "cells": side**2, "clock": time.perf_counter() - start}))


def apart(*arguments):
    """Output of another process of this program."""
    command = [sys.executable, __file__, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        print(done.stderr[-2000:], file=sys.stderr)
        return None
    return json.loads(done.stdout.splitlines()[-1])


def exponent(rows):
    """Exponent of the growth of processor time with cells, fitted to all sizes."""
    known = [(row["cells"], row["seconds"]) for row in rows if row]
    if len(known) < 2:
        return None
    return float(np.polyfit(*np.log(np.array(known)).T, 1)[0])


def tables(million, threads, repeat, workers):
    sides = [round((each * 1e6) ** 0.5) for each in million]
    found = {
        name: [apart("--one", name, side, threads, repeat) for side in sides] for name in (*FLOOR, *STAGES, *CHAINS)
    }
    yield from speeds(found, million)
    if workers:
        yield ""
        yield from scaling(sides[-1])


def speeds(found, million):
    floors = found[next(iter(FLOOR))]
    heads = [f"{each:g} M: million cells/s" for each in million]
    memory = f"peak memory, {million[0]:g} to {million[-1]:g} M [GB]"
    yield f"| | {' | '.join(heads)} | times the floor | exponent | {memory} |"
    yield f"|{'---|' * (len(heads) + 4)}"
    for name, rows in found.items():
        rates = [f"{row['cells'] / row['seconds'] / 1e6:.1f}" if row else "failed" for row in rows]
        times = [
            row["seconds"] / base["seconds"]
            for row, base in zip(rows, floors, strict=True)
            if row and base and row["cells"] > 8e6
        ]
        ratio = f"{np.median(times):.2f}" if times else ""
        grown = exponent(rows)
        memory = [f"{row['memory']:.2f}" for row in (rows[0], rows[-1]) if row]
        yield f"| {name} | {' | '.join(rates)} | {ratio} | {grown and f'{grown:.2f}'} | {' to '.join(memory)} |"


def scaling(side):
    one, two = (apart("--workers-of", workers, side) for workers in (1, 2))
    if one and two:
        ratio = one["clock"] / two["clock"]
        yield f"Workers of dask.distributed, flat chain of {side**2 / 1e6:.0f} M: 2 are {ratio:.2f} times as fast as 1."


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--million", type=float, nargs="+", default=[1, 4, 16, 64], help="sizes [million cells]")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeat", type=int, default=2)
    parser.add_argument("--no-workers", action="store_true")
    parser.add_argument("--one", nargs=4, help=argparse.SUPPRESS)
    parser.add_argument("--workers-of", nargs=2, type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        name, *numbers = options.one
        measure(name, *map(int, numbers))
    elif options.workers_of:
        on_workers(options.workers_of[1], options.workers_of[0])
    else:
        for line in tables(options.million, options.threads, options.repeat, not options.no_workers):
            print(line, flush=True)


if __name__ == "__main__":
    main()
