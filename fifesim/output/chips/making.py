"""Shards of chips as they come: made in this process, by processes of this machine, or on a cluster."""

from contextlib import closing

import numpy as np

from fifesim.output.chips.arrays import chip_arrays, empty_arrays, make_shard
from fifesim.output.chips.makers import jobs_of
from fifesim.output.run.workers import RETRIES, results_of


def made_shards(chips, layout, shards, wanted, advance, *, makers=None, client=None):
    """
    Arrays of shards.

    Parameters
    ----------
    chips : fifesim.scenario.chips.Chips
    layout : fifesim.output.chips.arrays.Layout
    shards : fifesim.output.chips.store.Shards
    wanted : sequence of int
        Those that are to be made.
    advance : callable
        ``advance(count)`` is called when so many more chips are done.
    makers : fifesim.output.chips.makers.Makers, optional
        Processes that make them.
    client : distributed.Client, optional
        Whose workers make them.

    Yields
    ------
    shard : int
        In the order in which they are whole.
    arrays : dict of str to array
        Of all chips of the shard.

    Raises
    ------
    RuntimeError
        If a process or a worker ends by itself.
    """
    if makers is None and client is not None:
        yield from _on_client(client, chips, layout, shards, wanted, advance)
        return
    jobs, begun = jobs_of(chips, shards, wanted, 1 if makers is None else makers.number), {}
    for job, arrays in _here(chips, jobs, layout) if makers is None else makers.made(jobs, layout):
        for shard, own in _by_shard(job.chips, shards):
            first, last = shards.range_of(shard)
            whole, left = begun.pop(shard, None) or (empty_arrays(last - first, layout), last - first)
            for name, values in arrays.items():
                whole[name][job.chips[own] - first] = values[own]
            left -= np.count_nonzero(own)
            if left:
                begun[shard] = whole, left
            else:
                yield shard, whole
        advance(len(job.chips))


def _here(chips, jobs, layout):
    for job in jobs:
        yield job, chip_arrays(chips, job.chips, layout)


def _by_shard(numbers, shards):
    """The shards that some chips lie in, and which of them do."""
    of = shards.shard_of(numbers)
    return [(shard, of == shard) for shard in np.unique(of).tolist()]


def _on_client(client, chips, layout, shards, wanted, advance):
    options = {"pure": False, "retries": RETRIES}
    futures = {
        client.submit(make_shard, chips.study, len(chips), *shards.range_of(shard), layout, **options): shard
        for shard in wanted
    }
    with closing(results_of(client, futures)) as found:
        for shard, arrays in found:
            yield shard, arrays
            advance(np.diff(shards.range_of(shard)).item())
