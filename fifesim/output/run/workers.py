"""Where a run computes: threads of its own process, a local cluster, or one that is there."""

import os
from contextlib import contextmanager

import dask
import dask.threaded

# What distributed shows of itself by HTTP, which tells addresses.
_PAGES = ("distributed.scheduler.http.routes", "distributed.worker.http.routes")

# Without an answer for so long, there is no scheduler. [s]
_TIMEOUT = 20

RETRIES = 3
"""How often a task is run again after its worker died; a task that ends more workers than that is at fault itself."""


def usable_cores():
    """
    Cores that this process may use.

    Returns
    -------
    cores : int
    """
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def cluster(workers=None, scheduler=None):
    """
    Workers to compute on.

    Parameters
    ----------
    workers : int, optional
        Start so many processes on this machine, which end with the context. They talk by TLS with a certificate made
        for them, over the loopback interface, so that no other program can reach them.
    scheduler : str, optional
        Address of a scheduler that runs, such as ``tcp://head:8786``. It is trusted: it and its workers run as who
        started them, and take part in what this run computes; by ``tls://`` with the certificates of dask's own
        configuration.

    Yields
    ------
    client : distributed.Client or None
        None where neither is given.

    Raises
    ------
    ValueError
        If both are given, or the number is not positive.
    OSError
        If no scheduler answers.
    """
    if workers is not None and scheduler is not None:
        raise ValueError("--workers starts a cluster and --scheduler uses one that runs: give one of them")
    if workers is not None and workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")
    if workers is None and scheduler is None:
        # By its name, or without one, dask would look for a client, and import all that one needs.
        with dask.config.set(scheduler=dask.config.get("scheduler", dask.threaded.get)):
            yield None
        return
    from distributed import Client, LocalCluster

    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=_TIMEOUT, set_as_default=False)
        except (OSError, ValueError) as error:
            raise OSError(f"no scheduler answers at {scheduler}: {error}") from None
        with client:
            yield client
        return
    from distributed.security import Security

    # Whoever reaches a scheduler or a worker can run code as this user: only who has the certificate made here does.
    guarded = {"protocol": "tls://", "host": "127.0.0.1", "security": Security.temporary(), "dashboard_address": None}
    with (
        dask.config.set({"distributed.worker.daemon": True} | {key: [] for key in _PAGES}),
        LocalCluster(n_workers=workers, threads_per_worker=1, silence_logs="ERROR", **guarded) as local,
        Client(local, set_as_default=False) as client,
    ):
        local.scheduler.http_server.stop()
        client.run(_without_pages)
        yield client


def results_of(client, futures):
    """
    Results of a cluster, in the order in which they come.

    Parameters
    ----------
    client : distributed.Client
    futures : dict of distributed.Future to object
        Emptied on the way. Futures that are left at the end are cancelled.

    Yields
    ------
    item : object
        Of the future.
    result : object

    Raises
    ------
    RuntimeError
        If a task has ended its workers too often.
    Exception
        Whatever a task raises.
    """
    from distributed import KilledWorker, as_completed  # there already, where a client is

    try:
        for future, result in as_completed(list(futures), loop=client.loop, with_results=True):
            yield futures.pop(future), result
            future.release()
    except KilledWorker as error:
        raise RuntimeError(f"{error}: has a worker too little memory? What is finished is kept, use --resume") from None
    finally:
        client.cancel(list(futures), force=True)


def _without_pages(dask_worker):
    dask_worker.http_server.stop()
