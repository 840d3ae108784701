"""Shards of chips as they come: made in this process, by processes of this machine, or on a cluster."""

from functools import partial

import numpy as np

from fifesim.output.chips.arrays import chip_arrays, empty_arrays, make_shard
from fifesim.output.chips.makers import jobs_of

_RETRIES = 3


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
    if makers is not None:
        way = partial(_by_makers, makers)
    else:
        way = _here if client is None else partial(_on_client, client)
    yield from way(chips, layout, shards, wanted, advance)


def _here(chips, layout, shards, wanted, advance):
    for shard in wanted:
        yield shard, chip_arrays(chips, range(*shards.range_of(shard)), layout, advance)


def _by_makers(makers, chips, layout, shards, wanted, advance):
    begun = {}
    for job, arrays in makers.made(jobs_of(chips, shards, wanted, makers.number), layout):
        first, last = shards.range_of(job.shard)
        whole, left = begun.pop(job.shard, None) or (empty_arrays(last - first, layout), last - first)
        for name, values in arrays.items():
            whole[name][job.chips - first] = values
        left -= len(job.chips)
        advance(len(job.chips))
        if left:
            begun[job.shard] = whole, left
        else:
            yield job.shard, whole


def _on_client(client, chips, layout, shards, wanted, advance):
    from distributed import KilledWorker, as_completed  # there already, where a client is

    options = {"pure": False, "retries": _RETRIES}
    futures = {
        client.submit(make_shard, chips.study, len(chips), *shards.range_of(shard), layout, **options): shard
        for shard in wanted
    }
    try:
        for future, arrays in as_completed(list(futures), loop=client.loop, with_results=True):
            shard = futures.pop(future)
            yield shard, arrays
            advance(np.diff(shards.range_of(shard)).item())
            future.release()
    except KilledWorker as error:
        raise RuntimeError(f"{error}: has a worker too little memory? What is finished is kept, use --resume") from None
    finally:
        client.cancel(list(futures), force=True)
